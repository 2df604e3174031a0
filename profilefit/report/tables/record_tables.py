"""Records as tables for a terminal: pure functions from what a record says to what rich prints.

Cells are `Text`, so that units in brackets are no markup. Every table fits 80 columns, most of 100 look better.
"""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mcml_sim.media.setting import Setting
from profilefit.recipes.checks import SAME_COST
from profilefit.recipes.kinds.stack import PIPELINE as STACK
from profilefit.report.records import (
    TOTAL,
    Content,
    at_index,
    converged,
    cosine_words,
    index_words,
    known_errors,
    largest_error,
    z_score,
)
from profilefit.report.tables.cells import (
    ABSENT,
    column_table,
    interval,
    on_the_point,
    row_table,
    significant,
    to_error,
)
from profilefit.report.tables.evidence_tables import evidence_tables
from profilefit.report.tables.quality_tables import quality_tables, spark_table
from profilefit.report.tables.stack_table import stack_tables
from profilefit.report.tables.summary_tables import summary, truth

__all__ = ["constants_table", "record_tables", "summary"]

Line = tuple[str, RenderableType]
MEANING_OF_ERROR = {
    "photons": "noise of the simulation",
    "dr": "radial bins of finite width",
    "model": "the law's misfit, as a random function of the same size and correlation lengths",
    "misfit": "the misfit taken for independent noise, which it is not",
    "jackknife": "leaving out a sixth of the albedos",
}
DERIVED = {
    "radius": ("r [mfp]", "Radius within which 99.5 % of the light leaves"),
    "reflectance": ("A", "Total reflectance"),
}
TENFOLD = 10.0  # standard errors beyond which tenths of one say nothing
KINDS = {"statistical": "photon noise", "misfit": "misfit as noise"}


def record_tables(content: Content) -> list[RenderableType]:
    """Return everything about one record: where it comes from, constants, the state of fit and chains, quality."""
    if content["pipeline"] == "evidence":
        return _spaced([_title(content), *evidence_tables(content)])
    if content["pipeline"] == STACK:
        return _spaced([_title(content), *stack_tables(content)])
    parts = [_title(content), constants_table(content), intervals_table(content)]
    if "derived" in content:
        parts.append(derived_table(content["derived"], at_index(content)))
    parts.append(fit_facts(content))
    if "stages" in content:
        parts += stage_tables(content["stages"])
    parts += [*spark_table(content), *quality_tables(content)]
    return _spaced(parts)


def _spaced(parts: list[RenderableType]) -> list[RenderableType]:
    return [Padding(part, (0, 0, 1, 0)) for part in parts]


def constants_table(content: Content) -> RenderableType:
    """Name, published (where there is one) and regenerated value, and the errors, each on its decimal point."""
    constants = content["constants"]
    rows = list(constants.values())
    columns: dict[str, list[str]] = {}
    if any(row.get("published") is not None for row in rows):
        columns["\npublished"] = on_the_point([f"{v:g}" if v is not None else ABSENT for v in _each(rows, "published")])
    columns["\nregenerated"] = on_the_point([to_error(row["regenerated"], largest_error(row)) for row in rows])
    known = known_errors(constants)
    for place, (key, word) in enumerate(known.items()):
        texts = on_the_point([significant(value) for value in _each(rows, key)])
        if place == 0:
            texts = [text if row.get("free", True) else "held" for text, row in zip(texts, rows, strict=True)]
        columns[f"±\n{word}"] = texts
    scores = [z_score(row) for row in rows]
    meanings = [f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values()]
    if any(score is not None for score in scores):
        columns["\nz"] = [ABSENT if z is None else f"{z:+.0f}" if abs(z) >= TENFOLD else f"{z:+.1f}" for z in scores]
        meanings.append(f"z: published less regenerated, over the errors of {TOTAL}, combined")
    title = "Constants, lengths in units of the transport mean free path"
    caption = "; ".join(meanings)
    if not converged(content):
        caption = f"The fit failed, so these are where it stopped, and no law: {content['fit']['result']}"
    return column_table(title, {"": list(constants), **columns}, caption)


def intervals_table(content: Content) -> RenderableType:
    """Return the 68 % and 95 % credible intervals of each constant, one line for each kind of error."""
    chains = content["posterior"]
    if not chains:
        return Text("No credible intervals: a chain starts from a fit that converged.")
    rows = []
    for name, constant in content["constants"].items():
        for place, kind in enumerate(kind for kind in KINDS if kind in constant.get("intervals", {})):
            levels = (constant["intervals"][kind].get(level) for level in ("68%", "95%"))
            rows.append(("" if place else name, KINDS[kind], *map(interval, levels)))
    return row_table("Credible intervals (emcee)", ("", "from", "68 %", "95 %"), rows, left=("", "from"))


