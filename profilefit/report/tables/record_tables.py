"""Records as tables for a terminal: pure functions from what a record says to what rich prints.

Cells are `Text`, so that units in brackets are no markup. Every table fits 80 columns, most of 100 look better.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf, log
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from mcml_sim.media.setting import Setting
from profilefit.recipes import record
from profilefit.recipes.checks import SAME_COST
from profilefit.recipes.reproduction import NORMALIZED_DIFFUSION
from profilefit.report import records
from profilefit.report.records import SETS, Content, at_index, converged, largest_error
from profilefit.report.tables import cells
from profilefit.report.tables.cells import ABSENT, column_table, on_the_point, row_table, significant, to_error
from profilefit.report.tables.quality_tables import quality_tables, spark_table, values_of, worst_measures

if TYPE_CHECKING:
    from profilefit.recipes.regenerate import Reproduction

Line = tuple[str, RenderableType]
MEANING_OF_ERROR = {
    "photons": "photon noise",
    "dr": "width of radial bins",
    "model": "misfit of the model, as a random function of equal size and correlation lengths",
    "misfit": "misfit treated as independent noise",
    "jackknife": "spread of fits that leave out a sixth of the albedos",
}
DERIVED = {
    "radius": ("r [mfp]", "Radius that contains 99.5 % of the energy"),
    "reflectance": ("A", "Total diffuse reflectance"),
}
TENFOLD = 10.0  # standard errors beyond which tenths of one say nothing
LIMITS = ("energy_limit", "source_limit")  # of a profile, that weigh in its fit
KINDS = {"statistical": "photon noise", "misfit": "misfit as noise"}


def record_tables(content: Content) -> list[RenderableType]:
    """Return everything about one record: where it comes from, constants, the state of fit and chains, quality."""
    if content["pipeline"] == "evidence":
        return spaced([title_of(content), *evidence_tables(content)])
    parts = [title_of(content), constants_table(content), _intervals_table(content)]
    if "derived" in content:
        parts.append(_derived_table(content["derived"], at_index(content)))
    parts.append(fit_facts(content))
    if "stages" in content:
        parts += stage_tables(content["stages"])
    return spaced([*parts, *spark_table(content), *quality_tables(content)])


def spaced(parts: Sequence[RenderableType]) -> list[RenderableType]:
    """Return the parts with a blank line below each."""
    return [Padding(part, (0, 0, 1, 0)) for part in parts]


def constants_table(content: Content) -> RenderableType:
    """Name, published (where there is one) and regenerated value, and the errors, each on its decimal point."""
    constants = content["constants"]
    rows = list(constants.values())
    columns: dict[str, list[str]] = {}
    published = [row.get("published") for row in rows]
    if any(v is not None for v in published):
        columns["\npublished"] = on_the_point([f"{v:g}" if v is not None else ABSENT for v in published])
    columns["\nregenerated"] = on_the_point([to_error(row["regenerated"], largest_error(row)) for row in rows])
    known = records.known_errors(constants.values())
    for place, (key, word) in enumerate(known.items()):
        texts = on_the_point([significant(row.get(key)) for row in rows])
        if place == 0:
            texts = [text if row.get("free", True) else "held" for text, row in zip(texts, rows, strict=True)]
        columns[f"±\n{word}"] = texts
    scores = [records.z_score(row) for row in rows]
    meanings = [f"{word}: {MEANING_OF_ERROR[word]}" for word in known.values()]
    if any(score is not None for score in scores):
        columns["\nz"] = [ABSENT if z is None else f"{z:+.0f}" if abs(z) >= TENFOLD else f"{z:+.1f}" for z in scores]
        meanings.append(f"z: published minus regenerated, over the combined error ({records.TOTAL})")
    title = "Constants, lengths in units of the transport mean free path"
    caption = "; ".join(meanings)
    if not converged(content):
        caption = f"The fit failed, and its last values are no model: {content['fit']['result']}"
    return column_table(title, {"": list(constants), **columns}, caption)


def _intervals_table(content: Content) -> RenderableType:
    """Return the 68 % and 95 % credible intervals of each constant, one line for each kind of error."""
    chains = content["posterior"]
    if not chains:
        return Text("No credible intervals: the fit did not converge.")
    rows = []
    for name, constant in content["constants"].items():
        for place, kind in enumerate(kind for kind in KINDS if kind in constant.get("intervals", {})):
            levels = (constant["intervals"][kind].get(level) for level in ("68%", "95%"))
            rows.append(("" if place else name, KINDS[kind], *map(cells.interval, levels)))
    return row_table("Credible intervals (emcee)", ("", "from", "68 %", "95 %"), rows, left=("", "from"))


def _derived_table(derived: Content, surface: str = "") -> RenderableType:
    """Return A, or the radius of 99.5 % of the energy, at a few albedos, each with its two errors."""
    columns = (derived[key] for key in ("alpha", "value", "statistical", "model"))
    rows = []
    for alpha, value, *errors in zip(*columns, strict=True):
        largest = max((error for error in errors if error is not None), default=None)
        rows.append((f"{alpha:g}", to_error(value, largest), *map(significant, errors)))
    quantity, title = DERIVED[derived["quantity"]]
    header = ("α", quantity, "± photons", "± model")
    caption = "One standard error each: of photon noise and of the model"
    return row_table(title + surface, header, rows, caption, ("α",), aligned=header[1:])


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
    if (off := content.get("discrepancy")) and off["amplitude"] is None:
        lines.append(("discrepancy", _verdict(off["result"])))
    elif off:  # the Gaussian process that the residuals are taken for
        amplitude = to_error(off["amplitude"], off["amplitude_error"])
        reach = f"correlation length {significant(off['length_s'])} in √(1 − α)"
        if off["length_r"] is not None:
            reach += f", {significant(off['length_r'])} in ln r"
        size = f"amplitude {amplitude} ± {significant(off['amplitude_error'])}; residuals {significant(off['rms'])} rms"
        lines += [("discrepancy", size), ("", f"{reach}; {off['result']}")]
    if left := content.get("left_out"):
        what = f"{left['rings']} radial bins and {left['albedos']} albedos"
        lines.append(("data", f"{what} left out: too few photons for a standard error"))
    return _facts("Fit", lines + _second_opinions(content))


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
        facts = f"χ² {significant(check['chi2'], 3)} in {check['rank']} directions"
        chance = f"p-value {significant(check['chance'])}, {check['photons']:.2g} photons"
        lines += [("photons", check["result"]), ("", f"{facts}, {chance}")]
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
        states.append(("scaling", f"{powers}; expected −1, 0, 1"))
    title, header = "Coefficients of the fits at each albedo, fitted over albedo", ("", "fitted", "± photons")
    return [row_table(title, header, rows, aligned=header[1:]), _facts("", states)]


def title_of(content: Content) -> RenderableType:
    """Return name and title of a record, and below them what it was fitted to, and how."""
    setting, protocol = content["setting"], content.get("protocol") or {}
    beam = " (a pencil beam, normal, collimated)" if setting["illumination"] == Setting().illumination else ""
    light = f"{setting['illumination']}{beam}"
    for name, ranges in record.SPANS.items():
        is_in = f"every {name} in" if content.get(ranges) else f"{name} ="
        light += f", {is_in} {records.index_words(content, name)}"
    if content.get("indices"):
        light += f"; tables and figures show {at_index(content).removeprefix(', ')} unless they name another"
    lines: list[Line] = [
        ("model", f"{content['law']}, {content['equations']}"),
        ("setting", light),
        ("reference", f"{truth(content)}, seed {content['seed']}, preset {content['preset']}"),
    ]
    if a := protocol.get("albedos"):
        lines.append(("albedos", f"{a['count']} from {a['low']:g} to {a['high']:g}, even in {a['spacing']}"))
    if indices := protocol.get("indices"):
        lines.append(("indices", ", ".join(f"{n:g}" for n in indices)))
    if cosines := protocol.get("cosines"):
        lines.append(("g", ", ".join(f"{g:g}" for g in cosines) + "; reduced albedos and radii"))
    if rings := protocol.get("rings"):
        even = f"even, {rings['dr']:g} wide, to {rings['last']:g}" if rings.get("dr") else ""
        text = even or f"{rings['count']} edges even in ln r, {rings['first']:g} to {rings['last']:g} [mfp]"
        if (trim := rings.get("trim", "none")) != "none":
            text += f"; trimmed by (6) on {trim}, ε = {rings['epsilon']:g}"
        lines.append(("bins", text))
    if weighting := protocol.get("weighting"):
        extras = [f"{key.replace('_', ' ')} × {weighting[key]:g}" for key in LIMITS if weighting[key]]
        if weighting.get("shares"):
            extras.append(f"{weighting['shares']} shares up to {weighting['last_share']:g}")
        lines.append(("weighting", "; ".join([f"objective {weighting['objective']}", *extras])))
    if held := protocol.get("held"):
        lines.append(("held", ", ".join(held)))
    if note := content.get("note"):
        lines.append(("note", note))
    head = Text.assemble((content["name"], "bold"), "  ", content["title"])
    return Group(head, Padding(_facts("", lines), (0, 0, 0, 2)))


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


BEST = 3  # readings shown of each equation, nearest to print first


def evidence_tables(content: Content) -> list[RenderableType]:
    """Return the best readings of each equation with their evidence, and the nearest rows of the paper's table 1."""
    parts = [_readings_of(equation, readings) for equation, readings in _by(content["readings"], "equation").items()]
    if content["table1"]:
        parts.append(_table1(content["table1"]))
    if halves := content.get("halves"):
        lines = [(f"{row.get('material', ABSENT)}, {row.get('model', '')}", _share(row.get("off"))) for row in halves]
        title = "Table 1 as published: mean of both halves over the whole range, minus 1"
        parts.append(row_table(title, ("material", "difference"), lines, left=("material",)))
    return parts or [Text("This record has no readings.")]


