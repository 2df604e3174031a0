"""Where everything on the page comes from: records, digests, versions, and what makes all of it again."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator, Mapping

from profilefit.recipes.evidence import digest
from profilefit.recipes.record import record_setting
from profilefit.recipes.run import preset_photons
from profilefit.report.page.markup import command, markup, paragraph
from profilefit.report.records import Content, Source
from profilefit.report.tables.cells import ABSENT, column_table

SHOWN = 12  # letters of a SHA-256


def provenance(source: Source, page: str) -> Iterator[str]:
    """Digests of data and records, libraries, the commands that make it again; `page` is the file's own name."""
    contents = {name: source.content(name) for name in source.paths}
    columns = {
        "record": list(contents),
        "photons": [_photons(one) for one in contents.values()],
        "seed": [str(one["seed"]) for one in contents.values()],
        "preset": [str(one["preset"]) for one in contents.values()],
        "data": [str(one.get("data_digest", ABSENT))[:SHOWN] for one in contents.values()],
        "record's own": [_sha(path.read_bytes()) for path in source.paths.values()],
    }
    caption = f"SHA-256, the first {SHOWN} letters, of the numbers that were fitted and of the record's file"
    yield markup(column_table("Records", columns, caption, left=("record", "preset", "data", "record's own")))
    versions = {tuple(sorted((one.get("versions") or {}).items())) for one in contents.values()} - {()}
    for known in sorted(versions):
        yield paragraph("Made with " + ", ".join(f"{name} {number}" for name, number in known) + ".", "dim")
    yield paragraph(f"SHA-256 over all records of the folder: {digest(source.folder)}", "dim")
    yield paragraph("All of it again; what was measured with the records has its own command where it stands:")
    shown = shlex.join(["profilefit", "report", *(source.names or ()), "--fits", "fits", "--html", page])
    yield command("\n".join([*again(contents, bool(source.names)), shown]))


def again(contents: Mapping[str, Content], named: bool = True) -> list[str]:
    """The commands that make these records again, a line for each preset, seed and number of photons."""
    groups: dict[str, list[str]] = {}
    for name, one in contents.items():
        groups.setdefault(_options(one), []).append(name)
    alone = len(groups) == 1 and not named
    return [
        " ".join(["profilefit regenerate", *([] if alone else map(shlex.quote, names)), options, "--out fits"])
        for options, names in groups.items()
    ]


def _options(content: Content) -> str:
    told = f"--preset {content['preset']} --seed {content['seed']}"
    photons = (content.get("truth") or {}).get("photons")
    usual = preset_photons(content["preset"], record_setting(content))
    return told if photons in (None, usual) else f"{told} --photons {photons}"


def _photons(content: Content) -> str:
    photons = (content.get("truth") or {}).get("photons")
    return ABSENT if photons is None else f"{photons:.3g}".replace("e+0", "e")


def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:SHOWN]
