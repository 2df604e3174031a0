"""Simulate, fit, and write the records."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from mcml_sim.cli.screen import notes, print_json
from mcml_sim.files.whole_file import require_folder
from mcml_sim.runs.progress import is_watched
from profilefit.errors import InputError, RecipeError
from profilefit.recipes import catalogue, recipe, record
from profilefit.recipes.regenerate import regenerate as regenerate_records
from profilefit.recipes.run import Run
from profilefit.recipes.schema import ERRORS
from profilefit.report.tables.quality_tables import worst_measures

PHOTON_STORE = ".photons"
MAX_SEED = 2**32 - 1  # numpy's RandomState, which moves the chains, takes 32 bits


def regenerate(
    recipes: list[str] | None, preset: str, out: Path, seed: int, photons: int | None, as_json: bool, quiet: bool
) -> None:
    """Run the recipes, and say how they fare."""
    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"seed must be a whole number in [0, {MAX_SEED}], got {seed}")
    if photons is not None and photons < 1:
        raise InputError(f"photons must be a whole number >= 1, got {photons}")
    said = notes(quiet)
    names = recipes or list(recipe.available(catalogue.fits_folder()))
    chosen = tuple(recipe.find(name, catalogue.fits_folder()) for name in names)
    _require_one_record_each(chosen)
    require_folder(out)
    begin = time.perf_counter()
    run = Run(
        preset=str(preset),
        seed=seed,
        out=out,
        store=out / PHOTON_STORE / f"seed-{seed}",
        photons=photons,
        say=lambda text: said.print(f"[{time.perf_counter() - begin:4.0f} s] {text}", markup=False),
        progress=is_watched() and not quiet,
    )
    written = regenerate_records(chosen, run)
    run.say(f"wrote {len(written)} record{'s' if len(written) != 1 else ''} to {out}")
    if as_json:
        print_json({path.stem: _summary(path) for path in written})


def _summary(path: Path) -> dict[str, Any]:
    """What came out: constants with their errors, and the worst errors over alpha."""
    content = record.read(path)
    told: dict[str, Any] = {"path": path, "law": content["law"], "equations": content.get("equations")}
    if "fit" not in content:
        return {**told, "readings": len(content.get("readings", []))}
    kept = ("published", "regenerated", *ERRORS)
    constants = {name: {key: one.get(key) for key in kept} for name, one in content["constants"].items()}
    return {**told, "result": content["fit"]["result"], "constants": constants, "worst": worst_measures(content)}


def _require_one_record_each(recipes: tuple[recipe.Recipe, ...]) -> None:
    """RecipeError if two recipes would write the same record."""
    first: dict[str, Path] = {}
    for one in recipes:
        if one.name in first:
            paths = f"{first[one.name]} and {one.path}"
            raise RecipeError(f"recipes must have different names, as their records do, got {paths}")
        first[one.name] = one.path
