"""The fluence in a stack of layers that scatter isotropically and share one index, at one transverse wave number.

With light that varies as e^{i k x} along the surface, every path of slope t = tan(theta) and azimuth psi has the
amplitude E(Z) = exp(-T sqrt(1 + t^2) + i k Z t cos psi) after a height Z of optical thickness T, whatever layers it
crossed and wherever it was reflected. So the fluence phi obeys, with mu_s phi / 4 pi the source,

    phi(z) = phi_0(z) + int (K + G)(z, z') mu_s(z') phi(z') dz'
    K = (1/2) int_0^1 <E(|z - z'|)> dmu/mu = (1/2) int_0^inf e^{-L cosh v - T sinh v} dv,   L^2 = T^2 + (k Z)^2
    G = (1/2) int_0^1 <[a E(z + z') + b E(2d - z - z') + a b (E(2d + z - z') + E(2d - z + z'))] / (1 - a b E(2d))> dmu/mu

where <> is the mean over psi, a and b are Fresnel's reflectances of the two surfaces from inside, and d is the height
of the stack. K is the inverse-square law transformed: E1(T)/2 at k = 0, and logarithmic at T = Z = 0. What comes out
above of a source at z is X(z) = (1/2) int_0^1 <(1 - a) (E(z) + b E(2d - z)) / (1 - a b E(2d))> dmu, which without
surfaces is e^{-L}/2 - T K (Case & Zweifel, Linear Transport Theory, 1967; Williams, J. Phys. D 15, 1982).

- Depths are Gauss nodes on panels that grow with the distance from the nearest interface. Nodes also crowd towards the
  ends of panels, where phi goes as z ln z. On its own panel K is integrated from each node by a double-exponential rule.
- Where a surface reflects, the mirror image K(z + z') holds all that is singular. What G has beside, light that gets
  out and light that crosses the stack, is smooth: directions inside the cones of escape, in the cosine outside, and
  beyond them slopes along a ray into the complex plane, where paths to and fro in a thin plate do not resonate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import exp1, expn, j0

from mcml_sim.exact.half_space import decay_rate
from mcml_sim.media.medium import Layer, Medium

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

FIRST_PANEL = 1.5  # mean free paths, of the panels at interfaces
DEEPEST = 40.0  # mean free paths beyond which an infinite layer has nothing but its slowest mode
DARK = 38.0  # optical depth beyond which e^-T is rounding
GRADING = 2  # power of the distance to the end of a panel by which nodes crowd there
NEAR_STEP, NEAR_LAST = 0.1, 3.4  # of the double-exponential rule
WAVES = 4.0  # 1/k, of the panels at surfaces
CLOSE = 0.5  # of the length of a panel: from nearer than this K is integrated by the double-exponential rule
SERIES_TERMS = 16
DIRECT_NODES = 20
TURN = np.exp(0.25j * np.pi)  # of slopes beyond the cones
RESOLVED = 16.0  # optical depth down to which the phases of slanted light are resolved,
MOST_PHASE = 50.0  # as far as they turn no farther than this


@dataclass(frozen=True)
class Rule:
    """Numbers of nodes: of a panel of depths, and of slopes and azimuths of slanted light where k = 0."""

    depth: int
    slope: int
    azimuth: int


class Stack(NamedTuple):
    """Depths in the layers of a medium that scatter, N = panels * nodes, for one wave number. Lengths in its unit."""

    z: Floats
    """(N,) [length]."""
    tau: Floats
    """Optical depths, (N,) [-]."""
    weight: Floats
    """mu_s dz, (N,) [-]."""
    absorbs: Floats
    """mu_a dz, (N,) [-]."""
    z_ends: Floats
    """(2, panels) [length]."""
    tau_ends: Floats
    """(2, panels) [-]."""
    alpha: Floats
    """Albedo, (panels,) [-]."""
    tail: Floats
    """Depths, optical depths and mu_s dz below the last node in an infinite layer, (3, tail)."""
    last: Layer
    """The layer at the bottom."""
    height: float
    """d, infinite in a half space [length]."""
    optical: float
    """Optical thickness [-]."""
    above: float
    """n over the index above."""
    below: float
    """n over the index below; 1 in a half space."""
    pane: bool
    """True of a single layer of clear glass."""

    @property
    def panels(self) -> int:
        """Number of panels."""
        return self.alpha.size

    @property
    def nodes(self) -> int:
        """Nodes of a panel."""
        return self.z.size // max(self.panels, 1)


class Answer(NamedTuple):
    """At one wave number; arrays (N,)."""

    phi: Floats
    """Fluence over the light that arrives [-]."""
    unscattered: Floats
    """phi_0 [-]."""
    up: Floats
    """X."""
    up_at_once: Floats
    """X without the light that the upper surface had reflected before."""
    down: Floats
    """X of the light that comes out below."""


def stack(medium: Medium, k: float, rule: Rule) -> Stack:
    """Depths of a medium whose layers share one index, for light of wave number k [1/length]."""
    layers, tops = medium.layers, medium.z_edges
    tau_tops = np.cumsum([0.0, *(layer.mu_t * layer.thickness if layer.mu_t else 0.0 for layer in layers)])
    ends: list[tuple[float, float, float, float]] = []
    scatters: list[Layer] = []
    for number, layer in enumerate(layers):
        if layer.mu_s > 0:
            # At the surfaces, where light gets out, its own length 1/k must be resolved.
            finest = min(FIRST_PANEL, WAVES * layer.mu_t / k) if k > 0 else FIRST_PANEL
            first = [finest if number == at else FIRST_PANEL for at in (0, len(layers) - 1)]
            cuts = _cuts(tau_tops[number + 1] - tau_tops[number], *first)
            z, tau = tops[number] + cuts / layer.mu_t, tau_tops[number] + cuts
            ends += zip(z[:-1], z[1:], tau[:-1], tau[1:], strict=True)
            scatters += [layer] * (cuts.size - 1)
    z_ends, tau_ends = np.reshape(np.reshape(ends, (-1, 4)).T, (2, 2, -1))
    s, d_s = _gauss(rule.depth)
    at = np.stack([1 - _crowded(s), _crowded(s)], axis=1)
    length = np.diff(z_ends, axis=0)[0][:, None] * (d_s * _crowding(s))
    mu_s, mu_a = np.reshape([(layer.mu_s, layer.mu_a) for layer in scatters], (-1, 2)).T[:, :, None]
    return Stack(
        z=(at @ z_ends).T.ravel(),
        tau=(at @ tau_ends).T.ravel(),
        weight=(mu_s * length).ravel(),
        absorbs=(mu_a * length).ravel(),
        z_ends=z_ends,
        tau_ends=tau_ends,
        alpha=np.array([layer.alpha for layer in scatters]),
        tail=_tail(medium, tops[-2], tau_tops[-2]),
        last=layers[-1],
        height=float(tops[-1]),
        optical=float(tau_tops[-1]),
        above=layers[0].n / medium.n_above,
        below=1.0 if medium.is_half_space else layers[0].n / medium.n_below,
        pane=len(layers) == 1 and not layers[0].mu_t,
    )


def _cuts(optical: float, first: float, last: float) -> Floats:
    """Ends of panels in a layer [mfp]: from either end each twice as long as the one before."""
    growth = 2.0 ** np.arange(60) - 1
    from_top, from_bottom = first * growth, last * growth
    if np.isinf(optical):
        return np.append(from_top[from_top < 0.6 * DEEPEST], DEEPEST)
    middle = 0.5 * optical
    down = from_top[from_top < middle - 0.25 * min(first, middle)]
    up = from_bottom[from_bottom < middle - 0.25 * min(last, middle)]
    return np.concatenate([down, optical - up[::-1]])


def _tail(medium: Medium, top: float, tau_top: float) -> Floats:
    layer = medium.layers[-1]
    if not (medium.is_half_space and layer.mu_s):
        return np.empty((3, 0))
    share, weight = _double_exponential()
    depth = DEEPEST + DARK * share
    return np.stack([top + depth / layer.mu_t, tau_top + depth, layer.alpha * DARK * weight])


@lru_cache
def _gauss(nodes: int) -> tuple[Floats, Floats]:
    """Gauss's rule on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(nodes)
    return (1 + x) / 2, weight / 2


