"""A fit of one's own data as tables, and its goodness of fit and identifiability in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from mcml_sim.media.setting import Setting
from profilefit.fitting.misfit import DETECTED
from profilefit.measured.fitting import MediumFit
from profilefit.measured.identifiability import REFERENCE_ERROR, REPEATS, Candidate, relative_errors
from profilefit.measured.model import NEAR, QUANTITIES, correlation, unit_of
from profilefit.measured.result import MediumPosterior, known_medium, rival_values
from profilefit.report.tables.cells import (
    ABSENT,
    SEARCHLIGHT,
    column_table,
    interval,
    on_the_point,
    significant,
    to_error,
)

HELD, EDGE = "held", "edge"
SHARES = ("A", "alpha")  # which end at 1
# tests/physics/measured/test_replicates.py: 3 to 10 replicates of 8 to 40 rows, of equal or uneven scatter.
HELD_IN = "checked on simulated replicates, such intervals cover the truth in 93 to 98 %"
RIVALLED = ("mu_s'", "mu_a", "scale")
ODD = (0.5, 2.0)  # scales between these are a calibration's
UNLIKELY = 3.0  # standard errors
LOUD = 0.05  # relative error of mu_a or mu_s' by lack of fit, from which the answer says MISFIT in capitals
REACHED = 0.1  # of the first radius
TINIEST = 1e-16  # p-value that is worth printing
ANYTHING, WIDE = "anything", 1e4  # of an interval, and from which ratio of its ends
CAPTION = "± statistical: from the errors of the data"
OF_RANGES = "; ± model: from what is known as a range"
OF_LAW = "; ± model: from the law's own error, taken for a Gaussian process along ln r"


def fit_tables(result: MediumPosterior, title: str) -> list[RenderableType]:
    """Return estimates with errors, their correlations, and the most informative additional measurement."""
    parts: list[RenderableType] = [_quantity_table(result, title)]
    if result.identifiability is not None:
        if len(result.identified) > 1:
            parts.append(_correlation_table(result))
        parts.append(_advice_table(result))
    return parts


def fit_lines(result: MediumPosterior) -> list[Text]:
    """Return a sentence each on goodness of fit, misfit, identifiability, and how the data were prepared."""
    return [Text(line) for line in _lines(result)]


def _quantity_table(result: MediumPosterior, title: str) -> RenderableType:
    fit, names = result.fit, QUANTITIES
    data = fit.errors(fit.statistical) if result.identified else {}
    law = fit.errors(fit.of_law) if fit.rel is not None and result.identified else {}
    moving = result.identified
    truth = known_medium(fit.data)
    columns = {
        "": list(names),
        "value": on_the_point([to_error(result.value(name), data[name] if name in moving else None) for name in names]),
        "± statistical": [significant(data[name]) if name in moving else _mark(result, name) for name in names],
    }
    caption = CAPTION
    if fit.rel != 0 or fit.spec.ranges:  # exact light has no error of its own
        columns["± model"] = [significant(law[name]) if name in law and name in moving else ABSENT for name in names]
        caption += OF_RANGES if fit.spec.ranges else OF_LAW
    if fit.plain is not None:
        misfit = fit.errors(fit.of_misfit) if moving else {}
        columns["± lack of fit"] = [significant(misfit[name]) if name in moving else ABSENT for name in names]
        caption += "; ± lack of fit: from the residuals that these do not explain, likewise"
    whole = bool(result.whole_draws)
    columns["95 %"] = [
        _ends(result.whole_interval(name) if whole else result.interval(name), 1.0 if name in SHARES else None)
        for name in names
    ]
    caption += "; 95 %: interval by " + (
        "all of these errors together" if whole or fit.plain is not None else "the statistical error alone"
    )
    if any(any(result.ends(name)) for name in result.moving):
        caption += f"; {EDGE}: the data do not exclude the end of its range, so a one-sided 95 % limit and no value"
    if fit.spec.law.setting.illumination == Setting().illumination:
        caption += f"; {SEARCHLIGHT}"
    columns["unit"] = [unit_of(name, fit.data.unit) for name in names]
    if fit.spec.law.setting.g:
        caption += "; alpha is the reduced albedo, l = 1 / (mu_s' + mu_a)"
    if truth:
        columns["of file"] = [significant(truth.get(name), 4) for name in names]
        caption += "; of file: its layer that scatters most, with scattering reduced by 1 - g"
    return column_table(title, columns, caption, left=("", "unit"))


def _ends(ends: Sequence[float | None] | None, most: float | None) -> str:
    """Return an interval, or in words that it says nothing."""
    low, high = ends or (None, None)
    wide = low is not None and high is not None and low > 0 and high > WIDE * low
    return ANYTHING if wide else interval(ends, most)


def _mark(result: MediumPosterior, name: str) -> str:
    """Return what stands where a quantity has no symmetric error."""
    if name not in result.moving:
        return HELD
    return EDGE if any(result.ends(name)) else ABSENT


def _correlation_table(result: MediumPosterior) -> RenderableType:
    names = result.identified
    joint = correlation(result.fit.gradients, result.fit.statistical, names)
    columns = {"": list(names)}
    for at, name in enumerate(names):
        columns[name] = [f"{joint[row, at]:.3f}" if row > at else "" for row in range(len(names))]
    return column_table("Correlations", {k: v for k, v in columns.items() if k != names[-1]})


def _advice_table(result: MediumPosterior) -> RenderableType:
    advice = result.advice
    if advice is None:
        return Text("")
    unit = result.fit.data.unit or "units of r"
    columns = {
        "additional measurement": ["none", *(described(one, unit) for one in advice.candidates)],
        "least certain quantity": [advice.name, *(one.worst[0] for one in advice.candidates)],
        "± statistical, relative": [significant(advice.now), *(significant(one.worst[1]) for one in advice.candidates)],
    }
    place = "at the far end of the interval of alpha" if result.fit.at_edge else "at the fitted values"
    caption = f"predicted {place}, best first; a value is given the median relative error of the data"
    left = "additional measurement", "least certain quantity"
    return column_table("Most informative additional measurement", columns, caption, left)


def described(candidate: Candidate, unit: str) -> str:
    """Return a candidate in words."""
    if candidate.kind == "point":
        where = f"at r = {0.5 * (candidate.inner + candidate.outer):.3g} {unit}"
        if candidate.outer > candidate.inner:
            where = f"over the annulus from {candidate.inner:.3g} to {candidate.outer:.3g} {unit}"
        return f"a value {where}, to {100 * candidate.error / candidate.value:.2g} %"
    if candidate.kind == "reflectance":
        return f"the total reflectance A, to {100 * REFERENCE_ERROR:g} %"
    if candidate.kind == "scale":
        return f"the scale, by a reference standard, to {100 * REFERENCE_ERROR:g} %"
    return f"the whole profile, {REPEATS} times"


def _lines(result: MediumPosterior) -> Iterator[str]:
    fit = result.fit
    for note in fit.data.notes:
        yield f"data: {note}"
    yield f"errors of the data: {fit.data.errors}"
    if result.identifiability is None:
        yield f"the fit failed: {fit.minimum.result}"
        return
    if fit.at_edge:
        yield f"AT AN EDGE: {fit.minimum.result}"
    if np.isfinite(fit.data.pooled):
        yield from _estimated(result)
    yield from _goodness(result)
    yield from _rivals(result)
    yield from _beam(result)
    yield from _oblique(result)
    yield from _medium(result)
    yield from _scale(result)
    yield from _identifiability(result)
    if (g := _forward(result)) is not None:
        yield (
            f"the medium scatters with g = {g:g}, what is fitted isotropically: within ten transport mean free paths "
            "this is off by tens of percent, which shows as a misfit only if rows lie within one"
        )
    if fit.rel is None:
        yield "the model error is unknown for this surface: there is neither an exact profile nor a record of it"
    elif beyond := int(fit.beyond.sum()):
        rows = f"{beyond} row{'s lie' if beyond > 1 else ' lies'}"
        yield f"{rows} beyond 99.5 % of the energy, where the law's error is larger; `r_max` leaves such rows out"
    if result.walk is not None and result.walk.result != "converged":
        yield f"posterior: {result.walk.result}"


def _estimated(result: MediumPosterior) -> Iterator[str]:
    """Yield a line on errors of data that are themselves estimates."""
    fit = result.fit
    yield (
        f"these are estimates of {np.median(fit.data.freedom):.2g} degrees of freedom each, their trend of "
        f"{fit.data.pooled:.2g}: so ± statistical is widened by a factor of {np.sqrt(fit.widening):.2f}, 95 % is "
        f"{fit.quantile:.2f} times ± statistical (Student's t) and the p-value below is of an F test; {HELD_IN}"
    )


def _forward(result: MediumPosterior) -> float | None:
    """Return g of a simulation whose scattering the law takes for isotropic."""
    layer = result.fit.data.layer
    return None if layer is None or result.fit.spec.law.setting.g else layer.g or None


def p_value(value: float) -> str:
    """Return a p-value as text."""
    return f"below {TINIEST:g}" if value < TINIEST else f"{value:.2g}"


def _goodness(result: MediumPosterior) -> Iterator[str]:
    one = result.fit.misfit
    at_most = " (at most: the errors are bounds)" if result.fit.data.bounded else ""
    yield (
        f"chi-square {one.chi2:.1f} for {one.freedom} degrees of freedom{at_most}, p-value {p_value(one.chance)}; "
        f"lag-1 autocorrelation {one.along_r:+.2f}, {one.runs[0]} sign runs ({one.runs[1]:.0f} expected)"
    )
    if one.detected:
        added = _added(result)
        loud = max(added.values(), default=one.relative) >= LOUD
        share = f"residuals of {100 * one.relative:.2g} % of a value are unexplained"
        missed = share if one.relative < 1 else "it misses whole values"
        yield (
            f"{'MISFIT' if loud else 'misfit'} (p-value {p_value(one.joined)}): one layer does not explain the data "
            f"under this light, scattering and surface; {missed}; {_effect(result, added)}"
        )
    elif result.fit.plain is not None:
        ranges = result.fit.spec.ranges
        why = f"though {' and '.join(ranges)}, known as ranges, may hide one" if ranges else "but more likely than none"
        yield f"a misfit is not detected (p-value {p_value(one.joined)}) {why}; {_effect(result, _added(result))}"
    elif one.within_law:
        yield "the misfit is within the law's own error: what is missing is a better law, not another medium"
    elif not result.fit.data.bounded and 1.0 - one.chance < DETECTED:
        yield "the residuals are too small: the errors of the data are overstated, or common to all rows"
    else:
        yield "no misfit is detected: one layer explains the data"


def _added(result: MediumPosterior) -> dict[str, float]:
    """Return relative errors of mu_a and mu_s' by lack of fit; empty where it is not allowed for."""
    fit = result.fit
    if fit.plain is None:
        return {}
    errors = relative_errors(fit, fit.of_misfit)
    return {name: errors[name] for name in ("mu_a", "mu_s'") if name in result.identified}


