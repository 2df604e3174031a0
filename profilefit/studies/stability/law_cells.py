"""Profile laws: R_d, cdf, radii and their density over albedo, radius or uniform number, and mean free path.

The reference is the law's own shader source in extended precision, at the very arguments that a narrower format was
given; and the exact half space, for what no arithmetic can mend, because the formula says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from profilefit.fitting import quality
from profilefit.laws.base import ProfileLaw
from profilefit.laws.liang import Liang
from profilefit.laws.quantile import FARTHEST, NEAREST, Quantile
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds, dense_grid
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import ArgumentGrid, Axes, Cells, Mask, RoundedText, absolute, axis, relative

# Of laws without a record: `quality.profile_quality` at the records' albedos, the worst; a test measures again.
MEASURED: dict[str, dict[str, float]] = {
    "burley_diffuse_mfp": {"rel": 0.156, "ks": 0.0658},
    "dipole": {"rel": 0.789, "ks": 0.435},
    "better_dipole": {"rel": 0.953, "ks": 0.491},
}
NO_BOUND = "its record states no error of this quantity"
BEYOND_TEXT = "beyond the radius at which shader sources stop, where no energy is left"
COMPUTED = tuple(one for one in cells.ARITHMETICS if one != cells.MODEL)
# What helps where the formula of a law leaves the half space.
OF_LIANG = (
    "take alpha >= 1e-6, b0 = 0.0641 (constants `corrected`) and |g| with the density of that map; hazard and quantile "
    "need none of this and have the exponential tail"
)
OF_DIPOLES = "add single scattering next to the source, or use hazard; of dipoles, beam diffusion has the least error"
OF_MODELS = {
    "liang": OF_LIANG,
    "burley": "use hazard or quantile near white; up to alpha = 0.98 the error is the record's",
    "gaussians": "use more Gaussians, up to 8, or a law that diverges as 1/r at the source: hazard, quantile, burley",
    "quantile": "use hazard beyond alpha = 0.995: its profile was fitted, not only its radii",
    **dict.fromkeys(("dipole", "better_dipole", "beam_diffusion"), OF_DIPOLES),
}


def advice_of(named: LoadedLaw, arithmetic: str) -> str:
    """Return what helps where a law is red; that of the arithmetic, an empty text, where it is no law's own."""
    if arithmetic == cells.MODEL:
        return OF_MODELS.get(named.name.partition(":")[0], "")
    return OF_LIANG if isinstance(named.law, Liang) and arithmetic in cells.HELD else ""


@dataclass(frozen=True)
class Limits:
    """Bounds of one law's errors by quantity, where they are known, and where it holds."""

    of: dict[str, float]
    valid: bounds.Validity


def limits_of(named: LoadedLaw, folder: Folder) -> Limits:
    """Return a tenth of the law's own model error, as its record or `MEASURED` states it, and its stated range."""
    model = MEASURED.get(named.name) or bounds.model_of_profile(named, folder).values
    rel, ks = model.get("rel"), model.get("ks")
    drawn = model.get("inversion_error") or ks
    errors = {cells.PROFILE: rel, cells.PDF: rel, cells.CDF: ks, cells.SAMPLE: drawn}
    known = {name: bounds.ROUNDING_SHARE * value for name, value in errors.items() if value is not None}
    return Limits(known, bounds.valid_profile(named, folder))


def cells_of(named: LoadedLaw, limits: Limits, arithmetics: Sequence[str] = COMPUTED) -> Iterator[Cells]:
    """Yield all quantities of a law in these arithmetics."""
    for arithmetic in arithmetics:
        at = ArgumentGrid.of(cells.DTYPES[arithmetic], arithmetic != cells.FLOAT64)
        yield from computed(named, limits, arithmetic, at)