def _crowded(s: Floats) -> Floats:
    """s on [0, 1] drawn towards both ends (Kress, Numer. Math. 58, 1990)."""
    up, down = s**GRADING, (1 - s) ** GRADING
    return up / (up + down)


def _crowding(s: Floats) -> Floats:
    """Its derivative."""
    up, down = s**GRADING, (1 - s) ** GRADING
    return GRADING * (s * (1 - s)) ** (GRADING - 1) / (up + down) ** 2


class Near(NamedTuple):
    """A double-exponential rule (Takahasi & Mori, Publ. RIMS 9, 1974) on a panel of length 1, for each of its nodes."""

    height: Floats
    """From the node, on both sides of it, (nodes, rule)."""
    weight: Floats
    """(nodes, rule)."""
    through: Floats
    """Values there of the polynomials in s that are 1 at one of the panel's nodes, (nodes, rule, nodes)."""


@lru_cache
def _near(nodes: int) -> Near:
    """From the node to both ends, in x, not s: K is a logarithm times what is smooth as far as those."""
    share, d_share = _double_exponential()
    x = _crowded(_gauss(nodes)[0])[:, None, None]
    side = np.concatenate([-x, 1 - x], axis=1)
    at, length = (x + side * share).reshape(nodes, -1), np.abs(side)
    return Near((length * share).reshape(nodes, -1), (length * d_share).reshape(nodes, -1), _through(at, nodes))


