"""Model discrepancy: the error of a law as a random function of radius and albedo, and what it does to a fit.

A law is not the truth: truth = law (1 + delta), delta small. Its residuals are smooth and repeat each other, so they
are no independent noise. Here delta is a Gaussian process of mean zero over ln r and sqrt(1 - alpha) (Kennedy and
O'Hagan, J. R. Statist. Soc. B 63, 2001), with Matern's covariance (nu = 3/2) along each:

    cov(delta, delta') = sigma^2 m(|ln r - ln r'| / l_r) m(|s - s'| / l_s),   m(d) = (1 + sqrt(3) d) e^(-sqrt(3) d)

Amplitude sigma and both lengths are those of greatest likelihood, the photons' noise known and the constants of the law
free (restricted maximum likelihood: Patterson and Thompson, Biometrika 58, 1971, since a fit bends into its residuals).
Waves that a law leaves in exact light are smoother than this process, and its fine scales, most in number, then ask for
too small a sigma: it is at least the one that leaves residuals of their own mean square (method of moments).
Another draw of that process would have led the fit elsewhere: the derivative of the optimum turns its covariance into
the constants' model error, and the law that was fitted is off by what remains of delta after the fit has followed it.
A fit to r R_d unweighted (objective "radial") lets the law go where the profile fades: there delta counts in units of
the profile's source limit, alpha / 4 pi r, instead of the profile itself.

A derived quantity (reflectance, radius of a share of the energy, profile) has two errors. Statistical: the photons'
covariance of the constants, carried over by the derivative. Model: how far the law that was fitted is from the truth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm

from mcml_sim.errors import InputError
from mcml_sim.exact.compiled import BRIEF, filter_jit
from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.setting import Setting
from profilefit.fitting.estimate import NO_LIMITS, Fit, ResidualFunction, Rings, followed
from profilefit.fitting.misfit import FARTHEST, MAX_STEPS, apart, likeliest, matern
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.fitting.solver import unit_columns
from profilefit.laws.base import OF_MAPS
from profilefit.laws.liang import QUANTILES
from profilefit.laws.surface import surface_of

Live = NDArray[np.bool_]
# Of rings along r: the process is smooth on that scale, and a matrix of as many rows as all have is inverted.
GROUPS, FEWEST_GROUPS, MOST_ROWS = 20, 8, 1000
# Lengths between a fraction of the spacing and a few times the range: beyond either the likelihood knows no more.
SHORTEST, LONGEST = 0.5, 3.0
LEFT_OUT = 1e-3  # share of a variance that the rank of the photons' covariance may leave out: noise of its own
SEEN = 3.9  # gain in log likelihood that three parameters exceed by chance in one of twenty (chi^2 / 2)
SHARES = 400  # nodes of an inverse cdf between which it is a straight line
FOUND, NOT_SEEN = "found", "not seen: noise alone explains the residuals"
FAILED = f"no convergence in {MAX_STEPS} steps: amplitude and lengths are where they stopped"
FACTS = ("amplitude", "amplitude_error", "length_r", "length_s", "gain", "rms", "result")
KEPT = ("u", "s", "influence")
SHOWN = (0.2, 0.5, 0.8, 0.95, 0.99)  # albedos of a record's table
# Rings fine enough that their middles stand for them, from the source to where no light is left [mfp].
EDGES = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 601)])


@dataclass(frozen=True)
class Discrepancy:
    """The process that a law's residuals are a draw of.

    amplitude        sigma [-], of the relative error of ring energies; amplitude_error of it
    length_r         in ln r [-]; NaN where the fit sees no rings; length_s in sqrt(1 - alpha) [-]
    gain             of log likelihood over noise alone; infinite where the truth has none
    rms              of the residuals themselves [-], smaller than the amplitude: the fit has followed what it could
    covariance       (p, p) of the constants: their model error
    result           whether there is one, or what failed
    u (g,), s (m,), influence (p, m, g): where delta was looked at, and d constants / d delta. Of a fit to several
    indices s is (m, 2), a point in the plane of sqrt(1 - alpha) and rho (`laws.surface`), and (m, 3) with g
    """

    amplitude: float
    amplitude_error: float
    length_r: float
    length_s: float
    gain: float
    rms: float
    result: str
    covariance: Floats
    u: Floats
    s: Floats
    influence: Floats

    def content(self) -> dict[str, Any]:
        """Return the facts that a record states."""
        return {name: getattr(self, name) for name in FACTS}

    def arrays(self) -> dict[str, Floats]:
        """Return the arrays that a record keeps, for `read`."""
        return {f"discrepancy_{name}": getattr(self, name) for name in KEPT}

    def law_covariance(self, u: Floats, s: Floats, slope: Floats) -> Floats:
        """Return the covariance (k, k) of the law less the truth at points (k,), d law / d constants being `slope`."""
        joint = self._kernel(s, self.s, self.length_s)[:, :, None] * self._kernel(u, self.u, self.length_r)[:, None, :]
        own = self._kernel(s, s, self.length_s) * self._kernel(u, u, self.length_r)
        followed = self.amplitude**2 * np.einsum("kp,pai,lai->kl", slope, self.influence, joint, optimize=True)
        return self.amplitude**2 * own - followed - followed.T + slope @ self.covariance @ slope.T

    def places(self, alpha: Floats, setting: Setting) -> Floats:
        """Return places in s of albedos (k,) of a setting."""
        return _placed(alpha, [setting] * len(alpha), 1 if self.s.ndim == 1 else self.s.shape[1])

    def _kernel(self, one: Floats, other: Floats, length: float) -> Floats:
        if not np.isfinite(length):  # a fit that sees no rings knows of no radius
            return np.ones((len(one), len(other)))
        return matern(apart(one, other) / length)


def read(content: Mapping[str, Any], arrays: Mapping[str, Floats]) -> Discrepancy | None:
    """Return a record's discrepancy; None where it has none, as old records, or where its fit failed."""
    facts, model = content.get("discrepancy"), content.get("covariance", {}).get("model")
    if not facts or facts["amplitude"] is None or model is None or "discrepancy_u" not in arrays:
        return None
    values: dict[str, Any] = {name: np.nan if facts[name] is None else facts[name] for name in FACTS}
    values |= {name: np.asarray(arrays[f"discrepancy_{name}"], float) for name in KEPT}
    return Discrepancy(**values, covariance=np.asarray(model, float))


