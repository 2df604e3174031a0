"""Layers that scatter isotropically solved exactly: what leaves above and below, and where. No photons, no noise.

    from mcml_sim import Layer, Medium, exact

    skin = Medium((Layer(1.4, 0.2, 20.0, 0.0, 0.01), Layer(1.4, 0.03, 18.0, 0.0)))
    light = exact.solve(skin)
    light.reflectance, light.absorbed, light.profile([0.01, 0.1]), light.cdf(0.1)

`fluence` has the equation, at one transverse wave number k, and its numerics. The profile is the inverse Hankel
transform of what it gives, of which first is taken apart what k would have to go far out for:

- light that was scattered once, under a searchlight: an integral over the beam for each radius;
- the rest of the light of a half space of the topmost layer, see `half_space`: the stack differs from it by light that
  has been deeper, and that falls off with k and the layer's thickness.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import erfc, j0, j1
from threadpoolctl import threadpool_limits

from mcml_sim.errors import InputError
from mcml_sim.exact import cone, half_space
from mcml_sim.exact.single_scattering import entered
from mcml_sim.exact.stack import fluence, known
from mcml_sim.exact.stack.quadrature import Depths, Nodes, gauss, interpolation, slowest, stack
from mcml_sim.media.arrays import Floats, checked_range, require, scalar_or_array
from mcml_sim.media.medium import Layer, Medium, specular_reflectance
from mcml_sim.media.setting import Setting, require_illumination

MAX_LAYERS = 20
STANDARD = Nodes(depth=20, slope=24, azimuth=24)
FINE = Nodes(depth=28, slope=32, azimuth=32)
DECAYED = 32.0  # k times the depth of the next interface, where the stack is no other than its topmost layer
LAST_WAVE = {True: 2000.0, False: 40.0}  # times the largest mu_t, where indices match and where they do not
THIN = 1.0  # mean free paths: plates that a half space is not much like, and in which slanted light does not go far:
RESOLVED = 60.0  # k times their height
FIRST_WAVE = 1e-3  # times the smallest mu_t, where nothing is absorbed
LAST_PHASE = 200.0  # k r: light changes little within a hundredth of r
SMOOTH = 5.0  # k times the depth of the first layer that scatters, where a half space without that depth is no use
NEAREST, FARTHEST = 1e-9, 1e9  # radii, in units of the medium's own
PHASE_STEP, PHASE_NODES = 20.0, 24
KEPT = 4096  # transforms of some ten media, so that their other illumination takes no more work


@dataclass(frozen=True)
class Solution:
    """Shares of the light that arrives at a stack, by where it goes; lengths in the unit of the medium.

    As in MCML, light that an interface below throws back counts as diffuse reflectance even if it was never scattered.
    Under a searchlight it leaves at r = 0: it is in `reflectance`, `transform` and `cdf`, and not in `profile`.
    """

    medium: Medium
    illumination: str
    specular: float
    """Light that the surface throws back at once [-]."""
    reflectance: float
    """Light that entered and left above [-]."""
    transmittance: float | None
    """Light that left below, whether it was scattered or not [-]; None where there is no below."""
    absorbed: Floats = field(compare=False)
    """Light that each layer absorbs, from the top, (layers,) [-].

    It is the net flux that enters a layer less the net flux that leaves it (`fluence.net_flux`). With `specular`,
    `reflectance` and `transmittance` the sum is 1 to rounding, if any layer absorbs.
    """
    absorbed_error: float
    """Largest change of `absorbed` with fewer nodes [-]: above its error."""
    error: float
    """Relative change of `reflectance`, and of the transform at k = 1 / mfp, with fewer nodes: above their error."""
    nodes: Nodes = field(default=STANDARD, repr=False)

    def transform(self, k: ArrayLike) -> float | Floats:
        """Return 2 pi int_0^inf r R_d(r) J0(k r) dr at wave numbers k >= 0 [1/length], of any shape [-]; A at 0."""
        waves = checked_range("k", k, "a finite wave number >= 0", 0.0, sys.float_info.max)
        return scalar_or_array(_each(lambda k: _reflected(self.medium, k, self.illumination, self.nodes), waves))

    def profile(self, r: ArrayLike) -> float | Floats:
        """Return R_d(r) [1/length^2] at radii r >= 0 of any shape; 2 pi r R_d integrates to what is not at r = 0."""
        radius = checked_range("r", r, "a radius >= 0", 0.0)
        return scalar_or_array(self._difference.profile(radius.ravel()).reshape(radius.shape))

    def cdf(self, r: ArrayLike) -> float | Floats:
        """Return the share of `reflectance` that leaves within radius r >= 0 of any shape [-]; 1 at infinity."""
        radius = checked_range("r", r, "a radius >= 0", 0.0)
        within = self._difference.within(radius.ravel()).reshape(radius.shape)
        all_of_it = np.isinf(radius) | (self.reflectance == 0)
        return scalar_or_array(np.where(all_of_it, 1.0, within / (self.reflectance or 1.0)))

    @cached_property
    def _difference(self) -> _Difference:
        return _difference(self.medium, self.illumination, self.nodes)


def solve(medium: Medium, illumination: str = "searchlight", nodes: Nodes = STANDARD) -> Solution:
    """Solve the light in a stack of up to 20 layers of one index that scatter isotropically, or not at all.

    medium        its indices above and below may be any
    illumination  "searchlight" or "diffuse", as in `mcml_sim.Setting`
    nodes         of its quadratures

    InputError on any other medium and illumination.

    Relative error of the reflectance, and of the transform up to k = 5 / mfp, and absolute error of the transmittance
    and of what layers absorb: below 1e-7, mostly 1e-9, in layers of up to 1000 mfp (3e-7 under diffuse light if the
    index above is all but the same); beyond, see `Solution.error`. Where the index above is another the transform's
    grows to 5e-4 at k = 25 / mfp.

    That of the profile is below 1e-5 as far as R_d is more than 1e-3 of what it is at one mean free path. Where the
    index above is another it is 1e-4 at the radii at which light comes just from the next interface under the critical
    angle, 5e-4 closer than 0.1 mfp where the topmost layer is thinner than that, 1e-3 in plates of about one mean free
    path, and up to 1e-2 at some radii in thinner ones.

    The first profile or cdf solves for some hundred k, which takes some seconds (twenty layers: half a minute); further
    radii cost little.
    """
    _require_solved(medium, illumination)
    require(isinstance(nodes, Nodes), "nodes", "a mcml_sim.exact.Nodes", nodes)
    first = medium.layers[_first_to_scatter(medium) or 0]
    (fine, down, absorbed), (coarse, _, other) = (_shares(medium, illumination, rule) for rule in (nodes, nodes.fewer))
    waves = np.array([first.mu_t])
    fines = np.append(fine, _each(lambda k: _reflected(medium, k, illumination, nodes), waves))
    coarses = np.append(coarse, _each(lambda k: _reflected(medium, k, illumination, nodes.fewer), waves))
    changes = np.abs(fines - coarses) / np.where(fines > 0, fines, 1.0)
    return Solution(
        medium,
        illumination,
        specular=_specular(medium, illumination),
        reflectance=fine,
        transmittance=None if medium.is_half_space else down,
        absorbed=absorbed,
        absorbed_error=float(np.max(np.abs(absorbed - other))),
        error=float(changes.max()),
        nodes=nodes,
    )


def _require_solved(medium: Medium, illumination: str) -> None:
    require(isinstance(medium, Medium), "medium", "a mcml_sim.Medium", medium)
    require_illumination(illumination)
    layers = medium.layers
    if len(layers) > MAX_LAYERS:
        raise InputError(f"a stack solved exactly must have at most {MAX_LAYERS} layers, got {len(layers)}")
    for number, layer in enumerate(layers, start=1):
        if layer.mu_s > 0 and not layer.is_isotropic:
            raise InputError(f"a stack solved exactly must scatter with g = 0, got {layer.g:g} in layer {number}")
        if layer.n != layers[0].n:
            got = f"{layers[0].n:g} in layer 1 and {layer.n:g} in layer {number}"
            raise InputError(f"a stack solved exactly must have one n in all layers, got {got}")


def _reflected(medium: Medium, k: float, illumination: str, rule: Nodes) -> float:
    """Return R^(k) [-]."""
    return _leaves_above(*_answer(medium, k, rule), k, illumination, rule)


def _answer(medium: Medium, k: float, rule: Nodes) -> tuple[Depths, fluence.Field]:
    here = stack(medium, k, rule)
    return here, fluence.solve(here, k, rule)


def _leaves_above(here: Depths, answer: fluence.Field, k: float, illumination: str, rule: Nodes) -> float:
    scattered = float(here.weight @ (answer.phi[illumination] * answer.up))
    return scattered + fluence.thrown_back(here, k, illumination, rule)


def _shares(medium: Medium, illumination: str, rule: Nodes) -> tuple[float, float, Floats]:
    """Return the light that leaves above and below, and that each layer absorbs, (layers,) [-]."""
    with threadpool_limits(1, "blas"):
        here, answer = _answer(medium, 0.0, rule)
        reflected, transmitted = _leaves_above(here, answer, 0.0, illumination, rule), 0.0
        if not medium.is_half_space:
            scattered = float(here.weight @ (answer.phi[illumination] * answer.down))
            # Below 0 by rounding where hardly any light gets through.
            transmitted = max(scattered + fluence.straight_through(here, illumination, rule), 0.0)
        absorbed = np.zeros(len(medium.layers))
        absorbs = np.flatnonzero([layer.mu_a > 0 for layer in medium.layers])
        if absorbs.size:
            # Between two layers that absorb any depth has the same flux.
            tau = np.cumsum([layer.mu_t * layer.thickness for layer in medium.layers[: absorbs[-1]]])
            between = fluence.net_flux(here, answer.phi[illumination], tau[absorbs[:-1]], illumination, rule)
            enters = 1 - _specular(medium, illumination) - reflected
            absorbed[absorbs] = -np.diff(np.concatenate([[enters], between, [transmitted]]))
    return reflected, transmitted, np.maximum(absorbed, 0.0)


def _specular(medium: Medium, illumination: str) -> float:
    """Return the specular light as `mcml_sim.simulate` counts it: of a single pane of clear glass, all of it."""
    if illumination == "searchlight":
        return specular_reflectance(medium)
    return 1 - entered(Setting(illumination, n=medium.layers[0].n / medium.n_above))


@dataclass(frozen=True)
class _Difference:
    """Profile as what is known of it, and the transform of the rest."""

    medium: Medium
    illumination: str
    base: Medium | None  # half space whose profile, without what is known of it, is taken away; None where nothing is
    share: float  # of that profile [-]
    edges: Floats  # edges of panels of k, (panels + 1,) [1/length]
    rest: Floats  # transform of the rest, (panels, nodes) [-]

    def profile(self, r: Floats) -> Floats:
        """Return R_d [1/length^2] at radii of shape (n,)."""
        unit, scatters = _unit(self.medium), self.medium.layers[0].mu_s > 0
        near = np.clip(r, NEAREST * unit, FARTHEST * unit)
        value = self._inverse(near, 0) / (2 * np.pi) + known.profile(self.medium, self.illumination, near)
        if self.base is not None:
            layer, light = _half_space(self.base, self.illumination)
            deep = half_space.profile(near, layer.alpha, layer.mfp, light)
            value += self.share * (deep - known.profile(self.base, self.illumination, near))
        return np.where(r > FARTHEST * unit, 0.0, np.where((r == 0) & scatters, np.inf, value))

    def within(self, r: Floats) -> Floats:
        """Return the light that leaves within radii of shape (n,) [-]."""
        unit = _unit(self.medium)
        near = np.clip(r, NEAREST * unit, FARTHEST * unit)
        value = near * self._inverse(near, 1) + known.within(self.medium, self.illumination, near)
        if self.base is not None:
            layer, light = _half_space(self.base, self.illumination)
            deep = half_space.cdf(near, layer.alpha, layer.mfp, light) * half_space.reflectance(layer.alpha, light)
            value += self.share * (deep - known.within(self.base, self.illumination, near))
        return value

    def _inverse(self, r: Floats, order: int) -> Floats:
        """Return int_0^inf f(k) J(k r) dk, f the rest times k with J0 and the rest itself with J1, (n,)."""
        value = np.zeros_like(r)
        size = np.ceil(np.log2(r))  # radii of like size share nodes
        for group in np.unique(size):
            here = size == group
            last = min(self.edges[-1], LAST_PHASE / float(r[here].max()))
            for low, high, rest in zip(self.edges[:-1], self.edges[1:], self.rest, strict=True):
                if low < last:
                    value[here] += _panel(low, high, last, rest, r[here], order)
        return value


def _panel(low: float, high: float, last: float, rest: Floats, r: Floats, order: int) -> Floats:
    """Return the part of the integral between two wave numbers, in steps of a few periods of J."""
    stop = min(high, last)
    steps = int(np.ceil((stop - low) * r.max() / PHASE_STEP)) or 1
    x, weight = gauss(PHASE_NODES)
    k = low + (stop - low) * ((np.arange(steps)[:, None] + x) / steps).ravel()
    # Ended softly, what is left at the last k blurs the light over a few times its wavelength, and that is all.
    soft = 0.5 * erfc(9.0 * (k / last - 0.52))
    through = interpolation(2 * ((k - low) / (high - low)) - 1, rest.size)
    values = soft * (through @ rest) * np.tile(weight, steps) * ((stop - low) / steps)
    waves = np.multiply.outer(r, k)
    return j0(waves) @ (values * k) if order == 0 else j1(waves) @ values


def _unit(medium: Medium) -> float:
    """Return a length of the medium's own: its shortest mean free path, or thickness where nothing scatters."""
    return min(layer.mfp if layer.mu_s > 0 else layer.thickness for layer in medium.layers)


