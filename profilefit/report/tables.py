"""Records as tables for a terminal: pure functions from what a record says to what rich prints.

Cells are `Text`, so that units in brackets are no markup. Every table fits 80 columns, most of 100 look better.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from profilefit.report.columns import column_table
from profilefit.report.content import Content, converged, known_errors, largest_error
from profilefit.report.digits import ABSENT, interval, on_the_point, significant, to_error
from profilefit.report.evidence_tables import evidence_line, evidence_tables
from profilefit.report.quality_tables import quality_tables, worst_lines
from profilefit.starts import SAME_COST

__all__ = ["constants_table", "record_tables", "summary"]

Line = tuple[str, RenderableType]
MEANING_OF_ERROR = {
    "photons": "another run's noise",
    "dr": "rings of finite width",
    "model": "what the law cannot follow, were it wrong in another way of the same size and reach",
    "misfit": "residuals taken for independent noise, which they are not",
    "jackknife": "what leaving out a sixth of the albedos moves",
}
DERIVED = {
    "radius": ("r [mfp]", "Radius within which 99.5 % of the light leaves"),
    "reflectance": ("A", "Total reflectance"),
}
KINDS = {"statistical": "photon noise", "discrepancy": "misfit as noise"}


def summary(records: Mapping[str, Content]) -> Table:
    """One line a record: what was fitted to what, whether it worked, and the worst error before and after."""
    table = Table(box=None, header_style="bold", padding=(0, 1, 0, 0), pad_edge=False)
    table.title, table.title_justify = "Records", "left"
    table.add_column("record", overflow="fold", min_width=max(map(len, records), default=0))
    for header in ("truth", "objective, fit", "worst error over α"):
        table.add_column(header, no_wrap=True)
    for name, content in records.items():
        table.add_row(*(_summary_evidence(name, content) if _is_evidence(content) else _summary_fit(name, content)))
    table.caption = "as printed → corrected, where there is such a set → regenerated"
    table.caption_justify = "left"
    return table


def _summary_fit(name: str, content: Content) -> tuple[Text, ...]:
    label = Text.assemble((name, "bold"), "\n", (f"{content['law']}, {content['equations']}", "dim"))
    if not converged(content):
        label.append(f"\n{content['fit']['result']}", style="red")
    objective = content["protocol"]["weighting"]["objective"].replace("_", "\n")
    verdict = Text("converged", style="green") if converged(content) else Text("FAILED", style="bold red")
    how = Text.assemble(objective, "\n", verdict)  # below it: names of records need the width
    return label, Text(truth(content)), how, Text("\n".join(worst_lines(content)))


def _summary_evidence(name: str, content: Content) -> tuple[Text, ...]:
    label = Text.assemble((name, "bold"), "\n", (str(content.get("equations", "")), "dim"))
    return label, Text(truth(content)), Text(ABSENT), Text(evidence_line(content))


def _is_evidence(content: Content) -> bool:
    return content["pipeline"] == "evidence"


def record_tables(content: Content) -> list[RenderableType]:
    """Everything about one record: where it comes from, constants, the state of fit and chains, quality."""
    if _is_evidence(content):
        return _spaced([_title(content), *evidence_tables(content)])
    parts = [_title(content), constants_table(content), intervals_table(content)]
    if "derived" in content:
        parts.append(derived_table(content["derived"]))
    parts.append(fit_facts(content))
    if "stages" in content:
        parts += stage_tables(content["stages"])
    parts += quality_tables(content)
    return _spaced(parts)


def _spaced(parts: list[RenderableType]) -> list[RenderableType]:
    return [Padding(part, (0, 0, 1, 0)) for part in parts]


def constants_table(content: Content) -> RenderableType:
    """Name, published (where there is one) and regenerated value, and the errors, each on its decimal point."""
    constants = content["constants"]
    rows = list(constants.values())
    columns: dict[str, list[str]] = {}
    if any(row.get("published") is not None for row in rows):
        columns["published"] = on_the_point([f"{v:g}" if v is not None else ABSENT for v in _each(rows, "published")])
    columns["regenerated"] = on_the_point([to_error(row["regenerated"], largest_error(row)) for row in rows])
    known = known_errors(constants)
    for place, (key, word) in enumerate(known.items()):
        texts = on_the_point([significant(value) for value in _each(rows, key)])
        if place == 0:
            texts = [text if row.get("free", True) else "held" for text, row in zip(texts, rows, strict=True)]
        columns[f"± {word}"] = texts
    title = "Constants, lengths in units of the mean free path"
    caption = "; ".join(f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values())
    if not converged(content):
        caption = f"The fit failed, so these are where it stopped, and no law: {content['fit']['result']}"
    return column_table(title, {"": list(constants), **columns}, caption)


def intervals_table(content: Content) -> RenderableType:
    """The 68 % and 95 % credible intervals of each constant, one line for each kind of error."""
    chains = content["posterior"]
    if not chains:
        return Text("No credible intervals: chains start from a fit that converged.")
    cells: dict[str, list[str]] = {"": [], "from": [], "68 %": [], "95 %": []}
    for name, constant in content["constants"].items():
        for place, kind in enumerate(kind for kind in KINDS if kind in constant.get("intervals", {})):
            levels = constant["intervals"][kind]
            cells[""].append("" if place else name)
            cells["from"].append(KINDS[kind])
            cells["68 %"].append(interval(levels.get("68%")))
            cells["95 %"].append(interval(levels.get("95%")))
    return column_table("Credible intervals (emcee)", cells, left=("", "from"))


def derived_table(derived: Content) -> RenderableType:
    """A, or the radius of 99.5 % of the energy, at a few albedos, each with its two errors."""
    errors = derived["statistical"], derived["model"]
    both = [max((e for e in pair if e is not None), default=None) for pair in zip(*errors, strict=True)]
    header, title = DERIVED[derived["quantity"]]
    columns = {
        "α": [f"{alpha:g}" for alpha in derived["alpha"]],
        header: on_the_point([to_error(v, e) for v, e in zip(derived["value"], both, strict=True)]),
        "± photons": on_the_point([significant(error) for error in errors[0]]),
        "± model": on_the_point([significant(error) for error in errors[1]]),
    }
    return column_table(title, columns, "model: how far the law is from the truth; one standard error each", ("α",))


def fit_facts(content: Content) -> RenderableType:
    """What the solver and the chains said."""
    fit = content["fit"]
    left = fit["residuals"]
    lines: list[Line] = [
        ("fit", _verdict(fit["result"])),
        ("", f"{fit['steps']} steps, condition number {significant(fit['condition_number'], 3)}"),
        ("residuals", f"rms {significant(left['rms'], 3)}, largest {significant(left['largest'], 3)}"),
        ("", f"autocorrelation {left['along_r']:.2f} along r, {left['along_alpha']:.2f} along α (0: noise only)"),
        ("", f"{left['half_waves']:.1f} stretches of one sign: so many residuals stand for themselves"),
    ]
    for kind, chain in content["posterior"].items():
        facts = f"τ {significant(chain['tau'])} steps, acceptance {chain['acceptance']:.2f}"
        lines.append((f"chain, {KINDS.get(kind, kind)}", _verdict(chain["result"])))
        lines.append(("", f"{facts}, {chain['steps']} steps of {chain['walkers']} walkers"))
    if off := content.get("discrepancy"):
        lines += _discrepancy(off)
    if left := content.get("left_out"):
        told = (
            f"{left['rings']} rings and {left['albedos']} albedos left out: too few photons for an error of their own"
        )
        lines.append(("data", told))
    return _facts("Fit", lines + _second_opinions(content))


def _discrepancy(off: Content) -> list[Line]:
    """The process that the residuals are taken for."""
    if off["amplitude"] is None:
        return [("discrepancy", _verdict(off["result"]))]
    amplitude = to_error(off["amplitude"], off["amplitude_error"])
    reach = f"reaching {significant(off['length_s'])} in √(1 − α)"
    if off["length_r"] is not None:
        reach += f", {significant(off['length_r'])} in ln r"
    size = f"amplitude {amplitude} ± {significant(off['amplitude_error'])}; residuals {significant(off['rms'])} rms"
    return [("discrepancy", size), ("", f"{reach}; {off['result']}")]


def _second_opinions(content: Content) -> list[Line]:
    """What random starts found, and whether photons give the same constants as the exact profile."""
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
            f"χ² {significant(check['chi2'], 3)} in {check['rank']} directions, chance {significant(check['chance'])}"
        )
        lines.append(("", f"{facts}, {check['photons']:.2g} photons"))
    return lines


def stage_tables(stages: Content) -> list[RenderableType]:
    """The paper's own order: coefficient laws through per-albedo fits, and how a, b, c scale with l."""
    cells: dict[str, list[str]] = {"": [], "through the points": [], "± photons": []}
    states: list[Line] = []
    for letter, law in stages["coefficient_laws"].items():
        errors = law.get("standard_error", {}) if law["result"] == "converged" else {}
        for name, value in law["constants"].items():
            error = errors.get(name)
            cells[""].append(name)
            cells["through the points"].append(to_error(value, error))
            cells["± photons"].append(significant(error))
        states.append((f"law of {letter}", _verdict(law["result"])))
        states.append(("", f"condition number {significant(law['condition_number'], 3)}"))
    failures = {mfp: count for mfp, count in stages.get("per_albedo_failures", {}).items() if count}
    text = "all converged" if not failures else ", ".join(f"{n} failed at l = {mfp}" for mfp, n in failures.items())
    states.append(("fits of (7)", text))
    if stages.get("length_exponents"):
        powers = ", ".join(f"{letter} l^{power:.3f}" for letter, power in stages["length_exponents"].items())
        states.append(("with l", f"{powers}; similarity says −1, 0, 1"))
    for key in ("through the points", "± photons"):
        cells[key] = on_the_point(cells[key])
    return [column_table("Stages: coefficient laws through the fits at each albedo", cells), _facts("", states)]


