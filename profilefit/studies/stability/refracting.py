"""Exact light where surfaces refract, and in stacks, in float64: alpha up to 1, radii and layers at both ends.

The half space is judged by half as many nodes again, next to the source by its limit, and where n tends to 1 by the
closed form there. Plates are judged by all that is known of them without their equation: nothing is lost where nothing
is absorbed, thick ones are the half space, thin ones scatter once; and their profiles by more nodes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.exact.single_scattering import source_strength
from mcml_sim.exact.stack import solution
from profilefit.studies.stability import halfspace, layout
from profilefit.studies.stability.cells import Cells, absolute, judged, relative, steps_down
from profilefit.studies.stability.layout import CDF, FLOAT64, PROFILE, REFLECTANCE_OF, ArgumentAxis

Floats = NDArray[np.float64]
BARELY = 1.0 + 1e-9  # an index that hardly refracts
SETTINGS = (Setting(n=BARELY), Setting(n=1.4), Setting("diffuse", n=3.0))
# What the docstrings of `exact` and of `exact.solve` promise.
BOUNDS = {PROFILE: 1e-7, CDF: 2e-7, REFLECTANCE_OF: 1e-7}
SURE_ALPHA, SURE_X, NEAREST = (0.05, 0.999), (1e-3, 15.0), 1e-6
AT_SOURCE = 1e-4  # relative, closer than NEAREST
PLATE_ALPHA = (0.0, 0.05, 0.5, 0.9, 0.99, 0.999, 1.0 - 1e-6, 1.0)
THICKNESS = (1e-3, 0.03, 0.5, 3.0, 30.0, 1e3)  # [mfp]
PLATE_INDEX = (1.0, 1.4, 3.0)
PROFILED = (1e-2, 1.5, 1e3)  # thicknesses, of alpha 0.9 and n = 1.4
PROFILE_BOUND, THIN_BOUND, THIN, SEEN = 1e-5, 1e-2, 1.0, 1e-3  # SEEN of R_d at one mfp
PLATE_X = (0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 100.0, 1e6, np.inf)


def cells_of() -> Iterator[Cells]:
    """Half spaces by albedo and radius, plates by albedo and thickness, and the profile of some of them."""
    for setting in SETTINGS:
        yield from _half_space(setting)
    for n in PLATE_INDEX:
        yield plates(n)
    yield _profiles()


def _half_space(setting: Setting) -> Iterator[Cells]:
    alpha, x = layout.alpha(np.float64), layout.radius(np.float64)
    a, r = alpha.values[:, None], x.values[None]
    closed = Setting(setting.illumination)
    with np.errstate(all="ignore"):
        profile = np.asarray(exact.profile(r, a, setting=setting))
        if setting.n == BARELY:
            error = relative(profile, np.asarray(exact.profile(r, a, setting=closed)))
        else:
            error = np.asarray(exact.error_estimate(r, a, setting=setting))
        limit = np.where(r == 0, np.inf, a * source_strength(setting) / (2 * np.pi * r))
    near = (r < NEAREST) & (a >= SURE_ALPHA[0]) & (a <= SURE_ALPHA[1])
    error = np.where(near, relative(profile, limit) * BOUNDS[PROFILE] / AT_SOURCE, error)
    bound = BOUNDS[PROFILE] if setting.n != BARELY else 1e-6
    promised = near | _within(a, SURE_ALPHA) & _within(r, SURE_X)
    yield _cells(_name(setting), PROFILE, (alpha, x), profile, np.where(near, limit, profile), error, bound, promised)
    cdf = np.asarray(exact.cdf(r, a, setting=setting))
    finer = np.asarray(exact.cdf(r, a, setting=closed)) if setting.n == BARELY else halfspace.finer_cdf(
        x.values, alpha.values, setting)[..., 0]  # fmt: skip
    everywhere = _within(a, SURE_ALPHA) & np.ones_like(r, bool)
    falls = steps_down(cdf, 1, np.float64, BOUNDS[CDF] / np.finfo(float).eps / 16.0)
    yield _cells(_name(setting), CDF, (alpha, x), cdf, finer, absolute(cdf, finer), BOUNDS[CDF], everywhere, falls)


def plates(n: float) -> Cells:
    """A of one layer, judged by what holds without its equation."""
    alpha = ArgumentAxis("α", "-", np.array(PLATE_ALPHA))
    thickness = ArgumentAxis("thickness", "mfp", np.array(THICKNESS))
    solved = [[exact.solve(plate(a, d, n)) for d in THICKNESS] for a in PLATE_ALPHA]
    finer = [[exact.solve(plate(a, d, n), nodes=solution.FINE) for d in THICKNESS] for a in PLATE_ALPHA]
    value, reference = (np.array([[one.reflectance for one in row] for row in all]) for all in (solved, finer))
    error = relative(value, reference)
    entered = 1.0 - np.array([[one.specular for one in row] for row in solved])
    whole = value + 1.0 - entered + np.array([[one.transmittance for one in row] for row in solved])
    error[-1] = np.maximum(error[-1], np.abs(whole[-1] - 1.0))
    deep = np.array([exact.reflectance(a, Setting(n=n)) for a in PLATE_ALPHA[1:-2]])
    error[1:-2, -1] = np.maximum(error[1:-2, -1], relative(value[1:-2, -1], deep))
    if n == 1.0:  # half of what a thin plate scatters comes back; the next order is d ln d of it
        thin = value[:, 0] - np.array(PLATE_ALPHA) * THICKNESS[0] / 2
        error[:, 0] = np.maximum(error[:, 0], np.where(np.abs(thin) > 0.02 * value[:, 0], np.abs(thin), 0.0))
    falls = steps_down(value, 0, np.float64) | steps_down(value, 1, np.float64) & (n == 1.0)
    inside = np.ones(value.shape, bool)
    return _cells(f"stack, n = {n:g}", REFLECTANCE_OF, (alpha, thickness), value, reference, error,
                  BOUNDS[REFLECTANCE_OF], inside, falls)  # fmt: skip


def plate(alpha: float, thickness: float, n: float) -> Medium:
    """One layer of one mean free path in one unit of length."""
    return Medium((Layer(n, 1.0 - alpha, alpha, 0.0, thickness),))


def _profiles() -> Cells:
    x, thickness = ArgumentAxis("r/l", "-", np.array(PLATE_X)), ArgumentAxis("thickness", "mfp", np.array(PROFILED))
    media = [plate(0.9, d, 1.4) for d in PROFILED]
    value, finer = (np.array([exact.solve(one, nodes=nodes).profile(PLATE_X) for one in media])
                    for nodes in (solution.STANDARD, solution.FINE))  # fmt: skip
    seen = finer > SEEN * finer[:, [PLATE_X.index(1.0)]]
    error = relative(value, finer) * np.where(thickness.values[:, None] < THIN, PROFILE_BOUND / THIN_BOUND, 1.0)
    return _cells("stack, n = 1.4", PROFILE, (thickness, x), value, finer, error, PROFILE_BOUND,
                  seen & (x.values >= SURE_X[0]) | (x.values == 0))  # fmt: skip


def _within(values: Floats, ends: tuple[float, float]) -> NDArray[np.bool_]:
    return (values >= ends[0]) & (values <= ends[1])


def _name(setting: Setting) -> str:
    return f"exact, n = {setting.n:.10g}" + ("" if setting.illumination == "searchlight" else ", diffuse light")


def _cells(
    name: str, quantity: str, axes: tuple[ArgumentAxis, ...], value, reference, error, bound: float, inside,
    wrong_way=None,
) -> Cells:  # fmt: skip
    codes = judged(value, reference, error, bound, inside, np.float64, wrong_way=wrong_way)
    return Cells(name, True, quantity, FLOAT64, axes, value, reference, error, bound, inside, codes)