def computed(named: LoadedLaw, limits: Limits, arithmetic: str, at: ArgumentGrid) -> Iterator[Cells]:
    """Yield all quantities of a law in one arithmetic on a grid."""
    nearest = 0.0 if arithmetic in (cells.FLOAT64, cells.FLOAT32) else dense_grid.LEAST_X
    stored = arithmetic == cells.STORED16
    albedo = _stored_albedo(RoundedText(named.law, np.float32), at.arguments[2]) if stored else None
    reference = Reference(named.law, at, albedo, nearest)
    shares = np.where(at.xi.values < 1.0, at.xi.values, np.inf)  # a uniform number is below 1
    profiled, drawn = bounds.masks(limits.valid, at.alpha.values, shares)
    holds = {cells.SAMPLE: drawn, cells.PDF: np.any(drawn, axis=1, keepdims=True)}
    for name, value in _values(named.law, arithmetic, at).items():
        places = (at.alpha, at.xi if name == cells.SAMPLE else at.x, at.mfp)
        shape = tuple(each.values.size for each in places)
        value, exactly = (np.broadcast_to(each, shape) for each in (value, reference.of(name)))
        inside, bound = holds.get(name, profiled) & at.accepted, limits.of.get(name, np.inf)
        if name == cells.SAMPLE:
            error = reference.misplaced(value)
        else:
            error = absolute(value, exactly) if name == cells.CDF else relative(value, exactly)
        yield _judged(
            *(named, name, arithmetic, places, value, exactly, error, bound, inside),
            dim=reference.dim(name, exactly),
            wrong_way=_wrong_way(name, value, reference),
            unjudged=BEYOND_TEXT if np.isfinite(bound) else NO_BOUND,
        )