def _effect(result: MediumPosterior, added: dict[str, float]) -> str:
    """Return how much a lack of fit adds to the errors, and how large the other errors are, in words."""
    fit = result.fit
    if fit.plain is None:
        return "no error below allows for it"
    if not added:
        return "the limits allow for it"
    others = relative_errors(fit, fit.total_covariance - fit.of_misfit)
    by_lack = " and ".join(f"± {significant(100 * error)} % to {name}" for name, error in added.items())
    rest = " and ".join(f"± {significant(100 * others[name])} %" for name in added)
    return f"it adds {by_lack}, where all other errors are {rest}; 95 % includes it"


def _rivals(result: MediumPosterior) -> Iterator[str]:
    """Yield other media that explain the data as well."""
    fit, unit = result.fit, result.fit.data.unit
    for one in fit.rivals:
        values = rival_values(fit, one)
        told = ", ".join(f"{name} {values[name]:.3g} {unit_of(name, unit)}".rstrip() for name in RIVALLED)
        yield (
            f"ANOTHER MEDIUM FITS AS WELL: {told}; chi-square {one.cost - fit.minimum.cost:+.1f}. No interval holds "
            "both: measure nearer to the beam, or the total reflectance, or the scale"
        )


def _oblique(result: MediumPosterior) -> Iterator[str]:
    """Yield lines on the centre of oblique light: whether it is explained, and known well where it was measured."""
    fit, unit = result.fit, result.fit.data.unit or "units of r"
    one = fit.spec.oblique
    if one is None:
        return
    (off,), _ = one.residuals(fit.spec.law.setting, fit.point[None])
    yield f"centre of oblique light: the fit has it {off:+.1f} of its errors from {one.centre:g} {unit}" + (
        ": IT CONTRADICTS THE PROFILE under this n, g and beam" if abs(off) > UNLIKELY else ""
    )
    if one.r < (near := NEAR * fit.values["l"]):
        yield (
            f"at r = {one.r:g} {unit} a centre of oblique light is known less well than is taken for granted: measure "
            f"it beyond {near:.2g} {unit}"
        )


