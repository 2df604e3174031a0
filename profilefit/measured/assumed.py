"""What a fit takes for granted where nobody says otherwise, and what that is worth: a pencil beam, n = 1 and g = 0.

Whether the data know of a beam that has a width, and what width would matter: the fit is repeated under Gaussian beams
of widths from a five-hundredth of the last radius to half of it. If chi-square falls by more than a pencil beam's noise
explains at 5 %, one-sided since a width is not negative, the data know of the width. Where a pencil beam leaves a lack
of fit, the noise has the lack of fit that the best width leaves: none if the width explains all of it. How far the
answer moves under the narrowest beam that moves it, as w^2, says which width would move it by a standard error.

What n and g of soft tissue would make of the same data: the fit is repeated once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.measured import model
from profilefit.measured.beam import Gaussian
from profilefit.measured.exact_light import exact_light
from profilefit.measured.fitting import MediumFit
from profilefit.measured.solving import Minimum, Problem, descended, descended_from

Floats = NDArray[np.float64]
HALVINGS = 9  # of the widths that are tried, from half the last radius
FINER = 3  # further trials between the best and its neighbours
NOTICED = 0.05  # chance below which a width is said to be seen
TISSUE = {"n": 1.4, "g": 0.9}


@dataclass(frozen=True)
class BeamWidth:
    """What a Gaussian beam would do to a fit that assumes a pencil beam.

    w        the 1/e^2 radius that explains the data best [unit of r]; fall how much chi-square falls there, by errors
             with the lack of fit that is left; chance how often noise lets it fall as much
    telling  the 1/e^2 radius that moves `moved`, a quantity, by one of its standard errors [unit of r]; None if no
             width does
    """

    w: float
    fall: float
    chance: float
    telling: float | None
    moved: str

    @property
    def noticed(self) -> bool:
        return self.chance < NOTICED


def beam_width(fit: MediumFit) -> BeamWidth | None:
    """None where a beam is given, or where the fit has no errors to compare with."""
    if fit.spec.instrument.beam is not None or not fit.minimum.converged:
        return None
    plain = fit.plain or fit
    fits = _under_widths(plain.problem, plain.minimum)
    best = _best(fits)
    if fit.plain is not None and best > 0 and (lack := _lack(fit.plain, best, fits[best])) is not None:
        problem = replace(plain.problem, noise=replace(plain.problem.noise, lack=lack))
        fits = _under_widths(problem, descended(problem, plain.point, plain.spec.free))
        best = _best(fits)
    fall = max(_cost(fits[0.0]) - _cost(fits[best]), 0.0)
    chance = 0.5 * float(stats.chi2.sf(fall, 1)) if fall > 0 else 1.0
    if fit.plain is not None:
        fits = _under_widths(fit.problem, fit.minimum)
    return BeamWidth(best, fall, chance, *_telling(fit, {w: fits[w] for w in _widths(fit.problem)}))


def _widths(problem: Problem) -> list[float]:
    return list(0.5 * problem.data.r[-1] * 0.5 ** np.arange(HALVINGS - 1.0, -1.0, -1.0))


def _under_widths(problem: Problem, pencil: Minimum) -> dict[float, Minimum]:
    """Fits under Gaussian beams by 1/e^2 radius: of the widths that are tried, the pencil beam's, and near the best."""
    fits, start = {0.0: pencil}, pencil
    for w in _widths(problem):
        start = _under(problem, w, start)
        fits[w] = start
    for _ in range(FINER):
        best, tried = _best(fits), sorted(fits)
        at = tried.index(best)
        for low, high in ((best, tried[min(at + 1, len(tried) - 1)]), (tried[max(at - 1, 0)], best)):
            between = float(np.sqrt(low * high))
            if between > 0 and between not in fits:
                fits[between] = _under(problem, between, fits[best])
    return fits


def _best(fits: dict[float, Minimum]) -> float:
    return min(fits, key=lambda w: _cost(fits[w]))


def _lack(plain: MediumFit, w: float, there: Minimum) -> Floats | None:
    """Covariance of the lack of fit that the best width leaves; None if it leaves none."""
    known = {} if plain.range_marginal is None else plain.range_marginal.mean
    spec = replace(plain.spec, ranges={**plain.spec.ranges, "beam": (0.0, 0.5 * float(plain.data.r[-1]))})
    problem = replace(plain.problem, spec=spec).under({"beam": w})
    return replace(plain, problem=problem, minimum=there).lack_of_fit({**known, "beam": w})


@dataclass(frozen=True)
class Tissue:
    """The same data under n and g of soft tissue, where these are assumed.

    values  of the quantities; rise  of chi-square
    """

    setting: Setting
    values: dict[str, float]
    rise: float


def as_tissue(fit: MediumFit) -> Tissue | None:
    """None where n and g are told, where a law is fitted, or where the fit has no errors to compare with."""
    spec = fit.spec
    there = Setting.of(spec.law.setting.as_table() | {name: TISSUE[name] for name in spec.assumed})
    if not (spec.assumed and there.is_solved and isinstance(spec.law, ExactLight) and fit.minimum.converged):
        return None
    plain = fit.plain or fit
    problem = replace(plain.problem, spec=replace(spec, law=exact_light(there)))
    try:
        end = descended_from(problem, plain.point)
    except InputError:  # a total reflectance is held that such a medium has not
        return None
    values = model.quantities(end.point[None], np.zeros(1))
    return Tissue(there, {name: float(value[0]) for name, value in values.items()}, end.cost - plain.minimum.cost)


def _under(problem: Problem, w: float, start: Minimum) -> Minimum:
    instrument = replace(problem.spec.instrument, beam=Gaussian(w))
    there = replace(problem, spec=replace(problem.spec, instrument=instrument))
    return descended(there, start.point, problem.spec.free)


def _cost(one: Minimum) -> float:
    return one.cost if np.isfinite(one.cost) else np.inf


def _telling(fit: MediumFit, fits: dict[float, Minimum]) -> tuple[float | None, str]:
    """The least width that moves a quantity by its standard error, and the quantity."""
    here = fit.values
    errors = {name: error for name, error in fit.errors(fit.total_covariance).items() if error > 0 and name != "A"}
    for w, one in fits.items():
        values = model.quantities(one.point[None], np.zeros(1))  # A, which alpha has already, is not looked at
        moved = {name: abs(float(values[name][0]) - here[name]) / error for name, error in errors.items()}
        name = max(moved, key=lambda each: moved[each], default="")
        if name and moved[name] > 1.0:
            return w / float(np.sqrt(moved[name])), name
    return None, ""
