"""Layers of fur: shadows of shells, hits of swept slabs, and the shadow of a cone in float32."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.fur.law import shadow, shell_shadow, strand_text
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, LayerTechnique, trial
from profilefit.studies.stability.cells import NAME, Cells, RoundedText, judged_cells, relative
from profilefit.studies.stability.layout import FLOAT32, FLOAT64, TEXT32, ArgumentAxis

Floats = NDArray[np.float64]
UNION, HITS, SHADOW = "shadow over the cone's", "rms of hits over L", "shadow of a cone"  # quantities
SHELLS: tuple[LayerTechnique, ...] = (FITTED, LINEAR, QUADRATIC)  # the first is ours; the others were published
SLABS: tuple[LayerTechnique, ...] = (SWEPT, SWEPT_TWO)
SLENDER, COVER = 20.0, 0.16  # L / r0, r0^2 n of what is looked at
# Fitted shells are promised from so many layers on, times L / r0 and times L tan(theta) / r0: fewer need an exponent
# that is far from the cone's, or leave gaps.
FULL, FILLED = 2.5, 1.5
# Swept slabs are promised below so much of y = (L tan(theta) / N) sqrt(n), the path of a ray in a slab over the
# strands' mean distance: in fur of r0^2 n from 0.04 to 0.25.
LIMITS = {SWEPT: 0.65, SWEPT_TWO: 1.2}
OF_SHELLS = (
    f"use swept slabs; or p = 1 from {FILLED:g} L tan(theta) / r0 layers on, the fitted p from {FULL:g} L / r0 as well"
)
OF_SLABS = (
    f"use L tan(theta) sqrt(n) / {LIMITS[SWEPT]:g} slabs, over {LIMITS[SWEPT_TWO]:g} where they test two strands, so "
    "that no ray meets a second strand within a slab"
)
OF_SHADOW = (
    "use r0^2 (pi + u - atan u) of profilefit.scenes.fur.law.shadow or profilefit export fur, which keeps digits"
)
DEGREES = (0.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
LAYERS_OF_SHELLS, LAYERS_OF_SLABS = (8, 16, 32, 64, 128, 256, 512), (4, 8, 16, 32, 64, 128)
SHADOW_BOUND = 0.1  # relative, of what a strand's discs hide
HIT_BOUND = 0.05  # root mean square of hits, over the length
RAYS, STRANDS, WIDER, SEED = 2000, 500, 1.2, 3  # of a patch: strands at least, and over a ray's way
# d / r0 to 89.9 degrees at L / r0 = 100, and next to where the tip leaves the root's disc.
ASIDES = (
    *(1e-3, 0.5, 1.0 - 1e-3, 1.0 - 2.0**-24, 1.0, 1.0 + 2.0**-23, 1.0 + 2.0**-20, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3),
    *(1.01, 1.05, 1.2, 2.0, 10.0, 100.0, 1e4, 1e2 * float(np.tan(np.radians(89.9)))),
)
ROOTS = (1e-3, 0.5, 1e3)  # any unit
DIGITS = 1e-6  # relative: a few roundings in float32


def cells_of() -> Iterator[Cells]:
    """Yield shells and slabs over angle and layers, and a cone's shadow over where its tip is seen."""
    yield from of_shells()
    yield of_slabs()
    yield from of_shadow()


def filled(way: LayerTechnique, degrees: Floats, layers: Floats) -> NDArray[np.bool_]:
    """Return where shells are promised to hide what a cone does."""
    tangent = np.tan(np.radians(degrees))
    return np.asarray((way == FITTED) & (layers >= SLENDER * np.maximum(FULL, FILLED * tangent)))


