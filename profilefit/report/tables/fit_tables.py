"""A fit of one's own data as tables, and in sentences what it can and cannot tell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from profilefit.measured.misfit import DETECTED
from profilefit.measured.model import QUANTITIES, correlation, unit_of
from profilefit.measured.optimal_design import REFERENCE_ERROR, REPEATS, Candidate
from profilefit.measured.result import Answer, known_medium
from profilefit.report.tables.cells import ABSENT, column_table, interval, on_the_point, significant, to_error

HELD, EDGE = "held", "edge"
SHARES = ("A", "alpha")  # which end at 1
# tests/physics/measured/test_replicates.py: 3 to 10 replicates of 8 to 40 rows, of equal or uneven scatter.
HELD_IN = "tried on made-up replicates, such intervals hold in 93 to 98 %"
TINIEST = 1e-16  # chance that is worth printing
CAPTION = "± data: the data's own errors; ± law: the law's distance from the truth, taken for waves along ln r"


def fit_tables(result: Answer, title: str) -> list[RenderableType]:
    """What was found, how well it is told apart, and what would tell more."""
    parts: list[RenderableType] = [_quantity_table(result, title)]
    if result.identifiability is not None:
        if len(result.identified) > 1:
            parts.append(_correlation_table(result))
        parts.append(_advice_table(result))
    return parts


def fit_lines(result: Answer) -> list[Text]:
    """A sentence each on goodness, misfit, what the data cannot tell, and what was done to them."""
    return [Text(line) for line in _lines(result)]


def _quantity_table(result: Answer, title: str) -> RenderableType:
    found, names = result.found, QUANTITIES
    data = found.errors(found.statistical) if result.identified else {}
    law = found.errors(found.of_law) if found.rel is not None and result.identified else {}
    moving = result.identified
    truth = known_medium(found.data)
    columns = {
        "": list(names),
        "value": on_the_point([to_error(result.value(name), data[name] if name in moving else None) for name in names]),
        "± data": [significant(data[name]) if name in moving else _mark(result, name) for name in names],
        "± law": [significant(law[name]) if name in law and name in moving else ABSENT for name in names],
    }
    caption = CAPTION
    if result.identifiability is not None and found.misfit.detected:
        misfit = found.errors(found.of_misfit) if moving else {}
        columns["± misfit"] = [significant(misfit[name]) if name in moving else ABSENT for name in names]
        caption += "; ± misfit: what is left unexplained, taken likewise"
    whole = bool(result.whole_draws)
    columns["95 %"] = [
        interval(result.whole_interval(name) if whole else result.interval(name), 1.0 if name in SHARES else None)
        for name in names
    ]
    caption += "; 95 %: " + ("all of these errors together" if whole else "the data's errors alone")
    if any(any(result.ends(name)) for name in result.moving):
        caption += f"; {EDGE}: the data do not exclude that it ends there, so a limit at 95 % and no value"
    columns["unit"] = [unit_of(name, found.data.unit) for name in names]
    if truth:
        columns["of file"] = [significant(truth.get(name), 4) for name in names]
        caption += "; of file: its first layer, scattering reduced by 1 - g"
    return column_table(title, columns, caption, left=("", "unit"))


def _mark(result: Answer, name: str) -> str:
    """What stands where a quantity has no symmetric error."""
    if name not in result.moving:
        return HELD
    return EDGE if any(result.ends(name)) else ABSENT


def _correlation_table(result: Answer) -> RenderableType:
    names = result.identified
    joint = correlation(result.found.gradients, result.found.statistical, names)
    columns = {"": list(names)}
    for at, name in enumerate(names):
        columns[name] = [f"{joint[row, at]:.3f}" if row > at else "" for row in range(len(names))]
    return column_table("Correlations", {k: v for k, v in columns.items() if k != names[-1]})


def _advice_table(result: Answer) -> RenderableType:
    advice = result.advice
    if advice is None:
        return Text("")
    unit = result.found.data.unit or "units of r"
    columns = {
        "one more measurement": ["none: as it is", *(described(one, unit) for one in advice.candidates)],
        "worst known": [advice.name, *(one.worst[0] for one in advice.candidates)],
        "± data, relative": [significant(advice.now), *(significant(one.worst[1]) for one in advice.candidates)],
    }
    place = "from the far end of what alpha may be" if result.found.minimum.at_edge else "from the fit's own place"
    caption = f"predicted {place}, best first; a point has the median relative error of the data"
    return column_table("What would tell more", columns, caption, left=("one more measurement", "worst known"))


def described(one: Candidate, unit: str) -> str:
    """A candidate in words."""
    if one.kind == "point":
        where = f"at r = {0.5 * (one.inner + one.outer):.3g} {unit}"
        if one.outer > one.inner:
            where = f"on a ring from {one.inner:.3g} to {one.outer:.3g} {unit}"
        return f"a value {where}, to {100 * one.error / one.value:.2g} %"
    if one.kind == "reflectance":
        return f"the total reflectance A, to {100 * REFERENCE_ERROR:g} %"
    if one.kind == "scale":
        return f"the scale, by a reference standard, to {100 * REFERENCE_ERROR:g} %"
    return f"all of it {REPEATS} times"


def _lines(result: Answer) -> Iterator[str]:
    found = result.found
    for note in found.data.notes:
        yield f"data: {note}"
    yield f"errors of the data: {found.data.errors}"
    if result.identifiability is None:
        yield f"the fit failed: {found.minimum.result}"
        return
    if found.minimum.at_edge:
        yield f"AT AN EDGE: {found.minimum.result}"
    if np.isfinite(found.data.pooled):
        yield from _estimated(result)
    yield from _goodness(result)
    yield from _identifiability(result)
    if (g := _forward(result)) is not None:
        yield (
            f"the medium scatters with g = {g:g}, the law isotropically: nearer than ten mean free paths this is "
            "off by tens of percent, and seen as a misfit only where rows lie within one"
        )
    if found.rel is None:
        yield "the error of the law is not known for this surface: nothing exact or recorded to hold it against"
    elif beyond := int(found.beyond.sum()):
        rows = f"{beyond} row{'s lie' if beyond > 1 else ' lies'}"
        yield f"{rows} beyond 99.5 % of the energy, where the law's error is larger; `r_max` leaves such rows out"
    if result.walk is not None and result.walk.result != "converged":
        yield f"posterior: {result.walk.result}"


def _estimated(result: Answer) -> Iterator[str]:
    """What was done about errors that are estimates."""
    found = result.found
    yield (
        f"these are estimates, each of {np.median(found.data.freedom):.2g} degrees of freedom, their trend of "
        f"{found.data.pooled:.2g}: so ± data is {np.sqrt(found.widening):.2f} times what they make, 95 % is "
        f"{found.quantile:.2f} times ± data (Student) and the chance below is one of F; {HELD_IN}"
    )


def _forward(result: Answer) -> float | None:
    """g of the first layer of a simulation whose scattering the law takes for isotropic."""
    medium = result.found.data.medium
    return None if medium is None or medium.layers[0].g == 0 else medium.layers[0].g


def _chance(value: float) -> str:
    return f"below {TINIEST:g}" if value < TINIEST else f"{value:.2g}"


def _goodness(result: Answer) -> Iterator[str]:
    one = result.found.misfit
    at_most = " (at most: the errors are bounds)" if result.found.data.bounded else ""
    yield (
        f"chi-square {one.chi2:.1f} for {one.freedom} degrees of freedom{at_most}, chance {_chance(one.chance)}; "
        f"neighbours correlate {one.along_r:+.2f}, {one.runs[0]} runs (noise: {one.runs[1]:.0f})"
    )
    if one.detected:
        yield (
            f"MISFIT (chance {_chance(one.joined)}): this is not one layer under this law, light and surface; "
            f"{100 * one.relative:.2g} % of the light of a row is unexplained"
        )
    elif one.within_law:
        yield "the misfit is within the law's own error: a better law, not another medium, is what is missing"
    elif not result.found.data.bounded and 1.0 - one.chance < DETECTED:
        yield "the residuals are too small: the errors of the data are overstated, or common to all rows"
    else:
        yield "no misfit is seen: one layer explains the data"


def _identifiability(result: Answer) -> Iterator[str]:
    identifiability, advice, unit = result.identifiability, result.advice, result.found.data.unit
    if identifiability is None or advice is None:
        return
    if identifiability.all_identified:
        return
    if identifiability.trades and identifiability.pair is not None:
        first, second = identifiability.pair
        yield f"THE DATA CANNOT TELL {first} FROM {second} (correlation {identifiability.correlation:+.4f}):"
    else:
        yield "THE DATA DO NOT TELL ALL:"
    for one in identifiability.intervals:
        low = "anything less" if one.open_low else f"{one.low:.3g}"
        high = "anything more" if one.open_high else f"{one.high:.3g}"
        yield f"  {one.name} from {low} to {high} {unit_of(one.name, unit)}".rstrip() + " fits as well, at 95 %"
    for name, error in (identifiability.loose if result.identified else {}).items():  # no errors at an edge
        yield f"  {name} is known to {100 * min(error, 99.0):.0f} %" + (" or worse" if error > 99 else "")
    yield f"  what would tell: {described(advice.candidates[0], unit or 'units of r')}"
