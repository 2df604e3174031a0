"""Checks of shader sources: a row for each law, where errors are largest, what an evaluation costs, broken bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.record import plain
from profilefit.report.tables.cells import ABSENT, row_table, significant
from profilefit.report.tables.markdown import markdown_table
from profilefit.shader.check.chosen import REGENERATED, Checked, checked, chosen
from profilefit.shader.check.dense_grid import ShaderCheck
from profilefit.shader.check.law_check import HALVES, JUDGED, OWN, HalfCheck, LawCheck, MapCheck
from profilefit.shader.check.law_cost import WORKS, Cost

Group = tuple[str, tuple[str, ...], Sequence[ShaderCheck]]
PASS, FAIL = "pass", "FAIL"
LAW_COLUMNS = ("rel\nmodel", "rel\nfloat32", "ks\nmodel", "ks\nfloat32", "sample\nfloat32", "pdf\n99 %")
MAP_COLUMNS = ("A\nmodel", "A\nfloat32", "α\nmodel", "α\nfloat32")
COUNTS = ("bad\nin", "bad\nout")
# Of markdown: what float32 adds.
LAW_HEADERS = ("R_d [1e-6]", "cumulative energy [1e-6]", "radius [1e-6]", "density [1e-6]")
MAP_HEADERS = ("A [1e-6]", "α [1e-6]")
COSTS = ("law", *(f"{work} [ns]" for work in tuple(WORKS)[:3]))
CAPTION = (
    "model: the record's error against the exact half space or photons, worst albedo (of printed constants that of "
    "the regenerated); float32: what rounding adds, at worst; sample: share of the energy between both radii; pdf: the "
    "density in the source against the slope of the sampler's own map; bad: NaN, Inf, negative, not monotone, in and "
    "out of where the law holds"
)
COST_CAPTION = (
    "ns and, in brackets, times normalized diffusion. profile: R_d; sample: a radius; both: a radius and R_d there; "
    "estimate: a sample of (22), that is a radius, its density and R_d at another distance; material: both, with "
    "another α at each. For the exported source; constants do not change it"
)
HALF_CAPTION = "mean relative error of R_d / largest error of the cdf by float16 alone, worst of 24 albedos, l = 1"


def check_tables(outcome: Checked, in_detail: bool = False) -> list[RenderableType]:
    """Return a line a law and a line a map, costs and half precision; `in_detail` each law's errors as well."""
    parts: list[RenderableType] = []
    for kind, names, checks in _groups(outcome):
        has_g = any(one.of.setting.g for one in checks)
        header = (kind, "n", *(("g",) if has_g else ()), *names, *COUNTS, "result")
        rows = [(one.of.label, *_setting(one.of)[: 1 + has_g], *_cells(one)) for one in checks]
        title, caption = f"{kind.capitalize()}s in float32, {outcome.device}", CAPTION if kind == "law" else ""
        parts.append(row_table(title, header, rows, caption, left=("result",), fold=(kind,)))
    parts += _place_tables(outcome.laws) if in_detail else []
    if outcome.costs:
        title, header = f"Cost of one evaluation, {outcome.device}", ("source", *WORKS)
        parts.append(row_table(title, header, _cost_rows(outcome.costs), COST_CAPTION, left=("source",)))
    return [*parts, *([_half_table(outcome.halves)] if outcome.halves else [])]


def _groups(outcome: Checked) -> list[Group]:
    """Return laws and maps, each with their name and the headers of their errors, as far as there are any."""
    laws: Group = ("law", LAW_COLUMNS, outcome.laws)
    maps: Group = ("map", MAP_COLUMNS, outcome.maps)
    return [group for group in (laws, maps) if group[2]]


def _place_tables(laws: Sequence[LawCheck]) -> list[RenderableType]:
    """Return the distribution of each law's errors, and where the largest is; below the GPU's beside the record's."""
    parts: list[RenderableType] = []
    for one in laws:
        each = one.spreads.items()
        rows = [(name, *map(significant, (at.half, at.most, at.largest)), at.where) for name, at in each]
        pairs = []
        for name, value in one.measured.items():
            pairs.append(f"{name} {significant(value, 3)} (model {significant(one.model.get(name), 3)})")
        caption = f"GPU against the exact half space: {', '.join(pairs)}" if pairs else ""
        header = ("float32 error", "50 %", "99 %", "largest", "at")
        parts.append(row_table(_called(one), header, rows, caption, left=("float32 error", "at")))
    return parts


def _cost_rows(costs: Mapping[str, Cost]) -> list[tuple[str, ...]]:
    works = {name: [(cost.ns[work], cost.ratio[work]) for work in WORKS] for name, cost in costs.items()}
    return [(name, *(f"{significant(ns)} ({ratio:.2f})" for ns, ratio in each)) for name, each in works.items()]


