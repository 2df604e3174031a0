"""What a measurement of time rests on: the machine, its load, the versions."""

from __future__ import annotations

import contextlib
import os
import platform
from collections.abc import Iterator
from importlib.metadata import version

import jax

from profilefit.evidence import processor
from profilefit.tradeoff.stopwatch import cores

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
        "load before": _load(),
        "device": jax.devices()[0].device_kind,
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        **{name: version(name) for name in LIBRARIES},
    }


def caption(known: dict[str, str]) -> str:
    """The facts in one line for a figure."""
    return f"{known['processor']}; cores: {known['cores']}; load before: {known['load before']}; jax {known['jax']}"


def _load() -> str:
    """Processes that wanted a core over the last minute, on average."""
    return f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
