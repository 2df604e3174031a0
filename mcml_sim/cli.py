"""mcml-sim on the command line: `run` does what an MCML input file asks, with error bars."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from mcml_sim import printed
from mcml_sim.checks import MAX_PHOTONS, checked_whole, checked_workers
from mcml_sim.compiling import Compiling
from mcml_sim.errors import ClusterError, InputError, OutputError, StoreError
from mcml_sim.grid import Grid
from mcml_sim.mcml_files import Run, read_mci, write_mco
from mcml_sim.medium import half_space
from mcml_sim.quantities import Precision, Tally, quantities
from mcml_sim.results import Results, read_results, write_results
from mcml_sim.run import FIRST_LOOK
from mcml_sim.simulation import batch_photons, require_store, simulate
from mcml_sim.store import ELSEWHERE, MANIFEST, RESUMES, batches
from mcml_sim.terminal import INTERRUPTED, mend_streams, two_interrupts, without_logs
from mcml_sim.version import __version__
from mcml_sim.whole_file import require_writable

__all__ = ["app", "main", "run"]

BAD_INPUT = 2
QUANTITY = "diffuse_reflectance"
# What the library tells to do about an error, as the command line says it.
REMEDIES = {
    ELSEWHERE: "delete that folder, or use --out elsewhere",
    RESUMES: "the same command with --resume goes on",
}
FIRST_LOOKS = [f"{FIRST_LOOK * batch_photons(half_space(0.5, n=n)) / 1e6:.2g} million" for n in (1.4, 1.0)]
PRECISION = (
    "Stop a run early at this relative standard error, for example 1e-3. It is looked at after 8, 16, 32, ... batches, "
    f"first at {FIRST_LOOKS[0]} photons ({FIRST_LOOKS[1]} in a matched isotropic half space), and no run goes beyond "
    "the photons asked for."
)
LOOKED_AT = f"What --precision looks at: {', '.join(quantities(Grid(1, 1, 1, 1, na=1)))}."
REPEATS = (
    "More photons or more repeats? Errors fall as 1/sqrt(photons) either way: k runs of N photons with k seeds are "
    "worth one run of k N."
)

app = typer.Typer(
    name="mcml-sim",
    help="Trace light through layered media as MCML does, with error bars.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mcml-sim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    """Trace light through layered media as MCML does, with error bars."""


@app.command()
def run(
    file: Annotated[Path, typer.Argument(help="Input file of MCML V1 (.mci).")],
    photons: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="Photons of each run, such as 1e7.", show_default="the file's")
    ] = None,
    seed: Annotated[str, typer.Option(metavar="NUMBER", help="Seed of the photons, >= 0.")] = "0",
    precision: Annotated[float | None, typer.Option(help=PRECISION)] = None,
    quantity: Annotated[str | None, typer.Option(help=LOOKED_AT, show_default=QUANTITY)] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the same command was interrupted.")] = False,
    workers: Annotated[int | None, typer.Option(help="Threads.", show_default="one a core")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers trace, like tcp://host:8786.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for what is written.", show_default="the current folder, as MCML"),
    ] = None,
) -> None:
    """Do every run of an MCML input file.

    Each writes NAME.mco, as MCML does, and NAME.npz, with the standard error of every bin; what had these names is
    replaced. While it runs, NAME.photons keeps the finished batches.

    Example: mcml-sim run sample.mci --photons 10000000 --precision 1e-3
    """
    runs = read_mci(file)
    number = None if photons is None else _whole("photons", photons, lowest=1, highest=MAX_PHOTONS)
    if quantity is not None and precision is None:
        raise InputError(f"quantity is what --precision looks at, got {quantity!r} without --precision")
    plan = _Plan(
        seed=_whole("seed", seed, lowest=0),
        goal=None if precision is None else Precision(precision, quantity or QUANTITY),
        resume=resume,
        workers=checked_workers(workers, scheduler),
        scheduler=scheduler,
    )
    jobs = [_Job(one, number or one.photons, *_outputs(one, out)) for one in runs]
    _require_room(file, jobs, plan)
    console = Console(highlight=False, soft_wrap=True)
    with contextlib.nullcontext() if scheduler is None else without_logs():  # dask's are tracebacks of many lines
        for at, job in enumerate(jobs, start=1):
            console.print(f"run {at} of {len(jobs)}: {job.mco}", markup=False)
            for line in _done(job, plan):
                console.print(f"  {line}", markup=False)
    if plan.goal is not None:
        console.print(REPEATS, markup=False)


def _whole(name: str, text: str, lowest: int, highest: int | None = None) -> int:
    """A whole number as people write them, 1e6 included."""
    number: object = text
    for read in (int, float):
        with contextlib.suppress(ValueError):  # the check says what is wrong with it
            number = read(text)
            break
    return checked_whole(name, number, lowest, highest)


@dataclass(frozen=True)
class _Plan:
    """What the options say of all runs alike."""

    seed: int
    goal: Precision | None
    resume: bool
    workers: int | None
    scheduler: str | None


@dataclass(frozen=True)
class _Job:
    """A run, and where its results go, and its batches until then."""

    run: Run
    photons: int
    mco: Path
    npz: Path
    store: Path

    @property
    def is_begun(self) -> bool:
        """True if the store holds batches."""
        return bool(batches(self.store))

    @property
    def is_part_of_more(self) -> bool:
        """True if the store holds batches beyond this run's photons, which are a longer run's."""
        return any(batch * batch_photons(self.run.medium) >= self.photons for batch in batches(self.store))

    def discard_batches(self) -> None:
        """Remove what a store keeps, and its folder if nothing else is in it."""
        with contextlib.suppress(OSError):  # left behind, it is in nobody's way but the next plain run's, which says so
            for path in (*self.store.glob("batch-*"), *self.store.glob("*.part"), self.store / MANIFEST):
                path.unlink(missing_ok=True)
            self.store.rmdir()


def _outputs(run: Run, folder: Path | None) -> tuple[Path, Path, Path]:
    """Paths by the name in the input file, in `folder` or, as MCML does, seen from where we are."""
    name = Path(run.output)
    if folder is not None and (name.is_absolute() or ".." in name.parts):
        raise InputError(f"output files must stay inside --out {folder}, got {run.output}")
    mco = (folder or Path()) / name
    bare = mco.with_suffix("") if mco.suffix.lower() == ".mco" else mco
    return mco, Path(f"{bare}.npz"), Path(f"{bare}.photons")


def _require_room(file: Path, jobs: list[_Job], plan: _Plan) -> None:
    """InputError or OutputError where the results of a run could not be written: better now than hours later."""
    taken = {file.resolve(): f"the input file {file}"}
    for job in jobs:
        if plan.goal is not None and plan.goal.quantity not in (names := quantities(job.run.grid)):
            raise InputError(f"quantity must be one of {', '.join(names)}, got {plan.goal.quantity!r}")
        for path in (job.mco, job.npz):
            require_writable(path)
            place = path.resolve()
            if place in taken:
                raise InputError(f"cannot write {path} for {job.run.output}: it belongs to {taken[place]}")
            taken[place] = job.run.output
        require_store(job.store, job.run.medium, job.run.grid, plan.seed)
        if job.is_begun and not plan.resume:
            raise InputError(
                f"{job.store} holds photons of a run that was not finished: --resume goes on with them, "
                "or delete that folder"
            )


def _done(job: _Job, plan: _Plan) -> Iterator[str]:
    """Do the run, unless a resumed command finds it done; lines that tell of it."""
    told, kept = "finished before", _finished(job, plan) if plan.resume else None
    if kept is None:
        tally, told = _traced(job, plan)
        write_mco(tally, job.mco)
        write_results(tally, job.npz)  # the last, by which the run counts as finished
        kept = read_results(job.npz)
    estimates = kept.estimates
    is_enough = plan.goal is None or plan.goal.is_reached(estimates[plan.goal.quantity])
    yield f"{kept.photons} photons, seed {plan.seed}, {told}"
    yield from printed.totals(kept)
    if plan.goal is not None:
        yield printed.answer(estimates[plan.goal.quantity], plan.goal, kept.photons)
    if job.is_part_of_more:
        yield f"{job.store} is kept, since it holds more photons than these: --resume with more --photons uses them"
    elif is_enough:  # else the photons at hand would save a longer run theirs
        job.discard_batches()


def _traced(job: _Job, plan: _Plan) -> tuple[Tally, str]:
    """The run's tally, and how fast it went."""
    begun, start = job.is_begun, time.perf_counter()
    with Compiling() as compiling:
        tally = simulate(
            job.run.medium,
            job.run.grid,
            job.photons,
            seed=plan.seed,
            store=job.store,
            workers=plan.workers,
            precision=plan.goal,
            scheduler=plan.scheduler,
        )
    seconds = time.perf_counter() - start
    if begun:  # the batches that were there cost nothing: a rate would be too good
        return tally, f"{printed.times(seconds, compiling.seconds)}, resumed"
    there = "" if plan.scheduler is None else ", compiling on the workers included"
    return tally, printed.speed(tally.photons, seconds, compiling.seconds) + there


