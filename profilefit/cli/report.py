"""profilefit report: show records as tables, and draw their figures."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli import options
from profilefit.cli.folders import evidence_folder, known_phases, known_stacks, records_folder
from profilefit.cli.options import AsJson, Fits, Quiet
from profilefit.errors import InputError, OtherRecords, ShaderError

if TYPE_CHECKING:
    from profilefit.recipes.stack.sum_record import SumRecord
    from profilefit.report.tables.law_tables import Qualities

MEGABYTE = 1e6
MOST_MARKDOWN = 2**24  # bytes of a page whose tables are filled in


def report(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of records, of stacks as well; a summary of all if none is named.",
            autocompletion=options.records,
        ),
    ] = None,
    quality: Annotated[
        bool, typer.Option("--quality", help="Measure every law against the exact half space instead (a minute).")
    ] = False,
    claims: Annotated[
        bool, typer.Option("--claims", help="Print what is promised of accuracy and speed, beside what was measured.")
    ] = False,
    figures_to: Annotated[
        Path | None, typer.Option("--figures", help="Folder for the figures; without it none are drawn.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Fill the tables between the marks <!-- name --> of this file instead.")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(help="Write all of it as one HTML page, with figures and an explorer: two minutes."),
    ] = None,
    evidence: Annotated[
        Path | None,
        typer.Option(
            help="Folder that check, stability and tradeoff wrote into with --out, for the page and --claims: "
            "./evidence if it is there, else the one beside the records."
        ),
    ] = None,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show constants, their errors, and how good they are.

    Also quality by albedo, or by thickness of a stack of layers and by number of Gaussians, and the state of fits and
    chains. --quality prints instead how good every law, map and sampler is, printed ones too; or those of the records
    named.

    \b
    Examples:
      profilefit report hazard
      profilefit report skin
      profilefit report liang-whole --figures figures
      profilefit report --html report.html
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen, show
        from mcml_sim.files.whole_file import require_folder
        from profilefit.recipes import record
        from profilefit.report import every_law
        from profilefit.report.tables import law_tables
        from profilefit.report.tables.claims_table import read_claims
        from profilefit.report.tables.stack_table import stack_table

    printed = {"--json": as_json, "--quality": quality and not as_json, "--claims": claims and not as_json}
    _require_one({"--markdown": markdown, "--html": html, **printed})
    folder = records_folder(fits, quiet)
    ordinary, known = record.available(folder), known_stacks(fits)
    if phases := [name for name in names or () if name not in ordinary and name in known_phases(fits)]:
        _require_alone(
            phases, names or [], {**printed, "--markdown": markdown, "--html": html, "--figures": figures_to}
        )
        _show_phases({name: known_phases(fits)[name] for name in phases}, as_json)
        return
    only_stacks = not names and not any((*printed.values(), markdown, html)) and not ordinary
    if only_stacks and (table := stack_table(folder)) is not None:
        show([table], screen())
        return
    stacks = {name: known[name] for name in names or () if name in known and name not in ordinary}
    _take_stacks(stacks, folder, {"--quality": quality, "--html": html, "--figures": figures_to})
    if markdown is not None and not names:
        stacks = known_stacks(folder)
    others = [name for name in names if name not in stacks] if names else list(ordinary)
    contents = record.chosen(folder, others, list(known) if names else ()) if others or not stacks else {}
    if figures_to is not None:
        require_folder(figures_to)
    if markdown is not None:
        _fill(markdown, contents, folder, stacks, quiet)
    elif html is not None:
        _page(html, folder, evidence_folder(folder, evidence), names, quiet)
    elif as_json:
        body: dict[str, Any] = {"records": _told(contents, stacks, names)}
        if sums := _sums(stacks):
            body["gaussians"] = {name: one.content for name, one in sums.items()}
        if quality:
            body["quality"] = law_tables.content(_measured(folder, names, quiet))
        if claims:
            body["claims"] = read_claims(evidence_folder(folder, evidence))[1]
        print_json(body)
    elif quality:
        show(list(every_law(_measured(folder, names, quiet), bool(names))), screen())
    elif claims:
        _show_claims(evidence_folder(folder, evidence), folder, quiet)
    else:
        _show(_told(contents, stacks, names), _sums(stacks), folder, bool(names))
    if figures_to is not None:
        _draw(folder, figures_to, names, quiet)


def _require_alone(phases: list[str], names: list[str], others: dict[str, object]) -> None:
    """InputError where tables of phase functions are asked for with what they are no part of."""
    given = [option for option, value in others.items() if value and option != "--json"]
    strange = [name for name in names if name not in phases]
    if given or strange:
        raise InputError(
            f"{(given or strange)[0]!r} must be left out where NAME is a phase function's record, got {phases[0]!r}"
        )


def _show_phases(paths: Mapping[str, Path], as_json: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen, show
        from profilefit.recipes.phases.record import load
        from profilefit.report.tables.phase_table import phase_tables, premise_lines

    found = {name: load(path).content for name, path in paths.items()}
    if as_json:
        print_json({"phases": found})
        return
    for one in found.values():
        show(phase_tables(one), screen())
        for line in premise_lines(one):
            screen().print(line, markup=False)


def _require_one(flags: dict[str, object]) -> None:
    given = [option for option, value in flags.items() if value]
    if len(given) > 1:
        accepted = f"one of {', '.join(flags)}, or --json with --quality or --claims"
        raise InputError(f"report takes {accepted}, got {' and '.join(given)}")


def _take_stacks(stacks: Mapping[str, Path], folder: Path, others: dict[str, object]) -> None:
    """Say where those are from that are not of the folder in use; InputError on an option that no stack takes."""
    for name, path in stacks.items():
        if given := [option for option, value in others.items() if value]:
            raise InputError(f"{given[0]} must be left out where NAME is a stack, got {name!r}")
        if path.parent.parent != folder:
            warnings.warn(f"stack {name!r} is of {str(path.parent.parent)!r}", OtherRecords, stacklevel=2)


def _told(
    contents: dict[str, dict[str, Any]], stacks: Mapping[str, Path], names: list[str] | None
) -> dict[str, dict[str, Any]]:
    """What is said of records and of stacks, in the order of their names."""
    with interruptible(__name__):
        from profilefit.recipes.stack.schema import read

    told = contents | {name: read(path) for name, path in stacks.items()}
    return {name: told[name] for name in names or told}


def _sums(stacks: Mapping[str, Path]) -> dict[str, SumRecord]:
    """The records of sums of Gaussians that lie beside those of stacks."""
    with interruptible(__name__):
        from profilefit.recipes.stack.sum_record import beside, load

    return {name: load(found) for name, path in stacks.items() if (found := beside(path)) is not None}


def _show(contents: dict[str, dict[str, Any]], sums: Mapping[str, SumRecord], folder: Path, named: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import put, screen
        from profilefit.report import record_tables, summary
        from profilefit.report.tables.phase_table import phase_table
        from profilefit.report.tables.stack_table import stack_table
        from profilefit.report.tables.sum_table import sum_tables

    parts = [] if named else [summary(contents)]
    for name in contents if named else ():
        parts += record_tables(contents[name])
        parts += sum_tables(sums[name]) if name in sums else []
    if not named:
        parts += [one for one in (stack_table(folder), phase_table(folder)) if one is not None]
    console = screen()
    for part in parts:
        put(part, console)


def _show_claims(evidence: Path, folder: Path, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes, screen, show
        from profilefit.recipes.evidence import stale
        from profilefit.report.tables.claims_table import claim_tables, read_claims

    made, rows = read_claims(evidence)
    show(claim_tables(rows), screen())
    if stale(made, folder):
        notes(quiet).print("since then records or version have changed: `make claims` measures again", markup=False)


def _measured(folder: Path, names: list[str] | None, quiet: bool) -> Qualities:
    with interruptible(__name__):
        from mcml_sim.runs.progress import tracked
        from profilefit.report.tables import law_tables

    def track(found: Iterator[Any], title: str, total: int) -> Iterator[Any]:
        return tracked(found, f"measuring {title}", "laws", total, quiet)

    return law_tables.measured(folder, names or None, track=track)


def _draw(folder: Path, out: Path, names: list[str] | None, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes
        from mcml_sim.runs.progress import tracked
        from profilefit.recipes.workers import cores
        from profilefit.report import draw_all

    def track(plans: Iterable[Any]) -> Iterator[Any]:
        return tracked(plans, "drawing", "figures", quiet=quiet)

    drawn, skipped = draw_all(folder, out, names, track, cores())
    said = notes(quiet)
    said.print(f"drew {len(drawn)} figures into {out}", markup=False)
    for line in skipped:
        said.print(f"left out: {line}", markup=False)


def _page(path: Path, folder: Path, evidence: Path, names: list[str] | None, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes
        from mcml_sim.runs.progress import tracked
        from profilefit.report.page.document import write_page

    write_page(path, folder, evidence, names, lambda parts: tracked(parts, "writing", "parts", quiet=quiet))
    notes(quiet).print(f"wrote {path}, {path.stat().st_size / MEGABYTE:.1f} MB", markup=False)


def _fill(
    path: Path, contents: dict[str, dict[str, Any]], folder: Path, stacks: Mapping[str, Path], quiet: bool
) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes
        from mcml_sim.files.whole_file import read_whole, require_writable, write_whole
        from mcml_sim.runs.progress import working
        from profilefit.report import fill, markdown_sections, sections
        from profilefit.report.tables.phase_table import phase_sections
        from profilefit.report.tables.stack_table import stack_sections
        from profilefit.report.tables.sum_table import sum_sections

    if path.exists() and not path.is_file():  # to read a pipe would wait for ever
        raise InputError(f"--markdown must be a file whose tables are filled in, got {path}, which is none")
    content = read_whole(path, MOST_MARKDOWN)
    try:
        if len(content) > MOST_MARKDOWN:
            raise ValueError(f"more than {MOST_MARKDOWN} bytes")
        text = content.decode("utf-8")
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    require_writable(path)
    measured = {}
    made = markdown_sections(folder) | stack_sections(stacks) | sum_sections(stacks) | phase_sections(folder)
    for name, make in made.items():
        if f"<!-- {name} -->" in text:  # what is measured takes a minute, so only where the file has a place for it
            try:
                with working(f"measuring the table {name}", quiet):
                    measured[name] = make()
            except ShaderError as error:
                notes(quiet).print(f"{path}: the table {name!r} stays as it was: {error}", markup=False)
    write_whole(path, fill(text, (sections(contents) if contents else {}) | measured))
