"""An ensemble of walkers over any density: long enough for its own autocorrelation time, or it says that it is not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# emcee's own advice: a chain shorter than this many autocorrelation times does not know its autocorrelation time.
LENGTHS = 50
FIRST_LOOK = 1000  # steps after which the autocorrelation time is estimated first
HALVINGS = 20
Moves = Sequence[tuple[emcee.moves.Move, float]]


def default_moves() -> Moves:
    """Differential evolution with snooker steps: a third of the evaluations of stretches (`benchmarks.moves`).

    With three or four constants draws from a kernel density take a third of these again.
    """
    return (emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)


@dataclass(frozen=True)
class Walk:
    """Chains of walkers.

    samples     (k, p) draws after burn-in, thinned, all walkers of a step together; log_density (k,) there
    tau         the longest integrated autocorrelation time of any coordinate [steps]
    acceptance  mean share of accepted proposals; walkers, steps of the chain
    result      "converged" or what is missing
    """

    samples: Floats
    log_density: Floats
    tau: float
    acceptance: float
    walkers: int
    steps: int
    result: str


def walk(
    log_density: Callable[[Floats], Floats],
    start: Floats,
    centre: Floats,
    seed: int,
    max_steps: int,
    kept: int,
    moves: Moves | None = None,
) -> Walk:
    """Walk from `start` (walkers, p) until the chain is 50 autocorrelation times long, or `max_steps`.

    log_density  of points (m, p), (m,), vectorised; -inf where there is none. A walker that starts there moves towards
                 `centre` (p,), by halves
    kept         how many draws to keep at most; moves emcee's, with their weights
    """
    start = start.copy()
    for _ in range(HALVINGS):
        outside = ~np.isfinite(log_density(start))
        start[outside] = 0.5 * (start[outside] + centre)
    sampler = emcee.EnsembleSampler(*start.shape, log_density, vectorize=True, moves=list(moves or default_moves()))
    sampler.random_state = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed))).get_state()
    tau, steps = _long_enough(sampler, start, max_steps)
    enough = np.isfinite(tau) and steps >= LENGTHS * tau
    burn = int(min(steps // 2, 5 * tau if np.isfinite(tau) else steps // 2))
    keep = np.linspace(burn, steps - 1, max(min(kept // len(start), steps - burn), 1)).astype(int)
    samples, density = sampler.get_chain()[keep].reshape(-1, start.shape[1]), sampler.get_log_prob()[keep].ravel()
    result = "converged" if enough else f"chain of {steps} steps is under {LENGTHS} autocorrelation times ({tau:.0f})"
    return Walk(samples, density, tau, float(np.mean(sampler.acceptance_fraction)), len(start), steps, result)


def _long_enough(sampler: emcee.EnsembleSampler, start: Floats, max_steps: int) -> tuple[float, int]:
    """Run in doubling stretches until the chain is long enough for its own autocorrelation time."""
    steps, state = min(FIRST_LOOK, max_steps), start
    while True:
        state = sampler.run_mcmc(state, steps - sampler.iteration, progress=False)
        tau = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
        if sampler.iteration >= max_steps or (np.isfinite(tau) and sampler.iteration >= LENGTHS * tau):
            return tau, sampler.iteration
        steps = min(2 * sampler.iteration, max_steps)
