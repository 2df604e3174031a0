"""A fit of one's own data as tables, and in sentences what it can and cannot tell."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from profilefit.measured.misfit import DETECTED
from profilefit.measured.model import QUANTITIES, correlation, unit_of
from profilefit.measured.optimal_design import CALIBRATED, REPEATS, Candidate
from profilefit.measured.result import Answer, known_medium
from profilefit.report.tables.cells import ABSENT, column_table, interval, on_the_point, significant, to_error

HELD, EDGE = "held", "edge"
SHARES = ("A", "alpha")  # which end at 1
# tests/physics/measured/test_replicates.py: 3 to 10 replicates of 8 to 40 rows, of equal or uneven scatter.
HELD_IN = "tried on made-up replicates, such intervals hold in 93 to 98 %"
TINIEST = 1e-16  # chance that is worth printing
CAPTION = "± data: the data's own errors; ± law: the law's distance from the truth, taken for waves along ln r"


def fit_tables(answer: Answer, title: str) -> list[RenderableType]:
    """What was found, how well it is told apart, and what would tell more."""
    parts: list[RenderableType] = [_quantity_table(answer, title)]
    if answer.telling is not None:
        if len(answer.told) > 1:
            parts.append(_correlation_table(answer))
        parts.append(_advice_table(answer))
    return parts


def fit_lines(answer: Answer) -> list[Text]:
    """A sentence each on goodness, misfit, what the data cannot tell, and what was done to them."""
    return [Text(line) for line in _lines(answer)]


def _quantity_table(answer: Answer, title: str) -> RenderableType:
    found, names = answer.found, QUANTITIES
    data = found.errors(found.statistical) if answer.told else {}
    law = found.errors(found.of_law) if found.rel is not None and answer.told else {}
    moving = answer.told
    truth = known_medium(found.data)
    columns = {
        "": list(names),
        "value": on_the_point([to_error(answer.value(name), data[name] if name in moving else None) for name in names]),
        "± data": [significant(data[name]) if name in moving else _mark(answer, name) for name in names],
        "± law": [significant(law[name]) if name in law and name in moving else ABSENT for name in names],
    }
    caption = CAPTION
    if answer.telling is not None and found.misfit.detected:
        misfit = found.errors(found.of_misfit) if moving else {}
        columns["± misfit"] = [significant(misfit[name]) if name in moving else ABSENT for name in names]
        caption += "; ± misfit: what is left unexplained, taken likewise"
    whole = bool(answer.whole_draws)
    columns["95 %"] = [
        interval(answer.whole_interval(name) if whole else answer.interval(name), 1.0 if name in SHARES else None)
        for name in names
    ]
    caption += "; 95 %: " + ("all of these errors together" if whole else "the data's errors alone")
    if any(any(answer.ends(name)) for name in answer.moving):
        caption += f"; {EDGE}: the data do not exclude that it ends there, so a limit at 95 % and no value"
    columns["unit"] = [unit_of(name, found.data.unit) for name in names]
    if truth:
        columns["of file"] = [significant(truth.get(name), 4) for name in names]
        caption += "; of file: its first layer, scattering reduced by 1 - g"
    return column_table(title, columns, caption, left=("", "unit"))


def _mark(answer: Answer, name: str) -> str:
    """What stands where a quantity has no symmetric error."""
    if name not in answer.moving:
        return HELD
    return EDGE if any(answer.ends(name)) else ABSENT


def _correlation_table(answer: Answer) -> RenderableType:
    names = answer.told
    joint = correlation(answer.found.gradients, answer.found.statistical, names)
    columns = {"": list(names)}
    for at, name in enumerate(names):
        columns[name] = [f"{joint[row, at]:.3f}" if row > at else "" for row in range(len(names))]
    return column_table("Correlations", {k: v for k, v in columns.items() if k != names[-1]})


def _advice_table(answer: Answer) -> RenderableType:
    advice = answer.advice
    if advice is None:
        return Text("")
    unit = answer.found.data.unit or "units of r"
    columns = {
        "one more measurement": ["none: as it is", *(described(one, unit) for one in advice.candidates)],
        "worst known": [advice.name, *(one.worst[0] for one in advice.candidates)],
        "± data, relative": [significant(advice.now), *(significant(one.worst[1]) for one in advice.candidates)],
    }
    place = "from the far end of what alpha may be" if answer.found.minimum.at_edge else "from the fit's own place"
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
        return f"the total reflectance A, to {100 * CALIBRATED:g} %"
    if one.kind == "scale":
        return f"the scale, by a reference standard, to {100 * CALIBRATED:g} %"
    return f"all of it {REPEATS} times"


def _lines(answer: Answer) -> Iterator[str]:
    found = answer.found
    for note in found.data.notes:
        yield f"data: {note}"
    yield f"errors of the data: {found.data.errors}"
    if answer.telling is None:
        yield f"the fit failed: {found.minimum.result}"
        return
    if found.minimum.at_edge:
        yield f"AT AN EDGE: {found.minimum.result}"
    if np.isfinite(found.data.pooled):
        yield from _estimated(answer)
    yield from _goodness(answer)
    yield from _telling(answer)
    if (g := _forward(answer)) is not None:
        yield (
            f"the medium scatters with g = {g:g}, the law isotropically: nearer than ten mean free paths this is "
            "off by tens of percent, and seen as a misfit only where rows lie within one"
        )
    if found.rel is None:
        yield "the error of the law is not known for this surface: nothing exact or recorded to hold it against"
    elif beyond := int(found.beyond.sum()):
        rows = f"{beyond} row{'s lie' if beyond > 1 else ' lies'}"
        yield f"{rows} beyond 99.5 % of the energy, where the law's error is larger; `r_max` leaves such rows out"
    if answer.walk is not None and answer.walk.result != "converged":
        yield f"posterior: {answer.walk.result}"


def _estimated(answer: Answer) -> Iterator[str]:
    """What was done about errors that are estimates."""
    found = answer.found
    yield (
        f"these are estimates, each of {np.median(found.data.freedom):.2g} degrees of freedom, their trend of "
        f"{found.data.pooled:.2g}: so ± data is {np.sqrt(found.widening):.2f} times what they make, 95 % is "
        f"{found.quantile:.2f} times ± data (Student) and the chance below is one of F; {HELD_IN}"
    )


def _forward(answer: Answer) -> float | None:
    """g of the first layer of a simulation whose scattering the law takes for isotropic."""
    medium = answer.found.data.medium
    return None if medium is None or medium.layers[0].g == 0 else medium.layers[0].g


def _chance(value: float) -> str:
    return f"below {TINIEST:g}" if value < TINIEST else f"{value:.2g}"


def _goodness(answer: Answer) -> Iterator[str]:
    one = answer.found.misfit
    at_most = " (at most: the errors are bounds)" if answer.found.data.bounded else ""
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
    elif not answer.found.data.bounded and 1.0 - one.chance < DETECTED:
        yield "the residuals are too small: the errors of the data are overstated, or common to all rows"
    else:
        yield "no misfit is seen: one layer explains the data"


def _telling(answer: Answer) -> Iterator[str]:
    telling, advice, unit = answer.telling, answer.advice, answer.found.data.unit
    if telling is None or advice is None:
        return
    if telling.told:
        return
    if telling.trades and telling.pair is not None:
        first, second = telling.pair
        yield f"THE DATA CANNOT TELL {first} FROM {second} (correlation {telling.correlation:+.4f}):"
    else:
        yield "THE DATA DO NOT TELL ALL:"
    for one in telling.intervals:
        low = "anything less" if one.open_low else f"{one.low:.3g}"
        high = "anything more" if one.open_high else f"{one.high:.3g}"
        yield f"  {one.name} from {low} to {high} {unit_of(one.name, unit)}".rstrip() + " fits as well, at 95 %"
    for name, error in (telling.loose if answer.told else {}).items():  # at an edge, derivatives are no errors
        yield f"  {name} is known to {100 * min(error, 99.0):.0f} %" + (" or worse" if error > 99 else "")
    yield f"  what would tell: {described(advice.candidates[0], unit or 'units of r')}"