def _beam(result: MediumPosterior) -> Iterator[str]:
    """Yield lines on the beam that was assumed, and whether another one would matter."""
    fit, width = result.fit, result.width
    unit = fit.data.unit or "units of r"
    if fit.spec.instrument.beam is not None:
        yield f"beam: {fit.spec.instrument.beam.words} {unit}"
    if width is None:
        return
    if width.noticed:
        yield (
            f"THE BEAM IS NO PENCIL (p-value {p_value(width.chance)}): a Gaussian one of 1/e^2 radius {width.w:.2g} "
            f"{unit} explains the data better; without its `beam` the values above are off by more than their errors"
        )
    elif width.telling is None:
        yield "a pencil beam is assumed; no Gaussian beam up to half of the last radius would move a value by its error"
    else:
        yield (
            f"a pencil beam is assumed: a Gaussian one of 1/e^2 radius {width.telling:.2g} {unit} would move "
            f"{width.moved} by a standard error, and these data would not show it; give `beam` if yours is as wide"
        )


def _narrowed(fit: MediumFit) -> str:
    """Return what the data say of ranges."""
    if fit.range_marginal is None:
        return "no value of theirs gives a fit with errors, so the middle is fitted"
    units = {"beam": f" {fit.data.unit or 'units of r'}"}
    told = ", ".join(
        f"{name} {value:.3g} ± {fit.range_marginal.error[name]:.2g}{units.get(name, '')}"
        for name, value in fit.range_marginal.mean.items()
    )
    return f"the data and the ranges together say {told}, and what this leaves open is in the intervals"


