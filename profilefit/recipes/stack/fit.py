"""Fit the law of a stack to its light, exact where all layers scatter isotropically, and what its constants depend on.

Where a layer scatters forward, half spaces are fitted to traced light, the constants of the interfaces
begin at those of the similar stack and are fitted to the stack's own traced light.
Similar media are no substitute: with g = 0.9 and the same reduced coefficients A differs by up to a sixth, R_d within
a mean free path by more than its half.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import Grid, Layer, Medium, Setting, exact, simulate
from mcml_sim.exact import half_space
from mcml_sim.exact.stack.solution import MAX_LAYERS
from mcml_sim.media.arrays import Floats, shown
from mcml_sim.media.setting import require_illumination
from profilefit.errors import InputError
from profilefit.fitting.solver import Solution, least_squares
from profilefit.laws.rational import REFRACTING
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.laws.two_parts import ForwardHalfSpace
from profilefit.recipes import catalogue
from profilefit.recipes.declared import Refused, at
from profilefit.recipes.run import PHOTONS, RecipeRun
from profilefit.recipes.stack.file import LayerStack

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
MOST_FORWARD = 0.95
STARTS, SPREAD = 6, 0.8
LOWEST = 0.95  # of 2 kappa l: how far below 0 u may go
NODES = exact.Nodes(12, 12, 12, 10)  # of the exact light: its error is a tenth of the law's or less
HALF_SPACE_PHOTONS, STACK_PHOTONS = 2**22, 2**21
LEAST = 2**17  # photons: with 20 000, sums of seven Gaussians have no optimum
RINGS = 120
TRACED_FARTHEST, SLOWEST = 40.0, 0.03  # decay lengths; the least rate that these are of
TRACED_SHARE = 0.997
RESOLVED = 0.01  # of a ring: noise below it weighs no less, since the law is no better
# ln of h, a, b of light scattered once, and of h, a, b, c of the rest [in l*]: from about what tissue has.
HALF_SPACE_STARTS = ((0.2, -0.5, -2.0, -0.7, -0.8, -2.3, -2.0), (0.8, -1.0, -3.0, 0.3, -0.8, -2.5, -1.0))
FITTED = ("once_h", "once_a", "once_b", "h", "a", "b", "c")


class TracedRings(NamedTuple):
    """Traced light by rings.

    edges   (n + 1,) radii [length];  energy  (n,) that leaves between them [-], 1 where nothing counts
    weight  (n,) of a relative residual, their squares sum to 1;  noise  (n,) relative standard errors of the energy
    whole   A [-];  error  its standard error
    """

    edges: Floats
    energy: Floats
    weight: Floats
    noise: Floats
    whole: float
    error: float


class Tracing(NamedTuple):
    """Numbers of photons, seeds and store of the traced light of one medium.

    seed   the first one;  photons  of each run in place of the usual number, else `times` of it
    store  folder of which a later run takes the photons that are there
    """

    seed: int = 1
    photons: int | None = None
    times: int = 1
    store: Path | None = None

    @classmethod
    def of(cls, run: RecipeRun, name: str, medium: Medium) -> Tracing:
        """Return how a command traces the light of a medium, under a name that no other has; InputError on too few."""
        if run.photons is not None and run.photons < LEAST and any(layer.g > 0 for layer in medium.layers):
            accepted = f"a whole number >= {LEAST} where a layer scatters forward"
            raise InputError(f"photons must be {accepted}, got {run.photons}")
        times = PHOTONS[run.preset] // PHOTONS["quick"]
        return cls(run.seed, run.photons, times, run.store and run.store / "stacks" / name)

    def rings(self, medium: Medium, illumination: str, edges: Floats, usual: int, offset: int) -> TracedRings:
        """Trace light of a medium as `traced` does; usual  number of photons;  offset  of the seed, one a run."""
        own = f"{illumination} {medium}".encode() + edges.tobytes()
        store = self.store and self.store / f"{hashlib.sha256(own).hexdigest()[:16]}-{offset}"
        return traced(medium, illumination, edges, self.photons or self.times * usual, self.seed + offset, store)


USUAL = Tracing()


def traced(
    medium: Medium, illumination: str, edges: Floats, photons: int, seed: int, store: Path | None = None
) -> TracedRings:
    """Trace light of a medium in rings; those beyond 99.7 % of it, and within the first edge, do not count."""
    grid = Grid.from_edges(r=edges)
    tally = simulate(medium, grid, photons, seed, store, illumination=illumination, progress=False)
    found = tally.reflectance_r.scaled(tally.grid.r_areas)
    energy, error = np.asarray(found.value, float), np.asarray(found.standard_error, float)
    whole, deviation = (float(getattr(tally.diffuse_reflectance, name)) for name in ("value", "standard_error"))
    counts = (energy > 0) & (np.cumsum(energy) <= TRACED_SHARE * whole) & (np.arange(energy.size) > 0)
    noise = np.where(counts, error / np.where(energy > 0, energy, 1.0), 0.0)
    weight = np.where(counts, 1.0 / np.hypot(RESOLVED, noise), 0.0)
    weight /= np.sqrt(np.sum(weight**2))
    return TracedRings(edges, np.where(counts, energy, 1.0), weight, noise, whole, deviation)


def ring_edges(first: Layer, layers: tuple[Layer, ...]) -> Floats:
    """Return edges from the source as far as light of the slowest layer goes [length]."""
    near = NEAREST * first.mfp
    rates = [max(float(half_space.decay_rate(one.alpha)), SLOWEST) / one.mfp for one in layers]
    return np.append(0.0, np.geomspace(near, TRACED_FARTHEST / min(rates), RINGS))


def lowest(solutions: Sequence[Solution]) -> Solution:
    """Return the solution of the lowest cost; one that is not finite comes last."""
    return min(solutions, key=lambda one: one.cost if np.isfinite(one.cost) else np.inf)


def traced_half_space(layer: Layer, setting: Setting, tracing: Tracing = USUAL, offset: int = 0) -> LayerLaw:
    """Fit the law of a layer's half space to traced light; offset  of the seed."""
    own = replace(setting, g=layer.g)
    edges = ring_edges(layer, (layer,))
    medium = Medium((replace(layer, thickness=np.inf),), layer.n / setting.n)
    rings = tracing.rings(medium, setting.illumination, edges, HALF_SPACE_PHOTONS, offset)
    data = (rings.edges / layer.mfp, rings.energy, rings.weight)

    def residual(parameters, light):
        at, energy, weight = light
        within = _half_space_of(own, layer.alpha, rings.whole, parameters).unscaled_energy(at, jnp.asarray(0.0))
        return weight * (jnp.diff(within) / energy - 1.0)

    best = lowest([least_squares(residual, np.array(start), data) for start in HALF_SPACE_STARTS])
    with jax.enable_x64(True):
        law = jax.tree.map(float, _half_space_of(own, layer.alpha, rings.whole, jnp.asarray(best.parameters)))
    return LayerLaw(own, law, layer.alpha, layer.mfp)


