"""Layers that scatter isotropically solved exactly: what leaves above and below, and where. No photons, no noise.

    from mcml_sim import Layer, Medium
    from mcml_sim.exact import stack

    skin = Medium((Layer(1.4, 0.2, 20.0, 0.0, 0.01), Layer(1.4, 0.03, 18.0, 0.0)))
    light = stack.solve(skin)
    light.reflectance, light.profile([0.01, 0.1]), light.cdf(0.1)

`fluence` has the equation, at one transverse wave number k, and its numerics. The profile is the inverse Hankel
transform of what it gives, of which first is taken apart what k would have to go far out for:

- light that was scattered once, under a searchlight: an integral over the beam for each radius;
- the rest of the light of a half space of the topmost layer, see `half_space`: the stack differs from it by light that
  has been deeper, and that falls off with k and the layer's thickness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0, j1

from mcml_sim.errors import InputError
from mcml_sim.exact import fluence, half_space
from mcml_sim.exact.fluence import Answer, Rule, Stack
from mcml_sim.media.checks import checked_numbers, shown
from mcml_sim.media.medium import Layer, Medium
from mcml_sim.media.setting import ILLUMINATIONS, Setting

Floats = NDArray[np.float64]

MAX_LAYERS = 20
STANDARD = Rule(depth=20, slope=24, azimuth=24)
COARSE = Rule(depth=16, slope=18, azimuth=18)
WAVE_NODES = 10  # of a panel of k, which is as long as it is far from 0
DECAYED = 25.0  # k times the depth of the next interface, where the stack is no other than its topmost layer
LAST_WAVE = {True: 2000.0, False: 40.0}  # times the largest mu_t, where indices match and where they do not
FIRST_WAVE = 1e-3  # times the smallest mu_t, where nothing is absorbed
FARTHEST_PHASE = 1e5  # k r
PHASE_STEP, PHASE_NODES = 20.0, 24


@dataclass(frozen=True)
class Solution:
    """What becomes of light in a stack, in shares of what arrives; lengths in the unit of the medium.

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
    error: float
    """Relative change of `reflectance`, and of the transform at one mean free path, with fewer nodes [-]."""

    def transform(self, k: ArrayLike) -> float | Floats:
        """2 pi int_0^inf r R_d(r) J0(k r) dr at wave numbers k >= 0 [1/length], of any shape [-]; A at k = 0."""
        waves = _checked("k", k, "a wave number >= 0")
        values = np.array([_reflected(self.medium, float(k), self.illumination) for k in waves.flat])
        return _scalar_or_array(values.reshape(waves.shape))

    def profile(self, r: ArrayLike) -> float | Floats:
        """R_d(r) [1/length^2] at radii r >= 0 of any shape: 2 pi r R_d integrates to what is not left at r = 0."""
        radius = _checked("r", r, "a radius >= 0")
        return _scalar_or_array(self._difference.profile(radius.ravel()).reshape(radius.shape))

    def cdf(self, r: ArrayLike) -> float | Floats:
        """Share of `reflectance` that leaves within radius r >= 0 of any shape [-]; 1 at infinity."""
        radius = _checked("r", r, "a radius >= 0")
        within = self._difference.within(radius.ravel()).reshape(radius.shape)
        return _scalar_or_array(within / self.reflectance if self.reflectance > 0 else np.ones_like(radius))

    @cached_property
    def _difference(self) -> _Difference:
        return _difference(self.medium, self.illumination)


