"""Closed forms of a stack of layers: light scattered once, exactly, and all of it by the fitted `stack_law`.

    from mcml_sim import Layer, Medium
    from profilefit.scenes import layers

    skin = Medium((Layer(1.4, 0.2, 48.0, 0.9, 0.25), Layer(1.4, 0.02, 32.0, 0.9)))
    layers.single_scattering(skin, cos_in=1.0, cos_out=0.5, azimuth=0.0)

Single scattering is a sum over the layers, for any indices and any phase functions.
Light of one direction outside has one direction in each layer: down, and up where an interface below threw it back.
What arrives of it at a depth is a product of Beer's and Fresnel's factors, and so is, by reciprocity, what reaches the
eye from there. Of a layer of index n that scatters a share a = mu_s / mu_t, with cosines mu_i and mu_o inside, t
optical depths below its top

    L = a (n_above / n)^2  cos_in / (mu_i mu_o)  sum_ab p(c_ab) int in_a(t) out_b(t) dt,    a, b down or up,

in_down = D e^{-t / mu_i}, say. With one index in all layers and no surface below that is

    L = T_i T_o / n^2  cos_in / (mu_i mu_o)  sum_j a_j p_j e^{-b t_j} (1 - e^{-b d_j}) / b,   b = 1/mu_i + 1/mu_o,

t_j and d_j the optical depths above and inside layer j (P. Hanrahan and W. Krueger, Reflection from layered surfaces
due to subsurface scattering, SIGGRAPH 1993, for one layer).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import exact
from mcml_sim.media.arrays import Floats, checked_numbers, checked_range, require, require_one_shape
from mcml_sim.media.medium import Layer, Medium, fresnel
from mcml_sim.media.phase import HenyeyGreenstein, Phase
from profilefit.errors import InputError
from profilefit.fitting.solver import differences, solve
from profilefit.recipes.stack.fit import NODES
from profilefit.recipes.stack.fit import stack_law as stack_law

PLATES = (0.2, 0.6, 1.5, 4.0, 8.0)  # thicknesses of a part's core that its transmittance is fitted at [mfp]
STEP = 1e-6  # of ln of a constant, for derivatives
LEAST = np.nextafter(0.0, 1.0)  # cosine > 0


class Beam(NamedTuple):
    """Light of one direction outside, in one layer: shares of the power that arrives on the surface [-].

    sine, cosine  of its angle to the normal in the layer; sine is above 1 where no light of that direction gets there
    down, up      share that passes the layer's top on its way down, and its bottom on its way up, as often as it does
    """

    sine: Floats
    cosine: Floats
    down: Floats
    up: Floats


def single_scattering(
    medium: Medium, cos_in: ArrayLike, cos_out: ArrayLike, azimuth: ArrayLike, phases: Sequence[Phase] | None = None
) -> float | Floats:
    """Return radiance outside [1/sr] of light scattered once, for unit irradiance across the beam. All broadcast.

    cos_in, cos_out  cosines of the beam and of the eye's ray to the normal, outside, in (0, 1] [-]
    azimuth          between the planes of the two propagation directions; 0 is onward [rad]
    phases           one for each layer, by default Henyey and Greenstein's with the layer's g

    InputError on other arguments. Exact, to rounding.
    """
    require(isinstance(medium, Medium), "medium", "a mcml_sim.Medium", medium)
    if phases is None:  # of clear glass any
        phases = [HenyeyGreenstein(layer.g if layer.mu_s > 0 else 0.0) for layer in medium.layers]
    given = tuple(phases)
    are_phases = len(given) == len(medium.layers) and all(isinstance(one, Phase) for one in given)
    require(are_phases, "phases", f"{len(medium.layers)} phase functions, one a layer", phases)
    into = checked_range("cos_in", cos_in, "a cosine in (0, 1]", LEAST, 1.0)
    out = checked_range("cos_out", cos_out, "a cosine in (0, 1]", LEAST, 1.0)
    turn = checked_numbers("azimuth", azimuth, "a finite angle")
    if not np.all(np.isfinite(turn)):
        raise InputError("azimuth must be a finite angle, got one that is not")
    require_one_shape(cos_in=into, cos_out=out, azimuth=turn)
    arriving, leaving = beams(medium, into), beams(medium, out)
    radiance = np.zeros(np.broadcast_shapes(into.shape, out.shape, turn.shape))
    for layer, phase, one, other in zip(medium.layers, given, arriving, leaving, strict=True):
        if layer.mu_s > 0:
            own = _of_layer(layer, phase, one, other, np.cos(turn))
            radiance = radiance + own * into * (medium.n_above / layer.n) ** 2
    return float(radiance) if radiance.ndim == 0 else radiance


class Plate(NamedTuple):
    """Light through a part of a thickness D that has a stack's upper layers on both sides, over what arrives.

    T = strength / sinh(rate (D - skins) + offset)

    Attributes:
        rate: decay rate of the last layer [1/length], exact far inside.
        skins: thickness of all upper layers [length].
        strength: fitted [-].
        offset: fitted [-].
        error: largest relative error of T at the thicknesses that the constants were fitted at [-].
    """

    rate: float
    skins: float
    strength: float
    offset: float
    error: float

    def transmitted(self, thickness: ArrayLike) -> Floats:
        """Return T [-] through a part of that thickness [length]; a thinner one than its skins counts as these."""
        depth = self.rate * np.maximum(np.asarray(thickness, float) - self.skins, 0.0) + self.offset
        return self.strength / np.sinh(depth)


@lru_cache(maxsize=32)
def plate_of(medium: Medium, illumination: str = "diffuse") -> Plate:
    """Fit the two constants of a stack to the exact transmittance of five plates, in about a second.

    The error of T is below .5 % where the last layer is no darker than alpha = 0.8. Darker layers let little through.
    For example, a plate of two mean free paths of alpha = 0.6 transmits 1 % of the light, with an error of 3 % of that.
    InputError as of `exact.solve`.
    """
    *upper, core = medium.layers
    skins = 2.0 * sum(layer.thickness for layer in upper)
    rate = float(exact.decay_rate(core.alpha)) / core.mfp
    depth = core.mfp * np.array(PLATES)

    def solved(inner: float) -> float:
        layers = (*upper, replace(core, thickness=inner), *reversed(upper))
        found = exact.solve(Medium(layers, medium.n_above, medium.n_above), illumination, NODES).transmittance
        assert found is not None  # there is something below
        return found

    known = np.log([solved(float(inner)) for inner in depth])

    def residual(at: Floats) -> Floats:
        return at[0] - np.log(np.sinh(rate * depth + np.exp(at[1]))) - known

    best = solve(differences(residual, STEP), np.array([known[0], 0.0]))
    strength, offset = map(float, np.exp(best.parameters))
    return Plate(rate, skins, strength, offset, float(np.max(np.abs(np.expm1(best.residuals)))))


def beams(medium: Medium, cosine: Floats) -> list[Beam]:
    """Return light that arrives at a cosine outside, by layer, as interfaces divide it; reflections of any order."""
    indices = [medium.n_above, *(layer.n for layer in medium.layers)]
    if not medium.is_half_space:
        indices.append(medium.n_below)
    n0 = medium.n_above
    sines = [n0 * np.sqrt((1.0 - cosine) * (1.0 + cosine)) / n for n in indices]
    # n^2 mu^2 = n^2 - n0^2 + n0^2 mu0^2: of 1 - sine^2 light that grazes the surface leaves few digits.
    squared = [(n - n0) * (n + n0) + (n0 * cosine) ** 2 for n in indices[1:]]
    cosines = [cosine, *(np.sqrt(np.maximum(one, 0.0)) / n for one, n in zip(squared, indices[1:], strict=True))]
    mirror = [
        np.where(cosines[j + 1] > 0.0, fresnel(indices[j], indices[j + 1], cosines[j])[0], 1.0)
        for j in range(len(indices) - 1)
    ]
    # Shares that cross each layer: 0 where it is infinite, or no light of that direction gets there.
    kept = [
        np.where(mu > 0, np.exp(-_depth(layer) / np.where(mu > 0, mu, 1.0)), 0.0)
        for layer, mu in zip(medium.layers, cosines[1:], strict=False)
    ]
    # Of light at a layer's bottom, and at its top on its way down, what comes up there: from below upwards.
    below = [np.zeros_like(cosine)] * len(medium.layers)
    for j in reversed(range(len(medium.layers))):
        if j + 1 < len(mirror):
            deeper = kept[j + 1] ** 2 * below[j + 1] if j + 1 < len(kept) else np.zeros_like(cosine)
            below[j] = mirror[j + 1] + (1.0 - mirror[j + 1]) * _passed(mirror[j + 1], deeper) * deeper
    found, arrives = [], np.ones_like(cosine)
    for j in range(len(medium.layers)):
        down = arrives * _passed(mirror[j], kept[j] ** 2 * below[j])
        arrives = down * kept[j]
        found.append(Beam(sines[j + 1], cosines[j + 1], down, arrives * below[j]))
    return found


def _passed(mirror: Floats, deeper: Floats) -> Floats:
    """Return the share that passes an interface, with what goes to and fro between it and what lies deeper."""
    return np.where(mirror < 1.0, (1.0 - mirror) / np.where(mirror < 1.0, 1.0 - mirror * deeper, 1.0), 0.0)


def _depth(layer: Layer) -> float:
    """Return the optical depth of a layer [-], which may be infinite."""
    return layer.mu_t * layer.thickness if np.isfinite(layer.thickness) else np.inf


def _of_layer(layer: Layer, phase: Phase, one: Beam, other: Beam, turn: Floats) -> Floats:
    """Return a / (mu_i mu_o) sum_ab p int in out dt [1/sr]."""
    reached = (one.cosine > 0) & (other.cosine > 0)
    into, out = np.where(reached, one.cosine, 1.0), np.where(reached, other.cosine, 1.0)
    depth = _depth(layer)
    across, along = np.where(reached, one.sine * other.sine, 0.0) * turn, into * out
    back, onward = (np.clip(across + sign * along, -1.0, 1.0) for sign in (-1.0, 1.0))
    turned = (one.down * other.down + one.up * other.up) * phase.pdf(back) * _spent(depth, 1.0 / into + 1.0 / out)
    total = turned
    if np.isfinite(depth):
        # Down on one way and up on the other: e^{-t / mu_i - (d - t) / mu_o}.
        least = np.exp(-depth / np.maximum(into, out))
        straight = least * _spent(depth, np.abs(1.0 / into - 1.0 / out))
        total = turned + (one.down * other.up + one.up * other.down) * phase.pdf(onward) * straight
    return np.where(reached, layer.mu_s / layer.mu_t * total / along, 0.0)


def _spent(depth: float, rate: Floats) -> Floats:
    """Return int_0^depth e^{-rate t} dt, also where the rate is 0, or the depth infinite."""
    if np.isinf(depth):
        return 1.0 / rate
    fast = np.where(rate > 0, rate, 1.0)
    return np.where(rate > 0, -np.expm1(-fast * depth) / fast, depth)