@dataclass(frozen=True)
class Residuals:
    """Relative residuals of a law on groups of neighbouring rings.

    table      (m, g) law less data over what counts as 1 [-]; live where a group counts
    u, s       (g,), (m,) as of `Discrepancy`
    slope      (m, g, p) d table / d constants; noise (g, m, k) factors of the photons' relative covariance
    influence  (p, m, g) d constants / d delta, `delta` of all the rings of a group
    """

    table: Floats
    live: Live
    u: Floats
    s: Floats
    slope: Floats
    noise: Floats
    influence: Floats


def discrepancy(fit: Fit, profiles: Profiles) -> Discrepancy:
    """Estimate the process behind the residuals of a fit to profiles, and its effect on the constants."""
    size = len(fit.free)
    if not fit.solution.converged:
        why, none, unknown = f"no fit: {fit.result}", np.zeros(0), np.full((size, size), np.nan)
        nan = float("nan")
        return Discrepancy(nan, nan, nan, nan, nan, nan, why, unknown, none, none, np.zeros((size, 0, 0)))
    return of_residuals(residuals(fit, profiles))


def of_residuals(data: Residuals) -> Discrepancy:
    """Estimate the process that makes residuals likeliest, and not smaller than they are."""
    a, g = np.nonzero(data.live)  # live points in one row
    u, s, y, slope = data.u[g], data.s[a], data.table[a, g], data.slope[a, g]
    each = np.einsum("gak,gbk->gab", data.noise, data.noise)
    noise = np.where(g[:, None] == g, each[g[:, None], a[:, None], a], 0.0)
    noise += LEFT_OUT * np.diag(np.diag(noise))
    lengths = np.log(np.stack([_scales(data.u), _scales(data.s)]))
    begin = np.array([np.log(max(np.sqrt(np.mean(y**2)), 1e-12)), *lengths.mean(axis=1)])
    limits = np.vstack([begin[0] + np.array([-FARTHEST, FARTHEST]), lengths])
    given = apart(u, u), apart(s, s), y, unit_columns(slope), noise
    theta, curved, worth, converged = likeliest(begin, limits, given)
    amplitude, length_u, length_s = map(float, np.exp(theta))
    gain = worth if np.any(noise) else np.inf
    kernel_u, kernel_s = (matern(apart(x, x) / length) for x, length in ((data.u, length_u), (data.s, length_s)))
    across = data.influence, kernel_s, kernel_u, data.influence
    covariance = amplitude**2 * np.einsum("pai,ab,ij,qbj->pq", *across, optimize=True)
    result = (FOUND if gain > SEEN else NOT_SEEN) if converged else FAILED
    shown_u = length_u if data.u.size > 1 else np.nan
    known, relative = np.diag(curved) > 1e-3, np.inf  # what the loss bends with: it may be blind to a length
    if known[0]:
        inverse = np.linalg.pinv(curved[np.ix_(known, known)], hermitian=True)
        relative = float(np.sqrt(max(inverse[0, 0], 0.0)))
    facts = amplitude, amplitude * relative, shown_u, length_s, gain, float(np.sqrt(np.mean(y**2))), result
    one = Discrepancy(*facts, covariance, data.u, data.s, data.influence)
    if result == NOT_SEEN:
        return one
    left = one.law_covariance(u, s, slope)
    more = float(y @ y - np.trace(noise)) / np.trace(left)  # times the variance that `one` leaves
    if more <= 1.0:
        return one
    amplitude, relative = one.amplitude * float(np.sqrt(more)), float(np.sqrt(0.5 * np.sum(left**2)) / np.trace(left))
    return replace(one, amplitude=amplitude, amplitude_error=amplitude * relative, covariance=more * one.covariance)


