"""Set before the first test module is imported: figures go to files, and what one process compiles serves all."""

import gc
import os
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # every core has a worker
if os.environ.get("PYTEST_XDIST_WORKER") and hasattr(os, "sched_setaffinity"):
    # Each worker on a core of its own: threads of XLA that wait for each other's cores cost a seventh of the time.
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw")) % len(cores)]})
# XLA takes two thirds of all time: workers, the commands that they start, and the next run share what it made.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / ".pytest_cache" / "xla"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
# Most programs run once, on few numbers: optimised a little they compile in half the time. `XLA_FLAGS= make test`
# optimises as for users; programs that trace photons have options of their own.
QUICKLY = ["--xla_backend_optimization_level=1"]
if version("jaxlib") < "0.11":  # which may not know it
    QUICKLY.append("--xla_cpu_use_fusion_emitters=false")
os.environ.setdefault("XLA_FLAGS", " ".join(QUICKLY))
# Tables of the exact half space under refracting surfaces: not the user's, and made once.
os.environ["XDG_CACHE_HOME"] = str(ROOT / ".pytest_cache" / "user")
pytest_plugins = ["tests.seconds", "tests.fixtures"]  # which import jax, and so come after the lines above
MOST_MAPS = 20_000  # of 65530 that Linux gives a process; a file of tests takes a few thousand


def pytest_collection_modifyitems(items):
    """Give a slow test without a time of its own half an hour: a slower machine is no failure."""
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(1800))


def pytest_collection_finish():
    """What stays to the end, modules and tests, is not searched for garbage with each new test: a tenth of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


@pytest.fixture(autouse=True, scope="module")
def few_memory_maps():
    """What earlier files compiled goes before it fills a worker's memory maps, at whose end Python aborts."""
    yield
    maps = Path("/proc/self/maps")
    if "jax" in sys.modules and maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        sys.modules["jax"].clear_caches()
        gc.collect()