def truth(content: Content) -> str:
    """What a record was fitted to, on two lines where photons were traced."""
    source = content.get("truth") or {}
    if source.get("photons") is None:
        return str(source.get("kind", ABSENT))
    return f"{source['photons']:.3g}".replace("e+0", "e") + "\nphotons"


def _title(content: Content) -> RenderableType:
    head = Text.assemble((content["name"], "bold"), "  ", content["title"])
    return Group(head, Padding(_facts("", _provenance(content)), (0, 0, 0, 2)))


def _provenance(content: Content) -> list[Line]:
    setting = content["setting"]
    light = f"{setting['illumination']}, n = {setting['n']:g}, g = {setting['g']:g}"
    lines: list[Line] = [
        ("law", f"{content['law']}, {content['equations']}"),
        ("setting", light),
        ("truth", f"{truth(content).replace(chr(10), ' ')}, seed {content['seed']}, preset {content['preset']}"),
    ]
    protocol = content.get("protocol") or {}
    if protocol.get("albedos"):
        a = protocol["albedos"]
        lines.append(("albedos", f"{a['count']} from {a['low']:g} to {a['high']:g}, even in {a['spacing']}"))
    if protocol.get("rings"):
        lines.append(("rings", _rings(protocol["rings"])))
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
    """What a solver or a chain said; anything but success stands out."""
    return Text(result, style="green") if result == "converged" else Text(f"FAILED: {result}", style="bold red")


def _facts(title: str, lines: Iterable[Line]) -> RenderableType:
    table = Table(box=None, show_header=False, padding=(0, 1, 0, 0), title=title or None, title_justify="left")
    table.add_column(no_wrap=True, style="dim")
    table.add_column(overflow="fold")
    for label, line in lines:
        table.add_row(Text(label), Text(line) if isinstance(line, str) else line)
    return table


def _each(rows: list[Content], key: str) -> list[float | None]:
    return [row.get(key) for row in rows]
