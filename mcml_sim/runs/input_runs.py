"""Runs of an MCML input file: where each keeps its results, what they may replace, and what was done before."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import jax.monitoring

from mcml_sim.errors import ELSEWHERE, NAMED, InputError, StoreError
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import ROOM, read_whole, require_target, require_writable, write_together
from mcml_sim.media.medium import Medium
from mcml_sim.results.mci import Run
from mcml_sim.results.mco import HEAD_BYTES, begins_mco, made_by, mco_text
from mcml_sim.results.tally import Precision, Results, read_results, require_quantity, results_bytes
from mcml_sim.runs.simulation import batch_photons, is_store_of, require_store, simulate
from mcml_sim.runs.store import batches, discard, strange

BYTES = 32  # of a cell: value and error in the .npz, and twelve letters in the .mco
EVENTS = "/jax/core/compile/"  # tracing, lowering and compiling


class Compiling:
    """Stopwatch that, while entered, notes when this process compiles, on whichever thread."""

    def __init__(self) -> None:
        self._spans: list[tuple[float, float]] = []

    def __enter__(self) -> Self:
        jax.monitoring.register_event_duration_secs_listener(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        jax.monitoring.unregister_event_duration_listener(self._note)

    @property
    def seconds(self) -> float:
        """Time in which anything was compiled [s]; what overlaps counts once."""
        total, end = 0.0, float("-inf")
        for begin, ended in sorted(self._spans):
            total += max(ended - max(begin, end), 0.0)
            end = max(end, ended)
        return total

    def _note(self, event: str, duration_secs: float, **_: str | int | float) -> None:
        if event.startswith(EVENTS):
            now = time.perf_counter()
            self._spans.append((now - duration_secs, now))


@dataclass(frozen=True)
class RunOptions:
    """Options that all runs have in common; arguments as for `simulate`.

    seed  of all runs; None is the seed that an input of MCML 2 gives each, else 0
    goal  the precision at which a run may stop early
    """

    seed: int | None
    goal: Precision | None
    workers: int | None
    scheduler: str | None
    progress: bool | None


@dataclass(frozen=True)
class Job:
    """Run, with the paths of its results and of its batches until then."""

    run: Run
    photons: int
    seed: int
    mco: Path
    npz: Path
    store: Path

    @property
    def is_part_of_more(self) -> bool:
        """Whether the store holds batches beyond this run's photons, which are a longer run's."""
        return self._holds_more(self.run.medium, self.photons)

    def is_in_the_way(self) -> bool:
        """Return True if the store holds what another run left, finished: no more photons than the results to replace.

        StoreError if it holds anything else of another run.
        """
        try:
            require_store(self.store, self.run.medium, self.run.grid, self.seed)
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


@dataclass(frozen=True)
class Done:
    """Run that is done: its results, and how that went.

    seconds  it took, of which compiling [s]; None if it was finished before
    resumed  whether some of its batches were there
    """

    results: Results
    seconds: float | None = None
    compiling: float = 0.0
    resumed: bool = False


def jobs(file: Path, runs: tuple[Run, ...], photons: int | None, folder: Path | None, options: RunOptions) -> list[Job]:
    """Return the runs of an input file, each with the paths of its results; nothing is written yet.

    `photons` are for each run in place of the file's, `folder` is in place of the current one. InputError,
    OutputError or StoreError where a run could not keep its results: better now than hours later.
    """
    seeds = [(run.seed or 0) if options.seed is None else options.seed for run in runs]
    planned = [
        Job(run, photons or run.photons, seed, *_outputs(run, folder)) for run, seed in zip(runs, seeds, strict=True)
    ]
    _require_room(file, planned, options)
    return planned


def done(job: Job, options: RunOptions) -> Done:
    """Do a run, unless the same was done before, and keep its results."""
    kept = _finished(job, options)
    finished = _traced(job, options) if kept is None else Done(kept)
    kept = finished.results
    is_enough = options.goal is None or options.goal.is_reached(kept.estimates[options.goal.quantity])
    if is_enough and not job.is_part_of_more:  # else the photons at hand would save a longer run theirs
        discard(job.store)
    return finished


def _traced(job: Job, options: RunOptions) -> Done:
    if job.is_in_the_way():
        discard(job.store)
    resumed, start = bool(batches(job.store)), time.perf_counter()
    with Compiling() as compiling:
        tally = simulate(
            job.run.medium,
            job.run.grid,
            job.photons,
            seed=job.seed,
            store=job.store,
            workers=options.workers,
            precision=options.goal,
            scheduler=options.scheduler,
            progress=options.progress,
        )
    seconds = time.perf_counter() - start
    # The .npz is last: by it the run counts as finished.
    write_together({job.mco: mco_text(tally, job.mco.name), job.npz: results_bytes(tally)})
    return Done(read_results(job.npz), seconds, compiling.seconds, resumed)


def _outputs(run: Run, folder: Path | None) -> tuple[Path, Path, Path]:
    """Return paths by the name in the input file, in `folder` or, as MCML does, in the current folder.

    A name that leads out of there is a stranger's say over our files: it takes a folder, which gets its last part.
    """
    name = Path(run.output)
    if name.is_absolute() or ".." in name.parts:
        if folder is None or name.name in ("", ".."):
            accepted = f"in the current folder, or have a name and {NAMED}"
            raise InputError(f"output files must lie {accepted}, got {run.output}")
        name = Path(name.name)
    mco = (folder or Path()) / name
    bare = mco.with_suffix("") if mco.suffix.lower() == ".mco" else mco
    return mco, Path(f"{bare}.npz"), Path(f"{bare}.photons")


def _require_room(file: Path, jobs: list[Job], options: RunOptions) -> None:
    owners = {file.resolve(): f"the input file {file}"}
    for job in jobs:
        if options.goal is not None:
            require_quantity(options.goal.quantity, job.run.grid)
        for path in (job.mco, job.npz):
            require_target(path)
        for path in (job.mco, job.npz, job.store):
            place = path.resolve()
            if place in owners:
                raise InputError(f"cannot write {path} for {job.run.output}: it belongs to {owners[place]}")
            owners[place] = job.run.output
        _require_ours(job)
        job.is_in_the_way()
    room = ROOM + BYTES * sum(job.run.cells for job in jobs if not job.npz.exists())
    for job in jobs:
        for path in (job.mco, job.npz):
            require_writable(path, 0 if job.npz.exists() else room)


def _require_ours(job: Job) -> None:
    """Raise InputError where a file or a folder that is to be replaced is no output of a run."""
    reason = None
    if job.mco.is_file() and job.mco.stat().st_size and not begins_mco(job.mco):
        reason = f"{job.mco} is there already, and no output of MCML"
    elif job.npz.exists() and not (job.npz.is_file() and (not job.npz.stat().st_size or _results(job.npz))):
        reason = f"{job.npz} is there already, and no results of mcml_sim"
    elif names := strange(job.store):
        reason = f"{job.store} is there already, and holds {names[0]}, which is no batch of photons"
    if reason is not None:
        raise InputError(f"{reason}: it is not replaced, {ELSEWHERE}")


def _finished(job: Job, options: RunOptions) -> Results | None:
    """Return the run's results, if its files are there and of this very run."""
    results = _results(job.npz)
    if results is None or not job.mco.is_file() or made_by(job.seed).encode() not in read_whole(job.mco, HEAD_BYTES):
        return None
    here = (job.run.medium, job.run.grid, job.seed, __version__)
    if (results.medium, results.grid, results.seed, results.version) != here:
        return None
    goal = options.goal
    is_enough = goal is not None and results.photons < job.photons and goal.is_reached(results.estimates[goal.quantity])
    return results if is_enough or results.photons == job.photons else None


def _results(path: Path) -> Results | None:
    """Return the results of a run in that file, if there are any."""
    try:
        return read_results(path)
    except InputError:
        return None
