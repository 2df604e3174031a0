"""Algorithm of MCML for layered media, one photon at a time, compiled by numba: the yardstick for layers.

Wang, Jacques & Zheng (Comput. Methods Programs Biomed. 47, 1995), function by function: a step is drawn in mean free
paths and what an interface cuts off is used up behind it; at an interface light reflects or passes at random, by
Fresnel's share; glass is crossed without absorption; a part of the weight is absorbed at each event; light photons
play roulette. It shares no code with the tracer that it measures.
"""

# ruff: noqa: NPY002 - numba compiles numpy's old generator (Mersenne Twister) into the loop; it would call the new one

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import Medium

WEIGHT_THRESHOLD, ROULETTE_CHANCE = 1e-4, 0.1  # MCML's
STRAIGHT = 1 - 1e-12  # MCML's COSZERO: light this close to the normal does not bend at an interface
VERTICAL = 0.99999  # MCML's: photons this close to the axis scatter in the simpler frame

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sums:
    """Weight of all photons, by bin; the last bin of r and z holds what falls beyond it too, as in MCML."""

    reflected: Floats
    """Weight scattered or not, out of the top, (nr, na)."""
    transmitted: Floats
    """Weight out of the bottom, (nr, na)."""
    absorbed_rz: Floats
    """Weight absorbed by ring and depth, (nr, nz); (1, 1), all in one, if that was not asked for."""
    events: int
    """Number of scatterings."""


def trace(medium: Medium, grid: Grid, photons: int, seed: int, tally_rz: bool = True) -> Sums:
    """Trace photons, of weight 1 - specular reflectance on entry, through `medium`, with the even bins of `grid`."""
    r, a = grid.rings, max(grid.angles, 1)
    sums = Sums(np.zeros((r, a)), np.zeros((r, a)), np.zeros((r, max(grid.depths, 1))), 0)
    dz = grid.z_edges[1] if grid.z_edges is not None else math.inf
    widths = np.array([1 / grid.r_edges[1], 1 / dz, a / (math.pi / 2)])
    total = np.zeros(1)
    layers = _layers(medium)
    absorbed = sums.absorbed_rz if tally_rz else None
    events = _trace(seed, photons, specular(medium), *layers, widths, sums.reflected, sums.transmitted, absorbed, total)
    return Sums(sums.reflected, sums.transmitted, sums.absorbed_rz if tally_rz else total[:, None], events)


def specular(medium: Medium) -> float:
    """Return the share of normally incident light that does not enter the first layer; it may be glass."""
    first, *others = medium.layers
    above = ((medium.n_above - first.n) / (medium.n_above + first.n)) ** 2
    if first.mu_t > 0 or not others:
        return above
    below = ((first.n - others[0].n) / (first.n + others[0].n)) ** 2
    return above + (1 - above) ** 2 * below / (1 - above * below)


def _layers(medium: Medium) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Return n with those around, depths of the interfaces, mu_t, absorbed share of an event, g, critical cosines."""
    n = np.array([medium.n_above, *(layer.n for layer in medium.layers), medium.n_below])
    inside = n[1:-1]
    critical = np.sqrt(np.maximum(1 - np.stack([n[:-2], n[2:]]) ** 2 / inside**2, 0.0))
    mu_t = np.array([layer.mu_t for layer in medium.layers])
    absorbed = np.array([layer.mu_a / layer.mu_t if layer.mu_t else 0.0 for layer in medium.layers])
    return n, medium.z_edges, mu_t, absorbed, np.array([layer.g for layer in medium.layers]), critical


@nb.njit(error_model="numpy")  # as in C, no checks of divisors
def _fresnel(n_from: float, n_to: float, cosine: float) -> tuple[float, float]:
    """Return the share reflected of unpolarised light below the critical angle, and the cosine behind the interface."""
    if n_from == n_to:
        return 0.0, cosine
    if cosine > STRAIGHT:
        return ((n_to - n_from) / (n_to + n_from)) ** 2, cosine
    behind = math.sqrt(max(1.0 - (n_from / n_to) ** 2 * (1.0 - cosine * cosine), 0.0))
    across = (n_from * cosine - n_to * behind) / (n_from * cosine + n_to * behind)
    along = (n_from * behind - n_to * cosine) / (n_from * behind + n_to * cosine)
    return 0.5 * (across * across + along * along), behind


@nb.njit(error_model="numpy")  # as in C, no checks of divisors
def _scattering_cosine(g: float) -> float:
    """Draw from Henyey and Greenstein's phase function."""
    if g == 0.0:
        return 2.0 * np.random.random() - 1.0
    ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * np.random.random())
    return min(max((1.0 + g * g - ratio * ratio) / (2.0 * g), -1.0), 1.0)