def _difference(medium: Medium, illumination: str, rule: Nodes) -> _Difference:
    base, last = _base(medium)
    edges = _wave_edges(medium, last)
    waves = edges[:-1, None] + np.diff(edges)[:, None] * gauss(rule.wave)[0]
    rest, share = _each(lambda k: _rests(medium, k, rule)[illumination], waves), 0.0
    if base is not None:
        deep = _rest_of_half_space(base, medium, waves, illumination, rule)
        share = 1.0 if medium.layers[0].n >= medium.n_above else rest.flat[-1] / deep.flat[-1]
        rest -= share * deep
    return _Difference(medium, illumination, base, share, edges, rest)


def _each(transform: Callable[[float], float], waves: Floats) -> Floats:
    """Return a transform at wave numbers of any shape; more threads, BLAS's or others, slow such small ones down."""
    with threadpool_limits(1, "blas"):
        return np.reshape([transform(k) for k in waves.ravel().tolist()], waves.shape)


def _rest_of_half_space(base: Medium, medium: Medium, waves: Floats, illumination: str, rule: Nodes) -> Floats:
    """Return what of the half space is taken away from the medium's rest at wave numbers of any shape [-]."""
    layer, light = _half_space(base, illumination)
    if _is_thin(medium) and layer.n > 1:
        with jax.enable_x64(True):
            whole, once = map(np.asarray, cone.orders(light.n, layer.alpha, jnp.asarray(waves.ravel() * layer.mfp)))
        searchlight, diffuse = whole - [[1], [0]] * once
        return np.reshape(searchlight if illumination == "searchlight" else diffuse, waves.shape)
    # In layers of the medium's heights: what is not resolved at its depths is the same in both.
    number = _first_to_scatter(medium)
    heights = [each.thickness for each in medium.layers[number:] if np.isfinite(each.thickness)]
    likewise = replace(base, layers=(*(replace(layer, thickness=height) for height in heights), layer))
    return _each(lambda k: _rests(likewise, k, rule)[illumination], waves)


