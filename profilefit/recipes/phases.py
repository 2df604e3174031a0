"""Phase functions fitted to a measured one: its table as text, forms fitted in logarithms, moments kept or free.

    angle [deg], value [1/(m sr)], sigma [1/(m sr)]      sigma, a standard error, may be left out

Cells are separated by commas; a # starts a comment. Values may have any scale: a density per steradian, 4 pi times
that, or a volume scattering function in 1/(m sr). They are divided by their integral over all directions, which is
then the scattering coefficient b. `spans` say how much of that integral lies at angles without rows.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from pydantic import model_validator

from mcml_sim.files.whole_file import read_whole, text_of
from mcml_sim.media.arrays import Floats, as_number, require
from mcml_sim.media.phase import Phase, Tabulated, as_table, from_table
from mcml_sim.results.mci import quoted
from profilefit.errors import InputError
from profilefit.fitting.discrepancy import FAILED, Residuals, of_residuals
from profilefit.fitting.estimate import JACKKNIFE_GROUPS, jackknife_error, judged, misfit_covariance
from profilefit.fitting.solver import Solution, least_squares
from profilefit.laws.phases import FORMS, PhaseForm, backscattered
from profilefit.recipes.declared import Declared, OneOf, Refused, words
from profilefit.recipes.record import ERRORS

MAX_BYTES = 2**20
MOST_ROWS, FEWEST_ROWS = 5000, 8
# Of values, and of the factor that brings them to an integral of 1.
UNITS = {"": "", "1/sr": "", "sr^-1": ""}
UNITS |= {text: f"1/{unit}" for unit in ("m", "cm", "mm") for text in (f"1/({unit} sr)", f"{unit}^-1 sr^-1")}
HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
ACCEPTED = "angle [deg], value [1/sr] or [1/(m sr)] and, if known, sigma"
LEAST_DEGREES = 7.0  # more than 2 pi: a table that ends before is one in radians
WIDEST = 20.0  # [degrees] between rows; wider gaps are named
MOST_SHARE = 1e3  # beyond which a rule estimates nothing
SPAN = ("low", "high", "share", "rule", "other", "other_rule")


class PhaseColumns(Declared):
    """Columns of a phase function's table: the unit of each, "" for none; headers name them in any case."""

    angle: Annotated[str, OneOf("", "deg", "degrees"), words(
        "in deg, degrees or without a unit", cells="an angle in [0, 180] degrees that rises", spellings="angle",
    )]  # fmt: skip
    value: Annotated[str, OneOf(*UNITS), words(
        f"in {', '.join(filter(None, UNITS))} or without a unit", cells="a value > 0", spellings="value",
    )]  # fmt: skip
    sigma: Annotated[str, words("in the unit of value or without a unit", cells="a sigma > 0", spellings="sigma")] = ""

    @model_validator(mode="after")
    def _of_one_unit(self) -> Self:
        """Refuse errors in another unit than that of the values."""
        if self.sigma not in ("", self.value):
            raise Refused(f"in the unit of value, {self.value or 'none'}, or without a unit", self.sigma, "sigma")
        return self


COLUMNS = PhaseColumns.model_json_schema()["properties"]
NAMES = {spelling: name for name, column in COLUMNS.items() for spelling in column["spellings"].split(", ")}


@dataclass(frozen=True)
class PhaseData:
    """Phase function read from a table.

    Attributes:
        source: source of the numbers, in words.
        digest: SHA-256 of their file.
        angles: (n,) [rad], rising, >= 0.
        values: (n,) [1/sr], > 0, brought to an integral of 1.
        sigma: (n,) relative standard errors [-], or None.
        integral: integral of the values as read, in `unit`.
        unit: unit of the integral, 1/m where the values had 1/(m sr), none where they had 1/sr or no unit.
        spans: angles without rows: below the first angle > 0, between rows more than `WIDEST` apart, and beyond the
            last angle: `low`, `high` [degrees]; `share` of the integral by the `rule` of `Tabulated`, in words, and
            `other` by `other_rule`, which is as likely [-].
    """

    source: str
    digest: str
    angles: Floats
    values: Floats
    sigma: Floats | None
    integral: float
    unit: str
    spans: list[dict[str, Any]]

    @cached_property
    def table(self) -> Tabulated:
        """The phase function of the rows themselves."""
        return Tabulated(self.angles, self.values)

    @property
    def mean_cosine(self) -> float:
        """Mean cosine of the table [-]."""
        return float(self.table.mean_cosine)

    @property
    def backscattered(self) -> float:
        """Share that is turned by more than 90 degrees [-]."""
        return float(self.table.invert(0.0))

    @property
    def off_axis(self) -> PhaseData:
        """Rows at angles > 0: at 0 degrees forms may be infinite, and ln angle is."""
        seen = self.angles > 0
        sigma = None if self.sigma is None else self.sigma[seen]
        return replace(self, angles=self.angles[seen], values=self.values[seen], sigma=sigma)

    def within(self, low: float, high: float) -> NDArray[np.bool_]:
        """Return a mask (n,) of the rows at angles low ... high [degrees]."""
        degrees = np.degrees(self.angles)
        return (degrees >= low - 1e-9) & (degrees <= high + 1e-9)


