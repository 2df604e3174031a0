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
PRESETS = "quick: 2.1e7 photons, minutes. full: 4.2e8. Fewer in each setting whose surface refracts."


class Preset(StrEnum):
    """Number of photons: quick is enough for four digits of most constants, full for five."""

    QUICK = "quick"
    FULL = "full"


def regenerate(
    context: typer.Context,
    recipes: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of recipes, stacks, phase functions, or their files (.toml, .csv); all shipped ones if none.",
            autocompletion=options.recipes,
        ),
    ] = None,
    preset: Annotated[Preset, typer.Option(help=PRESETS)] = Preset.QUICK,
    out: Annotated[
        Path, typer.Option(help="Folder for the records, and for the photons that a rerun resumes.")
    ] = LOCAL,
    seed: Annotated[int, typer.Option(help="Seed of the photons and of the chains, 0 to 4294967295.")] = SEED,
    photons: Annotated[
        int | None, typer.Option(help="Number of photons in each setting instead of the preset's.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was written as JSON: constants, errors, quality.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Simulate light, refit the laws, write the records.

    Each record takes seconds to minutes, and as many are fitted side by side as there are cores. After Ctrl-C the same
    command resumes: photons that are traced stay. The table at the end compares each record with the shipped one: how
    far its constants moved, in units of their stated error. The command ends with status 1 where a constant moves by
    more than 0.05 of its error, or an interval by more than the Monte Carlo error of its chain.

    A file of layers is a stack. Its law is fitted to exact light in one to three minutes, longer where a layer scatters
    forward, and its record goes to OUT/stacks. The record of its sums of Gaussians, half a minute more, goes to
    OUT/gaussians. A table of a phase function is fitted by every form in a minute, and its record goes to OUT/phases.

    \b
    Examples, the last on a file of profilefit examples:
      profilefit regenerate hazard --out mine
      profilefit regenerate albedo-liang --photons 100000 --out mine
      profilefit regenerate examples/layers-head.toml --out mine
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
