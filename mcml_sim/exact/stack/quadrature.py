"""Depths in a stack of layers that share one index, directions through it, and how to integrate over both.

Depths: Gauss nodes on panels that grow with the distance from the nearest interface. They also crowd towards the ends
of panels, where fluences go as z ln z.

Directions: under angles at which light gets out somewhere the cosine outside is the variable, in which Fresnel's law is
smooth. Light that is reflected totally on both sides of a plate may resonate in it: its slopes t = tan(theta) run along
a complex ray, where it does not, as do all slopes up to 90 degrees where a surface has no critical angle.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_legendre

from mcml_sim.exact.half_space import decay_rate
from mcml_sim.media.arrays import Floats, checked_whole
from mcml_sim.media.medium import Layer, Medium

FIRST_PANEL = 1.5  # mean free paths, of the panels at interfaces
WAVES = 4.0  # 1/k, of the panels at surfaces
DEEPEST = 40.0  # mean free paths beyond which an infinite layer has nothing but its slowest mode
FADED = 30.0  # exponent by which light has faded where it is not followed any deeper
DARK = 38.0  # optical depth beyond which e^-T is rounding
FEWEST, MOST = 4, 100  # nodes
GRADING = 2  # power of the distance to the end of a panel by which nodes crowd there
FEW = 16  # nodes of a panel: with fewer, all that panels hold is integrated less finely
NEAR_STEP, FEW_STEP, NEAR_LAST = 0.1, 0.15, 3.4  # of the double-exponential rule

TURN = complex(np.exp(0.25j * np.pi))  # of slopes beyond the cones
RAY_NODES = 14  # of a panel
AZIMUTHS = 0.7  # eights of them for each e-fold by which waves are shorter than mean free paths
STEEPEST = 1e9  # where no critical angle ends the slopes
THINNEST = 1e-6  # optical thickness of a plate that light beyond the critical angles crosses to and fro
SLOPES_A_RADIAN, AZIMUTHS_A_RADIAN = 0.55 / 24, 0.25 / 8  # growth of their numbers by the radian of phase
RESOLVED = 16.0  # optical depth down to which the phases of slanted light are resolved,
MOST_PHASE = 40.0  # as far as they turn no farther than this
KEPT = 8  # sets of depths, whose pairs many wave numbers share

Complexes = NDArray[Any]  # complex128, which numpy's own types lose


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


@dataclass(frozen=True, eq=False)
class Depths:
    """Depths in the layers of a medium that scatter, N = panels * nodes, for many wave numbers. Lengths in its unit."""

    z: Floats  # depths of the nodes, (N,) [length]
    tau: Floats  # optical depths of the nodes, (N,) [-]
    weight: Floats  # weights mu_s dz, (N,) [-]
    absorbs: Floats  # weights mu_a dz, (N,) [-]
    z_ends: Floats  # depths of the ends of panels, (2, panels) [length]
    tau_ends: Floats  # optical depths of the ends of panels, (2, panels) [-]
    alpha: Floats  # albedo, (panels,) [-]
    tail: Floats  # depths, optical depths and mu_s dz below the last node in an infinite layer, (3, tail)
    last: Layer  # layer at the bottom
    height: float  # thickness d, infinite in a half space [length]
    optical: float  # optical thickness [-]
    above: float  # index n over the index above
    below: float  # index n over the index below; 1 in a half space
    pane: bool  # whether this is a single layer of clear glass

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
    return _placed(medium, _panels(medium.layers, k), rule)


@lru_cache(maxsize=KEPT)
def _placed(medium: Medium, panels: tuple[tuple[int, float, float, int], ...], rule: Nodes) -> Depths:
    layers, tops = medium.layers, medium.z_edges
    tau_tops = np.cumsum([0.0, *map(_optical, layers)])
    ends: list[tuple[float, float, float, float]] = []
    scatters: list[Layer] = []
    for number, finest_above, finest_below, count in panels:
        cuts = _cuts(_optical(layers[number]), finest_above, finest_below)[: 1 + count]
        z, tau = tops[number] + cuts / layers[number].mu_t, tau_tops[number] + cuts
        ends += zip(z[:-1], z[1:], tau[:-1], tau[1:], strict=True)
        scatters += [layers[number]] * count
    z_ends, tau_ends = np.reshape(np.reshape(ends, (-1, 4)).T, (2, 2, -1))
    s, d_s = gauss(rule.depth)
    x, d_x = _crowded(s)
    at = np.stack([1 - x, x], axis=1)
    length = np.diff(z_ends, axis=0)[0][:, None] * (d_s * d_x)
    mu_s, mu_a = np.reshape([(layer.mu_s, layer.mu_a) for layer in scatters], (-1, 2)).T[:, :, None]
    last, tail = layers[-1], np.empty((3, 0))
    if medium.is_half_space and np.any(tau_ends[1:] == tau_tops[-2] + DEEPEST):
        share, weight = double_exponential()
        depth = DEEPEST + DARK * share
        tail = np.stack([tops[-2] + depth / last.mu_t, tau_tops[-2] + depth, last.alpha * DARK * weight])
    return Depths(
        z=(at @ z_ends).T.ravel(),
        tau=(at @ tau_ends).T.ravel(),
        weight=(mu_s * length).ravel(),
        absorbs=(mu_a * length).ravel(),
        z_ends=z_ends,
        tau_ends=tau_ends,
        alpha=np.array([layer.alpha for layer in scatters]),
        tail=tail,
        last=last,
        height=float(tops[-1]),
        optical=float(tau_tops[-1]),
        above=layers[0].n / medium.n_above,
        below=1.0 if medium.is_half_space else layers[0].n / medium.n_below,
        pane=len(layers) == 1 and not layers[0].mu_t,
    )


def _optical(layer: Layer) -> float:
    return layer.mu_t * layer.thickness if layer.mu_t else 0.0


def _panels(layers: tuple[Layer, ...], k: float) -> tuple[tuple[int, float, float, int], ...]:
    """Return panels of layers that scatter, as far as light of wave number k comes: layer, ends' lengths, count."""
    found, faded = [], 0.0
    numbers = [number for number, layer in enumerate(layers) if layer.mu_s > 0]
    for number, layer in enumerate(layers):
        optical = _optical(layer)
        fades = min(np.hypot(slowest(layer.alpha), k / layer.mu_t), 1.0) if layer.mu_t else 0.0  # per mean free path
        if layer.mu_s > 0:
            # Where light gets out its own length 1/k must be resolved.
            finest = min(FIRST_PANEL, WAVES * layer.mu_t / k) if k > 0 else FIRST_PANEL
            first, last = (finest if number == numbers[at] else FIRST_PANEL for at in (0, -1))
            cuts = _cuts(optical, first, last)
            found.append((number, first, last, int(np.count_nonzero(faded + fades * cuts[:-1] < FADED))))
        if np.isfinite(optical):
            faded += fades * optical
    return tuple(found)


