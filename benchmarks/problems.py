"""Problems that are timed: the yardsticks and the tracer on the same ones."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import scalar_half_space
import scalar_layered

from mcml_sim import Grid, Layer, Medium, Orders, Tally, half_space, simulate, simulate_orders
from mcml_sim.tracing import layered_batch, matched_batch, orders_batch, rng
from mcml_sim.tracing.order_bins import bins_of
from profilefit.studies.tradeoff.stopwatch import Work

ALPHA = 0.9
# Rings and depths of the half space, in mean free paths: the last bins of the yardstick hold what is beyond.
DR, NR, DZ, NZ = 0.01, 1000, 0.02, 50
ORDER_RINGS = Grid.from_edges(r=np.concatenate([[0.0], np.geomspace(0.01, 5.0, 101)]))
# The sample that MCML ships (Wang & Jacques 1992), in cm, on a grid like its own.
THREE_LAYERS = Medium(
    (
        Layer(n=1.37, mu_a=1.0, mu_s=100.0, g=0.9, thickness=0.1),
        Layer(n=1.37, mu_a=1.0, mu_s=10.0, g=0.0, thickness=0.1),
        Layer(n=1.37, mu_a=2.0, mu_s=10.0, g=0.7, thickness=0.2),
    )
)
EXITS = Grid(0.01, 50, na=30)
EXITS_AND_RZ = Grid(0.01, 50, 0.01, 40, na=30)
QUANTITIES = ("diffuse_reflectance", "transmittance", "absorbed")


@dataclass(frozen=True)
class Sizes:
    """Numbers of photons that each work traces in one turn."""

    yardstick: int
    layered_yardstick: int
    half_space: int
    layered: int
    orders: int


FULL = Sizes(yardstick=500_000, layered_yardstick=200_000, half_space=2**22, layered=2**20, orders=2**23)
QUICK = Sizes(yardstick=50_000, layered_yardstick=20_000, half_space=2**19, layered=2**17, orders=2**20)


def yardstick(photons: int, tally_rz: bool, alpha: float = ALPHA) -> Work:
    """Trace the scalar half space."""

    def work(seed: int) -> int:
        reflected, absorbed = np.zeros(NR), np.zeros((NR, NZ)) if tally_rz else None
        scalar_half_space.trace(seed, photons, 1 - alpha, alpha, DR, reflected, absorbed, DZ)
        return photons

    return work


def yardstick_events(photons: int = 200_000, alpha: float = ALPHA) -> float:
    """Return the events per photon of the scalar half space."""
    return scalar_half_space.trace(0, photons, 1 - alpha, alpha, DR, np.zeros(NR), None, DZ)[0] / photons


def layered_yardstick(photons: int, tally_rz: bool) -> Work:
    """Trace the three-layer sample by the scalar tracer of layers."""

    def work(seed: int) -> int:
        scalar_layered.trace(THREE_LAYERS, EXITS_AND_RZ, photons, seed, tally_rz)
        return photons

    return work


def half_space_grid(tally_rz: bool) -> Grid:
    """Return the bins of the scalar half space."""
    return Grid(DR, NR, DZ, NZ) if tally_rz else Grid(DR, NR)


def half_space_tally(photons: int, tally_rz: bool, seed: int, workers: int = 1) -> Tally:
    """Run `simulate` on the scalar half space's problem."""
    return simulate(half_space(ALPHA), half_space_grid(tally_rz), photons, seed, workers=workers, progress=False)


def half_space_by_layers(photons: int, tally_rz: bool) -> Work:
    """Run the kernel for any layers, which `simulate` does not take for it, on the same problem."""

    def work(seed: int) -> int:
        for batch, first in enumerate(range(0, photons, layered_batch.BATCH_PHOTONS)):
            number = min(layered_batch.BATCH_PHOTONS, photons - first)
            layered_batch.trace_batch(half_space(ALPHA), half_space_grid(tally_rz), seed, batch, number)
        return photons

    return work