def _wrong_way(name: str, value: Floats, reference: Reference) -> Mask | None:
    """Return where R_d rises with r, or the cdf or a radius falls. e^-t has as many roundings as t."""
    at = reference.at
    with np.errstate(all="ignore"):
        if name == cells.PROFILE:
            depth = np.abs(np.log(np.abs(value * at.mfp.values**2)))
            return cells.steps_up(value, 1, at.dtype, np.abs(value) * np.where(np.isfinite(depth), depth, 0.0))
        if name == cells.CDF:
            return cells.steps_down(value, 1, at.dtype, 1.0)
        if name != cells.SAMPLE:
            return None
        falls = cells.steps_down(value, 1, at.dtype, np.abs(value[:, value.shape[1] // 2, None]))
    # Where another part of the light begins, radii begin anew.
    xi, ulp = at.xi.values[:, None], float(np.finfo(at.dtype).eps)
    falls[:, 1:] &= (xi[1:] < reference.jump - ulp) | (reference.jump + ulp < xi[:-1])
    return falls


def _values(law: ProfileLaw, arithmetic: str, at: ArgumentGrid) -> dict[str, Floats]:
    r, xi, alpha, mfp = at.arguments
    if arithmetic in (cells.FLOAT64, cells.FLOAT32):
        if arithmetic == cells.FLOAT32:
            law, r, xi, alpha, mfp = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), (law, r, xi, alpha, mfp))
        sampler = dense_grid.drawn_by(law)
        profile, cdf = law.profile(r, alpha, mfp), law.cdf(r, alpha, mfp)
        values: tuple = profile, cdf, sampler.sample(xi, alpha, mfp), sampler.pdf(r, alpha, mfp)
    else:
        text = RoundedText(law, np.float16 if arithmetic == cells.TEXT16 else np.float32)
        if arithmetic == cells.STORED16:
            alpha = _stored_albedo(text, alpha)
        calls = zip(cells.QUANTITIES, (r, r, xi, r), strict=True)
        values = tuple(np.asarray(text.call(name, first, alpha, mfp)) for name, first in calls)
        if arithmetic == cells.STORED16:
            with np.errstate(over="ignore"):
                values = tuple(each.astype(np.float16) for each in values)
    return dict(zip(cells.QUANTITIES, (np.asarray(each, float) for each in values), strict=True))


def _stored_albedo(text: RoundedText, alpha: Floats) -> Floats:
    """Return alpha by way of the law's own A kept in half, as a texture keeps it."""
    reflectance = np.asarray(text.call("reflectance", text.call("shape", alpha)))
    return np.asarray(text.call("alpha", reflectance.astype(np.float16).astype(np.float32)))


HALVINGS = 70  # of a bracket of 90 in ln t
NOWHERE = np.finfo(cells.EXTENDED).tiny ** cells.EXTENDED(0.4)  # r/l that stands for 0 in a quotient


class Reference:
    """A law's shader source in extended precision on a grid.

    albedo   alphas (m, 1, 1) in place of the grid's, where these are kept in some other form
    nearest  r/l at which R_d is taken where r/l is less, as shader sources do; 0 if it is not
    """

    def __init__(self, law: ProfileLaw, at: ArgumentGrid, albedo: Floats | None = None, nearest: float = 0.0) -> None:
        self.at, self._nearest = at, nearest
        self._finite_source = law.is_finite_at_source
        self._text = RoundedText(law, cells.EXTENDED)
        if isinstance(law, Quantile):  # its few steps do not settle for albedos that only float64 has
            self._text.replace("depth", self._depth)
        r, xi, alpha, mfp = (each.astype(cells.EXTENDED) for each in at.arguments)
        self._x, self._mfp, self._xi = r / mfp, mfp, xi
        self._shape = self._text.call("shape", alpha if albedo is None else albedo.astype(cells.EXTENDED))

    def of(self, name: str) -> Floats:
        """Return the quantity, in its own unit, as a float64: infinite where it is beyond that."""
        with np.errstate(all="ignore"):
            if name == cells.PROFILE:
                return np.asarray(self._known_at(self._scaled_profile()) / self._mfp**2, float)
            if name == cells.CDF:
                return np.asarray(self._text.call("cumulated", self._x, self._shape), float)
            if name == cells.SAMPLE:
                return np.asarray(self._radius() * self._mfp, float)
            density = self._text.call("radius_density", self._x, self._shape)
            return np.asarray(self._known_at(density) / self._mfp, float)

    def dim(self, name: str, reference: Floats) -> Mask:
        """Return where a number in units of l has left the format before the unit of length enters."""
        if name not in (cells.PROFILE, cells.PDF):
            return np.zeros((1, 1, 1), bool)
        least = cells.DIMMEST[self.at.dtype]
        with np.errstate(all="ignore"):
            scaled = reference * self.at.mfp.values ** (2 if name == cells.PROFILE else 1)
        # A is a factor, and may be too small itself; a denormal r/l is 0 where denormals are.
        tiny = float(np.finfo(self.at.dtype).tiny)
        if name == cells.PDF:  # next to the source laws take it at the root of the least number
            return (np.abs(scaled) < least) & (reference != 0) | (self._x < 4.0 * tiny**0.5)
        lost = (self.at.arguments[2] < least) | ((self._x > 0) & (self._x < 4.0 * tiny))
        return ((np.abs(scaled) < least) | lost) & (reference != 0)

    @property
    def jump(self) -> Floats:
        """Uniform number (m, 1, 1) that separates two parts of the light; 1 where there is one part."""
        share = getattr(self._shape, "share", None)
        return np.ones((1, 1, 1)) if share is None else np.asarray(share, float)

    def misplaced(self, value: Floats) -> Floats:
        """Return the share of the energy between a drawn radius and the reference [-], of the part that both are of."""
        with np.errstate(all="ignore"):
            x = np.where(value >= 0, value, np.inf).astype(cells.EXTENDED) / self._mfp
            here, there = (self._undone(each) for each in (x, self._radius()))
            return np.asarray(np.abs(here - there), float)

    def _undone(self, x: NDArray) -> NDArray:
        """Return the uniform number that draws x, of two the nearer."""
        shape = self._shape
        if not hasattr(shape, "share"):
            return np.asarray(self._text.call("cumulated", x, shape))
        parts = []
        for share in (1.0, 0.0):  # all light is of the first part, or of the second
            alone = copy(shape)
            alone.share, alone.rest = cells.EXTENDED(share), cells.EXTENDED(1.0 - share)
            parts.append(self._text.call("cumulated", x, alone))
        first, second = shape.share * parts[0], shape.share + shape.rest * parts[1]
        return np.where(np.abs(first - self._xi) < np.abs(second - self._xi), first, second)

    def _known_at(self, value: NDArray) -> NDArray:
        """Return NaN beyond the radius at which texts stop, where no light is left."""
        return np.where((self._x > FARTHEST) & (value != 0), np.nan, value)

    def _scaled_profile(self) -> NDArray:
        x = np.maximum(self._x, cells.EXTENDED(self._nearest))
        near = np.maximum(x, NOWHERE)
        density = self._text.call("density", near, self._shape)
        profile = self._text.call("reflectance", self._shape) * density / (2.0 * cells.EXTENDED(np.pi) * near)
        return profile if self._finite_source else np.where((x > 0) | (profile == 0), profile, np.inf)

    def _depth(self, radius: NDArray, shape: Any) -> NDArray:
        """Return t at x of the quantile law: a bracket halved, in ln t."""
        x = np.clip(radius, cells.EXTENDED(NEAREST), cells.EXTENDED(FARTHEST))
        low, high = np.full_like(x, -65.0), np.full_like(x, 25.0) + 0.0 * shape.kappa
        low = low + 0.0 * high
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = self._text.call("local", np.exp(middle), shape).radius < x
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.exp(0.5 * (low + high))

    def _radius(self) -> NDArray:
        return np.asarray(self._text.call("radius", self._xi, self._shape))


# What a picture shows at once: R_d off by a third, three hundredths of the light in the wrong place.
MODEL_BOUNDS = {cells.PROFILE: 1.0 / 3.0, cells.CDF: 0.03, cells.SAMPLE: 0.03}
ALPHA = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.995, 0.999, 0.9999, 1.0 - 1e-6, 1.0)
RADIUS = tuple(float(one) for one in np.geomspace(quality.NEAREST, 300.0, 19))
SHARE = (1e-3, 5e-3, 0.0099, 0.0101, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.995, 0.999)
INVERSE, ENERGY = "g, not clipped (19)", "energy (17)"
ENERGY_BOUND = 0.1  # of cdf(r_max), which (18) hides by dividing