@lru_cache
def _from_end(nodes: int) -> Near:
    """The same from the panel's upper end, (rule,) and (rule, nodes)."""
    share, d_share = _double_exponential()
    return Near(share, d_share, _through(share, nodes))


def _double_exponential() -> tuple[Floats, Floats]:
    """Nodes and weights on (0, 1)."""
    y = np.arange(-NEAR_LAST, NEAR_LAST + NEAR_STEP / 2, NEAR_STEP)
    share = 1 / (1 + np.exp(np.pi * np.sinh(y)))
    return share, NEAR_STEP * np.pi * np.cosh(y) * share * (1 - share)


def _through(x: Floats, nodes: int) -> Floats:
    """sum over l of P_l(x) P_l(x_j) w_j (2l + 1)/2 is 1 at node j and 0 at the others, (..., nodes)."""
    x = np.clip(x, 0.0, 1.0)
    low, high = x ** (1 / GRADING), (1 - x) ** (1 / GRADING)
    s, weight = _gauss(nodes)
    basis = np.polynomial.legendre.legvander(2 * s - 1, nodes - 1) * (2 * np.arange(nodes) + 1) * weight[:, None]
    return np.polynomial.legendre.legvander((low - high) / (low + high), nodes - 1) @ basis.T


def direct(optical: Floats, height: Floats, k: float) -> Floats:
    """K at optical thicknesses T > 0 and heights Z, of one shape."""
    across = k * height
    length = np.hypot(optical, across)
    # a e^v + b e^-v is the exponent
    a = 0.5 * (length + optical)
    b = 0.25 * across**2 / a
    value = np.zeros_like(a)
    close, seen = a < 1.0, (a >= 1.0) & (length < DARK)
    value[close] = _direct_close(a[close], b[close])
    value[seen] = _direct_far(a[seen], b[seen])
    return value


def _direct_close(a: Floats, b: Floats) -> Floats:
    """(1/2) sum over m of (-b)^m/m! E_{m+1}(a)."""
    decay, integral = np.exp(-a), exp1(a)
    total, power = integral.copy(), np.ones_like(a)
    for m in range(1, SERIES_TERMS):
        integral = (decay - a * integral) / m
        power *= -b / m
        total += power * integral
    return 0.5 * total


def _direct_far(a: Floats, b: Floats) -> Floats:
    """Gauss's rule in v as far as the exponent has grown by DARK."""
    largest = a + b + DARK
    v = np.log((largest + np.sqrt(largest**2 - 4 * a * b)) / (2 * a))
    total = np.zeros_like(a)
    for x, weight in zip(*_gauss(DIRECT_NODES), strict=True):
        growth = np.exp(x * v)
        total += weight * np.exp(-a * growth - b / growth)
    return 0.5 * v * total