def _half_space_of(setting: Setting, albedo: float, whole: float, parameters) -> ForwardHalfSpace:
    values = dict(zip(FITTED, jnp.exp(parameters), strict=True))
    return ForwardHalfSpace(setting, albedo, whole, **values)


RingData = tuple[Floats, ...] | TracedRings  # exact light at radii, or traced rings
Lights = Sequence[RingData]  # of each thickness
Below = LayerLaw | StackLaw  # what lies under an interface, or a whole stack


class Interface(NamedTuple):
    """Light that one interface of a stack was fitted to, and the fit.

    law        of the stack below the surface of its upper layer;  thicknesses  (m,) of that layer, fitted at [length]
    best       the optimum taken, in unbounded parameters;  solutions  those of every start
    lights     of each thickness radii [length], R_d, weights and A, or traced rings
    """

    law: StackLaw
    medium: Medium
    thicknesses: Floats
    lights: Lights
    best: Solution
    solutions: tuple[Solution, ...]

    @property
    def is_traced(self) -> bool:
        """Return whether its light has photons."""
        return isinstance(self.lights[0], TracedRings)


Interfaces = tuple[Interface, ...]
Starts = Sequence[ArrayLike]


def stack_law(medium: Medium, illumination: str = "searchlight") -> Below:
    """Fit the law of a stack of layers of one index to its light.

    medium        layers from the surface down, the last one infinite; one n in [1, 1.6] over that above, g in [0, 0.95]
    illumination  "searchlight" or "diffuse"

    A half space has a law as it is. Of two layers the thickness of the first is an argument; of more, those below the
    first have the ones that they have. InputError on other media. Seconds to a minute, most of it for the exact light;
    where a layer scatters forward light is traced, minutes, and lengths of the law are those of similar layers.
    """
    law, _ = fitted(medium, illumination)
    return law