def _half_space(base: Medium, illumination: str) -> tuple[Layer, Setting]:
    (layer,) = base.layers
    return layer, Setting(illumination, n=layer.n)


@lru_cache(maxsize=KEPT)
def _rests(medium: Medium, k: float, rule: Nodes) -> dict[str, float]:
    """Return the transform of the light that `known` has no formula for, of each illumination [-]."""
    here, answer = _answer(medium, k, rule)
    once = {"searchlight": answer.unscattered["searchlight"] * answer.up_at_once, "diffuse": np.zeros_like(answer.up)}
    return {light: float(here.weight @ (phi * answer.up - once[light])) for light, phi in answer.phi.items()}


def _base(medium: Medium) -> tuple[Medium | None, float]:
    """Return the half space to take away, and the wave number from which the rest of the light is its."""
    layers, tops = medium.layers, medium.z_edges
    number = _first_to_scatter(medium)
    if number is None:
        return None, 0.0
    first, steepest = layers[number], max(layer.mu_t for layer in layers if layer.mu_s > 0)
    farthest = LAST_WAVE[layers[0].n == medium.n_above] * steepest
    if _is_thin(medium):
        farthest = min(LAST_WAVE[True] * steepest, RESOLVED / tops[-1])
    if tops[number] * farthest > SMOOTH:
        return None, min(farthest, DECAYED / tops[number])
    index = first.n / medium.n_above
    base = Medium((Layer(max(index, 1.0), first.mu_a, first.mu_s, 0.0),))
    # A half space under a denser medium is not solved: one without a surface is much like it, but not the same.
    return base, min(farthest, DECAYED / first.thickness) if index >= 1 else farthest


def _first_to_scatter(medium: Medium) -> int | None:
    return next((number for number, layer in enumerate(medium.layers) if layer.mu_s > 0), None)


def _is_thin(medium: Medium) -> bool:
    return max(layer.mu_t for layer in medium.layers if layer.mu_s > 0) * medium.z_edges[-1] < THIN


def _wave_edges(medium: Medium, last: float) -> Floats:
    """Return panels of k, each as long as it is far from 0, (panels + 1,)."""
    scatter = [layer for layer in medium.layers if layer.mu_s > 0]
    if last == 0:
        return np.zeros(1)
    least = min(layer.mu_t * max(slowest(layer.alpha), FIRST_WAVE) for layer in scatter)
    first = min(0.5 * least, 0.5 * last)
    return np.append(0.0, np.geomspace(first, last, int(np.ceil(np.log2(last / first))) + 1))
