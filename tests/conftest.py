"""Set before the first test module is imported: figures are drawn to files, never to a screen."""

import gc
import os
import sys
from pathlib import Path

import pytest

os.environ["MPLBACKEND"] = "Agg"
MOST_MAPS = 20_000  # of 65530 that Linux gives a process; a file of tests takes a few thousand


@pytest.fixture(autouse=True, scope="module")
def few_memory_maps():
    """What earlier files compiled goes before it fills a worker's memory maps, at whose end Python aborts."""
    yield
    maps = Path("/proc/self/maps")
    if "jax" in sys.modules and maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        sys.modules["jax"].clear_caches()
        gc.collect()
