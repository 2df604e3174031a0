"""profilefit regenerate: simulate, fit, and write the records."""

from __future__ import annotations

import time
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli import options
from profilefit.cli.options import Quiet
from profilefit.errors import InputError
from profilefit.recipes.folder import LOCAL, PHASES, STACKS, SUMS, fits_folder

PHOTON_STORE = ".photons"
SEED = 1
MAX_SEED = 2**32 - 1  # numpy's RandomState, which moves the chains, takes 32 bits
PRESETS = "quick: 2.1e7 photons, minutes. full: 4.2e8. Fewer in each setting whose surface refracts."


class Preset(StrEnum):
    """How many photons: quick is enough for four digits of most constants, full for five."""

    QUICK = "quick"
    FULL = "full"


def regenerate(
    recipes: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of recipes, stacks, phase functions, or their files (.toml, .csv); all recipes if none.",
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
    quiet: Quiet = False,
) -> None:
    """Simulate light, refit the laws, write the records.

    One record a recipe, in some seconds each, as many side by side as there are cores. Ctrl-C loses what is in flight
    only: photons that are traced stay, and the same command resumes.

    A file of layers is a stack: its law is fitted to exact light in two to four minutes, longer where a layer scatters
    forward, and its record goes to OUT/stacks. That of its sums of Gaussians, two minutes more, goes to OUT/gaussians.
    A table of a phase function is fitted by every form in a minute, and its record goes to OUT/phases.

    \b
    Examples, the last on a file of profilefit examples:
      profilefit regenerate hazard --out mine
      profilefit regenerate albedo-liang --photons 100000 --out mine
      profilefit regenerate examples/layers-head.toml --out mine
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes, print_json, put
        from mcml_sim.files.whole_file import require_folder
        from mcml_sim.runs.progress import is_watched
        from profilefit.recipes.phases import record as phase_record
        from profilefit.recipes.phases.data import read_phase
        from profilefit.recipes.recipe import chosen
        from profilefit.recipes.regenerate import regenerate as regenerate_records
        from profilefit.recipes.run import RecipeRun
        from profilefit.recipes.stack import record as stack_record
        from profilefit.recipes.stack import sum_record
        from profilefit.recipes.workers import cores
        from profilefit.report.tables.summary_tables import outcome, spent

    if not 0 <= seed <= MAX_SEED:
        raise InputError(f"seed must be a whole number in [0, {MAX_SEED}], got {seed}")
    if photons is not None and photons < 1:
        raise InputError(f"photons must be a whole number >= 1, got {photons}")
    said = notes(quiet)
    tables = {name: found for name in recipes or () if (found := phase_record.table_of(name)) is not None}
    phases, recipes = list(dict.fromkeys(tables.values())), [name for name in recipes or () if name not in tables]
    for table in phases:
        read_phase(table)
    stacks = [stack_record.request_of(name) for name in recipes or () if stack_record.is_stack(name)]
    others = [name for name in recipes or () if not stack_record.is_stack(name)]
    those = chosen(others, fits_folder()) if others or not (stacks or phases) else ()
    stack_record.require_apart(stacks)
    if stacks or phases:
        _require_default(
            {"--preset": preset is not Preset.QUICK, "--seed": seed != SEED, "--photons": photons is not None}
        )
    require_folder(out)
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
    steps = regenerate_records(those, run, processes=cores()) if those else []
    written = {step.name: step.path for step in steps if step.path}
    seconds = {step.name: step.seconds for step in steps}
    for stack in stacks:
        for folder, made in ((STACKS, stack_record.regenerate), (SUMS, sum_record.regenerate)):
            start, name = time.perf_counter(), f"{folder}/{stack.name}"
            written[name] = made(stack, out, cores(), run.say)
            seconds[name] = time.perf_counter() - start
    for table in phases:
        start, name = time.perf_counter(), f"{PHASES}/{table.stem}"
        written[name] = phase_record.regenerate(table, out, run.say)
        seconds[name] = time.perf_counter() - start
    if len(written) > 1:
        put(spent(seconds, written), said)
    run.say(f"wrote {len(written)} record{'s' if len(written) != 1 else ''} to {out}")
    if as_json:
        print_json({name: {**outcome(path), "seconds": round(seconds[name], 1)} for name, path in written.items()})


def _require_default(given: dict[str, bool]) -> None:
    """InputError on an option that stacks and phase functions do not take."""
    for option, is_given in given.items():
        if is_given:
            raise InputError(
                f"{option} must be left out where a stack or a phase function is fitted: its data and starts are fixed"
            )