@nb.njit(error_model="numpy")  # as in C, no checks of divisors
def _trace(
    seed: int,
    photons: int,
    specular_share: float,
    n: Floats,
    depth: Floats,
    mu_t: Floats,
    absorbed_share: Floats,
    anisotropy: Floats,
    critical: Floats,
    per_width: Floats,
    reflected: Floats,
    transmitted: Floats,
    absorbed: Floats | None,
    total: Floats,
) -> int:
    np.random.seed(seed)
    per_dr, per_dz, per_da = per_width
    last_ring, last_angle = reflected.shape[0] - 1, reflected.shape[1] - 1
    last_layer = mu_t.size - 1
    events = 0
    sum_absorbed = 0.0
    for _ in range(photons):
        x, y, z = 0.0, 0.0, 0.0
        ux, uy, uz = 0.0, 0.0, 1.0
        weight = 1.0 - specular_share
        layer = 0
        left = 0.0  # of the step [mfp]
        alive = True
        while alive:
            rate = mu_t[layer]
            # How far to the interface ahead, and is it nearer than the next event?
            if uz > 0.0:
                to_interface = (depth[layer + 1] - z) / uz
            elif uz < 0.0:
                to_interface = (depth[layer] - z) / uz
            else:
                to_interface = math.inf
            if rate == 0.0:
                if uz == 0.0:  # a horizontal photon never leaves glass
                    break
                meets, step = True, to_interface
            else:
                if left == 0.0:
                    left = -math.log(1.0 - np.random.random())
                step = left / rate
                meets = step > to_interface
                if meets:
                    step = to_interface
                    left -= step * rate
                else:
                    left = 0.0
            x += ux * step
            y += uy * step
            z += uz * step
            if meets:
                down = uz > 0.0
                beyond = layer + 1 if down else layer - 1
                cosine = abs(uz)
                # (n is shifted by one: n[0] is above.)
                share, behind = 1.0, 0.0
                if cosine > critical[1 if down else 0, layer]:
                    share, behind = _fresnel(n[layer + 1], n[beyond + 1], cosine)
                if np.random.random() <= share:
                    uz = -uz
                elif 0 <= beyond <= last_layer:
                    bend = n[layer + 1] / n[beyond + 1]
                    ux *= bend
                    uy *= bend
                    uz = behind if down else -behind
                    layer = beyond
                    z = depth[layer] if down else depth[layer + 1]
                else:
                    ring = min(int(math.sqrt(x * x + y * y) * per_dr), last_ring)
                    angle = min(int(math.acos(behind) * per_da), last_angle)
                    if down:
                        transmitted[ring, angle] += weight
                    else:
                        reflected[ring, angle] += weight
                    break
            else:
                events += 1
                drop = weight * absorbed_share[layer]
                weight -= drop
                if absorbed is None:
                    sum_absorbed += drop
                else:
                    ring = min(int(math.sqrt(x * x + y * y) * per_dr), last_ring)
                    absorbed[ring, min(int(z * per_dz), absorbed.shape[1] - 1)] += drop
                cosine = _scattering_cosine(anisotropy[layer])
                sine = math.sqrt(1.0 - cosine * cosine)
                azimuth = 2.0 * math.pi * np.random.random()
                cos_azimuth = math.cos(azimuth)
                sin_azimuth = math.copysign(math.sqrt(max(1.0 - cos_azimuth * cos_azimuth, 0.0)), math.pi - azimuth)
                if abs(uz) > VERTICAL:
                    ux, uy = sine * cos_azimuth, sine * sin_azimuth
                    uz = math.copysign(cosine, cosine * uz)
                else:
                    root = math.sqrt(1.0 - uz * uz)
                    scale = sine / root
                    ux, uy, uz = (
                        scale * (ux * uz * cos_azimuth - uy * sin_azimuth) + ux * cosine,
                        scale * (uy * uz * cos_azimuth + ux * sin_azimuth) + uy * cosine,
                        -sine * cos_azimuth * root + uz * cosine,
                    )
            if weight < WEIGHT_THRESHOLD:
                if np.random.random() >= ROULETTE_CHANCE:
                    alive = False
                weight /= ROULETTE_CHANCE
    total[0] = sum_absorbed
    return events
