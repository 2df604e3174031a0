"""Patches of fur whose feet are not independent: apart, or in tufts."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import checked_whole, is_number, shown
from profilefit.errors import InputError
from profilefit.scenes.fur.truth import Patch, strand_count

MOST_PACKING = 0.6


def spaced_patch(density: float, radius: float, length: float, side: float, packing: float, seed: int = 0) -> Patch:
    """Return as many upright strands, none nearer to another one than d: packing n d^2 in [0, 0.6], 0.7 being jammed.

    Darts are thrown anywhere, one by one, and stay where all that stayed before are d away.
    """
    count, rng = strand_count(density, side), np.random.default_rng([seed, 2])
    if not (is_number(packing) and 0 <= packing <= MOST_PACKING):
        raise InputError(f"packing must be a number in [0, {MOST_PACKING:g}], got {shown(packing)}")
    apart = float(np.sqrt(packing / count)) * side
    feet = np.empty((0, 2))
    while len(feet) < count:
        thrown = rng.random((2 * (count - len(feet)) + 16, 2)) * side
        if len(feet):
            thrown = thrown[cKDTree(feet, boxsize=side).query(thrown)[0] >= apart]
        falls = np.zeros(len(thrown), bool)
        pairs = cKDTree(thrown, boxsize=side).query_pairs(apart, output_type="ndarray") if len(thrown) else []
        for first, later in sorted(map(tuple, pairs), key=lambda pair: (pair[1], pair[0])):
            falls[later] |= not falls[first]
        feet = np.concatenate([feet, thrown[~falls]])[:count]
    return Patch(feet, side, radius, length)


def tufted_patch(
    density: float, radius: float, length: float, side: float, each: int, spread: float, seed: int = 0
) -> Patch:
    """Return as many upright strands in tufts of so many each, within discs of radius `spread` that lie anywhere.

    Discs may overlap; tufts are as many as the density says on average, 1 at least.
    """
    many, tufts = checked_whole("each", each, 1), strand_count(density / max(each, 1), side)
    if not (is_number(spread) and 0 <= spread < np.inf):
        raise InputError(f"spread must be a finite length >= 0, got {shown(spread)}")
    rng = np.random.default_rng([seed, 3])
    turn, away = 2.0 * np.pi * rng.random((tufts, many)), spread * np.sqrt(rng.random((tufts, many)))
    middles = rng.random((tufts, 1, 2)) * side
    feet = middles + away[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return Patch(np.mod(feet.reshape(-1, 2), side), side, radius, length)
