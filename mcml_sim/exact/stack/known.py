"""Light of a stack that has a formula by radius: scattered once under a searchlight, or thrown back without scattering.

From the beam at height Z below the surface, or below its image in the lower one, light scattered once leaves at a
distance r = Z tan(theta), and dZ / (r^2 + Z^2) = d(theta) / r:

    R_1(r) = 1/(4 pi r) int mu_s phi_0 (1 - a) cos(theta) e^{-T / cos(theta)} d(theta)
    int_0^r 2 pi r R_1 dr = (1/2) int (1 - a) [int_0^{r / tan(theta)} mu_s phi_0 e^{-T / mu} dZ] dmu,   mu = cos(theta)

with a Fresnel's reflectance of the upper surface from inside; light by way of the lower surface has its reflectance
too. Under diffuse light what comes back without scattering after M = m + 1 times to and fro, d the stack's height:

    R_0(r) = (n^2/pi) sum over m of (1 - a)^2 b (a b)^m mu^4 e^{-2 M T / mu} / (2 M d)^2,   tan(theta) = r / 2 M d
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mcml_sim.exact.stack import fluence
from mcml_sim.exact.stack.quadrature import Depths, Nodes, critical_slope, double_exponential, reflectance, stack
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import Layer, Medium

SURFACES = Nodes(depth=4, slope=4, azimuth=4)  # of a stack whose depths nobody asks for
LEAST = 1e-13  # of light to and fro
MOST_TURNS = 10_000


class _Piece(NamedTuple):
    """Layer, or its image in the lower surface, as the light flies."""

    near: float  # height at its nearer end [length]
    far: float  # height at its farther end [length]
    optical: float  # optical thickness up to the nearer end [-]
    layer: Layer
    image: bool

    def scattered(self, here: Depths, low: Floats, high: Floats, slow: Floats) -> Floats:
        """Return the integral of mu_s phi_0 e^{-T slow} from height low to high [-]."""
        a, b = fluence.normal_reflectances(here)
        entering = (1 - a) / (1 - a * b * np.exp(-2 * here.optical))
        start = self.optical + self.layer.mu_t * (low - self.near)
        total = np.zeros_like(slow)
        # The beam on its way down, and back up from the lower surface: e^-tau and b e^-(2 optical - tau).
        for way, lost, share in ((1, 0.0, 1.0), (-1, 2 * here.optical, b)):
            turn, more = (-way, 2 * here.optical - lost) if self.image else (way, lost)
            if share:
                rate = slow + turn
                depth = rate * self.layer.mu_t * (high - low)
                mean = np.where(depth > 1e-12, -np.expm1(-depth) / np.where(depth > 1e-12, depth, 1.0), 1.0)
                total += share * np.exp(-rate * start - more) * mean
        return entering * self.layer.mu_s * (high - low) * total

    def fluence(self, here: Depths, height: Floats) -> Floats:
        """Return mu_s phi_0 [1/length]."""
        tau = self.optical + self.layer.mu_t * (height - self.near)
        return self.layer.mu_s * fluence.beam(here, 2 * here.optical - tau if self.image else tau)

    def passes(self, here: Depths, t: Floats) -> Floats:
        """Return the share of light of that slope that the surfaces let out [-]."""
        out = 1 - reflectance(here.above, t + 0j).real
        return out * reflectance(here.below, t + 0j).real if self.image else out


def profile(medium: Medium, illumination: str, r: Floats) -> Floats:
    """Return R_d of that light [1/length^2] at radii r > 0 of shape (n,)."""
    here = stack(medium, 0.0, SURFACES)
    if illumination == "diffuse":
        return _thrown_back(here, r)
    value = np.zeros_like(r)
    share, weight = double_exponential()
    for piece, low, high in _ranges(here, medium, r, ends=True):
        theta = low + (high - low) * share
        height, cosine = np.clip(r[:, None] / np.tan(theta), piece.near, piece.far), np.cos(theta)
        tau = piece.optical + piece.layer.mu_t * (height - piece.near)
        light = piece.passes(here, np.tan(theta)) * piece.fluence(here, height) * np.exp(-tau / cosine)
        value += np.sum((high - low) * weight * cosine * light, axis=1)
    return value / (4 * np.pi * r)


def within(medium: Medium, illumination: str, r: Floats) -> Floats:
    """Return the light that leaves within radii r > 0 of shape (n,), and the beam that comes straight back [-]."""
    here = stack(medium, 0.0, SURFACES)
    if illumination == "diffuse":
        return _thrown_back_within(here, r)
    value = np.full_like(r, fluence.thrown_back(here, 0.0, illumination, SURFACES))
    share, weight = double_exponential()
    for piece, low, high in _ranges(here, medium, r, ends=False):
        theta = low + (high - low) * share
        farthest = np.clip(r[:, None] / np.tan(theta), piece.near, piece.far)
        light = piece.scattered(here, piece.near + 0 * theta, farthest, 1 / np.cos(theta))
        out = piece.passes(here, np.tan(theta)) * np.sin(theta)
        value += 0.5 * np.sum((high - low) * weight * out * light, axis=1)
    return value


def _pieces(here: Depths, medium: Medium) -> list[_Piece]:
    pieces, tau = [], 0.0
    for layer, top in zip(medium.layers, medium.z_edges, strict=False):
        bottom, thickness = top + layer.thickness, layer.mu_t * layer.thickness if layer.mu_t else 0.0
        if layer.mu_s > 0:
            pieces.append(_Piece(top, bottom, tau, layer, False))
            if here.below != 1:
                ends = 2 * here.height - bottom, 2 * here.height - top
                pieces.append(_Piece(*ends, 2 * here.optical - tau - thickness, layer, True))
        tau += thickness
    return pieces


def _ranges(here: Depths, medium: Medium, r: Floats, ends: bool) -> Iterator[tuple[_Piece, Floats, Floats]]:
    """Yield each piece with the least and largest angles inside, (n, 1), under which light leaves at r, or within r."""
    for piece in _pieces(here, medium):
        heights = [piece.near, piece.far] if ends or piece.far == np.inf else [piece.near, piece.far, np.inf]
        for near, far in itertools.pairwise(heights):
            low, high = np.arctan2(r, far)[:, None], np.arctan2(r, near)[:, None]
            for start, stop in itertools.pairwise(_breaks(here)):
                yield piece, np.clip(low, start, stop), np.clip(high, start, stop)


def _breaks(here: Depths) -> list[float]:
    """Return 0, the critical angles inside as far as light gets out above, and the last of these."""
    above, below = (float(np.arctan(critical_slope(ratio))) for ratio in (here.above, here.below))
    return [0.0, below, above] if below < above else [0.0, above]


def _turns(here: Depths) -> range:
    """Return how often light goes to and fro until LEAST of it is left."""
    if here.below == 1:
        return range(0)
    return range(int(min(-np.log(LEAST) / max(2 * here.optical, 1e-9) + 1, MOST_TURNS)))


def _thrown_back(here: Depths, r: Floats) -> Floats:
    value = np.zeros_like(r)
    for turn in _turns(here):
        flown = 2 * (turn + 1)
        t = r / (flown * here.height)
        light = _returned(here, t, turn) / (1 + t * t) ** 2 / (flown * here.height) ** 2
        value += here.above**2 / np.pi * light
        if not np.any(light > LEAST * value):
            break
    return value


def _thrown_back_within(here: Depths, r: Floats) -> Floats:
    """Return 2 n^2 int mu ... dmu as far as the slope that leaves at r, from sin(theta)^2."""
    value = np.zeros_like(r)
    share, weight = double_exponential()
    for turn in _turns(here):
        light = np.zeros_like(r)
        for start, stop in itertools.pairwise(_breaks(here)):
            width = np.clip(np.arctan2(r, 2 * (turn + 1) * here.height), start, stop)[:, None] - start
            theta = start + width * share
            flux = _returned(here, np.tan(theta), turn) * np.sin(2 * theta)
            light += here.above**2 * np.sum(width * weight * flux, axis=1)
        value += light
        if not np.any(light > LEAST * value):
            break
    return value


def _returned(here: Depths, t: Floats, turn: int) -> Floats:
    """Return (1 - a)^2 b (a b)^turn e^{-T / mu} after that many turns more than one."""
    a, b = (reflectance(ratio, t + 0j).real for ratio in (here.above, here.below))
    return (1 - a) ** 2 * b * (a * b) ** turn * np.exp(-2 * (turn + 1) * here.optical * np.sqrt(1 + t * t))