def read_phase(path: Path) -> PhaseData:
    """Read the table of a phase function; InputError in one line names file, line, and what is accepted."""
    content = read_whole(path, MAX_BYTES)
    lines = text_of(path, content, MAX_BYTES, "a phase function").splitlines()
    texts = {at: line.partition("#")[0].strip() for at, line in enumerate(lines, start=1)}
    (first, header), *rows = [(at, text) for at, text in texts.items() if text] or [(0, "")]
    if not header:
        raise InputError(f"{path}: expected a header of {ACCEPTED}, got an empty file")
    units = _header(path, first, header)
    if not FEWEST_ROWS <= len(rows) <= MOST_ROWS:
        raise InputError(f"{path}: expected {FEWEST_ROWS} to {MOST_ROWS} rows under the header, got {len(rows)}")
    table = [_row(path, at, text, units) for at, text in rows]
    column = dict(zip(units, np.array(table).T, strict=True))
    degrees, values, sigma = column["angle"], column["value"], column.get("sigma")
    for (at, _), before, angle, value in zip(rows, [-1.0, *degrees[:-1]], degrees, values, strict=True):
        if not 0 <= angle <= 180 or angle <= before:
            raise InputError(f"{path}:{at}: expected {COLUMNS['angle']['cells']}, got {angle:g}")
        if not value > 0:
            raise InputError(f"{path}:{at}: expected {COLUMNS['value']['cells']}, got {value:g}")
    if degrees[-1] < LEAST_DEGREES:
        got = f"{degrees[-1]:g} at most: radians times 180 / pi"
        raise InputError(f"{path}: expected angles in degrees up to 180, got {got}")
    if sigma is not None and not np.all(sigma > 0):
        at, wrong = rows[int(np.argmin(sigma > 0))][0], COLUMNS["sigma"]["cells"]
        raise InputError(f"{path}:{at}: expected {wrong}, got {sigma.min():g}")
    angles = np.radians(degrees)
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = Tabulated.through(angles, values)
        integral = pieces.total
    if angles[0] > 0 and pieces.slope[0] <= -1:
        expected = "first rows that rise towards 0 degrees slower than angle^-2, which has an integral"
        got = f"angle^{2 * pieces.slope[0]:.3g}: a row at 0 degrees ends the rise"
        raise InputError(f"{path}: expected {expected}, got {got}")
    if not 0 < integral < np.inf:
        raise InputError(f"{path}: expected values whose integral is finite and > 0, got {integral:g}")
    relative, density = None if sigma is None else sigma / values, values / integral
    digest, unit = hashlib.sha256(content).hexdigest(), UNITS[units["value"]]
    return PhaseData(str(path), digest, angles, density, relative, integral, unit, _spans(angles, density))


def _spans(angles: Floats, values: Floats) -> list[dict[str, Any]]:
    """Spans without rows, of rows (n,) in [rad] and [1/sr] whose integral is 1."""
    u, f, t = 2 * np.sin(angles / 2) ** 2, 2 * np.pi * values, np.linspace(0.0, 1.0, 1001)
    below = Tabulated.through(angles, values).below(u)
    if angles[0] > 0:
        found = [(0.0, angles[0], below[0], "the first rows' power law", u[0] * f[0], "the first value")]
    else:  # a peak is rounded at 0, or it is not and holds less
        sharp = np.trapezoid(f[0] * (f[1] / f[0]) ** t * np.sin(angles[1] * t), angles[1] * t)
        found = [(0.0, angles[1], below[1], "p linear in 1 - cosine", sharp, "ln p linear in the angle")]
    for at in np.flatnonzero((np.diff(angles) > np.radians(WIDEST) + 1e-9) & (angles[:-1] > 0)):
        line = (u[at + 1] - u[at]) * (f[at] + f[at + 1]) / 2
        rules = "ln p linear in ln(1 - cosine)", "p linear in 1 - cosine"
        found.append((angles[at], angles[at + 1], below[at + 1] - below[at], rules[0], line, rules[1]))
    if u[-1] < 2:
        # Noise of two rows side by side would decide the law.
        first = int(np.clip(np.searchsorted(angles, angles[-1] - np.radians(WIDEST) - 1e-9), 1, u.size - 2))
        on, slope = u[-1] * (2 / u[-1]) ** t, np.log(f[-1] / f[first]) / np.log(u[-1] / u[first])
        with np.errstate(over="ignore"):
            power = min(np.trapezoid(f[-1] * (on / u[-1]) ** slope, on), MOST_SHARE)
        other = f"the power law of the last {WIDEST:g} degrees"
        found.append((angles[-1], np.pi, 1 - below[-1], "the last value", power, other))
    return [dict(zip(SPAN, (np.degrees(low), np.degrees(high), *rest), strict=True)) for low, high, *rest in found]


