"""Batches on threads, with a store or without: the same photons whoever traced them, whenever."""

import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from mcml_sim import Grid, simulate_orders
from mcml_sim.run import run_batches
from mcml_sim.tally import Counts
from mcml_sim.tracer import BATCH_PHOTONS

GRID = Grid(0.5, 8)
PHOTONS = 5 * BATCH_PHOTONS // 2  # two batches and a half


def equal(a, b):
    return np.array_equal(a.counts.exits, b.counts.exits) and a.ledger == b.ledger


@pytest.fixture(scope="module")
def alone():
    return simulate_orders(GRID, PHOTONS, seed=9, workers=1)


@pytest.mark.parametrize("workers", [2, 7])
def test_any_number_of_workers_gives_the_same_bits(alone, workers):
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, workers=workers), alone)


def test_a_store_gives_the_same_bits_and_is_read_back(alone, tmp_path, monkeypatch):
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)
    monkeypatch.setattr("mcml_sim.tracer.trace", None)  # nothing is traced again
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)


def test_more_photons_later_are_the_photons_of_one_long_run(alone, tmp_path):
    simulate_orders(GRID, BATCH_PHOTONS // 3, seed=9, store=tmp_path)
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)


def test_fewer_photons_later_are_right_and_do_not_shorten_the_store(tmp_path):
    simulate_orders(GRID, BATCH_PHOTONS, seed=9, store=tmp_path)
    before = (tmp_path / "batch-000000.npz").read_bytes()
    assert equal(simulate_orders(GRID, 1000, seed=9, store=tmp_path), simulate_orders(GRID, 1000, seed=9))
    assert (tmp_path / "batch-000000.npz").read_bytes() == before


def test_a_killed_run_resumes_to_the_same_bits(alone, tmp_path):
    photons = 400 * BATCH_PHOTONS  # far more than will be traced before the kill
    call = f"simulate_orders(Grid(0.5, 8), {photons}, 9, store={str(tmp_path)!r})"
    process = subprocess.Popen([sys.executable, "-c", f"from mcml_sim import Grid, simulate_orders; {call}"])
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("batch-*.npz")) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert list(tmp_path.glob("batch-*.npz"))
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)


def one(batch, photons):
    """A batch that says who it was: its number in place of counts."""
    return Counts(np.array([[photons]]), 0, 0, photons)


def test_batches_are_numbered_and_the_last_holds_the_rest():
    asked = []
    total = run_batches(lambda b, n: asked.append((b, n)) or one(b, n), 10, 25, workers=3)
    assert sorted(asked) == [(0, 10), (1, 10), (2, 5)]
    assert total.started == 25


@pytest.fixture
def python_handles_sigint():
    """As in a terminal; a process started in the background inherits a deaf ear."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("python_handles_sigint")
def test_ctrl_c_stops_after_the_batches_in_flight():
    asked, begun = [], threading.Event()

    def trace(batch, photons):
        asked.append(batch)
        if batch == 3:
            begun.set()
        time.sleep(0.1)
        return one(batch, photons)

    def interrupt():
        begun.wait()
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        run_batches(trace, 1, 1000, workers=2)
    count = len(asked)
    assert count < 10
    time.sleep(0.5)
    assert len(asked) == count
    assert threading.active_count() < 5


def test_an_error_in_a_batch_stops_the_others_and_rises():
    asked = []

    def trace(batch, photons):
        asked.append(batch)
        if batch == 3:
            raise ValueError("batch 3")
        time.sleep(0.05)
        return one(batch, photons)

    with pytest.raises(ValueError, match="batch 3"):
        run_batches(trace, 1, 1000, workers=2)
    assert len(asked) < 20


def test_progress_is_shown_when_asked_and_silent_otherwise(capfd):
    run_batches(one, 10, 25)
    assert capfd.readouterr().err == ""
    run_batches(one, 10, 25, progress=True)
    assert "photons/s" in capfd.readouterr().err
