"""Work: the independent parts of records, done side by side."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from threadpoolctl import threadpool_limits

from profilefit.recipes import record
from profilefit.recipes.workers import Workers

# Every law compiles a fit of its own for each setting: hundreds of memory maps, of which Linux gives a process 65
# thousand, and tens of megabytes. No later part needs them.
CLEARED = 8  # parts of a process after which compiled programs go
_PARTS = itertools.count(1)  # of this process
Made = tuple[Mapping[str, Any], Mapping[str, np.ndarray]]


def silent(text: str) -> None:
    """Say nothing: the function that takes the place of a caller's on the way to another process."""


@dataclass(frozen=True)
class Work:
    """One record to be made.

    name    of the record in a folder of records, for example "hazard" or "stacks/skin"
    parts   functions without arguments that processes can do in any order
    finish  content and arrays of the record, from the results of the parts in their order
    notes   lines on its data, to be said before the parts begin
    """

    name: str
    parts: tuple[Callable[[], Any], ...]
    finish: Callable[[list[Any]], Made]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Step:
    """One thing done: a record written, or the light of a setting made ready.

    name     of the record or of the light; path of the record, None for light
    seconds  that its parts took, added up
    """

    name: str
    seconds: float
    path: Path | None = None


def written(works: Sequence[Work], out: Path, workers: Workers, say: Callable[[str], None] = silent) -> Iterator[Step]:
    """Write the records of `works` into the folder `out`, each as soon as its parts are done; parts begin in order."""
    for work in works:
        for note in work.notes:
            say(note)
    parts = [(at, place) for at, work in enumerate(works) for place in range(len(work.parts))]
    results: list[dict[int, Any]] = [{} for _ in works]
    seconds = [0.0] * len(works)
    for number, (result, spent) in workers.each(_done, [works[at].parts[place] for at, place in parts]):
        at, place = parts[number]
        work = works[at]
        results[at][place], seconds[at] = result, seconds[at] + spent
        if len(results[at]) == len(work.parts):
            content, arrays = work.finish([results[at][one] for one in range(len(work.parts))])
            folder, _, name = work.name.rpartition("/")
            path = record.write(out / folder, name, content, arrays)
            say(f"{work.name}: {seconds[at]:.1f} s, {content['title']}")
            yield Step(work.name, seconds[at], path)


def _done(part: Callable[[], Any]) -> tuple[Any, float]:
    """Result of a part, and the seconds it took."""
    begin = time.perf_counter()
    # Matrices are small here: threads of BLAS wait for each other, and their number would decide digits.
    with threadpool_limits(1, "blas"):
        result = part()
    if next(_PARTS) % CLEARED == 0:
        jax.clear_caches()
    return result, time.perf_counter() - begin


def alone(work: Work, out: Path, processes: int = 1, say: Callable[[str], None] = silent) -> Path:
    """Write one record, and return its path."""
    with Workers(min(processes, len(work.parts))) as workers:
        (step,) = written([work], out, workers, say)
    assert step.path is not None
    return step.path
