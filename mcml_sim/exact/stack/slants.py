"""Light along directions that a surface makes a difference to, in a stack whose layers share one index.

Under angles at which light gets out somewhere the cosine outside is the variable: there Fresnel's law is smooth. Light
that is reflected totally on both sides of a plate may resonate in it; its slopes t = tan(theta) run along a ray into
the complex plane, where it does not, as do all slopes up to 90 degrees where a surface has no critical angle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim.exact.stack.depths import DARK, Depths, Nodes, gauss
from mcml_sim.media.arrays import Floats

Complexes = NDArray[Any]  # complex128, which numpy's own types lose

TURN = complex(np.exp(0.25j * np.pi))  # of slopes beyond the cones
RAY_NODES = 14  # of a panel
AZIMUTHS = 0.7  # eights of them for each e-fold by which waves are shorter than mean free paths
STEEPEST = 1e9  # where no critical angle ends the slopes
THINNEST = 1e-6  # optical thickness of a plate that light beyond the critical angles crosses to and fro
RESOLVED = 16.0  # optical depth down to which the phases of slanted light are resolved,
MOST_PHASE = 40.0  # as far as they turn no farther than this


class Slants(NamedTuple):
    """Directions, arrays (directions,), and light along them."""

    weight: Complexes
    """Weight: dmu/mu, times 1/2, times the share of the azimuth."""
    mu: Complexes
    a: Complexes
    """Reflectance of the upper surface from inside."""
    b: Complexes
    whole: Complexes
    """Transmission E(d), 0 in a half space."""
    from_top: Complexes
    """Transmission E(z), (directions, N)."""
    to_bottom: Complexes
    """Transmission E(d - z), (directions, N)."""
    cones: int
    """Number of the first directions, those inside the cones of escape."""


def reflectance(ratio: float, t: Any) -> Any:
    """Return Fresnel's reflectance for unpolarised light, from inside, n over the index outside `ratio`."""
    if ratio == 1:
        return np.zeros_like(t)
    mu = 1 / np.sqrt(1 + t * t)
    outside = np.sqrt(1 - (ratio * t * mu) ** 2)
    s_wave, p_wave = (ratio * mu - outside) / (ratio * mu + outside), (ratio * outside - mu) / (ratio * outside + mu)
    return np.where(t.real > critical_slope(ratio), 1.0, 0.5 * (s_wave**2 + p_wave**2))


def critical_slope(ratio: float) -> float:
    """Return tan of the critical angle inside; infinite where there is none."""
    return float(1 / np.sqrt(ratio**2 - 1)) if ratio > 1 else np.inf


def cones(here: Depths, nodes: int) -> tuple[Complexes, Complexes]:
    """Return slopes of light that gets out, and dmu/mu, in the cosine outside, where Fresnel's law is smooth."""
    slopes, weights, low = [np.empty(0)], [np.empty(0)], 0.0
    for ratio in sorted({ratio for ratio in (here.above, here.below) if ratio > 1}, reverse=True):
        top = np.sqrt(1 - (ratio * low) ** 2 / (1 + low**2))
        step = 8 * 2 ** max(0, nodes.bit_length() - 8)  # at most 6 % more nodes, and few rules
        x, weight = gauss(nodes - nodes % -step)
        # Flat at the normal, where the slope goes as the root of the cosine, and at 90 degrees: where the indices are
        # nearly equal mu follows the cosine but close to 0.
        angle = 0.5 * np.pi * x
        outside, d_outside = top * np.sin(angle) ** 2, top * 0.5 * np.pi * np.sin(2 * angle) * weight
        mu = np.sqrt(1 - (1 - outside**2) / ratio**2)
        slopes.append(np.sqrt(1 - outside**2) / (ratio * mu))
        weights.append(outside * d_outside / (ratio * mu) ** 2)
        low = critical_slope(ratio)
    return np.concatenate(slopes) + 0j, np.concatenate(weights) + 0j


