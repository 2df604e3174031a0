"""Options and folders of several subcommands, and shell completion: names of laws and records.

Words are repeated here where their module takes seconds to import; a test compares both.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from profilefit.errors import InputError, OtherRecords
from profilefit.laws import PROFILES
from profilefit.recipes import kinds
from profilefit.recipes.folder import EVIDENCE, fits_folder, known_folder

Fits = Annotated[
    Path | None,
    typer.Option(help="Folder of the records.", show_default="./fits if it has records, else the shipped folder"),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print the result only, without progress and notes.")]

EXACT = "exact"  # light that is solved, in place of a law
LANGUAGES = ("glsl", "hlsl", "glsl-es", "python", "json")
LIGHTS = ("searchlight", "diffuse")
LIGHTS_HELP = "searchlight (a pencil beam) or diffuse"
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
    """Raise InputError on an option that was given but has no effect."""
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise InputError(f"--{name.replace('_', '-')} must be left out where {where}")


def refused(option: str, accepted: str, got: object, hint: str = "") -> InputError:
    """Return the error of an option whose value is not accepted."""
    from mcml_sim.media.arrays import shown

    return InputError(f"{option} must be {accepted}, got {shown(got)}{hint}")


def percent(text: str) -> str:
    """Return a hint for a message if a share was written as a percentage, else an empty text."""
    match = PERCENT.match(text.strip())
    is_one = match is not None and (match[2] or 2 < float(match[1]) <= 100)
    return f" (a share: {float(match[1]) / 100:g} for {match[1]} %)" if match is not None and is_one else ""


def in_options(text: Any) -> Any:
    """Return texts of the library with names of options in place of arguments."""
    if isinstance(text, str):
        return ARGUMENT.sub(lambda found: OPTIONS.get(found[1] or found[2], found[0]), text)
    if isinstance(text, Mapping):
        return {name: in_options(value) for name, value in text.items()}
    return [in_options(value) for value in text] if isinstance(text, list | tuple) else text


def records_folder(requested: Path | None = None, quiet: bool = False) -> Path:
    """Return the folder requested, or ./fits if it has records, or the one shipped.

    An OtherRecords warning names a folder that is not the shipped one, unless it was requested with `quiet`, because
    constants of other records look like the shipped ones. InputError if it is no folder.
    """
    if requested is not None and not requested.is_dir():
        raise InputError(f"--fits must be a folder of records, got {str(requested)!r}, which is none")
    folder = known_folder(requested)
    if folder.resolve() != fits_folder().resolve() and not (quiet and requested):
        where = "" if requested else " in the current folder; --fits chooses others"
        warnings.warn(f"records of {str(folder)!r}{where}", OtherRecords, stacklevel=2)
    return folder


def evidence_folder(records: Path, requested: Path | None = None) -> Path:
    """Return the folder requested, or ./evidence if it is there, or the one beside the records.

    An OtherRecords warning names ./evidence. InputError if the requested folder does not exist.
    """
    if requested is not None and not requested.is_dir():
        raise InputError(f"--evidence must be a folder, got {str(requested)!r}, which is none")
    if requested is None and EVIDENCE.is_dir():
        where = f"measurements of {str(EVIDENCE)!r} in the current folder; --evidence chooses others"
        warnings.warn(where, OtherRecords, stacklevel=2)
    return requested or (EVIDENCE if EVIDENCE.is_dir() else records / EVIDENCE)


def _among(known: Iterable[str]) -> Callable[[str], Iterator[str]]:
    """Return the completion of a word from known ones."""
    return lambda incomplete: _starting(incomplete, known)


def _named(kind: Callable[[kinds.Kind], object] = bool, forms: bool = True) -> Callable[..., Iterator[str]]:
    """Return the completion by names of some kinds of records, in the folder of --fits if given."""

    def offered(ctx: typer.Context, incomplete: str) -> Iterator[str]:
        requested = ctx.params.get("fits")
        folder = Path(requested) if requested else None
        return _starting(incomplete, kinds.names(filter(kind, kinds.KINDS), folder, forms=forms))

    return offered


def recipes(incomplete: str) -> Iterator[str]:
    """Return the names of shipped recipes, stacks and phase functions."""
    return _starting(incomplete, sorted({name for kind in kinds.KINDS for name in kind.requests()}))


def tested(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Return the names that `stability` accepts: laws, maps, their records, and functions."""
    yield from subjects(ctx, incomplete)
    yield from _starting(incomplete, FUNCTIONS)


records = _named(forms=False)
subjects = _named(lambda kind: kind.forms)  # laws, maps and their records
exported = _named()
fitted = _among((EXACT, *PROFILES))
languages = _among(LANGUAGES)
parts = _among(PARTS)


def constants(incomplete: str) -> Iterator[str]:
    """Return the names of all sets of constants."""
    from profilefit.laws.published import SETS

    return _starting(incomplete, dict.fromkeys(("regenerated", *(one.name for one in SETS))))


def _starting(incomplete: str, known: Iterable[str]) -> Iterator[str]:
    return (word for word in known if word.startswith(incomplete))
