"""Light solved exactly: no photons, no noise.

    import jax
    from mcml_sim import Layer, Medium, Setting, exact

    exact.profile([0.1, 1.0], 0.9)  # semi-infinite medium, numpy, float64
    exact.profile([0.1, 1.0], 0.9, setting=Setting(n=1.4))  # refracting interface, n >= 1
    exact.profile([0.1, 1.0], 0.9, setting=Setting(n=1.4, g=0.9))  # n 1.33 to 1.45, g to .95
    with jax.enable_x64(True):
        jax.jit(jax.grad(exact.profile, argnums=1))(1.0, 0.9)  # jax

    layers = Layer(1.4, 0.2, 20.0, 0.0, 0.01), Layer(1.4, 0.03, 18.0, 0.0)
    light = exact.solve(Medium(layers))
    light.reflectance, light.profile([0.01, 0.1])

`transform` has the transform of the profile where n = 1, `cone` and `refracting` where n > 1, `by_albedo` its inverse,
`forwards` the table where g > 0, `stack` the layers, all with their sources. `alpha` is the reduced albedo
mu_s' / (mu_s' + mu_a) and `mfp` the transport mean free path 1 / (mu_s' + mu_a), mu_s' = (1 - g) mu_s, whatever g.

Every function of the half space takes lengths in any one unit with `mfp` in that unit, and broadcasts `r` (or `xi`)
against `alpha`. Numbers, lists and numpy arrays give float64 numpy arrays, a float for scalars; what is out of range is
an InputError. An albedo's transform is kept, so that further radii cost little. An index other than 1 needs a table,
which takes some seconds (a minute for derivatives by n, compilation included) and is kept in the user's cache folder.
Where an argument is a jax array, concrete or traced, so is the answer, which can be jitted, vmapped and differentiated
in every argument but the kind of light, forwards and backwards: by n where `Setting.n` is a jax array. Double precision
must be on then (`jax.enable_x64(True)`), and what is out of range gives nan. Derivatives by alpha are infinite at
alpha = 1, where everything is smooth in sqrt(1 - alpha) only: A is A(1) - c sqrt(1 - alpha) there.

Relative error of `profile` where n = 1, for alpha in [0.05, 1]: below 1e-10 for r in [1e-3, 35] mfp, below 2e-7 up to
100 mfp, where the profile of alpha = 0.05 has fallen to 1e-51. Where 1 < n <= 3, for alpha in [0.05, 0.999]: below 1e-7
for r in [1e-3, 15] mfp; where alpha = 1 and r > 1000 mfp it is taken for its power, r^-3. Closer than 1e-6 mfp to the
source the profile is taken for its own limit, alpha / (4 pi r) where n = 1, which is 1e-5 off at most, and 1e-4 under
other surfaces. Absolute error of `cdf` where g = 0: below 1e-10 where n = 1, else below 2e-7, so that `quantile` of
shares that are that close to 1 is too large there. `error_estimate` says what more nodes would change.

Relative error of the table, g > 0, from .05 to 15 l* against photons where n = 1.4 (`benchmarks/half_spaces.py`): A
below 3e-4, 1.3e-3 where g = .95; rings, where alpha' >= .5 and g <= .9, mostly below .5 %, which is what 1e8 to 6e8
photons know; up to 5 % far from the source of darker media, 9 % where g = .95. `cdf` is that of the profile's own
light, which is A to within 8e-4, and 3.2e-3 in white media (alpha' > .999).
"""

from mcml_sim.exact.half_space import FINER, cdf, decay_rate, error_estimate, profile, quantile, reflectance
from mcml_sim.exact.stack.quadrature import Nodes
from mcml_sim.exact.stack.solution import Solution, solve
from mcml_sim.media.setting import SEARCHLIGHT

__all__ = [
    "FINER",
    "SEARCHLIGHT",
    "Nodes",
    "Solution",
    "cdf",
    "decay_rate",
    "error_estimate",
    "profile",
    "quantile",
    "reflectance",
    "solve",
]
