"""Timing on a machine that others use too: pinned to one core, in turns, and compared turn by turn."""

from __future__ import annotations

import contextlib
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version

import jax
import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.recipes.evidence import processor

Work = Callable[[int], int]
"""Does its work once, with that seed; returns how many of whatever it did (photons, points, fits)."""
Track = Callable[[range, str], Iterable[int]]
"""Turns as they come, under a title: where a bar may be shown."""


def silent(turns: range, title: str) -> Iterable[int]:
    """Return the turns, without any progress shown."""
    return turns


def cores() -> list[int]:
    """Return cores this process may use; on systems that do not say, all of them."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def pin(*to: int) -> bool:
    """Keep this process, and the threads it will start, on these cores; False where the system cannot."""
    if not hasattr(os, "sched_setaffinity"):
        return False
    os.sched_setaffinity(0, to)
    return True


@contextlib.contextmanager
def on_one_core() -> Iterator[bool]:
    """Pin the process to the last core, which has the fewest interrupts; threads that run already stay."""
    before = cores()
    done = pin(before[-1])
    try:
        yield done
    finally:
        if done:
            pin(*before)


@dataclass(frozen=True)
class Rates:
    """Photons a second in each turn, by work; first, seconds of the untimed time before them, which compiles."""

    by_name: dict[str, list[float]]
    first: dict[str, float] = field(default_factory=dict)

    def best(self, name: str) -> float:
        """Return the undisturbed rate: that of the fastest turn [1/s]."""
        return max(self.by_name[name])

    def seconds(self, name: str) -> Floats:
        """Time of one photon in each turn (turns,) [s]."""
        return 1.0 / np.array(self.by_name[name])

    def times(self, name: str, over: str) -> Floats:
        """Return how many times as long as `over` in each turn (turns,) [-]: what disturbs a turn hits both."""
        return self.seconds(name) / self.seconds(over)

    def ratio(self, name: str, over: str, factor: float = 1.0) -> Ratio:
        """Return median of the ratios turn by turn, times `factor`, with their spread."""
        ratios = factor * self.times(over, name)
        return Ratio(float(np.median(ratios)), float(ratios.min()), float(ratios.max()))


@dataclass(frozen=True)
class Ratio:
    """Ratio of speeds: median, least and most over the turns [-]."""

    median: float
    least: float
    most: float

    def __str__(self) -> str:
        middle, *ends = (f"{x:.2f}" if self.median < 10 else f"{x:.1f}" for x in (self.median, self.least, self.most))
        return middle if self.least == self.most else f"{middle} ({' ... '.join(ends)})"


def take_turns(works: Mapping[str, Work], turns: int, track: Track = silent, title: str = "") -> Rates:
    """Time every work once a turn, after one untimed time that compiles it (seed 0)."""
    rates: dict[str, list[float]] = {name: [] for name in works}
    first = {}
    for turn in track(range(turns + 1), title):
        for name, work in works.items():
            begin = time.perf_counter()
            photons = work(turn)
            seconds = time.perf_counter() - begin
            if turn == 0:
                first[name] = seconds
            else:
                rates[name].append(photons / seconds)
    return Rates(rates, first)


LIBRARIES = ("jax", "jaxlib", "numpy", "profilefit")


@contextlib.contextmanager
def on_processor() -> Iterator[None]:
    """Keep jax from a GPU, if nothing has run on one yet: what is compared are times of one core."""
    before = jax.config.jax_platforms  # type: ignore[attr-defined]
    jax.config.update("jax_platforms", "cpu")
    try:
        yield
    finally:
        jax.config.update("jax_platforms", before)


def facts(pinned: bool) -> dict[str, str]:
    """Name -> what is known of this machine now; call it before the measurement, for the load that others make."""
    return {
        "processor": processor(),
        "cores": f"{os.cpu_count() or 1}, {'pinned to one' if pinned else f'{len(cores())} used'}",
        "load before": f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown",
        "device": jax.devices()[0].device_kind,
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        **{name: version(name) for name in LIBRARIES},
    }


def caption(known: dict[str, str]) -> str:
    """Return the facts in one line for a figure."""
    return f"{known['processor']}; cores: {known['cores']}; load before: {known['load before']}; jax {known['jax']}"
