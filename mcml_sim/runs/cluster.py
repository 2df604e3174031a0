"""Batches traced by the workers of a Dask cluster."""

from __future__ import annotations

import asyncio
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from types import ModuleType, TracebackType
from typing import Generic

from mcml_sim.errors import ClusterError, InputError, Notice
from mcml_sim.runs.store import RESUMES, R, cpu_class, maker

# Twice as many batches as there are threads: the next one is there when one is done.
BATCHES_PER_THREAD = 2
MIN_TASKS = 8  # a cluster that starts workers on demand has none before it sees some demand
MAX_TASKS = 1024  # each of them waits in a thread here
PATIENCE = 5.0  # for a scheduler to answer [s]
REMEDY = "install the same profilefit there as here"


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
        self._require_package()
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

    def __enter__(self) -> Cluster[R]:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
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

    def _require_package(self) -> None:
        """Raise ClusterError unless the scheduler has the package: it unpickles what it passes on."""
        try:
            self._client.run_on_scheduler(cpu_class)
        except Exception as error:  # whatever unpickling raises over there
            self._client.close()
            raise ClusterError(f"the scheduler at {self._scheduler} cannot load mcml_sim ({error}); {REMEDY}") from None


def _dask() -> ModuleType:
    try:
        import distributed
    except ModuleNotFoundError:
        raise InputError(
            "scheduler must be None where the package distributed is missing; pip install distributed"
        ) from None
    return distributed


def _require_scheduler(dask: ModuleType, address: str) -> None:
    """Ask who is there, since a dask Client waits forever for a port that accepts and then is silent."""
    if not isinstance(address, str):
        raise InputError(f"scheduler must be an address like tcp://host:8786, got {address!r}")

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
            address = _dask().get_worker().address
            raise ClusterError(
                f"worker {address} would give other bits: {name} is {here.get(name)} there, {value} here"
            )
    return trace(batch, photons)
