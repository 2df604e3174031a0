"""Profile laws: R_d, cdf, radii and their density over albedo, radius or uniform number, and mean free path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import ProfileLaw
from profilefit.recipes.catalogue import Named
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds, dense_grid, validity
from profilefit.shader.check.bounds import ROUNDING_SHARE
from profilefit.studies.stability.cells import (
    Cells,
    Codes,
    Mask,
    RoundedText,
    absolute,
    judged,
    relative,
    steps_down,
    steps_up,
)
from profilefit.studies.stability.layout import (
    ARITHMETICS,
    CDF,
    DTYPES,
    FLOAT32,
    FLOAT64,
    HALF_BOUND,
    HELD,
    MODEL,
    PDF,
    PROFILE,
    QUANTITIES,
    SAMPLE,
    STORED16,
    TEXT16,
    TEXT32,
    ArgumentGrid,
)
from profilefit.studies.stability.reference import LEAST_X, Right

Floats = NDArray[np.float64]
Values = dict[str, Floats]
# Of laws without a record: `quality.profile_quality` at the records' albedos, the worst; a test measures again.
MEASURED: dict[str, dict[str, float]] = {
    "burley_diffuse_mfp": {"rel": 0.156, "ks": 0.0658},
    "dipole": {"rel": 0.789, "ks": 0.435},
    "better_dipole": {"rel": 0.953, "ks": 0.491},
}
NO_BOUND = "its record states no error of this quantity"
BEYOND_TEXT = "beyond the radius at which shader sources stop, where no energy is left"
COMPUTED = tuple(one for one in ARITHMETICS if one != MODEL)


@dataclass(frozen=True)
class Limits:
    """The bounds of one law's errors by quantity, and where it holds."""

    of: dict[str, float]
    valid: validity.Validity

    def stated(self, quantity: str) -> float:
        """The model's own error [-], as `quality` measures it; NaN where it is not known."""
        return self.of.get(quantity, np.nan) / ROUNDING_SHARE

    def bound(self, quantity: str, dtype: type) -> float:
        """A tenth of the model's own error; in half not less than what keeping a number costs."""
        own = self.of.get(quantity, np.inf)
        return max(own, HALF_BOUND) if dtype is np.float16 else own


def limits_of(one: Named, folder: Folder) -> Limits:
    """A tenth of the law's own model error, as its record or `MEASURED` states it, and its stated range."""
    model = MEASURED.get(one.name) or bounds.of_profile(one, folder).values
    rel, ks = model.get("rel"), model.get("ks")
    drawn = model.get("inversion_error") or ks
    found = {PROFILE: rel, PDF: rel, CDF: ks, SAMPLE: drawn}
    known = {name: ROUNDING_SHARE * value for name, value in found.items() if value is not None}
    return Limits(known, validity.of_profile(one, folder))


def cells_of(one: Named, limits: Limits, arithmetics: Sequence[str] = COMPUTED) -> Iterator[Cells]:
    """All quantities of a law in these arithmetics."""
    for arithmetic in arithmetics:
        yield from computed(one, limits, arithmetic, ArgumentGrid.of(DTYPES[arithmetic], arithmetic != FLOAT64))


def computed(one: Named, limits: Limits, arithmetic: str, at: ArgumentGrid) -> Iterator[Cells]:
    found, right = _values(one.law, arithmetic, at), _right(one.law, arithmetic, at)
    single = _values(one.law, TEXT32, at) if arithmetic == TEXT16 else {}
    for name, value in found.items():
        places = (at.alpha, at.xi if name == SAMPLE else at.x, at.mfp)
        shape = tuple(each.values.size for each in places)
        value, reference = (np.broadcast_to(each, shape) for each in (value, right.of(name)))
        inside = np.broadcast_to(_inside(name, limits.valid, at), shape)
        bound = limits.bound(name, at.dtype)
        error, codes = _classed(name, value, reference, right, bound, inside, at.dtype)
        twin = None
        if arithmetic == TEXT16:
            beside = np.broadcast_to(single[name], shape)
            twin = _classed(name, beside, reference, right, bound, inside, np.float32)[1]
        yield Cells(
            subject=one.label,
            own=one.law.entry.own,
            quantity=name,
            arithmetic=arithmetic,
            axes=places,
            value=value,
            reference=reference,
            error=error,
            bound=bound,
            inside=inside & (arithmetic in HELD),
            codes=codes,
            law=one.law,
            dtype=at.dtype,
            twin=twin,
            unjudged=BEYOND_TEXT if np.isfinite(bound) else NO_BOUND,
        )


