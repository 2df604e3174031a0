"""Numbered batches on several threads or a cluster, summed: the result does not depend on who ran which, or when."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from typing import Generic

from rich.progress import Progress

from mcml_sim.media.checks import checked_workers
from mcml_sim.runs.cluster import Cluster
from mcml_sim.runs.progress import bar
from mcml_sim.runs.store import R, Store

# How often the waiting thread looks up: where a wait cannot be interrupted, this is the delay of Ctrl-C [s].
GLANCE = 0.1
# A standard error from fewer batches is too poor to stop by, and each look is one more chance to stop by luck.
FIRST_LOOK = 8
# Batches in hand or waiting for an earlier one to be added, per thread: bounds the memory, whatever batch is slow.
AHEAD = 2


def run_batches(
    trace: Callable[[int, int], R],
    batch_photons: int,
    photons: int,
    workers: int | None = None,
    store: Store[R] | None = None,
    progress: bool | None = None,
    scheduler: str | None = None,
    enough: Callable[[R], bool] | None = None,
) -> R:
    """Sum over `photons` photons, in batches of `batch_photons` and a last one with the rest.

    Args:
        trace: (batch number, photons) -> result of that batch's first photons.
        batch_photons: photons of a batch.
        photons: photons of all batches.
        workers: threads, by default one a core.
        store: batches it holds in the size needed are read, the others traced and saved.
        progress: show a bar on stderr; by default only if that is a terminal.
        scheduler: address of a Dask scheduler whose workers trace, instead of threads; `trace` must pickle.
        enough: called with the sum after 8, 16, 32, ... batches; True ends the run with that sum.

    Results are added in the order of their numbers, so the same bits come out whatever the workers. That `enough`
    sees few sums, the same ones in every run, keeps small the bias of stopping by an error estimated from the photons
    themselves: it vanishes as the precision requested grows (Glynn and Whitt, "The asymptotic validity of sequential
    stopping rules for stochastic simulations", Ann. Appl. Probab. 2, 1992). Batches beyond the last look stay in the
    store and do not count.

    Errors and Ctrl-C stop all threads after the batch they are at, then rise. InputError if both `workers` and
    `scheduler` are given; ClusterError if the scheduler or its workers cannot do it.
    """
    checked_workers(workers, scheduler)
    cluster = None if scheduler is None else Cluster(scheduler, trace)
    threads = min(cluster.tasks if cluster else workers or os.cpu_count() or 1, -(-photons // batch_photons))
    # Leaving, the cluster is closed first: that frees the threads that wait for it.
    with (
        bar("photons", progress, kept=True) as shown,
        ThreadPoolExecutor(threads) as pool,
        cluster or contextlib.nullcontext(),
    ):
        fold = _Fold(enough, AHEAD * threads)
        run = _Run(cluster.trace if cluster else trace, batch_photons, photons, store, fold, shown)
        try:
            _wait([pool.submit(run.work) for _ in range(threads)])
        finally:
            fold.stop()
    return fold.total()


class _Fold(Generic[R]):
    """Queue of batch numbers, and the sum of the results in their order, however they come in."""

    def __init__(self, enough: Callable[[R], bool] | None, ahead: int) -> None:
        self._enough, self._ahead = enough, ahead
        self._turn = threading.Condition()
        self._stopped = False
        self._next = self._added = 0
        self._early: dict[int, R] = {}
        self._sum: R | None = None

    def take(self) -> int | None:
        """Return the next batch, as soon as it is not too far ahead of the sum; None if no more are needed."""
        with self._turn:
            self._turn.wait_for(lambda: self._stopped or self._next < self._added + self._ahead)
            self._next += 1
            return None if self._stopped else self._next - 1

    def add(self, batch: int, result: R) -> None:
        """Add what can be added, and stop if that is enough."""
        with self._turn:
            self._early[batch] = result
            while not self._stopped and self._added in self._early:
                result = self._early.pop(self._added)
                self._sum = result if self._sum is None else self._sum + result
                self._added += 1
                is_look = self._added >= FIRST_LOOK and self._added & (self._added - 1) == 0  # 8, 16, 32, ...
                self._stopped = is_look and self._enough is not None and self._enough(self._sum)
            self._turn.notify_all()

    def stop(self) -> None:
        """Hand out no more."""
        with self._turn:
            self._stopped = True
            self._turn.notify_all()

    def total(self) -> R:
        """Return the sum so far."""
        if self._sum is None:
            raise RuntimeError("no batch was run")
        return self._sum


class _Run(Generic[R]):
    """State that the threads of one run share."""

    def __init__(
        self,
        trace: Callable[[int, int], R],
        batch_photons: int,
        photons: int,
        store: Store[R] | None,
        fold: _Fold[R],
        shown: Progress,
    ) -> None:
        self._trace, self._store, self._fold = trace, store, fold
        self._batch_photons, self._photons = batch_photons, photons
        self._bar, self._line = shown, shown.add_task("photons", total=photons)

    def work(self) -> None:
        """Take the next batch until there is none."""
        while (batch := self._fold.take()) is not None:
            photons = min(self._batch_photons, self._photons - batch * self._batch_photons)
            if photons <= 0:
                return
            self._fold.add(batch, self._batch(batch, photons))
            self._bar.advance(self._line, photons)

    def _batch(self, batch: int, photons: int) -> R:
        kept = self._store.load(batch) if self._store else None
        if kept is not None and kept.started == photons:
            return kept
        result = self._trace(batch, photons)
        # A fuller batch from a longer run holds these photons and more: keep it.
        if self._store and (kept is None or kept.started < photons):
            self._store.save(batch, result)
        return result


def _wait(futures: list[Future[None]]) -> None:
    """Wait for all, or raise the first error."""
    pending: set[Future[None]] = set(futures)
    while pending:
        done, pending = wait(pending, timeout=GLANCE, return_when=FIRST_EXCEPTION)
        for future in done:
            future.result()
