"""Options that several subcommands have, and the words that a shell completes: names of laws, maps, records, recipes.

Words are written out where their owner takes seconds to import; a test holds them against it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli.folders import known_folder, known_stacks
from profilefit.errors import InputError
from profilefit.laws import MAPS, PROFILES
from profilefit.recipes.folder import fits_folder

Fits = Annotated[
    Path | None, typer.Option(help="Folder of the records: ./fits if it has any, which is said, else the ones shipped.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print all of it as JSON instead.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes: the result only.")]

EXACT = "exact"  # light that is solved, in place of a law
LANGUAGES = ("glsl", "hlsl", "glsl-es", "python", "json")
LIGHTS = ("searchlight", "diffuse")
LIGHTS_HELP = "searchlight, a pencil beam (normal, collimated), or diffuse"
PARTS = ("truth", "laws", "samplers", "fits", "sea", "fur")
FUNCTIONS = ("exact", "convert", "solver", "stacks", "heart", "sea", "fur")
# What the library calls an argument, at the head of a message ("out must be") or in backquotes, and its option here.
OPTIONS = {
    "beam": "--beam",
    "colour": "--colour",
    "constants": "--constants",
    "fibre": "--fibre",
    "free": "--free",
    "g": "--g",
    "held": "--fix",
    "n": "--n",
    "out": "--out",
    "part": "PART",
    "r_max": "--r-max",
    "r_min": "--r-min",
    "scale": "--scale",
    "scaled": "--scale free",
    "unit": "--unit",
}
PERCENT = re.compile(r"(\d+\.?\d*|\.\d+)\s*(%?)")
ARGUMENT = re.compile(r"^(\w+)(?=[\w ]* must )|`(\w+)`")


def require_left_out(context: typer.Context, names: Iterable[str], where: str) -> None:
    """InputError of an option that was given although it says nothing there."""
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise InputError(f"--{name.replace('_', '-')} must be left out where {where}")


def percent(text: str) -> str:
    """Return a hint for the end of a message, where a share was written as a percent; else an empty text."""
    match = PERCENT.match(text.strip())
    is_one = match is not None and (match[2] or 2 < float(match[1]) <= 100)
    return f" (a share: {float(match[1]) / 100:g} for {match[1]} %)" if match is not None and is_one else ""


def in_options(text: Any) -> Any:
    """A text of the library, or content with such texts, with options in place of arguments."""
    if isinstance(text, str):
        return ARGUMENT.sub(lambda found: OPTIONS.get(found[1] or found[2], found[0]), text)
    if isinstance(text, Mapping):
        return {name: in_options(value) for name, value in text.items()}
    return [in_options(value) for value in text] if isinstance(text, list | tuple) else text


def records(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Names of the records, and of those of stacks, in the folder that the command has been given so far."""
    return _starting(incomplete, dict.fromkeys((*_known_records(ctx), *known_stacks(_folder(ctx)))))


def recipes(incomplete: str) -> Iterator[str]:
    """Names of the recipes that came with this installation."""
    return _starting(incomplete, sorted(path.stem for path in fits_folder().glob("*.toml")))


def subjects(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Names of laws, maps and records."""
    return _starting(incomplete, dict.fromkeys((*PROFILES, *MAPS, *_known_records(ctx))))


def tested(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """What `stability` takes: those, and functions."""
    yield from subjects(ctx, incomplete)
    yield from _starting(incomplete, FUNCTIONS)


def laws(incomplete: str) -> Iterator[str]:
    """Names of profile laws."""
    return _starting(incomplete, PROFILES)


def fitted(incomplete: str) -> Iterator[str]:
    """What `fit` takes for light: laws, and exact light."""
    return _starting(incomplete, (EXACT, *PROFILES))


def languages(incomplete: str) -> Iterator[str]:
    """Languages of `export`."""
    return _starting(incomplete, LANGUAGES)


def parts(incomplete: str) -> Iterator[str]:
    """Parts of `tradeoff`."""
    return _starting(incomplete, PARTS)


def constants(incomplete: str) -> Iterator[str]:
    """Sets of constants, of whatever law."""
    with interruptible(__name__):
        from profilefit.laws.published import SETS

    return _starting(incomplete, dict.fromkeys(("regenerated", *(one.name for one in SETS))))


def _known_records(ctx: typer.Context) -> list[str]:
    with interruptible(__name__):
        from profilefit.recipes.record import available

    return list(available(known_folder(_folder(ctx))))


def _folder(ctx: typer.Context) -> Path | None:
    requested = ctx.params.get("fits")
    return Path(requested) if requested else None


def _starting(incomplete: str, known: Iterable[str]) -> Iterator[str]:
    return (word for word in known if word.startswith(incomplete))
