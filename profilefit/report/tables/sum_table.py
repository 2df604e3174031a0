"""Sums of Gaussians of a stack: their errors over their number, and the constants of six of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from rich.console import RenderableType

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.laws.gaussians import DEFAULT
from profilefit.materials import CHANNELS
from profilefit.recipes.kinds.gaussians import COUNTS, SumRecord, load
from profilefit.recipes.stack.gaussians import constant_names, quality
from profilefit.report.records import known_errors, largest_error
from profilefit.report.tables.cells import column_table, on_the_point, significant, to_error
from profilefit.report.tables.markdown import markdown_table
from profilefit.scenes.skin.law import D_EON

TITLE = "Sums of N Gaussians, whose variances the colours share"
MEASURES = (
    "red, green, blue: mean relative error of R_d, in rings even in ln r from 0.01 mean free paths to 99.5 % of the "
    "light; the worst of the three: rms: its root mean square, ks: error of the cdf, alone: the first again where each "
    "colour has variances of its own"
)
PUBLISHED = "; published: the six Gaussians of d'Eon and Luebke (GPU Gems 3, ch. 14), in mm, of a skin"
MEANING_OF_ERROR = {
    "photons": "noise of the simulation",
    "dr": "exact light of fewer nodes",
    "model": "the misfit as a random function",
    "misfit": "the misfit taken for independent noise, which it is not",
    "jackknife": "leaving out a sixth of the rings",
}
LEFT = ("light", "constant")


def sum_tables(found: SumRecord) -> list[RenderableType]:
    """Errors of 1 to 8 Gaussians in both lights, and the constants of six in the light that the stack is for."""
    return [_over_number(found), _constants(found)]


def sum_sections(paths: Mapping[str, Path]) -> dict[str, Callable[[], str]]:
    """Return the table of these records of sums for Markdown, by the name of its mark; none where there is none."""

    def made() -> str:
        rows = [
            (name, light, *(significant(max(one["rel"])) for one in by_count), significant(max(of_six["alone"])))
            for name, found in ((name, load(path)) for name, path in paths.items())
            for light in ILLUMINATIONS
            for by_count in [found.content["sums"][light]["by_count"]]
            for of_six in [by_count[DEFAULT - 1]]
        ]
        return markdown_table(("stack", "light", *map(str, COUNTS), f"{DEFAULT} each its own"), rows)

    return {"stack-gaussians": made} if paths else {}


def published(found: SumRecord) -> dict[str, list[dict[str, float]]]:
    """`quality` of the published Gaussians of human skin at a stack named skin, by light and colour; else none."""
    if found.path.stem != "skin" or found.stack.unit != "mm":
        return {}
    variances, weights = np.array(D_EON.variances), np.transpose(D_EON.weights)
    return {
        light: [quality(one, variances, own) for one, own in zip(found.lights(light), weights, strict=True)]
        for light in ILLUMINATIONS
    }


def _over_number(found: SumRecord) -> RenderableType:
    rows: list[tuple[str, ...]] = []
    others = published(found)
    for light in ILLUMINATIONS:
        for count, one in zip(COUNTS, found.content["sums"][light]["by_count"], strict=True):
            worst = (max(one[key]) for key in ("rms", "ks", "alone"))
            rows.append((light, str(count), *map(significant, one["rel"]), *map(significant, worst)))
        if light in others:
            rel, rms, ks = ([one[key] for one in others[light]] for key in ("rel", "rms", "ks"))
            rows.append((light, "published", *map(significant, (*rel, max(rms), max(ks))), ""))
    columns = dict(
        zip(("light", "N", *CHANNELS, "rms", "ks", "alone"), map(list, zip(*rows, strict=True)), strict=True)
    )
    return column_table(TITLE, columns, MEASURES + (PUBLISHED if others else ""), left=LEFT)


def _constants(found: SumRecord) -> RenderableType:
    light, unit = found.content["setting"]["illumination"], found.content["unit"]
    of = {name: found.content["constants"][f"{light}.{DEFAULT}.{name}"] for name in constant_names(DEFAULT)}
    known = {key: word for key, word in known_errors(of).items() if any(one[key] is not None for one in of.values())}
    columns = {
        "constant": [f"{name} [{unit}^2]" if "." not in name else name for name in of],
        "regenerated": on_the_point([to_error(one["regenerated"], largest_error(one)) for one in of.values()]),
        **{f"± {word}": on_the_point([significant(one[key]) for one in of.values()]) for key, word in known.items()},
    }
    meaning = "; ".join(f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values())
    caption = f"{meaning}. --json has those of every number, in both lights. {found.content['note']}"
    return column_table(f"Six of them, in {light} light", columns, caption, left=LEFT)
