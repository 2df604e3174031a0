"""Numbered batches on several threads, summed: the result does not depend on who ran which batch, or when."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from mcml_sim.store import Store
from mcml_sim.tally import Counts

# How often the waiting thread looks up: where a wait cannot be interrupted, this is the delay of Ctrl-C [s].
GLANCE = 0.1

TraceBatch = Callable[[int, int], Counts]
"""(batch number, photons) -> counts of that batch's first photons."""


def run_batches(
    trace: TraceBatch,
    batch_photons: int,
    photons: int,
    workers: int | None = None,
    store: Store | None = None,
    progress: bool | None = None,
) -> Counts:
    """Counts of `photons` photons, in batches of `batch_photons` and a last one with the rest.

    Batches that `store` holds in the size needed are read, the others traced and saved. Errors and Ctrl-C stop all
    threads after the batch they are at, then rise.
    """
    tasks = _tasks(photons, batch_photons)
    threads = workers or os.cpu_count() or 1
    with _bar(progress) as bar, ThreadPoolExecutor(threads) as pool:
        run = _Run(trace, tasks, store, bar, photons)
        try:
            _wait([pool.submit(run.work) for _ in range(min(threads, -(-photons // batch_photons)))])
        finally:
            run.stop.set()
    return run.total()


class _Run:
    """What the threads of one run share."""

    def __init__(
        self, trace: TraceBatch, tasks: Iterator[tuple[int, int]], store: Store | None, bar: Progress, photons: int
    ) -> None:
        self.stop = threading.Event()
        self._lock = threading.Lock()
        self._trace, self._tasks, self._store = trace, tasks, store
        self._bar, self._line = bar, bar.add_task("photons", total=photons)
        self._sum: Counts | None = None

    def work(self) -> None:
        """Take the next batch until there is none, or someone says stop."""
        while not self.stop.is_set():
            with self._lock:
                task = next(self._tasks, None)
            if task is None:
                return
            self._add(self._batch(*task))

    def total(self) -> Counts:
        """The sum so far."""
        if self._sum is None:
            raise RuntimeError("no batch was run")
        return self._sum

    def _batch(self, batch: int, photons: int) -> Counts:
        kept = self._store.load(batch) if self._store else None
        if kept is not None and kept.started == photons:
            return kept
        counts = self._trace(batch, photons)
        # A fuller batch from a longer run holds these photons and more: keep it.
        if self._store and (kept is None or kept.started < photons):
            self._store.save(batch, counts)
        return counts

    def _add(self, counts: Counts) -> None:
        with self._lock:
            self._sum = counts if self._sum is None else self._sum + counts
        self._bar.advance(self._line, counts.started)


def _tasks(photons: int, batch_photons: int) -> Iterator[tuple[int, int]]:
    for batch, first in enumerate(range(0, photons, batch_photons)):
        yield batch, min(batch_photons, photons - first)


def _wait(futures: list[Future[None]]) -> None:
    """Wait for all, or raise the first error."""
    pending: set[Future[None]] = set(futures)
    while pending:
        done, pending = wait(pending, timeout=GLANCE, return_when=FIRST_EXCEPTION)
        for future in done:
            future.result()


class _RateColumn(ProgressColumn):
    """Photons a second."""

    def render(self, task: Task) -> Text:
        """The rate in millions, once there is one."""
        return Text(f"{(task.speed or 0.0) / 1e6:.2f} M photons/s")


def _bar(progress: bool | None) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), _RateColumn(), TimeRemainingColumn())
    shown = sys.stderr.isatty() if progress is None else progress
    return Progress(*columns, console=Console(stderr=True), disable=not shown)
