"""Runs that are killed, or meet a full disk, and go on: the bits of a run that nothing happened to."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

KILLS = 4
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


def wait_for(batches, store, child):
    deadline = time.monotonic() + 60
    while kept(store) < batches and child.poll() is None and time.monotonic() < deadline:
        time.sleep(0.002)


@pytest.mark.slow
def test_runs_killed_at_random_moments_resume_to_the_same_bits(start, tmp_path):
    whole = finish(start())
    store = tmp_path / "store"
    random = np.random.default_rng(2)
    hit = set()
    for more in random.integers(1, 4, size=KILLS):
        child = start(str(store))
        wait_for(kept(store) + more, store, child)
        time.sleep(random.uniform(0, 0.03))  # in the middle of a batch, or of writing one
        child.kill()
        child.communicate()
        assert child.returncode == -signal.SIGKILL, "else it was done before the last kill: give it more photons"
        hit |= {next(name for name, batches in BATCHES.items() if kept(store, name) < batches)}
    assert hit == set(BATCHES), "else only one of the two was killed"
    assert finish(start(str(store))) == whole


# Batches of rising size, so that both a small disk and a small limit for a file are met in the middle.
FULL = """
import resource, signal, subprocess, sys
from dataclasses import dataclass
from pathlib import Path
import numpy as np
from mcml_sim import StoreError
from mcml_sim.runs.batches import run_batches
from mcml_sim.runs.store import Store

@dataclass
class Bytes:
    started: int
    random: np.ndarray
    def __add__(self, other):
        return Bytes(self.started + other.started, self.random + other.random[:1])
    def arrays(self):
        return {"started": np.array(self.started), "random": self.random}
    @classmethod
    def read(cls, arrays):
        return cls(int(arrays["started"]), arrays["random"])

traced = []
def trace(batch, photons):
    traced.append(batch)
    return Bytes(photons, np.random.default_rng(batch).normal(size=1 + 300 * batch))

folder, how = sys.argv[1:]
disk = ["mount", "-t", "tmpfs", "-o"]
if how == "small disk":
    subprocess.run([*disk, "size=80k", "tmpfs", folder], check=True)
else:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16384, resource.RLIM_INFINITY))
store = Store(Path(folder), {}, Bytes.read)
try:
    run_batches(trace, 1, 20, workers=1, store=store)
except StoreError as error:
    print(error)
kept = sorted(path.name for path in Path(folder).iterdir())
print(traced, len(kept))
if how == "small disk":
    subprocess.run([*disk, "remount,size=8m", "tmpfs", folder], check=True)
else:
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
traced.clear()
again = run_batches(trace, 1, 20, workers=1, store=store)
first = again.random.tobytes() == run_batches(trace, 1, 20).random.tobytes()
print(traced[:20 - len(kept) + 1], first)
"""


def may_mount():
    """True where a user may have a file system of his own, in a name space that ends with the process."""
    trial = ["unshare", "-Urm", "mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", "/tmp"]
    return shutil.which("unshare") is not None and subprocess.run(trial, capture_output=True).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("how", "reason"), [("small disk", "No space left on device"), ("small files", "File too large")]
)
def test_a_full_disk_is_named_and_the_run_goes_on_when_there_is_room(tmp_path, how, reason):
    inside = []
    if how == "small disk":
        if not may_mount():
            pytest.skip("this machine lets no user mount a file system; 'small files' meets the same error")
        inside = ["unshare", "-Urm"]
    words = [*inside, sys.executable, "-c", FULL, str(tmp_path), how]
    child = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert child.returncode == 0, child.stderr
    error, before, after = child.stdout.splitlines()
    named = rf"cannot write {tmp_path}/batch-0+[0-9]+.npz: {reason}; what the store holds is whole, .*"
    assert re.fullmatch(named, error)
    failed = int(before.split("]")[0].split(",")[-1])
    assert 3 < failed < 19
    assert before == f"{list(range(failed + 1))} {failed + 1}", "the manifest and the batches before, nothing half-done"
    assert after == f"{list(range(failed, 20))} True"
