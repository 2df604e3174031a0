"""Layers by adding and doubling: reflectance and transmittance without photons, to hold the tracer against.

After Prahl, van Gemert & Welch (Appl. Opt. 32, 1993). All vectors are fluxes: component i is the light that flies in
a narrow bundle of cosines around mu_i. A matrix maps what comes in to what goes out, so totals are sums of components,
and light of one bin of exit angles is the sum of that bin's bundles. The thinnest layer is the exact exponential of
the transport equation on these bundles; doubling it and adding layers is exact too. What is left is the quadrature in
mu: 1e-6 of the total and 2e-5 of any bin with four points in each of 18 bins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from mcml_sim.media.medium import fresnel


@dataclass(frozen=True)
class Answer:
    """What leaves, relative to the incident beam, specular light at the first interface apart."""

    specular: float
    reflected: np.ndarray  # diffuse reflectance by bin of exit angle, (angles,)
    transmitted: np.ndarray  # diffuse transmittance by bin of exit angle, (angles,)
    ballistic: float


@dataclass(frozen=True)
class Bundles:
    """Cosines inside; the last is the normal, with weight 0, where the beam is."""

    mu: np.ndarray
    weights: np.ndarray
    bins: np.ndarray  # bin of exit angle, or -1 where light is totally reflected


def solve(medium, angles=18, nodes=4, diffuse=False):
    """Answer for a Medium whose layers share one index n, between equal media, in `angles` even bins of exit angle.

    `nodes` Gauss points a bin, in the bin's own range of cosines inside. Of cosine-weighted diffuse light, if that is
    what comes in, nothing is told apart as ballistic.
    """
    n = medium.layers[0].n
    if any(layer.n != n for layer in medium.layers) or medium.n_above != medium.n_below:
        raise ValueError("layers must share one index, between equal media")
    relative = n / medium.n_above
    bundles = _bundles(relative, angles, nodes)
    layers = [_layer(layer, bundles) for layer in medium.layers]
    inside = layers[0]
    for below in layers[1:]:
        inside = _add(inside, below)
    surface = fresnel(relative, 1.0, bundles.mu)[0]
    beam = np.zeros(bundles.mu.size)
    beam[-1] = 1 - surface[-1]
    if diffuse:
        beam = (1 - surface) * 2 * relative**2 * bundles.mu * bundles.weights
    return _through_surfaces(inside, surface, bundles, beam)


def _through_surfaces(layer, surface, bundles, beam):
    """Shut the layer between two surfaces that reflect the share `surface` of each bundle from inside."""
    specular = 1 - beam.sum()
    # Light inside that goes down at the top, and up at the bottom: down = beam + S up_top, up = S down_bottom.
    (r_top, r_bottom, t_down, t_up), s = layer, np.diag(surface)
    unit = np.eye(beam.size)
    system = np.block([[unit - s @ r_top, -s @ t_up], [-s @ t_down, unit - s @ r_bottom]])
    down, up = np.split(np.linalg.solve(system, np.concatenate([beam, 0 * beam])), 2)
    reflected = (1 - surface) * (r_top @ down + t_up @ up)
    transmitted = (1 - surface) * (t_down @ down + r_bottom @ up)
    ballistic, transmitted[-1] = transmitted[-1], 0.0  # nothing scatters into the bundle of weight 0
    by_bin = (np.bincount(bundles.bins + 1, flux)[1:] for flux in (reflected, transmitted))
    return Answer(specular, *by_bin, float(ballistic))


def _bundles(relative, angles, nodes):
    """Gauss points in the cosine outside, bin by bin: there light at grazing angles is smooth."""
    edges = np.cos(np.linspace(0, np.pi / 2, angles + 1))
    edges[-1] = 0.0
    outside, steps = _gauss(edges, nodes)
    mu = np.sqrt(1 - (1 - outside**2) / relative**2)
    weights = steps * outside / (relative**2 * mu)
    critical = np.sqrt(max(1 - 1 / relative**2, 0))
    # Light that is totally reflected leaves through no bin; the pieces are as wide as those of 6 degrees.
    trapped, trapped_weights = _gauss(np.linspace(critical, 0, round(15 * critical) + 1), nodes)
    return Bundles(
        np.concatenate([mu, trapped, [1.0]]),
        np.concatenate([weights, trapped_weights, [0.0]]),
        np.concatenate([np.repeat(np.arange(angles), nodes), np.full(trapped.size, -1), [0]]),
    )


def _gauss(falling_edges, nodes):
    """Points and weights of Gauss's rule with `nodes` points in each piece."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    upper, width = falling_edges[:-1, None], -np.diff(falling_edges)[:, None]
    return (upper - width * (1 - x) / 2).ravel(), (width * w / 2).ravel()


def _layer(layer, bundles):
    """Reflection and transmission matrices (r_top, r_bottom, t_down, t_up) of a layer without its surfaces."""
    optical = layer.mu_t * layer.thickness
    doublings = max(0, int(np.ceil(np.log2(2 * optical / bundles.mu.min()))))
    result = _thin(layer, bundles, optical / 2**doublings)
    for _ in range(doublings):
        result = _add(result, result)
    return result


def _thin(layer, bundles, optical):
    """Exact matrices of a layer thin enough for an exponential: d(flux)/d(depth) = loss + gain, down and up."""
    forward, backward = (layer.mu_s / layer.mu_t * _scatter(layer.g, bundles, sign) / bundles.mu for sign in (1, -1))
    loss = np.diag(1 / bundles.mu)
    whole = expm(optical * np.block([[forward - loss, backward], [-backward, loss - forward]]))
    a, b, c, d = (np.vsplit(half, 2)[i] for i in (0, 1) for half in np.hsplit(whole, 2))
    # [down, up] at the bottom = whole [down, up] at the top; solved for what leaves.
    inverse = np.linalg.inv(d)
    return -inverse @ c, b @ inverse, a - b @ inverse @ c, inverse


def _scatter(g, bundles, sign):
    """Share of the light in bundle j that scatters into bundle i, of the same (+1) or the other (-1) half space."""
    mu, w = bundles.mu, bundles.weights
    last = 1 if g == 0 else int(np.ceil(np.log(1e-17) / np.log(abs(g))))
    same, other = (np.zeros((mu.size, mu.size)) for _ in range(2))
    previous, legendre = np.zeros_like(mu), np.ones_like(mu)
    for order in range(last):
        term = 0.5 * (2 * order + 1) * g**order * np.outer(legendre, legendre)
        same += term
        other += (-1) ** order * term
        previous, legendre = legendre, ((2 * order + 1) * mu * legendre - order * previous) / (order + 1)
    total = w @ (same + other)  # 1 but for the quadrature's error: scattering must keep the light
    return w[:, None] * (same if sign == 1 else other) / total


def _add(top, bottom):
    """One layer upon another."""
    (r_top, r_under, t_down, t_up), (s_top, s_under, s_down, s_up) = top, bottom
    unit = np.eye(len(r_top))
    down = np.linalg.solve(unit - r_under @ s_top, t_down)
    up = np.linalg.solve(unit - s_top @ r_under, s_up)
    return r_top + t_up @ s_top @ down, s_under + s_down @ r_under @ up, s_down @ down, t_up @ up
