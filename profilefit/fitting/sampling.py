"""Quality of samplers: judged by the density that they have themselves, against the exact profile.

A point gathers light with radii r = sample(xi) and the weights w = f(r) / pdf(r), f the density in r of the light that
leaves (2 pi r R_d / A). Then, xi uniform:

    E[w E(r)] with the sampler's own pdf misses only what the sampler never reaches;
    with the law's density in place of pdf, as shaders do that take an approximate inverse for an exact one, the whole
    error of the inverse remains: even light comes out right if f is the law's too, an edge does not;
    Var[w] is the chi-square divergence of f from pdf.

A clip, r = min(g, r_max), draws r_max itself with a finite chance: an atom, whose samples weigh nothing. A sampler may
draw one part of the light below some xi and another above it, where radii begin at 0 anew: then two xi have one radius.

All of it is integrated over xi by Gauss's rule between the places where r(xi) turns, stops, begins anew or crosses a
radius at which the integrand jumps. xi goes up to 1 - 2^-24, as single-precision generators draw it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Setting, exact
from mcml_sim.exact.compiled import filter_jit
from mcml_sim.media.arrays import Floats, require, require_all
from profilefit.laws.base import ProfileLaw, Sampler

SEARCHLIGHT = Setting()
# The integrals run over t = -ln(1 - xi), where tails are exponential: to the last of a float's 2^24 steps.
LAST = 24.0 * np.log(2.0)
SCAN = np.concatenate([[0.0], np.geomspace(1e-9, LAST, 4000)])
SPLITS = np.concatenate([[0.0], np.geomspace(1e-6, LAST, 32)])
NODES = 16
BESIDE = np.geomspace(1e-9, 0.1, 9)  # of t, on either side of a jump: radii go to infinity before it
ZOOM, ZOOMS = 65, 8  # a bracket shrinks by 32 each time: to rounding
BATCH = 512  # calls have one shape, so that a compiled sampler compiles once
LAST_SHARE = 0.999
Radius = Callable[[Floats], Floats]


@dataclass(frozen=True)
class SamplerQuality:
    """Measures of a sampler at each albedo (m,).

    inversion_error  max over xi in [0, 0.999] of |cdf(sample(xi)) - xi|, the target's cdf [-]; where one radius has two
                     xi, `Sampler.undone` in place of the law's cdf
    atom             share of the samples at radii that are drawn with a finite chance [-]
    bias             relative error of even light (m,), and of light beyond a straight edge, `edge_bias`, with pdf
    bias_by_law_pdf  the same with the law's density in place of pdf; infinite where that is 0 and samples fall
    variance         of the weight f / pdf of one sample [-]
    """

    alpha: Floats
    inversion_error: Floats
    atom: Floats
    bias: Floats
    edge_bias: Floats
    bias_by_law_pdf: Floats
    edge_bias_by_law_pdf: Floats
    variance: Floats


@dataclass(frozen=True)
class LawTarget:
    """The light of a law."""

    law: ProfileLaw

    def density(self, x: Floats, alpha: float) -> Floats:
        """Return the slope of the law's cdf: whatever the law scales its profile to."""
        return _called("slope", self.law, x, alpha)

    def cdf(self, x: Floats, alpha: float) -> Floats:
        return _called("cdf", self.law, x, alpha)


@dataclass(frozen=True)
class ExactTarget:
    """The light of the exact half space."""

    setting: Setting = SEARCHLIGHT

    def density(self, x: Floats, alpha: float) -> Floats:
        profile = np.asarray(exact.profile(x, alpha, setting=self.setting))
        return 2.0 * np.pi * x * profile / exact.reflectance(alpha, self.setting)

    def cdf(self, x: Floats, alpha: float) -> Floats:
        return np.asarray(exact.cdf(x, alpha, setting=self.setting))


# Light that is to be gathered: `density` 2 pi x R_d / A [1/mfp] and `cdf` its share within x [-], at x = r/l.
Target = LawTarget | ExactTarget


def sampler_quality(
    sampler: Sampler, alpha: ArrayLike, target: Target | None = None, edge: float = 1.0
) -> SamplerQuality:
    """Measure a sampler at each albedo in `alpha` (m,), all in (0, 1]; else InputError.

    target  the light it gathers, by default its own law's
    edge    distance of the straight edge beyond which there is light [mfp], > 0
    """
    albedos = np.atleast_1d(np.asarray(alpha, float))
    require_all("alpha", albedos, (albedos > 0) & (albedos <= 1), "in (0, 1]")
    require(np.isfinite(edge) and edge > 0, "edge", "a distance > 0", edge)
    light = target or LawTarget(sampler.law)
    rows = [_at(sampler, float(value), light, edge) for value in albedos]
    names = [field.name for field in fields(SamplerQuality)]
    return SamplerQuality(**{name: np.array([row[name] for row in rows]) for name in names})