def _out_freely(optical: Floats, height: Floats, k: float) -> Floats:
    """X without surfaces."""
    return 0.5 * np.exp(-np.hypot(optical, k * height)) - optical * direct(optical, height, k)


class Slants(NamedTuple):
    """Directions, arrays (directions,), and light along them."""

    weight: Complexes
    """dmu/mu, times 1/2, times the share of the azimuth."""
    mu: Complexes
    a: Complexes
    """Reflectance of the upper surface from inside."""
    b: Complexes
    whole: Complexes
    """E(d), 0 in a half space."""
    from_top: Complexes
    """E(z), (directions, N)."""
    to_bottom: Complexes
    """E(d - z), (directions, N)."""
    cones: int
    """So many of them, the first, are inside the cones of escape."""


def reflectance(ratio: float, t: Complexes) -> Complexes:
    """Fresnel's for unpolarised light, from inside, n over the index outside `ratio`; 1 beyond the critical angle."""
    if ratio == 1:
        return np.zeros_like(t)
    mu = 1 / np.sqrt(1 + t * t)
    outside = np.sqrt(1 - (ratio * t * mu) ** 2)
    s_wave, p_wave = (ratio * mu - outside) / (ratio * mu + outside), (ratio * outside - mu) / (ratio * outside + mu)
    return np.where(t.real > critical_slope(ratio), 1.0, 0.5 * (s_wave**2 + p_wave**2))


def critical_slope(ratio: float) -> float:
    """tan of the critical angle inside; infinite where there is none."""
    return float(1 / np.sqrt(ratio**2 - 1)) if ratio > 1 else np.inf


def _cones(here: Stack, nodes: int) -> tuple[Complexes, Complexes]:
    """Slopes under which light gets out somewhere, and dmu/mu, in the cosine outside: there Fresnel's law is smooth."""
    slopes, weights, low = [np.empty(0)], [np.empty(0)], 0.0
    for ratio in sorted({ratio for ratio in (here.above, here.below) if ratio > 1}, reverse=True):
        top = np.sqrt(1 - (ratio * low) ** 2 / (1 + low**2))
        x, weight = _gauss(nodes)
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
    """Slopes from `start` along a complex ray, and dmu/mu: panels that grow fourfold up to a distance `last`."""
    first = min(0.3, 1 / max(phase, 1.0))
    steps = max(int(np.ceil(np.log(last / first) / np.log(4.0))), 1)
    edges = np.append(0.0, np.geomspace(first, last, steps + 1))
    x, weight = _gauss(12)
    s = (edges[:-1, None] + np.diff(edges)[:, None] * x).ravel()
    t = start + s * TURN
    return t, TURN * (np.diff(edges)[:, None] * weight).ravel() * t / (1 + t * t)


def _steepest(here: Stack) -> float:
    """The largest of the critical slopes; 0 where there is none."""
    return max((critical_slope(ratio) for ratio in (here.above, here.below) if ratio > 1), default=0.0)


def _deepest(here: Stack) -> float:
    """Depth from which slanted light still gets out [length]."""
    seen = here.z[here.tau < RESOLVED]
    return float(max(seen.max(initial=0.0), here.height if here.optical < RESOLVED else 0.0))


def _slopes(here: Stack, k: float, phase: float, rule: Rule) -> tuple[Complexes, Floats, Complexes, int]:
    """tan(theta), cos(azimuth) and weight of directions, for phases that turn so far; how many lie in cones."""
    t, d_mu = _cones(here, rule.slope + int(0.7 * phase))
    azimuths = 1 if k == 0 else rule.azimuth // 2 + int(0.27 * phase)
    parts = [(t, np.cos(0.5 * np.pi * (np.arange(azimuths) + 0.5) / azimuths), d_mu, np.full(azimuths, 1 / azimuths))]
    reflected_below = here.below != 1 and 0 < here.optical < DARK
    if reflected_below or min(here.above, here.below) < 1:
        last = DARK / max(here.optical, 1e-6) if min(here.above, here.below) >= 1 else 1e7
        t, d_mu = _ray(_steepest(here), k * _deepest(here), last)
        # Close to 90 degrees the phase stays small out to the largest slopes.
        x, weight = _gauss(rule.azimuth + int(0.3 * phase))
        parts.append((t, np.sin(0.5 * np.pi * x**4), d_mu, 4 * x**3 * weight))
    columns = [
        (np.repeat(t, c.size), np.tile(c, t.size), 0.5 * np.outer(d_mu, share).ravel()) for t, c, d_mu, share in parts
    ]
    slope, cosine, weight = (np.concatenate(column) for column in zip(*columns, strict=True))
    return slope, cosine, weight, columns[0][0].size


