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
from profilefit.report.records import largest_error, numbered_errors
from profilefit.report.tables.cells import column_table, on_the_point, row_table, significant, to_error
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


def sum_tables(record: SumRecord) -> list[RenderableType]:
    """Return the errors of 1 to 8 Gaussians in both lights, and the constants of six in the light of the stack."""
    return [_over_number(record), _constants(record)]


def sum_sections(paths: Mapping[str, Path]) -> dict[str, Callable[[], str]]:
    """Return the table of these records of sums for Markdown, by the name of its mark; none where there is none."""

    def section() -> str:
        rows = [
            (name, light, *(significant(max(one["rel"])) for one in by_count), significant(max(of_six["alone"])))
            for name, record in ((name, load(path)) for name, path in paths.items())
            for light in ILLUMINATIONS
            for by_count in [record.content["sums"][light]["by_count"]]
            for of_six in [by_count[DEFAULT - 1]]
        ]
        return markdown_table(("stack", "light", *map(str, COUNTS), f"{DEFAULT} each its own"), rows)

    return {"stack-gaussians": section} if paths else {}


def published(record: SumRecord) -> dict[str, list[dict[str, float]]]:
    """Return `quality` of the published Gaussians of skin at a stack of that name, by light and colour; else none."""
    if record.path.stem != "skin" or record.stack.unit != "mm":
        return {}
    variances, weights = np.array(D_EON.variances), np.transpose(D_EON.weights)
    return {
        light: [quality(one, variances, own) for one, own in zip(record.lights(light), weights, strict=True)]
        for light in ILLUMINATIONS
    }


def _over_number(record: SumRecord) -> RenderableType:
    rows: list[tuple[str, ...]] = []
    others = published(record)
    for light in ILLUMINATIONS:
        for count, one in zip(COUNTS, record.content["sums"][light]["by_count"], strict=True):
            worst = (max(one[key]) for key in ("rms", "ks", "alone"))
            rows.append((light, str(count), *map(significant, one["rel"]), *map(significant, worst)))
        if light in others:
            rel, rms, ks = ([one[key] for one in others[light]] for key in ("rel", "rms", "ks"))
            rows.append((light, "published", *map(significant, (*rel, max(rms), max(ks))), ""))
    header = ("light", "N", *CHANNELS, "rms", "ks", "alone")
    return row_table(TITLE, header, rows, MEASURES + (PUBLISHED if others else ""), LEFT)


def _constants(record: SumRecord) -> RenderableType:
    light, unit = record.content["setting"]["illumination"], record.content["unit"]
    of = {name: record.content["constants"][f"{light}.{DEFAULT}.{name}"] for name in constant_names(DEFAULT)}
    known = numbered_errors(of.values())
    columns = {
        "constant": [f"{name} [{unit}^2]" if "." not in name else name for name in of],
        "regenerated": on_the_point([to_error(one["regenerated"], largest_error(one)) for one in of.values()]),
        **{f"± {word}": on_the_point([significant(one[key]) for one in of.values()]) for key, word in known.items()},
    }
    meaning = "; ".join(f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values())
    caption = f"{meaning}. --json has those of every number, in both lights. {record.content['note']}"
    return column_table(f"Six of them, in {light} light", columns, caption, left=LEFT)
