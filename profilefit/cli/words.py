"""Words that a shell completes: names of laws, maps, records and recipes, and the few values of some options.

Written out where their owner takes seconds to import; a test holds them against it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import typer

from profilefit.laws import MAPS, PROFILES
from profilefit.laws.published import SETS
from profilefit.recipes import record
from profilefit.recipes.folder import fits_folder, known_folder

LANGUAGES = ("glsl", "hlsl", "glsl-es", "python", "json")
PARTS = ("truth", "laws", "samplers", "fits")
FUNCTIONS = ("exact", "convert", "solver")


def records(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Names of the records in the folder that the command has been given so far."""
    return _starting(incomplete, record.available(_folder(ctx)))


def recipes(incomplete: str) -> Iterator[str]:
    """Names of the recipes that came with this installation."""
    return _starting(incomplete, sorted(path.stem for path in fits_folder().glob("*.toml")))


def subjects(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Names of laws, maps and records."""
    return _starting(incomplete, dict.fromkeys((*PROFILES, *MAPS, *record.available(_folder(ctx)))))


def tested(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """What `stability` takes: those, and functions."""
    yield from subjects(ctx, incomplete)
    yield from _starting(incomplete, FUNCTIONS)


def laws(incomplete: str) -> Iterator[str]:
    """Names of profile laws."""
    return _starting(incomplete, PROFILES)


def languages(incomplete: str) -> Iterator[str]:
    """Languages of `export`."""
    return _starting(incomplete, LANGUAGES)


def parts(incomplete: str) -> Iterator[str]:
    """Parts of `tradeoff`."""
    return _starting(incomplete, PARTS)


def constants(incomplete: str) -> Iterator[str]:
    """Sets of constants, of whatever law."""
    return _starting(incomplete, dict.fromkeys(("regenerated", *(one.name for one in SETS))))


def _folder(ctx: typer.Context) -> Path:
    asked = ctx.params.get("fits")
    return known_folder(Path(asked) if asked else None)


def _starting(incomplete: str, known: Iterable[str]) -> Iterator[str]:
    return (word for word in known if word.startswith(incomplete))
