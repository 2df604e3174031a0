"""Processes that work side by side: each does one job after the other, and none outlives the one that started it.

They are spawned, since the threads of JAX do not survive a fork, and nothing here imports JAX, so that all of them
start at once. Each has its own share of the cores, where the system allows that: XLA and BLAS start a thread for each
core that they see, and more threads than cores take a tenth more time. What XLA compiles for one process serves all.
Warnings of a job are issued again in the process that asked for it.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.queues import SimpleQueue
from typing import Any, Self, TypeVar, cast

CACHE = "JAX_COMPILATION_CACHE_DIR"  # read by JAX when a process starts
SHARED = {  # programs worth keeping: of any size, that took some time
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}
Job = TypeVar("Job")
Done = TypeVar("Done")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers(ExitStack):
    """Pool of processes; with fewer than two, jobs are done in this process.

    Leaving ends the processes at once, whatever they do: what they write must be whole or absent at any moment.
    """

    def __init__(self, processes: int) -> None:
        super().__init__()
        self._processes = processes if processes > 1 else 0

    def __enter__(self) -> Self:
        if self._processes:
            context = get_context("spawn")
            watched, held = context.Pipe(duplex=False)
            shares = context.SimpleQueue()
            known = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
            for number in range(self._processes):
                shares.put(known[number :: self._processes] if len(known) >= self._processes else [])
            self.enter_context(_sharing_programs())
            self._pool = ProcessPoolExecutor(self._processes, context, _begin, (watched, shares))
            self.callback(self._pool.shutdown, cancel_futures=True)
            if sys.version_info < (3, 11, 5):  # else a job that is on its way to nobody is waited for (CPython 94777)
                self.callback(cast("Any", self._pool)._call_queue._reader.close)
            self.callback(held.close)  # first of all: by this the processes end
        return self

    def each(self, task: Callable[[Job], Done], jobs: Sequence[Job]) -> Iterator[tuple[int, Done]]:
        """Yield the number of each job and what `task` makes of it, as they come; jobs begin in their order.

        An error of a job is raised here; ChildProcessError if a process was ended from outside.
        """
        if not self._processes:
            yield from ((number, task(job)) for number, job in enumerate(jobs))
            return
        try:
            numbers = {self._pool.submit(_done, task, job): number for number, job in enumerate(jobs)}
            for future in as_completed(numbers):
                result, warned = future.result()
                for warning in warned:
                    warnings.warn(warning, stacklevel=2)
                yield numbers[future], result
        except BrokenProcessPool:
            reason = "a process that fitted was ended from outside, for want of memory, say"
            raise ChildProcessError(reason) from None


@contextmanager
def _sharing_programs() -> Iterator[None]:
    """Let processes that start keep compiled programs in one folder, unless the user's environment names one."""
    if CACHE in os.environ:
        yield
        return
    before = {name: os.environ.get(name) for name in SHARED}
    with tempfile.TemporaryDirectory(prefix="profilefit-") as folder:
        os.environ.update({**SHARED, CACHE: folder})
        try:
            yield
        finally:
            for name, value in {**before, CACHE: None}.items():
                os.environ.pop(name, None) if value is None else os.environ.update({name: value})


def _begin(watched: Connection, shares: SimpleQueue[list[int]]) -> None:
    """Take one share of the cores, ignore Ctrl-C, which is for the process that started this, and end with that."""
    if share := shares.get():
        with suppress(OSError):  # a sandbox may forbid it; then all share all cores
            os.sched_setaffinity(0, share)
    gc.set_threshold(100_000)  # JAX makes objects by the million, few in cycles: collecting takes a tenth of the time
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()


def _end_with(watched: Connection) -> None:
    """End this process when the other end of the pipe is closed, as it also is where its holder was killed."""
    with suppress(EOFError, OSError):
        watched.recv()
    os._exit(1)


def _done(task: Callable[[Any], Any], job: Any) -> tuple[Any, list[Warning | str]]:
    """Return what a task makes of a job, and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return task(job), [warning.message for warning in caught]
