"""Seconds in which this process compiles, told from those in which it runs what is compiled."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

import jax.monitoring

EVENTS = "/jax/core/compile/"  # tracing, lowering and compiling


class Compiling:
    """While entered, notes when this process compiles, on whichever thread."""

    def __init__(self) -> None:
        self._spans: list[tuple[float, float]] = []

    def __enter__(self) -> Self:
        jax.monitoring.register_event_duration_secs_listener(self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        jax.monitoring.unregister_event_duration_listener(self._note)

    @property
    def seconds(self) -> float:
        """Time in which anything was compiled [s]; what overlaps counts once."""
        total, end = 0.0, float("-inf")
        for begun, ended in sorted(self._spans):
            total += max(ended - max(begun, end), 0.0)
            end = max(end, ended)
        return total

    def _note(self, event: str, duration_secs: float, **_: str | int | float) -> None:
        if event.startswith(EVENTS):
            now = time.perf_counter()
            self._spans.append((now - duration_secs, now))
