"""Command `mcml-sim run`: every run of an MCML input file, its results written and printed."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from mcml_sim.errors import InputError, Notice

# Numbers and names of what takes a second to import; a test holds them against it.
FIRST_LOOKS = ("2.1 million", "8.4 million")
QUANTITY = "diffuse_reflectance"
QUANTITIES = (
    "specular_reflectance",
    QUANTITY,
    "absorbed",
    "transmittance",
    "diffuse_transmittance",
    "ballistic_transmittance",
    "energy",
    "absorbed_per_layer",
    "reflectance_r",
    "transmittance_r",
    "reflectance_r_overflow",
    "transmittance_r_overflow",
    "absorbed_z",
    "absorbed_rz",
    "absorbed_z_overflow",
    "reflectance_a",
    "reflectance_ra",
    "transmittance_a",
    "transmittance_ra",
)
PRECISION = (
    "Stop a run early at this relative standard error, for example 1e-3. It is looked at after 8, 16, 32, ... batches, "
    f"first at {FIRST_LOOKS[0]} photons ({FIRST_LOOKS[1]} in a matched isotropic half space), and no run goes beyond "
    "the photons requested."
)
REPEATS = (
    "More photons or more repeats? Errors fall as 1/sqrt(photons) either way: k runs of N photons with k seeds are "
    "worth one run of k N."
)


def _quantities(incomplete: str) -> Iterator[str]:
    return (name for name in QUANTITIES if name.startswith(incomplete))


def run(
    file: Annotated[Path, typer.Argument(help="Input file of MCML 1 or 2 (.mci).")],
    photons: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="Photons of each run, such as 1e7.", show_default="the file's")
    ] = None,
    seed: Annotated[
        str | None,
        typer.Option(metavar="NUMBER", help="Seed of the photons, >= 0.", show_default="the file's, of MCML 2, else 0"),
    ] = None,
    precision: Annotated[float | None, typer.Option(help=PRECISION)] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help=f"What --precision looks at: {', '.join(QUANTITIES)}.",
            show_default=QUANTITY,
            autocompletion=_quantities,
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Changes nothing: a command resumes without.")] = False,
    workers: Annotated[int | None, typer.Option(help="Threads.", show_default="one a core")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers trace, like tcp://host:8786.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for what is written.", show_default="the current folder, as MCML"),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the totals of every run, with standard errors, as JSON instead.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print nothing but errors, and what --json does.")
    ] = False,
) -> None:
    """Do every run of an MCML input file.

    Each writes NAME.mco, as MCML does, and NAME.npz, with the standard error of every bin. While it runs, NAME.photons
    keeps the finished batches: the same command goes on where it was interrupted, and leaves a run that is finished as
    it is. Results of another run are replaced, other files are not. An absolute NAME, or one with .., needs --out, and
    its last part is written there.

    \b
    Examples, on a file of profilefit examples:
      mcml-sim run examples/slab.mci --photons 1e5 --out runs
      mcml-sim run examples/slab.mci --photons 1e8 --precision 1e-3 --out runs
    """
    with interruptible(__name__):
        from rich.console import Console

        from mcml_sim.cli import printed
        from mcml_sim.cli.screen import print_json
        from mcml_sim.cli.terminal import without_logs
        from mcml_sim.media.checks import MAX_PHOTONS, checked_workers
        from mcml_sim.results.mci import read_mci
        from mcml_sim.results.tally import Precision
        from mcml_sim.runs import input_runs

    del resume  # changes nothing: a command resumes by itself
    runs = read_mci(file)
    number = None if photons is None else _whole("photons", photons, lowest=1, highest=MAX_PHOTONS)
    if quantity is not None and precision is None:
        raise InputError(f"quantity is what --precision looks at, got {quantity!r} without --precision")
    options = input_runs.RunOptions(
        seed=None if seed is None else _whole("seed", seed, lowest=0),
        goal=None if precision is None else Precision(precision, quantity or QUANTITY),
        workers=checked_workers(workers, scheduler),
        scheduler=scheduler,
        progress=False if quiet else None,
    )
    jobs = input_runs.jobs(file, runs, number, out, options)
    if not quiet and any(planned.limit for planned in runs):
        warnings.warn(f"{file}: time limits end no run: each traces all its photons", Notice, stacklevel=2)
    console = Console(highlight=False, soft_wrap=True, quiet=quiet or as_json)
    summaries = []
    with contextlib.nullcontext() if scheduler is None else without_logs():  # dask's are tracebacks of many lines
        for at, job in enumerate(jobs, start=1):
            console.print(f"run {at} of {len(jobs)}: {job.mco}", markup=False)
            done = input_runs.done(job, options)
            summaries.append(printed.summary(job, done.results, options.goal))
            for line in printed.lines(job, done, options):
                console.print(f"  {line}", markup=False)
    if options.goal is not None:
        console.print(REPEATS, markup=False)
    if as_json:
        print_json({"runs": summaries})


def _whole(name: str, text: str, lowest: int, highest: int | None = None) -> int:
    """Return a whole number as people write them, 1e6 included."""
    with interruptible(__name__):
        from mcml_sim.media.checks import checked_whole

    number: object = text
    for read in (int, float):
        with contextlib.suppress(ValueError):  # the check says what is wrong with it
            number = read(text)
            break
    return checked_whole(name, number, lowest, highest)