def fitted(
    medium: Medium, illumination: str, starts: Starts = (), tracing: Tracing = USUAL
) -> tuple[Below, Interfaces]:
    """Fit the law: it, and the fit at each interface from the surface down; none of a half space.

    starts  constants (9,) of each interface: the law is the optimum that a fit from there reaches, not the best one of
            the search, which many optima beside each other make a matter of rounding. Light of isotropic layers only
    tracing  of layers that scatter forward; its seed is that of random starts, too
    """
    require(medium)
    require_illumination(illumination)
    setting = setting_of(medium, illumination)
    if all(layer.g == 0 for layer in medium.layers):
        return _fitted(medium, isotropic_tops(medium, setting), tracing, starts=starts)
    similar = replace(medium, layers=tuple(layer.similar for layer in medium.layers))
    _, initial_fits = fitted(similar, illumination, tracing=tracing)
    tops = [traced_half_space(layer, setting, tracing, place) for place, layer in enumerate(medium.layers)]
    return _fitted(medium, tops, tracing, initial_fits)


def isotropic_tops(medium: Medium, setting: Setting) -> list[LayerLaw]:
    """Return the hazard laws of the half spaces that layers of isotropic scattering would be alone."""
    hazard = catalogue.load("hazard", setting=setting)
    return [LayerLaw(setting, hazard, layer.alpha, layer.mfp) for layer in medium.layers]


def _fitted(
    medium: Medium, tops: list[LayerLaw], tracing: Tracing, initial_fits: Interfaces = (), starts: Starts = ()
) -> tuple[Below, Interfaces]:
    """Fit interface after interface from the last layer up, over the half spaces of the layers.

    initial_fits  the interfaces of the similar stack, from whose constants those of traced light start
    """
    law: Below = tops[-1]
    done: list[Interface] = []
    for place in reversed(range(len(tops) - 1)):
        layer, top, illumination = medium.layers[place], tops[place], tops[place].setting.illumination
        here = Medium(medium.layers[place:], medium.n_above)
        d = _thicknesses(layer.similar, is_below=place > 0)
        lights: Lights
        if initial_fits:
            lights = [rings_of(here, each, illumination, number, tracing) for number, each in enumerate(d)]
            best = _solved(initial_fits[place].best.parameters, top, law, d, lights)
            found: tuple[Solution, ...] = (best,)
        else:
            lights = [light_of(here, each, illumination) for each in d]
            best, found = _searched(top, law, d, lights, tracing.seed, starts[place] if starts else None)
        law = _law_of(best.parameters, top, law, layer.thickness)
        done.insert(0, Interface(law, here, d, lights, best, found))
    return law, tuple(done)


def rings_of(medium: Medium, d: float, illumination: str, number: int, tracing: Tracing = USUAL) -> TracedRings:
    """Trace light under a first layer of another thickness d [length]; number  of the run, by which seeds differ."""
    edges = ring_edges(medium.layers[0], medium.layers)
    return tracing.rings(medium.with_first(d), illumination, edges, STACK_PHOTONS, 100 + number)


def errors(interface: Interface) -> dict[str, dict[str, float | None]]:
    """Return the errors of an interface's constants, by their names in records; None where there can be none.

    statistical     that of the photons, by the sandwich formula; none where light is exact
    discretisation  what a refit to light of fewer nodes changes; none of rings, which are integrals
    model           none: of a law that fits at each thickness in its own way no likelihood is known
    misfit          s^2 (J^T J)^-1, as if residuals were independent
    jackknife       refits without one thickness after the other
    """
    top, below, thickness = interface.law.top, interface.law.below, interface.law.thickness

    def refitted(lights: Lights) -> Floats:
        best = _solved(interface.best.parameters, top, below, interface.thicknesses, lights)
        return _vector(_law_of(best.parameters, top, below, thickness))

    own, fewer = _vector(interface.law), None
    if not interface.is_traced:
        illumination = interface.law.setting.illumination
        fewer = refitted([light_of(interface.medium, d, illumination, NODES.fewer) for d in interface.thicknesses])
    left_out = []
    for number, light in enumerate(interface.lights):
        # It gets no weight: leaving it out would change the shape, and compile a program.
        weight = 0.0 * np.asarray(light[2])
        blind = light._replace(weight=weight) if isinstance(light, TracedRings) else (*light[:2], weight, *light[3:])
        left_out.append(refitted([*interface.lights[:number], blind, *interface.lights[number + 1 :]]))
    apart = np.array(left_out) - np.mean(left_out, axis=0)
    jackknife = np.sqrt((len(left_out) - 1) * np.mean(apart**2, axis=0))
    with jax.enable_x64(True):
        best = jnp.asarray(interface.best.parameters)
        slopes = np.asarray(jax.jacfwd(lambda at: _vector(_made(at, top, below, thickness)))(best))
    inverse = interface.best.covariance

    def spread(covariance: Floats) -> Floats:
        return np.sqrt(np.diag(slopes @ covariance @ slopes.T))

    found: dict[str, Floats | None] = {
        "statistical_error": spread(inverse @ _noise(interface) @ inverse) if interface.is_traced else None,
        "discretisation_error": None if fewer is None else np.abs(fewer - own),
        "model_error": None,
        "misfit_error": spread(interface.best.variance * inverse),
        "jackknife_error": jackknife,
    }
    return {
        name: {key: None if each is None else float(each[i]) for key, each in found.items()}
        for i, name in enumerate(StackLaw.constant_names())
    }


