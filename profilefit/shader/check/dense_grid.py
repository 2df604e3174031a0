"""Dense grid on which laws are evaluated, both ends included, with its errors and counts of bad numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.shader.check.bounds import ULP, Bound, Mask, ModelError
from profilefit.shader.check.shader_law import Values

SMALLEST = 2.0**-126  # below it a float32 loses digits, or is 0 on many GPUs
DIMMEST = 1e-30  # R_d l^2 below which products of small factors leave float32
LEAST_X = 1e-6  # R_d is taken here where x = r/l is less: at the source itself it is infinite
# Steps the wrong way are counted beyond this many ULP: of R_d and the cdf, sums of a few rounded terms; of x and
# its median for radii x, since 1 - xi is rounded before its logarithm is taken.
STEPS_OF_PROFILE, STEPS_OF_CDF, STEPS_OF_SAMPLE = 16, 4, 16


def _rounded(*pieces: Sequence[float] | Floats) -> Floats:
    return np.unique(np.concatenate(pieces).astype(np.float32)).astype(np.float64)


ALPHA = _rounded(1.0 - np.linspace(0.0, 1.0, 56) ** 2, [1e-6, 1e-4], 1.0 - np.geomspace(2.0 * ULP, 1e-4, 6))
X = _rounded([0.0, 1e-8], np.geomspace(LEAST_X, 1e4, 251), [1e6, 1e9, 1e30])
XI = _rounded([0.0], np.geomspace(ULP, 0.02, 40), np.linspace(0.03, 0.97, 175), 1 - np.geomspace(0.02, ULP, 40))
XI = np.append(XI, 1.0)
MFP = np.array([1.0, 1e-3, 1e3], np.float32).astype(np.float64)


@dataclass(frozen=True)
class Arguments:
    """Arguments that broadcast to (alphas, radii or shares, lengths), each a float32: what the GPU sees."""

    alpha: Floats
    r: Floats
    xi: Floats
    mfp: Floats

    @property
    def x(self) -> Floats:
        """r/l of the rounded r and l [mfp]."""
        return np.broadcast_to(self.r / self.mfp, self.shape)

    @property
    def shape(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.alpha.shape, self.r.shape, self.xi.shape, self.mfp.shape)

    def place(self, index: int, of_share: bool = False) -> str:
        """Return the place of a flat index in words."""
        at = np.unravel_index(index, self.shape)
        alpha, xi, mfp = (float(np.broadcast_to(one, self.shape)[at]) for one in (self.alpha, self.xi, self.mfp))
        first = f"ξ {_shown(xi)}" if of_share else f"r/l {float(self.x[at]):.3g}"
        return f"{first}, α {_shown(alpha)}" + (f", l {mfp:g}" if mfp != 1.0 else "")


def _shown(share: float) -> str:
    return f"{share:.4g}" if share < 0.9995 or share == 1.0 else f"1 - {1.0 - share:.2g}"


def arguments() -> Arguments:
    """Return the arguments of the whole grid."""
    r = (X[:, None] * MFP).astype(np.float32).astype(np.float64)
    return Arguments(ALPHA[:, None, None], r[None], XI[None, :, None], MFP)


def reference(law: ProfileLaw, at: Arguments) -> Values:
    """Return a law's values in float64; xi = 1 is taken for the largest float below 1, as the shader source does."""
    r = np.maximum(at.r, LEAST_X * at.mfp)
    xi = np.minimum(at.xi, 1.0 - ULP)
    sampler = drawn_by(law)
    functions = ((law.profile, r), (law.cdf, at.r), (sampler.sample, xi), (sampler.pdf, r))
    with np.errstate(all="ignore"):
        found = [np.asarray(function(given, at.alpha, at.mfp), float) for function, given in functions]
    return Values(*(np.broadcast_to(value, at.shape) for value in found))


def drawn_by(law: ProfileLaw) -> Sampler:
    """Return the sampler of a law's shader source: the one of two steps where there are several."""
    return law.samplers.get("two steps", law.sampler)


@dataclass(frozen=True)
class Spread:
    """Errors at many places: the median, what 99 % do not exceed, the largest and where."""

    half: float
    most: float
    largest: float
    where: str


