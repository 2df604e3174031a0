"""Checks of shader sources: a row for each law, where errors are largest, what an evaluation costs, broken bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.record import plain
from profilefit.report.tables.cells import ABSENT, column_table, row_table, significant
from profilefit.report.tables.markdown import markdown_table
from profilefit.shader.check.chosen import REGENERATED, checked, chosen
from profilefit.shader.check.law_check import HALVES, JUDGED, OWN, HalfCheck, LawCheck, MapCheck
from profilefit.shader.check.law_cost import WORKS, Cost

PASS, FAIL = "pass", "FAIL"
LAW_COLUMNS = ("rel\nmodel", "rel\nfloat32", "ks\nmodel", "ks\nfloat32", "sample\nfloat32", "pdf\n99 %")
MAP_COLUMNS = ("A\nmodel", "A\nfloat32", "α\nmodel", "α\nfloat32")
COUNTS = ("bad\nin", "bad\nout")
CAPTION = (
    "model: the record's error against the exact half space or photons, worst albedo (of printed constants that of "
    "the regenerated); float32: what rounding adds, at worst; sample: share of the energy between both radii; pdf: the "
    "density in the source against the slope of the sampler's own map; bad: NaN, Inf, negative, not monotone, in and "
    "out of where the law holds"
)
COST_CAPTION = (
    "ns and, in brackets, times normalized diffusion. profile: R_d; sample: a radius; both: a radius and R_d there; "
    "estimate: a sample of (22), that is a radius, its density and R_d at another distance; material: both, with "
    "another α at each. Of the source as exported; constants do not change it"
)
HALF_CAPTION = "mean relative error of R_d / largest error of the cdf by float16 alone, worst of 24 albedos, l = 1"


def check_tables(laws: Sequence[LawCheck], maps: Sequence[MapCheck], device: str) -> list[RenderableType]:
    """Return a line a law and a line a map."""
    parts: list[RenderableType] = []
    for kind, names, cells, checks in _kinds(laws, maps):
        caption, has_g = CAPTION if kind == "law" else "", any(one.of.setting.g for one in checks)
        header = (kind, "n", *(("g",) if has_g else ()), *names, *COUNTS, "result")
        rows = [
            (one.of.label, *_setting(one.of)[1 : 2 + has_g], *cells(one), *_counts(one), _result(one)) for one in checks
        ]
        title = f"{kind.capitalize()}s in float32, {device}"
        parts.append(row_table(title, header, rows, caption, left=("result",), fold=(kind,)))
    return parts


def _kinds(laws: Sequence[LawCheck], maps: Sequence[MapCheck]) -> list[tuple[str, tuple[str, ...], Any, Sequence[Any]]]:
    """Return word, headers, cells and checks of laws and of maps, where there are any."""
    kinds: list[tuple[str, tuple[str, ...], Any, Sequence[Any]]] = [
        ("law", LAW_COLUMNS, _law_cells, laws),
        ("map", MAP_COLUMNS, _map_cells, maps),
    ]
    return [kind for kind in kinds if kind[-1]]


def place_tables(laws: Sequence[LawCheck]) -> list[RenderableType]:
    """Return the distribution of each law's errors, and where the largest is."""
    parts: list[RenderableType] = []
    for one in laws:
        spreads = one.spreads.values()
        columns = {
            "float32 error": list(one.spreads),
            "50 %": [significant(spread.half) for spread in spreads],
            "99 %": [significant(spread.most) for spread in spreads],
            "largest": [significant(spread.largest) for spread in spreads],
            "at": [spread.where for spread in spreads],
        }
        parts.append(column_table(_called(one), columns, _against_exact(one), left=("float32 error", "at")))
    return parts


def _against_exact(check: LawCheck) -> str:
    """Return the GPU's own errors beside the record's."""
    pairs = [
        f"{name} {significant(value, 3)} (model {significant(check.model.get(name), 3)})"
        for name, value in check.measured.items()
    ]
    return f"GPU against the exact half space: {', '.join(pairs)}" if pairs else ""


def cost_table(costs: Mapping[str, Cost], device: str) -> RenderableType:
    """Return a row for each source."""
    columns = {"source": list(costs)}
    for work in WORKS:
        columns[work] = [f"{significant(cost.ns[work])} ({cost.ratio[work]:.2f})" for cost in costs.values()]
    return column_table(f"Cost of one evaluation, {device}", columns, COST_CAPTION, left=("source",))


def half_table(checks: Sequence[HalfCheck]) -> RenderableType:
    """Return a line a law, a column for each thing that is stored in float16."""
    columns = {"law": [_at_index(one.of) for one in checks]}
    for name in HALVES:
        if any(name in one.rel for one in checks):
            columns[name] = [
                f"{significant(one.rel[name])} / {significant(one.ks[name])}" if name in one.rel else ABSENT
                for one in checks
            ]
    return column_table("Half precision", columns, HALF_CAPTION, fold=("law",))


