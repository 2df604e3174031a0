"""Set before the first test module is imported: figures go to files, and what one process compiles serves all."""

import gc
import os
import sys
from pathlib import Path

import pytest

os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # every core has a worker
# XLA takes two thirds of all time: workers, the commands that they start, and the next run share what it made.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "xla"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
# Tables of the exact half space under refracting surfaces: not the user's, and made once.
os.environ["XDG_CACHE_HOME"] = str(Path(__file__).parents[1] / ".pytest_cache" / "user")
pytest_plugins = ["tests.fixtures"]  # imports jax, and so comes after the lines above
MOST_MAPS = 20_000  # of 65530 that Linux gives a process; a file of tests takes a few thousand


@pytest.fixture(autouse=True, scope="module")
def few_memory_maps():
    """What earlier files compiled goes before it fills a worker's memory maps, at whose end Python aborts."""
    yield
    maps = Path("/proc/self/maps")
    if "jax" in sys.modules and maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        sys.modules["jax"].clear_caches()
        gc.collect()