def _ray(start: float, phase: float, last: float) -> tuple[Complexes, Complexes]:
    """Return slopes from `start` along a complex ray, and dmu/mu: panels that grow fourfold up to a distance `last`."""
    first = min(0.3, 1 / max(phase, 1.0))
    steps = max(int(np.ceil(np.log(last / first) / np.log(4.0))), 1)
    edges = np.append(0.0, np.geomspace(first, last, steps + 1))
    x, weight = gauss(RAY_NODES)
    s = (edges[:-1, None] + np.diff(edges)[:, None] * x).ravel()
    t = start + s * TURN
    return t, TURN * (np.diff(edges)[:, None] * weight).ravel() * t / (1 + t * t)


def steepest(here: Depths) -> float:
    """Return the largest of the critical slopes; 0 where there is none."""
    return max((critical_slope(ratio) for ratio in (here.above, here.below) if ratio > 1), default=0.0)


def deepest(here: Depths) -> float:
    """Return the depth from which slanted light still gets out [length]."""
    seen = here.z[here.tau < RESOLVED]
    return float(max(seen.max(initial=0.0), here.height if here.optical < RESOLVED else 0.0))


def _slopes(here: Depths, k: float, phase: float, rule: Nodes) -> tuple[Complexes, Floats, Complexes, int]:
    """Return tan(theta), cos(azimuth) and weight of directions, for phases that turn so far; how many lie in cones."""
    t, d_mu = cones(here, rule.slope + int(0.55 * phase))
    # Of each slope as many azimuths as its own phases take.
    share = np.minimum(t.real / (min(steepest(here), 1.5) or 1.0), 1.0)
    azimuths = np.ones(t.size, int) if k == 0 else rule.azimuth // 3 + (0.25 * phase * share).astype(int)
    of = np.repeat(np.arange(t.size), azimuths)
    place = (np.arange(of.size) - (np.cumsum(azimuths) - azimuths)[of] + 0.5) / azimuths[of]
    columns = [(t[of], np.cos(0.5 * np.pi * place), 0.5 * d_mu[of] / azimuths[of])]
    reflected_below = here.below != 1 and 0 < here.optical < DARK
    if reflected_below or min(here.above, here.below) < 1:
        last = DARK / max(here.optical, THINNEST) if min(here.above, here.below) >= 1 else STEEPEST
        t, d_mu = _ray(steepest(here), k * deepest(here), last)
        # Close to 90 degrees the phase stays small out to the largest slopes: within an angle of mu_t / k.
        waves = k * here.z[-1] / here.tau[-1] if here.panels else 0.0
        x, weight = gauss(rule.azimuth + 8 * int(0.04 * phase + AZIMUTHS * np.log1p(waves)))
        cosine = np.sin(0.5 * np.pi * x**4)
        columns.append((np.repeat(t, x.size), np.tile(cosine, t.size), 0.5 * np.outer(d_mu, 4 * x**3 * weight).ravel()))
    slope, cosine, weight = (np.concatenate(column) for column in zip(*columns, strict=True))
    return slope, cosine, weight, columns[0][0].size


def directions(here: Depths, k: float, rule: Nodes) -> Slants:
    """Return light along directions; a phase that turns farther than MOST_PHASE is left out: it averages away."""
    wave = k * min(steepest(here), 1.5)
    last = min(deepest(here), MOST_PHASE / wave if wave > 0 else np.inf)
    t, cosine, weight, inside = _slopes(here, k, 2 * wave * last, rule)

    def along(z: Floats, tau: Floats) -> Complexes:
        seen = (z <= last) | (wave == 0)
        light = np.zeros((t.size, z.size), complex)
        light[:, seen] = np.exp((1j * k * t * cosine)[:, None] * z[seen] - np.sqrt(1 + t * t)[:, None] * tau[seen])
        return light

    if np.isinf(here.height):
        whole, to_bottom = np.zeros_like(t), np.zeros((t.size, 0), complex)
    else:
        whole = along(np.array([here.height]), np.array([here.optical]))[:, 0]
        to_bottom = along(here.height - here.z, here.optical - here.tau)
    a, b = reflectance(here.above, t), reflectance(here.below, t)
    return Slants(weight, 1 / np.sqrt(1 + t * t), a, b, whole, along(here.z, here.tau), to_bottom, inside)