def _medium(result: MediumPosterior) -> Iterator[str]:
    """Yield lines on n and g: known as ranges, or assumed."""
    spec, there, unit = result.fit.spec, result.tissue, result.fit.data.unit
    if spec.ranges:
        known = ", ".join(f"{name} from {low:g} to {high:g}" for name, (low, high) in spec.ranges.items())
        yield f"known as ranges: {known}; {_narrowed(result.fit)}"
    if there is not None:
        names = spec.assumed
        here, other = (_named(names, one) for one in (spec.law.setting, there.setting))
        told = ", ".join(f"{name} {there.values[name]:.3g} {unit_of(name, unit)}" for name in ("mu_s'", "mu_a"))
        yield (
            f"{here} {'are' if len(names) > 1 else 'is'} assumed; {other}, as of soft tissue, would say {told}, "
            f"chi-square {there.rise:+.1f}: give {' and '.join(f'`{name}`' for name in names)}, or a range"
        )


def _named(names: tuple[str, ...], setting: Setting) -> str:
    return " and ".join(f"{name} = {getattr(setting, name):g}" for name in names)


def _scale(result: MediumPosterior) -> Iterator[str]:
    """Yield lines on a free scale that no reflectance has, and a length that the data do not reach."""
    fit = result.fit
    scale, mfp, r = fit.values["scale"], fit.values["l"], fit.data.r
    free = "scale" in result.moving and fit.spec.scale is None and fit.data.unit
    if free and not ODD[0] < scale < ODD[1]:
        yield (
            f"the scale is {scale:.3g}; of values per incident light it is near 1: if yours are that, hold it, for "
            "the medium is another one then"
        )
    if "l" in result.moving and not REACHED * r[0] < mfp < r[-1]:
        yield f"l = {mfp:.3g} is beyond the data's reach, from r = {r[0]:.3g} to {r[-1]:.3g}: they tell little of it"


def _identifiability(result: MediumPosterior) -> Iterator[str]:
    identifiability, advice, unit = result.identifiability, result.advice, result.fit.data.unit
    if identifiability is None or advice is None:
        return
    if identifiability.all_identified:
        return
    if identifiability.trades and identifiability.pair is not None:
        first, second = identifiability.pair
        yield f"{first} AND {second} ARE NOT SEPARATELY IDENTIFIABLE (correlation {identifiability.correlation:+.4f}):"
    else:
        yield "NOT ALL QUANTITIES ARE IDENTIFIABLE:"
    for one in identifiability.intervals:
        low = "anything less" if one.open_low else f"{one.low:.3g}"
        high = "anything more" if one.open_high else f"{one.high:.3g}"
        if (one.open_low and one.open_high) or one.high > WIDE * one.low:
            yield f"  {one.name}: anything fits as well"
            continue
        yield f"  {one.name} from {low} to {high} {unit_of(one.name, unit)}".rstrip() + " fits as well, at 95 %"
    for name, error in (identifiability.loose if result.identified else {}).items():  # no errors at an edge
        yield f"  {name} is known to {100 * min(error, 99.0):.0f} %" + (" or worse" if error > 99 else "")
    yield f"  most informative additional measurement: {described(advice.candidates[0], unit or 'units of r')}"
