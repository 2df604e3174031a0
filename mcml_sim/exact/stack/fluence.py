"""Fluence in a stack of layers that scatter isotropically and share one index, at one transverse wave number.

With light that varies as e^{i k x} along the surface, every path of slope t = tan(theta) and azimuth psi has the
amplitude E(Z) = exp(-T sqrt(1 + t^2) + i k Z t cos psi) after a height Z of optical thickness T, whatever layers it
crossed and wherever it was reflected. So the fluence phi obeys, with mu_s phi / 4 pi the source,

    phi(z) = phi_0(z) + int (K + G)(z, z') mu_s(z') phi(z') dz'
    K = (1/2) int_0^1 <E(|z - z'|)> dmu/mu = (1/2) int_0^inf e^{-L cosh v - T sinh v} dv,   L^2 = T^2 + (k Z)^2
    G = (1/2) int_0^1 <[a E(z + z') + b E(2d - z - z') + a b (E(2d + z - z') + E(2d - z + z'))] / D> dmu/mu

where D = 1 - a b E(2d), <> is the mean over psi, a and b are Fresnel's reflectances of the two surfaces from inside,
and d is the height of the stack. K is the inverse-square law transformed: E1(T)/2 at k = 0, and logarithmic at
T = Z = 0. What comes out above of a source at z is

    X(z) = (1/2) int_0^1 <(1 - a) (E(z) + b E(2d - z)) / D> dmu

which without surfaces is e^{-L}/2 - T K (Case & Zweifel, Linear Transport Theory, 1967). Nystroem's method solves it:
K is integrated from each node over near panels by a double-exponential rule. Where a surface reflects, the
mirror image K(z + z') holds all that is singular; what G has beside, light that gets out and light that crosses the
stack, is smooth, and is summed over the directions of `quadrature`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import exp1, expn, j0

from mcml_sim.exact.stack import quadrature
from mcml_sim.exact.stack.quadrature import Complexes, Depths, Nodes, Slants, directions, gauss, reflectance
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import normal_reflectance
from mcml_sim.media.setting import ILLUMINATIONS

CLOSE = 0.5  # of the length of a panel: from nearer than this K is integrated by the double-exponential rule
# Terms of the series, nodes of Gauss's rule, and by how many e-folds its integrand falls. The error of K is 3e-12, and
# 2e-10 where panels have few nodes. Thick plates in which nothing is absorbed show a million times that.
FINE, COARSE = (16, 16, 28.0), (13, 13, 22.0)
MOST_KEPT = 600  # depths of a stack whose pairs are kept: they take 24 bytes times the square of it


class Field(NamedTuple):
    """Light at one wave number; arrays (N,)."""

    phi: dict[str, Floats]  # fluence over the light that arrives, under each illumination [-]
    unscattered: dict[str, Floats]  # fluence phi_0 of unscattered light [-]
    up: Floats  # response X of the light that comes out above
    up_at_once: Floats  # part of X without the light that the upper surface had reflected before
    down: Floats  # response X of the light that comes out below


def direct(optical: Floats, height: Floats, k: float, panel: int = quadrature.FEW) -> Floats:
    """Return K at optical thicknesses T > 0 and heights Z, of one shape, for panels of so many nodes."""
    terms, nodes, fallen = FINE if panel >= quadrature.FEW else COARSE
    across = k * height
    length = np.sqrt(optical**2 + across**2)
    # a e^v + b e^-v is the exponent
    a = 0.5 * (length + optical)
    b = 0.25 * across**2 / a
    value = np.zeros_like(a)
    close, seen = a < 1.0, (a >= 1.0) & (length < quadrature.DARK)
    value[close] = _direct_close(a[close], b[close], terms)
    value[seen] = _direct_far(a[seen], b[seen], nodes, fallen)
    return value


def _direct_close(a: Floats, b: Floats, terms: int) -> Floats:
    """Return (1/2) sum over m of (-b)^m/m! E_{m+1}(a)."""
    decay, integral = np.exp(-a), exp1(a)
    total, power, term, minus = integral.copy(), np.ones_like(a), np.empty_like(a), -b
    for m in range(1, terms):
        integral *= a
        np.subtract(decay, integral, out=integral)
        integral *= 1.0 / m
        power *= minus
        power *= 1.0 / m
        total += np.multiply(power, integral, out=term)
    return 0.5 * total


def _direct_far(a: Floats, b: Floats, nodes: int, fallen: float) -> Floats:
    """Return K by Gauss's rule in v."""
    largest = a + b + fallen
    v = np.log((largest + np.sqrt(largest**2 - 4 * a * b)) / (2 * a))
    total, growth, rest, minus = np.zeros_like(a), np.empty_like(a), np.empty_like(a), -a
    for x, weight in zip(*gauss(nodes), strict=True):
        np.exp(np.multiply(x, v, out=growth), out=growth)
        np.divide(b, growth, out=rest)
        growth *= minus
        growth -= rest
        total += np.multiply(weight, np.exp(growth, out=growth), out=growth)
    return 0.5 * v * total


