"""Fit the law of a stack to its exact light, and what the constants depend on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.exact import half_space
from mcml_sim.exact.stack.solution import MAX_LAYERS
from mcml_sim.media.checks import shown
from mcml_sim.media.setting import require_illumination
from profilefit.errors import InputError
from profilefit.fitting.estimate import degrees_of_freedom, scaled_inverse
from profilefit.fitting.solver import Optimum, solve
from profilefit.laws.refracting_rational import REFRACTING
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.recipes import catalogue

Floats = NDArray[np.float64]
THIN, THICK, LONGEST = 0.1, 3.0, 12.0  # thicknesses that are fitted: mean free paths; decay lengths; mean free paths
COUNT = 5
INSIDE = (0.6, 1.0, 1.6)  # thicknesses of a layer below another, in its own: there it has no other
NEAREST = 0.01  # radius [mfp of the first layer]
FARTHEST, LONGEST_DECAY = 30.0, 300.0  # radius, in decay lengths of so many mean free paths at most
RADII = 100
LAST_SHARE = 0.995
OF_A = 3.0  # weight of the reflectance beside that of a whole profile
TIMID = 1e-3  # weight of a constant's distance from its start: those that nothing depends on stay there
# ln, but of w its logit, and u a multiple of the least one with which A is monotone in d.
START = (0.0, 0.0, 0.2, 0.2, -2.0, -2.0, -1.0, 0.0, -2.0)
STARTS, SPREAD, SEED = 5, 0.8, 1
LOWEST = 0.95  # of 2 kappa l: how far below 0 u may go


NODES = exact.Nodes(12, 16, 16, 10)  # of the exact light: right to a tenth of the law's error and better


class Interface(NamedTuple):
    """What one interface of a stack was fitted to, and how that ended.

    law        of the stack below the surface of its upper layer;  thicknesses  (m,) of that layer, fitted at [length]
    best       the optimum taken, in unbounded parameters;  found  those of every start
    lights     of each thickness radii [length], R_d, weights and A;  is_below  whether layers lie above it
    """

    law: StackLaw
    medium: Medium
    is_below: bool
    thicknesses: Floats
    lights: list[tuple[Floats, ...]]
    best: Optimum
    found: tuple[Optimum, ...]


def stack_law(medium: Medium, illumination: str = "searchlight") -> StackLaw | LayerLaw:
    """The law of a stack of layers of one index that scatter isotropically, fitted to its exact light.

    medium        layers from the surface down, the last one infinite; one n in [1, 1.6] over that above, g = 0
    illumination  "searchlight" or "diffuse"

    A half space has a law as it is. Of two layers the thickness of the first is an argument; of more, those below the
    first have the ones that they have. InputError on other media. Seconds to a minute, most of it for the exact light.
    """
    law, _ = fitted(medium, illumination)
    return law


def fitted(medium: Medium, illumination: str) -> tuple[StackLaw | LayerLaw, tuple[Interface, ...]]:
    """The law, and the fit at each interface from the surface down; none of a half space."""
    require(medium)
    require_illumination(illumination)
    setting = Setting(illumination, n=medium.layers[0].n / medium.n_above)
    hazard = catalogue.load("hazard", setting=setting)
    law: StackLaw | LayerLaw | None = None
    done: list[Interface] = []
    for place in reversed(range(len(medium.layers))):
        layer = medium.layers[place]
        top = LayerLaw(setting, hazard, layer.alpha, layer.mfp)
        if law is None:
            law = top
            continue
        here = Medium(medium.layers[place:], medium.n_above)
        d = _thicknesses(layer, is_below=place > 0)
        lights = [light_of(here, each, illumination) for each in d]
        best, found = _searched(top, law, d, lights)
        law = _law_of(best.parameters, top, law, layer.thickness)
        done.insert(0, Interface(law, here, place > 0, d, lights, best, found))
    assert law is not None  # a medium has a layer
    return law, tuple(done)


def errors(one: Interface) -> dict[str, dict[str, float | None]]:
    """Errors of an interface's constants, by the names that records have for them; None where there can be none.

    statistical     none: exact light has no photons
    discretisation  what a refit to light of fewer nodes changes
    model           none: of a law that fits at each thickness in its own way no likelihood is known
    misfit          s^2 (J^T J)^-1, as if residuals were independent
    jackknife       refits without one thickness after the other
    """
    top, below, thickness = one.law.top, one.law.below, one.law.thickness

    def refitted(d: Floats, lights: list[tuple[Floats, ...]]) -> Floats:
        return _vector(_law_of(_solved(one.best.parameters, top, below, d, lights).parameters, top, below, thickness))

    coarse = [light_of(one.medium, d, one.law.setting.illumination, NODES.fewer) for d in one.thicknesses]
    own, fewer = _vector(one.law), refitted(one.thicknesses, coarse)
    count = len(one.thicknesses)
    left_out = np.array(
        [refitted(np.delete(one.thicknesses, i), one.lights[:i] + one.lights[i + 1 :]) for i in range(count)]
    )
    jackknife = np.sqrt((count - 1) * np.mean((left_out - left_out.mean(axis=0)) ** 2, axis=0))
    with jax.enable_x64(True):
        slopes = jax.jacfwd(lambda at: _vector(_made(at, top, below, thickness)))(jnp.asarray(one.best.parameters))
    inverse = scaled_inverse(one.best.jacobian.T @ one.best.jacobian)
    spread = np.asarray(slopes) @ (one.best.cost / degrees_of_freedom(one.best) * inverse) @ np.asarray(slopes).T
    found = zip(np.abs(fewer - own), np.sqrt(np.diag(spread)), jackknife, strict=True)
    return {
        name: {
            "statistical_error": None,
            "discretisation_error": float(discretisation),
            "model_error": None,
            "misfit_error": float(misfit),
            "jackknife_error": float(jack),
        }
        for name, (discretisation, misfit, jack) in zip(StackLaw.constant_names(), found, strict=True)
    }


def quality(one: Interface) -> dict[str, list[float]]:
    """rel, ks and the relative error of A at thicknesses that were not fitted, between those that were [length]."""
    d = np.sqrt(one.thicknesses[:-1] * one.thicknesses[1:])
    found: dict[str, list[float]] = {"thickness": d.tolist(), "rel": [], "ks": [], "delta_A": []}
    for each in d:
        light = _solution(one.medium, each, one.law.setting.illumination, NODES)
        r = _radii(one.medium)
        share = np.asarray(light.cdf(r))
        near = r[share <= LAST_SHARE]
        relative = np.asarray(one.law.profile(near, each)) / np.asarray(light.profile(near)) - 1.0
        found["rel"].append(float(np.mean(np.abs(relative))))
        found["ks"].append(float(np.max(np.abs(np.asarray(one.law.cdf(r, each)) - share))))
        found["delta_A"].append(float(np.asarray(one.law.total(each)) / light.reflectance - 1.0))
    return found


def _solution(medium: Medium, d: float, illumination: str, nodes: exact.Nodes) -> exact.Solution:
    """Its light under a first layer of another thickness."""
    first, *others = medium.layers
    return exact.solve(Medium((replace(first, thickness=d), *others), medium.n_above), illumination, nodes)


def _radii(medium: Medium) -> Floats:
    """As far as light of its slowest layer goes [length]."""
    slowest = max(
        min(layer.mfp / max(float(half_space.decay_rate(layer.alpha)), 1e-12), LONGEST_DECAY * layer.mfp)
        for layer in medium.layers
    )
    return np.geomspace(NEAREST * medium.layers[0].mfp, FARTHEST * slowest, RADII)


def _vector(law: StackLaw):
    return jnp.stack([jnp.asarray(getattr(law, name)) for name in StackLaw.constant_names()])


def require(medium: Medium) -> None:
    if not isinstance(medium, Medium):
        raise InputError(f"medium must be a mcml_sim.Medium, got {shown(medium)}")
    if not medium.is_half_space:
        raise InputError(f"the last layer must be infinitely thick, got {medium.layers[-1].thickness:g}")
    if len(medium.layers) > MAX_LAYERS:
        raise InputError(f"a law of a stack must have at most {MAX_LAYERS} layers, got {len(medium.layers)}")
    index = medium.layers[0].n / medium.n_above
    if not (index == 1.0 or REFRACTING.holds(index)):
        raise InputError(f"n over that above must be 1 or in {REFRACTING} for a law of a stack, got {index:g}")
    for number, layer in enumerate(medium.layers, start=1):
        if not layer.mu_t > 0:
            raise InputError(f"layers must scatter or absorb, got mu_a = mu_s = 0 in layer {number}")
        if layer.g != 0:
            raise InputError(f"layers must scatter with g = 0 for a law of a stack, got {layer.g:g} in layer {number}")
        if layer.n != medium.layers[0].n:
            got = f"{medium.layers[0].n:g} in layer 1 and {layer.n:g} in layer {number}"
            raise InputError(f"layers must have one n for a law of a stack, got {got}")


def _thicknesses(layer: Layer, is_below: bool) -> Floats:
    """Those to fit at, the layer's own among them [length]."""
    if is_below:
        return layer.thickness * np.array(INSIDE)
    rate = float(half_space.decay_rate(layer.alpha))
    last = min(THICK / max(rate, THICK / LONGEST), LONGEST)
    return np.unique(np.append(layer.mfp * np.geomspace(THIN, last, COUNT), layer.thickness))


