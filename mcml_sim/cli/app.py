"""Program mcml-sim: first screen, subcommand `run`, its report, and errors in terms of the command line."""

from __future__ import annotations

import contextlib
import math
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcml_sim.cli.program import ACCEPTED, FirstScreen, Program, add, add_version, two_interrupts, without_logs
from mcml_sim.errors import ELSEWHERE, NAMED, RESUMES, ClusterError, InputError, Notice, OutputError, StoreError

if TYPE_CHECKING:
    from mcml_sim.results.estimate import Estimate
    from mcml_sim.results.tally import Precision, Results
    from mcml_sim.runs.input_runs import Done, Job, RunOptions

__all__ = ["app", "main"]

# The library's remedies for errors, in the command line's words.
REMEDIES = {ELSEWHERE: "use --out elsewhere", NAMED: "--out FOLDER", RESUMES: "the same command resumes"}
HELP = """\
Trace photons through layered media as MCML does, with standard errors.

  mcml-sim run FILE.mci --out runs        simulate an MCML input file
  mcml-sim run FILE.mci --precision 1e-3  stop at an error of 0.1 %

Writes NAME.mco, as MCML does, and NAME.npz with the standard error of each bin.
After Ctrl-C the same command resumes."""
# Numbers and names of what takes a second to import; a test holds them against it.
FIRST_LOOKS = ("2.1 million", "8.4 million")
QUANTITY = "diffuse_reflectance"
QUANTITIES = (
    *("specular_reflectance", QUANTITY, "absorbed", "transmittance", "diffuse_transmittance"),
    *("ballistic_transmittance", "energy", "absorbed_per_layer", "reflectance_r", "transmittance_r"),
    *("reflectance_r_overflow", "transmittance_r_overflow", "absorbed_z", "absorbed_rz", "absorbed_z_overflow"),
    *("reflectance_a", "reflectance_ra", "transmittance_a", "transmittance_ra"),
)
PRECISION = (
    "Relative standard error at which a run stops early, for example 1e-3. It is tested after 8, 16, 32, ... batches, "
    f"first at {FIRST_LOOKS[0]} photons ({FIRST_LOOKS[1]} in a semi-infinite medium with n = 1 and g = 0)."
)
REPEATS = (
    "More photons or more repeats? Errors fall as 1/sqrt(photons) either way: k runs of N photons with k seeds are "
    "worth one run of k N."
)
# What is printed of a run, in MCML's order; ballistic light apart, since MCML's transmittance has it included.
TOTALS = {
    "specular_reflectance": "specular reflectance",
    "diffuse_reflectance": "diffuse reflectance",
    "absorbed": "absorbed fraction",
    "transmittance": "transmittance",
    "ballistic_transmittance": "  of it ballistic",
}
MOST_DIGITS = 12  # of a printed value after the point
SMALLEST = 1e-4  # value that is printed without an exponent
SLOW = 1e4  # photons/s; faster is printed in millions
SHORT = 0.05  # compiling that is not worth a word [s]


def run(
    file: Annotated[Path, typer.Argument(help="Input file of MCML 1 or 2 (.mci).")],
    photons: Annotated[
        str | None,
        typer.Option(metavar="NUMBER", help="Number of photons per run, for example 1e7.", show_default="the file's"),
    ] = None,
    seed: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBER", help="Seed of the random numbers, >= 0.", show_default="the file's in MCML 2, else 0"
        ),
    ] = None,
    precision: Annotated[float | None, typer.Option(help=PRECISION)] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help=f"Quantity whose error --precision limits: {', '.join(QUANTITIES)}.",
            show_default=QUANTITY,
            autocompletion=lambda incomplete: [name for name in QUANTITIES if name.startswith(incomplete)],
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="No effect, since every command resumes.")] = False,
    workers: Annotated[int | None, typer.Option(help="Number of threads.", show_default="one per core")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, for example tcp://host:8786.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the output files.", show_default="the current folder")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the totals of every run, with standard errors, as JSON.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only, and the output of --json.")] = False,
) -> None:
    """Simulate every run of an MCML input file.

    Writes NAME.mco, as MCML does, and NAME.npz with the standard error of every bin. The folder NAME.photons keeps
    finished batches, so that the same command resumes after an interruption. Results of another run with this NAME are
    replaced. A NAME that is an absolute path, or contains .., needs --out, which takes its last part.

    \b
    Example, on a file of profilefit examples:
      mcml-sim run examples/slab.mci --photons 1e5 --out runs
    """
    from rich.console import Console

    from mcml_sim.cli.screen import print_json
    from mcml_sim.media.arrays import MAX_PHOTONS, checked_workers
    from mcml_sim.results.mci import read_mci
    from mcml_sim.results.tally import Precision
    from mcml_sim.runs import input_runs

    del resume  # no effect: every command resumes
    runs = read_mci(file)
    number = None if photons is None else _whole("photons", photons, lowest=1, highest=MAX_PHOTONS)
    if quantity is not None and precision is None:
        raise InputError(f"quantity must be left out without --precision, got {quantity!r}")
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
            summaries.append(summary(job, done.results, options.goal))
            for line in lines(job, done, options):
                console.print(f"  {line}", markup=False)
    if options.goal is not None:
        console.print(REPEATS, markup=False)
    if as_json:
        print_json({"runs": summaries})