def lit_beyond_edge(x: Floats, edge: float) -> Floats:
    """Share of the circle of radius x that is lit where light falls beyond a straight edge at this distance [-]."""
    return np.arccos(np.minimum(edge / np.maximum(x, edge), 1.0)) / np.pi


def edge_light(target: Target, alpha: float, edge: float) -> float:
    """Light gathered from beyond the edge, of that from everywhere [-]: (1/pi) int_0^(pi/2) (1 - cdf(edge/cos t)) dt.

    By parts from int f(x) arccos(edge/x)/pi dx: no density enters, so that it can judge one.
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    angle = 0.25 * np.pi * (nodes + 1.0)
    return float(0.25 * np.sum(weights * (1.0 - target.cdf(edge / np.cos(angle), alpha))))


def _at(sampler: Sampler, alpha: float, target: Target, edge: float) -> dict[str, float]:
    def radius(t: Floats) -> Floats:
        return _called("sample", sampler, -np.expm1(-t), alpha)

    with jax.enable_x64(True):
        jump = float(sampler.jump(jnp.asarray(alpha)))
    breaks, flats = _map(radius, edge, -np.log1p(-jump) if jump < 1.0 else np.inf)
    t, dt = _rule(breaks)
    share = np.exp(-t) * dt
    x = radius(t)
    light = target.density(x, alpha)
    lit = lit_beyond_edge(x, edge)
    moving = ~np.any([np.zeros(t.size, bool), *((t > low) & (t < high) for low, high, _ in flats)], axis=0)
    weight = np.where(moving, _ratio(light, _called("pdf", sampler, x, alpha)), 0.0)
    by_law = np.where(moving, _ratio(light, LawTarget(sampler.law).density(x, alpha)), 0.0)
    lost = _at_atoms(sampler, alpha, target, flats, edge)
    beyond = edge_light(target, alpha, edge)
    mean = float(share @ weight)
    xi = np.linspace(0.0, LAST_SHARE, BATCH)
    return {
        "alpha": alpha,
        "inversion_error": float(np.max(np.abs(drawn_by(sampler, xi, alpha, target) - xi))),
        "atom": float(sum(_mass(low, high) for low, high, _ in flats)),
        "bias": mean - 1.0,
        "edge_bias": float(share @ (weight * lit)) / beyond - 1.0,
        "bias_by_law_pdf": float(share @ by_law) + lost[0] - 1.0,
        "edge_bias_by_law_pdf": (float(share @ (by_law * lit)) + lost[1]) / beyond - 1.0,
        "variance": float(share @ weight**2) - mean**2,
    }


def drawn_by(sampler: Sampler, xi: Floats, alpha: float, target: Target) -> Floats:
    """Return the xi that an exact inverse of the target's cdf sends to the radii drawn at xi (m,) [-].

    Where a sampler draws a radius twice, it is the nearer of its own two, moved by the difference of the cdfs.
    """
    x = _called("sample", sampler, xi, alpha)
    with jax.enable_x64(True):
        own = np.asarray(sampler.undone(x, xi, alpha))
    if isinstance(target, LawTarget) and target.law is sampler.law:
        return own
    return own + target.cdf(x, alpha) - LawTarget(sampler.law).cdf(x, alpha)


def _at_atoms(
    sampler: Sampler, alpha: float, target: Target, flats: list[tuple[float, float, float]], edge: float
) -> tuple[float, float]:
    """Return what samples at atoms add to the means of f / law's density, of even light and light beyond the edge."""
    total, beyond = 0.0, 0.0
    for low, high, x in flats:
        outside = np.array([x * (1.0 + 1e-12)])  # where a law ends in a zero, rounding decides whether it is one
        ratio = 1.0  # of the law's light to the law's density, even where both end
        if not (isinstance(target, LawTarget) and target.law is sampler.law):
            ratio = float(_ratio(target.density(outside, alpha), LawTarget(sampler.law).density(outside, alpha))[0])
        total += _mass(low, high) * ratio
        beyond += _mass(low, high) * ratio * float(lit_beyond_edge(outside, edge)[0])
    return total, beyond


def _mass(low: float, high: float) -> float:
    """Chance of xi between -ln(1 - xi) = low and high; what lies beyond the last step counts as lying there."""
    return float(np.exp(-low) - (np.exp(-high) if high < LAST else 0.0))