def _readings_of(equation: str, readings: list[Content]) -> RenderableType:
    rows = []
    for one in sorted(readings, key=lambda one: inf if one["curve_distance"] is None else one["curve_distance"])[:BEST]:
        pairs = []
        for name, value in one["constants"].items():
            printed = f" (printed {one['published'][name]:g})" if name in one["published"] else ""
            pairs.append(f"{name} {value:.4g}{printed}")
        text = "\n".join(part for part in (one["choices"], ", ".join(pairs), one.get("evidence")) if part)
        rows.append((one["verdict"], _share(one["curve_distance"]), _share(one["constant_distance"]), text))
    more = len(readings) - len(rows)
    caption = f"The record has {more} more readings, which differ more from print." if more else ""
    title = f"{equation}: rms difference of the curve and largest difference of a constant, relative to print"
    header = ("verdict", "curve", "constants", "reading, constants, evidence")
    return row_table(title, header, rows, caption, left=("verdict",), fold=header[-1:])


def _table1(rows: list[Content]) -> RenderableType:
    """Return every model of each material, at the channel and range that the other law's printed error points to."""
    shown: list[Content] = []
    for group in _by(rows, "material").values():
        known = (row for row in group if row.get("model") == NORMALIZED_DIFFUSION)
        best = min(known, key=lambda row: abs(log(_ratio(row)[-1])) if _ratio(row) else inf, default=None)
        of_best = ("channel", "range_choice", "range_mm")
        shown += [row for row in group if best is None or all(row.get(key) == best.get(key) for key in of_best)]
    lines = []
    for row in shown:
        size = f"{row['range_mm']:g} mm" if "range_mm" in row else ABSENT
        material = f"{row.get('material', ABSENT)}, {row.get('channel', '')}, {size}"
        ratios = [*(significant(ratio, 3) for ratio in _ratio(row)), *[ABSENT] * 3]
        lines.append((material, row.get("model", ABSENT), *ratios[:3]))
    caption = (
        f"MSE over the published MSE, {len(shown)} of {len(rows)} rows. The paper does not state channel and range: "
        "here they are those at which normalized diffusion is closest to its published error."
    )
    header = ("material", "model", "near half", "far half", "all")
    return row_table("Table 1 recomputed", header, lines, caption, left=("material",), fold=("model",))


