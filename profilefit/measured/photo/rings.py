"""Means over rings about the spot, and their covariance by sectors: noise, speckle and unevenness alike.

Each ring is divided into sectors. The scatter of their means over the sectors gives the covariance of the rings, which
are correlated where something is uneven over many of them; with fewer sectors than rings it is shrunk towards its
diagonal by as much as its correlations are noise (Schaefer and Strimmer, Stat. Appl. Genet. Mol. Biol. 4, 2005).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.measured.photo.bracket import Picture
from profilefit.measured.photo.pixel_scale import PixelScale
from profilefit.measured.photo.spot import places

Floats = NDArray[np.float64]
SECTORS = 24
FACTOR = 1.12  # of the radii of neighbouring edges
FINEST = 3.0  # pixels, of a ring's width


@dataclass(frozen=True, eq=False)
class SpotRings:
    """Of inner and outer radii (n,) [unit], the light of each, and its covariance (n, n)."""

    inner: Floats
    outer: Floats
    value: Floats
    covariance: Floats

    @property
    def r(self) -> Floats:
        return 0.5 * (self.inner + self.outer)

    def within(self, low: float, high: float) -> SpotRings:
        """Those that lie wholly between two radii."""
        keep = (self.inner >= low) & (self.outer <= high)
        return SpotRings(self.inner[keep], self.outer[keep], self.value[keep], self.covariance[np.ix_(keep, keep)])


def edges_of(reach: float, pixel: float) -> Floats:
    """Radii from the centre to `reach`, at least FINEST pixels apart [unit]."""
    found = [0.0]
    while (following := max(found[-1] * FACTOR, found[-1] + FINEST * pixel)) < reach:
        found.append(following)
    return np.array(found)


def rings(pictures: Sequence[Picture], centre: tuple[float, float], edges: Floats, plate: PixelScale) -> SpotRings:
    """Of the planes of one colour, between edges [unit]."""
    count = edges.size - 1
    cells = count * SECTORS
    sums = np.zeros((2, cells))
    for one in pictures:
        x, y, light = places(one, plate, centre)
        ring = np.digitize(np.hypot(x, y), edges) - 1
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2.0 * np.pi))).astype(int) % SECTORS
        good = (ring >= 0) & (ring < count) & np.isfinite(light)
        cell = (ring * SECTORS + sector)[good]
        sums += np.bincount(cell, minlength=cells), np.bincount(cell, light[good], cells)
    many, total = sums.reshape(2, count, SECTORS)
    whole = np.all(many > 0, axis=1)
    mean = total[whole] / many[whole]
    value = mean.mean(axis=1)
    return SpotRings(edges[:-1][whole], edges[1:][whole], value, shrunk(mean - value[:, None]))


def shrunk(off: Floats) -> Floats:
    """Covariance (n, n) of means over sectors from their deviations (n, sectors)."""
    sectors = off.shape[1]
    variance = np.sum(off**2, axis=1) / (sectors - 1)
    scaled = off / np.sqrt(np.maximum(variance, np.finfo(float).tiny))[:, None]
    products = scaled[:, None] * scaled[None]
    correlation = products.sum(axis=2) / (sectors - 1)
    noise = np.sum((products - products.mean(axis=2, keepdims=True)) ** 2, axis=2) * sectors / (sectors - 1) ** 3
    apart = ~np.eye(len(off), dtype=bool)
    share = float(np.clip(noise[apart].sum() / max(np.sum(correlation[apart] ** 2), 1e-12), 0.05, 1.0))
    kept = np.where(apart, (1.0 - share) * correlation, 1.0)
    size = np.sqrt(variance / sectors)
    found: Floats = kept * np.outer(size, size)
    return found