def solve(here: Depths, k: float, rule: Nodes) -> Field:
    """Solve for phi, phi_0 and X at wave number k [1/length]. Both illuminations share all steps but the last."""
    if not here.panels:
        none = np.empty(0)
        return Field(dict.fromkeys(ILLUMINATIONS, none), dict.fromkeys(ILLUMINATIONS, none), none, none, none)
    slants = directions(here, k, rule)
    at_once = _out_at_once(here, slants, k, rule)
    up = at_once + _out_later(here, slants)
    down = 0 * up
    if here.height < np.inf:
        turned = replace(here, z=here.height - here.z, tau=here.optical - here.tau, above=here.below, below=here.above)
        slanted = slants._replace(a=slants.b, b=slants.a, from_top=slants.to_bottom, to_bottom=slants.from_top)
        down = _out_at_once(turned, slanted, k, rule) + _out_later(turned, slanted)
    unscattered = {"searchlight": beam(here, here.tau), "diffuse": 4 * here.above**2 * up}
    matrix = np.eye(here.z.size) - _scattered(here, slants, k)
    phi = np.linalg.solve(matrix, np.column_stack(list(unscattered.values())))
    return Field(dict(zip(unscattered, phi.T, strict=True)), unscattered, up, at_once, down)


def beam(here: Depths, tau: Floats) -> Floats:
    """Return phi_0 of a searchlight at optical depths tau, per photon that arrives [-]."""
    a, b = normal_reflectances(here)
    back = b * np.exp(-(2 * here.optical - tau)) if b else 0.0
    return (1 - a) * (np.exp(-tau) + back) / (1 - a * b * np.exp(-2 * here.optical))


def normal_reflectances(here: Depths) -> tuple[float, float]:
    """Return the reflectances of the two surfaces at normal incidence [-]."""
    return normal_reflectance(here.above, 1.0), normal_reflectance(here.below, 1.0)


def _scattered(here: Depths, slants: Slants, k: float) -> Floats:
    """Return the integral operator on fluences at the nodes, (N, N)."""
    by_panel = _kept_by_panel if here.z.size <= MOST_KEPT else _by_panel
    matrix = by_panel(here)(k)
    for mirror in _mirrors(here):
        matrix += by_panel(here, mirror)(k)
    matrix += _slanted(here, slants) * here.weight
    if here.tail.size:  # below the last node, per fluence there: the slowest mode never ends
        z, tau, weight = here.tail
        decay = np.hypot(here.last.mu_t * quadrature.slowest(here.last.alpha), k)
        mode = weight * np.exp(-decay * (z - here.z[-1]))
        matrix[:, -1] += direct(tau - here.tau[:, None], z - here.z[:, None], k, here.nodes) @ mode
    return matrix


def _mirrors(here: Depths) -> list[tuple[float, float]]:
    """Return twice the depth and the optical depth of the surfaces that reflect."""
    top = [(0.0, 0.0)] if here.above != 1 else []
    return top + ([(2 * here.height, 2 * here.optical)] if here.below != 1 else [])