def _ratio(row: Content) -> list[float]:
    return list(row.get("mse_over_printed", ()))


def _share(value: float | None) -> str:
    return ABSENT if value is None else f"{100 * value:.1f} %"


def _by(rows: Iterable[Content], key: str) -> dict[Any, list[Content]]:
    """Return rows by the values of a key, in order."""
    groups: dict[Any, list[Content]] = {}
    for row in rows:
        groups.setdefault(row.get(key, ABSENT), []).append(row)
    return groups


# All records on one screen: a line each, what was fitted to what, and its worst error before and after.

SPARK = 8  # characters of a sparkline: 80 columns hold no more beside the longest name
FAILED = "FAILED"
Records = Mapping[str, Content]
REPRODUCED = "Regenerated records: largest changes of their constants from the shipped records"
REPRODUCED_CAPTION = (
    "moved: change over the stated error, reproduced up to 0.05. relative: change over the constant. interval: change "
    "of an end of an interval, over the change that the Monte Carlo error of the chains allows. "
    f"{ABSENT}: no shipped record has equal photons, seed and layers."
)
CAPTION = (
    "Largest error over α, and over n where a record spans indices: published → corrected, if any → regenerated. "
    "`profilefit report NAME` prints constants, their errors, and errors by α."
)


# Measure that a kind of records has, by which one knows them -> title, and measures by their headers.
SUMMARIES = {
    "rel": ("Profile models: mean |model / exact − 1| of R_d over radii, and max |cdf − exact cdf|", {"R_d": "rel"}),
    "inversion_error": ("Samplers: max |cdf(r(ξ)) − ξ|", {"error": "inversion_error"}),
    "delta_A": (
        "Albedo inversions: error of A, relative error of √(1 − α)",
        {"A": "delta_A", "√(1 − α)": "largest_s"},
    ),
}


