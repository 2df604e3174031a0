"""Time until every ring is known to 1 %, at 32 albedos: by 32 scalar runs, and by one order-resolved run.

A run of N photons knows a ring with the relative variance v / N; it takes N = v / 1e-4 photons to reach 1 %, and N over
the photons a second is the time. So the time is measured as variance times time, by runs shorter than it. A scalar run
needs the v of its worst ring; the order-resolved run that of the worst ring at the worst albedo.

v comes from second moments, not from scatter: where a ring is rarely hit, scatter is as rare. The mean of a ring is the
exact one. In the scalar run a photon that leaves after n scatterings weighs w_n = alpha^n 10^j, having won j rounds of
roulette, the same for all of them; so its second moment is the sum of P_n(ring) w_n^2 10^-j, where P_n, the probability
of leaving a conservative half space through the ring after n scatterings, is exact for n = 1 and comes from a long
order-resolved run beyond. Where scalar runs do hit, `check` compares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import problems
import scalar_half_space
from numpy.typing import NDArray
from scalar_half_space import ROULETTE_CHANCE, WEIGHT_THRESHOLD

from mcml_sim import Orders, exact
from mcml_sim.exact import single_scattering
from mcml_sim.tracing.order_bins import OrderBins
from profilefit.studies.tradeoff.stopwatch import take_turns

Floats = NDArray[np.float64]

ALPHAS = 1 - np.linspace(0.97, 0.07, 32) ** 2
ACCURACY = 0.01  # relative standard error of every ring
ORDERS = OrderBins()
FIRST_RING = 1  # the disc inside the innermost of the 100 rings is not one of them


@dataclass(frozen=True)
class Need:
    """Work until every ring is known to 1 %."""

    scalar_photons: Floats
    """Photons of the scalar runs by albedo, (32,)."""
    scalar_seconds: Floats
    orders_photons: float
    orders_seconds: float
    worst_alpha: float
    worst_ring: float
    """Middle of the ring that needs most of the order-resolved run's photons [mfp]."""

    @property
    def ratio(self) -> float:
        """Time of the scalar runs over that of the one run."""
        return float(self.scalar_seconds.sum() / self.orders_seconds)


def ring_energy(alphas: Floats) -> Floats:
    """Return Exact share of light in each ring, (alphas, rings)."""
    edges = problems.ORDER_RINGS.r_edges
    return np.diff(exact.cdf(edges, alphas[:, None]), axis=1) * np.asarray(exact.reflectance(alphas))[:, None]


def exit_probabilities(run: Orders) -> Floats:
    """Return P_n of a photon where alpha = 1, by ring and bin of order, (rings, bins)."""
    probabilities = run.ring_order_counts * run.weights(1.0) / run.photons
    probabilities[:, 0] = single_scattering.ring_shares(run.grid.r_edges)[:-1]
    return probabilities


def scalar_second_moments(alphas: Floats, probabilities: Floats) -> Floats:
    """Return the mean squared weight that one scalar photon brings to each ring, (alphas, rings)."""
    moments = np.empty((alphas.size, probabilities.shape[0]))
    for row, alpha in enumerate(alphas):
        by_order = np.empty(ORDERS.max_order)
        weight, chance = 1.0, 1.0
        for n in range(by_order.size):
            weight *= alpha
            if weight < WEIGHT_THRESHOLD:
                weight, chance = weight / ROULETTE_CHANCE, chance * ROULETTE_CHANCE
            by_order[n] = weight**2 * chance
        moments[row] = probabilities @ ORDERS.mean(by_order)
    return moments


def relative_variances(run: Orders) -> tuple[Floats, Floats]:
    """Return v of one scalar photon, and of one order-resolved photon, each (32, 100)."""
    energy = ring_energy(ALPHAS)[:, FIRST_RING:]
    moments = scalar_second_moments(ALPHAS, exit_probabilities(run))[:, FIRST_RING:]
    of_orders = run.energy(ALPHAS).standard_error[:, FIRST_RING:]
    return moments / energy**2 - 1, run.photons * of_orders**2 / energy**2


def measure(run: Orders, photons_a_second: float, photons: int, turns: int) -> Need:
    """Measure the work, by a long order-resolved run and the rate of such runs; scalar runs have `photons` each."""
    scalar, of_orders = relative_variances(run)
    works = {str(i): problems.yardstick(photons, False, alpha) for i, alpha in enumerate(ALPHAS)}
    rates = take_turns(works, turns)
    scalar_photons = scalar.max(axis=1) / ACCURACY**2
    seconds = scalar_photons / [rates.best(str(i)) for i in range(ALPHAS.size)]
    needed = float(of_orders.max()) / ACCURACY**2
    worst_alpha, worst_ring = np.unravel_index(np.argmax(of_orders), of_orders.shape)
    edges = run.grid.r_edges[FIRST_RING + worst_ring : FIRST_RING + worst_ring + 2]
    return Need(
        scalar_photons, seconds, needed, needed / photons_a_second, float(ALPHAS[worst_alpha]), float(edges.mean())
    )


def check(run: Orders, alpha: float, photons: int) -> Floats:
    """Return z of the squared weights that a scalar run brings to rings, against `scalar_second_moments`.

    The error of a mean of squares would need fourth powers; so many photons of nearly one weight hit a ring that
    Poisson's, and as much for the run behind the prediction, is it nearly.
    """
    edges = run.grid.r_edges
    _, squares = scalar_half_space.squares(1, photons, 1 - alpha, alpha, edges)
    probabilities = exit_probabilities(run)
    expected = scalar_second_moments(np.array([alpha]), probabilities)[0]
    fourth = scalar_second_moments(np.array([alpha**2]), probabilities)[0]
    often = photons * expected**2 / fourth > 100
    return ((squares[:-1] / photons - expected) / np.sqrt(fourth / photons))[often]
