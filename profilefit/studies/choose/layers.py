"""One layer for many: a stack of layers against the half space that is nearest to it at a step edge of light.

By exact light where all layers scatter isotropically under one index; else both are traced, the stack as it is, and a
half space of the upper layer's index that scatters alike in all directions, at every albedo from one run. The half
space's albedo is the one that gives the stack's reflectance back; its mean free path is the one whose light near an
edge is nearest to the stack's.

The error of single scattering that leaves like all other light says whether it needs a pass of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcml_sim import Estimate, Grid, Medium, Setting, simulate, simulate_orders
from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.recipes.stack.file import LayerStack
from profilefit.scenes.layers import half_space
from profilefit.scenes.layers.half_space import RingShares
from profilefit.scenes.layers.passes import alike_error
from profilefit.studies.choose.case import Within

FEWEST, MOST = 2**18, 2**22  # photons
PRECISE = 10.0  # photons as its square over that of the tolerance: the light's error is then a twentieth of it
REPLICATES, SEED = 200, 1
SURE = 2.0  # standard errors


@dataclass(frozen=True)
class OneLayer:
    """The half space nearest to a stack.

    reflectance  A of both [-];  alpha, mfp  of the half space [-], [unit];  n  of its surface [-]
    error        root mean square, near a step edge, of what it is wrong by, as a share of white, less what the photons'
                 noise adds;  standard_error  of that;  photons  of each run, 0 where light is exact
    single       mean error, as a share of white, of light scattered once if it leaves in all directions alike; exact
    """

    reflectance: float
    alpha: float
    mfp: float
    n: float
    error: float
    standard_error: float
    photons: int
    single: float

    def verdict(self, tolerance: float) -> str:
        """Return whether it is within the tolerance: "enough", "not enough", or "undecided" by so many photons."""
        if self.error + SURE * self.standard_error <= tolerance:
            return "enough"
        return "not enough" if self.error - SURE * self.standard_error > tolerance else "undecided"


def one_layer(
    stack: Medium,
    tolerance: float,
    within: Within,
    photons: int | None = None,
    progress: bool | None = None,
    illumination: str = "searchlight",
) -> OneLayer:
    """Compare both, by exact light or traced; InputError where nothing comes back. Seconds to a minute.

    tolerance  share of white, which says how many photons it takes, unless `photons` does
    progress   show a bar on stderr; by default only if that is a terminal
    """
    first = stack.layers[0]
    n = first.n / stack.n_above
    is_isotropic = all(layer.g == 0 and layer.n == first.n and layer.mu_t > 0 for layer in stack.layers)
    # Exact light is known of the stack, and of the half spaces that are tried for it.
    is_solved = is_isotropic and stack.is_half_space and first.n >= stack.n_above and first.mu_s > 0
    if photons is None and is_solved:
        near = half_space.one_half_space(stack, illumination, within.mfp)
        return OneLayer(near.reflectance, near.alpha, near.mfp, n, near.error, 0.0, 0, alike_error(stack))
    number = int(np.clip((PRECISE / tolerance) ** 2, FEWEST, MOST)) if photons is None else photons
    reduced = [layer.mu_a + layer.mu_s * (1.0 - layer.g) for layer in stack.layers]
    lengths = [1.0 / mu for mu in reduced if mu > 0]
    if not lengths:
        raise InputError(f"layers must scatter or absorb somewhere, got {len(reduced)} that are clear")
    edges, scaled = half_space.ring_edges(min(lengths), max(lengths)), half_space.ring_edges()
    tally = simulate(stack, Grid.from_edges(r=edges), number, seed=SEED, progress=progress, illumination=illumination)
    reflectance = float(tally.diffuse_reflectance.value)
    setting = Setting(illumination, n)
    white = simulate_orders(Grid.from_edges(r=scaled), number, seed=SEED + 1, setting=setting, progress=progress)
    alpha = half_space.albedo_of(reflectance, lambda alpha: float(white.reflectance(alpha).value))
    of_stack = _rings(edges, tally.reflectance_r.scaled(tally.grid.r_areas), tally.reflectance_r_overflow)
    of_one = _rings(scaled, white.energy(alpha), white.overflow(alpha))
    mfp = half_space.nearest_length(of_stack, of_one, within.mfp)
    error, standard_error = _difference(of_stack, of_one, mfp, within)
    errors = reflectance * error, reflectance * standard_error
    return OneLayer(reflectance, alpha, mfp, n, *errors, number, alike_error(stack))


def of_each_colour(
    stack: LayerStack, tolerance: float, within: Within, progress: bool | None = None, illumination: str = "searchlight"
) -> tuple[OneLayer, ...]:
    """Return `one_layer` of red, green and blue, equal ones traced once; of one alone where all three are equal."""
    layers = {
        medium: one_layer(medium, tolerance, within, progress=progress, illumination=illumination)
        for medium in dict.fromkeys(stack.media)
    }
    return tuple(layers[medium] for medium in stack.media[: 1 if stack.is_grey else None])


def _rings(edges: Floats, energy: Estimate, overflow: Estimate) -> RingShares:
    """Return shares of rings, with one ring more at the last edge for the light beyond it."""
    spread = np.append(energy.standard_error, overflow.standard_error)
    return RingShares.of(edges, np.append(energy.value, overflow.value), spread)


def _difference(stack: RingShares, one: RingShares, mfp: float, within: Within) -> tuple[float, float]:
    """Return the root mean square difference and its standard error, by replicates of both with their rings' errors."""
    random, d = np.random.default_rng(SEED), half_space.places(mfp, within.mfp)
    apart = stack.beyond(d) - one.beyond(d / mfp)

    def drawn(rings: RingShares, at: Floats) -> Floats:
        noise = rings.error * random.standard_normal((REPLICATES, rings.error.size))
        return rings.beyond(at, noise - noise.sum(axis=1, keepdims=True) * rings.share)

    noise = drawn(stack, d) - drawn(one, d / mfp)
    squares = np.mean((apart + noise) ** 2, axis=1)
    true = max(float(np.mean(apart**2) - np.mean(noise**2)), 0.0)
    return float(np.sqrt(true)), float(np.std(np.sqrt(squares)))
