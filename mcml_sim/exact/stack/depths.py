"""Depths in a stack of layers, and how to integrate over them what is logarithmic at one of them.

Gauss nodes on panels that grow with the distance from the nearest interface. They also crowd towards the ends of
panels, where fluences go as z ln z.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import roots_legendre

from mcml_sim.exact.half_space import decay_rate
from mcml_sim.media.arrays import Floats
from mcml_sim.media.checks import checked_whole
from mcml_sim.media.medium import Layer, Medium

FIRST_PANEL = 1.5  # mean free paths, of the panels at interfaces
WAVES = 4.0  # 1/k, of the panels at surfaces
DEEPEST = 40.0  # mean free paths beyond which an infinite layer has nothing but its slowest mode
FADED = 30.0  # exponent by which light has faded where it is not followed any deeper
DARK = 38.0  # optical depth beyond which e^-T is rounding
FEWEST, MOST = 4, 100  # nodes
GRADING = 2  # power of the distance to the end of a panel by which nodes crowd there
NEAR_STEP, NEAR_LAST = 0.1, 3.4  # of the double-exponential rule


@dataclass(frozen=True)
class Nodes:
    """Numbers of nodes of `exact.solve`, 4 to 100; InputError on any others.

    depth   of a panel of depths; slope, azimuth  directions of slanted light where k = 0, more of them elsewhere
    wave    of a panel of wave numbers, which is as long as it is far from 0
    """

    depth: int
    slope: int
    azimuth: int
    wave: int = 14

    def __post_init__(self) -> None:
        for field in fields(self):
            checked_whole(field.name, getattr(self, field.name), FEWEST, MOST)

    @property
    def fewer(self) -> Nodes:
        """Nodes that an error is estimated with: what they change is above it."""
        depth, slope, azimuth = self.depth * 4 // 5, self.slope * 3 // 4, self.azimuth * 3 // 4
        return replace(self, depth=max(FEWEST, depth), slope=max(FEWEST, slope), azimuth=max(FEWEST, azimuth))


class Depths(NamedTuple):
    """Depths in the layers of a medium that scatter, N = panels * nodes, for one wave number. Lengths in its unit."""

    z: Floats
    """Depths of the nodes, (N,) [length]."""
    tau: Floats
    """Optical depths of the nodes, (N,) [-]."""
    weight: Floats
    """Weights mu_s dz, (N,) [-]."""
    absorbs: Floats
    """Weights mu_a dz, (N,) [-]."""
    z_ends: Floats
    """Depths of the ends of panels, (2, panels) [length]."""
    tau_ends: Floats
    """Optical depths of the ends of panels, (2, panels) [-]."""
    alpha: Floats
    """Albedo, (panels,) [-]."""
    tail: Floats
    """Depths, optical depths and mu_s dz below the last node in an infinite layer, (3, tail)."""
    last: Layer
    """Layer at the bottom."""
    height: float
    """Thickness d, infinite in a half space [length]."""
    optical: float
    """Optical thickness [-]."""
    above: float
    """Index n over the index above."""
    below: float
    """Index n over the index below; 1 in a half space."""
    pane: bool
    """Whether this is a single layer of clear glass."""

    @property
    def panels(self) -> int:
        """Number of panels."""
        return self.alpha.size

    @property
    def nodes(self) -> int:
        """Number of nodes of a panel."""
        return self.z.size // max(self.panels, 1)


def stack(medium: Medium, k: float, rule: Nodes) -> Depths:
    """Return the depths of a medium whose layers share one index, for light of wave number k [1/length]."""
    layers, tops = medium.layers, medium.z_edges
    tau_tops = np.cumsum([0.0, *(layer.mu_t * layer.thickness if layer.mu_t else 0.0 for layer in layers)])
    z_ends, tau_ends, scatters = _panels(layers, tops, tau_tops, k)
    s, d_s = gauss(rule.depth)
    x, d_x = _crowded(s)
    at = np.stack([1 - x, x], axis=1)
    length = np.diff(z_ends, axis=0)[0][:, None] * (d_s * d_x)
    mu_s, mu_a = np.reshape([(layer.mu_s, layer.mu_a) for layer in scatters], (-1, 2)).T[:, :, None]
    return Depths(
        z=(at @ z_ends).T.ravel(),
        tau=(at @ tau_ends).T.ravel(),
        weight=(mu_s * length).ravel(),
        absorbs=(mu_a * length).ravel(),
        z_ends=z_ends,
        tau_ends=tau_ends,
        alpha=np.array([layer.alpha for layer in scatters]),
        tail=_tail(layers[-1], tops[-2], tau_tops[-2], seen=bool(np.any(tau_ends[1:] == tau_tops[-2] + DEEPEST))),
        last=layers[-1],
        height=float(tops[-1]),
        optical=float(tau_tops[-1]),
        above=layers[0].n / medium.n_above,
        below=1.0 if medium.is_half_space else layers[0].n / medium.n_below,
        pane=len(layers) == 1 and not layers[0].mu_t,
    )


def _panels(layers: tuple[Layer, ...], tops: Floats, tau_tops: Floats, k: float) -> tuple[Floats, Floats, list[Layer]]:
    """Return depths and optical depths of the ends of panels, (2, panels) each, and the panels' layers."""
    ends: list[tuple[float, float, float, float]] = []
    scatters: list[Layer] = []
    faded = 0.0
    numbers = [number for number, layer in enumerate(layers) if layer.mu_s > 0]
    for number, layer in enumerate(layers):
        optical = tau_tops[number + 1] - tau_tops[number]
        fades = min(np.hypot(slowest(layer.alpha), k / layer.mu_t), 1.0) if layer.mu_t else 0.0  # per mean free path
        if layer.mu_s > 0:
            # Where light gets out its own length 1/k must be resolved.
            finest = min(FIRST_PANEL, WAVES * layer.mu_t / k) if k > 0 else FIRST_PANEL
            cuts = _cuts(optical, *(finest if number == numbers[at] else FIRST_PANEL for at in (0, -1)))
            cuts = cuts[: 1 + np.count_nonzero(faded + fades * cuts[:-1] < FADED)]
            z, tau = tops[number] + cuts / layer.mu_t, tau_tops[number] + cuts
            ends += zip(z[:-1], z[1:], tau[:-1], tau[1:], strict=True)
            scatters += [layer] * (cuts.size - 1)
        if np.isfinite(optical):
            faded += fades * optical
    z_ends, tau_ends = np.reshape(np.reshape(ends, (-1, 4)).T, (2, 2, -1))
    return z_ends, tau_ends, scatters