def _noise(one: Interface) -> Floats:
    """J^T V J of the photons' variances V of the residuals (p, p)."""
    rings = [light for light in one.lights if isinstance(light, TracedRings)]
    of_rings = np.concatenate([light.weight * light.noise for light in rings])
    of_whole = np.array([OF_A * light.error / light.whole for light in rings])
    rest = np.zeros(len(one.best.residuals) - len(of_rings) - len(of_whole))  # those that keep constants near a start
    scaled = np.concatenate([of_rings, of_whole, rest])[:, None] * one.best.jacobian
    return np.asarray(scaled.T @ scaled)


def radii(medium: Medium) -> Floats:
    """Return radii as far as light of its slowest layer goes [length]."""
    slowest = max(
        min(layer.mfp / max(float(half_space.decay_rate(layer.alpha)), 1e-12), LONGEST_DECAY * layer.mfp)
        for layer in medium.layers
    )
    return np.geomspace(NEAREST * medium.layers[0].mfp, FARTHEST * slowest, RADII)


def _vector(law: StackLaw):
    return jnp.stack([jnp.asarray(getattr(law, name)) for name in StackLaw.constant_names()])


def require_exact(stack: LayerStack) -> None:
    """Refuse a stack of a scene's file whose exact light is unknown."""
    for medium in stack.media:
        with at("layers"):
            require(medium)
        for number, layer in enumerate(medium.layers):
            if layer.g > 0:
                accepted = "0, and mu_s reduced: the exact truth is of isotropic scattering"
                raise Refused(accepted, layer.g, "layers", number, "g")


def require(medium: Medium) -> None:
    """Raise InputError where no law of a stack can be fitted to a medium."""
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
        if not 0 <= layer.g <= MOST_FORWARD:
            accepted = f"g in [0, {MOST_FORWARD:g}] for a law of a stack"
            raise InputError(f"layers must scatter with {accepted}, got {layer.g:g} in layer {number}")
        if not layer.mu_s > 0 and any(one.g > 0 for one in medium.layers):
            raise InputError(f"layers must scatter where one scatters forward, got mu_s = 0 in layer {number}")
        if layer.n != medium.layers[0].n:
            got = f"{medium.layers[0].n:g} in layer 1 and {layer.n:g} in layer {number}"
            raise InputError(f"layers must have one n for a law of a stack, got {got}")


def setting_of(medium: Medium, illumination: str) -> Setting:
    """Return the setting of a stack's light, and of its half spaces where all scatter isotropically."""
    return Setting(illumination, n=medium.layers[0].n / medium.n_above)


def _thicknesses(layer: Layer, is_below: bool) -> Floats:
    """Return thicknesses to fit at, the layer's own among them [length]."""
    if is_below:
        return layer.thickness * np.array(INSIDE)
    rate = float(half_space.decay_rate(layer.alpha))
    last = min(THICK / max(rate, THICK / LONGEST), LONGEST)
    return np.unique(np.append(layer.mfp * np.geomspace(THIN, last, COUNT), layer.thickness))


