"""Batches on threads, or in shares, with a store or without: the same photons whoever traced them, whenever."""

import io
import operator
import signal
import sys
import threading
import time
from dataclasses import dataclass
from functools import reduce

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, simulate_orders, trace_share
from mcml_sim.runs.batches import AHEAD, run_batches
from mcml_sim.runs.input_runs import EVENTS, Compiling
from mcml_sim.runs.progress import is_watched, rate, tracked, working
from mcml_sim.runs.store import Store
from mcml_sim.tracing.order_bins import Counts
from mcml_sim.tracing.orders_batch import BATCH_PHOTONS
from tests.fixtures import refused, slow

GRID = Grid(0.5, 8)
PHOTONS = 5 * BATCH_PHOTONS // 2  # two batches and a half
SHARED = BATCH_PHOTONS + 1000  # a whole batch and the beginning of another


def equal(a, b):
    return np.array_equal(a.counts.exits, b.counts.exits) and a.ledger == b.ledger


@pytest.fixture(scope="module")
def alone():
    return simulate_orders(GRID, PHOTONS, seed=9, workers=1)


@pytest.mark.parametrize("workers", [2, *slow(7)])
def test_any_number_of_workers_gives_the_same_bits(alone, workers):
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, workers=workers), alone)


def test_a_store_gives_the_same_bits_and_is_read_back(alone, tmp_path, monkeypatch):
    """Also after a shorter run: more photons later are the photons of one long run."""
    simulate_orders(GRID, BATCH_PHOTONS // 3, seed=9, store=tmp_path)
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)
    monkeypatch.setattr("mcml_sim.tracing.orders_batch.trace", None)  # nothing is traced again
    assert equal(simulate_orders(GRID, PHOTONS, seed=9, store=tmp_path), alone)


def test_fewer_photons_later_are_right_and_do_not_shorten_the_store(tmp_path):
    simulate_orders(GRID, BATCH_PHOTONS, seed=9, store=tmp_path)
    before = (tmp_path / "batch-00000000.npz").read_bytes()
    assert equal(simulate_orders(GRID, 1000, seed=9, store=tmp_path), simulate_orders(GRID, 1000, seed=9))
    assert (tmp_path / "batch-00000000.npz").read_bytes() == before


def one(batch, photons):
    """A batch that says who it was: its number in place of counts."""
    return Counts(np.array([[photons]]), 0, 0, photons)


def test_batches_are_numbered_and_the_last_holds_the_rest():
    asked = []
    total = run_batches(lambda b, n: asked.append((b, n)) or one(b, n), 10, 25, workers=3)
    assert sorted(asked) == [(0, 10), (1, 10), (2, 5)]
    assert total.started == 25


@dataclass(frozen=True, eq=False)
class Noise:
    """A sum that says by its last bits in which order it was made."""

    started: int
    value: np.ndarray

    def __add__(self, other):
        return Noise(self.started + other.started, self.value + other.value)

    def arrays(self):
        return {"started": np.array(self.started), "value": self.value}

    @classmethod
    def of(cls, batch, photons):
        return cls(photons, np.random.default_rng(batch).normal(size=100) * 10.0 ** (batch % 5))

    @classmethod
    def read(cls, arrays):
        return cls(int(arrays["started"]), arrays["value"])


def in_order(batches):
    return reduce(operator.add, (Noise.of(batch, 10) for batch in range(batches)))


def jittery(batch, photons):
    """Batches that finish in another order than they began."""
    time.sleep(float(np.random.default_rng(batch).uniform(0, 0.01)))
    return Noise.of(batch, photons)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_sums_are_added_in_the_order_of_batches(workers):
    order = []
    total = run_batches(lambda b, n: (jittery(b, n), order.append(b))[0], 10, 400, workers=workers)
    np.testing.assert_array_equal(total.value, in_order(40).value)
    assert total.started == 400
    assert (order == sorted(order)) == (workers == 1), "else the order of finishing was not tried"
    # Another order gives other bits.
    backwards = reduce(operator.add, (Noise.of(batch, 10) for batch in reversed(range(40))))
    assert np.any(backwards.value != in_order(40).value)


def test_no_worker_runs_far_ahead_of_a_slow_batch():
    begun, seen = [], []

    def trace(batch, photons):
        begun.append(batch)
        if batch == 0:
            deadline = time.monotonic() + 30
            while len(begun) < 3 * AHEAD and time.monotonic() < deadline:
                time.sleep(0.01)
            time.sleep(0.2)  # for the others to go on, if they would
            seen.extend(begun)
        return one(batch, photons)

    run_batches(trace, 10, 1000, workers=3)
    assert sorted(seen) == list(range(3 * AHEAD))


