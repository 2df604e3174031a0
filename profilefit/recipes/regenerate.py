"""Records made again: what names request of every kind, the works of all, and whether these agree with what ships.

Other processors round differently: constants move by 1e-10 to 1e-5 of their size, and a chain that once rounds another
way takes another path. A constant is reproduced where it moves by at most `MOST_MOVED` of its stated error, the end of
a chain's interval where it moves by no more than the Monte Carlo error of both chains allows. A constant without an
error was not fitted, and must be equal.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from mcml_sim.runs.progress import tracked
from profilefit.errors import RecordError
from profilefit.recipes import kinds, recipe, record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.run import RecipeRun, Step, written
from profilefit.recipes.workers import Workers

Request = tuple[kinds.Kind, Any]
Content = Mapping[str, Any]
MOST_MOVED = 0.05  # of a stated error
EQUAL = 10.0**-record.DIGITS  # relative size of the last digit of a record
READING = 1e-5  # relative move of a constant that a comparison of published readings refits, without errors
CHANCE = 1e-3  # probability that one of a record's intervals moves farther, though both chains are right
SAME = ("law", "pipeline", "setting", "protocol", "layers", "preset", "seed", "indices", "cosines")


def requests_of(names: Sequence[str] = ()) -> list[Request]:
    """Return what names of records or files request of each kind; of all that ship, if none is named.

    InputError on a name of no kind, on a damaged file, and where two of one kind would write one record.
    """
    found: list[Request] = []
    for name in dict.fromkeys(names or (each for kind in kinds.KINDS for each in kind.requests())):
        own = [(kind, request) for kind in kinds.KINDS if (request := kind.module.request(name)) is not None]
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
    """Make and write the records of requests: first the maps that others are normalised with, last what compares them.

    Records do not depend on the number of processes. Return the light that was made ready, and each record.
    """
    works = sorted((kind.module.fit(request, run) for kind, request in requests), key=lambda work: work.order)
    steps = list(run.steps)
    with Workers(min(processes, sum(len(work.parts) for work in works))) as workers:
        for _, stage in itertools.groupby(works, key=lambda work: work.order[0]):
            those = list(stage)
            made = written(those, run.out, workers, run.say)
            steps += tracked(made, "fitting", "records", len(those), run.progress is False)
    return steps


@dataclass(frozen=True)
class Reproduction:
    """Moves of a record from the shipped one of its name.

    name       of the record; constants  how many it has
    moved      largest move of a constant, in units of its stated error [-]; relative  the largest relative move [-]
    intervals  largest move of an end of an interval, in units of what Monte Carlo error allows [-]; 0 without chains
    problem    empty where the record is reproduced, else what differs
    """

    name: str
    constants: int
    moved: float
    relative: float
    intervals: float
    problem: str

    @property
    def is_reproduced(self) -> bool:
        return not self.problem


def reproduction(path: Path, name: str) -> Reproduction | None:
    """Compare the record at `path` with the shipped one called `name`, for example "hazard" or "stacks/skin".

    None where none is shipped, or where the shipped one is of other photons, seeds or layers.
    """
    shipped = fits_folder() / f"{name}.json"
    if not shipped.exists() or shipped.resolve() == path.resolve():
        return None
    one, other = record.read(shipped), record.read(path)
    before, after = ((each.get("truth") or {}).get("photons") for each in (one, other))
    if any(one.get(key) != other.get(key) for key in SAME) or before != after:
        return None
    return compared(name, one, other, _chains(shipped, one), _chains(path, other))


def compared(name: str, shipped: Content, other: Content, chains: Content, others: Content) -> Reproduction:
    """Compare two records' contents; `chains` and `again` hold the draws of each kind of posterior, (k, p)."""
    if "constants" not in shipped:
        return _of_readings(name, shipped, other)
    constants = shipped["constants"]
    moved, relative, worst, problems = 0.0, 0.0, "", []
    if missing := constants.keys() ^ other["constants"].keys():
        problems.append(f"{min(missing)} is in one record only")
    for key in constants.keys() & other["constants"].keys():
        before, after = constants[key]["regenerated"], other["constants"][key]["regenerated"]
        error, by = stated_error(constants[key]), abs(after - before)
        relative = max(relative, by / (abs(before) or 1.0))
        if not error and by > EQUAL * abs(before):
            problems.append(f"{key} was not fitted and is {after:.12g} in place of {before:.12g}")
        elif error and by / error > moved:
            moved, worst = by / error, key
    if moved > MOST_MOVED:
        problems.append(f"{worst} moved by {moved:.2g} of its stated error")
    if shipped["fit"]["result"] != other["fit"]["result"]:
        problems.append(f"the fit {other['fit']['result']!r} in place of {shipped['fit']['result']!r}")
    if lost := sorted(chains.keys() ^ others.keys()):
        problems.append(f"the chain of {lost[0]} is in one record only")
    intervals, end = max(_moves(shipped, other, chains, others), default=(0.0, ""))
    if intervals > 1.0:
        problems.append(f"the interval of {end} moved by {intervals:.2g} of what its chain allows")
    return Reproduction(name, len(constants), moved, relative, intervals, "; ".join(problems))


