"""Runs that are killed, and go on: the bits of a run that nothing happened to."""

import contextlib
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

BATCHES = {"orders": 6, "layers": 12}
# It prints the digest of all numbers found.
CHILD = f"""
import hashlib, sys
from pathlib import Path
from mcml_sim import Grid, Layer, Medium, simulate_orders
from mcml_sim.tracing.layered_batch import BATCH_PHOTONS
from mcml_sim.runs.simulation import simulate

def store(name):
    return Path(sys.argv[1], name) if len(sys.argv) > 1 else None

medium = Medium((Layer(1.4, 1.0, 50.0, 0.8, 0.05), Layer(1.0, 0.5, 10.0, 0.0, 0.1)), 1.0, 1.3)
grid = Grid(0.05, 8, 0.01, 15, na=3)
orders = simulate_orders(Grid(0.5, 8), {BATCHES["orders"]} * 2**20, 9, store=store("orders"), workers=2)
layers = simulate(medium, grid, {BATCHES["layers"]} * BATCH_PHOTONS, 9, store=store("layers"), workers=2)
digest = hashlib.sha256()
for result in orders.counts, layers.deposits:
    for name, array in sorted(result.arrays().items()):
        digest.update(name.encode() + array.tobytes())
print(digest.hexdigest())
"""


@pytest.fixture
def start(tmp_path):
    """Start a child, with a store or without; none outlives the test.

    What the first one compiles the others load, which saves half of this file's time. The machine code is the same.
    """
    cache = {
        "JAX_COMPILATION_CACHE_DIR": str(tmp_path / "code"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }
    with contextlib.ExitStack() as children:

        def start(*store):
            words = [sys.executable, "-c", CHILD, *store]
            child = subprocess.Popen(words, env=os.environ | cache, stdout=subprocess.PIPE, text=True)
            children.enter_context(child)
            children.callback(child.kill)
            return child

        yield start


def finish(child):
    out, _ = child.communicate(timeout=120)
    assert child.returncode == 0
    return out


def kept(store, name="*"):
    return len(list(store.glob(f"{name}/batch-*.npz")))


@pytest.mark.slow
def test_runs_killed_at_random_moments_resume_to_the_same_bits(start, tmp_path):
    whole = finish(start())
    store = tmp_path / "store"
    random = np.random.default_rng(2)
    hit = set()
    for more in random.integers(1, 4, size=4):
        child = start(str(store))
        batches, deadline = kept(store) + more, time.monotonic() + 60
        while kept(store) < batches and child.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        time.sleep(random.uniform(0, 0.03))  # in the middle of a batch, or of writing one
        child.kill()
        child.communicate()
        assert child.returncode == -signal.SIGKILL, "else it was done before the last kill: give it more photons"
        hit |= {next(name for name, batches in BATCHES.items() if kept(store, name) < batches)}
    assert hit == set(BATCHES), "else only one of the two was killed"
    assert finish(start(str(store))) == whole
