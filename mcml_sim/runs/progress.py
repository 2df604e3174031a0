"""Progress bar: how far, how fast, how long still; on stderr, and only where that is a terminal."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sized
from datetime import timedelta
from typing import TypeVar

from rich import progress as bars
from rich.console import Console
from rich.text import Text

T = TypeVar("T")
MILLION = 1e6
MINUTE = 60.0  # [s]
PERIOD = 300.0  # over which a rate is estimated [s]; rich's own 30 s forget every item that takes longer


def is_watched() -> bool:
    """Return whether somebody sees stderr; there is none where a shell has closed it."""
    return sys.stderr is not None and sys.stderr.isatty()


def bar(unit: str, shown: bool | None = None, kept: bool = False) -> bars.Progress:
    """Return a bar that counts in `unit`, such as "photons".

    Args:
        unit: what is counted.
        shown: whether it is shown; None and True: on a terminal only, as elsewhere it would be a file full of bars.
        kept: whether it stays on the screen when all is done.
    """
    counted = () if unit == "photons" else (bars.MofNCompleteColumn(),)
    speed = _Words(lambda task: rate(_speed(task), unit), "dim")
    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(),
        *counted,
        bars.TimeElapsedColumn(),
        speed,
        _Words(_remaining, "cyan"),
    )
    is_shown = is_watched() if shown is None else shown
    return bars.Progress(
        *columns, console=Console(stderr=True), transient=not kept, disable=not is_shown, speed_estimate_period=PERIOD
    )


def tracked(
    items: Iterable[T], title: str, unit: str = "items", total: int | None = None, quiet: bool = False
) -> Iterator[T]:
    """Yield the items as they come, with a bar until all are done; `total` is their number if they have no length."""
    count = total if total is not None else len(items) if isinstance(items, Sized) else None
    with bar(unit, False if quiet else None) as shown:
        yield from shown.track(items, count, description=title)


@contextlib.contextmanager
def working(what: str, quiet: bool = False) -> Iterator[None]:
    """Show a spinner, and for how long already, while something runs whose length nobody knows."""
    columns = (bars.SpinnerColumn(), bars.TextColumn("{task.description}"), bars.TimeElapsedColumn())
    shown = bars.Progress(*columns, console=Console(stderr=True), transient=True, disable=quiet or not is_watched())
    with shown:
        shown.add_task(what, total=None)
        yield


class _Words(bars.ProgressColumn):
    """Column of words that are blank until there are any."""

    def __init__(self, words: Callable[[bars.Task], str], style: str) -> None:
        super().__init__()
        self._words, self._style = words, style

    def render(self, task: bars.Task) -> Text:
        return Text(self._words(task), style=self._style)


def _remaining(task: bars.Task) -> str:
    """Return the time that remains, blank until anything is done, and once all is."""
    speed = _speed(task)
    left = 0.0 if task.total is None or not speed else (task.total - task.completed) / speed
    return f"{timedelta(seconds=round(left))} left" if left > 0 else ""


def _speed(task: bars.Task) -> float | None:
    """Return the units per second, lately; or since the start, before there are two steps."""
    since = task.completed / task.elapsed if task.elapsed else None
    return task.finished_speed or task.speed or since


def rate(speed: float | None, unit: str) -> str:
    """Return `speed` [units/s] in words: 2.30 M photons/s, 4.1 laws/s, 1 law in 12 s."""
    if not speed:
        return ""
    if speed >= 0.1 * MILLION:
        return f"{speed / MILLION:.2f} M {unit}/s"
    if speed >= 1.0:
        return f"{speed:.1f} {unit}/s"
    each = 1.0 / speed
    return f"1 {unit.removesuffix('s')} in " + (f"{each:.0f} s" if each < MINUTE else f"{each / MINUTE:.1f} min")