@lru_cache(maxsize=512)
def slowest(alpha: float) -> float:
    """Return the rate at which light far from all sources fades [1/mfp]."""
    return float(decay_rate(alpha))


def _cuts(optical: float, first: float, last: float) -> Floats:
    """Return ends of panels in a layer [mfp]: from either end each twice as long as the one before."""
    growth = 2.0 ** np.arange(60) - 1
    from_top, from_bottom = first * growth, last * growth
    if np.isinf(optical):
        return np.append(from_top[from_top < 0.6 * DEEPEST], DEEPEST)
    middle = 0.5 * optical
    down = from_top[from_top < middle - 0.25 * min(first, middle)]
    up = from_bottom[from_bottom < middle - 0.25 * min(last, middle)]
    return np.concatenate([down, optical - up[::-1]])


def _tail(layer: Layer, top: float, tau_top: float, seen: bool) -> Floats:
    if np.isfinite(layer.thickness) or not seen:
        return np.empty((3, 0))
    share, weight = double_exponential()
    depth = DEEPEST + DARK * share
    return np.stack([top + depth / layer.mu_t, tau_top + depth, layer.alpha * DARK * weight])


@lru_cache(maxsize=512)
def gauss(nodes: int) -> tuple[Floats, Floats]:
    """Return Gauss's rule on (0, 1)."""
    x, weight = roots_legendre(nodes)  # numpy's takes seconds for thousands of nodes
    return (1 + x) / 2, weight / 2


def _crowded(s: Floats) -> tuple[Floats, Floats]:
    """Return x on [0, 1], drawn from s towards both ends (Kress, Numer. Math. 58, 1990), and dx/ds."""
    up, down = s**GRADING, (1 - s) ** GRADING
    return up / (up + down), GRADING * (s * (1 - s)) ** (GRADING - 1) / (up + down) ** 2


class Near(NamedTuple):
    """Double-exponential rule (Takahasi & Mori, Publ. RIMS 9, 1974) on a panel of length 1, for each node of it."""

    height: Floats
    """Distances from the node, on both sides of it, (nodes, rule)."""
    weight: Floats
    """Weights, (nodes, rule)."""
    through: Floats
    """Values of the polynomials in s that are 1 at one of the panel's nodes, (nodes, rule, nodes)."""


@lru_cache
def near_node(nodes: int) -> Near:
    """Return the rule from each node to both ends, in x, not s: K is a logarithm times what is smooth in x."""
    share, d_share = double_exponential()
    x = _crowded(gauss(nodes)[0])[0][:, None, None]
    side = np.concatenate([-x, 1 - x], axis=1)
    at, length = (x + side * share).reshape(nodes, -1), np.abs(side)
    return Near((length * share).reshape(nodes, -1), (length * d_share).reshape(nodes, -1), _through(at, nodes))


@lru_cache
def near_end(nodes: int) -> Near:
    """Return the rule from the panel's upper end, (rule,) and (rule, nodes)."""
    share, d_share = double_exponential()
    return Near(share, d_share, _through(share, nodes))


def double_exponential() -> tuple[Floats, Floats]:
    """Return nodes and weights on (0, 1)."""
    y = np.arange(-NEAR_LAST, NEAR_LAST + NEAR_STEP / 2, NEAR_STEP)
    share = 1 / (1 + np.exp(np.pi * np.sinh(y)))
    return share, NEAR_STEP * np.pi * np.cosh(y) * share * (1 - share)


def _through(x: Floats, nodes: int) -> Floats:
    """Return the sum over l of P_l(x) P_l(x_j) w_j (2l + 1)/2: 1 at node j and 0 at the others, (..., nodes)."""
    x = np.clip(x, 0.0, 1.0)
    low, high = x ** (1 / GRADING), (1 - x) ** (1 / GRADING)
    s, weight = gauss(nodes)
    basis = np.polynomial.legendre.legvander(2 * s - 1, nodes - 1) * (2 * np.arange(nodes) + 1) * weight[:, None]
    return np.polynomial.legendre.legvander((low - high) / (low + high), nodes - 1) @ basis.T