def summary(contents: Records, glyphs: bool = True) -> RenderableType:
    """Return profile laws, inverse cdfs, maps, and comparisons of readings, each kind in a table, `glyphs` too."""
    groups: dict[str, dict[str, Content]] = {measure: {} for measure in SUMMARIES}
    readings = {name: content for name, content in contents.items() if content["pipeline"] == "evidence"}
    for name, content in contents.items():
        if name not in readings:
            is_of = (measure for measure in ("delta_A", "rel") if records.measures(content, measure))
            groups[next(is_of, "inversion_error")][name] = content
    shown = [_summary_table(measure, group, glyphs) for measure, group in groups.items() if group]
    if readings:
        lines = []
        for content in readings.values():
            verdicts = [(one["equation"], one["verdict"]) for one in content["readings"]]
            good = {equation for equation, verdict in verdicts if verdict == "reproduced"}
            lines.append(f"{len(verdicts)} readings, {len(good)} of {len(dict(verdicts))} reproduced")
        columns = {"record": list(readings), "found": lines}
        shown.append(column_table("Readings of choices that a paper leaves open", columns, left=("record", "found")))
    failed = {name: content["fit"]["result"] for name, content in contents.items() if "fit" in content}
    failures = [Text(f"{name}: {text}", style="red") for name, text in failed.items() if text != "converged"]
    parts = [part for table in shown for part in (table, Text())]
    return Group(*parts, *failures, Text(CAPTION, style="dim"))


