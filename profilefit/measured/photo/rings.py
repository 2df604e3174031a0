"""Means over rings about the spot, and their covariance by sectors: noise, speckle and unevenness alike.

A ring has few pixels near the centre, and where these lie in it is chance. Its mean is that of its pixels, and it keeps
the distances at which these lie, over which the fit averages its light.

Each ring is divided into sectors, whose deviations from a polynomial in the square of the radius give the covariance of
the rings. Rings are correlated where something is uneven over many of them; with fewer sectors than rings the
covariance is shrunk towards its diagonal by as much as its correlations are noise (Schaefer and Strimmer, Stat. Appl.
Genet. Mol. Biol. 4, 2005). Near the centre a grain of speckle is wider than a sector, and sectors that share it do not
scatter, or a sector has no pixel. There a ring's variance is at least that of as many pixels, as bright, of next rings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.measured.instrument import RING
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
PARTS = 32  # of a ring, of equal area, that each count at one distance


@dataclass(frozen=True, eq=False)
class SpotRings:
    """Rings of inner and outer radii (n,) [unit], the light of each, and its covariance (n, n).

    pixels  distances (n, m) of a ring's pixels from the centre, and the share of the pixels at each; None: even by area
    """

    inner: Floats
    outer: Floats
    value: Floats
    covariance: Floats
    pixels: tuple[Floats, Floats] | None = None

    @property
    def gathered(self) -> tuple[Floats, Floats]:
        """Distances (n, m) whose light each ring averages, and how much each counts."""
        if self.pixels is not None:
            return self.pixels
        d, share = over_rings(self.inner, self.outer)
        return d, np.broadcast_to(share, d.shape)

    @property
    def r(self) -> Floats:
        return 0.5 * (self.inner + self.outer)

    @property
    def shows_spot(self) -> bool:
        """True if the middle is brighter than the outer half of the rings, by more than their noise explains."""
        if self.value.size < 2:
            return False
        areas, far = np.pi * (self.outer - self.inner) * (self.outer + self.inner), slice(self.value.size // 2, None)
        noise = np.median((np.diag(self.covariance) * areas)[far])
        return bool(self.value[0] - np.median(self.value[far]) > SEEN * np.sqrt(noise / areas[0]))


def edges_of(reach: float, pixel: float) -> Floats:
    """Radii from the centre to `reach`, at least FINEST pixels apart [unit]."""
    edges = [0.0]
    while (following := max(edges[-1] * FACTOR, edges[-1] + FINEST * pixel)) < reach:
        edges.append(following)
    return np.array(edges)


def rings(pictures: Sequence[Picture], centre: tuple[float, float], edges: Floats, plate: PixelScale) -> SpotRings:
    """Return rings of the planes of one colour, between edges [unit]."""
    count = edges.size - 1
    cells, parts = count * SECTORS, count * PARTS
    kept = []
    powers, products = np.zeros((2 * DEGREE + 1, count)), np.zeros((DEGREE + 1, count))
    places_of, light_of = np.zeros((2, parts)), np.zeros((2, count))
    squares = edges**2
    for one in pictures:
        x, y, light = places(one, plate, centre)
        square = x * x + y * y
        ring = np.digitize(np.sqrt(square), edges) - 1
        good = (ring >= 0) & (ring < count) & np.isfinite(light)
        x, y, square, light, ring = x[good], y[good], square[good], light[good], ring[good]
        share = (square - squares[ring]) / np.diff(squares)[ring]
        across = 2.0 * share - 1.0
        part = ring * PARTS + np.clip(PARTS * share, 0, PARTS - 1).astype(int)
        places_of += np.bincount(part, minlength=parts), np.bincount(part, square, parts)
        light_of += np.bincount(ring, light, count), np.bincount(ring, light.astype(float) ** 2, count)
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2.0 * np.pi))).astype(int) % SECTORS
        kept.append((ring, across, ring * SECTORS + sector, light))
        for power in range(2 * DEGREE + 1):
            powers[power] += np.bincount(ring, across**power, count)
        for power in range(DEGREE + 1):
            products[power] += np.bincount(ring, light * across**power, count)
    polynomials = _polynomials(powers, products)
    sums = np.zeros((2, cells))
    for ring, across, cell, light in kept:
        residual = light - np.sum(polynomials[:, ring] * across ** POWERS[:, None], axis=0)
        sums += np.bincount(cell, minlength=cells), np.bincount(cell, residual, cells)
    many, total = sums.reshape(2, count, SECTORS)
    pixels, whole = many.sum(axis=1), np.all(many > 0, axis=1)
    covariance, residual = np.zeros((count, count)), total[whole] / many[whole]
    covariance[np.ix_(whole, whole)] = shrunk(residual - residual.mean(axis=1)[:, None])
    narrow = ~whole | (np.pi * (edges[1:] + edges[:-1]) < SECTORS * GRAIN * plate.pixel(centre))
    covariance = _of_grains(covariance, pixels, light_of, narrow)
    number, square = places_of.reshape(2, count, PARTS)
    distance = np.sqrt(np.where(number > 0, square / np.maximum(number, 1.0), squares[1:, None]))
    seen = (pixels > 0) & (np.diag(covariance) > 0)
    each = np.maximum(pixels, 1.0)
    return SpotRings(
        edges[:-1][seen], edges[1:][seen], (light_of[0] / each)[seen], covariance[np.ix_(seen, seen)],
        (distance[seen], (number / each[:, None])[seen]),
    )  # fmt: skip


def _of_grains(covariance: Floats, pixels: Floats, light: Floats, narrow: NDArray[np.bool_]) -> Floats:
    """Return the covariance (n, n) of rings, raised in narrow rings to at least the level that the other rings suggest.

    Args:
        covariance: (n, n) of the means of rings, from sectors; zero where a sector has no pixel.
        pixels: (n,) number of each ring's pixels.
        light: (2, n) sums of their light, and of its square.
        narrow: (n,) mask of the rings with an empty sector, or with sectors too narrow for grains.
    """
    variance = np.diag(covariance)
    # Relative variance of a pixel, grains included: a mean over pixels of light y has that times (sum y^2) / n^2.
    spread = light[1] / np.maximum(pixels, 1.0) ** 2
    tells = ~narrow & (light[0] > 0)
    if not np.any(tells):
        tells = (variance > 0) & (light[0] > 0)
    least = np.median((variance[tells] / spread[tells])[:NEXT]) * spread if np.any(tells) else np.zeros(pixels.size)
    missing = np.where(narrow & (variance == 0), least, 0.0)
    wider = np.sqrt(np.maximum(least / np.where(variance > 0, variance, np.inf), 1.0))
    widening = np.where(narrow, wider, 1.0)
    return covariance * np.outer(widening, widening) + np.diag(missing)


def _polynomials(powers: Floats, products: Floats) -> Floats:
    """Fit each ring by least squares (DEGREE + 1, n), lowest power first; from sums over its pixels."""
    at = np.add.outer(POWERS, POWERS)
    return np.asarray(np.einsum("nij,jn->in", np.linalg.pinv(np.moveaxis(powers[at], 2, 0)), products), float)


def shrunk(residual: Floats) -> Floats:
    """Covariance (n, n) of means over sectors from their deviations (n, sectors)."""
    sectors = residual.shape[1]
    variance = np.sum(residual**2, axis=1) / (sectors - 1)
    scaled = residual / np.sqrt(np.maximum(variance, np.finfo(float).tiny))[:, None]
    products = scaled[:, None] * scaled[None]
    correlation = products.sum(axis=2) / (sectors - 1)
    noise = np.sum((products - products.mean(axis=2, keepdims=True)) ** 2, axis=2) * sectors / (sectors - 1) ** 3
    apart = ~np.eye(len(residual), dtype=bool)
    share = float(np.clip(noise[apart].sum() / max(np.sum(correlation[apart] ** 2), 1e-12), 0.05, 1.0))
    kept = np.where(apart, (1.0 - share) * correlation, 1.0)
    size = np.sqrt(variance / sectors)
    return np.asarray(kept * np.outer(size, size), float)


def over_rings(inner: Floats, outer: Floats) -> tuple[Floats, Floats]:
    """Distances (n, q) and shares (q,) of a ring's area."""
    t, share = 0.5 * (1.0 + RING[0]), 0.5 * RING[1]
    return np.sqrt(inner[:, None] ** 2 + ((outer - inner) * (outer + inner))[:, None] * t), share