def spread(error: Floats, used: Mask, at: Arguments, of_share: bool = False) -> Spread | None:
    """Return the spread of the errors that are used; one that is no number counts as infinite. None if none is used."""
    if not np.any(used):
        return None
    judged = np.where(used, np.nan_to_num(error, nan=np.inf), -1.0)
    worst = int(np.argmax(judged))
    half, most = np.quantile(judged[used], [0.5, 0.99], method="higher")
    return Spread(float(half), float(most), float(judged.flat[worst]), at.place(worst, of_share))


KINDS = {"nan": "NaN", "infinite": "Inf", "negative": "negative", "wrong_way": "not monotone"}


@dataclass(frozen=True)
class Count:
    """Count results that are no number, infinite, negative, or go the wrong way; and name the first place."""

    nan: int
    infinite: int
    negative: int
    wrong_way: int
    where: str = ""

    @property
    def total(self) -> int:
        return sum(getattr(self, name) for name in KINDS)

    def less(self, other: Count) -> Count:
        """Return what is counted here and not in another."""
        return Count(*(getattr(self, name) - getattr(other, name) for name in KINDS))

    @property
    def kinds(self) -> str:
        """Counts in words."""
        return ", ".join(f"{count} {kind}" for name, kind in KINDS.items() if (count := getattr(self, name))) or "none"


def bad_numbers(count: Count) -> Bound:
    """Return the bound that allows none of the counted results."""
    return Bound("bad numbers", count.total, 0, f"{count.where} ({count.kinds})" if count.total else "")


def summed(faults: Iterable[tuple[list[Mask], Callable[[int], str]]]) -> Count:
    """Count the faults of each result: a mask for each of `KINDS`, and the place of an index in words."""
    numbers, first = np.zeros(len(KINDS), int), ""
    for masks, place in faults:
        numbers += [int(np.sum(mask)) for mask in masks]
        bad = np.any(masks, axis=0)
        if np.any(bad) and not first:
            first = place(int(np.argmax(bad)))
    return Count(**dict(zip(KINDS, numbers.tolist(), strict=True)), where=first)


def counted(values: Values, at: Arguments, profiled: Mask, drawn: Mask, jump: Floats | float = 1.0) -> Count:
    """Count what must not be: R_d falls with r, the cdf rises, and so does the radius with xi.

    profiled  where profile and cdf count, drawn where radii and their pdf do; both as `Arguments.shape`
    jump      xi (alphas, 1, 1) at which radii begin at 0 anew, 1 where none does
    """

    def faults(name: str) -> tuple[list[Mask], Callable[[int], str]]:
        value: Floats = getattr(values, name)
        among = drawn if name in ("sample", "pdf") else profiled
        wrong = np.zeros(value.shape, bool)
        with np.errstate(invalid="ignore"):
            step, before = np.diff(value, axis=1), np.abs(value[:, :-1])
            if name == "profile":
                wrong[:, 1:] = step > STEPS_OF_PROFILE * ULP * before + SMALLEST
            elif name == "cdf":
                wrong[:, 1:] = step < -STEPS_OF_CDF * ULP
            elif name == "sample":
                median = np.abs(value[:, value.shape[1] // 2, None])
                wrong[:, 1:] = step < -STEPS_OF_SAMPLE * ULP * (before + median)
                wrong[:, 1:] &= (at.xi[:, 1:] < jump - ULP) | (jump + ULP < at.xi[:, :-1])
            wrong[:, 1:] &= among[:, :-1]  # of two neighbours both count
            masks = [mask & among for mask in (np.isnan(value), np.isinf(value), value < 0, wrong)]
        return masks, lambda index: f"{name}, {at.place(index, name == 'sample')}"

    return summed(map(faults, ("profile", "cdf", "sample", "pdf")))


@dataclass(frozen=True)
class ShaderCheck:
    """One law or map, judged.

    rounding  errors that float32 makes, worst, by the names of `quality` [-]; measured of the GPU against the exact
    inside    what must not be, where the law says that it holds; outside elsewhere
    """

    of: LoadedLaw
    model: ModelError
    rounding: dict[str, float]
    measured: dict[str, float]
    inside: Count
    outside: Count
    bounds: tuple[Bound, ...]

    @property
    def broken(self) -> tuple[Bound, ...]:
        return tuple(bound for bound in self.bounds if bound.broken)
