"""A measured profile: reflectance at radii or averaged over annuli, with its errors and source; what a fit accepts.

Standard errors from few replicates are moderated: each row's variance is shrunk towards the trend of all rows. The
standard deviation of three replicates is known to a factor of two, and a fit that uses it gives most weight to the rows
that agree by accident. Smyth (Stat. Appl. Genet. Mol. Biol. 3, 2004) and Phipson et al. (Ann. Appl. Stat. 10, 2016):
the true variances of the rows scatter around a trend like a scaled inverse chi-square, whose spread shows in the
observed ones; each row's variance is then its own and the trend's, weighted by the degrees of freedom of both.

Errors that are estimates make weights that are estimates, and the inverse of the summed weights is too small an error
of what is fitted: `widening` is Meier's factor (Biometrics 9, 1953; Kenward and Roger, Biometrics 53, 1997, for fits).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

from mcml_sim.media.arrays import Floats, shown
from mcml_sim.media.medium import Layer, Medium
from profilefit.errors import InputError

# The judgement of a misfit decomposes matrices of rows by rows: seconds at this many, minutes at four times as many.
MOST_ROWS = 500
# Products of four numbers in these bounds, as in a fourth moment, are floats; no unit of length or light is near them.
SMALLEST, LARGEST = 1e-40, 1e40
FINEST = 1e-12  # relative error; a law in double precision is rounded near it
FEWEST = 3  # replicates of a row
MOST_PRIOR = 1e6  # degrees of freedom that stand for infinitely many: all variances lie on the trend
LEAST_POOLED = 1.0
LEAST_RISE = 1e-6  # of ln |mean|, which a trend is taken over
# In millimetres.
UNITS = {
    "nm": 1e-6,
    "um": 1e-3,
    "µm": 1e-3,  # the micro sign
    "μm": 1e-3,  # the Greek letter, which looks alike
    "mm": 1.0,
    "cm": 10.0,
    "m": 1000.0,
    "in": 25.4,
    "inch": 25.4,
}
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*)")
PER_AREA = re.compile(
    r"1?\s*/\s*\(?\s*(?P<over>[^\W\d_]+)\s*(?:(?:\^|\*\*)?\s*2|²)\s*\)?"
    r"|(?P<power>[^\W\d_]+)\s*(?:(?:\^|\*\*)?\s*\(?[-−]2\)?|⁻²)"
)


@dataclass(frozen=True)
class Fact:
    """Fact that a comment of a table states, as text, and the line where it stands."""

    text: str
    line: int


@dataclass(frozen=True, eq=False)
class Measured:
    """Reflected light per area at n radii, or averaged over n annuli (rings).

    source     where it comes from, for messages; digest the SHA-256 of that file
    inner      (n,) inner radii of the rings [unit]; outer (n,) outer ones. A point is a ring without width
    value      (n,) reflected light per area and per incident light [1/unit^2]; in any other measure with a free scale
    sigma      (n,) standard errors of `value`
    freedom    (n,) degrees of freedom that each sigma rests on; infinite where it is known. pooled those of what all
               sigmas share, the trend of replicates
    errors     what the sigmas are, in words
    unit       of length; "" where nobody named one
    counted    True of photon counts: the variance of a ring is proportional to the light expected there, for which the
               model is a better estimate than the ring's own count. bounded: True if the sigmas are upper bounds
    photons    of the run that the rings come from, which correlates them (see `noise`); infinite if rows are
               independent
    medium     what a simulation was of, lengths in `unit`; None of what was measured
    illumination  under which light it was; None of what was measured
    notes      what was left out or merged, for the reader
    stated     what a table's comments state of light, n, g, beam and fibre
    """

    source: str
    digest: str
    inner: Floats
    outer: Floats
    value: Floats
    sigma: Floats
    freedom: Floats
    errors: str
    unit: str
    counted: bool = False
    bounded: bool = False
    pooled: float = np.inf
    photons: float = np.inf
    medium: Medium | None = None
    illumination: str | None = None
    notes: tuple[str, ...] = ()
    stated: Mapping[str, Fact] = field(default_factory=dict)

    @property
    def rings(self) -> bool:
        """True of averages over rings, False of values at radii."""
        return bool(np.all(self.outer > self.inner))

    @property
    def r(self) -> Floats:
        """(n,) radii, of rings the middles [unit]."""
        return 0.5 * (self.inner + self.outer)

    @property
    def relative_error(self) -> float:
        """Median of |sigma / value| [-]."""
        return float(np.median(np.abs(self.sigma) / np.maximum(np.abs(self.value), np.finfo(float).tiny)))

    @property
    def layer(self) -> Layer | None:
        """Layer of a simulated medium that scatters most, not the glass on top; None of what was measured."""
        return None if self.medium is None else max(self.medium.layers, key=lambda layer: layer.similar.mu_s)

    @property
    def n(self) -> float | None:
        """Refractive index of that layer over that above the medium [-]; None of what was measured."""
        return None if self.medium is None or self.layer is None else self.layer.n / self.medium.n_above

    @property
    def g(self) -> float | None:
        """Mean cosine of the scattering of that layer [-]; None of what was measured."""
        return None if self.layer is None or self.layer.phase else self.layer.g

    def within(self, r_min: float | None, r_max: float | None) -> Measured:
        """Return the rows that lie wholly between two radii [unit]; InputError if none does."""
        least, most = (-np.inf if r_min is None else r_min), (np.inf if r_max is None else r_max)
        keep = (self.inner >= least) & (self.outer <= most)
        if np.all(keep):
            return self
        if not np.any(keep):
            ends = f"from {self.inner[0]:g} to {self.outer[-1]:g}"
            raise InputError(f"{self.source}: no row is left between `r_min` and `r_max`: r goes {ends}")
        return self.chosen(keep, f"{np.sum(~keep)} of {keep.size} rows left out, by `r_min` and `r_max`")

    def chosen(self, keep: NDArray[np.bool_], *notes: str) -> Measured:
        """Return the rows where `keep` (n,) is true, with notes on it."""
        fields = ("inner", "outer", "value", "sigma", "freedom")
        rows: dict[str, Any] = {name: getattr(self, name)[keep] for name in fields}
        return replace(self, **rows, notes=(*self.notes, *notes))


def require_workable(data: Measured) -> None:
    """InputError, in one line, for data that no fit in double precision and in memory can work with."""
    if data.value.size > MOST_ROWS:
        raise InputError(
            f"{data.source}: expected at most {MOST_ROWS} rows, got {data.value.size}: average neighbours over annuli "
            "(r_in, r_out), or choose a range by `r_min` and `r_max`"
        )
    lit = np.where(data.value == 0, 1.0, data.value)  # no light is a value like any other
    for name, column in (("r", data.r), ("value", lit), ("sigma", data.sigma)):
        size = np.abs(column)
        wrong = ~((size >= SMALLEST) & (size <= LARGEST))
        if np.any(wrong):
            at = int(np.argmax(wrong))
            raise InputError(
                f"{data.source}: expected {name} between {SMALLEST:g} and {LARGEST:g} in size, got {column[at]:g} in "
                f"the row of r = {data.r[at]:g}; choose another unit"
            )
    fine = data.sigma < FINEST * np.abs(data.value)
    if np.any(fine):
        at = int(np.argmax(fine))
        raise InputError(
            f"{data.source}: expected sigma of at least {FINEST:g} of the value, got {data.sigma[at]:g} for "
            f"{data.value[at]:g} in the row of r = {data.r[at]:g}"
        )


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
    """Return mean and standard error of each row, from samples (n, k), k >= 3.

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
    # Degrees of freedom d of the prior, whose ln variance scatters with trigamma(d / 2) = `spread`.
    if spread <= polygamma(1, MOST_PRIOR / 2):
        prior = MOST_PRIOR
    else:
        ends = np.log(1e-3), np.log(MOST_PRIOR)
        prior = float(np.exp(brentq(lambda x: polygamma(1, np.exp(x) / 2) - spread, *ends)))
    # The mean of ln sigma^2 over the rows stands for s0^2 by the same rule.
    with np.errstate(over="ignore"):  # of a row far outside of the others, which do not inform it then
        centre = np.exp(trend + digamma(prior / 2) - np.log(prior / 2))
    both = (prior * centre + own * variance) / (prior + own)
    return ModeratedVariance(mean, np.sqrt(both / count), np.full(mean.size, min(prior, pooled) + own), pooled)