def light_of(medium: Medium, d: float, illumination: str, nodes: exact.Nodes = NODES) -> tuple[Floats, ...]:
    """Under a first layer of thickness d: radii [length], R_d there, weights of the radii, and A."""
    light, r = _solution(medium, d, illumination, nodes), _radii(medium)
    seen = np.asarray(light.cdf(r)) <= LAST_SHARE
    value = np.where(seen, np.asarray(light.profile(r)), 1.0)
    return r, value, seen / np.count_nonzero(seen), np.asarray(light.reflectance)


def _searched(
    top: LayerLaw, below: LayerLaw | StackLaw, d: Floats, lights: list[tuple[Floats, ...]]
) -> tuple[Optimum, tuple[Optimum, ...]]:
    """The best optimum of several starts, and all."""
    random = np.random.default_rng(SEED)
    starts = [np.array(START), *(START + SPREAD * random.standard_normal((STARTS - 1, len(START))))]
    found = tuple(_solved(start, top, below, d, lights) for start in starts)
    return min(found, key=lambda one: one.cost if np.isfinite(one.cost) else np.inf), found


def _solved(start, top: LayerLaw, below: LayerLaw | StackLaw, d: Floats, lights: list[tuple[Floats, ...]]) -> Optimum:
    return solve(_residual, start, (*(np.stack(columns) for columns in zip(*lights, strict=True)), d, top, below))


def _law_of(parameters: Floats, top: LayerLaw, below: LayerLaw | StackLaw, thickness: float) -> StackLaw:
    with jax.enable_x64(True):
        return jax.tree.map(float, _made(jnp.asarray(parameters), top, below, thickness))


def _residual(parameters, data):
    r, value, weight, whole, d, top, below = data
    law = _made(parameters, top, below, d[0])
    relative = jax.vmap(law.value)(r, d) / value - 1.0
    of_a = jax.vmap(law.whole)(d) / whole - 1.0
    away = TIMID * (parameters - jnp.asarray(START))
    return jnp.concatenate([jnp.where(weight > 0, jnp.sqrt(weight) * relative, 0.0).ravel(), OF_A * of_a, away])


def _made(at, top: LayerLaw, below, thickness) -> StackLaw:
    """A law of unbounded parameters."""
    w, u, *others = at
    least = -2.0 * LOWEST * top.decay() * top.mfp
    constants: list[Any] = [jax.nn.sigmoid(w), least + jnp.logaddexp(0.0, u), *map(jnp.exp, others)]
    return StackLaw(top.setting, top, below, thickness, *constants)