def light_of(medium: Medium, d: float, illumination: str, nodes: exact.Nodes = NODES) -> tuple[Floats, ...]:
    """Return light under a first layer of thickness d: radii [length], R_d there, weights of the radii, and A."""
    light, r = exact.solve(medium.with_first(d), illumination, nodes), radii(medium)
    seen = np.asarray(light.cdf(r)) <= LAST_SHARE
    value = np.where(seen, np.asarray(light.profile(r)), 1.0)
    return r, value, seen / np.count_nonzero(seen), np.asarray(light.reflectance)


def _searched(
    top: LayerLaw, below: Below, d: Floats, lights: Lights, seed: int, given: ArrayLike | None = None
) -> tuple[Solution, tuple[Solution, ...]]:
    """Return the best optimum of several starts, or that of constants which are given; and all."""
    random = np.random.default_rng(seed)
    spread = START + SPREAD * random.standard_normal((STARTS - 2, len(START)))
    starts = [np.array(START), _as_slabs_add(top, below), *spread]
    found = tuple(_solved(start, top, below, d, lights) for start in starts)
    if given is not None:
        # The parameters of `_made` that make these constants, u moved to where the law is defined.
        w, u, *others = np.asarray(given, float)
        least = LOWEST * _fading(top, below)
        bounded = [np.log(w / (1.0 - w)), np.log(np.expm1(max(u + least, 0.01 * least))), *np.log(others)]
        own = _solved(np.array(bounded), top, below, d, lights)
        return own, (own, *found)
    return lowest(found), found


def _as_slabs_add(top: LayerLaw, below: Below) -> Floats:
    """Return a start whose A(d) is that of added slabs of isotropic light.

    A(d) is A_1 + T^2 A_2 / (1 - A_1 A_2), with u = 0 and w = A_1 (A_1 - A_2) / (1 - A_1 A_2). Over a dark layer the A
    of a white one falls as h / (d + h), which no other start finds.
    """
    first, second, rate = float(top.whole()), float(below.whole()), _fading(top, below)
    w = np.clip(first * (first - second) / (1.0 - first * second + 1e-12), 1e-4, 1.0 - min(rate, 0.5))
    return np.array([np.log(w / (1.0 - w)), np.log(np.expm1(LOWEST * rate)), *START[2:]])


def _solved(start, top: LayerLaw, below: Below, d: Floats, lights: Lights) -> Solution:
    """Return the optimum from a start; fits to traced light stay near it where nothing speaks against that."""
    arrays = tuple(np.stack(column) for column in zip(*lights, strict=True))
    if isinstance(lights[0], TracedRings):
        return least_squares(_ring_residual, start, (*arrays, d, top, below, np.asarray(start)))
    return least_squares(_residual, start, (*arrays, d, top, below))


def _law_of(parameters: Floats, top: LayerLaw, below: Below, thickness: float) -> StackLaw:
    with jax.enable_x64(True):
        return jax.tree.map(float, _made(jnp.asarray(parameters), top, below, thickness))


def _residual(parameters, data):
    r, value, weight, whole, d, top, below = data
    law = _made(parameters, top, below, d[0])
    relative = jax.vmap(law.value)(r, d) / value - 1.0
    of_a = jax.vmap(law.whole)(d) / whole - 1.0
    away = TIMID * (parameters - jnp.asarray(START))
    return jnp.where(weight > 0, jnp.sqrt(weight) * relative, 0.0).ravel(), OF_A * _counts(weight) * of_a, away


def _ring_residual(parameters, data):
    edges, energy, weight, _, whole, _, d, top, below, start = data
    law = _made(parameters, top, below, d[0])
    within = jax.vmap(law.within)(edges, d)
    relative = jnp.diff(within, axis=1) / energy - 1.0
    of_a = jax.vmap(law.whole)(d) / whole - 1.0
    return (weight * relative).ravel(), OF_A * _counts(weight) * of_a, TIMID * (parameters - start)


def _counts(weight):
    return jnp.any(weight > 0, axis=1).astype(float)


def _fading(top: LayerLaw, below: Below) -> float:
    return 2.0 * float(_made(jnp.array(START), top, below, 0.0).fading()) * top.mfp


def _made(at, top: LayerLaw, below, thickness) -> StackLaw:
    w, u, *others = at
    constants: list[Any] = [jax.nn.sigmoid(w), jnp.logaddexp(0.0, u), *map(jnp.exp, others)]
    law = StackLaw(top.setting, top, below, thickness, *constants)
    return eqx.tree_at(lambda one: one.u, law, law.u - 2.0 * LOWEST * law.fading() * top.mfp)
