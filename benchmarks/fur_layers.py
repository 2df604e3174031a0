"""Layers of fur against its truths: linear shells per quadratic one, every way over N, and the swept slabs' law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.fur.chart import patch_view
from profilefit.scenes.fur.law import MOST_LAYERS, shell_shadow
from profilefit.scenes.fur.passes import FurSurface
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, cast, random_patch, rays
from profilefit.scenes.fur.ways import LINEAR as SHELLS
from profilefit.scenes.fur.ways import MOST, SWEPT, SWEPT_TWO, WAYS, FurTrial, error_of, least_layers, trial
from profilefit.scenes.stage.renderer import Renderer
from profilefit.shader import opened
from profilefit.studies.tradeoff.scenes import DEGREES, DENSITY, RADIUS

Floats = NDArray[np.float64]
Rows = list[tuple[str | float, ...]]
THICK, SLENDER = (0.2, 0.4, 0.6), (10.0, 20.0, 40.0)  # r0 sqrt(n), L / r0
ASLANT = tuple(np.arange(30.0, 76.0, 7.5).tolist())
QUADRATIC = (8, 16, 32)
LINEAR = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181)
SLABS = tuple(n for n in LINEAR if n <= 64)
RAYS, STRANDS = 1500, 400
FLATTENED = 0.05  # twice the layers take no more off the error: the floor
DRAWS = 2000
TOLERANCE, LEAST_AT = 0.02, (30.0, 45.0, 60.0)
PATCHES, OF_WAYS = 4, 2500
LAYERS = (8, 12, 16, 24, 32, 48, 96)
COSTS, COST_LAYERS, TURNS = (SHELLS, SWEPT, SWEPT_TWO), (32, 128), 9
WITHIN = (0.01, 0.1)  # rms for which swept slabs' law is fitted


class Cell(NamedTuple):
    """Fur toward one angle, strands of length 1: r0 sqrt(n), L / r0 and the angle; errors are rms of heights.

    linear        to the cone, of LINEAR shells: it is their own limit
    cone, own     of quadratic shells and twice as many, to the cone and to their own limit: by N
    contrast      standard deviation of the heights of the cone, and of that limit
    swept         of SLABS with one and with two strands tested
    """

    thick: float
    slender: float
    degrees: float
    linear: Floats
    cone: dict[int, float]
    own: dict[int, float]
    contrast: tuple[float, float]
    swept: tuple[Floats, Floats]


def rms(found: Floats, true: Floats) -> float:
    return float(np.sqrt(np.mean((found - true) ** 2)))


@cache
def cells() -> list[Cell]:
    found = []
    for number, thick in enumerate(THICK):
        for slender in SLENDER:
            for degrees in ASLANT:
                theta, density = float(np.radians(degrees)), (thick * slender) ** 2
                side = max(1.3 * float(np.tan(theta)), (STRANDS / density) ** 0.5)
                patch = random_patch(density, 1.0 / slender, 1.0, side, number)
                found.append(_cell(patch, degrees, thick, rays(patch, RAYS, number)))
    return found


def _cell(patch: Patch, degrees: float, thick: float, start: Floats) -> Cell:
    theta, slender = float(np.radians(degrees)), 1.0 / patch.radius
    true = cast(patch, theta, start)
    many = min(int(24.0 * slender * np.tan(theta)) + 64, MOST_LAYERS)  # discs a twenty-fourth of a root apart
    limit = by_shells(patch, theta, start, many, 2.0)
    drawn = {n: by_shells(patch, theta, start, n, 2.0) for n in (*QUADRATIC, 2 * QUADRATIC[-1])}
    one, two = (np.array([rms(by_slabs(patch, theta, start, n, k), true) for n in SLABS]) for k in (1, 2))
    return Cell(
        thick,
        slender,
        degrees,
        np.array([rms(by_shells(patch, theta, start, n, 1.0), true) for n in LINEAR]),
        {n: rms(each, true) for n, each in drawn.items()},
        {n: rms(each, limit) for n, each in drawn.items()},
        (float(true.std()), float(limit.std())),
        (one, two),
    )


def layers_for(error: float, errors: Floats) -> float:
    """Return how many LINEAR shells have this error: a straight line between logarithms; nan beyond them."""
    falling = np.log(np.minimum.accumulate(errors))
    return float(np.exp(np.interp(-np.log(error), -falling, np.log(LINEAR), np.nan, np.nan)))


def third() -> Rows:
    """Return the linear shells per quadratic one at equal error, by the truth that both are held against."""
    found: Rows = []
    furs = cells()
    for n in (*QUADRATIC, 0):
        found.append(_factors("heights, to the cone", n, lambda c, n: layers_for(c.cone[n], c.linear), furs))
    found.append(_factors("the same, above its floor", 0, _above, furs))
    for n in (*QUADRATIC, 0):
        found.append(_factors("heights, each to its own", n, lambda c, n: layers_for(c.own[n], c.linear), furs))
    for n in (*QUADRATIC, 0):
        found.append(
            _factors(
                "the same over its own contrast",
                n,
                lambda c, n: layers_for(c.own[n] / c.contrast[1], c.linear / c.contrast[0]),
                furs,
            )
        )
    for n in (*QUADRATIC, 0):
        found.append(_factors("coverage, each to its own", n, _covered, [c for c in furs if c.thick == THICK[0]]))
    return found


def _above(cell: Cell, layers: int) -> float:
    return np.nan if _flat(cell, layers) else layers_for(cell.cone[layers], cell.linear)


def _flat(cell: Cell, layers: int) -> bool:
    return cell.cone[2 * layers] > (1.0 - FLATTENED) * cell.cone[layers]


def _covered(cell: Cell, layers: int) -> float:
    theta, radius = float(np.radians(cell.degrees)), 1.0 / cell.slender
    limit = shell_shadow(MOST_LAYERS, 2.0, radius, 1.0, theta)
    linear = np.array([1.0 - shell_shadow(n, 1.0, radius, 1.0, theta) for n in LINEAR])
    return layers_for(1.0 - shell_shadow(layers, 2.0, radius, 1.0, theta) / limit, linear)


def _factors(
    name: str, layers: int, linear: Callable[[Cell, int], float], furs: Sequence[Cell]
) -> tuple[str | float, ...]:
    """Return the geometric mean, 95 % of it by bootstrap, 5 % and 95 % of single ones, and the odd ones."""
    numbers = (layers,) if layers else QUADRATIC
    each = np.array([[linear(cell, n) / n for n in numbers] for cell in furs])
    logs = np.log(each)
    drawn = np.random.default_rng(0).integers(0, len(furs), (DRAWS, len(furs)))
    low, high = np.exp(np.percentile(np.nanmean(logs[drawn], axis=(1, 2)), [2.5, 97.5]))
    mean = float(np.exp(np.nanmean(logs)))
    flat = float(np.mean([_flat(cell, n) for cell in furs for n in numbers])) if name.endswith("cone") else ""
    return (
        name,
        str(layers or "all"),
        int(np.isfinite(each).sum()),
        mean,
        float(low),
        float(high),
        0.5 * float(high - low) / mean,
        *np.nanpercentile(each, [5.0, 95.0]).tolist(),
        flat,
        float(np.nanmean(each < 1.0)) if np.all(np.isfinite(each)) else float(np.mean(each[np.isfinite(each)] < 1.0)),
        float(np.mean(~np.isfinite(each))),
    )


@cache
def trials(degrees: float) -> tuple[FurTrial, ...]:
    theta = float(np.radians(degrees))
    side = max(4.0, 1.3 * float(np.tan(theta)))
    patches = (random_patch(DENSITY, RADIUS, 1.0, side, seed) for seed in range(PATCHES))
    return tuple(trial(patch, theta, OF_WAYS, seed) for seed, patch in enumerate(patches))


def ways() -> Rows:
    """Return the root mean square error of heights over N, and the standard error over patches at 16 layers."""
    found: Rows = []
    for way in WAYS:
        for degrees in DEGREES:
            own = [error_of(trials(degrees), way, n) for n in LAYERS]
            at = [one.error(way, 16) for one in trials(degrees)]
            found.append((way.name, degrees, *own, float(np.std(at, ddof=1)) / PATCHES**0.5))
    return found


def least() -> Rows:
    """Return the fewest layers of each way, by angle."""
    found: Rows = []
    for way in WAYS:
        each = [least_layers(partial(error_of, trials(degrees), way), TOLERANCE) for degrees in LEAST_AT]
        found.append((way.name, *(f"> {MOST}" if n is None else n for n in each)))
    return found


def swept() -> Rows:
    """Fit ln rms = ln c + a ln y + b ln(r0 sqrt(n)), and with L tan / r0, too: constants, errors, residuals."""
    found: Rows = []
    for tested in (1, 2):
        table, of = _swept_points(tested)
        for name, columns in (("y", [1]), ("y, r0 sqrt(n)", [1, 2]), ("y, r0 sqrt(n), L tan / r0", [1, 2, 3])):
            made = np.column_stack([np.ones(len(table)), np.log(table[:, columns])])
            logs = np.log(table[:, 0])
            best = np.linalg.lstsq(made, logs, rcond=None)[0]
            left = logs - made @ best
            errors = _errors(made, logs, of)
            best[0], errors[0] = np.exp(best[0]), np.exp(best[0]) * errors[0]
            pairs: list[str | float] = []
            for i in range(4):
                pairs += [float(best[i]), float(errors[i])] if i < len(best) else ["", ""]
            scatter = float(np.sqrt(left @ left / (len(left) - len(best))))
            worst, y = float(np.max(np.abs(left))), table[:, 1]
            found.append((name, tested, *pairs, scatter, worst, len(y), float(y.min()), float(y.max())))
    return found


def _swept_points(tested: int) -> tuple[Floats, NDArray[np.intp]]:
    """Return rows rms, y, r0 sqrt(n), L tan / r0, of those within WITHIN, and the cell of each."""
    rows, of = [], []
    for number, cell in enumerate(cells()):
        aside = float(np.tan(np.radians(cell.degrees))) * cell.slender
        for n, error in zip(SLABS, cell.swept[tested - 1], strict=True):
            if WITHIN[0] <= error <= WITHIN[1]:
                rows.append((float(error), aside * cell.thick / n, cell.thick, aside))
                of.append(number)
    return np.array(rows), np.array(of)


def _errors(made: Floats, logs: Floats, of: NDArray[np.intp]) -> Floats:
    """Return the standard deviations of a line's constants by furs and angles drawn anew."""
    own, rng, found = [np.flatnonzero(of == number) for number in np.unique(of)], np.random.default_rng(0), []
    for _ in range(DRAWS // 4):
        rows = np.concatenate([own[i] for i in rng.integers(0, len(own), len(own))])
        found.append(np.linalg.lstsq(made[rows], logs[rows], rcond=None)[0])
    return np.std(found, axis=0, ddof=1)


def cost() -> Rows:
    """Return the time of a layer over a shell's, where a ray meets next to nothing; by OpenGL, ends over turns."""
    patch, (few, many), size = random_patch(1.0, 0.01, 1.0, 6.0), COST_LAYERS, (256, 256)
    (view, _), surface = patch_view(patch, 0.25 * np.pi, size), FurSurface.of_patch(patch)
    taken: dict[str, list[float]] = {way.name: [] for way in COSTS}
    with opened() as context, Renderer(context, size) as renderer:
        for turn in range(-1, TURNS):  # the first is compiled, and not counted
            for way in COSTS:
                each = [surface.layered(view, way, layers) for layers in (few, many)]
                times = [renderer.time(one) for one in each]
                if turn >= 0:
                    taken[way.name].append((times[1] - times[0]) / (many - few))
    shell = np.array(taken[COSTS[0].name])
    found: Rows = []
    for way in COSTS:
        ratio = np.array(taken[way.name]) / shell
        found.append((way.name, float(np.median(ratio)), *np.percentile(ratio, [16.0, 84.0]).tolist()))
    return found
