"""The index-matched, isotropic half space solved exactly: no photons, no noise.

    import jax
    from mcml_sim import exact

    exact.profile([0.1, 1.0], 0.9)                                  # numpy, float64
    with jax.enable_x64(True):
        jax.jit(jax.grad(exact.profile, argnums=1))(1.0, 0.9)       # jax

How: `transform` has the transform of the profile, `hankel` its inverse, both with their sources.

Every function takes lengths in any one unit with `mfp` in that unit, and broadcasts `r` (or `xi`) against `alpha`.
Numbers, lists and numpy arrays give float64 numpy arrays, a float for scalars; what is out of range is an InputError.
An albedo's transform is kept, so that further radii cost little. Where an argument is a jax array, concrete or traced,
so is the answer, which can be jitted, vmapped and differentiated in every argument but `setting`, forwards and
backwards; double precision must be on then (`jax.enable_x64(True)`), and what is out of range gives nan. Derivatives by
alpha are infinite at alpha = 1, where everything is smooth in sqrt(1 - alpha) only: A is 1 - c sqrt(1 - alpha) there.

Relative error of `profile`, for alpha in [0.05, 1]: below 1e-10 for r in [1e-3, 35] mfp, below 2e-7 up to 100 mfp,
where the profile of alpha = 0.05 has fallen to 1e-51. Closer than 1e-6 mfp to the source the profile is taken for its
own limit, alpha / (4 pi r), which is 1e-5 off at most. Absolute error of `cdf`: below 1e-10. `error_estimate` says what
more nodes would change.
"""

from mcml_sim.exact.half_space import (
    ARGUMENTS,
    FINER,
    SEARCHLIGHT,
    cdf,
    decay_rate,
    error_estimate,
    profile,
    quantile,
    reflectance,
)

__all__ = [
    "ARGUMENTS",
    "FINER",
    "SEARCHLIGHT",
    "cdf",
    "decay_rate",
    "error_estimate",
    "profile",
    "quantile",
    "reflectance",
]