def derived_table(derived: Content, surface: str = "") -> RenderableType:
    """Return A, or the radius of 99.5 % of the energy, at a few albedos, each with its two errors."""
    errors = derived["statistical"], derived["model"]
    both = [max((e for e in pair if e is not None), default=None) for pair in zip(*errors, strict=True)]
    header, title = DERIVED[derived["quantity"]]
    columns = {
        "α": [f"{alpha:g}" for alpha in derived["alpha"]],
        header: on_the_point([to_error(v, e) for v, e in zip(derived["value"], both, strict=True)]),
        "± photons": on_the_point([significant(error) for error in errors[0]]),
        "± model": on_the_point([significant(error) for error in errors[1]]),
    }
    return column_table(
        title + surface, columns, "model: how far the law is from the truth; one standard error each", ("α",)
    )


def fit_facts(content: Content) -> RenderableType:
    """Return the results of the solver and of the chains."""
    fit = content["fit"]
    left = fit["residuals"]
    lines: list[Line] = [
        ("fit", _verdict(fit["result"])),
        ("", f"{fit['steps']} steps, condition number {significant(fit['condition_number'], 3)}"),
        ("residuals", f"rms {significant(left['rms'], 3)}, largest {significant(left['largest'], 3)}"),
        ("", f"autocorrelation {left['along_r']:.2f} along r, {left['along_alpha']:.2f} along α (0: noise only)"),
        ("", f"{left['half_waves']:.1f} sign runs: the effective number of independent residuals"),
    ]
    for kind, chain in content["posterior"].items():
        facts = f"τ {significant(chain['tau'])} steps, acceptance {chain['acceptance']:.2f}"
        lines.append((f"chain, {KINDS.get(kind, kind)}", _verdict(chain["result"])))
        lines.append(("", f"{facts}, {chain['steps']} steps of {chain['walkers']} walkers"))
    if off := content.get("discrepancy"):
        lines += _discrepancy(off)
    if left := content.get("left_out"):
        facts = (
            f"{left['rings']} radial bins and {left['albedos']} albedos left out: too few photons for a standard error"
        )
        lines.append(("data", facts))
    return _facts("Fit", lines + _second_opinions(content))


def _discrepancy(off: Content) -> list[Line]:
    """Return the Gaussian process that the residuals are taken for."""
    if off["amplitude"] is None:
        return [("discrepancy", _verdict(off["result"]))]
    amplitude = to_error(off["amplitude"], off["amplitude_error"])
    reach = f"correlation length {significant(off['length_s'])} in √(1 − α)"
    if off["length_r"] is not None:
        reach += f", {significant(off['length_r'])} in ln r"
    size = f"amplitude {amplitude} ± {significant(off['amplitude_error'])}; residuals {significant(off['rms'])} rms"
    return [("discrepancy", size), ("", f"{reach}; {off['result']}")]


def _second_opinions(content: Content) -> list[Line]:
    """Return what random starts found, and whether photons give the same constants as the exact profile."""
    lines: list[Line] = []
    if tried := content.get("starts"):
        best = round(tried["share_best"] * tried["count"])
        lines.append(("random starts", f"{best} of {tried['count']} reach the best optimum"))
        for other in tried["outcomes"]:
            ratio = other["cost_ratio"]
            if ratio is None or ratio > 1 + SAME_COST:
                cost = "" if ratio is None else f"misfit {significant(ratio)} times the best: "
                lines.append(("", f"{other['count']}: {cost}{other['result'].split(':')[0]}"))
    if check := content.get("crosscheck"):
        lines.append(("photons", check["result"]))
        facts = (
            f"χ² {significant(check['chi2'], 3)} in {check['rank']} directions, p-value {significant(check['chance'])}"
        )
        lines.append(("", f"{facts}, {check['photons']:.2g} photons"))
    return lines