@lru_cache(maxsize=512)
def slowest(alpha: float) -> float:
    """Return the rate at which light far from all sources fades [1/mfp]."""
    return float(decay_rate(alpha))


@lru_cache(maxsize=512)
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

    height: Floats  # distances from the node, on both sides of it, (nodes, rule)
    weight: Floats  # weights, (nodes, rule)
    through: Floats  # values of the polynomials in s that are 1 at one of the panel's nodes, (nodes, rule, nodes)


@lru_cache
def near_node(nodes: int) -> Near:
    """Return the rule from each node to both ends, in x, not s: K is a logarithm times what is smooth in x."""
    share, d_share = double_exponential(nodes)
    x = _crowded(gauss(nodes)[0])[0][:, None, None]
    side = np.concatenate([-x, 1 - x], axis=1)
    at, length = (x + side * share).reshape(nodes, -1), np.abs(side)
    return Near((length * share).reshape(nodes, -1), (length * d_share).reshape(nodes, -1), _through(at, nodes))


@lru_cache
def near_end(nodes: int) -> Near:
    """Return the rule from the panel's upper end, (rule,) and (rule, nodes)."""
    share, d_share = double_exponential(nodes)
    return Near(share, d_share, _through(share, nodes))


def double_exponential(nodes: int = FEW) -> tuple[Floats, Floats]:
    """Return nodes and weights on (0, 1), for panels of so many nodes."""
    step = NEAR_STEP if nodes >= FEW else FEW_STEP
    y = np.arange(-NEAR_LAST, NEAR_LAST + step / 2, step)
    share = 1 / (1 + np.exp(np.pi * np.sinh(y)))
    return share, step * np.pi * np.cosh(y) * share * (1 - share)


def _through(x: Floats, nodes: int) -> Floats:
    """Return the polynomials in s that are 1 at one of a panel's nodes, at x, (..., nodes)."""
    x = np.clip(x, 0.0, 1.0)
    low, high = x ** (1 / GRADING), (1 - x) ** (1 / GRADING)
    return interpolation((low - high) / (low + high), nodes)


def interpolation(t: Floats, nodes: int) -> Floats:
    """Return the polynomials that are 1 at one of so many Gauss nodes on (-1, 1) and 0 at the others, (..., nodes).

    The sum over l of P_l(t) P_l(t_j) w_j (2l + 1)/2, w_j on (0, 1).
    """
    x, weight = gauss(nodes)
    basis = np.polynomial.legendre.legvander(2 * x - 1, nodes - 1) * (2 * np.arange(nodes) + 1) * weight[:, None]
    return np.polynomial.legendre.legvander(t, nodes - 1) @ basis.T


class Slants(NamedTuple):
    """Directions, arrays (directions,), and light along them."""

    weight: Complexes  # weight: dmu/mu, times 1/2, times the share of the azimuth
    mu: Complexes
    a: Complexes  # reflectance of the upper surface from inside
    b: Complexes
    whole: Complexes  # transmission E(d), 0 in a half space
    from_top: Complexes  # transmission E(z), (directions, N)
    to_bottom: Complexes  # transmission E(d - z), (directions, N)
    cones: int  # number of the first directions, those inside the cones of escape


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
    t, d_mu = cones(here, int(rule.slope * (1 + SLOPES_A_RADIAN * phase)))
    # Of each slope as many azimuths as its own phases take.
    share = np.minimum(t.real / (min(steepest(here), 1.5) or 1.0), 1.0)
    azimuths = np.full(t.size, rule.azimuth / 3 * (1 + AZIMUTHS_A_RADIAN * phase * share) if k > 0 else 1.0).astype(int)
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
