"""Fit the law of a stack to its exact light."""

from __future__ import annotations

from typing import Any

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


def stack_law(medium: Medium, illumination: str = "searchlight") -> StackLaw | LayerLaw:
    """The law of a stack of layers of one index that scatter isotropically, fitted to its exact light.

    medium        layers from the surface down, the last one infinite; one n in [1, 1.6] over that above, g = 0
    illumination  "searchlight" or "diffuse"

    A half space has a law as it is. Of two layers the thickness of the first is an argument; of more, those below the
    first have the ones that they have. InputError on other media. Seconds to a minute, most of it for the exact light.
    """
    _require(medium)
    require_illumination(illumination)
    return _law(medium, Setting(illumination, n=medium.layers[0].n / medium.n_above), is_below=False)


def _require(medium: Medium) -> None:
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


def _law(medium: Medium, setting: Setting, is_below: bool) -> StackLaw | LayerLaw:
    first, *others = medium.layers
    top = LayerLaw(setting, catalogue.load("hazard", setting=setting), first.alpha, first.mfp)
    if not others:
        return top
    below = _law(Medium(tuple(others), medium.n_above), setting, is_below=True)
    thicknesses = _thicknesses(first, is_below)
    lights = [_light(first, others, medium.n_above, d, setting.illumination) for d in thicknesses]
    return _fitted(top, below, first.thickness, thicknesses, lights)


def _thicknesses(layer: Layer, is_below: bool) -> Floats:
    """Those to fit at, the layer's own among them [length]."""
    if is_below:
        return layer.thickness * np.array(INSIDE)
    rate = float(half_space.decay_rate(layer.alpha))
    last = min(THICK / max(rate, THICK / LONGEST), LONGEST)
    return np.unique(np.append(layer.mfp * np.geomspace(THIN, last, COUNT), layer.thickness))


def _light(first: Layer, others: list[Layer], n_above: float, d: float, illumination: str) -> tuple[Floats, ...]:
    """Radii [length], R_d there, weights of the radii, and A."""
    medium = Medium((Layer(first.n, first.mu_a, first.mu_s, 0.0, d), *others), n_above)
    light = exact.solve(medium, illumination, exact.Nodes(12, 16, 16, 10))
    slowest = max(
        min(layer.mfp / max(float(half_space.decay_rate(layer.alpha)), 1e-12), LONGEST_DECAY * layer.mfp)
        for layer in medium.layers
    )
    r = np.geomspace(NEAREST * first.mfp, FARTHEST * slowest, RADII)
    seen = np.asarray(light.cdf(r)) <= LAST_SHARE
    value = np.where(seen, np.asarray(light.profile(r)), 1.0)
    return r, value, seen / np.count_nonzero(seen), np.asarray(light.reflectance)


def _fitted(
    top: LayerLaw, below: LayerLaw | StackLaw, thickness: float, d: Floats, lights: list[tuple[Floats, ...]]
) -> StackLaw:
    data = (*(np.stack(columns) for columns in zip(*lights, strict=True)), d, top, below)
    random = np.random.default_rng(SEED)
    starts = [np.array(START), *(START + SPREAD * random.standard_normal((STARTS - 1, len(START))))]
    found: list[Optimum] = [solve(_residual, start, data) for start in starts]
    best = min(found, key=lambda one: one.cost if np.isfinite(one.cost) else np.inf)
    with jax.enable_x64(True):
        made = _made(jnp.asarray(best.parameters), top, below, thickness)
        return jax.tree.map(float, made)


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
