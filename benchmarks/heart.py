"""The balance of texture and screen: fitted to sixty random scenes, judged on sixty others.

    python -m benchmarks.heart            # twenty minutes on two cores
    python -m benchmarks.heart --count 6  # fewer scenes

Kernels are six Gaussians of heart and of skin. Errors are root mean squares of light against the sum over the whole
surface with the same kernel, white 1; ratios are scene by scene, their means geometric.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.table import show
from profilefit.recipes.stack.gaussians import alike
from profilefit.recipes.stack.record import request_of
from profilefit.scenes.heart import trials
from profilefit.scenes.heart.fit import GRID, Errors, errors, fitted
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.passes import kernel_of
from profilefit.shader import opened

STACKS, COUNT = ("heart", "skin"), 6
SEEDS = (11, 12)  # of the scenes that are fitted, and of those that judge


def kernels() -> list[Kernel]:
    """Of the stacks, in diffuse light."""
    found = []
    for name in STACKS:
        media = request_of(name).stack.media
        units = [medium.layers[0].similar.mfp for medium in media]
        found.append(kernel_of(alike(media, "diffuse", COUNT), units))
    return found


def rows(own: Errors, judged: Errors) -> list[tuple[str, ...]]:
    """What is fitted, and what it is worth."""
    best, refits = fitted(own)
    row, column = (int(np.argmin(np.abs(grid - one))) for grid, one in zip(GRID, best, strict=True))
    found = judged.balanced[:, row, column]
    ratio, searched = found / judged.better, judged.balanced.min(axis=(1, 2))
    low, high = np.quantile(refits, [0.16, 0.84], axis=0)

    def mean(values: np.ndarray) -> str:
        return f"{np.exp(np.log(values).mean()):.3f}"

    return [
        ("constant of the crossover", f"{best.constant:.2f}", f"{low[0]:.2f} to {high[0]:.2f}"),
        ("threshold of the share", f"{best.threshold:g}", f"{low[1]:g} to {high[1]:g}"),
        ("over the better of texture and screen: median", f"{np.median(ratio):.3f}", ""),
        ("90th percentile", f"{np.quantile(ratio, 0.9):.3f}", ""),
        ("worst", f"{ratio.max():.3f}", ""),
        ("mean", mean(ratio), ""),
        ("over the best balance of each scene: mean", mean(found / searched), ""),
        *((f"over {name}: mean", mean(found / of), "") for name, of in judged.ways.items()),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    count = parser.parse_args().count
    known = kernels()
    with opened() as context:
        own, judged = (
            errors([trials.measured(context, one) for one in trials.drawn(known, count, seed)]) for seed in SEEDS
        )
    columns = ("", "value", "1 sigma")
    show(f"{count} scenes are fitted, {count} others judge", columns, rows(own, judged))


if __name__ == "__main__":
    main()
