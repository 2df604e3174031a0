"""Means over rings about the spot, and their covariance by sectors: noise, speckle and unevenness alike.

A ring has few pixels near the centre, and where these lie in it is chance: its mean is that of the polynomial in the
square of the radius that fits its pixels, which is even over its area.

Each ring is divided into sectors. The scatter of what they differ from that by gives the covariance of the rings, which
are correlated where something is uneven over many of them; with fewer sectors than rings it is shrunk towards its
diagonal by as much as its correlations are noise (Schaefer and Strimmer, Stat. Appl. Genet. Mol. Biol. 4, 2005). Near
the centre a grain of speckle is wider than a sector, and sectors that share it do not scatter: there a ring's relative
variance is at least that of the next ones, by area.
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
GRAIN, NEXT = 8.0, 5  # pixels, of a sector that no grain fills; rings with such sectors that tell of the narrower
SEEN = 5.0  # standard errors of noise in the middle, from which there is a spot
DEGREE = 4  # in the square of the radius, of the light within a ring
POWERS = np.arange(DEGREE + 1)
EVEN = np.where(POWERS % 2 == 0, 1.0 / (POWERS + 1.0), 0.0)  # means of the powers over -1 ... 1


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

    @property
    def shows_spot(self) -> bool:
        """Whether the middle is brighter than the outer half of the rings, by more than their noise explains."""
        if self.value.size < 2:
            return False
        areas, far = np.pi * (self.outer - self.inner) * (self.outer + self.inner), slice(self.value.size // 2, None)
        noise = np.median((np.diag(self.covariance) * areas)[far])
        return bool(self.value[0] - np.median(self.value[far]) > SEEN * np.sqrt(noise / areas[0]))

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
    kept = []
    powers, products = np.zeros((2 * DEGREE + 1, count)), np.zeros((DEGREE + 1, count))
    squares = edges**2
    for one in pictures:
        x, y, light = places(one, plate, centre)
        ring = np.digitize(np.hypot(x, y), edges) - 1
        good = (ring >= 0) & (ring < count) & np.isfinite(light)
        x, y, light, ring = x[good], y[good], light[good], ring[good]
        across = 2.0 * (x * x + y * y - squares[ring]) / np.diff(squares)[ring] - 1.0
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2.0 * np.pi))).astype(int) % SECTORS
        kept.append((ring, across, ring * SECTORS + sector, light))
        for power in range(2 * DEGREE + 1):
            powers[power] += np.bincount(ring, across**power, count)
        for power in range(DEGREE + 1):
            products[power] += np.bincount(ring, light * across**power, count)
    polynomials = _polynomials(powers, products)
    sums = np.zeros((2, cells))
    for ring, across, cell, light in kept:
        off = light - np.sum(polynomials[:, ring] * across ** POWERS[:, None], axis=0)
        sums += np.bincount(cell, minlength=cells), np.bincount(cell, off, cells)
    many, total = sums.reshape(2, count, SECTORS)
    whole = np.all(many > 0, axis=1)
    off = total[whole] / many[whole]
    value = (EVEN @ polynomials)[whole]
    inner, outer = edges[:-1][whole], edges[1:][whole]
    covariance = shrunk(off - off.mean(axis=1)[:, None])
    widening = _of_grains(np.diag(covariance), value, inner, outer, GRAIN * plate.pixel(centre))
    return SpotRings(inner, outer, value, covariance * np.outer(widening, widening))


def _of_grains(variance: Floats, value: Floats, inner: Floats, outer: Floats, grain: float) -> Floats:
    """Factor (n,) on the errors of rings whose sectors are narrower than `grain`, from their variances (n,)."""
    areas, narrow = np.pi * (outer - inner) * (outer + inner), np.pi * (inner + outer) < SECTORS * grain
    tells = ~narrow & (value > 0)
    if not np.any(tells):
        return np.ones(areas.size)
    by_area = float(np.median((variance[tells] * areas[tells] / value[tells] ** 2)[:NEXT]))
    least = by_area * value**2 / areas
    return np.where(narrow & (least > variance), np.sqrt(least / np.maximum(variance, np.finfo(float).tiny)), 1.0)


def _polynomials(powers: Floats, products: Floats) -> Floats:
    """Of each ring, by least squares (DEGREE + 1, n), lowest power first; from sums over its pixels."""
    at = np.add.outer(POWERS, POWERS)
    found: Floats = np.einsum("nij,jn->in", np.linalg.pinv(np.moveaxis(powers[at], 2, 0)), products)
    return found


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