def _by_panel(here: Depths, mirror: tuple[float, float] | None = None) -> Callable[[float], Floats]:
    """Return a function of k: mu_s K dz' from every panel, or from its mirror image, to every node, (N, N)."""
    z, tau, z_ends, tau_ends = here.z, here.tau, here.z_ends, here.tau_ends
    if mirror is not None:
        z, tau, z_ends, tau_ends = mirror[0] - z, mirror[1] - tau, mirror[0] - z_ends[::-1], mirror[1] - tau_ends[::-1]
    # Whether K varies on a source panel (second axis) faster than its nodes follow, from a target panel.
    close = np.zeros((here.panels, here.panels), bool)
    for targets, ends in ((here.z_ends, z_ends), (here.tau_ends, tau_ends)):
        gap = np.maximum(targets[0][:, None] - ends[1], ends[0] - targets[1][:, None])
        close |= gap < CLOSE * (ends[1] - ends[0])
    own = np.eye(here.panels, dtype=bool) & (mirror is None)
    far, shape = ~(close | own), (-1, here.nodes)
    row, column = np.nonzero(np.triu(np.repeat(np.repeat(far | far.T, here.nodes, axis=0), here.nodes, axis=1)))
    (target, source), (itself, _) = np.nonzero(close & ~own), np.nonzero(own)
    end, inside = quadrature.near_end(here.nodes), quadrature.near_node(here.nodes)
    upwards = inside.height[:, : inside.height.shape[1] // 2]
    # Whether the panel's end on the target's side is its lower one.
    below = tau_ends[0, source] < here.tau_ends[0, target]
    flip = below if mirror is None else ~below
    pieces = []  # optical thicknesses, and heights: all of K in one call, of which small ones take half of the time
    for at, image, ends in ((here.tau, tau, tau_ends), (here.z, z, z_ends)):
        gap, length = at.reshape(shape)[target] - ends[below.astype(int), source, None], np.diff(ends, axis=0)[0]
        near = np.abs(gap)[:, :, None] + length[source, None, None] * end.height
        pieces.append([np.abs(at[row] - image[column]), near, length[itself, None, None] * upwards])
    optical, height = (np.concatenate([piece.ravel() for piece in each]) for each in pieces)
    starts = np.cumsum([piece.size for piece in pieces[0]])[:2]
    _, of_near, of_own = (piece.shape for piece in pieces[0])
    weight = (here.alpha * np.diff(tau_ends, axis=0)[0])[:, None, None]
    near_weight, own_weight = end.weight * weight[source], inside.weight * weight[itself]

    def at_wave(k: float) -> Floats:
        apart, near, above = np.split(direct(optical, height, k, here.nodes), starts)
        matrix = np.zeros((here.panels, here.nodes, here.panels, here.nodes))
        whole = matrix.reshape(here.z.size, here.z.size)
        whole[row, column] = whole[column, row] = apart
        whole *= here.weight
        blocks = (near.reshape(of_near) * near_weight) @ end.through
        blocks[flip] = blocks[flip][:, :, ::-1]
        matrix[target, :, source] = blocks
        # What lies below a node lies above its mirror image in the panel's middle.
        above = above.reshape(of_own)
        kernel = np.concatenate([above, above[:, ::-1]], axis=2) * own_weight
        matrix[itself, :, itself] = (kernel.swapaxes(0, 1) @ inside.through).swapaxes(0, 1)
        return whole

    return at_wave


_kept_by_panel = lru_cache(maxsize=quadrature.KEPT)(_by_panel)


def _slanted(here: Depths, slants: Slants) -> Floats:
    """Return G without the mirror images, (N, N)."""
    a, b, whole = slants.a, slants.b, slants.whole
    series = slants.weight / (1 - a * b * whole**2)
    kernel = _real_product(slants.from_top, a * series - (here.above != 1) * slants.weight, slants.from_top)
    if here.height < np.inf:
        kernel += _real_product(slants.to_bottom, b * series - (here.below != 1) * slants.weight, slants.to_bottom)
        across = _real_product(slants.from_top, a * b * whole * series, slants.to_bottom)
        kernel += across + across.T
    return kernel


def _real_product(left: Complexes, weight: Complexes, right: Complexes) -> Floats:
    """Return Re(left^T diag(weight) right), (N, N): in half the time where weights are real, a quarter if squared."""
    if np.any(weight.imag):
        return np.asarray((left.T @ (weight[:, None] * right)).real)
    if right is left and np.all(weight.real <= 0):
        roots = np.sqrt(-weight.real)[:, None]
        real, imaginary = roots * left.real, roots * left.imag
        return np.asarray(imaginary.T @ imaginary - real.T @ real)
    weights = np.concatenate([weight.real, -weight.real])[:, None]
    both = np.concatenate([left.real, left.imag])
    return np.asarray(both.T @ (weights * np.concatenate([right.real, right.imag])))


def _out_at_once(here: Depths, slants: Slants, k: float, rule: Nodes) -> Floats:
    """Return X, (N,), of light that goes straight up, or by way of the lower surface."""
    matched = here.above == 1
    phase = k * quadrature.deepest(here) * min(quadrature.steepest(here), 1.5)
    t, d_mu = quadrature.cones(here, int(rule.slope * (1 + quadrature.SLOPES_A_RADIAN * phase)))
    a, b = reflectance(here.above, t), reflectance(here.below, t)
    ways = [(here.z, here.tau, 1 - a - matched)]
    if here.height < np.inf and here.below != 1:
        ways.append((2 * here.height - here.z, 2 * here.optical - here.tau, (1 - a) * b - matched))
    out = np.zeros_like(here.z)
    for z, tau, passes in ways:
        light = np.exp(-np.multiply.outer(np.sqrt(1 + t * t).real, tau)) * j0(k * np.multiply.outer(t.real, z))
        out += (0.5 * d_mu * passes / np.sqrt(1 + t * t)).real @ light
        if matched:
            out += 0.5 * np.exp(-np.hypot(tau, k * z)) - tau * direct(tau, z, k, here.nodes)  # X without surfaces
    ray = slice(slants.cones, None)
    a, b, weight = slants.a[ray], slants.b[ray], slants.weight[ray] * slants.mu[ray]
    out += ((weight * (1 - a - matched)) @ slants.from_top[ray]).real
    if here.height < np.inf:
        out += ((weight * ((1 - a) * b - matched) * slants.whole[ray]) @ slants.to_bottom[ray]).real
    return out


def _out_later(here: Depths, slants: Slants) -> Floats:
    """Return X, (N,), of light that the upper surface has reflected before."""
    a, b, whole = slants.a, slants.b, slants.whole
    passes = slants.weight * slants.mu * (1 - a) * a * b * whole**2 / (1 - a * b * whole**2)
    out = (passes @ slants.from_top).real
    return out + ((passes * b * whole) @ slants.to_bottom).real if here.height < np.inf else out


def thrown_back(here: Depths, k: float, illumination: str, rule: Nodes) -> float:
    """Return the share of light that comes out above, reflected below but never scattered, transformed [-]."""
    if here.below == 1:
        return 0.0
    if illumination == "searchlight":
        top, bottom = normal_reflectances(here)
        once = bottom * np.exp(-2 * here.optical)
        # MCML counts what comes out of a single pane of clear glass as specular.
        return 0.0 if here.pane else float((1 - top) ** 2 * once / (1 - top * once))
    slants = directions(here, k, rule)
    a, b, back = slants.a, slants.b, slants.whole**2
    flux = slants.weight * slants.mu**2
    return float(4 * here.above**2 * np.sum(flux * (1 - a) ** 2 * b * back / (1 - a * b * back)).real)


def straight_through(here: Depths, illumination: str, rule: Nodes) -> float:
    """Return the share of the light that comes out below unscattered [-]."""
    if illumination == "searchlight":
        top, bottom = normal_reflectances(here)
        left = np.exp(-here.optical)
        return float((1 - top) * (1 - bottom) * left / (1 - top * bottom * left**2))
    if here.above == here.below == 1:
        return float(2 * expn(3, here.optical))
    slants = directions(here, 0.0, rule)
    a, b, whole = slants.a, slants.b, slants.whole
    flux = slants.weight * slants.mu**2
    return float(4 * here.above**2 * np.sum(flux * (1 - a) * (1 - b) * whole / (1 - a * b * whole**2)).real)


def net_flux(here: Depths, phi: Floats, tau: Floats, illumination: str, rule: Nodes) -> Floats:
    """Return the net flux downwards through interfaces at optical depths `tau`, k = 0, over what arrives [-].

    phi  (N,) fluences at the nodes;  tau  (interfaces,)

    Light that was not scattered, and that of the sources: one at optical depth T sends E2(|tau - T|) / 2 straight
    through (Case & Zweifel, Linear Transport Theory, 1967). Both surfaces' reflections are summed as those of G.
    """
    slants, finite = directions(here, 0.0, rule), np.isfinite(here.height)
    a, b, whole, weight = slants.a, slants.b, slants.whole, slants.weight * slants.mu
    down = np.exp(-np.multiply.outer(tau, 1 / slants.mu))
    up = np.exp(-np.multiply.outer(here.optical - tau, 1 / slants.mu)) if finite else np.zeros_like(down)
    series = weight / (1 - a * b * whole**2)
    if illumination == "searchlight":
        top, bottom = normal_reflectances(here)
        back = bottom * np.exp(tau - 2 * here.optical)
        flux = (1 - top) * (np.exp(-tau) - back) / (1 - top * bottom * np.exp(-2 * here.optical))
    else:
        once = series * slants.mu * (1 - a)
        flux = 4 * here.above**2 * ((here.above != 1) * down @ once - up @ (once * b * whole)).real
        flux += 2 * expn(3, tau) if here.above == 1 else 0.0
    sources = here.weight * phi
    apart = np.subtract.outer(tau, here.tau)
    passes = np.sign(apart) * expn(2, np.abs(apart))
    for sign, (_, mirror) in zip((1, -1) if here.above != 1 else (-1,), _mirrors(here), strict=False):
        passes += sign * expn(2, np.abs(mirror - np.add.outer(tau, here.tau)))
    from_top = slants.from_top @ sources
    from_bottom = slants.to_bottom @ sources if finite else np.zeros_like(whole)
    across = a * b * whole * series
    falls = (a * series - (here.above != 1) * weight) * from_top + across * from_bottom
    rises = (b * series - (here.below != 1) * weight) * from_bottom + across * from_top
    return flux + 0.5 * passes @ sources + (down @ falls - up @ rises).real
