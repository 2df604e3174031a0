"""Show records as tables, draw their figures, or write all of it as one page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from mcml_sim.cli.screen import notes, print_json, put, screen, show
from mcml_sim.files.whole_file import read_whole, require_folder, write_whole
from mcml_sim.runs.progress import tracked, working
from profilefit.errors import InputError, RecordError, ShaderError
from profilefit.recipes.folder import Records, evidence_folder, records_folder
from profilefit.report import every_law, fill, markdown_sections, sections
from profilefit.report.figures import record_figures
from profilefit.report.page.document import write_page
from profilefit.report.tables import law_tables, record_tables

Contents = dict[str, dict[str, Any]]
MEGABYTE = 1e6
MOST_MARKDOWN = 2**24  # bytes of a page whose tables are filled in
NEAREST, ALIKE = 3, 0.6  # names that are suggested; of difflib's similarity, 1 for the same name


def report(
    names: list[str] | None,
    quality: bool,
    figures_to: Path | None,
    markdown: Path | None,
    html: Path | None,
    evidence: Path | None,
    fits: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Print what is asked for, or write it."""
    _require_one({"--markdown": markdown, "--html": html, "--json": as_json, "--quality": quality and not as_json})
    folder = records_folder(fits, quiet)
    contents = _contents(folder, names)
    if markdown is not None:
        _fill(markdown, contents, folder, quiet)
    elif html is not None:
        _page(html, folder, evidence_folder(folder, evidence), names, quiet)
    elif as_json:
        told: dict[str, Any] = {"records": contents}
        if quality:
            told["quality"] = law_tables.content(_measured(folder, names, quiet))
        print_json(told)
    elif quality:
        show(list(every_law(_measured(folder, names, quiet), bool(names))), screen())
    else:
        _show(contents, bool(names))
    if figures_to is not None:
        _draw(folder, figures_to, names, quiet)


def _require_one(asked: dict[str, object]) -> None:
    given = [option for option, value in asked.items() if value]
    if len(given) > 1:
        raise InputError(f"report takes one of {', '.join(asked)}, or --json with --quality, got {' and '.join(given)}")


def _show(contents: Contents, named: bool) -> None:
    console = screen()
    if not named:
        put(record_tables.summary(contents), console)
        return
    for content in contents.values():
        for part in record_tables.record_tables(content):
            put(part, console)


def _measured(folder: Path, names: list[str] | None, quiet: bool) -> law_tables.Measured:
    def track(found: Iterator[Any], title: str, total: int) -> Iterator[Any]:
        return tracked(found, f"measuring {title}", "laws", total, quiet)

    return law_tables.measured(folder, names or None, track=track)


def _draw(folder: Path, out: Path, names: list[str] | None, quiet: bool) -> None:
    require_folder(out)

    def track(plans: list[record_figures.Plan]) -> Iterable[record_figures.Plan]:
        return tracked(plans, "drawing", "figures", quiet=quiet)

    drawn, skipped = record_figures.draw_all(folder, out, names, track)
    said = notes(quiet)
    said.print(f"drew {len(drawn)} figures into {out}", markup=False)
    for line in skipped:
        said.print(f"left out: {line}", markup=False)


def _page(path: Path, folder: Path, evidence: Path, names: list[str] | None, quiet: bool) -> None:
    def track(parts: list[str]) -> Iterator[str]:
        return tracked(parts, "writing", "parts", quiet=quiet)

    write_page(path, folder, evidence, names, track)
    notes(quiet).print(f"wrote {path}, {path.stat().st_size / MEGABYTE:.1f} MB", markup=False)


def _fill(path: Path, contents: Contents, folder: Path, quiet: bool) -> None:
    if path.exists() and not path.is_file():  # to read a pipe would wait for ever
        raise InputError(f"--markdown must be a file whose tables are filled in, got {path}, which is none")
    content = read_whole(path, MOST_MARKDOWN)
    try:
        if len(content) > MOST_MARKDOWN:
            raise ValueError(f"more than {MOST_MARKDOWN} bytes")
        text = content.decode("utf-8")
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    measured = {}
    for name, make in markdown_sections(folder).items():
        if f"<!-- {name} -->" in text:  # what is measured takes a minute, so only where the file has a place for it
            try:
                with working(f"measuring the table {name}", quiet):
                    measured[name] = make()
            except ShaderError as error:
                notes(quiet).print(f"{path}: the table {name!r} stays as it was: {error}", markup=False)
    write_whole(path, fill(text, sections(contents) | measured))


def _contents(folder: Path, names: list[str] | None) -> Contents:
    records = Records(folder)
    known = records.paths
    if not known:
        raise RecordError(f"{folder} has no records: `profilefit regenerate` makes them")
    for name in names or ():
        if name not in known:
            raise RecordError(f"there is no record {name!r} in {folder}; {_nearest(name, list(known))}")
    return {name: records.content(name, whole=True) for name in (names or known)}


def _nearest(name: str, known: list[str]) -> str:
    """What may have been meant: names that begin so, or differ by a few letters."""
    begun = sorted((one for one in known if one.startswith(name.lower())), key=len)
    near = begun or get_close_matches(name.lower(), known, n=NEAREST, cutoff=ALIKE)
    hint = f"did you mean {', '.join(near[:NEAREST])}? " if near else ""
    return f"{hint}`profilefit report` lists them"
