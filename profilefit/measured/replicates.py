"""Standard errors from few replicates: moderated variances, each row's own shrunk towards the trend of all rows.

The standard deviation of three replicates is known to a factor of two, and a fit that uses it gives most weight to the
rows that agree by accident. Smyth (Stat. Appl. Genet. Mol. Biol. 3, 2004) and Phipson et al. (Ann. Appl. Stat. 10,
2016): the true variances of the rows scatter around a trend like a scaled inverse chi-square, whose spread shows in the
observed ones; each row's variance is then its own and the trend's, weighted by the degrees of freedom of both.

Errors that are estimates make weights that are estimates, and the inverse of the summed weights is too small an error
of what is fitted: `widening` is Meier's factor (Biometrics 9, 1953; Kenward and Roger, Biometrics 53, 1997, for fits).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

Floats = NDArray[np.float64]
FEWEST = 3  # replicates of a row
MOST_PRIOR = 1e6  # degrees of freedom that stand for infinitely many: all variances lie on the trend
LEAST_POOLED = 1.0
LEAST_RISE = 1e-6  # of ln |mean|, which a trend is taken over


@dataclass(frozen=True, eq=False)
class ModeratedVariance:
    """Means of replicates.

    value, sigma    (n,) means and their standard errors
    freedom         (n,) degrees of freedom that each sigma rests on: its own, and as many of the trend as count
    pooled          degrees of freedom that the trend rests on, which all sigmas share
    """

    value: Floats
    sigma: Floats
    freedom: Floats
    pooled: float


def moderated_variances(samples: Floats) -> ModeratedVariance:
    """Mean and standard error of each row, from samples (n, k), k >= 3.

    The trend is a straight line of ln variance over ln |mean|: gain noise (slope 2), counts (1) and a floor (0) alike.
    """
    count = samples.shape[1]
    mean, variance = samples.mean(axis=1), samples.var(axis=1, ddof=1)
    own = count - 1.0
    usable = variance > 0
    pooled = trend_freedom(int(np.count_nonzero(usable)), own)
    if np.count_nonzero(usable) < FEWEST:
        return ModeratedVariance(mean, np.sqrt(variance / count), np.full(mean.size, own), pooled)
    # ln s^2 of own degrees of freedom lies below ln sigma^2 by this much, on average.
    level = np.log(variance[usable]) - digamma(own / 2) + np.log(own / 2)
    height = np.log(np.maximum(np.abs(mean), np.abs(mean).max() * 1e-12))
    # Rows of one height have a level, and no slope.
    slope, start = np.polyfit(height[usable], level, 1) if np.ptp(height[usable]) > LEAST_RISE else (0.0, level.mean())
    trend = start + slope * height
    left = level - trend[usable]
    spread = float(left @ left) / max(left.size - 2, 1) - float(polygamma(1, own / 2))
    prior = _freedom(spread)
    # The mean of ln sigma^2 over the rows stands for s0^2 by the same rule.
    with np.errstate(over="ignore"):  # of a row far outside of the others, which do not inform it then
        centre = np.exp(trend + digamma(prior / 2) - np.log(prior / 2))
    both = (prior * centre + own * variance) / (prior + own)
    return ModeratedVariance(mean, np.sqrt(both / count), np.full(mean.size, min(prior, pooled) + own), pooled)


def trend_freedom(rows: int, own: float) -> float:
    """Degrees of freedom of a line through ln s^2 of rows of `own` each: .61 own (rows - 2) from three replicates.

    The level has variance trigamma(own / 2) / rows, a scaled chi-square of d degrees 2 / d; the line takes two rows.
    """
    return max(2.0 * (rows - 2) / float(polygamma(1, own / 2)), LEAST_POOLED)


def widening(freedom: Floats, free: int) -> float:
    """Factor on the variances of `free` coordinates fitted with weights of `freedom` (n,): 1 where errors are known.

    Meier's 1 + 4 sum p (1 - p) / d for n rows of leverage free / n, with d - 1 for d: his is the first term of a
    series, short at the three or four degrees that three replicates leave where rows differ. Measured with it, and
    Student's quantile of `pooled`, 95 % intervals hold in 93 to 98 % (tests: 3 to 10 replicates).
    """
    return 1.0 + 4.0 * (1.0 - free / freedom.size) * float(np.mean(1.0 / (freedom - 1.0)))


def _freedom(spread: float) -> float:
    """Degrees of freedom d of the prior whose ln variance scatters with trigamma(d/2) = `spread`."""
    if spread <= polygamma(1, MOST_PRIOR / 2):
        return MOST_PRIOR
    return float(np.exp(brentq(lambda x: polygamma(1, np.exp(x) / 2) - spread, np.log(1e-3), np.log(MOST_PRIOR))))