def _summary_table(measure: str, contents: Records, glyphs: bool) -> RenderableType:
    """Return a line a record: the worst of its measures, set by set, and how one that varies goes over α."""
    title, headers = SUMMARIES[measure]
    columns = {
        "record": list(contents),
        "n": [f"≤ {c['indices'][1]:g}" if c.get("indices") else f"{c['setting']['n']:g}" for c in contents.values()],
        "photons": [truth(content).removesuffix(" photons") for content in contents.values()],
        **{header: [_course(content, key) for content in contents.values()] for header, key in headers.items()},
    }
    if measure == "rel":
        columns["cdf"] = [_course(content, "ks").rpartition(" → ")[2] for content in contents.values()]
    if glyphs and measure != "delta_A":
        rows = [values_of(content["quality"]["regenerated"], measure) or [] for content in contents.values()]
        columns["over α"] = [cells.spark(row, cells.span(rows), SPARK) for row in rows]
    return column_table(title, columns, left=("record", "over α"))


def outcome(path: Path) -> dict[str, Any]:
    """Return what came out of a recipe, for --json: constants with their errors, and the worst errors over alpha."""
    content = record.read(path)
    body: dict[str, Any] = {"path": path, "law": content["law"], "equations": content.get("equations")}
    if "fit" not in content:
        return {**body, "readings": len(content.get("readings", []))}
    kept = ("published", "regenerated", *record.ERRORS)
    constants = {name: {key: one.get(key) for key in kept} for name, one in content["constants"].items()}
    return {**body, "result": content["fit"]["result"], "constants": constants, "worst": worst_measures(content)}


def reproduced(
    seconds: Mapping[str, float], paths: Mapping[str, Path], reproductions: Mapping[str, Reproduction | None]
) -> RenderableType:
    """Return seconds of each record and of each setting's light, and how far each record is from the shipped one."""
    rows = []
    for name, spent in seconds.items():
        one, content = reproductions.get(name), record.read(paths[name]) if name in paths else {"fit": {"result": ""}}
        result = content["fit"]["result"] if "fit" in content else f"{len(content.get('readings', []))} readings"
        numbers = (one.moved, one.relative, one.intervals) if one else ()
        shown = [str(one.constants) if one else ABSENT, *(f"{value:.1g}" for value in numbers)] + [ABSENT] * 3
        rows.append([name, f"{spent:.1f}", *shown[:4], (one.problem if one else "") or result])
    headers = ("record", "seconds", "constants", "moved", "relative", "interval", "result")
    return row_table(REPRODUCED, headers, rows, REPRODUCED_CAPTION, left=("record",), fold=("result",))


def verdict(reproductions: Sequence[Reproduction]) -> str:
    """Return one line: how many records are reproduced, and the largest move of a constant."""
    count, moved = sum(one.is_reproduced for one in reproductions), max(one.moved for one in reproductions)
    return f"{count} of {len(reproductions)} records reproduced; largest move {moved:.1g} of a stated error"


def photons_text(content: Content) -> str:
    """Return how many photons a record was fitted to; – where its light is exact."""
    photons = (content.get("truth") or {}).get("photons")
    return ABSENT if photons is None else f"{photons:.3g}".replace("e+0", "e")


def truth(content: Content) -> str:
    """Return what a record was fitted to: the exact solution, or so many photons."""
    text = photons_text(content)
    return f"{text} photons" if text != ABSENT else str((content.get("truth") or {}).get("kind", ABSENT))


def _course(content: Content, measure: str) -> str:
    """Return the worst error of each set in turn; a failed fit has no law to measure."""
    worst = worst_measures(content).get(measure, {})
    shown = [significant(worst[name]) for name in SETS if name in worst]
    if not converged(content):
        shown.append(FAILED)
    return " → ".join(shown)