def _header(path: Path, at: int, line: str) -> dict[str, str]:
    """Return units by the names of columns, checked by `PhaseColumns`."""
    units: dict[str, str] = {}
    for cell in line.split(","):
        match = HEADING.fullmatch(cell.strip())
        name = NAMES.get(match["name"].strip().lower(), "") if match else ""
        if match is None or not name or name in units:
            raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {quoted(cell.strip())}")
        units[name] = " ".join((match["unit"] or "").split())
    if "angle" not in units or "value" not in units:
        raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {quoted(line)}")
    PhaseColumns.of(f"{path}:{at}", units)
    return units


def _row(path: Path, at: int, text: str, names: Collection[str]) -> list[float]:
    """Return the numbers of a row, one for each column."""
    cells = text.split(",")
    numbers = [as_number(cell) for cell in cells]
    if len(cells) != len(names):
        raise InputError(f"{path}:{at}: expected {len(names)} cells, as the header has, got {len(cells)}")
    for name, cell, number in zip(names, cells, numbers, strict=True):
        if not math.isfinite(number):
            raise InputError(f"{path}:{at}: column {name}: expected a finite number, got {quoted(cell.strip())}")
    return numbers


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

    held       moments that it keeps;  moments  mean cosine and backscattered share of the table [-]
    constants  (c,) [-];  errors  (c,) by the names that records have for them, None where one does not apply
    phase      the fitted phase function
    rms        root mean square of ln(form / table) over the angles that were fitted
    bands      the same between BANDS, NaN if empty
    """

    form: PhaseForm
    held: tuple[str, ...]
    best: Solution
    constants: Floats
    errors: dict[str, Floats | None]
    phase: Phase
    rms: float
    bands: tuple[float, ...]
    moments: tuple[float, float]

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
    data: PhaseData, form: str, hold: Sequence[str] = (), angles: tuple[float, float] = ALL_ANGLES, seed: int = SEED
) -> PhaseFit:
    """Fit the form nearest to a table, all rows alike in ln p (or by sigma, where the table has it), but for one at 0.

    form    a name of `FORMS`;  hold  of the table's mean cosine and backscattered share, those that are kept
    angles  of the rows that count [degrees]; moments are those of the whole table;  seed  of random starts
    InputError on another name, more moments than the form has numbers, or fewer rows than twice those.
    """
    require(form in FORMS, "form", f"one of {', '.join(FORMS)}", form)
    own = FORMS[form]
    held = tuple(name for name in MOMENTS if name in hold)
    if unknown := [name for name in hold if name not in MOMENTS]:
        raise InputError(f"hold must be of {', '.join(MOMENTS)}, got {unknown[0]!r}")
    require(len(held) <= own.free, "hold", f"at most {own.free} of the moments for {form}", len(held))
    moments = data.mean_cosine, data.backscattered
    data = data.off_axis
    used = data.within(*angles)
    if np.count_nonzero(used) < 2 * own.free:
        got = f"{np.count_nonzero(used)} in {angles[0]:g} ... {angles[1]:g} degrees"
        raise InputError(f"angles must hold {2 * own.free} rows or more for {form}, got {got}")
    weight = np.where(used, 1.0 if data.sigma is None else 1.0 / data.sigma, 0.0)
    weight = weight / np.sqrt(np.sum(weight**2) / np.count_nonzero(used))
    arrays = np.cos(data.angles), np.log(data.values), weight, np.array(moments)
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
    return PhaseFit(own, held, best, constants, errors, phase, _rms(off[used]), bands, moments)


def built(form: PhaseForm, constants: Floats) -> Phase:
    """Return the checked phase function of constants (c,)."""
    return from_table(as_table(form.phase([float(one) for one in constants])))


def _rms(off: Floats) -> float:
    return float(np.sqrt(np.mean(off**2))) if off.size else float("nan")


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


Arrays = tuple[Floats, ...]  # cosines, ln values, weights whose squares have the mean 1, and moments
Mask = NDArray[np.bool_]


def _errors(
    form: PhaseForm, held: tuple[str, ...], best: Solution, arrays: Arrays, data: PhaseData, used: Mask
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


def _jackknife(form: PhaseForm, held: tuple[str, ...], best: Solution, arrays: Arrays, used: Mask) -> Floats:
    """Return the standard errors of a grouped jackknife over rows; NaN where a refit fails."""
    cosine, level, weight, moments = arrays
    group = np.where(used, (np.cumsum(used) - 1) // TOGETHER % JACKKNIFE_GROUPS, -1)
    moved = []
    for number in range(JACKKNIFE_GROUPS):
        fewer = cosine, level, weight * (group != number), moments
        again = least_squares(_residual(form.name, held), best.parameters, fewer)
        with jax.enable_x64(True):
            own = np.asarray(form.constants(jnp.asarray(again.parameters)))
        moved.append(own if again.converged else np.full(own.shape, np.nan))
    return jackknife_error(moved)
