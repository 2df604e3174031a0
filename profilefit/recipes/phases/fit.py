"""Forms of a phase function fitted to a table: residuals in logarithms, moments kept or free, errors of constants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.media.phase import Phase, as_table, from_table
from profilefit.errors import InputError
from profilefit.fitting.discrepancy import FAILED, Residuals, of_residuals
from profilefit.fitting.estimate import JACKKNIFE_GROUPS, judged, misfit_covariance
from profilefit.fitting.solver import Solution, least_squares
from profilefit.laws.phases import FORMS, PhaseForm, backscattered
from profilefit.recipes.phases.data import PhaseData
from profilefit.recipes.schema import ERRORS

Floats = NDArray[np.float64]
MOMENTS = ("mean_cosine", "backscattered")  # that a fit may hold, in this order
MET = 1e-3  # of a moment, by which it may be missed
HELD = 1e4  # weight of a moment over that of a row: it is met to 1e-6
STARTS, SEED = 12, 1
TOGETHER = 2  # neighbouring rows that a refit of the jackknife leaves out together: their residuals are alike
BANDS = (0.0, 1.0, 10.0, 90.0, 180.0 + 1e-3)  # [degrees]; a row at an end belongs to the next
ROUNDING = 1e-6
ALL_ANGLES = (0.0, 180.0)


@dataclass(frozen=True)
class PhaseFit:
    """One form, fitted to a table.

    held       moments that it keeps;  range  of the angles that were fitted [degrees]
    constants  (c,) [-];  errors  (c,) by the names that records have for them, None where one does not apply
    phase      the fitted phase function
    rms        root mean square of ln(form / table) over those angles;  bands  the same between BANDS, NaN if empty
    """

    form: PhaseForm
    held: tuple[str, ...]
    range: tuple[float, float]
    best: Solution
    constants: Floats
    errors: dict[str, Floats | None]
    phase: Phase
    rms: float
    bands: tuple[float, ...]

    moments: tuple[float, float]
    """Mean cosine and backscattered share of the table [-]."""

    @property
    def result(self) -> str:
        """Result of the fit in words; a form whose few numbers cannot keep the moments says so."""
        own = self.mean_cosine, self.backscattered
        off = {name: abs(own[at] - self.moments[at]) for at, name in enumerate(MOMENTS) if name in self.held}
        missed = [name.replace("_", " ") for name, one in off.items() if one > MET * self.moments[MOMENTS.index(name)]]
        if not self.best.converged or not missed:
            return self.best.result
        return f"{' and '.join(missed)} cannot be kept by this form"

    @property
    def mean_cosine(self) -> float:
        """Mean cosine of the fitted phase function [-]."""
        return float(self.phase.mean_cosine)

    @property
    def backscattered(self) -> float:
        """Share that is turned by more than 90 degrees [-]."""
        return backscattered(self.phase)


def fit_phase(
    data: PhaseData,
    form: str,
    hold: Sequence[str] = (),
    angles: tuple[float, float] = ALL_ANGLES,
    seed: int = SEED,
) -> PhaseFit:
    """Fit the form nearest to a table, all rows alike in ln p (or by sigma, where the table has it), but for one at 0.

    form    a name of `FORMS`;  hold  of the table's mean cosine and backscattered share, those that are kept
    angles  of the rows that count [degrees]; moments are those of the whole table;  seed  of random starts
    InputError on another name, more moments than the form has numbers, or fewer rows than twice those.
    """
    if form not in FORMS:
        raise InputError(f"form must be one of {', '.join(FORMS)}, got {form!r}")
    own = FORMS[form]
    held = tuple(name for name in MOMENTS if name in hold)
    if unknown := [name for name in hold if name not in MOMENTS]:
        raise InputError(f"hold must be of {', '.join(MOMENTS)}, got {unknown[0]!r}")
    if len(held) > own.free:
        raise InputError(f"hold must be at most {own.free} of the moments for {form}, got {len(held)}")
    moments = data.mean_cosine, data.backscattered
    data = data.off_axis
    used = data.within(*angles)
    if np.count_nonzero(used) < 2 * own.free:
        raise InputError(
            f"angles must hold {2 * own.free} rows or more for {form}, got {np.count_nonzero(used)} "
            f"in {angles[0]:g} ... {angles[1]:g} degrees"
        )
    arrays = _arrays(data, used, moments)
    residual = _residual(form, held)
    random = np.random.default_rng(seed)
    found = [least_squares(residual, start, arrays) for start in own.starts(random, STARTS)]
    best = min(found, key=lambda one: (not one.converged, one.cost if np.isfinite(one.cost) else np.inf))
    best = judged(best, tuple(f"parameter {i + 1}" for i in range(own.free)))
    with jax.enable_x64(True):
        constants = np.asarray(own.constants(jnp.asarray(best.parameters)))
    phase = built(own, constants)
    off = np.log(phase.pdf(np.cos(data.angles)) / data.values)
    bands = tuple(_rms(off[used & data.within(low, high - ROUNDING)]) for low, high in pairwise(BANDS))
    errors = _errors(own, held, best, arrays, data, used)
    return PhaseFit(own, held, angles, best, constants, errors, phase, _rms(off[used]), bands, moments)


def built(form: PhaseForm, constants: Floats) -> Phase:
    """Return the checked phase function of constants (c,)."""
    return from_table(as_table(form.phase([float(one) for one in constants])))


def _rms(off: Floats) -> float:
    return float(np.sqrt(np.mean(off**2))) if off.size else float("nan")


def _arrays(data: PhaseData, used: NDArray[np.bool_], moments: tuple[float, float]) -> tuple[Floats, ...]:
    """Return cosines, ln values, weights whose squares have the mean 1, and moments."""
    weight = np.where(used, 1.0 if data.sigma is None else 1.0 / data.sigma, 0.0)
    weight = weight / np.sqrt(np.sum(weight**2) / np.count_nonzero(used))
    return np.cos(data.angles), np.log(data.values), weight, np.array(moments)


@lru_cache(maxsize=64)
def _residual(form: str, held: tuple[str, ...]) -> Callable[[Array, Any], Array]:
    """One function a question: a program is compiled for each."""
    own = FORMS[form]

    def residual(parameters: Array, data: Any) -> Array:
        cosine, level, weight, moments = data
        constants = own.constants(parameters)
        phase = own.phase(constants)
        off = weight * (jnp.log(phase.pdf(cosine)) - level)
        kept = {"mean_cosine": own.mean_cosine(constants), "backscattered": phase.invert(jnp.zeros(()))}
        rows = [HELD * (kept[name] - moments[MOMENTS.index(name)]) for name in held]
        return jnp.concatenate([off, jnp.stack(rows)]) if rows else off

    return residual


def _errors(
    form: PhaseForm,
    held: tuple[str, ...],
    best: Solution,
    arrays: tuple[Floats, ...],
    data: PhaseData,
    used: NDArray[np.bool_],
) -> dict[str, Floats | None]:
    """Return the errors of the constants (c,), by their names in records; NaN in each where the fit failed.

    statistical  of the table's own sigma, None where it has none;  discretisation  None: rows are no integrals
    model        the misfit as a random function of ln angle (`fitting.discrepancy`);  misfit  as if rows were
                 independent;  jackknife  refits without a sixth of the rows
    """
    if not best.converged:
        none = np.full(len(form.names), np.nan)
        absent = {"discretisation_error", *(() if data.sigma is not None else ("statistical_error",))}
        return {name: None if name in absent else none for name in ERRORS}
    cosine, _, weight, _ = arrays
    with jax.enable_x64(True):
        slope = np.asarray(jax.jacfwd(form.constants)(jnp.asarray(best.parameters)))
    gain = best.covariance @ (best.jacobian[: cosine.size] * weight[:, None]).T

    def spread(covariance: Floats) -> Floats:
        return np.sqrt(np.maximum(np.diag(slope @ covariance @ slope.T), 0.0))

    statistical = None if data.sigma is None else spread((gain * data.sigma**2) @ gain.T)
    rows = best.residuals[: cosine.size][used] / weight[used]
    process = of_residuals(
        Residuals(
            table=rows[None],
            live=np.ones((1, rows.size), bool),
            u=np.log(data.angles[used]),
            s=np.zeros(1),
            slope=(best.jacobian[: cosine.size][used] / weight[used, None])[None],
            noise=np.zeros((rows.size, 1, 1)) if data.sigma is None else data.sigma[used][:, None, None],
            influence=gain[:, None, used],
        )
    )
    model = spread(process.covariance) if process.result != FAILED else np.full(len(form.names), np.nan)
    return {
        "statistical_error": statistical,
        "discretisation_error": None,
        "model_error": model,
        "misfit_error": spread(misfit_covariance(best)),
        "jackknife_error": _jackknife(form, held, best, arrays, used),
    }


def _jackknife(
    form: PhaseForm, held: tuple[str, ...], best: Solution, arrays: tuple[Floats, ...], used: NDArray[np.bool_]
) -> Floats:
    """Return the standard errors of a grouped jackknife over rows (Efron, The Jackknife, 1982, ch. 2).

    They are NaN where a refit fails.
    """
    cosine, level, weight, moments = arrays
    group = np.where(used, (np.cumsum(used) - 1) // TOGETHER % JACKKNIFE_GROUPS, -1)
    moved = []
    for number in range(JACKKNIFE_GROUPS):
        again = least_squares(
            _residual(form.name, held), best.parameters, (cosine, level, weight * (group != number), moments)
        )
        with jax.enable_x64(True):
            own = np.asarray(form.constants(jnp.asarray(again.parameters)))
        moved.append(own if again.converged else np.full(own.shape, np.nan))
    apart = np.array(moved) - np.mean(moved, axis=0)
    return np.sqrt((JACKKNIFE_GROUPS - 1) / JACKKNIFE_GROUPS * np.sum(apart**2, axis=0))