def _ratio(above: Floats, below: Floats) -> Floats:
    """0 where nothing is above, infinite where something is and nothing below."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(above > 0, above / np.maximum(below, 0.0), 0.0)


def _map(radius: Radius, edge: float, jump: float) -> tuple[Floats, list[tuple[float, float, float]]]:
    """Return places in t that divide a sampler's map t -> x = r/l, and (low, high, x) where x stands still.

    jump  t at which radii begin at 0 anew
    """
    beside = np.concatenate([[jump], jump * (1.0 - BESIDE), jump * (1.0 + BESIDE)]) if jump < LAST else np.array([])
    x = radius(SCAN)
    step = np.sign(np.diff(x))
    flats = _flats(radius, x, step == 0)
    step[(SCAN[:-1] <= jump) & (jump <= SCAN[1:])] = 0.0
    turns = np.flatnonzero(step[1:] * step[:-1] < 0)
    places = [0.5 * sum(_zoomed(radius, SCAN[i], SCAN[i + 2], partial(_largest, step[i]))) for i in turns]
    extremes = [float(radius(np.array([place]))[0]) for place in places]
    crossings = [
        0.5 * sum(_zoomed(radius, SCAN[i], SCAN[i + 1], partial(_passing, np.greater, level)))
        for level in {*extremes, edge}
        for i in np.flatnonzero(np.diff(np.sign(x - level)) != 0)
    ]
    ends = [end for low, high, _ in flats for end in (low, high)]
    return np.unique(np.concatenate([SPLITS, beside[beside < LAST], places, crossings, ends])), flats


def _flats(radius: Radius, x: Floats, still: NDArray[np.bool_]) -> list[tuple[float, float, float]]:
    """Return runs of equal radii on the scan, their ends found to rounding."""
    edges = np.diff(np.concatenate([[0], still.astype(int), [0]]))
    flats = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        low, high, value = float(SCAN[first]), float(SCAN[last]), float(x[first])
        if first > 0:
            _, low = _zoomed(radius, SCAN[first - 1], low, partial(_passing, np.equal, value))
        if last < SCAN.size - 1:
            _, high = _zoomed(radius, SCAN[last + 1], high, partial(_passing, np.equal, value))
        flats.append((low, high, value))
    return flats


def _zoomed(radius: Radius, low: float, high: float, pick: Callable[[Floats], tuple[int, int]]) -> tuple[float, float]:
    """Narrow a bracket in t to rounding: `pick` names the ends of the next one, of ZOOM radii across it."""
    for _ in range(ZOOMS):
        t = np.linspace(low, high, ZOOM)
        low, high = (float(t[at]) for at in pick(radius(t)))
    return low, high


def _passing(compare: np.ufunc, level: float, x: Floats) -> tuple[int, int]:
    true = compare(x, level)
    first = int(np.argmax(true != true[0])) or ZOOM - 1
    return first - 1, first


def _largest(rising: float, x: Floats) -> tuple[int, int]:
    best = int(np.argmax(rising * x))
    return max(best - 1, 0), min(best + 1, ZOOM - 1)


def _rule(breaks: Floats) -> tuple[Floats, Floats]:
    """Nodes and weights over every interval; t = low + width sin^2 does no harm to roots at either end."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    angle = 0.25 * np.pi * (nodes + 1.0)
    low, width = breaks[:-1, None], np.diff(breaks)[:, None]
    t = low + width * np.sin(angle) ** 2
    dt = width * np.sin(2.0 * angle) * 0.25 * np.pi * weights
    return t.ravel(), dt.ravel()


def _called(name: str, owner: Sampler | ProfileLaw, values: Floats, alpha: float) -> Floats:
    """Call a method, or "slope" of a cdf, compiled, on every value, BATCH of them at a time."""
    padded = np.pad(values, (0, -values.size % BATCH), mode="edge").reshape(-1, BATCH)
    with jax.enable_x64(True):
        owner, at = jax.tree.map(jnp.asarray, (owner, alpha))  # traced, so that other constants compile nothing
        parts = [np.asarray(_method(owner, jnp.asarray(part), at, name)) for part in padded]
    return np.concatenate(parts)[: values.size]


@filter_jit
def _method(owner: Any, values: Array, alpha: Array, name: str) -> Array:
    if name == "slope":
        return jax.jvp(lambda x: owner.cdf(x, alpha), (values,), (jnp.ones_like(values),))[1]
    return getattr(owner, name)(values, alpha)