def _slants(here: Stack, k: float, rule: Rule) -> Slants:
    """Light whose phase turns farther than MOST_PHASE is left out: it is as good as averaged away."""
    wave = k * min(_steepest(here), 1.5)
    deepest = min(_deepest(here), MOST_PHASE / wave if wave > 0 else np.inf)
    t, cosine, weight, cones = _slopes(here, k, 2 * wave * deepest, rule)

    def along(z: Floats, tau: Floats) -> Complexes:
        seen = (z <= deepest) | (wave == 0)
        light = np.zeros((t.size, z.size), complex)
        light[:, seen] = np.exp((1j * k * t * cosine)[:, None] * z[seen] - np.sqrt(1 + t * t)[:, None] * tau[seen])
        return light

    if np.isinf(here.height):
        whole, to_bottom = np.zeros_like(t), np.zeros((t.size, 0), complex)
    else:
        whole = along(np.array([here.height]), np.array([here.optical]))[:, 0]
        to_bottom = along(here.height - here.z, here.optical - here.tau)
    a, b = reflectance(here.above, t), reflectance(here.below, t)
    return Slants(weight, 1 / np.sqrt(1 + t * t), a, b, whole, along(here.z, here.tau), to_bottom, cones)


def solve(here: Stack, k: float, illumination: str, rule: Rule) -> Answer:
    """phi, phi_0 and X at wave number k [1/length]."""
    slants = _slants(here, k, rule)
    at_once = _out_at_once(here, slants, k, rule)
    up = at_once + _out_later(here, slants)
    down = 0 * up
    if here.height < np.inf:
        turned, slants_turned = _upside_down(here), _slants_upside_down(slants)
        down = _out_at_once(turned, slants_turned, k, rule) + _out_later(turned, slants_turned)
    unscattered = 4 * here.above**2 * up if illumination == "diffuse" else beam(here, here.tau)
    matrix = np.eye(here.z.size) - _scattered(here, slants, k)
    return Answer(np.linalg.solve(matrix, unscattered), unscattered, up, at_once, down)


def beam(here: Stack, tau: Floats) -> Floats:
    """phi_0 of a searchlight at optical depths tau, per photon that arrives [-]."""
    a, b = normal_reflectances(here)
    back = b * np.exp(-(2 * here.optical - tau)) if b else 0.0
    return (1 - a) * (np.exp(-tau) + back) / (1 - a * b * np.exp(-2 * here.optical))


def normal_reflectances(here: Stack) -> tuple[float, float]:
    """Of the two surfaces, at normal incidence [-]."""
    a, b = (((ratio - 1) / (ratio + 1)) ** 2 for ratio in (here.above, here.below))
    return a, b


def _scattered(here: Stack, slants: Slants, k: float) -> Floats:
    """The integral operator on fluences at the nodes, (N, N)."""
    matrix = _by_panel(here, k)
    for mirror in _mirrors(here):
        matrix += _by_panel(here, k, mirror)
    matrix += _slanted(here, slants) * here.weight
    if here.tail.size:
        matrix[:, -1] += _below(here, k)
    return matrix


def _mirrors(here: Stack) -> list[tuple[float, float]]:
    """Twice the depth and the optical depth of the surfaces that reflect."""
    top = [(0.0, 0.0)] if here.above != 1 else []
    return top + ([(2 * here.height, 2 * here.optical)] if here.below != 1 else [])


