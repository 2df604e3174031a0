"""Light of media that scatter forward, traced: rings of a half space or stack, and the law of one half space.

Exact light of a stack is known for isotropic scattering only. Similar media are no substitute: with g = 0.9 and the
same reduced coefficients A differs by up to a sixth, R_d within a mean free path by more than its half.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, Layer, Medium, Setting, exact, simulate
from profilefit.errors import InputError
from profilefit.fitting.solver import Solution, least_squares
from profilefit.laws.stack import LayerLaw
from profilefit.laws.two_parts import ForwardHalfSpace
from profilefit.recipes.run import PHOTONS, RecipeRun

Floats = NDArray[np.float64]
HALF_SPACE_PHOTONS, STACK_PHOTONS = 2**22, 2**21
LEAST = 2**17  # photons: with 20 000, sums of seven Gaussians have no optimum
RINGS = 120
NEAREST, FARTHEST, SLOWEST = 0.01, 40.0, 0.03  # mean free paths; decay lengths; the least rate that these are of
LAST_SHARE = 0.997
RESOLVED = 0.01  # of a ring: noise below it weighs no less, since the law is no better
# ln of h, a, b of light scattered once, and of h, a, b, c of the rest [in l*]: from about what tissue has.
STARTS = ((0.2, -0.5, -2.0, -0.7, -0.8, -2.3, -2.0), (0.8, -1.0, -3.0, 0.3, -0.8, -2.5, -1.0))
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
    whole = tally.diffuse_reflectance
    counts = (energy > 0) & (np.cumsum(energy) <= LAST_SHARE * float(whole.value)) & (np.arange(energy.size) > 0)
    noise = np.where(counts, error / np.where(energy > 0, energy, 1.0), 0.0)
    weight = np.where(counts, 1.0 / np.hypot(RESOLVED, noise), 0.0)
    weight /= np.sqrt(np.sum(weight**2))
    return TracedRings(
        edges, np.where(counts, energy, 1.0), weight, noise, float(whole.value), float(whole.standard_error)
    )


def ring_edges(first: Layer, layers: tuple[Layer, ...]) -> Floats:
    """Return edges from the source as far as light of the slowest layer goes [length]."""
    near = NEAREST * first.similar.mfp
    rates = [max(float(exact.decay_rate(one.similar.alpha)), SLOWEST) / one.similar.mfp for one in layers]
    return np.append(0.0, np.geomspace(near, FARTHEST / min(rates), RINGS))


def half_space(layer: Layer, setting: Setting, tracing: Tracing = USUAL, offset: int = 0) -> LayerLaw:
    """Fit the law of a layer's half space to traced light, in similar lengths and albedo; offset  of the seed."""
    own = replace(setting, g=layer.g)
    similar = layer.similar
    edges = ring_edges(layer, (layer,))
    medium = Medium((replace(layer, thickness=np.inf),), layer.n / setting.n)
    rings = tracing.rings(medium, setting.illumination, edges, HALF_SPACE_PHOTONS, offset)
    data = (rings.edges / similar.mfp, rings.energy, rings.weight)

    def residual(parameters, light):
        at, energy, weight = light
        within = _law(own, similar.alpha, rings.whole, parameters).unscaled_energy(at, jnp.asarray(0.0))
        return weight * (jnp.diff(within) / energy - 1.0)

    found: list[Solution] = [least_squares(residual, np.array(start), data) for start in STARTS]
    best = min(found, key=lambda one: one.cost if np.isfinite(one.cost) else np.inf)
    with jax.enable_x64(True):
        law = jax.tree.map(float, _law(own, similar.alpha, rings.whole, jnp.asarray(best.parameters)))
    return LayerLaw(own, law, similar.alpha, similar.mfp)


def _law(setting: Setting, albedo: float, whole: float, parameters) -> ForwardHalfSpace:
    values = dict(zip(FITTED, jnp.exp(parameters), strict=True))
    return ForwardHalfSpace(setting, albedo, whole, **values)
