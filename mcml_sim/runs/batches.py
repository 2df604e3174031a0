"""Numbered batches on threads or a Dask cluster, summed: the result does not depend on who ran which, or when."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import FIRST_EXCEPTION, CancelledError, ThreadPoolExecutor, wait
from types import ModuleType
from typing import Generic, cast

from rich.progress import Progress, TaskID

from mcml_sim.errors import ClusterError, InputError, Notice
from mcml_sim.media.arrays import checked_workers, require
from mcml_sim.runs.progress import bar
from mcml_sim.runs.store import RESUMES, R, Store, cpu_class, maker

# How often the waiting thread looks up: where a wait cannot be interrupted, this is the delay of Ctrl-C [s].
GLANCE = 0.1
# A standard error from fewer batches is too poor to stop by, and each look is one more chance to stop by luck.
FIRST_LOOK = 8
# Batches in hand or waiting for an earlier one to be added, per thread: bounds the memory, whatever batch is slow.
AHEAD = 2

# Twice as many batches as there are threads: the next one is there when one is done.
BATCHES_PER_THREAD = 2
MIN_TASKS = 8  # a cluster that starts workers on demand has none before it sees some demand
MAX_TASKS = 1024  # each of them waits in a thread here
PATIENCE = 5.0  # for a scheduler to answer [s]
REMEDY = "install the same profilefit there as here"


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
    fold = _Fold(enough, AHEAD * threads)

    def work(shown: Progress, line: TaskID) -> None:
        while (batch := fold.take()) is not None:
            size = min(batch_photons, photons - batch * batch_photons)
            if size <= 0:
                return
            kept = store.load(batch) if store else None
            if kept is not None and kept.started == size:
                result = kept
            else:
                result = (cluster.trace if cluster else trace)(batch, size)
                # A fuller batch from a longer run holds these photons and more: keep it.
                if store and (kept is None or kept.started < size):
                    store.save(batch, result)
            fold.add(batch, result)
            shown.advance(line, size)

    # Leaving, the cluster is closed first: that frees the threads that wait for it.
    with (
        bar("photons", progress, kept=True) as shown,
        ThreadPoolExecutor(threads) as pool,
        contextlib.closing(cluster) if cluster else contextlib.nullcontext(),
    ):
        line = shown.add_task("photons", total=photons)
        try:
            pending = {pool.submit(work, shown, line) for _ in range(threads)}
            while pending:
                done, pending = wait(pending, timeout=GLANCE, return_when=FIRST_EXCEPTION)
                for future in done:
                    future.result()
        finally:
            fold.stop()
    return cast(R, fold.sum)


class _Fold(Generic[R]):
    """Queue of batch numbers, and the sum of the results in their order, however they come in."""

    def __init__(self, enough: Callable[[R], bool] | None, ahead: int) -> None:
        self._enough, self._ahead = enough, ahead
        self._turn = threading.Condition()
        self._stopped = False
        self._next = self._added = 0
        self._early: dict[int, R] = {}
        self.sum: R | None = None  # of the batches so far

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
                self.sum = result if self.sum is None else self.sum + result
                self._added += 1
                is_look = self._added >= FIRST_LOOK and self._added & (self._added - 1) == 0  # 8, 16, 32, ...
                self._stopped = is_look and self._enough is not None and self._enough(self.sum)
            self._turn.notify_all()

    def stop(self) -> None:
        """Hand out no more."""
        with self._turn:
            self._stopped = True
            self._turn.notify_all()


class Deserted(Notice):
    """Notice that a Dask cluster has no workers; the run waits for one."""


class Cluster(Generic[R]):
    """Connection to the scheduler at an address such as tcp://host:8786, whose workers call `trace`.

    A batch whose worker dies goes to another one. A worker that would not give the bits of this machine (another
    version, jaxlib, device or kind of CPU) refuses, whenever it joins: ClusterError says which, and what differs.
    InputError if the optional package is missing or `scheduler` is no address; ClusterError if no scheduler answers,
    or leaves. A Deserted warning after some seconds without workers.
    """

    def __init__(self, scheduler: str, trace: Callable[[int, int], R]) -> None:
        self._dask = _dask()
        self._scheduler, self._trace = scheduler, trace
        _require_scheduler(self._dask, scheduler)
        self._client = self._dask.Client(scheduler, timeout=PATIENCE, set_as_default=False)
        try:
            self._client.run_on_scheduler(cpu_class)  # which has the package, or cannot unpickle what it passes on
        except Exception as error:  # whatever unpickling raises over there
            self._client.close()
            raise ClusterError(f"the scheduler at {scheduler} cannot load mcml_sim ({error}); {REMEDY}") from None
        threads = sum(self._client.nthreads().values())
        self.tasks = min(max(BATCHES_PER_THREAD * threads, MIN_TASKS), MAX_TASKS)
        """Number of batches that may be under way at once."""
        self._warning, self._has_warned = threading.Lock(), False

    def trace(self, batch: int, photons: int) -> R:
        """Return the result of `trace`, computed by a worker; may be called from several threads."""
        try:
            task = self._client.submit(_trace_alike, maker(), self._trace, batch, photons, pure=False)
            while True:
                try:
                    return task.result(timeout=PATIENCE)
                except TimeoutError:  # of the wait, or the batch's own; and it may have ended since
                    if task.status == "error":
                        return task.result()
                if not task.done():
                    self._warn_if_deserted()
        except (CancelledError, self._dask.client.ClosedClientError):
            raise ClusterError(f"the scheduler at {self._scheduler} has gone; {RESUMES}") from None
        except self._dask.KilledWorker as error:
            raise ClusterError(
                f"batch {batch} was on {error.allowed_failures + 1} workers of {self._scheduler} when they died, "
                f"the last one {error.last_worker.address}; look at their logs and memory"
            ) from None
        except ModuleNotFoundError as error:
            raise ClusterError(f"a worker of {self._scheduler} lacks {error.name}; {REMEDY}") from None

    def close(self) -> None:
        """Disconnect, which frees the threads that wait."""
        self._client.close()

    def _warn_if_deserted(self) -> None:
        with self._warning:  # many threads wait, and one says so
            if self._has_warned:
                return
            try:
                self._has_warned = not self._client.nthreads()
            except OSError:  # the scheduler is going: the batch's result says so
                return
        if self._has_warned:
            text = f"no worker has come to the scheduler at {self._scheduler} so far; waiting for one"
            warnings.warn(text, Deserted, stacklevel=2)


def _dask() -> ModuleType:
    try:
        import distributed
    except ModuleNotFoundError:
        remedy = "the package distributed is missing; pip install distributed"
        raise InputError(f"scheduler must be None where {remedy}") from None
    return distributed


def _require_scheduler(dask: ModuleType, address: str) -> None:
    """Ask who is there, since a dask Client waits forever for a port that accepts and then is silent."""
    require(isinstance(address, str), "scheduler", "an address like tcp://host:8786", address)

    async def greet() -> dict[str, object]:
        security = dask.Security().get_connection_args("client")
        async with dask.rpc(address, connection_args=security) as there:
            return await asyncio.wait_for(there.identity(), PATIENCE)

    try:
        with ThreadPoolExecutor(1) as aside:  # here an event loop may be running already, as in a notebook
            kind = aside.submit(asyncio.run, greet()).result()["type"]
    except ValueError as error:
        raise InputError(f"scheduler must be an address like tcp://host:8786, got {address!r}: {error}") from None
    except Exception as error:  # whatever an answer that is none makes of the protocol, a MemoryError for one
        raise ClusterError(f"no Dask scheduler answers at {address} ({type(error).__name__})") from None
    if kind != "Scheduler":
        raise ClusterError(f"at {address} there is a Dask {kind}, not a scheduler")


def _trace_alike(made_by: dict[str, object], trace: Callable[[int, int], R], batch: int, photons: int) -> R:
    """Trace, on a worker, if that gives the bits it would give to whoever sent `made_by`."""
    here = maker()
    for name, value in made_by.items():
        if here.get(name) != value:
            at = _dask().get_worker().address
            raise ClusterError(f"worker {at} would give other bits: {name} is {here.get(name)} there, {value} here")
    return trace(batch, photons)