@pytest.mark.parametrize("workers", [1, 2, 5])
@pytest.mark.parametrize("needed", [1, 8, 9, 33, 64])
def test_enough_is_asked_on_a_fixed_schedule_and_ends_the_run_there(tmp_path, workers, needed):
    asked = []

    def enough(result):
        asked.append(result.started // 10)
        return result.started >= 10 * needed

    store = Store(tmp_path, {}, Noise.read)
    looks = [n for n in (8, 16, 32, 64) if n < 2 * needed or n == 8]
    for _ in range(2):  # the second time from the store
        asked.clear()
        total = run_batches(jittery, 10, 700, workers=workers, store=store, enough=enough)
        assert asked == looks
        np.testing.assert_array_equal(total.value, in_order(looks[-1]).value)
        assert total.started == 10 * looks[-1]


@pytest.mark.parametrize("batches", [5, 8, 20])
def test_a_run_that_never_has_enough_traces_all_its_photons_and_an_error_in_enough_rises(batches):
    assert run_batches(jittery, 10, 10 * batches - 3, enough=lambda result: False).started == 10 * batches - 3
    with pytest.raises(ZeroDivisionError):
        run_batches(one, 10, 1000, enough=lambda result: 1 / 0)


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

    refused("batch 3", run_batches, trace, 1, 1000, workers=2, error=ValueError)
    assert len(asked) < 20


def test_progress_is_shown_when_asked_and_silent_otherwise(capfd, monkeypatch):
    run_batches(one, 10, 25)
    assert capfd.readouterr().err == ""
    run_batches(one, 10, 25, progress=True)
    assert "photons/s" in capfd.readouterr().err
    monkeypatch.setattr("sys.stderr", None)
    assert run_batches(one, 10, 25).started == 25, "a closed stderr is no terminal"


def files(folder):
    return {path.name: path.read_bytes() for path in folder.glob("batch-*")}


def test_shares_are_the_run_and_a_share_again_is_nothing(tmp_path):
    assert [trace_share(share, 2, GRID, SHARED, 9, store=tmp_path) for share in (1, 0, 0)] == [1, 1, 0]
    before = files(tmp_path)
    assert len(before) == 2
    together, alone = simulate_orders(GRID, SHARED, 9, store=tmp_path), simulate_orders(GRID, SHARED, 9)
    assert np.array_equal(together.ring_order_counts, alone.ring_order_counts)
    assert together.ledger == alone.ledger
    assert files(tmp_path) == before
    other = tmp_path / "a longer run traces a short batch again"
    assert [trace_share(0, 1, GRID, photons, 9, store=other) for photons in (500, 1000, 500)] == [1, 1, 0]


def test_what_is_no_share_is_said(tmp_path):
    refused(r"share must be a whole number >= 0 and <= 1, got 2", trace_share, 2, 2, GRID, 1000, store=tmp_path)
    refused(r"shares must be a whole number >= 1, got 0", trace_share, 0, 0, GRID, 1000, store=tmp_path)
    refused(r"store must be the path of a folder, got None", trace_share, 0, 1, GRID, 1000, store=None)


@pytest.mark.parametrize(
    ("speed", "unit", "said"),
    [
        (2.3e6, "photons", "2.30 M photons/s"),
        (4.14, "laws", "4.1 laws/s"),
        (1 / 12, "laws", "1 law in 12 s"),
        (1 / 150, "recipes", "1 recipe in 2.5 min"),
        (None, "laws", ""),
        (0.0, "laws", ""),
    ],
)
def test_a_rate_in_words(speed, unit, said):
    assert rate(speed, unit) == said


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_how_far_how_fast_and_how_long_still(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert is_watched()
    for number in tracked(iter([1, 2, 3]), "counting", "numbers", total=3):
        time.sleep(0.4 * number)  # in whole seconds, what is left rounds to one
    with working("thinking"):
        pass
    shown = sys.stderr.getvalue()
    assert "counting" in shown
    assert "3/3" in shown
    assert " numbers/s" in shown
    assert " left" in shown
    assert "thinking" in shown


@pytest.mark.parametrize(("screen", "quiet"), [(Terminal, True), (io.StringIO, False)])
def test_nobody_else_does(monkeypatch, screen, quiet):
    monkeypatch.setattr(sys, "stderr", screen())
    assert list(tracked([1, 2], "counting", quiet=quiet)) == [1, 2]
    with working("thinking", quiet):
        pass
    assert sys.stderr.getvalue() == ""
    monkeypatch.setattr(sys, "stderr", None)
    assert not is_watched(), "a closed stderr is no terminal"


def test_the_first_call_compiles_and_the_second_does_not():
    def slow_to_compile(x):
        for power in range(60):
            x = jnp.sin(x + power) * jnp.where(x > power, x, -x)
        return x

    compiled, argument = jax.jit(slow_to_compile), jnp.ones(3)
    begun = time.perf_counter()
    with Compiling() as first:
        compiled(argument).block_until_ready()
    elapsed = time.perf_counter() - begun
    assert 0.5 * elapsed < first.seconds <= elapsed
    with Compiling() as second:
        compiled(argument).block_until_ready()
    assert second.seconds == 0


def test_threads_that_compile_at_once_count_once():
    def compile_slowly():
        begun = time.perf_counter()
        time.sleep(0.3)
        jax.monitoring.record_event_duration_secs(EVENTS + "anything", time.perf_counter() - begun)
        jax.monitoring.record_event_duration_secs("/something/else", 1000.0)

    threads = [threading.Thread(target=compile_slowly) for _ in range(4)]
    begun = time.perf_counter()
    with Compiling() as compiling:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert 0.3 <= compiling.seconds <= time.perf_counter() - begun


def test_what_lies_apart_adds_up(monkeypatch):
    with Compiling() as compiling:
        for now, duration in ((10.0, 2.0), (9.5, 1.0), (13.0, 2.0), (12.5, 2.0)):  # 8-10 with 8.5-9.5; 10.5-13
            monkeypatch.setattr(time, "perf_counter", lambda now=now: now)
            jax.monitoring.record_event_duration_secs(EVENTS, duration)
    assert compiling.seconds == pytest.approx(4.5)