def _finished(job: _Job, plan: _Plan) -> Results | None:
    """The run's results, if its files are there and of this very run."""
    try:
        found = read_results(job.npz)
    except InputError:
        return None
    if (found.medium, found.grid, found.seed, found.version) != (job.run.medium, job.run.grid, plan.seed, __version__):
        return None
    goal = plan.goal
    is_enough = goal is not None and found.photons < job.photons and goal.is_reached(found.estimates[goal.quantity])
    return found if (is_enough or found.photons == job.photons) and job.mco.is_file() else None


def main() -> None:
    """Run a command; whatever the user can mend is one line on stderr and exit status 2."""
    mend_streams()
    errors = Console(stderr=True, highlight=False, soft_wrap=True)

    def say(text: object) -> None:
        errors.print(f"mcml-sim: {text}", markup=False)

    with warnings.catch_warnings(), two_interrupts():
        # Of a damaged batch, say: a line, without the place in the code.
        warnings.showwarning = lambda message, *_: say(message)
        status = _status(say)
        if status == INTERRUPTED:
            say("stopped; the finished batches are kept, the same command with --resume goes on")
    sys.exit(status)


def _status(say: Callable[[object], None]) -> int:
    """Do the command, and say what went wrong."""
    try:
        # Standalone, typer would end the process itself on Ctrl-C, and tell usage errors in a box of many lines.
        status = app(standalone_mode=False) or 0
        sys.stdout.flush()
        return int(status)
    except (ClusterError, InputError, OutputError, StoreError) as error:
        say(_remedied(str(error)))
    except typer.TyperException as error:
        if message := error.format_message():  # without arguments typer has shown the help and says no more
            say(f"{message} ({_hint()})")
        return error.exit_code
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except OSError as error:  # what is printed goes to a full disk
        say(f"cannot print: {error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python tries once more as it ends
    return BAD_INPUT


def _remedied(text: str) -> str:
    """What a library error says, with remedies of the command line."""
    for theirs, ours in REMEDIES.items():
        text = text.replace(theirs, ours)
    return text


def _hint() -> str:
    """How to put right a command that was not understood."""
    first = next(iter(sys.argv[1:]), "")
    return f"mcml-sim run {first} does its runs" if first.endswith(".mci") else "--help shows what is accepted"