def model_cells(named: LoadedLaw, limits: Limits) -> Iterator[Cells]:
    """Yield R_d, cdf and radii against the exact profile of a law's setting; and what only Liang et al.'s laws have."""
    if named.setting.is_solved:
        yield from _against_exact(named, limits)
    if isinstance(named.law, Liang):
        yield unclipped(named, limits)
        yield own_energy(named, limits)


def _against_exact(named: LoadedLaw, limits: Limits) -> Iterator[Cells]:
    alpha, x, xi = (axis("α", ALPHA), axis("r/l", RADIUS), axis("ξ", SHARE))
    albedo, r, share = alpha.values[:, None], x.values[None], xi.values[None]
    law, medium = named.law, (albedo, 1.0, named.setting)
    within = np.asarray(exact.cdf(r, *medium))
    with np.errstate(all="ignore"):
        drawn = np.asarray(law.sampler.sample(share, albedo))
        profile, cdf = np.asarray(law.profile(r, albedo)), np.asarray(law.cdf(r, albedo))
    reached = np.asarray(exact.cdf(np.where(drawn >= 0, drawn, np.inf), *medium))
    if np.any(law.sampler.jump(alpha.values) < 1.0):  # two shares of the light draw one radius: the law's nearer one
        reached += np.asarray(law.sampler.undone(drawn, share, albedo)) - np.asarray(law.cdf(drawn, albedo))
    truth = np.asarray(exact.profile(r, *medium))
    held, draws = (_holds(span, albedo) for span in (limits.valid.alpha, limits.valid.drawn))
    seen = (within <= quality.ENERGY_WITHIN) & law.entry.profile.holds(albedo)
    for name, places, value, reference, error, inside in (
        (cells.PROFILE, (alpha, x), profile, truth, relative(profile, truth), held & seen),
        (cells.CDF, (alpha, x), cdf, within, absolute(cdf, within), held),
        (cells.SAMPLE, (alpha, xi), drawn, drawn, absolute(reached, np.broadcast_to(share, drawn.shape)), draws),
    ):
        yield _judged(named, name, cells.MODEL, places, value, reference, error, MODEL_BOUNDS[name], inside)


def _judged(named: LoadedLaw, name: str, arithmetic: str, axes: Axes, *given: Any, **more: Any) -> Cells:
    """Return cells of a law, given value, reference, error, bound and where they count."""
    known = {"judge": given[-1], "advice": advice_of(named, arithmetic), **more}
    return Cells(named.label, named.law.entry.own, name, arithmetic, axes, *given, **known)


def _holds(span: bounds.Range | None, alpha: Floats) -> Mask:
    return span.holds(alpha) if span else np.zeros(alpha.shape, bool)


def unclipped(named: LoadedLaw, limits: Limits) -> Cells:
    """Return g(xi) of (19), which should be a radius, and is judged by its sign; the law takes |g|, up to r_max."""
    axes = axis("α", (0.0, *ALPHA)), axis("ξ", (0.0, 1e-6, 1e-4, *SHARE))
    alpha = axes[0].values[:, None]
    with np.errstate(all="ignore"):
        value = np.asarray(named.law.sampler.unclipped(axes[1].values[None], alpha))
    error, inside = np.where(value < 0, np.abs(value), 0.0), _holds(limits.valid.alpha, alpha)
    return _judged(named, INVERSE, cells.FLOAT64, axes, value, value, error, 0.0, inside)


def own_energy(named: LoadedLaw, limits: Limits) -> Cells:
    """Return cdf(r_max) of (17) before (18) divides by it: the law's own energy over A, which should be 1."""
    alpha = axis("α", (0.0, *ALPHA))
    with np.errstate(all="ignore"):
        whole = np.asarray(named.law.unscaled_energy(np.inf, alpha.values))
        value = whole / np.asarray(named.law.albedo.reflectance(alpha.values))
    error, inside = absolute(value, np.ones_like(value)), _holds(limits.valid.alpha, alpha.values)
    return _judged(named, ENERGY, cells.MODEL, (alpha,), value, np.ones(()), error, ENERGY_BOUND, inside)
