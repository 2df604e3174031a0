"""profilefit regenerate: simulate, fit, and write the records."""

from __future__ import annotations

import sys
import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from profilefit import calibrate, catalogue, recipe, record
from profilefit.errors import InputError, RecipeError
from profilefit.run import Run

OUT = Path("fits")
PHOTON_STORE = ".photons"
PRESETS = "quick: 2.1e7 photons, minutes. full: 4.2e8. Fewer in each setting whose surface refracts."
MAX_SEED = 2**32 - 1  # numpy's RandomState, which moves the chains, takes 32 bits


class Preset(StrEnum):
    """How much light: quick is enough for four digits of most constants, full for five."""

    QUICK = "quick"
    FULL = "full"


def regenerate(
    recipes: Annotated[
        list[str] | None, typer.Argument(help="Names of recipes, or .toml files; all of them if none is named.")
    ] = None,
    preset: Annotated[Preset, typer.Option(help=PRESETS)] = Preset.QUICK,
    out: Annotated[Path, typer.Option(help="Folder for the records, and for the photons that a rerun resumes.")] = OUT,
    seed: Annotated[int, typer.Option(help="Seed of the photons and of the chains, 0 to 4294967295.")] = 1,
    photons: Annotated[
        int | None, typer.Option(help="Number of photons in each setting instead of the preset's.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Simulate the light, refit the recipes' laws to it, and write one record a recipe.

    Example: profilefit regenerate albedo-liang liang-whole --out my-fits
    """
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"seed must be a whole number in [0, {MAX_SEED}], got {seed}")
    if photons is not None and photons < 1:
        raise InputError(f"photons must be a whole number >= 1, got {photons}")
    console = Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)
    names = recipes or list(recipe.available(catalogue.fits_folder()))
    chosen = tuple(recipe.find(name, catalogue.fits_folder()) for name in names)
    _require_one_record_each(chosen)
    record.require_writable(out)
    begin = time.perf_counter()
    run = Run(
        preset=preset.value,
        seed=seed,
        out=out,
        store=out / PHOTON_STORE / f"seed-{seed}",
        photons=photons,
        say=lambda text: console.print(f"[{time.perf_counter() - begin:4.0f} s] {text}", markup=False),
        progress=None if sys.stderr.isatty() and not quiet else False,
    )
    written = calibrate.regenerate(chosen, run)
    run.say(f"wrote {len(written)} record{'s' if len(written) != 1 else ''} to {out}")


def _require_one_record_each(recipes: tuple[recipe.Recipe, ...]) -> None:
    """RecipeError if two recipes would write the same record."""
    first: dict[str, Path] = {}
    for one in recipes:
        if one.name in first:
            paths = f"{first[one.name]} and {one.path}"
            raise RecipeError(f"recipes must have different names, as their records do, got {paths}")
        first[one.name] = one.path
