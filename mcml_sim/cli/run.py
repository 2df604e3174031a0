"""What `mcml-sim run` does: every run of an MCML input file, its results kept and told."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import jax.monitoring
from rich.console import Console

from mcml_sim.cli import printed
from mcml_sim.cli.screen import print_json
from mcml_sim.cli.terminal import without_logs
from mcml_sim.errors import InputError, StoreError
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import read_whole, require_target, require_writable, write_together
from mcml_sim.media.checks import MAX_PHOTONS, checked_whole, checked_workers
from mcml_sim.media.medium import Medium
from mcml_sim.results.mci import Run, read_mci
from mcml_sim.results.mco import HEAD_BYTES, begins_mco, made_by, mco_text
from mcml_sim.results.tally import Precision, Tally, quantities
from mcml_sim.results.tally_file import Results, read_results, results_bytes
from mcml_sim.runs.simulation import batch_photons, is_store_of, require_store, simulate
from mcml_sim.runs.store import batches, discard, strange

EVENTS = "/jax/core/compile/"  # tracing, lowering and compiling


class Compiling:
    """While entered, notes when this process compiles, on whichever thread."""

    def __init__(self) -> None:
        self._spans: list[tuple[float, float]] = []

    def __enter__(self) -> Self:
        jax.monitoring.register_event_duration_secs_listener(self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        jax.monitoring.unregister_event_duration_listener(self._note)

    @property
    def seconds(self) -> float:
        """Time in which anything was compiled [s]; what overlaps counts once."""
        total, end = 0.0, float("-inf")
        for begun, ended in sorted(self._spans):
            total += max(ended - max(begun, end), 0.0)
            end = max(end, ended)
        return total

    def _note(self, event: str, duration_secs: float, **_: str | int | float) -> None:
        if event.startswith(EVENTS):
            now = time.perf_counter()
            self._spans.append((now - duration_secs, now))


QUANTITY = "diffuse_reflectance"
REPEATS = (
    "More photons or more repeats? Errors fall as 1/sqrt(photons) either way: k runs of N photons with k seeds are "
    "worth one run of k N."
)


def run(
    file: Path,
    photons: str | None,
    seed: str,
    precision: float | None,
    quantity: str | None,
    resume: bool,  # changes nothing: a command resumes by itself
    workers: int | None,
    scheduler: str | None,
    out: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Do the runs in turn, and print the totals of each."""
    runs = read_mci(file)
    number = None if photons is None else _whole("photons", photons, lowest=1, highest=MAX_PHOTONS)
    if quantity is not None and precision is None:
        raise InputError(f"quantity is what --precision looks at, got {quantity!r} without --precision")
    plan = _Plan(
        seed=_whole("seed", seed, lowest=0),
        goal=None if precision is None else Precision(precision, quantity or QUANTITY),
        workers=checked_workers(workers, scheduler),
        scheduler=scheduler,
        progress=False if quiet else None,
    )
    jobs = [_Job(one, number or one.photons, *_outputs(one, out)) for one in runs]
    _require_room(file, jobs, plan)
    console = Console(highlight=False, soft_wrap=True, quiet=quiet or as_json)
    found = []
    with contextlib.nullcontext() if scheduler is None else without_logs():  # dask's are tracebacks of many lines
        for at, job in enumerate(jobs, start=1):
            console.print(f"run {at} of {len(jobs)}: {job.mco}", markup=False)
            kept, how = _done(job, plan)
            found.append(_summary(job, kept, plan.goal))
            for line in _told(job, kept, how, plan):
                console.print(f"  {line}", markup=False)
    if plan.goal is not None:
        console.print(REPEATS, markup=False)
    if as_json:
        print_json({"runs": found})


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
    workers: int | None
    scheduler: str | None
    progress: bool | None


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
        return self._holds_more(self.run.medium, self.photons)

    def is_in_the_way(self, seed: int) -> bool:
        """True if the store holds what another run left, finished: no more photons than the results to be replaced.

        StoreError if it holds anything else of another run.
        """
        try:
            require_store(self.store, self.run.medium, self.run.grid, seed)
        except StoreError:
            done = _results(self.npz) if self.store.is_dir() else None
            if done is None or self._holds_more(done.medium, done.photons):
                raise
            if not is_store_of(self.store, done.medium, done.grid, done.seed):
                raise
            return True
        return False

    def _holds_more(self, medium: Medium, photons: int) -> bool:
        return any(batch * batch_photons(medium) >= photons for batch in batches(self.store))


def _outputs(run: Run, folder: Path | None) -> tuple[Path, Path, Path]:
    """Paths by the name in the input file, in `folder` or, as MCML does, seen from where we are.

    A name that leads out of there is a stranger's say over our files: it takes a folder, which gets its last part.
    """
    name = Path(run.output)
    if name.is_absolute() or ".." in name.parts:
        if folder is None or name.name in ("", ".."):
            raise InputError(
                f"output files must lie in the current folder, or have a name and --out FOLDER, got {run.output}"
            )
        name = Path(name.name)
    mco = (folder or Path()) / name
    bare = mco.with_suffix("") if mco.suffix.lower() == ".mco" else mco
    return mco, Path(f"{bare}.npz"), Path(f"{bare}.photons")


