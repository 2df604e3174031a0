"""Test of the number of layers that `profilefit choose` states for fur: on other rays, and against fewer layers.

    python -m benchmarks.fur_choose                  # 50 random furs: nine minutes on a core
    python -m benchmarks.fur_choose --furs 5         # fewer of them

Each has its own density, slenderness, angle and tolerance; its way is the cheapest of `choose` there. What N layers are
wrong by, and the least number that is within the tolerance, are of fresh patches with several times as many rays.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.table import show
from mcml_sim.files.whole_file import as_json, write_whole
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import WAYS, FurTrial, LayerTechnique, error_of, trial
from profilefit.studies.choose.scenes import RandomFur, cheapest

FURS, SEED = 50, 2024
COVER, SLENDER, DEGREES, TOLERANCES = (0.02, 0.25), (8.0, 40.0), (0.0, 80.0), (0.02, 0.1)  # r0^2 n; L / r0
PATCHES, RAYS, OTHERS = 40, 4000, 500_000  # of a truth; where its seeds begin


class Fur(NamedTuple):
    """Fur drawn at random: lengths in r0.

    density  [1/r0^2];  length  [r0];  degrees  of the view to the normal;  tolerance  rms over the length
    """

    density: float
    length: float
    degrees: float
    tolerance: float


class Judged(NamedTuple):
    """Fur, its cheapest way and layers, and their error [-]; `least` layers that would do; None: no way does."""

    fur: Fur
    way: str | None
    layers: int | None
    error: float | None
    least: int | None

    @property
    def holds(self) -> bool:
        return self.error is not None and self.error <= self.fur.tolerance

    @property
    def ratio(self) -> float | None:
        """Ratio of the layers to the least [-]."""
        return self.layers / self.least if self.layers and self.least else None


def furs(count: int, seed: int = SEED) -> list[Fur]:
    """Draw furs, even in the logarithm of all but the angle."""
    u = np.random.default_rng(seed).random((count, 4))
    ends = np.array([COVER, SLENDER, TOLERANCES])
    logs = np.exp(np.log(ends[:, 0]) + u[:, :3] * np.log(ends[:, 1] / ends[:, 0]))
    degrees = DEGREES[0] + u[:, 3] * (DEGREES[1] - DEGREES[0])
    return [
        Fur(float(n), float(length), float(angle), float(tolerance))
        for (n, length, tolerance), angle in zip(logs, degrees, strict=True)
    ]


def judged(fur: Fur, seed: int) -> Judged:
    """Judge a fur by patches that were not used to choose."""
    theta = float(np.radians(fur.degrees))
    looked = RandomFur(fur.density, 1.0, fur.length, theta, seed)
    least = {way.name: looked.least_layers(way, fur.tolerance) for way in WAYS}
    way = cheapest(least)
    if way is None:
        return Judged(fur, None, None, None, None)
    trials = [
        trial(random_patch(fur.density, 1.0, fur.length, looked.side, OTHERS + one), theta, RAYS, OTHERS + one)
        for one in range(PATCHES)
    ]
    layers = least[way.name]
    assert layers is not None
    return Judged(fur, way.name, layers, error_of(trials, way, layers), _least(trials, way, layers, fur.tolerance))


def _least(trials: Sequence[FurTrial], way: LayerTechnique, layers: int, tolerance: float) -> int:
    """Return the least number within the tolerance and next to others that are, from one that nearly is."""
    while error_of(trials, way, layers) > tolerance:
        layers += 1
    while layers > 1 and error_of(trials, way, layers - 1) <= tolerance:
        layers -= 1
    return layers


def summary(found: Sequence[Judged]) -> dict[str, float]:
    """Return the share within the tolerance, of those that have a way; layers over the least."""
    chosen = [one for one in found if one.way is not None]
    ratios = [one.ratio for one in chosen if one.ratio is not None]
    return {
        "furs": len(found),
        "with a way": len(chosen),
        "within": float(np.mean([one.holds for one in chosen])),
        "median ratio": float(np.median(ratios)),
        "mean ratio": float(np.mean(ratios)),
    }


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--furs", type=int, default=FURS, metavar="COUNT", help=f"{FURS} if not said")
    parser.add_argument("--seed", type=int, default=SEED, help="of the furs: others")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same in numbers, too")
    given = parser.parse_args(arguments)
    found = [judged(fur, number) for number, fur in enumerate(furs(given.furs, given.seed))]
    columns = ("way", "r0^2 n", "L / r0", "degrees", "tolerance", "layers", "error", "least")
    show("Layers by choose, and their error and the least by fresh rays", columns, [_row(one) for one in found])
    told = summary(found)
    show("In all", tuple(told), [[f"{value:.3g}" for value in told.values()]])
    if given.json is not None:
        rows = [{**one.fur._asdict(), **{key: getattr(one, key) for key in RESULTS}} for one in found]
        write_whole(given.json, as_json({"furs": rows, "summary": told}))


RESULTS = ("way", "layers", "error", "least")


def _row(one: Judged) -> list[str]:
    fur = one.fur
    return [
        one.way or "none",
        *(f"{value:.3g}" for value in (fur.density, fur.length, fur.degrees)),
        f"{fur.tolerance:.4f}",
        *(("-", "-", "-") if one.error is None else (str(one.layers), f"{one.error:.4f}", str(one.least))),
    ]


if __name__ == "__main__":
    main()