def of_shells() -> Iterator[Cells]:
    """Yield what a strand's discs hide over what its cone does: of the fitted exponent, and of the published ones."""
    for name, own, ways in (("shells", True, SHELLS[:1]), ("shells, as published", False, SHELLS[1:])):
        value = np.array(
            [
                [
                    [shell_shadow(n, way.exponent_of(n, SLENDER), 1.0, SLENDER, turn) for n in LAYERS_OF_SHELLS]
                    for turn in np.radians(DEGREES).tolist()
                ]
                for way in ways
            ]
        )
        inside = np.array([filled(way, np.array(DEGREES)[:, None], np.array(LAYERS_OF_SHELLS)) for way in ways])
        axes = _axes(ways, LAYERS_OF_SHELLS)
        error = relative(value, np.ones_like(value))
        yield judged_cells(
            name, own, UNION, FLOAT64, axes, value, np.ones(()), error, SHADOW_BOUND, inside, advice=OF_SHELLS
        )


def of_slabs() -> Cells:
    """Return the error of first hits' heights on one patch an angle, by slabs that test one strand and two."""
    value = np.empty((len(SLABS), len(DEGREES), len(LAYERS_OF_SLABS)))
    for i, turn in enumerate(np.radians(DEGREES).tolist()):
        side = max(WIDER * SLENDER * np.tan(turn), float(np.sqrt(STRANDS / COVER)))
        rays = trial(random_patch(COVER, 1.0, SLENDER, side, SEED), turn, RAYS, SEED)
        value[:, i] = [[rays.error(way, n) for n in LAYERS_OF_SLABS] for way in SLABS]
    moved = SLENDER * np.tan(np.radians(DEGREES))[:, None] / np.array(LAYERS_OF_SLABS) * COVER**0.5  # y
    inside = moved < np.array([LIMITS[way] for way in SLABS])[:, None, None]
    axes = _axes(SLABS, LAYERS_OF_SLABS)
    return judged_cells(
        "slabs", True, HITS, FLOAT64, axes, value, np.zeros(()), value, HIT_BOUND, inside, advice=OF_SLABS
    )


def of_shadow() -> Iterator[Cells]:
    """Yield a cone's shadow in float32: by its shader source, and by the formula as textbooks have it."""
    text = RoundedText(strand_text("python", NAME), np.float32)
    yield _shadow("cone's shadow", True, TEXT32, lambda *given: text.call("shadow", *given))
    yield _shadow("cone's shadow, by acos", False, FLOAT32, by_acos)


def by_acos(radius: Floats, aside: Floats) -> Floats:
    """Return r0^2 (pi - acos(r0 / d)) + r0 sqrt(d^2 - r0^2) where d > r0, else pi r0^2."""
    one = radius.dtype.type
    with np.errstate(all="ignore"):
        beyond = radius**2 * (one(np.pi) - np.arccos(radius / aside)) + radius * np.sqrt(aside**2 - radius**2)
    return np.where(aside <= radius, one(np.pi) * radius**2, beyond)


def _shadow(name: str, own: bool, arithmetic: str, function: Callable[..., Floats]) -> Cells:
    axes = ArgumentAxis("d/r0", "-", np.array(ASIDES)), ArgumentAxis("r0", "length", np.array(ROOTS))
    aside, radius = np.meshgrid(ASIDES, ROOTS, indexing="ij")
    root = radius.astype(np.float32)
    away = (aside * root.astype(float)).astype(np.float32)
    value = np.asarray(function(root, away), float)
    # A tip that leans by the length is seen that far aside from above, to the last digit.
    exactly = np.asarray(shadow(root.astype(float), away.astype(float), 0.0, (1.0, 0.0)))
    error = relative(value, exactly)
    return judged_cells(name, own, SHADOW, arithmetic, axes, value, exactly, error, DIGITS, advice=OF_SHADOW)


def _axes(ways: Sequence[LayerTechnique], layers: tuple[int, ...]) -> tuple[ArgumentAxis, ...]:
    return (
        ArgumentAxis("way", "-", np.arange(len(ways), dtype=float), tuple(way.name for way in ways)),
        ArgumentAxis("θ", "degrees", np.array(DEGREES)),
        ArgumentAxis("N", "-", np.array(layers, float)),
    )
