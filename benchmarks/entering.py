"""Exact light of a semi-infinite medium into which light enters in given directions: total reflectance and step edge.

Isotropic scattering, index-matched surface, lengths in mean free paths. Light that enters at cosine mu to the normal
and azimuth phi has at transverse wave number k the rate s0 = (1 + i k sqrt(1 - mu^2) cos phi) / mu, and

    R^(k) = alpha / (2 mu) <H_k(1/s0) int_0^1 H_k(1/s) / (s0 + s) dm>,    s = sqrt(1/m^2 + k^2)

with the mean <> over azimuths. `mcml_sim.exact.transform` has H_k, and the cases mu = 1 and cosine-weighted mu. Here k
is real, and the integral of H_k runs along a ray that keeps away from its poles. Errors: 1e-5 of A for the reflectance
and for the edge within ten mean free paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import sici

from profilefit.convert.colour import reflectance_by_cosine

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
STEP = 0.2  # of the logarithm of x
LN_X = np.arange(-12.0, 12.0, STEP)
LAST_K = 50.0  # [1/mfp], beyond which R^ falls as 1/k
LEAST_K = 1e-3
NEAREST, FARTHEST = 2e-3, 30.0  # distances [mfp] from the edge, between which it is a table
ON_CIRCLE = 1024  # albedos from which orders of scattering are found
SMALL = 1e-2  # |K| below which arctan(K)/K is its series


@dataclass(frozen=True)
class Entry:
    """Directions in which light enters: cosines to the inward normal, and the share of the light in each (n,) [-]."""

    cosine: Floats
    share: Floats

    def __add__(self, other: Entry) -> Entry:
        """Return half of the light in the directions of each."""
        shares = np.concatenate([0.5 * self.share, 0.5 * other.share])
        return Entry(np.concatenate([self.cosine, other.cosine]), shares)


def unit_nodes(count: int) -> tuple[Floats, Floats]:
    """Return Gauss's rule on (0, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def cosine_weighted(count: int = 10) -> Entry:
    """Return the directions of diffuse illumination."""
    cosine, weight = unit_nodes(count)
    return Entry(cosine, 2.0 * cosine * weight)


def refracted(n: float, roughness: float, count: int = 10) -> Entry:
    """Return directions of a normal ray behind a rough surface, as Cycles enters a medium: no Fresnel factor.

    Normals of the facets are distributed as GGX has those visible from the normal, tan^2 = a^2 u / (1 - u) with uniform
    u, a the roughness; each deviates a ray by its angle less the refracted one.
    """
    u, weight = unit_nodes(count)
    angle = np.arctan(roughness * np.sqrt(u / (1.0 - u)))
    return Entry(np.cos(angle - np.arcsin(np.sin(angle) / n)), weight)


def reflectance(alpha: float, entry: Entry, most: int | None = None) -> float:
    """Return the total reflectance A [-]; with `most`, that of light scattered no more often than so many times.

    A(alpha) is a power series whose coefficients are the orders: Cauchy's formula on the circle of radius alpha.
    """
    if most is None:
        return float(_total(np.array([alpha], complex), entry)[0].real)
    half = alpha * np.exp(-2j * np.pi * np.arange(ON_CIRCLE // 2 + 1) / ON_CIRCLE)
    return float(np.sum(np.fft.irfft(_total(half, entry))[: most + 1]))


def _total(alpha: Complexes, entry: Entry) -> Complexes:
    """Return A at albedos (n,) of any argument [-], averaged over the directions."""
    return np.asarray(reflectance_by_cosine(alpha, entry.cosine) @ entry.share)


def dark_edge(alpha: float, entry: Entry) -> CubicSpline:
    """Return the share of its light that a point gathers from beyond a straight edge, over ln of its distance [mfp]."""
    k = np.append(0.0, np.geomspace(LEAST_K, LAST_K, 48))
    values = np.array([_transform(alpha, one, entry) for one in k])
    curve = CubicSpline(np.arcsinh(k / LEAST_K), values / values[0])
    last = values[-1] / values[0] * LAST_K
    distance = np.geomspace(NEAREST, FARTHEST, 100)
    return CubicSpline(np.log(distance), [_dark(x, curve, last) for x in distance])


def _dark(x: float, curve: CubicSpline, last: float) -> float:
    """Return 1/2 - (1/pi) int_0^inf sin(k x) R^(k) / (k A) dk, with R^ / A = last / k beyond LAST_K."""
    even = np.linspace(0.0, LAST_K, 2 + int(LAST_K * x))
    edges = np.union1d(even, np.geomspace(LEAST_K, LAST_K, 48))
    nodes, weights = unit_nodes(12)
    k = edges[:-1, None] + np.diff(edges)[:, None] * nodes
    within = np.sum(np.diff(edges)[:, None] * weights * np.sin(k * x) / k * curve(np.arcsinh(k / LEAST_K)))
    beyond = last * (np.sin(LAST_K * x) / LAST_K - x * sici(LAST_K * x)[1])
    return float(0.5 - (within + beyond) / np.pi)


def _transform(alpha: float, k: float, entry: Entry) -> float:
    """Return R^(k) of one real wave number [1/mfp]."""
    t, weight = unit_nodes(32)
    s = np.sqrt(1.0 / t**4 + k * k)  # m = t^2
    outgoing = 2.0 * t * weight * _h(alpha, k, s)
    quarter, azimuth_weight = unit_nodes(32)
    total = 0.0
    for cosine, share in zip(entry.cosine, entry.share, strict=True):
        rate = (1.0 + 1j * k * np.sqrt(1.0 - cosine**2) * np.cos(0.5 * np.pi * quarter)) / cosine
        through = np.sum(outgoing / (rate[:, None] + s), axis=1)
        total += share * alpha / (2.0 * cosine) * float(np.sum(azimuth_weight * (_h(alpha, k, rate) * through).real))
    return total


def _h(alpha: float, k: float, s: Complexes | Floats) -> Complexes:
    """Return H_k(1/s) for s (n,) of positive real part and imaginary part >= 0."""
    x = np.exp(LN_X + 0.5j * np.angle(s)[:, None])  # halfway between the poles at +-i s and the singularities of ln L
    size = np.sqrt(k * k + x * x)
    small = np.abs(size) < SMALL
    ratio = np.where(small, 1.0 - size**2 / 3.0 + size**4 / 5.0, np.arctan(size) / np.where(small, 1.0, size))
    return np.exp(-(s / np.pi) * STEP * np.sum(np.log(1.0 - alpha * ratio) * x / (s[:, None] ** 2 + x * x), axis=1))