def stated_error(constant: Content) -> float:
    """Return a constant's error by its record: that of the model where there is one, else the largest of the others.

    0 of one that was not fitted.
    """
    if model := constant.get("model_error"):
        return float(model)
    return max((float(constant.get(name) or 0.0) for name in record.ERRORS), default=0.0)


def _of_readings(name: str, shipped: Content, made: Content) -> Reproduction:
    """Compare the constants of readings of a paper, which have no errors, and the verdicts.

    A reading whose fit has no optimum has no constants: its verdict alone counts.
    """
    pairs = list(zip(shipped["readings"], made["readings"], strict=True))
    moves = [
        abs(other["constants"][key] / value - 1.0) if value else abs(other["constants"][key])
        for one, other in pairs
        if other.get("result", record.CONVERGED) == record.CONVERGED
        for key, value in one["constants"].items()
    ]
    problems = [f"{one['equation']}: {other['verdict']}" for one, other in pairs if one["verdict"] != other["verdict"]]
    relative = max(moves, default=0.0)
    if relative > READING:
        problems.append(f"a constant moved by {relative:.2g} of its size, and has no stated error")
    return Reproduction(name, len(moves), 0.0, relative, 0.0, "; ".join(problems))


def _chains(path: Path, content: Content) -> dict[str, np.ndarray]:
    if not content.get("posterior"):
        return {}
    arrays = record.read_arrays(path)
    return {kind: np.asarray(arrays[f"samples_{kind}"], float) for kind in content["posterior"]}


def _moves(shipped: Content, made: Content, chains: Content, again: Content) -> Iterator[tuple[float, str]]:
    """Return the move of each end of each interval over what is allowed, and whose it is."""
    ends = 4 * sum(draws.shape[1] for draws in chains.values())
    most = float(norm.isf(0.5 * (1.0 - (1.0 - CHANCE) ** (1.0 / max(ends, 1)))))  # Sidak, over all ends of the record
    for kind in chains.keys() & again.keys():
        free = shipped.get("covariance", {}).get("names") or list(shipped["constants"])  # in the order of the draws
        for column, name in enumerate(free):
            levels = shipped["constants"][name]["intervals"][kind]
            for level, ends_before in levels.items():
                outside = 0.5 * (1.0 - float(level.rstrip("%")) / 100.0)
                for place, share in enumerate((outside, 1.0 - outside)):
                    by = abs(made["constants"][name]["intervals"][kind][level][place] - ends_before[place])
                    errors = [_quantile_error(one[kind][:, column], share) for one in (chains, again)]
                    yield (by / (most * math.hypot(*errors)) if by else 0.0), f"{name}, {kind}, {level}"


def _quantile_error(draws: np.ndarray, share: float) -> float:
    """Return the standard error of a quantile of independent draws (k,), from the order statistics about it.

    The binomial spread of a share of k draws is sqrt(share (1 - share) / k), and half the distance of the quantiles so
    far to either side is the error of the quantile.
    """
    spread = np.sqrt(share * (1.0 - share) / len(draws))
    low, high = np.quantile(draws, np.clip([share - spread, share + spread], 0.0, 1.0))
    return 0.5 * float(high - low)
