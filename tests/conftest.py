"""Set before the first test module is imported: figures go to files, and what one process compiles serves all."""

import gc
import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
os.environ["MPLBACKEND"] = "Agg"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # every core has a worker
# XLA takes two thirds of all time: workers, the commands that they start, and the next run share what it made.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / ".pytest_cache" / "xla"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
# Tables of the exact half space under refracting surfaces: not the user's, and made once.
os.environ["XDG_CACHE_HOME"] = str(ROOT / ".pytest_cache" / "user")
pytest_plugins = ["tests.seconds", "tests.fixtures"]  # which import jax, and so come after the lines above
# Most programs run once, on few numbers: unoptimised they compile three times as fast. `XLA_FLAGS= make test` optimises
# all; those that trace photons, which have options of their own, always are, and those of exact light, which run for
# long, are a little.
UNOPTIMISED = {"xla_backend_optimization_level": 0, "xla_cpu_use_fusion_emitters": False}
A_LITTLE = {**UNOPTIMISED, "xla_backend_optimization_level": 1}
EXACT = {"jit__systems", "jit__series", "jit_solve", "jit__of_block", "jit__each"}
MOST_MAPS = 20_000  # of 65530 that Linux gives a process; a file of tests takes a few thousand


def quickly_compiled(compile_program):
    """Wrap what compiles for jax."""

    def compile_quickly(backend, computation, devices, options, *arguments, **named):
        if not options.env_option_overrides:
            name = computation.operation.attributes["sym_name"].value
            options.env_option_overrides = list((A_LITTLE if name in EXACT else UNOPTIMISED).items())
        return compile_program(backend, computation, devices, options, *arguments, **named)

    return compile_quickly


if "XLA_FLAGS" not in os.environ:
    from jax._src import compiler  # jax has no public option of most programs: XLA_FLAGS are of all

    compiler.compile_or_get_cached = quickly_compiled(compiler.compile_or_get_cached)


@pytest.fixture(autouse=True, scope="module")
def few_memory_maps():
    """What earlier files compiled goes before it fills a worker's memory maps, at whose end Python aborts."""
    yield
    maps = Path("/proc/self/maps")
    if "jax" in sys.modules and maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        sys.modules["jax"].clear_caches()
        gc.collect()
