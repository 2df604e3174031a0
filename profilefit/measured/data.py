"""A measured profile: reflectance at radii or averaged over annuli, with its errors and source; what a table may state.

Standard errors from few replicates are moderated: each row's variance is shrunk towards the trend of all rows. The
standard deviation of three replicates is known to a factor of two, and a fit that uses it gives most weight to the rows
that agree by accident. Smyth (Stat. Appl. Genet. Mol. Biol. 3, 2004) and Phipson et al. (Ann. Appl. Stat. 10, 2016):
the true variances of the rows scatter around a trend like a scaled inverse chi-square, whose spread shows in the
observed ones; each row's variance is then its own and the trend's, weighted by the degrees of freedom of both.

Errors that are estimates make weights that are estimates, and the inverse of the summed weights is too small an error
of what is fitted: `widening` is Meier's factor (Biometrics 9, 1953; Kenward and Roger, Biometrics 53, 1997, for fits).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator
from scipy.optimize import brentq
from scipy.special import digamma, polygamma

from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import Layer, Medium
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import InputError
from profilefit.recipes.declared import Declared, OneOf, Range, Refused, words

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
KNOWN_UNITS = ", ".join(UNITS)
FWHM, TOPHAT = "fwhm:", "tophat:"
BY_FWHM = 1.0 / math.sqrt(2.0 * math.log(2.0))  # 1/e^2 radius of a Gaussian beam over its full width at half maximum
REPLICATE = re.compile(r"value[_ ]?\d+")
HEADER = "r (or r_in and r_out) with value and sigma, or with value1, value2, value3, ..."


def _ends(text: str) -> Range:
    """Return both ends of a range LOW:HIGH, or a number as both; ValueError of any other text."""
    low, *rest = (float(part) for part in text.split(":"))
    if len(rest) > 1 or not low <= (high := rest[0] if rest else low):
        raise ValueError
    return low, high


def _size(text: str, info: ValidationInfo) -> float:
    """Return the length of a text such as 1.2mm in the unit of the data, the context; ValueError of any other text."""
    match, unit = NUMBER.fullmatch(text.strip()), str(info.context or "")
    if match is None or not float(match[1]) > 0 or (match[2] and match[2] not in UNITS):
        raise ValueError
    if match[2] and not unit:
        raise Refused("without a unit where the data has none (`unit` gives it one)", text)
    value = float(match[1]) * (factor(match[2], unit) if match[2] and match[2] != unit else 1.0)
    if not SMALLEST <= value <= LARGEST:
        raise Refused(f"between {SMALLEST:g} and {LARGEST:g} {unit or 'in size'}", text)
    return value


def _beam(text: str, info: ValidationInfo) -> Beam:
    """Return `TOPHAT` and a radius, "" and a 1/e^2 radius or both ends of its range, or the name of a file and none."""
    text = text.strip()
    kind = next((one for one in (FWHM, TOPHAT) if text.lower().startswith(one)), "")
    width = text[len(kind) :]
    ends = width.split(":") if width.count(":") == 1 and kind != TOPHAT else [width]
    if len(ends) == 1 and text.lower().endswith((".csv", ".tsv", ".txt")):
        return text, ()
    sizes = tuple(_size(end, info) * (BY_FWHM if kind == FWHM else 1.0) for end in ends)
    if len(sizes) > 1 and not sizes[0] < sizes[1]:
        raise Refused("a range that rises, such as 0.3mm:0.7mm", text)
    return kind.removeprefix(FWHM), sizes


Beam = tuple[Any, tuple[float, ...]]  # names of files may have bytes that are no text, which `str` refuses
Index = Annotated[float, Field(gt=0.0)]
Cosine = Annotated[float, Field(gt=-1.0, lt=1.0)]
Unit = Annotated[str, OneOf(*UNITS)]
OfLength = Annotated[str, OneOf("", *UNITS), words(f"in {KNOWN_UNITS} or without a unit")]


class Facts(Declared):
    """Facts that options and comments of a table state, read by `parsed`, whose context is the unit of r.

    Names in comments are compared in lower case, with spaces for _ and -.
    """

    light: Annotated[str, OneOf(*ILLUMINATIONS), words(spellings="light, lighting, illumination, incident light")] = ""
    n: Annotated[tuple[Index, Index], BeforeValidator(_ends), words(
        "a refractive index > 0, or a range such as 1.33:1.45",
        spellings="n, refractive index, refractive index n, index of refraction, refraction index, ior",
    )] = (1.0, 1.0)  # fmt: skip
    g: Annotated[tuple[Cosine, Cosine], BeforeValidator(_ends), words(
        "a mean cosine in (-1, 1), or a range such as 0.7:0.95",
        spellings="g, anisotropy, anisotropy g, anisotropy factor, anisotropy factor g, mean cosine, asymmetry",
    )] = (0.0, 0.0)  # fmt: skip
    beam: Annotated[Beam, BeforeValidator(_beam), words(
        "a length > 0, the 1/e^2 radius of a Gaussian beam (0.5mm) or its range (0.3mm:0.7mm), fwhm:0.6mm, its full "
        f"width at half maximum, tophat:0.5mm, the radius of a disc, or a .csv file (units: {KNOWN_UNITS})",
        spellings="beam, beam radius, spot radius, 1/e^2 radius, 1/e2 radius, 1/e² radius", unit="by default that of r",
    )] = ("", ())  # fmt: skip
    fibre: Annotated[float, BeforeValidator(_size), words(
        f"a length > 0 such as 1.2mm (units: {KNOWN_UNITS})", unit="by default that of r",
        spellings="fibre, fibre radius, fibre core radius, fiber, fiber radius, fiber core radius, core radius",
    )] = 0.0  # fmt: skip
    unit: Annotated[Unit, words(spellings="unit, units, unit of r, units of r, unit of length, length unit")] = ""


class ProfileColumns(Declared):
    """Columns of a profile's table: the unit of each, "" for none; headers name them in any case."""

    r: Annotated[OfLength, words(
        cells="a radius > 0, since the profile is infinite at 0", spellings="r, rho, ρ, radius, distance",
    )] = ""  # fmt: skip
    r_in: Annotated[OfLength, words(cells="a radius >= 0", spellings="r_in")] = ""
    r_out: Annotated[OfLength, words(cells="more than r_in", spellings="r_out")] = ""
    value: Annotated[str, words(
        "light per area such as [1/mm^2], or `scaled` for any other measure",
        cells="reflected light per area and per incident light", spellings="value, reflectance, rd, r_d",
    )] = ""  # fmt: skip
    sigma: Annotated[str, words(
        "in the unit of value or without a unit", cells="a standard error > 0",
        spellings="sigma, σ, error, standard_error, standard error",
    )] = ""  # fmt: skip
    replicates: Annotated[dict[str, str], words(
        "in one unit", cells=f"{FEWEST} or more in place of value and sigma", spellings="value1, value2, value3",
    )]  # fmt: skip

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Refuse a header that lacks a column, or has one too many, or an error in another unit than its value."""
        given, count = self.model_fields_set, len(self.replicates)
        faults = (
            (("r_in" in given) != ("r_out" in given), "one of r_in and r_out without the other"),
            (("r" in given) == ("r_in" in given), "both r and r_in" if "r" in given else "no column r"),
            (count > 0 and ("value" in given or "sigma" in given), "replicates beside value or sigma"),
            (0 < count < FEWEST, f"{count} replicates: fewer than {FEWEST} give no useful standard error"),
            (not count and "value" not in given, "no column value"),
            (not count and "sigma" not in given, "no column sigma: a fit needs the standard errors of its data"),
        )
        if missing := next((words for is_fault, words in faults if is_fault), ""):
            raise InputError(f"expected a header of {HEADER}, got {missing}")
        (first, own), *others = (self.replicates or {"value": self.value, "sigma": self.sigma}).items()
        for name, unit in others:
            areas = area_unit(unit or own), area_unit(own)  # one measure may be spelled in several ways
            if unit not in ("", own) and (None in areas or UNITS[str(areas[0])] != UNITS[str(areas[1])]):
                raise InputError(f"column {name}: expected the unit of {first}, [{own}], or none, got [{unit}]")
        return self


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


def length(name: str, text: str, unit: str) -> float:
    """Return a length > 0 such as 1.2mm, in `unit`; a bare number is in `unit` already. InputError names `name`."""
    return float(Facts.parsed("fibre", text, name, unit))  # a fact that is any length


def factor(source: str, target: str) -> float:
    """Return how many `target` a `source` is."""
    return UNITS[source] / UNITS[target]


def area_unit(text: str) -> str | None:
    """Return the unit of length in 1/mm^2, 1/mm², 1/mm2, mm^-2 or mm⁻²; None if the text is no such thing."""
    match = PER_AREA.fullmatch(text.strip())
    unit = (match["over"] or match["power"]) if match else None
    return unit if unit in UNITS else None