def _whole(name: str, text: str, lowest: int, highest: int | None = None) -> int:
    """Return a whole number from a text such as 1000 or 1e6; InputError otherwise."""
    from mcml_sim.media.arrays import checked_whole

    number: object = text
    for read in (int, float):
        with contextlib.suppress(ValueError):  # the check says what is wrong with it
            number = read(text)
            break
    return checked_whole(name, number, lowest, highest)


def totals(kept: Results) -> Iterator[str]:
    """Yield a line for each share of the light, and one for their sum."""
    for name, title in TOTALS.items():
        yield f"{title:<22} {with_error(kept.estimates[name])}"
    if kept.cut > 0:
        yield f"{'at scattering limit':<22} {kept.cut:.2g}"
    yield f"{'all of these':<22} {with_error(kept.estimates['energy'])}"


def with_error(estimate: Estimate) -> str:
    """Return a value and its standard error with two digits, such as 0.23783 ± 0.00042."""
    value, error = float(estimate.value), float(estimate.standard_error)
    if not math.isfinite(error):
        return f"{value:.6g} ± unknown"
    if error <= 0:
        return "0 (no photon seen)" if not estimate.effective_samples else f"{value:.6g}"
    place = math.floor(math.log10(error))
    if 0 < value < SMALLEST:
        digits = max(math.floor(math.log10(value)) - place + 1, 0)
        return f"{value:.{digits}e} ± {error:.1e}"
    digits = min(max(1 - place, 0), MOST_DIGITS)
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def precision_reached(estimate: Estimate, goal: Precision, photons: int) -> str:
    """Return a line that states whether the precision was reached, or how many photons would reach it."""
    import numpy as np

    if goal.is_reached(estimate):
        return f"{goal.quantity}: relative standard error {goal.relative_error:g} reached"
    value, error = np.asarray(estimate.value), np.asarray(estimate.standard_error)
    if not (np.all(value > 0) and np.all(np.isfinite(error))):
        return (
            f"{goal.quantity}: {goal.relative_error:g} not reached; some bins hold too few photons to predict how many "
            "would reach it"
        )
    reached = float(np.max(error / value))
    needed = photons * (reached / goal.relative_error) ** 2
    return (
        f"{goal.quantity}: relative standard error {reached:.2g}, not {goal.relative_error:g}; about {needed:.2g} "
        "photons in all would reach it, and these are kept: request more --photons"
    )


def lines(job: Job, done: Done, options: RunOptions) -> Iterator[str]:
    """Yield the report of a finished run, line by line."""
    kept = done.results
    yield f"{kept.photons} photons, seed {job.seed}, {pace(done, options.scheduler is not None)}"
    yield from totals(kept)
    if options.goal is not None:
        yield precision_reached(kept.estimates[options.goal.quantity], options.goal, kept.photons)
    if job.is_part_of_more:
        yield f"{job.store} is kept, since it holds more photons than these: more --photons use them"


def pace(done: Done, on_workers: bool) -> str:
    """Return the seconds of tracing and of compiling, and the photons traced per second."""
    if done.seconds is None:
        return "finished before"
    traced, times = max(done.seconds - done.compiling, 0.0), f"{done.seconds:.1f} s"
    if done.compiling >= SHORT:
        times = f"{traced:.1f} s and {done.compiling:.1f} s to compile"
    if done.resumed:  # the batches that were there cost nothing: a rate would be too good
        return f"{times}, resumed"
    rate = done.results.photons / max(traced, 1e-3)
    shown = f"{rate / 1e6:.3g} M" if rate >= SLOW else f"{rate:.0f}"
    there = ", compiling on the workers included" if on_workers else ""
    return f"{times}, {shown} photons/s{there}"


def summary(job: Job, kept: Results, goal: Precision | None) -> dict[str, Any]:
    """Return a finished run for JSON: files, and each share of the light with its standard error."""
    shares = {name: kept.estimates[name] for name in (*TOTALS, "energy")}
    summary = {
        "mco": job.mco,
        "npz": job.npz,
        "photons": kept.photons,
        "seed": kept.seed,
        "version": kept.version,
        "cut": kept.cut,
        "estimates": {
            name: {"value": share.value, "standard_error": share.standard_error} for name, share in shares.items()
        },
    }
    if goal is not None:
        reached = goal.is_reached(kept.estimates[goal.quantity])
        summary["precision"] = {"quantity": goal.quantity, "goal": goal.relative_error, "reached": reached}
    return summary


app = typer.Typer(cls=FirstScreen, help=HELP, no_args_is_help=True, pretty_exceptions_enable=False)
add_version(app, "mcml_sim")
add(app, run)


def _remedied(text: str) -> str:
    """Return the message of a library error with remedies for the command line."""
    for theirs, ours in REMEDIES.items():
        text = text.replace(theirs, ours)
    return text


def _hint() -> str:
    """Return advice for a command line that cannot be parsed."""
    first = next(iter(sys.argv[1:]), "")
    return f"mcml-sim run {first} does its runs" if first.endswith(".mci") else ACCEPTED


PROGRAM = Program(
    "mcml-sim",
    app,
    (ClusterError, InputError, OutputError, StoreError),
    lambda: "stopped; the finished batches are kept, the same command resumes",
    hint=_hint,
    remedied=_remedied,
)


def main() -> None:
    """Run a command; the first Ctrl-C waits for the batches in flight, the second does not."""
    with two_interrupts():
        PROGRAM.main()