def stage_tables(stages: Content) -> list[RenderableType]:
    """Return the paper's own order: coefficient laws through per-albedo fits, and how a, b, c scale with l."""
    rows = []
    states: list[Line] = []
    for letter, law in stages["coefficient_laws"].items():
        errors = law.get("standard_error", {}) if law["result"] == "converged" else {}
        for name, value in law["constants"].items():
            rows.append((name, to_error(value, errors.get(name)), significant(errors.get(name))))
        states.append((f"law of {letter}", _verdict(law["result"])))
        states.append(("", f"condition number {significant(law['condition_number'], 3)}"))
    failures = {mfp: count for mfp, count in stages.get("per_albedo_failures", {}).items() if count}
    text = "all converged" if not failures else ", ".join(f"{n} failed at l = {mfp}" for mfp, n in failures.items())
    states.append(("fits of (7)", text))
    if stages.get("length_exponents"):
        powers = ", ".join(f"{letter} l^{power:.3f}" for letter, power in stages["length_exponents"].items())
        states.append(("with l", f"{powers}; similarity says −1, 0, 1"))
    title, header = "Stages: coefficient laws through the fits at each albedo", ("", "through the points", "± photons")
    return [row_table(title, header, rows, aligned=header[1:]), _facts("", states)]


def _title(content: Content) -> RenderableType:
    head = Text.assemble((content["name"], "bold"), "  ", content["title"])
    return Group(head, Padding(_facts("", _provenance(content)), (0, 0, 0, 2)))


def _provenance(content: Content) -> list[Line]:
    setting = content["setting"]
    beam = " (a pencil beam, normal, collimated)" if setting["illumination"] == Setting().illumination else ""
    surface = f"every n in {index_words(content)}" if content.get("indices") else f"n = {setting['n']:g}"
    g = f"every g in {cosine_words(content)}" if content.get("cosines") else f"g = {setting['g']:g}"
    light = f"{setting['illumination']}{beam}, {surface}, {g}"
    if content.get("indices"):
        light += f"; tables and figures are of {at_index(content).removeprefix(', ')} where they do not say another"
    lines: list[Line] = [
        ("law", f"{content['law']}, {content['equations']}"),
        ("setting", light),
        ("truth", f"{truth(content)}, seed {content['seed']}, preset {content['preset']}"),
    ]
    protocol = content.get("protocol") or {}
    if protocol.get("albedos"):
        a = protocol["albedos"]
        lines.append(("albedos", f"{a['count']} from {a['low']:g} to {a['high']:g}, even in {a['spacing']}"))
    if protocol.get("indices"):
        lines.append(("indices", ", ".join(f"{n:g}" for n in protocol["indices"])))
    if protocol.get("cosines"):
        lines.append(("g", ", ".join(f"{g:g}" for g in protocol["cosines"]) + "; albedos and radii are reduced"))
    if protocol.get("rings"):
        lines.append(("bins", _rings(protocol["rings"])))
    if protocol.get("weighting"):
        lines.append(("weighting", _weighting(protocol["weighting"])))
    if protocol.get("held"):
        lines.append(("held", ", ".join(protocol["held"])))
    if content.get("note"):
        lines.append(("note", content["note"]))
    return lines


def _rings(rings: Content) -> str:
    if rings.get("dr"):
        text = f"even, {rings['dr']:g} wide, to {rings['last']:g}"
    else:
        text = f"{rings['count']} edges even in ln r, {rings['first']:g} to {rings['last']:g} [mfp]"
    trim = rings.get("trim", "none")
    return text if trim == "none" else f"{text}; trimmed by (6) on {trim}, ε = {rings['epsilon']:g}"


def _weighting(weighting: Content) -> str:
    extras = [
        f"{key.replace('_', ' ')} × {weighting[key]:g}" for key in ("energy_limit", "source_limit") if weighting[key]
    ]
    if weighting.get("shares"):
        extras.append(f"{weighting['shares']} shares up to {weighting['last_share']:g}")
    return "; ".join([f"objective {weighting['objective']}", *extras])


def _verdict(result: str) -> Text:
    """Return the result of a solver or a chain; anything but success stands out."""
    return Text(result, style="green") if result == "converged" else Text(f"FAILED: {result}", style="bold red")


def _facts(title: str, lines: Iterable[Line]) -> RenderableType:
    table = Table(box=None, show_header=False, padding=(0, 1, 0, 0), title=title or None)
    table.title_justify, table.title_style = "left", "bold"
    table.add_column(no_wrap=True, style="dim")
    table.add_column(overflow="fold")
    for label, line in lines:
        table.add_row(Text(label), Text(line) if isinstance(line, str) else line)
    return table


def _each(rows: list[Content], key: str) -> list[float | None]:
    return [row.get(key) for row in rows]