def verdict_lines(checks: Sequence[LawCheck | MapCheck]) -> list[Text]:
    """Return the broken bounds, a line each, and the sum of it."""
    lines = [Text(f"{FAIL} {_called(one)}: {bound}") for one in checks for bound in one.broken]
    failed = sum(bool(one.broken) for one in checks)
    count = f"{len(checks)} law{'s' if len(checks) != 1 else ''} or map{'s' if len(checks) != 1 else ''}"
    return [*lines, Text(f"{count}: {failed} fail" if failed else f"{count}: all pass", style="bold")]


def markdown_check(folder: Path) -> str:
    """Return the README's tables: all regenerated laws, and Liang et al.'s printed ones. ShaderError without OpenGL."""
    regenerated, printed = chosen((), REGENERATED, folder), chosen(("liang",), "published", folder)
    results = checked((regenerated[0] + printed[0], regenerated[1] + printed[1]), folder)
    return markdown_checks(results.laws, results.maps, results.costs, results.device)


def markdown_checks(laws: Sequence[LawCheck], maps: Sequence[MapCheck], costs: Mapping[str, Cost], device: str) -> str:
    """Return the README's tables: laws, maps, costs, and the broken bounds."""
    parts = []
    for kind, names, cells, group in _kinds(laws, maps):
        header = (kind, "light", "n", "g", *(name.replace("\n", " ") for name in (*names, *COUNTS)), "result")
        rows = [(one.of.label, *_setting(one.of), *cells(one), *_counts(one), _result(one)) for one in group]
        parts.append(markdown_table(header, rows))
    checks: list[LawCheck | MapCheck] = [*laws, *maps]
    broken = [f"- `{_called(one)}`: {bound}" for one in checks for bound in one.broken]
    if broken:
        parts.append("\n".join(broken))
    if costs:
        rows = [
            (name, *(f"{significant(cost.ns[work])} ({cost.ratio[work]:.2f})" for work in WORKS))
            for name, cost in costs.items()
        ]
        parts.append(markdown_table(("law", *(f"{work}, ns" for work in WORKS)), rows))
    captions = [CAPTION, *([f"Costs: {COST_CAPTION}"] if costs else [])]
    return "\n\n".join([*parts, f"On {device}. {'. '.join(captions)}."])


def content(
    laws: Sequence[LawCheck],
    maps: Sequence[MapCheck],
    costs: Mapping[str, Cost],
    halves: Sequence[HalfCheck],
    device: str,
) -> dict[str, Any]:
    """Return all checks as plain numbers and text, for --json; null stands for what is not finite."""
    checks: list[LawCheck | MapCheck] = [*laws, *maps]
    whole = {
        "device": device,
        "passed": not any(one.broken for one in checks),
        "laws": [{**_check_content(one), "spreads": one.spreads} for one in laws],
        "maps": [_check_content(one) for one in maps],
        "costs": dict(costs),
        "float16": {_at_index(one.of): {"rel": one.rel, "ks": one.ks} for one in halves},
    }
    return dict(plain(whole))


def _check_content(check: LawCheck | MapCheck) -> dict[str, Any]:
    return {
        "name": check.of.name,
        "constants": check.of.constants,
        "setting": check.of.setting,
        "model": check.model,
        "rounding": check.rounding,
        "measured": check.measured,
        "inside": check.inside,
        "outside": check.outside,
        "bounds": check.bounds,
        "broken": [str(bound) for bound in check.broken],
    }


def _called(check: LawCheck | MapCheck) -> str:
    """Return a label that distinguishes a map from the law of its name, and an index from others."""
    name = _at_index(check.of)
    return f"map {name}" if isinstance(check, MapCheck) and not check.of.records else name


def _at_index(named: LoadedLaw) -> str:
    where = f", n = {named.setting.n:g}" if named.setting.n != 1.0 else ""
    return named.label + where + (f", g = {named.setting.g:g}" if named.setting.g else "")


def _law_cells(check: LawCheck) -> tuple[str, ...]:
    """Return model and float32 error of profile and cdf; float32 error of radii, and of their pdf."""
    rounding = {name: value for name, value in check.rounding.items() if JUDGED[name] in check.spreads}
    own = check.spreads.get(OWN)
    cells = [value for name in ("rel", "ks") for value in (check.model.get(name), rounding.get(name))]
    return tuple(significant(value) for value in (*cells, rounding.get("inversion_error"), own.most if own else None))


def _map_cells(check: MapCheck) -> tuple[str, ...]:
    return tuple(
        significant(value)
        for name in ("delta_A", "delta_alpha")
        for value in (check.model.get(name), check.rounding[name])
    )


def _counts(check: LawCheck | MapCheck) -> tuple[str, str]:
    return str(check.inside.total), str(check.outside.total)


def _result(check: LawCheck | MapCheck) -> str:
    return FAIL if check.broken else PASS


def _setting(named: LoadedLaw) -> tuple[str, str, str]:
    return named.setting.illumination, f"{named.setting.n:g}", f"{named.setting.g:g}"