def half_space_events(photons: int = 2**18) -> float:
    """Return events per photon of `half_space_tally`: scatterings, and the last flight as the yardstick counts it."""
    stops = jnp.asarray(matched_batch.weights(ALPHA).stops)
    ends = orders_batch.trace(jnp.asarray(rng.batch_key(0, 0)), jnp.int32(photons), stops)
    return float(np.abs(np.asarray(ends.order)).sum() / photons) + 1


def layered_tally(photons: int, tally_rz: bool, seed: int, workers: int = 1) -> Tally:
    """Run `simulate` on the three-layer sample."""
    return simulate(THREE_LAYERS, EXITS_AND_RZ if tally_rz else EXITS, photons, seed, workers=workers, progress=False)


def orders(photons: int, seed: int, workers: int = 1) -> Orders:
    """Run `simulate_orders` on the rings of the time to accuracy."""
    return simulate_orders(ORDER_RINGS, photons, seed, workers=workers, progress=False)


def order_events(run: Orders) -> float:
    """Return scatterings per photon of `simulate_orders`, of those that roulette or the cap ended too.

    Where roulette raises the weight from w to w' as many photons end, on average, as go on times w'/w - 1. So how many
    ended at which order follows from how many left after it; that it adds up to the run's own number is checked.
    """
    heavier = np.append(run.weights(1.0)[1:] / run.weights(1.0)[:-1] - 1, 0.0)
    left = run.counts.exits.sum(axis=0)
    beyond, ended = float(run.counts.cut), 0.0
    last_orders = bins_of(run.setting).last_orders
    events = beyond * last_orders[-1]
    for at in reversed(range(left.size)):
        stopped = beyond * heavier[at]
        events += stopped * last_orders[at] + left[at] * run.orders[at]
        ended += stopped
        beyond += stopped + left[at]
    if abs(ended - run.counts.rouletted) > 0.01 * run.photons:
        raise RuntimeError(f"{run.counts.rouletted} photons ended by roulette, but {ended:.0f} should have")
    return float(events / run.photons)


def works(sizes: Sizes) -> dict[str, Work]:
    """Return all that one core is timed on, by name."""
    return {
        "yardstick": yardstick(sizes.yardstick, tally_rz=False),
        "yardstick, r-z": yardstick(sizes.yardstick, tally_rz=True),
        "orders": lambda seed: orders(sizes.orders, seed).photons,
        "half space": lambda seed: half_space_tally(sizes.half_space, False, seed).photons,
        "half space, r-z": lambda seed: half_space_tally(sizes.half_space, True, seed).photons,
        "half space by layers": half_space_by_layers(sizes.half_space // 4, tally_rz=False),
        "half space by layers, r-z": half_space_by_layers(sizes.half_space // 4, tally_rz=True),
        "layered yardstick": layered_yardstick(sizes.layered_yardstick, tally_rz=False),
        "three layers": lambda seed: layered_tally(sizes.layered, False, seed).photons,
        "layered yardstick, r-z": layered_yardstick(sizes.layered_yardstick, tally_rz=True),
        "three layers, r-z": lambda seed: layered_tally(sizes.layered, True, seed).photons,
    }


def yardstick_variance(blocks: int = 400, photons: int = 2000) -> tuple[float, float]:
    """Return the diffuse reflectance of the scalar half space: mean, and variance of one photon."""
    means = np.empty(blocks)
    for block in range(blocks):
        reflected = np.zeros(NR)
        scalar_half_space.trace(10_000 + block, photons, 1 - ALPHA, ALPHA, DR, reflected, None, DZ)
        means[block] = reflected.sum() / photons
    return float(means.mean()), float(means.var(ddof=1) * photons)


def layered_yardstick_variances(blocks: int = 400, photons: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Return QUANTITIES of the three-layer sample by the scalar tracer: means (3,), and variances of one photon (3,).

    A variance between 400 blocks is known to sqrt(2 / 399), 7 %.
    """
    means = np.empty((blocks, len(QUANTITIES)))
    for block in range(blocks):
        sums = scalar_layered.trace(THREE_LAYERS, EXITS, photons, 10_000 + block, tally_rz=False)
        means[block] = [s.sum() / photons for s in (sums.reflected, sums.transmitted, sums.absorbed_rz)]
    return means.mean(axis=0), means.var(axis=0, ddof=1) * photons
