"""profilefit report: show records as tables, and draw their figures."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from profilefit.cli import options
from profilefit.errors import InputError, OtherRecords, ShaderError

if TYPE_CHECKING:
    from profilefit.recipes.kinds import Chosen, Kind

    Groups = Mapping[Kind, Mapping[str, Path]]

MEGABYTE = 1e6
MOST_MARKDOWN = 2**24  # bytes of a page whose tables are filled in


def report(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME",
            help="Names of records or stacks.",
            show_default="a summary of all",
            autocompletion=options.records,
        ),
    ] = None,
    quality: Annotated[
        bool,
        typer.Option("--quality", help="Measure all models, inversions and samplers, or the named ones (a minute)."),
    ] = False,
    claims: Annotated[
        bool, typer.Option("--claims", help="Print claims of accuracy and speed with measured values.")
    ] = False,
    figures_to: Annotated[
        Path | None, typer.Option("--figures", help="Folder for figures.", show_default="none drawn")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Markdown file whose tables between marks <!-- name --> are filled in.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option(help="File for one HTML page with an explorer, tables and charts.")
    ] = None,
    evidence: Annotated[
        Path | None,
        typer.Option(
            help="Folder of results of check, stability and tradeoff, for --html and --claims.",
            show_default="./evidence if present, else beside the records",
        ),
    ] = None,
    fits: options.Fits = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Show constants, their errors and the models' quality.

    The tables also give quality by albedo, by thickness of a stack or by number of Gaussians, and the state of fits and
    chains.

    \b
    Example:
      profilefit report hazard
    """
    from mcml_sim.cli.screen import notes, print_json, screen, show
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import tracked
    from profilefit.recipes.evidence import stale
    from profilefit.recipes.kinds import KINDS, no_records, records_of
    from profilefit.report.kinds import tables_of
    from profilefit.report.tables import law_tables
    from profilefit.report.tables.claims_table import claim_tables, read_claims

    printed = {"--json": as_json, "--quality": quality and not as_json, "--claims": claims and not as_json}
    flags = {"--markdown": markdown, "--html": html, **printed}
    if len(given := [option for option, value in flags.items() if value]) > 1:
        accepted = f"one of {', '.join(flags)}, or --json with --quality or --claims"
        raise InputError(f"report takes {accepted}, got {' and '.join(given)}")
    folder = options.records_folder(fits, quiet)
    chosen = records_of(names or (), fits)
    groups = {kind: {} if names else kind.paths(folder) for kind in KINDS}
    for kind, name, path in chosen:
        groups[kind][name] = path
    if not chosen and (any(printed.values()) or html or not any(groups.values())):
        raise no_records(folder)
    outputs = {"quality": quality, "claims": claims, "markdown": markdown, "html": html, "figures": figures_to}
    _require_together(chosen, folder, [option for option, value in outputs.items() if value])
    if figures_to is not None:
        require_folder(figures_to)
    said = notes(quiet)
    bar = partial(tracked, quiet=quiet)
    measured = partial(
        law_tables.measured,
        folder,
        names or None,
        track=lambda laws, title, total: bar(laws, f"measuring {title}", "laws", total),
    )
    if markdown is not None:
        _fill(markdown, groups, folder, quiet)
    elif html is not None:
        from profilefit.report.page.document import write_page

        where = options.evidence_folder(folder, evidence)
        write_page(html, folder, where, names, lambda parts: bar(parts, "writing", "parts"))
        said.print(f"wrote {html}, {html.stat().st_size / MEGABYTE:.1f} MB", markup=False)
    elif as_json:
        body: dict[str, Any] = {}
        for kind, name, path in chosen:
            if (shown := tables_of(kind)) is not None:
                body.setdefault(shown.key, {})[name] = kind.module.read(path)
        if quality:
            body["quality"] = law_tables.content(measured())
        if claims:
            body["claims"] = read_claims(options.evidence_folder(folder, evidence))[1]
        print_json(body)
    elif quality:
        show(list(law_tables.every_law(measured(), bool(names))), screen())
    elif claims:
        made, rows = read_claims(options.evidence_folder(folder, evidence))
        show(list(claim_tables(rows, titled=True).values()), screen())
        if stale(made, folder):
            said.print("since then records or version have changed: `make claims` measures again", markup=False)
    else:
        _show(chosen if names else (), groups, folder)
    if figures_to is not None:
        from profilefit.recipes.workers import cores
        from profilefit.report.figures.record_figures import draw_all

        drawn, skipped = draw_all(folder, figures_to, names, lambda plans: bar(plans, "drawing", "figures"), cores())
        said.print(f"drew {len(drawn)} figures into {figures_to}", markup=False)
        for line in skipped:
            said.print(f"left out: {line}", markup=False)


def _require_together(chosen: Sequence[Chosen], folder: Path, given: Sequence[str]) -> None:
    """Warn of records from another folder; InputError on an option that has no effect on a kind."""
    seen: set[str] = set()
    for kind, name, path in chosen:
        if option := next((option for option in given if option in kind.apart), None):
            raise InputError(f"--{option} must be left out where NAME is {kind.words}, got {name!r}")
        if (root := kind.root(path)) != folder and name not in seen:
            warnings.warn(f"{kind.words.partition(' ')[2]} {name!r} is of {str(root)!r}", OtherRecords, stacklevel=2)
        seen.add(name)


def _show(named: Sequence[Chosen], groups: Groups, folder: Path) -> None:
    """Print the tables of records, or a summary of every kind where none is named."""
    from mcml_sim.cli.screen import put, screen
    from profilefit.report.kinds import tables_of

    parts: list[Any] = []
    for kind, _, path in named:
        if (shown := tables_of(kind)) is not None:
            parts += shown.tables(kind.module.read(path), path)
    for kind, paths in () if named else groups.items():
        if (shown := tables_of(kind)) is not None and (table := shown.summary(paths, folder)) is not None:
            parts.append(table)
    console = screen()
    for part in parts:
        put(part, console)


def _fill(path: Path, groups: Groups, folder: Path, quiet: bool) -> None:
    from mcml_sim.cli.screen import notes
    from mcml_sim.files.whole_file import read_whole, require_writable, write_whole
    from mcml_sim.runs.progress import working
    from profilefit.report.kinds import tables_of
    from profilefit.report.tables.markdown import fill

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
    tables = {}
    for kind, paths in groups.items():
        shown = tables_of(kind)
        for name, make in shown.sections(paths, folder).items() if shown else ():
            if f"<!-- {name} -->" in text:  # what is measured takes a minute: only where the file has a place for it
                try:
                    with working(f"measuring the table {name}", quiet):
                        tables[name] = make()
                except ShaderError as error:
                    notes(quiet).print(f"{path}: the table {name!r} stays as it was: {error}", markup=False)
    write_whole(path, fill(text, tables))
