"""Records made again: what names request of every kind, and the works of all of them side by side, stage by stage."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from mcml_sim.runs.progress import tracked
from profilefit.errors import RecordError
from profilefit.recipes import recipe
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import KINDS, Kind
from profilefit.recipes.run import RecipeRun, Step, written
from profilefit.recipes.workers import Workers

Request = tuple[Kind, Any]


def requests_of(names: Sequence[str] = ()) -> list[Request]:
    """Return what names of records or files request of each kind; of all that ship, if none is named.

    InputError on a name of no kind, on a damaged file, and where two of one kind would write one record.
    """
    found: list[Request] = []
    for name in dict.fromkeys(names or (each for kind in KINDS for each in kind.requests())):
        own = [(kind, request) for kind in KINDS if (request := kind.module.request(name)) is not None]
        if not own:
            recipe.find(name, fits_folder())  # says which there are
        found += own
    first: dict[tuple[str, str], Any] = {}
    for kind, request in found:
        before = first.setdefault((kind.folder, request.name), request)
        if before is not request:
            path = getattr(request, "path", None)
            got = f"{before.path} and {path}" if path else f"{request.name!r} twice"
            raise RecordError(f"{kind.plural} must have different names, as their records do, got {got}")
    return found


def regenerate(requests: Sequence[Request], run: RecipeRun, processes: int = 1) -> list[Step]:
    """Make and write records: first the maps that others are normalised with, last what compares them.

    Args:
        requests: what to fit, as `requests_of` finds it.
        run: preset, seed and folders.
        processes: number of processes that fit side by side; the records do not depend on it.

    Returns:
        The light that was made ready, and each record as it was written.
    """
    works = sorted((kind.module.fit(request, run) for kind, request in requests), key=lambda work: work.order)
    steps = list(run.steps.values())
    with Workers(min(processes, sum(len(work.parts) for work in works))) as workers:
        for _, stage in itertools.groupby(works, key=lambda work: work.order[0]):
            those = list(stage)
            made = written(those, run.out, workers, run.say)
            steps += tracked(made, "fitting", "records", len(those), run.progress is False)
    return steps