def _require_room(file: Path, jobs: list[_Job], plan: _Plan) -> None:
    """InputError, OutputError or StoreError where a run could not keep its results: better now than hours later.

    Nothing is written before all of them have passed.
    """
    taken = {file.resolve(): f"the input file {file}"}
    for job in jobs:
        if plan.goal is not None and plan.goal.quantity not in (names := quantities(job.run.grid)):
            raise InputError(f"quantity must be one of {', '.join(names)}, got {plan.goal.quantity!r}")
        for path in (job.mco, job.npz):
            require_target(path)
        for path in (job.mco, job.npz, job.store):
            place = path.resolve()
            if place in taken:
                raise InputError(f"cannot write {path} for {job.run.output}: it belongs to {taken[place]}")
            taken[place] = job.run.output
        _require_ours(job)
        job.is_in_the_way(plan.seed)
    for job in jobs:
        for path in (job.mco, job.npz):
            require_writable(path)


def _require_ours(job: _Job) -> None:
    """InputError where a file or a folder that is to be replaced is no output of a run."""
    found = None
    if job.mco.is_file() and job.mco.stat().st_size and not begins_mco(job.mco):
        found = f"{job.mco} is there already, and no output of MCML"
    elif job.npz.exists() and not (job.npz.is_file() and (not job.npz.stat().st_size or _results(job.npz))):
        found = f"{job.npz} is there already, and no results of mcml_sim"
    elif names := strange(job.store):
        found = f"{job.store} is there already, and holds {names[0]}, which is no batch of photons"
    if found is not None:
        raise InputError(f"{found}: it is not replaced, use --out elsewhere")


def _done(job: _Job, plan: _Plan) -> tuple[Results, str]:
    """The results of the run, which is done unless the same command has done it before; and how that went."""
    kept, how = _finished(job, plan), "finished before"
    if kept is None:
        if job.is_in_the_way(plan.seed):
            discard(job.store)
        tally, how = _traced(job, plan)
        # The .npz is last: by it the run counts as finished.
        write_together({job.mco: mco_text(tally, job.mco.name), job.npz: results_bytes(tally)})
        kept = read_results(job.npz)
    is_enough = plan.goal is None or plan.goal.is_reached(kept.estimates[plan.goal.quantity])
    if is_enough and not job.is_part_of_more:  # else the photons at hand would save a longer run theirs
        discard(job.store)
    return kept, how


def _told(job: _Job, kept: Results, how: str, plan: _Plan) -> Iterator[str]:
    """Lines that tell of a run that is done."""
    yield f"{kept.photons} photons, seed {plan.seed}, {how}"
    yield from printed.totals(kept)
    if plan.goal is not None:
        yield printed.answer(kept.estimates[plan.goal.quantity], plan.goal, kept.photons)
    if job.is_part_of_more:
        yield f"{job.store} is kept, since it holds more photons than these: more --photons use them"


def _summary(job: _Job, kept: Results, goal: Precision | None) -> dict[str, Any]:
    """The same for JSON: files, and each share of the light with its standard error."""
    shares = {name: kept.estimates[name] for name in (*printed.TOTALS, "energy")}
    summary = {
        "mco": job.mco,
        "npz": job.npz,
        "photons": kept.photons,
        "seed": kept.seed,
        "version": kept.version,
        "cut": kept.cut,
        "estimates": {name: {"value": one.value, "standard_error": one.standard_error} for name, one in shares.items()},
    }
    if goal is not None:
        reached = goal.is_reached(kept.estimates[goal.quantity])
        summary["precision"] = {"quantity": goal.quantity, "goal": goal.relative_error, "reached": reached}
    return summary


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
            progress=plan.progress,
        )
    seconds = time.perf_counter() - start
    if begun:  # the batches that were there cost nothing: a rate would be too good
        return tally, f"{printed.times(seconds, compiling.seconds)}, resumed"
    there = "" if plan.scheduler is None else ", compiling on the workers included"
    return tally, printed.speed(tally.photons, seconds, compiling.seconds) + there


def _finished(job: _Job, plan: _Plan) -> Results | None:
    """The run's results, if its files are there and of this very run."""
    found = _results(job.npz)
    if found is None or not job.mco.is_file() or made_by(plan.seed).encode() not in read_whole(job.mco, HEAD_BYTES):
        return None
    if (found.medium, found.grid, found.seed, found.version) != (job.run.medium, job.run.grid, plan.seed, __version__):
        return None
    goal = plan.goal
    is_enough = goal is not None and found.photons < job.photons and goal.is_reached(found.estimates[goal.quantity])
    return found if is_enough or found.photons == job.photons else None


def _results(path: Path) -> Results | None:
    """What a run has kept there, if anything."""
    try:
        return read_results(path)
    except InputError:
        return None
