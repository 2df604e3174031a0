"""profilefit regenerate: simulate, fit, and write the records."""

from __future__ import annotations

import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from profilefit.cli import options
from profilefit.errors import InputError
from profilefit.recipes.folder import LOCAL, fits_folder

PHOTON_STORE = ".photons"
SEED = 1
MAX_SEED = 2**32 - 1  # numpy's RandomState, which moves the chains, takes 32 bits
ROOM = 2**25  # bytes: more than all that is shipped
PRESETS = "Number of photons per setting, 2.1e7 (quick, minutes) or 4.2e8 (full), fewer where n is not 1."


class Preset(StrEnum):
    """Preset number of photons; quick gives four digits of most constants, full five."""

    QUICK = "quick"
    FULL = "full"


def regenerate(
    context: typer.Context,
    recipes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="RECIPE",
            help="Names of recipes, stacks or phase functions, or their files (.toml, .csv).",
            show_default="all shipped recipes",
            autocompletion=options.recipes,
        ),
    ] = None,
    preset: Annotated[Preset, typer.Option(help=PRESETS)] = Preset.QUICK,
    out: Annotated[
        Path, typer.Option(help="Folder for the records, its folders stacks, gaussians and phases, and kept photons.")
    ] = LOCAL,
    seed: Annotated[int, typer.Option(help="Seed of photons and Markov chains, 0 to 4294967295.")] = SEED,
    photons: Annotated[
        int | None, typer.Option(help="Number of photons per setting.", show_default="by --preset")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print constants, errors and quality of the records as JSON.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Refit profile models and write their records.

    Each record takes seconds to minutes, and several are fitted in parallel. After Ctrl-C the same command resumes. The
    final table compares each record with the shipped one. Exit status 1 if a constant moves by more than 0.05 of its
    stated error, or an interval by more than the Monte Carlo error of its chain.

    \b
    Example:
      profilefit regenerate hazard --out mine
    """
    from mcml_sim.cli.screen import notes, print_json, put
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import is_watched
    from profilefit.recipes.regenerate import regenerate as regenerate_records
    from profilefit.recipes.regenerate import reproduction, requests_of
    from profilefit.recipes.run import RecipeRun
    from profilefit.recipes.workers import cores
    from profilefit.report.tables.record_tables import outcome, reproduced, verdict

    if not 0 <= seed <= MAX_SEED:
        raise options.refused("seed", f"a whole number in [0, {MAX_SEED}]", seed)
    if photons is not None and photons < 1:
        raise options.refused("photons", "a whole number >= 1", photons)
    said = notes(quiet)
    requests = requests_of(recipes or ())
    is_named = getattr(context.get_parameter_source("out"), "name", "") == "COMMANDLINE"
    if out.resolve() == fits_folder() and not is_named:
        raise InputError("--out must be given where ./fits holds the shipped records, for example --out mine, got none")
    require_folder(out, room=ROOM)
    begin = time.perf_counter()
    run = RecipeRun(
        preset=str(preset),
        seed=seed,
        out=out,
        store=out / PHOTON_STORE / f"seed-{seed}",
        photons=photons,
        say=lambda text: said.print(f"[{time.perf_counter() - begin:4.0f} s] {text}", markup=False),
        progress=is_watched() and not quiet,
    )
    steps = regenerate_records(requests, run, processes=cores())
    written = {step.name: step.path for step in steps if step.path}
    seconds = {step.name: step.seconds for step in steps}
    beside = {name: reproduction(path, name) for name, path in written.items()}
    compared = [found for found in beside.values() if found is not None]
    if len(written) > 1 or compared:
        put(reproduced(seconds, written, beside), said)
    run.say(f"wrote {len(written)} record{'s' if len(written) != 1 else ''} to {out}")
    if as_json:
        print_json(
            {
                name: {**outcome(path), "seconds": round(seconds[name], 1), "reproduction": beside[name]}
                for name, path in written.items()
            }
        )
    if compared:
        said.print(verdict(compared), markup=False)
    if not all(found.is_reproduced for found in compared):
        raise typer.Exit(1)