def _by_panel(here: Stack, k: float, mirror: tuple[float, float] | None = None) -> Floats:
    """mu_s K dz' from every panel, or from its mirror image, to every node, (N, N)."""
    z, tau, z_ends, tau_ends = here.z, here.tau, here.z_ends, here.tau_ends
    if mirror is not None:
        z, tau, z_ends, tau_ends = mirror[0] - z, mirror[1] - tau, mirror[0] - z_ends[::-1], mirror[1] - tau_ends[::-1]
    close = _is_close(here, z_ends, tau_ends)
    own = np.eye(here.panels, dtype=bool) & (mirror is None)
    matrix = np.zeros((here.panels, here.nodes, here.panels, here.nodes))
    far = np.broadcast_to(~(close | own)[:, None, :, None], matrix.shape).reshape(z.size, z.size)
    row, column = np.nonzero(far)
    whole = matrix.reshape(z.size, z.size)
    whole[row, column] = direct(np.abs(here.tau[row] - tau[column]), np.abs(here.z[row] - z[column]), k)
    whole *= here.weight
    target, source = np.nonzero(close & ~own)
    rule = _from_end(here.nodes)
    # The panel's end on the target's side, and whether that is its lower one.
    below = tau_ends[0, source] < here.tau_ends[0, target]
    upwards = np.where(below, 1, 0)
    tau_end, z_end = tau_ends[upwards, source, None], z_ends[upwards, source, None]
    tau_gap = np.abs(here.tau.reshape(-1, here.nodes)[target] - tau_end)
    z_gap = np.abs(here.z.reshape(-1, here.nodes)[target] - z_end)
    tau_length, z_length = np.diff(tau_ends, axis=0)[0, source], np.diff(z_ends, axis=0)[0, source]
    kernel = direct(
        tau_gap[:, :, None] + tau_length[:, None, None] * rule.height,
        z_gap[:, :, None] + z_length[:, None, None] * rule.height,
        k,
    ) * (rule.weight * (here.alpha[source] * tau_length)[:, None, None])
    blocks = kernel @ rule.through
    flip = below if mirror is None else ~below
    blocks[flip] = blocks[flip][:, :, ::-1]
    matrix[target, :, source] = blocks
    if mirror is None:
        matrix[np.arange(here.panels), :, np.arange(here.panels)] = _own(here, k)
    return whole


def _is_close(here: Stack, z_ends: Floats, tau_ends: Floats) -> NDArray[np.bool_]:
    """Whether K varies on a source panel (second axis) faster than its nodes follow, seen from a target panel."""
    close = np.zeros((here.panels, here.panels), bool)
    for own, ends in ((here.z_ends, z_ends), (here.tau_ends, tau_ends)):
        gap = np.maximum(own[0][:, None] - ends[1], ends[0] - own[1][:, None])
        close |= gap < CLOSE * (ends[1] - ends[0])
    return close


def _own(here: Stack, k: float) -> Floats:
    """mu_s K dz' from each panel to its own nodes, (panels, nodes, nodes)."""
    rule = _near(here.nodes)
    tau_length, z_length = (np.diff(ends, axis=0)[0][:, None, None] for ends in (here.tau_ends, here.z_ends))
    kernel = direct(tau_length * rule.height, z_length * rule.height, k) * rule.weight
    return np.einsum("piq,iqj->pij", here.alpha[:, None, None] * tau_length * kernel, rule.through, optimize=True)


def _slanted(here: Stack, slants: Slants) -> Floats:
    """G without the mirror images, (N, N)."""
    a, b, whole = slants.a, slants.b, slants.whole
    series = slants.weight / (1 - a * b * whole**2)
    top = (a * series - (here.above != 1) * slants.weight)[:, None] * slants.from_top
    kernel = (slants.from_top.T @ top).real
    if here.height < np.inf:
        bottom = (b * series - (here.below != 1) * slants.weight)[:, None] * slants.to_bottom
        across = (slants.from_top.T @ ((a * b * whole * series)[:, None] * slants.to_bottom)).real
        kernel += (slants.to_bottom.T @ bottom).real + across + across.T
    return kernel