def trend_freedom(rows: int, own: float) -> float:
    """Return degrees of freedom of a line through ln s^2 of rows of `own` each, which takes two of them."""
    return max(2.0 * (rows - 2) / float(polygamma(1, own / 2)), LEAST_POOLED)


def widening(freedom: Floats, free: int) -> float:
    """Return the factor on the variances of `free` coordinates fitted with weights of `freedom` (n,).

    Meier's 1 + 4 sum p (1 - p) / d for n rows of leverage free / n, with d - 1 for d: his is the first term of a
    series, short at the three or four degrees that three replicates leave. 1 where errors are known.
    """
    return 1.0 + 4.0 * (1.0 - free / freedom.size) * float(np.mean(1.0 / (freedom - 1.0)))


def length(name: str, text: str, unit: str, accepted: str = "a length > 0 such as 1.2mm") -> float:
    """Return a length > 0 such as 1.2mm, in `unit`; a bare number is in `unit` already. InputError names `name`."""
    match = NUMBER.fullmatch(text.strip())
    if match is None or not float(match[1]) > 0 or (match[2] and match[2] not in UNITS):
        raise InputError(f"{name} must be {accepted} (units: {', '.join(UNITS)}), got {shown(text)}")
    if match[2] and not unit:
        where = "where the data has none (`unit` gives it one)"
        raise InputError(f"{name} must be without a unit {where}, got {shown(text)}")
    value = float(match[1]) * (factor(match[2], unit) if match[2] and match[2] != unit else 1.0)
    if not SMALLEST <= value <= LARGEST:
        raise InputError(f"{name} must lie between {SMALLEST:g} and {LARGEST:g} {unit or 'in size'}, got {shown(text)}")
    return value


def factor(source: str, target: str) -> float:
    """Return how many `target` a `source` is."""
    return UNITS[source] / UNITS[target]


def area_unit(text: str) -> str | None:
    """Return the unit of length in 1/mm^2, 1/mm², 1/mm2, mm^-2 or mm⁻²; None if the text is no such thing."""
    match = PER_AREA.fullmatch(text.strip())
    unit = (match["over"] or match["power"]) if match else None
    return unit if unit in UNITS else None