def solve(medium: Medium, illumination: str = "searchlight") -> Solution:
    """Light in a stack of up to 20 layers of one index that scatter isotropically, or not at all.

    medium        its indices above and below may be any
    illumination  "searchlight" or "diffuse", as in `mcml_sim.Setting`

    InputError on any other medium and illumination.
    """
    _require_solved(medium, illumination)
    first = next((layer for layer in medium.layers if layer.mu_s > 0), medium.layers[0])
    waves = (0.0, first.mu_t)
    fine, coarse = (
        np.array([_reflected(medium, k, illumination, rule) for k in waves]) for rule in (STANDARD, COARSE)
    )
    changes = np.abs(fine - coarse) / np.where(fine > 0, fine, 1.0)
    return Solution(
        medium,
        illumination,
        specular=_specular(medium, illumination),
        reflectance=float(fine[0]),
        transmittance=None if medium.is_half_space else _transmitted(medium, illumination),
        error=float(changes.max()),
    )


def _require_solved(medium: Medium, illumination: str) -> None:
    if not isinstance(medium, Medium):
        raise InputError(f"medium must be a mcml_sim.Medium, got {shown(medium)}")
    if illumination not in ILLUMINATIONS:
        raise InputError(f"illumination must be one of {', '.join(ILLUMINATIONS)}, got {shown(illumination)}")
    layers = medium.layers
    if len(layers) > MAX_LAYERS:
        raise InputError(f"a stack solved exactly must have at most {MAX_LAYERS} layers, got {len(layers)}")
    for number, layer in enumerate(layers, start=1):
        if layer.mu_s > 0 and layer.g != 0:
            raise InputError(f"a stack solved exactly must scatter with g = 0, got {layer.g:g} in layer {number}")
        if layer.n != layers[0].n:
            got = f"{layers[0].n:g} in layer 1 and {layer.n:g} in layer {number}"
            raise InputError(f"a stack solved exactly must have one n in all layers, got {got}")


def _reflected(medium: Medium, k: float, illumination: str, rule: Rule = STANDARD) -> float:
    """R^(k) [-]."""
    here, answer = _answer(medium, k, illumination, rule)
    return float(here.weight @ (answer.phi * answer.up)) + fluence.thrown_back(here, k, illumination, rule)


def _answer(medium: Medium, k: float, illumination: str, rule: Rule = STANDARD) -> tuple[Stack, Answer]:
    here = fluence.stack(medium, k, rule)
    return here, fluence.solve(here, k, illumination, rule)


def _transmitted(medium: Medium, illumination: str) -> float:
    here, answer = _answer(medium, 0.0, illumination)
    return float(here.weight @ (answer.phi * answer.down)) + fluence.straight_through(here, illumination, STANDARD)


def _specular(medium: Medium, illumination: str) -> float:
    """As `mcml_sim.simulate` counts it: of a single pane of clear glass, all that comes back."""
    if illumination == "searchlight":
        return fresnel.specular_reflectance(medium)
    return 1 - entered(Setting(illumination, n=medium.layers[0].n / medium.n_above))


@dataclass(frozen=True)
class _Difference:
    """A stack's profile less what is known of it, by wave number, and what is known."""

    here: Stack
    """Of k = 0."""
    medium: Medium
    illumination: str
    base: Layer | None
    """The layer whose half space is taken away; None where nothing is."""
    edges: Floats
    """Of panels of k, (panels + 1,) [1/length]."""
    beyond_once: Floats
    """Transform of the difference without what was scattered once and goes straight out, (panels, WAVE_NODES) [-]."""
    whole: Floats
    """Transform of the difference, (panels, WAVE_NODES) [-]."""

    def profile(self, r: Floats) -> Floats:
        """R_d [1/length^2], (n,)."""
        source = 0.0 if self.medium.layers[0].mu_s == 0 else np.inf
        near = np.clip(r, 1e-9 / self._mu_t, 1e30 / self._mu_t)
        value = self._inverse(near, self.beyond_once, 0) / (2 * np.pi) + self._once(near, self.medium)
        if self.base is not None:
            light = Setting(self.illumination, n=self.here.above)
            value += half_space.profile(near, self.base.alpha, self.base.mfp, light)
            value -= self._once(near, _alone(self.medium, self.base))
        return np.where(r == np.inf, 0.0, np.where((r == 0) & (source > 0), np.inf, value))
