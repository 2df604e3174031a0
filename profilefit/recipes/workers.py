"""Processes that work side by side: each does one job after the other, and none outlives the one that started it.

They are spawned, since the threads of JAX do not survive a fork, and nothing here imports JAX, so that all of them
start at once. Each has its own share of the cores, where the system allows that: XLA and BLAS start a thread for each
core that they see, and more threads than cores take a tenth more time. What XLA compiles for one process serves all.
What a job warns of is warned of where it was asked for.
"""

from __future__ import annotations

import os
import signal
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any, Self, TypeVar, cast

CACHE = "JAX_COMPILATION_CACHE_DIR"  # read by JAX when a process starts
SHARED = {  # programs worth keeping: of any size, that took some time
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.1",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}
Job = TypeVar("Job")
Done = TypeVar("Done")


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _shares(processes: int) -> list[list[int]]:
    """Numbers of the cores that each process may use. Lists are empty where cores are too few or cannot be chosen."""
    known = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return [known[number::processes] if len(known) >= processes else [] for number in range(processes)]


class Workers:
    """Processes that do jobs; jobs are done here if there is one.

    Leaving ends them at once, whatever they are at; what they write must be whole or absent whenever that is.
    """

    def __init__(self, processes: int) -> None:
        self._processes = processes if processes > 1 else 0

    def __enter__(self) -> Self:
        context, self._left = get_context("spawn"), ExitStack()
        if self._processes:
            self._left.enter_context(_sharing_programs())
        pairs = [context.Pipe() for _ in range(self._processes)]
        self._pipes = [ours for ours, _ in pairs]
        self._started = [
            context.Process(target=_work, args=(theirs, share), daemon=True)
            for (_, theirs), share in zip(pairs, _shares(self._processes), strict=True)
        ]
        for process, (_, theirs) in zip(self._started, pairs, strict=True):
            process.start()
            theirs.close()  # or the end of a process would not be seen
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for process, pipe in zip(self._started, self._pipes, strict=True):
            process.kill()
            process.join()
            pipe.close()
        self._left.close()

    def each(self, task: Callable[[Job], Done], jobs: Sequence[Job]) -> Iterator[tuple[int, Done]]:
        """Return the number of each job and what `task` makes of it, as they come; jobs begin in their order.

        An error of a job rises here; ChildProcessError if a process was ended from outside.
        """
        if not self._pipes:
            yield from ((number, task(job)) for number, job in enumerate(jobs))
            return
        left, idle, at_work = list(enumerate(jobs)), list(self._pipes), dict[Any, int]()
        while left or at_work:
            while left and idle:
                number, job = left.pop(0)
                at_work[pipe := idle.pop(0)] = number
                with suppress(BrokenPipeError):  # it has ended, as the next lines will see
                    pipe.send(partial(task, job))
            for ready in wait(list(at_work)):
                number, pipe = at_work.pop(ready), cast("Connection", ready)
                idle.append(pipe)
                yield number, _received(pipe)


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


def _received(pipe: Connection) -> Any:
    try:
        result, error, warned = pipe.recv()
    except (EOFError, ConnectionResetError):
        raise ChildProcessError("a process that fitted was ended from outside, for want of memory, say") from None
    for one in warned:
        warnings.warn(one, stacklevel=3)
    if error is not None:
        raise error
    return result


def _work(pipe: Connection, own: list[int]) -> None:
    """Do jobs until nobody asks for one any more."""
    if own:
        with suppress(OSError):  # a sandbox may forbid it; then all share all cores
            os.sched_setaffinity(0, own)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that started this
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with suppress(EOFError, BrokenPipeError):
        while True:
            pipe.send(_done(pipe.recv()))


def _done(job: Callable[[], Any]) -> tuple[Any, Exception | None, list[Warning | str]]:
    """Return what a job gives, what went wrong, and what it warned of."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        try:
            result, error = job(), None
        except Exception as raised:
            raised.add_note(traceback.format_exc())  # the traceback itself stays here
            result, error = None, raised
    return result, error, [one.message for one in found]


def _end_with_parent() -> None:
    """Whoever started this may have been killed, and could not say so."""
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(1)
