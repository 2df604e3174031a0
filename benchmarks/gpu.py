"""Order-resolved run on a GPU, if jax sees one. A process of its own, since jax's platform is chosen once.

`gpu.py PHOTONS` prints a line of JSON: the device, events and photons a second; or null, where there is no GPU.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import TypedDict

QUIET = {"TF_CPP_MIN_LOG_LEVEL": "3"}


class Measured(TypedDict):
    """Result of `measure`."""

    device: str
    events_per_second: float
    photons_per_second: float


def measure(photons: int) -> Measured | None:
    """Return the best of three runs; None without a GPU."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_PLATFORMS"} | QUIET
    command = [sys.executable, __file__, str(photons)]
    answer = subprocess.run(
        command, cwd=Path(__file__).parent, env=environment, capture_output=True, text=True, check=True
    )
    found: Measured | None = json.loads(answer.stdout.splitlines()[-1])
    return found


def _measure_here(photons: int) -> Measured | None:
    # Imported late, so that asking for a GPU costs the benchmark's own process nothing.
    import jax
    import problems

    if jax.default_backend() not in ("gpu", "cuda", "rocm"):
        return None
    problems.orders(photons, 0)
    seconds = []
    for seed in (1, 2, 3):
        begin = time.perf_counter()
        run = problems.orders(photons, seed)
        seconds.append(time.perf_counter() - begin)
    rate = photons / min(seconds)
    return Measured(
        device=jax.devices()[0].device_kind,
        events_per_second=rate * problems.order_events(run),
        photons_per_second=rate,
    )


if __name__ == "__main__":
    print(json.dumps(_measure_here(int(float(sys.argv[1])))))
