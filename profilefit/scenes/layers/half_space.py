"""One half space in place of a stack: the one of its reflectance whose light near a step edge is nearest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import Medium
from profilefit.errors import InputError
from profilefit.fitting.solver import differences, solve
from profilefit.recipes.stack.fit import NODES

WHITE = 1e-6  # 1 - alpha of the whitest half space that stands for a stack
RINGS, NEAREST, FARTHEST = 200, 1e-3, 200.0  # that light is summed over [mfp]
PLACES = 40  # beside the edge
SPAN = 4.5  # of l, over the first guess and under it, that is searched
STEP = 0.02  # of the first guess, for derivatives: on a smaller scale the rings make the misfit uneven
TOLERANCE = 1e-5  # of l


@dataclass(frozen=True)
class RingShares:
    """Shares of the light that leaves (rings,) in each ring of the radii, with their standard errors [-]."""

    radius: Floats
    share: Floats
    error: Floats

    @classmethod
    def of(cls, edges: Floats, energy: ArrayLike, error: ArrayLike) -> RingShares:
        """Return shares of energy and errors (rings,), the last beyond the last edge; edges  (rings,), from 0."""
        middle = np.append(np.sqrt(np.maximum(edges[:-1], 0.25 * edges[1]) * edges[1:]), edges[-1])
        value = np.asarray(energy, float)
        return cls(middle, value / value.sum(), np.asarray(error, float) / value.sum())

    def beyond(self, d: Floats, share: Floats | None = None) -> Floats:
        """Return F(d), the share from beyond an edge at each distance (m,)."""
        across = np.arccos(np.minimum(d[:, None] / self.radius, 1.0)) / np.pi
        return (self.share if share is None else share) @ across.T


class OneHalfSpace(NamedTuple):
    """Half space that is nearest to a stack.

    alpha  whose reflectance is the stack's [-];  mfp  with which it is nearest near an edge of light [length]
    error  root mean square there of what it is wrong by, as a share of white [-];  reflectance  A of both [-]
    """

    alpha: float
    mfp: float
    error: float
    reflectance: float


@lru_cache(maxsize=32)
def one_half_space(medium: Medium, illumination: str = "diffuse", within: float = 4.0) -> OneHalfSpace:
    """Return one half space in place of a stack, by exact light up to so many mean free paths from a step edge.

    InputError as of `exact.solve`, and where no half space reflects as much. Seconds.
    """
    stack = exact.solve(medium, illumination, NODES)
    setting = Setting(illumination, n=medium.layers[0].n / medium.n_above)
    whole = stack.reflectance
    alpha = albedo_of(whole, lambda alpha: float(exact.reflectance(alpha, setting)))
    unit = max(layer.mfp for layer in medium.layers if layer.mu_t > 0)
    edges = ring_edges()
    cdfs = (unit, stack.cdf(unit * edges)), (1.0, exact.cdf(edges, alpha, setting=setting))
    of_stack, of_one = (
        RingShares.of(length * edges, np.diff(np.append(cdf, 1.0)), np.zeros(edges.size)) for length, cdf in cdfs
    )
    mfp = nearest_length(of_stack, of_one, within)
    d = places(mfp, within)
    error = float(np.sqrt(np.mean((of_stack.beyond(d) - of_one.beyond(d / mfp)) ** 2)))
    return OneHalfSpace(alpha, mfp, whole * error, whole)


def albedo_of(whole: float, reflectance: Callable[[float], float]) -> float:
    """Return the albedo at which a half space reflects as much as a stack; InputError where none does.

    whole  A of the stack [-];  reflectance  alpha -> A of the half space [-]
    """
    most = reflectance(1.0 - WHITE)
    if not 0 < whole < most:
        raise InputError(f"layers must reflect a share in (0, {most:.3f}) of the light, got {whole:.3f}")
    return float(brentq(lambda alpha: reflectance(alpha) - whole, 0.0, 1.0 - WHITE))


def ring_edges(shortest: float = 1.0, longest: float = 1.0) -> Floats:
    """Return edges from 0 of the rings that light is summed over, for mean free paths of these lengths [length]."""
    return np.append(0.0, np.geomspace(NEAREST * shortest, FARTHEST * longest, RINGS))


def places(mfp: float, within: float) -> Floats:
    """Return distances from an edge that are judged, up to so many mean free paths [length]."""
    return within * mfp * (np.arange(PLACES) + 0.5) / PLACES


def nearest_length(stack: RingShares, half_space: RingShares, within: float) -> float:
    """Return the mean free path of a half space, whose rings are in it, that makes the difference at an edge least."""

    def quartile(rings: RingShares) -> float:
        return float(brentq(lambda u: float(rings.beyond(np.exp([u]))[0]) - 0.25, *np.log(rings.radius[[0, -1]])))

    first = np.exp(quartile(stack) - quartile(half_space))

    def residual(mfp: Floats) -> Floats:
        d = places(float(mfp[0]), within)
        return stack.beyond(d) - half_space.beyond(d / mfp)

    bounds = first / SPAN, first * SPAN
    found = solve(differences(residual, STEP * first), np.array([first]), bounds, tolerance=TOLERANCE)
    return float(found.parameters[0])
