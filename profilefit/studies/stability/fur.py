"""Where fur in layers may fail: shadows of shells, hits of swept slabs, and a cone's shadow in float32."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.fur.law import shadow, shell_shadow
from profilefit.scenes.fur.source import strand_text
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import trial
from profilefit.studies.stability.causes_of_fur import (
    ANGLE,
    ASIDE,
    COVER,
    HITS,
    LAYERS,
    LIMITS,
    ROOT,
    SHADOW,
    SHELLS,
    SLABS,
    SLENDER,
    UNION,
    WAY,
    filled,
    moved,
)
from profilefit.studies.stability.cells import NAME, Cells, RoundedText, absolute, judged_cells, relative
from profilefit.studies.stability.layout import FLOAT32, FLOAT64, TEXT32, ArgumentAxis

Floats = NDArray[np.float64]
DEGREES = (0.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
OF_SHELLS, OF_SLABS = (8, 16, 32, 64, 128, 256, 512), (4, 8, 16, 32, 64, 128)  # layers
OURS = 1  # of `SHELLS`, the first; the others were published
OFF = 0.1  # of a cone's shadow
RMS = 0.05  # of hits, over the length
RAYS, STRANDS, WIDER, SEED = 2000, 500, 1.2, 3  # of a patch: strands at least, and over a ray's way
# d / r0 to 89.9 degrees at L / r0 = 100, and next to where the tip leaves the root's disc.
ASIDES = (
    *(1e-3, 0.5, 1.0 - 1e-3, 1.0 - 2.0**-24, 1.0, 1.0 + 2.0**-23, 1.0 + 2.0**-20, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3),
    *(1.01, 1.05, 1.2, 2.0, 10.0, 100.0, 1e4, 1e2 * float(np.tan(np.radians(89.9)))),
)
ROOTS = (1e-3, 0.5, 1e3)  # any unit
DIGITS = 1e-6  # relative: a few roundings in float32


def cells_of() -> Iterator[Cells]:
    """Shells and slabs over angle and layers, a cone's shadow over where its tip is seen."""
    yield from of_shells()
    yield of_slabs()
    yield from of_shadow()


def of_shells() -> Iterator[Cells]:
    """What a strand's discs hide over what its cone does: of the fitted exponent, and of those that were published."""
    for own, rows in ((True, slice(0, OURS)), (False, slice(OURS, None))):
        ways = SHELLS[rows]
        value = np.array(
            [
                [
                    [shell_shadow(n, way.exponent_of(n, SLENDER), 1.0, SLENDER, turn) for n in OF_SHELLS]
                    for turn in turns()
                ]
                for way in ways
            ]
        )
        axes = _axes(np.arange(len(SHELLS))[rows], tuple(way.name for way in ways), OF_SHELLS)
        inside = np.array([filled(way, np.array(DEGREES)[:, None], np.array(OF_SHELLS)) for way in ways])
        right = np.ones_like(value)
        name = "shells" if own else "shells, as published"
        yield judged_cells(name, own, UNION, FLOAT64, axes, value, right, relative(value, right), OFF, inside)


def of_slabs() -> Cells:
    """Error of the heights of first hits on one patch an angle, by slabs that test one strand and two."""
    value = np.empty((len(SLABS), len(DEGREES), len(OF_SLABS)))
    for i, turn in enumerate(turns()):
        side = max(WIDER * SLENDER * np.tan(turn), float(np.sqrt(STRANDS / COVER)))
        rays = trial(random_patch(COVER, 1.0, SLENDER, side, SEED), turn, RAYS, SEED)
        value[:, i] = [[rays.error(way, n) for n in OF_SLABS] for way in SLABS]
    axes = _axes(np.arange(len(SLABS)), tuple(way.name for way in SLABS), OF_SLABS)
    limits = np.array([LIMITS[way] for way in SLABS])[:, None, None]
    inside = moved(np.array(DEGREES)[:, None], np.array(OF_SLABS)) < limits
    right = np.zeros_like(value)
    return judged_cells("slabs", True, HITS, FLOAT64, axes, value, right, absolute(value, right), RMS, inside)


def of_shadow() -> Iterator[Cells]:
    """A cone's shadow in float32: its text, and the formula as textbooks have it."""
    text = RoundedText(strand_text("python", NAME), np.float32)
    yield _shadow("cone's shadow", True, TEXT32, lambda *given: text.call("shadow", *given))
    yield _shadow("cone's shadow, by acos", False, FLOAT32, by_acos)


def by_acos(radius: Floats, aside: Floats) -> Floats:
    """r0^2 (pi - acos(r0 / d)) + r0 sqrt(d^2 - r0^2), d > r0; pi r0^2 of less."""
    one = radius.dtype.type
    with np.errstate(all="ignore"):
        beyond = radius**2 * (one(np.pi) - np.arccos(radius / aside)) + radius * np.sqrt(aside**2 - radius**2)
    return np.where(aside <= radius, one(np.pi) * radius**2, beyond)


def turns() -> list[float]:
    """Angles to the normal [rad]."""
    return [float(one) for one in np.radians(DEGREES)]


def _shadow(name: str, own: bool, arithmetic: str, function: Callable[..., Floats]) -> Cells:
    axes = ArgumentAxis(ASIDE, "-", np.array(ASIDES)), ArgumentAxis(ROOT, "length", np.array(ROOTS))
    aside, radius = np.meshgrid(ASIDES, ROOTS, indexing="ij")
    root = radius.astype(np.float32)
    away = (aside * root.astype(float)).astype(np.float32)
    value = np.asarray(function(root, away), float)
    # A tip that leans by the length is seen that far aside from above, to the last digit.
    right = np.asarray(shadow(root.astype(float), away.astype(float), 0.0, (1.0, 0.0)))
    everywhere = np.ones(value.shape, bool)
    return judged_cells(name, own, SHADOW, arithmetic, axes, value, right, relative(value, right), DIGITS, everywhere)


def _axes(places: NDArray[np.intp], names: tuple[str, ...], layers: tuple[int, ...]) -> tuple[ArgumentAxis, ...]:
    return (
        ArgumentAxis(WAY, "-", places.astype(float), names),
        ArgumentAxis(ANGLE, "degrees", np.array(DEGREES)),
        ArgumentAxis(LAYERS, "-", np.array(layers, float)),
    )
