"""The whole page: what is on it, in which order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from string import Template

from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import require_writable, write_whole
from profilefit.recipes import record
from profilefit.report.drawing import classed
from profilefit.report.explorer import explorer_section
from profilefit.report.page import sections
from profilefit.report.page.markup import element, paragraph, section
from profilefit.report.records import Source
from profilefit.shader.emit import text_beside

Tracked = Callable[[list[str]], Iterable[str]]
TITLE = "Reflectance profiles, refitted"
LEAD = "Light enters skin, milk or marble at one point and leaves around it: these models compute how much, and where."
ROOM = 2**25  # bytes of a disk; the page of all shipped records has 2.5 MB
PARTS = {
    "explorer": "Try a material",
    "fits": "What was fitted",
    "records": "Each record",
    "quality": "Errors and constants",
    "paper": "Figures of the paper",
    "stacks": "Layered media",
    "tradeoff": "Speed and accuracy",
    "stability": "Limits of the models",
    "check": "In a shader",
    "claims": "Promises and measurements",
    "provenance": "Origin of the records",
}
# Section, and the command that measures it -> its parts.
MEASURED = {"stability": sections.failures, "tradeoff": sections.speed, "check": sections.shader}
RECORD = "record "  # begins the key of a part that is one record
PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title</title>
<link rel="icon" href="data:,">
<style>
$style
</style>
</head>
<body>
<header>
<h1>$title</h1>
<p class="lead">$lead <span class="dim">$summary</span></p>
<button id="theme" type="button" hidden>light or dark</button>
</header>
<nav aria-label="Contents"><ul>$links</ul></nav>
<main>
$sections
</main>
<script>
$script
</script>
</body>
</html>
""")


def write_page(
    path: Path, folder: Path, evidence: Path, names: Sequence[str] | None = None, tracked: Tracked | None = None
) -> None:
    """Write the report of the records in `folder` as one HTML file that needs no other and no network.

    evidence  folder of what `profilefit check`, `stability` and `tradeoff` wrote with `--out`; what is not there is
              named, with the command that makes it
    names     of records; all if None
    tracked   wraps the keys of the parts as these are made: in a bar, say
    RecordError, InputError on files that are damaged; OutputError where `path` cannot be written.
    """
    require_writable(path, room=ROOM)
    source = Source(folder, tuple(names) if names else None)
    measures = sections.EvidenceFolder(evidence, folder)
    for file in source.paths.values():  # damage is reported now, not after a minute
        record.read(file, whole=True)
    measured = {name: measures.section(name, parts) for name, parts in MEASURED.items()}
    measured["claims"] = "\n".join(sections.promises(measures))
    makers: dict[str, Callable[[], str]] = {
        "fits": lambda: sections.fitted(source),
        "explorer": lambda: explorer_section(source.folder),
        "quality": lambda: sections.whole_figures(source),
        "paper": lambda: sections.paper_figures(source),
        "stacks": lambda: "\n".join(sections.layers(source, measures)),
        # These take longest.
        **{f"{RECORD}{name}": partial(sections.record_part, source, name) for name in source.paths},
        "provenance": lambda: "\n".join(sections.provenance(source, path.name)),
        **{key: partial(str, text) for key, text in measured.items()},
    }
    made = {key: makers[key]() for key in (tracked(list(makers)) if tracked else makers)}
    made["records"] = "\n".join(text for key, text in made.items() if key.startswith(RECORD))
    intro = {key: paragraph(text) for key, text in sections.INTRO.items() if key not in MEASURED}
    parts = {key: (title, intro.get(key, "") + made[key]) for key, title in PARTS.items() if made[key]}
    count = f"{len(source.paths)} record{'s' if len(source.paths) != 1 else ''}"
    write_whole(path, document(TITLE, LEAD, f"{count}, profilefit {__version__}", parts))


def document(title: str, lead: str, summary: str, parts: Mapping[str, tuple[str, str]]) -> str:
    """Return a page of sections, each with its title and HTML, by what a link to it ends in; the rest is plain text."""
    rules, body = classed("\n".join(section(key, head, [text]) for key, (head, text) in parts.items()))
    links = "".join(element("li", element("a", escape(head), href=f"#{key}")) for key, (head, _) in parts.items())
    return PAGE.substitute(
        title=escape(title),
        lead=escape(lead),
        summary=escape(summary),
        style=text_beside(__name__, "page.css") + rules,
        script=text_beside(__name__, "page.js"),
        links=links,
        sections=body,
    )
