"""The shader texts on a GPU: a line a law, broken bounds, costs; and pictures of renders that lie beside them."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from profilefit.report.columns import column_table
from profilefit.report.digits import significant
from profilefit.report.page.markup import element, markup, paragraph
from profilefit.report.page.measured import Measured, Told, missing

# `python -m benchmarks.render` makes them.
RENDERS = {
    "render-laws.png": "A head by the exact profile, four laws and the separable filter, and how far each is off.",
    "render-error.png": "Error of renders over samples a pixel and over time, against the exact picture.",
    "render-choices.png": "The same head with the ways to sample.",
    "render-17-samples.png": "Seventeen samples a pixel, as in Figure 14 of Liang et al.",
}
GROUPS = {
    "laws": ("Laws in float32", {"rel": "rel", "ks": "ks", "inversion_error": "sample"}),
    "maps": ("Maps in float32", {"delta_A": "A", "delta_alpha": "α"}),
}
MEANING = (
    "model: the record's error against exact half space or photons, worst albedo; float32: what rounding adds; bad: "
    "NaN, Inf, negative or not monotone, in and out of where the law holds"
)
COSTS = "Cost of one evaluation: ns of the fastest turn; in brackets the median of its ratios to normalized diffusion's"


def shader(found: Measured) -> Iterator[str]:
    """The parts of the section."""
    told = found.told("check")
    yield missing("check") if told is None else "\n".join([found.origin(told), *_check(told)])
    for name, title in RENDERS.items():
        path = found.folder / name
        if path.exists():
            yield _picture(path.read_bytes(), title)


def _check(told: Told) -> Iterator[str]:
    counts = " and ".join(f"{len(told[key])} {key}" for key in GROUPS)
    verdict = "all pass" if told["passed"] else "bounds are broken"
    yield paragraph(f"{counts} on {told['device']}: {verdict}.", "bold")
    for key, (title, measures) in GROUPS.items():
        if told[key]:
            columns = _columns(told[key], measures)
            yield markup(column_table(title, columns, MEANING, left=("light", "result"), fold=("law",)))
    if broken := [f"{_label(one)}: {line}" for key in GROUPS for one in told[key] for line in one["broken"]]:
        yield element("ul", "".join(element("li", escape(line)) for line in broken))
    if told["costs"]:
        yield markup(column_table(COSTS, _costs(told["costs"]), left=("text",)))


def _columns(group: Sequence[Told], measures: Mapping[str, str]) -> dict[str, list[str]]:
    columns = {
        "law": [_label(one) for one in group],
        "result": ["FAIL" if one["broken"] else "pass" for one in group],
        "light": [one["setting"]["illumination"] for one in group],
        "n": [f"{one['setting']['n']:g}" for one in group],
    }
    for name, short in measures.items():
        columns[f"{short}\nmodel"] = [significant(one["model"]["values"].get(name)) for one in group]
        columns[f"{short}\nfloat32"] = [significant(one["rounding"].get(name)) for one in group]
    for place in ("inside", "outside"):
        columns[f"bad\n{place}"] = [_count(one[place]) for one in group]
    return columns


def _label(one: Told) -> str:
    return f"{one['name']}, {one['constants']}" if one["constants"] else str(one["name"])


def _count(bad: Told) -> str:
    return str(sum(value for value in bad.values() if isinstance(value, int)))


def _costs(costs: Told) -> dict[str, list[str]]:
    works = list(next(iter(costs.values()))["ns"])
    columns = {"text": list(costs)}
    for work in works:
        columns[work] = [f"{significant(one['ns'][work])} ({one['ratio'][work]:.2f})" for one in costs.values()]
    return columns


def _picture(png: bytes, title: str) -> str:
    data = base64.b64encode(png).decode()
    image = f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'
    caption = element("figcaption", escape(title))
    return element("figure", element("div", image, class_="wide", tabindex="0") + caption)