def residuals(fit: Fit, profiles: Profiles) -> Residuals:
    """Return residuals of groups of rings that the fit used, from 0.01 mfp to 99.5 % of the energy."""
    problem, rings = ResidualFunction(fit.objective, fit.free), fit.rings
    gain = followed(*fit.second_derivatives)
    energy, slope = predicted(problem, fit.law, rings)
    albedos = np.asarray(rings.weight)[:, None] > 0
    if fit.objective in OF_MAPS:
        return _one_ring(profiles, energy, slope, gain, albedos)
    data, counted = profiles.energy, albedos & (np.asarray(rings.used) > 0)
    judged = counted & (data > 0) & (profiles.cdf[:, 1:] <= ENERGY_WITHIN)
    judged &= profiles.r_edges[1:] > NEAREST
    u = np.log(middles(profiles.r_edges))
    # Groups are even in ln r over the judged rings; rings beyond them go with the nearest.
    inner, most = u[np.any(judged, axis=0)], max(min(GROUPS, MOST_ROWS // profiles.alpha.size), FEWEST_GROUPS)
    edges = np.linspace(inner.min(), inner.max() + 1e-9, min(most, inner.size) + 1)
    group = np.clip(np.searchsorted(edges, u, side="right") - 1, 0, edges.size - 2)
    known = np.unique(group[np.any(judged, axis=0)])
    group = known[np.abs(group[:, None] - known).argmin(axis=1)]
    member = (group[:, None] == np.unique(group)).astype(float)  # (n, g)
    unit = unit_energy(fit.objective, profiles.energy, profiles.alpha, profiles.r_edges)
    own, seen, live = energy * judged @ member, data * judged @ member, (judged @ member) > 0
    safe = np.where(live, unit * judged @ member, 1.0)
    tilt = np.einsum("aip,ai,ig->agp", slope, judged.astype(float), member) / safe[..., None]
    whole = np.append(member, member[-1:], axis=0)  # the light beyond the last ring goes with it
    parts = gain * np.concatenate([unit, profiles.beyond[:, None]], axis=1)
    middle = (u * judged.sum(axis=0)) @ member / np.maximum(judged.sum(axis=0) @ member, 1)
    noise = _noise(profiles, judged, member, safe)
    return Residuals(np.where(live, (own - seen) / safe, 0.0), live, middle, _s(profiles), tilt, noise, parts @ whole)


def middles(r_edges: Floats) -> Floats:
    """Return the radii (n,) that stand for rings: geometric means, of the first one half its edge."""
    return np.sqrt(r_edges[1:] * np.maximum(r_edges[:-1], 0.25 * r_edges[1:]))


def unit_energy(objective: str, energy: Floats, alpha: Floats, r_edges: Floats) -> Floats:
    """Return the unit of delta (m, n): the ring's own `energy`, or that of the source limit of r R_d."""
    return 0.5 * alpha[:, None] * np.diff(r_edges) if objective == "radial" else energy


def predicted(problem: ResidualFunction, law: Any, rings: Rings) -> tuple[Floats, Floats]:
    """Return ring energies of a law as the problem's objective means them (m, n), and derivatives (m, n, p)."""
    with jax.enable_x64(True):
        theta = jnp.asarray(law.vector(problem.free))
        energy, slope = _predicted(problem, theta, jax.tree.map(jnp.asarray, law), rings)
    return np.asarray(energy), np.asarray(slope)


def _one_ring(profiles: Profiles, energy: Floats, slope: Floats, gain: Floats, live: Live) -> Residuals:
    """Return residuals of a map between alpha and A, which sees all light as one ring."""
    total, m = profiles.reflectance[:, None], profiles.alpha.size
    whole = (gain * np.column_stack([profiles.energy, profiles.beyond])).sum(axis=2, keepdims=True)
    noise = np.zeros((1, m, 1))
    if profiles.covariance is not None:
        everything = np.ones((m, len(profiles.covariance.factor)))
        noise = _root(profiles.covariance.sandwich(np.eye(m)[:, :, None] * everything) / (total @ total.T))[None]
    live = live & np.isfinite(energy) & np.all(np.isfinite(slope), axis=2)  # a map may end before alpha = 1
    table = np.where(live, energy / total - 1.0, 0.0)
    return Residuals(table, live, np.zeros(1), _s(profiles), slope / total[..., None], noise, whole)


def _s(profiles: Profiles) -> Floats:
    settings = profiles.settings
    return _placed(profiles.alpha, settings, 1 if not settings else 2 if len({one.g for one in settings}) == 1 else 3)


def _placed(alpha: Floats, settings: Sequence[Setting], size: int) -> Floats:
    """Return places in s, of so many numbers each."""
    s = np.sqrt(1.0 - alpha)
    if size == 1:
        return s
    return np.column_stack([s, [(surface_of(one).trapped, one.g)[: size - 1] for one in settings]])


def _noise(profiles: Profiles, judged: Live, member: Floats, law: Floats) -> Floats:
    """Return factors (g, m, k) of the relative covariance of groups, whose rings add up and share photons."""
    groups = member.shape[1]
    if profiles.covariance is None:
        return np.zeros((groups, profiles.alpha.size, 1))
    factor = profiles.covariance.factor[: member.shape[0]] * judged.T[:, :, None]
    blocks = np.einsum("iak,ibk,ig->gab", factor, factor, member, optimize=True)
    return np.stack([_root(block / np.outer(unit, unit)) for block, unit in zip(blocks, law.T, strict=True)])


def _root(covariance: Floats) -> Floats:
    value, vector = np.linalg.eigh(covariance)
    return np.asarray(vector * np.sqrt(np.maximum(value, 0.0)))


def _scales(x: Floats) -> Floats:
    """Return the shortest and the longest length worth looking at."""
    along = np.unique(x if x.ndim == 1 else x[:, 0])
    return np.array([SHORTEST * np.min(np.diff(along)), LONGEST * np.ptp(along)]) if along.size > 1 else np.ones(2)


@partial(filter_jit, options=BRIEF)
def _predicted(problem: ResidualFunction, theta, law, rings: Rings):
    def energy(vector):
        moved = law.with_vector(problem.free, vector).under(rings.surface)
        edges, alpha = jnp.asarray(rings.r_edges), jnp.asarray(rings.alpha)
        if problem.objective in OF_MAPS:
            return moved.reflectance(alpha[:, None])
        if problem.objective == "radial":
            r = 0.5 * (edges[1:] + edges[:-1])
            a, b, c = moved.coefficients(alpha[:, None])
            return 2.0 * jnp.pi * jnp.diff(edges) * (a * r + b) / (r + c)
        if problem.objective in QUANTILES:
            xi = 1.0 - jnp.geomspace(1.0, 1e-4, SHARES)
            radii = moved.sampler.unclipped(xi, alpha[:, None])
            inside = jax.vmap(lambda nodes: jnp.interp(edges, nodes, xi))(radii)
            return rings.reflectance[:, None] * jnp.diff(inside, axis=-1)
        return jnp.diff(moved.unscaled_energy(edges, alpha[:, None]), axis=-1)

    return energy(theta), jax.jacfwd(energy)(theta)


@dataclass(frozen=True)
class Quantity:
    """Numbers (k,) with two standard errors; statistical is NaN where the truth had no photon noise."""

    value: Floats
    statistical: Floats
    model: Floats

    @property
    def error(self) -> Floats:
        """Both together (k,)."""
        return np.hypot(np.nan_to_num(self.statistical), self.model)

    def interval(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """Low and high ends (k,) of the interval that holds the truth with probability `level`."""
        half = norm.isf(0.5 - level / 2) * self.error
        return self.value - half, self.value + half


@dataclass(frozen=True)
class LawWithErrors:
    """A law with the names of its constants and its objective; `statistical` (p, p) is None without photon noise."""

    law: Any
    free: tuple[str, ...]
    objective: str
    statistical: Floats | None
    discrepancy: Discrepancy | None

    @classmethod
    def of_record(cls, law: Any, content: Mapping[str, Any], arrays: Mapping[str, Floats]) -> LawWithErrors:
        """Return `law` with the constants of a record and its errors; old ones say nothing of the model."""
        covariance = content.get("covariance", {})
        statistical = covariance.get("statistical")
        noise = None if statistical is None else np.asarray(statistical, float)
        objective = content["protocol"]["weighting"]["objective"]
        return cls(law, tuple(covariance.get("names", ())), objective, noise, read(content, arrays))

    @property
    def is_map(self) -> bool:
        return self.objective in OF_MAPS

    def statistical_error(self, slope: Floats) -> Floats:
        """Return statistical errors (k,) of quantities whose derivatives are `slope` (k, p)."""
        if self.statistical is None:
            return np.full(len(slope), np.nan)
        return np.sqrt(np.einsum("kp,pq,kq->k", slope, self.statistical, slope))


@dataclass(frozen=True)
class AtAlbedo:
    """A profile law at one albedo, ring by ring of `EDGES`: energy (n,) [-] and slope (n, p), its derivatives."""

    known: LawWithErrors
    alpha: float
    energy: Floats
    slope: Floats

    @classmethod
    def of(cls, known: LawWithErrors, alpha: float) -> AtAlbedo:
        """Evaluate a law at an albedo."""
        total = float(known.law.albedo.reflectance(alpha))
        alone, none = np.array([alpha]), np.zeros((1, EDGES.size - 1))
        rings = Rings(alone, EDGES, none, np.array([total]), none, alone, np.array(NO_LIMITS), np.zeros(0))
        energy, slope = predicted(ResidualFunction(known.objective, known.free), known.law, rings)
        lit = energy[0] > 0  # (7) ends where it falls below zero
        return cls(known, alpha, np.where(lit, energy[0], 0.0), np.where(lit[:, None], slope[0], 0.0))

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (n, n) of the model's error in ring energies."""
        process, n = self.known.discrepancy, EDGES.size - 1
        if process is None:
            return np.full((n, n), np.nan)
        unit = unit_energy(self.known.objective, self.energy[None], np.array([self.alpha]), EDGES)[0]
        unit = np.where(self.energy > 0, unit, 0.0)
        relative = self.slope / np.where(unit > 0, unit, 1.0)[:, None]
        u, s = np.log(middles(EDGES)), process.places(np.full(n, self.alpha), self.known.law.setting)
        return process.law_covariance(u, s, np.where(unit[:, None] > 0, relative, 0.0)) * np.outer(unit, unit)

    def radius(self, share: float) -> tuple[float, float, float]:
        """Return the radius within which `share` of the energy leaves [mfp], and its two errors."""
        total = self.energy.sum()
        inside = np.cumsum(self.energy) / total
        place = int(np.searchsorted(inside, share))
        weight = (np.arange(inside.size) <= place) * 1.0
        before = inside[place - 1] if place else 0.0
        part = (share - before) / (inside[place] - before)
        weight[place] = part
        value = EDGES[place] + part * (EDGES[place + 1] - EDGES[place])
        density = (inside[place] - before) / (EDGES[place + 1] - EDGES[place])
        moved = -(weight - share) / total / density  # d radius / d ring energy
        gain = moved @ self.slope
        model = float(np.sqrt(max(moved @ self.covariance @ moved, 0.0))) if self.known.discrepancy else np.nan
        return float(value), float(self.known.statistical_error(gain[None])[0]), model


def radius(known: LawWithErrors, alpha: ArrayLike, share: float = ENERGY_WITHIN) -> Quantity:
    """Return the radius (k,) [mfp] within which `share` of the light leaves; beyond 99.5 % see `tail_error`."""
    if known.is_map or not 0 < share < 1:
        raise InputError(f"share must be in (0, 1), of a profile law, got {share!r} of {type(known.law).__name__}")
    rows = [AtAlbedo.of(known, float(a)).radius(share) for a in np.atleast_1d(alpha)]
    return Quantity(*np.array(rows).T)


def profile(known: LawWithErrors, r: ArrayLike, alpha: float) -> Quantity:
    """Return R_d (k,) [1/mfp^2] at radii `r` (k,) [mfp] of one albedo."""
    require(not (known.is_map or known.objective in QUANTILES), "objective", "of a fit to profiles", known.objective)
    here, radii = AtAlbedo.of(known, float(alpha)), np.atleast_1d(np.asarray(r, float))
    value = np.asarray(known.law.profile(radii, alpha), float)
    energy = np.where(here.energy > 0, here.energy, 1.0)
    noise = known.statistical_error(here.slope) / energy
    model = np.sqrt(np.maximum(np.diag(here.covariance), 0.0)) / energy
    at, known_at = np.log(radii), np.log(middles(EDGES))
    relative = [np.interp(at, known_at, np.where(here.energy > 0, part, np.nan)) for part in (noise, model)]
    return Quantity(value, np.abs(value) * relative[0], np.abs(value) * relative[1])


def reflectance(known: LawWithErrors, alpha: ArrayLike) -> Quantity:
    """Return the total reflectance A (k,) [-] at albedos `alpha` (k,), by a map."""
    if not known.is_map:
        raise InputError(f"known must be of a map between alpha and A, got {type(known.law).__name__}")
    albedos = np.atleast_1d(np.asarray(alpha, float))
    one, none = np.ones(albedos.size), np.zeros((albedos.size, 1))
    rings = Rings(albedos, np.array([0.0, 1.0]), none, one, none, one, np.array(NO_LIMITS), np.zeros(0))
    energy, slope = predicted(ResidualFunction(known.objective, known.free), known.law, rings)
    value = energy[:, 0]
    model = np.full(value.size, np.nan)
    if known.discrepancy is not None:
        places = known.discrepancy.places(albedos, known.law.setting)
        spread = known.discrepancy.law_covariance(0.0 * albedos, places, slope[:, 0] / energy)
        model = value * np.sqrt(np.maximum(np.diag(spread), 0.0))
    return Quantity(value, known.statistical_error(slope[:, 0]), model)


def tail_error(known: LawWithErrors, profiles: Profiles) -> float:
    """Return the root mean square of law/data - 1 of the radius of 99.5 % [-], over the law's albedos that hold it."""
    errors = []
    settings = profiles.settings or (known.law.setting,) * profiles.alpha.size
    for alpha, cdf, setting in zip(profiles.alpha, profiles.cdf, settings, strict=True):
        if setting == known.law.setting and alpha < 1.0 and cdf[-1] > ENERGY_WITHIN:
            truth = float(np.interp(ENERGY_WITHIN, cdf, profiles.r_edges))
            errors.append(AtAlbedo.of(known, float(alpha)).radius(ENERGY_WITHIN)[0] / truth - 1.0)
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan


def summary(known: LawWithErrors, profiles: Profiles) -> dict[str, Any]:
    """Return a record's table of A, or of the radius that holds 99.5 % of the energy, at a few albedos."""
    if known.is_map:
        return {"alpha": SHOWN, "quantity": "reflectance", **vars(reflectance(known, SHOWN))}
    radii = radius(known, SHOWN)
    model = np.fmax(radii.model, radii.value * tail_error(known, profiles))
    return {"alpha": SHOWN, "quantity": "radius", **vars(replace(radii, model=model))}
