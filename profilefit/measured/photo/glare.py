"""Point spread of beam and lens, and rings of a medium seen under it.

A point is spread over a core, a Gaussian of standard deviation sigma (the beam, its 1/e^2 radius being 2 sigma, and
what a lens blurs), and over halos, h_a(r) = 3 a^3 / (2 pi (r^2 + a^2)^{5/2}), whose transform is (1 + ka) e^{-ka}:
glare that falls outwards more slowly is a mixture of them. Of light of profile R_d under a beam of power one, and a
share S of it that never enters the medium but is scattered by its surface, a picture shows

    I = k sum_c share_c (R_d + S delta) * spread_c + dark,     sum_c share_c = 1,

as means over rings. The mean of h_a over a circle of radius rho, at a distance d from its centre, is
2 a^3 (E(m) / (A - B) + (2 E(m) - K(m)) / (2 (A + B))) / (pi^2 (A - B) sqrt(A + B)), A = d^2 + rho^2 + a^2, B = 2 d rho,
m = 2 B / (A + B), E and K the complete elliptic integrals. The core blurs a halo, too: by sigma^2 / 2 times its
Laplacian, which is -d^2 h_a / da^2 + (2 / a) dh_a / da.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import ellipe, ellipk

from profilefit.measured.instrument import Floats, Gaussian, Instrument
from profilefit.measured.photo.rings import SpotRings, over_rings

FARTHER = 5.0  # of the last ring, from where halos still bring light
NEAR = 0.1  # of a, between halos whose difference is a derivative
APART = 0.05  # in ln sigma, of cores whose weights are known
POLYNOMIALS = np.linalg.inv(np.vander(np.arange(4.0), increasing=True)).T  # (4, 4) Lagrange's, lowest power first


class RingWeights(NamedTuple):
    """Radii (m,) and weights (1 + halos, n, m) of 2 pi rho R_d(rho) in the mean over each ring, of core and halos.

    widening  (n, m) derivative of the core's by ln sigma
    """

    rho: Floats
    weights: Floats
    widening: Floats


def ring_weights(sigma: float, halos: Sequence[float], rings: SpotRings) -> RingWeights:
    """Return weights of a core and halos; the core's lie on cubics between those of sigmas APART."""
    place = float(np.log(sigma)) / APART
    first = int(np.floor(place)) - 1
    share = POLYNOMIALS @ (place - first) ** np.arange(4.0)
    slope = POLYNOMIALS[:, 1:] @ (np.arange(1.0, 4.0) * (place - first) ** np.arange(3.0)) / APART
    cores = [_core(float(np.exp(APART * (first + at))), *map(_hashable, rings.gathered)) for at in range(4)]
    rho, near = cores[0][0], np.stack([one for _, one in cores])
    core, widening = np.tensordot([share, slope], near, axes=1)
    sharp, bend = _halos(tuple(halos), rho.tobytes(), rings.inner.tobytes(), rings.outer.tobytes())
    blurred = sharp - 0.5 * _blur(sigma, halos)[:, None, None] ** 2 * bend
    return RingWeights(rho, np.concatenate([core[None], blurred]), widening)


def _blur(sigma: float, halos: Sequence[float]) -> Floats:
    """Return the blur of each halo by the core; where that is no small part of it, what the second order gives."""
    return np.minimum(sigma, 0.5 * np.array(halos))


Hashable = tuple[bytes, tuple[int, ...]]


def _hashable(numbers: Floats) -> Hashable:
    return numbers.tobytes(), numbers.shape


@lru_cache(maxsize=24)
def _core(sigma: float, distances: Hashable, shares: Hashable) -> tuple[Floats, Floats]:
    d, share = (np.frombuffer(content).reshape(shape) for content, shape in (distances, shares))
    return Instrument(Gaussian(2.0 * sigma)).gathered(d, share, FARTHER * float(d.max()))


@lru_cache(maxsize=8)
def _halos(halos: tuple[float, ...], radii: bytes, inner: bytes, outer: bytes) -> tuple[Floats, Floats]:
    """Weights (halos, n, m) of halos that no core blurs, and minus their Laplacians; even over the rings' areas."""
    rho = np.frombuffer(radii)
    steps = CubicSpline(np.arange(rho.size), rho)(np.arange(rho.size), 1)  # a sum is a trapezoidal integral
    d, share = over_rings(np.frombuffer(inner), np.frombuffer(outer))

    def weights(by: float) -> Floats:
        return np.stack([np.einsum("q,nqm->nm", share, halo(by * a, d[..., None], rho)) * steps for a in halos])

    less, own, more = weights(1.0 - NEAR), weights(1.0), weights(1.0 + NEAR)
    slope, bend = 0.5 * (more - less) / NEAR, (more + less - 2.0 * own) / NEAR**2  # times a, a^2
    return own, (bend - 2.0 * slope) / np.array(halos)[:, None, None] ** 2


def ring_means(sigma: float, halos: Sequence[float], rings: SpotRings) -> tuple[Floats, Floats]:
    """Each spread's own mean over rings (1 + halos, n) [1/area], and the core's derivative (n,) by ln sigma."""
    (inner, outer), (d, share) = (rings.inner, rings.outer), rings.gathered
    areas = np.pi * (outer - inner) * (outer + inner)
    square = (d / sigma) ** 2
    core = share * np.exp(-0.5 * square) / (2.0 * np.pi * sigma**2)
    # (1 + ka) e^{-ka} cos(k sigma), as much blurred to third order, is (1 - a d/da) of e^{-kz} at z = a + i sigma.
    a, z = np.array(halos)[:, None], (np.array(halos) + 1j * _blur(sigma, halos))[:, None]
    near, far = (z / np.sqrt(r**2 + z**2) - a * r**2 / (r**2 + z**2) ** 1.5 for r in (inner, outer))
    return np.concatenate([core.sum(axis=1)[None], (near - far).real / areas]), np.sum(core * (square - 2.0), axis=1)


def halo(a: float, d: Floats, rho: Floats) -> Floats:
    """Mean of h_a over a circle of radius rho about a point at the distance d."""
    whole, cross = d * d + rho * rho + a * a, 2.0 * d * rho
    m, less, more = 2.0 * cross / (whole + cross), whole - cross, whole + cross
    e, k = ellipe(m), ellipk(m)
    return np.asarray(2.0 * a**3 * (e / less + 0.5 * (2.0 * e - k) / more) / (np.pi**2 * less * np.sqrt(more)), float)