def _classed(
    name: str, value: Floats, reference: Floats, right: Right, bound: float, inside: Mask, dtype: type
) -> tuple[Floats, Codes]:
    """Errors and classes of what a format made of the arguments of `right`."""
    error, wrong_way = _error(name, value, reference, right), _wrong_way(name, value, right.at)
    if name == SAMPLE and wrong_way is not None:  # where another part of the light begins, radii begin anew
        xi, ulp = right.at.xi.values[:, None], float(np.finfo(right.at.dtype).eps)
        wrong_way[:, 1:] &= (xi[1:] < right.jump - ulp) | (right.jump + ulp < xi[:-1])
    return error, judged(value, reference, error, bound, inside, dtype, right.dim(name, reference), wrong_way)


def _inside(name: str, valid: validity.Validity, at: ArgumentGrid) -> Mask:
    """Where the law says that the quantity holds; a uniform number is below 1."""
    albedos, shares = at.alpha.values, at.xi.values
    profiled, drawn = validity.masks(valid, albedos, np.where(shares < 1.0, shares, np.inf))
    if name == SAMPLE:
        return drawn & at.accepted
    return (np.any(drawn, axis=1, keepdims=True) if name == PDF else profiled) & at.accepted


def _error(name: str, value: Floats, reference: Floats, right: Right) -> Floats:
    if name == SAMPLE:
        return right.misplaced(value)
    return absolute(value, reference) if name == CDF else relative(value, reference)


def _wrong_way(name: str, value: Floats, at: ArgumentGrid) -> Mask | None:
    """R_d falls with r, the cdf and radii rise. e^-t has as many roundings as t."""
    with np.errstate(all="ignore"):
        if name == PROFILE:
            depth = np.abs(np.log(np.abs(value * at.mfp.values**2)))
            return steps_up(value, 1, at.dtype, np.abs(value) * np.where(np.isfinite(depth), depth, 0.0))
        if name == CDF:
            return steps_down(value, 1, at.dtype, 1.0)
        if name == SAMPLE:
            return steps_down(value, 1, at.dtype, np.abs(value[:, value.shape[1] // 2, None]))
    return None


def _right(law: ProfileLaw, arithmetic: str, at: ArgumentGrid) -> Right:
    nearest = 0.0 if arithmetic in (FLOAT64, FLOAT32) else LEAST_X
    albedo = _stored_albedo(RoundedText(law, np.float32), at.arguments[2]) if arithmetic == STORED16 else None
    return Right(law, at, albedo, nearest)


def _values(law: ProfileLaw, arithmetic: str, at: ArgumentGrid) -> Values:
    if arithmetic == FLOAT64:
        found = _of_law(law, *at.arguments)
    elif arithmetic == FLOAT32:
        with np.errstate(over="ignore"):
            single = (jnp.asarray(each, jnp.float32) for each in at.arguments)
        found = _of_law(jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), law), *single)
    else:
        found = _of_text(law, arithmetic, *at.arguments)
    return dict(zip(QUANTITIES, (np.asarray(each, float) for each in found), strict=True))


def _of_law(law: ProfileLaw, r, xi, alpha, mfp) -> tuple:
    sampler = dense_grid.drawn_by(law)
    profile, cdf = law.profile(r, alpha, mfp), law.cdf(r, alpha, mfp)
    return profile, cdf, sampler.sample(xi, alpha, mfp), sampler.pdf(r, alpha, mfp)


def _of_text(law: ProfileLaw, arithmetic: str, r, xi, alpha, mfp) -> tuple:
    text = RoundedText(law, np.float16 if arithmetic == TEXT16 else np.float32)
    if arithmetic == STORED16:
        alpha = _stored_albedo(text, alpha)
    calls = (("profile", r), ("cdf", r), ("sample", xi), ("pdf", r))
    found = tuple(np.asarray(text.call(name, first, alpha, mfp)) for name, first in calls)
    if arithmetic != STORED16:
        return found
    with np.errstate(over="ignore"):
        return tuple(each.astype(np.float16) for each in found)


def _stored_albedo(text: RoundedText, alpha: Floats) -> Floats:
    """alpha by way of the law's own A kept in half, as a texture keeps it."""
    reflectance = np.asarray(text.call("reflectance", text.call("shape", alpha)))
    return np.asarray(text.call("alpha", reflectance.astype(np.float16).astype(np.float32)))