def _half_table(checks: Sequence[HalfCheck]) -> RenderableType:
    """Return a line a law, a column for each thing that is stored in float16."""
    stored = [name for name in HALVES if any(name in one.rel for one in checks)]
    rows = []
    for one in checks:
        pairs = ((one.rel.get(name), one.ks.get(name)) for name in stored)
        texts = (ABSENT if rel is None else f"{significant(rel)} / {significant(ks)}" for rel, ks in pairs)
        rows.append((_at_index(one.of), *texts))
    return row_table("Half precision", ("law", *stored), rows, HALF_CAPTION, fold=("law",))


def verdict_lines(checks: Sequence[LawCheck | MapCheck]) -> list[Text]:
    """Return the broken bounds, a line each, and the sum of it."""
    lines = [Text(f"{FAIL} {_called(one)}: {bound}") for one in checks for bound in one.broken]
    failed = sum(bool(one.broken) for one in checks)
    count = "1 law or map" if len(checks) == 1 else f"{len(checks)} laws or maps"
    return [*lines, Text(f"{count}: {f'{failed} fail' if failed else 'all pass'}", style="bold")]


def markdown_check(folder: Path) -> str:
    """Return the README's tables: all regenerated laws, and Liang et al.'s printed ones. ShaderError without OpenGL."""
    regenerated, printed = chosen((), REGENERATED, folder), chosen(("liang",), "published", folder)
    return markdown_checks(checked((regenerated[0] + printed[0], regenerated[1] + printed[1]), folder))


def markdown_checks(outcome: Checked) -> str:
    """Return the tables of a page: what float32 adds at worst, a line a law and a line a map, costs, the device."""
    parts = []
    for kind, _, checks in _groups(outcome):
        header = (kind, *(LAW_HEADERS if kind == "law" else MAP_HEADERS), "bad values", "result")
        labels = dict.fromkeys(one.of.label for one in checks)
        parts.append(markdown_table(header, [_row(name, [c for c in checks if c.of.label == name]) for name in labels]))
    if outcome.costs:
        parts.append(markdown_table(COSTS, [row[: len(COSTS)] for row in _cost_rows(outcome.costs)]))
    return "\n\n".join([*parts, f"Measured on {outcome.device}."])


def _row(label: str, checks: Sequence[ShaderCheck]) -> tuple[str, ...]:
    """Return the largest errors of float32 over n and g [1e-6], and bad values in/out of where the law holds."""
    added = zip(*(_numbers(one)[1:4:2] + _numbers(one)[4:] for one in checks), strict=True)
    worst = (max((1e6 * value for value in column if value is not None), default=None) for column in added)
    bad = (str(sum(getattr(one, where).total for one in checks)) for where in ("inside", "outside"))
    return (label, *map(significant, worst), "/".join(bad), FAIL if any(one.broken for one in checks) else PASS)


def content(outcome: Checked) -> dict[str, Any]:
    """Return all checks as plain numbers and text, for --json; null stands for what is not finite."""
    whole = {
        "device": outcome.device,
        "passed": not outcome.is_broken,
        "laws": [{**_check_content(one), "spreads": one.spreads} for one in outcome.laws],
        "maps": [_check_content(one) for one in outcome.maps],
        "costs": outcome.costs,
        "float16": {_at_index(one.of): {"rel": one.rel, "ks": one.ks} for one in outcome.halves},
    }
    return dict(plain(whole))


def _check_content(check: ShaderCheck) -> dict[str, Any]:
    measured = ("model", "rounding", "measured", "inside", "outside", "bounds")
    return {
        **{name: getattr(check.of, name) for name in ("name", "constants", "setting")},
        **{name: getattr(check, name) for name in measured},
        "broken": [str(bound) for bound in check.broken],
    }


def _called(check: ShaderCheck) -> str:
    """Return a label that distinguishes a map from the law of its name, and an index from others."""
    name = _at_index(check.of)
    return f"map {name}" if isinstance(check, MapCheck) and not check.of.records else name


def _at_index(named: LoadedLaw) -> str:
    where = f", n = {named.setting.n:g}" if named.setting.n != 1.0 else ""
    return named.label + where + (f", g = {named.setting.g:g}" if named.setting.g else "")


def _cells(check: ShaderCheck) -> tuple[str, ...]:
    """Return the errors, bad values and the verdict."""
    bad = (str(check.inside.total), str(check.outside.total))
    return (*map(significant, _numbers(check)), *bad, FAIL if check.broken else PASS)


def _numbers(check: ShaderCheck) -> list[float | None]:
    """Return model and float32 errors: of profile and cdf, or A and α; of radii and pdf."""
    rounding, more = check.rounding, list[float | None]()
    if isinstance(check, LawCheck):
        rounding = {name: value for name, value in rounding.items() if JUDGED[name] in check.spreads}
        own = check.spreads.get(OWN)
        more = [rounding.get("inversion_error"), own.most if own else None]
    names = ("delta_A", "delta_alpha") if isinstance(check, MapCheck) else ("rel", "ks")
    return [value for name in names for value in (check.model.get(name), rounding.get(name))] + more


def _setting(named: LoadedLaw) -> tuple[str, str]:
    return f"{named.setting.n:g}", f"{named.setting.g:g}"
