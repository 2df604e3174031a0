"""Fits of one's own data as tables, sentences and JSON content: of one medium, of layers, of a photographed spot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.text import Text

from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.fitting.misfit import DETECTED
from profilefit.measured.identifiability import LOOSE, REFERENCE_ERROR, REPEATS, Candidate, relative_errors
from profilefit.measured.model import NEAR, QUANTITIES, correlation, unit_of
from profilefit.measured.result import MediumPosterior, known_medium, rival_values
from profilefit.recipes import record
from profilefit.report.tables import cells
from profilefit.report.tables.cells import ABSENT, SEARCHLIGHT, column_table, row_table, significant, to_error

if TYPE_CHECKING:  # which a fit of one medium does not load
    from profilefit.measured.layers import LayersFit
    from profilefit.measured.photo.workflow import Photo

HELD, EDGE = "held", "edge"
SHARES = ("A", "alpha")  # which end at 1
# tests/physics/measured/test_replicates.py: 3 to 10 replicates of 8 to 40 rows, of equal or uneven scatter.
HELD_IN = "checked on simulated replicates, such intervals cover the simulated value in 93 to 98 %"
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
        if len(names := result.identified) > 1:
            joint = correlation(result.fit.gradients, result.fit.statistical, names)
            parts.append(column_table("Correlations", {"": names, **_below_diagonal(names, joint, 3)}))
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
    ends = {name: any(result.ends(name)) for name in result.moving}
    marks = {name: (EDGE if ends[name] else ABSENT) if name in ends else HELD for name in names}
    columns = {
        "": list(names),
        "value": cells.on_the_point(
            [to_error(result.value(name), data[name] if name in moving else None) for name in names]
        ),
        "± statistical": [significant(data[name]) if name in moving else marks[name] for name in names],
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
    columns["95 %"] = []
    for name in names:
        within = result.whole_interval(name) if whole else result.interval(name)
        low, high = within or (None, None)
        is_wide = low is not None and high is not None and 0 < WIDE * low < high
        columns["95 %"].append(ANYTHING if is_wide else cells.interval(within, 1.0 if name in SHARES else None))
    errors = "all of these errors together" if whole or fit.plain is not None else "the statistical error alone"
    caption += f"; 95 %: interval by {errors}"
    if any(ends.values()):
        caption += f"; {EDGE}: the data do not exclude the end of its range, so a one-sided 95 % limit and no value"
    if fit.spec.law.setting.illumination == Setting().illumination:
        caption += f"; {SEARCHLIGHT}"
    columns["unit"] = [unit_of(name, fit.data.unit) for name in names]
    if fit.spec.law.setting.g:
        caption += "; alpha is the reduced albedo, l = 1 / (mu_s' + mu_a)"
    if truth := known_medium(fit.data):
        columns["of file"] = [significant(truth.get(name), 4) for name in names]
        caption += "; of file: its layer that scatters most, with scattering reduced by 1 - g"
    return column_table(title, columns, caption, left=("", "unit"))


def _below_diagonal(names: Sequence[str], joint: Floats, places: int) -> dict[str, list[str]]:
    """Return the columns of a symmetric matrix by name, each pair of names once."""
    rows = range(len(names))
    columns = ([f"{joint[row, at]:.{places}f}" if row > at else "" for row in rows] for at in rows[:-1])
    return dict(zip(names, columns, strict=False))


def _advice_table(result: MediumPosterior) -> RenderableType:
    advice = result.advice
    if advice is None:
        return Text("")
    unit = result.fit.data.unit or "units of r"
    header = ("additional measurement", "least certain quantity", "± statistical, relative")
    rows = [("none", advice.name, significant(advice.now))]
    rows += [(described(one, unit), one.worst[0], significant(one.worst[1])) for one in advice.candidates]
    place = "at the far end of the interval of alpha" if result.fit.at_edge else "at the fitted values"
    caption = f"predicted {place}, best first; a value is given the median relative error of the data"
    return row_table("Most informative additional measurement", header, rows, caption, header[:2])


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
    if np.isfinite(fit.data.pooled):  # errors of the data that are themselves estimates
        yield (
            f"these are estimates of {np.median(fit.data.freedom):.2g} degrees of freedom each, their trend of "
            f"{fit.data.pooled:.2g}: so ± statistical is widened by a factor of {np.sqrt(fit.widening):.2f}, 95 % is "
            f"{fit.quantile:.2f} times ± statistical (Student's t) and the p-value below is of an F test; {HELD_IN}"
        )
    yield from _goodness(result)
    for one in fit.rivals:  # other media that explain the data as well
        told = _words(rival_values(fit, one), RIVALLED, fit.data.unit)
        yield (
            f"ANOTHER MEDIUM FITS AS WELL: {told}; chi-square {one.cost - fit.minimum.cost:+.1f}. No interval holds "
            "both: measure nearer to the beam, or the total reflectance, or the scale"
        )
    yield from _beam(result)
    yield from _oblique(result)
    yield from _medium(result)
    yield from _scale(result)
    yield from _identifiability(result)
    g = 0.0 if fit.data.layer is None else fit.data.layer.g  # of a simulation
    if g and not fit.spec.law.setting.g:
        yield (
            f"the medium has g = {g:g}, and the fitted model g = 0: within ten transport mean free paths the error is "
            "tens of percent, which shows as a misfit only if rows lie within one"
        )
    if fit.rel is None:
        yield "the model error is unknown for this surface: there is neither an exact profile nor a record of it"
    elif beyond := int(fit.beyond.sum()):
        rows = f"{beyond} row{'s lie' if beyond > 1 else ' lies'}"
        yield f"{rows} beyond 99.5 % of the energy, where the law's error is larger; `r_max` leaves such rows out"
    if result.walk is not None and result.walk.result != "converged":
        yield f"posterior: {result.walk.result}"


def _words(values: Mapping[str, float], names: Sequence[str], unit: str) -> str:
    """Return values with their units, where lengths are in `unit`."""
    return ", ".join(f"{name} {values[name]:.3g} {unit_of(name, unit)}".rstrip() for name in names)


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


def _oblique(result: MediumPosterior) -> Iterator[str]:
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
    fit, width = result.fit, result.width
    unit = fit.data.unit or "units of r"
    if fit.spec.instrument.beam is not None:
        yield f"beam: {fit.spec.instrument.beam.words} {unit}"
    if width is None:
        return
    if width.noticed:
        yield (
            f"THE BEAM IS NO PENCIL (p-value {p_value(width.chance)}): a Gaussian one of 1/e^2 radius {width.w:.2g} "
            f"{unit} explains the data better; without its `beam` the errors of the values above are too small"
        )
    elif width.telling is None:
        yield "a pencil beam is assumed; no Gaussian beam up to half of the last radius would move a value by its error"
    else:
        yield (
            f"a pencil beam is assumed: a Gaussian one of 1/e^2 radius {width.telling:.2g} {unit} would move "
            f"{width.moved} by a standard error, and these data would not show it; give `beam` if yours is as wide"
        )


def _medium(result: MediumPosterior) -> Iterator[str]:
    spec, there, unit = result.fit.spec, result.tissue, result.fit.data.unit
    if spec.ranges:
        known = ", ".join(f"{name} from {low:g} to {high:g}" for name, (low, high) in spec.ranges.items())
        narrowed = "no value of theirs gives a fit with errors, so the middle is fitted"
        if (marginal := result.fit.range_marginal) is not None:
            each = []
            for name, value in marginal.mean.items():
                in_unit = f" {unit or 'units of r'}" if name == "beam" else ""
                each.append(f"{name} {value:.3g} ± {marginal.error[name]:.2g}{in_unit}")
            narrowed = f"the data and the ranges together say {', '.join(each)}"
            narrowed += ", and what this leaves open is in the intervals"
        yield f"known as ranges: {known}; {narrowed}"
    if there is not None:
        names, settings = spec.assumed, (spec.law.setting, there.setting)
        here, other = (" and ".join(f"{name} = {getattr(one, name):g}" for name in names) for one in settings)
        told = _words(there.values, RIVALLED[:2], unit)
        yield (
            f"{here} {'are' if len(names) > 1 else 'is'} assumed; {other}, as of soft tissue, would say {told}, "
            f"chi-square {there.rise:+.1f}: give {' and '.join(f'`{name}`' for name in names)}, or a range"
        )


def _scale(result: MediumPosterior) -> Iterator[str]:
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
    if identifiability is None or advice is None or identifiability.all_identified:
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


# Layers

UNKNOWN = "not identified"
MOST = 9.0  # relative error, as a logarithm, beyond which a product is not known at all


def layers_tables(fit: LayersFit, title: str) -> list[RenderableType]:
    """Return what is free, with errors and correlations; and the products of powers that the data know, best first."""
    unit = fit.data.unit or "unit of r"
    free = {
        "": fit.names,
        "value": [to_error(value, value * error) for value, error in zip(fit.values, fit.errors, strict=True)],
        "±": [significant(value * error) for value, error in zip(fit.values, fit.errors, strict=True)],
        "95 %": [
            UNKNOWN if name in fit.loose else cells.interval(ends)
            for name, ends in zip(fit.names, fit.intervals.tolist(), strict=True)
        ],
        "unit": ["" if name == "scale" else unit if name[0] == "d" else f"1/{unit}" for name in fit.names],
        **_below_diagonal(fit.names, fit.correlation, 2),
    }
    caption = "±: from the errors of the data, wider where they do not explain the residuals; right: correlations"
    products = {
        "product": [fit.product(at) for at in range(len(fit.products))],
        "known to": [f"{100 * error:.2g} %" if error < MOST else ABSENT for _, error in fit.products],
    }
    parts = [column_table(title, free, caption, left=("", "unit"))]
    if len(fit.names) > 1:
        parts.append(column_table("What the data know, best first", products, left=("product",)))
    return list(parts)


def layers_lines(fit: LayersFit) -> Iterator[str]:
    """Yield a sentence each on what was held, the goodness of fit, and what is not identified."""
    if fit.result != "converged":
        yield f"the fit failed: {fit.result}"
    for number, layer in enumerate(fit.medium.layers, start=1):
        thick = "endless" if math.isinf(layer.thickness) else f"d {layer.thickness:.4g}"
        yield f"layer {number}: n {layer.n:g}, mu_a {layer.mu_a:.4g}, mu_s {layer.mu_s:.4g}, {thick}"
    yield (
        f"chi-square {fit.chi2:.1f} for {fit.freedom} degrees of freedom"
        f"{' (at most: the errors are bounds)' if fit.data.bounded else ''}, p-value {p_value(fit.chance)}: "
        + ("THESE LAYERS DO NOT EXPLAIN THE DATA" if fit.chance < DETECTED else "no misfit is detected")
    )
    for name in fit.loose:
        yield f"{name} IS NOT IDENTIFIED: its error is more than {100 * LOOSE:.0f} %; hold it, or measure elsewhere"


def layers_content(fit: LayersFit) -> dict[str, Any]:
    """Return all results as JSON content."""
    data = fit.data
    content = {
        "data": {"file": data.source, "sha256": data.digest, "unit": data.unit, "inner": data.inner,
                 "outer": data.outer, "value": data.value, "sigma": data.sigma, "notes": data.notes},
        "light": fit.light,
        "setting": fit.premises.setting,
        "beam": None if fit.premises.instrument.beam is None else fit.premises.instrument.beam.words,
        "start": fit.start,
        "medium": fit.medium,
        "free": fit.names,
        "values": fit.values,
        "relative_errors": fit.errors,
        "intervals_95": fit.intervals,
        "correlation": fit.correlation,
        "products": [{"exponents": powers, "relative_error": error} for powers, error in fit.products],
        "chi2": fit.chi2,
        "freedom": fit.freedom,
        "p_value": fit.chance,
        "not_identified": fit.loose,
        "result": fit.result,
        "versions": record.versions(),
    }  # fmt: skip
    return dict(record.plain(content))


# Photographs of a spot

MEDIUM = ("mu_s'", "mu_a", "alpha", "l", "A")
REMEDY = "photograph cards, or expose longer"
CARDS = "a white one gives beam and glare, a grey one the scale; --simulate says what they are worth"


def photo_tables(photo: Photo) -> list[RenderableType]:
    """Return a line a colour and quantity, with what such photographs can know at best."""
    rows = []
    for colour, fit in photo.fits.items():
        for name in MEDIUM:
            value, error = fit.values[name], fit.errors[name]
            best = photo.bounds[colour].get(name)
            rows.append((
                colour if name == MEDIUM[0] else "", name, to_error(value, error), significant(error),
                cells.interval(fit.interval(name)), "" if best is None else f"{100 * best:.1f} %", unit_of(name, "mm"),
            ))  # fmt: skip
    title = f"{photo.shot.sources[0]}: {len(photo.shot.sources)} exposures, exact light, {photo.setting}"
    caption = (
        "±: from the scatter over sectors, a correlated 1 %, and what is known of beam, surface, glare and scale; "
        "at best: by Fisher's information of such rings and of what is known"
    )
    header = ("colour", "", "value", "±", "95 %", "at best", "unit")
    return [row_table(title, header, rows, caption, left=("colour", "", "unit"))]


def photo_lines(photo: Photo) -> Iterator[str]:
    """Yield a sentence each on sensor, spot, surface and lens, the goodness of fit, and what is not identified."""
    shot = photo.shot
    yield f"scale: {photo.plate.words}; spot at pixel {shot.spot.centre[0]:.1f}, {shot.spot.centre[1]:.1f}"
    if len(shot.sources) == 1:
        yield "one exposure does not tell gain and read noise: one electron a step is taken for both"
    else:
        yield f"sensor: {shot.sensor.gain:.3g} electrons a step, read noise {shot.sensor.read:.2g} steps"
        yield "times by the pictures: " + ", ".join(f"{time:.3g}" for time in sorted(shot.times.value))
    yield from photo.notes
    for colour, fit in photo.fits.items():
        x = dict(zip(fit.shot.names, fit.x, strict=True))
        glare = sum(value for name, value in x.items() if name.startswith("glare"))
        lens = f"surface {100 * x['surface']:.2g} %, glare {100 * glare:.2g} %"
        widened = f"MISFIT, for which errors are widened by a factor of {fit.widening:.1f}"
        verdict = widened if fit.chance < DETECTED else "no misfit is detected"
        yield (
            f"{colour}: beam and lens 1/e^2 radius {2.0 * np.exp(x['core']):.3g} mm, {lens}; chi-square {fit.chi2:.1f} "
            f"for {fit.freedom} degrees of freedom, p-value {p_value(fit.chance)}: {verdict}"
        )
        if not fit.converged:
            yield f"{colour}: NO ANSWER: {fit.result}"
        for one in fit.rivals:
            values = _words(one.values, (*MEDIUM[:2], "A"), "mm")
            yield f"{colour}: ANOTHER MEDIUM FITS, TOO: {values}; chi-square {one.chi2 - fit.chi2:+.1f}"
        for name in MEDIUM[:2]:
            if not fit.errors[name] < LOOSE * fit.values[name]:
                yield f"{colour}: {name} IS NOT IDENTIFIED: its error is more than {100 * LOOSE:.0f} %; {REMEDY}"
    if not photo.cards:
        first, *_ = photo.fits.values()
        halos = first.shot.beliefs.halos
        yield (
            f"no card was photographed, so the shape of glare is not known: it is a mixture of halos {halos[0]:.3g} to "
            f"{halos[-1]:.3g} mm wide; {CARDS}"
        )


def photo_content(photo: Photo) -> dict[str, Any]:
    """Return all results as JSON content."""
    content = {
        "shots": photo.shot.sources,
        "times": photo.shot.times.value,
        "sensor": vars(photo.shot.sensor),
        "spot": vars(photo.shot.spot),
        "scale": {"matrix": photo.plate.matrix, "words": photo.plate.words},
        "setting": photo.setting,
        "notes": photo.notes,
        "colours": {
            colour: {
                "values": fit.values,
                "errors": fit.errors,
                "at_best": photo.bounds[colour],
                "coordinates": dict(zip(fit.shot.names, fit.x.tolist(), strict=True)),
                **{name: getattr(fit, name) for name in ("chi2", "freedom", "chance", "converged", "result")},
                "rivals": [one.values | {"chi2": one.chi2} for one in fit.rivals],
                **{name: getattr(fit.shot.medium, name) for name in ("inner", "outer", "value", "covariance")},
            }
            for colour, fit in photo.fits.items()
        },
        "versions": record.versions(),
    }
    return dict(record.plain(content))


def setup_tables(bounds: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[RenderableType]:
    """Return what a setup's photographs can know at best, by colour: with the cards that it has, and with others."""
    rows = [
        (setup, colour, *(f"{100 * errors[name]:.1f} %" for name in MEDIUM[:2]))
        for setup, by_colour in bounds.items()
        for colour, errors in by_colour.items()
    ]
    caption = (
        "by Fisher's information of rings of exact light that scatter by 0.3 %, a correlated 1 %, and what a fit "
        "takes for known of surface, glare and lens"
    )
    return [row_table("At best", ("photographs", "colour", *MEDIUM[:2]), rows, caption, left=("photographs", "colour"))]