def _below(here: Stack, k: float) -> Floats:
    """mu_s K dz' from below the last node, per fluence there, to all nodes: the slowest mode goes on for ever."""
    z, tau, weight = here.tail
    decay = np.hypot(here.last.mu_t * float(decay_rate(here.last.alpha)), k)
    mode = weight * np.exp(-decay * (z - here.z[-1]))
    return direct(tau - here.tau[:, None], z - here.z[:, None], k) @ mode


def _out_at_once(here: Stack, slants: Slants, k: float, rule: Rule) -> Floats:
    """X, (N,), of light that goes straight up, or by way of the lower surface."""
    matched = here.above == 1
    t, d_mu = _cones(here, rule.slope + int(0.7 * k * _deepest(here) * min(_steepest(here), 1.5)))
    a, b = reflectance(here.above, t), reflectance(here.below, t)
    ways = [(here.z, here.tau, 1 - a - matched)]
    if here.height < np.inf and here.below != 1:
        ways.append((2 * here.height - here.z, 2 * here.optical - here.tau, (1 - a) * b - matched))
    out = np.zeros_like(here.z)
    for z, tau, passes in ways:
        light = np.exp(-np.multiply.outer(np.sqrt(1 + t * t).real, tau)) * j0(k * np.multiply.outer(t.real, z))
        out += (0.5 * d_mu * passes / np.sqrt(1 + t * t)).real @ light
        if matched:
            out += _out_freely(tau, z, k)
    ray = slice(slants.cones, None)
    a, b, weight = slants.a[ray], slants.b[ray], slants.weight[ray] * slants.mu[ray]
    out += ((weight * (1 - a - matched)) @ slants.from_top[ray]).real
    if here.height < np.inf:
        out += ((weight * ((1 - a) * b - matched) * slants.whole[ray]) @ slants.to_bottom[ray]).real
    return out


def _out_later(here: Stack, slants: Slants) -> Floats:
    """X, (N,), of light that the upper surface has reflected before."""
    a, b, whole = slants.a, slants.b, slants.whole
    passes = slants.weight * slants.mu * (1 - a) * a * b * whole**2 / (1 - a * b * whole**2)
    out = (passes @ slants.from_top).real
    return out + ((passes * b * whole) @ slants.to_bottom).real if here.height < np.inf else out


def _upside_down(here: Stack) -> Stack:
    return here._replace(z=here.height - here.z, tau=here.optical - here.tau, above=here.below, below=here.above)


def _slants_upside_down(slants: Slants) -> Slants:
    return slants._replace(a=slants.b, b=slants.a, from_top=slants.to_bottom, to_bottom=slants.from_top)


def thrown_back(here: Stack, k: float, illumination: str, rule: Rule) -> float:
    """Share of the light that comes out above, never scattered but reflected below, transformed [-]."""
    if here.below == 1:
        return 0.0
    if illumination == "searchlight":
        a, b = normal_reflectances(here)
        back = b * np.exp(-2 * here.optical)
        # MCML counts what comes out of a single pane of clear glass as specular.
        return 0.0 if here.pane else float((1 - a) ** 2 * back / (1 - a * back))
    slants = _slants(here, k, rule)
    a, b, back = slants.a, slants.b, slants.whole**2
    flux = slants.weight * slants.mu**2
    return float(4 * here.above**2 * np.sum(flux * (1 - a) ** 2 * b * back / (1 - a * b * back)).real)


def straight_through(here: Stack, illumination: str, rule: Rule) -> float:
    """Share of the light that comes out below unscattered [-]."""
    if illumination == "searchlight":
        a, b = normal_reflectances(here)
        return float((1 - a) * (1 - b) * np.exp(-here.optical) / (1 - a * b * np.exp(-2 * here.optical)))
    if here.above == here.below == 1:
        return float(2 * expn(3, here.optical))
    slants = _slants(here, 0.0, rule)
    a, b, whole = slants.a, slants.b, slants.whole
    flux = slants.weight * slants.mu**2
    return float(4 * here.above**2 * np.sum(flux * (1 - a) * (1 - b) * whole / (1 - a * b * whole**2)).real)
