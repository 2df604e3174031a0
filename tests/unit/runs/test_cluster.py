"""Batches on a Dask cluster of worker processes: the bits of one process, whoever dies."""

import os
import signal
import socket
import sys
import threading
from functools import partial

import distributed
import numpy as np
import pytest

from mcml_sim import Grid, InputError
from mcml_sim.errors import ClusterError
from mcml_sim.runs import batches as cluster
from mcml_sim.runs.batches import run_batches
from mcml_sim.runs.store import Store
from mcml_sim.tracing import orders_batch
from mcml_sim.tracing.order_bins import Counts

GRID = Grid(0.5, 8)
BATCH, BATCHES = 1000, 24
TRACE = partial(orders_batch.trace_batch, GRID, 9)
# Where the cores are busy, a worker that ended is replaced late.
pytestmark = pytest.mark.filterwarnings("ignore::mcml_sim.runs.batches.Deserted")


@pytest.fixture(scope="module")
def workers():
    """Two worker processes of one thread each, under nannies that restart them."""
    with distributed.LocalCluster(
        "127.0.0.1:0", n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as started:
        yield started


@pytest.fixture(scope="module")
def alone():
    return run_batches(TRACE, BATCH, BATCH * BATCHES, workers=1)


def equal(a, b):
    return np.array_equal(a.exits, b.exits) and a.ledger == b.ledger


def fails(scheduler, message, error=ClusterError, trace=TRACE):
    with pytest.raises(error, match=message):
        run_batches(trace, BATCH, BATCH, scheduler=scheduler)


def pids(workers):
    with distributed.Client(workers.scheduler_address, set_as_default=False) as client:
        return set(client.run(os.getpid).values())


@pytest.mark.slow
def test_two_processes_give_the_bits_of_one(workers, alone, monkeypatch):
    """Also of a batch that ends as the wait for it does."""
    assert equal(run_batches(TRACE, BATCH, BATCH * BATCHES, scheduler=workers.scheduler_address), alone)
    real, waited = distributed.Future.result, set()

    def late(task, timeout=None):
        found = real(task)
        if task.key not in waited:
            waited.add(task.key)
            raise TimeoutError
        return found

    monkeypatch.setattr(distributed.Future, "result", late)
    assert equal(run_batches(TRACE, BATCH, BATCH * BATCHES, scheduler=workers.scheduler_address), alone)
    assert len(waited) == BATCHES


def test_a_worker_killed_in_the_middle_changes_no_bit(workers, alone, tmp_path):
    victim = min(pids(workers))
    saved = []

    class Killing(Store):
        """With 4 of 24 batches saved, and 8 under way, one of the two workers gets SIGKILL."""

        def save(self, batch, result):
            super().save(batch, result)
            saved.append(batch)
            if len(saved) == 4:
                os.kill(victim, signal.SIGKILL)

    store = Killing(tmp_path, {}, partial(Counts.from_arrays, shape=alone.exits.shape))
    total = run_batches(TRACE, BATCH, BATCH * BATCHES, store=store, scheduler=workers.scheduler_address)
    assert equal(total, alone)
    assert sorted(saved) == list(range(BATCHES)), "saved here, each once"
    assert victim not in pids(workers), "else nobody died"


def test_a_worker_that_would_give_other_bits_is_refused_by_name(workers, monkeypatch):
    real = cluster.maker()
    monkeypatch.setattr(cluster, "maker", lambda: real | {"jaxlib": "0.0.1"})
    said = r"worker tcp://127.* would give other bits: jaxlib is .* there, 0.0.1 here"
    fails(workers.scheduler_address, said)


LACKING = r"a worker of tcp://.* lacks mcml_sim_; install the same profilefit there"


@pytest.mark.parametrize(
    ("trace", "error", "message"),
    [
        (partial(orders_batch.trace_batch, nonsense=1), TypeError, "trace_batch"),
        (lambda *_: __import__("mcml_sim_"), ClusterError, LACKING),
        (lambda *_: (_ for _ in ()).throw(TimeoutError("mine")), TimeoutError, "mine"),
    ],
    ids=["any error", "without the package", "a time-out, which is no silence"],
)
def test_an_error_on_a_worker_rises_here(workers, trace, error, message):
    fails(workers.scheduler_address, message, error, trace)


def test_a_batch_that_kills_its_workers_is_given_up_by_name(workers, monkeypatch):
    monkeypatch.setattr(workers.scheduler, "allowed_failures", 0)
    said = r"^batch 0 was on 1 workers of tcp://.* when they died, .*; look at their"
    fails(workers.scheduler_address, said, trace=lambda batch, photons: os._exit(1))


def test_a_scheduler_without_the_package_is_refused(workers, monkeypatch):
    monkeypatch.setattr(cluster, "cpu_class", lambda: __import__("mcml_sim_"))
    fails(workers.scheduler_address, r"cannot load mcml_sim \(No module named 'mcml_sim_'\); install the same")


@pytest.fixture
def lonely():
    """A scheduler to which no worker has come yet."""
    with distributed.LocalCluster(
        n_workers=0, protocol="tcp://", processes=False, dashboard_address=":0", silence_logs=50
    ) as started:
        yield started


def test_a_worker_may_come_later(lonely, alone):
    threading.Timer(0.2, lonely.scale, [1]).start()
    assert equal(run_batches(TRACE, BATCH, BATCH * BATCHES, scheduler=lonely.scheduler_address), alone)


@pytest.mark.slow  # of a clock: a busy machine breaks its second
def test_a_cluster_without_workers_is_said_once(lonely, alone, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    threading.Timer(3, lonely.scale, [1]).start()
    with pytest.warns(cluster.Deserted, match=r"^no worker has come to the scheduler at tcp://.* so far") as said:
        assert equal(run_batches(TRACE, BATCH, BATCH * BATCHES, scheduler=lonely.scheduler_address), alone)
    assert len(said) == 1


@pytest.mark.usefixtures("python_handles_sigint")
def test_ctrl_c_does_not_wait_for_a_cluster_that_is_stuck(lonely):
    threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
    fails(lonely.scheduler_address, None, KeyboardInterrupt)


def test_a_scheduler_that_leaves_is_one_line(lonely):
    threading.Timer(0.5, lonely.close).start()
    fails(lonely.scheduler_address, r"^the scheduler at tcp://.* has gone; the same run with its store resumes$")


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)


@pytest.mark.usefixtures("impatient")
def test_no_scheduler_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        fails(address, f"^no Dask scheduler answers at {address} .*$")
    fails(address, f"^no Dask scheduler answers at {address} .*$")  # now nobody listens


@pytest.mark.usefixtures("impatient")
def test_another_server_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            connection, _ = server.accept()
            with connection:
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 9)
                connection.recv(1000)

        thread = threading.Thread(target=answer)
        thread.start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        fails(address, f"^no Dask scheduler answers at {address} .*$")
        thread.join()


def test_a_worker_is_no_scheduler(workers):
    fails(next(iter(workers.scheduler_info["workers"])), "there is a Dask Worker, not a scheduler")


@pytest.mark.parametrize("address", ["here", "", "http://127.0.0.1:8786", 8786])
def test_no_address_is_refused(address):
    fails(address, r"scheduler must be an address like tcp://host:8786, got ", InputError)


def test_the_optional_package_is_named_and_workers_here_and_there_are_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    fails("tcp://127.0.0.1:8786", r"the package distributed is missing; pip install distributed$", InputError)
    with pytest.raises(InputError, match="workers must be None where a scheduler is given"):
        run_batches(TRACE, BATCH, BATCH, workers=2, scheduler="tcp://127.0.0.1:8786")
