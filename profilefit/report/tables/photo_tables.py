"""Results of photographs of a spot as tables, as sentences, and as JSON content."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from rich.console import RenderableType

from profilefit.fitting.misfit import DETECTED
from profilefit.measured.identifiability import LOOSE
from profilefit.measured.photo.workflow import Photo
from profilefit.recipes import record
from profilefit.report.tables.cells import interval, row_table, significant, to_error
from profilefit.report.tables.fit_tables import p_value

NAMES = ("mu_s'", "mu_a", "alpha", "l", "A")
UNITS = {"mu_s'": "1/mm", "mu_a": "1/mm", "alpha": "", "l": "mm", "A": ""}
RIVALLED = ("mu_s'", "mu_a", "A")  # of another medium
REMEDY = "photograph cards, or expose longer"
CARDS = "a white one tells beam and glare, a grey one the scale; --simulate says what they are worth"


def photo_tables(photo: Photo) -> list[RenderableType]:
    """Return a line a colour and quantity, with what such photographs can know at best."""
    rows = []
    for colour, fit in photo.fits.items():
        for name in NAMES:
            value, error = fit.values[name], fit.errors[name]
            best = photo.bounds[colour].get(name)
            rows.append((
                colour if name == NAMES[0] else "", name, to_error(value, error), significant(error),
                interval(fit.interval(name)), "" if best is None else f"{100 * best:.1f} %", UNITS[name],
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
            values = ", ".join(f"{name} {one.values[name]:.3g} {UNITS[name]}".rstrip() for name in RIVALLED)
            yield f"{colour}: ANOTHER MEDIUM FITS, TOO: {values}; chi-square {one.chi2 - fit.chi2:+.1f}"
        for name in NAMES[:2]:
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
    plain: dict[str, Any] = record.plain(
        {
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
                    "chi2": fit.chi2,
                    "freedom": fit.freedom,
                    "chance": fit.chance,
                    "converged": fit.converged,
                    "result": fit.result,
                    "rivals": [one.values | {"chi2": one.chi2} for one in fit.rivals],
                    "inner": fit.shot.medium.inner,
                    "outer": fit.shot.medium.outer,
                    "value": fit.shot.medium.value,
                    "covariance": fit.shot.medium.covariance,
                }
                for colour, fit in photo.fits.items()
            },
            "versions": record.versions(),
        }
    )
    return plain


def setup_tables(bounds: Mapping[str, Mapping[str, Mapping[str, float]]]) -> list[RenderableType]:
    """Return what a setup's photographs can know at best, by colour: with the cards that it has, and with others."""
    rows = [
        (setup, colour, *(f"{100 * errors[name]:.1f} %" for name in NAMES[:2]))
        for setup, by_colour in bounds.items()
        for colour, errors in by_colour.items()
    ]
    caption = "by Fisher's information of rings of exact light that scatter by 0.3 %, a correlated 1 %, and what a fit "
    caption += "takes for known of surface, glare and lens"
    return [row_table("At best", ("photographs", "colour", *NAMES[:2]), rows, caption, left=("photographs", "colour"))]
