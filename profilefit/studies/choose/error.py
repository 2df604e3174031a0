"""Error of a technique at a step edge of light, and its parts; the light of profiles, filters and gathers there.

On a plane the light from beyond an edge at the distance d is a share F(d) of A (`step_edge`), and what a line at
the distance c adds is -F'(c). On a cylinder of radius R the line at the arc s is c = 2R sin(s/2R) away, straight
through, so that what lies within the arc s adds

    I(s) = int_0^s -F'(c) ds = int -dF / cos(s / 2R)

and the light at a place is the lit part of what is visible over all that is visible: half the cylinder. These are
integrals, without noise; the reference is the exact half space.

A filter sums over its taps, which follow the surface as the stage's do; a gather over its samples, on an endless
surface. A few Gaussians, each blurred with on its own along rows and columns, are what a profile's step edge is nearest
to:

    F(d) = sum_k w_k Q(d / sigma_k),    Q the upper tail of the normal distribution (d'Eon and Luebke, GPU Gems 3, 14)

Weights and widths are fitted to the light beyond a straight edge, within 6 mean free paths of it, for one albedo.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import ndtr

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats, require
from profilefit.fitting.sampling import LawTarget
from profilefit.fitting.solver import differences, solve
from profilefit.laws.base import ProfileLaw
from profilefit.laws.rational import REFRACTING
from profilefit.scenes.skin.law import DARKEST, FOLLOW, Separable, kernel_quartile
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.reference.step_edge import LAST_XI, shifted_points, step_response
from profilefit.scenes.stage.world import Rgb
from profilefit.studies.choose.case import Case, Option, Within, is_filter

NEAR = 0.03  # d = NEAR sinh u [mfp]: F is smooth in d at the edge and in ln d far away
FARTHEST = 300.0  # [mfp]
KNOTS = 72  # of F: within 2e-5 of itself
ARCS = 600  # of I(s)
LEAST_SHARE = 1e-15
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Beyond:
    """F(d), the share of the light from beyond a straight edge at the distance d >= 0 [mfp] on a plane."""

    curve: CubicSpline

    def __call__(self, d: Floats) -> Floats:
        near = np.clip(np.asarray(d, float), 0.0, FARTHEST)
        return np.where(np.isinf(d), 0.0, np.exp(self.curve(np.arcsinh(near / NEAR))))

    @property
    def quartile(self) -> float:
        """The distance [mfp] at which a quarter comes from beyond."""
        return float(NEAR * np.sinh(brentq(lambda u: float(self.curve(u)) - np.log(0.25), 0.0, self.curve.x[-1])))


@lru_cache(maxsize=512)
def beyond(alpha: float, setting: Setting, law: ProfileLaw | None = None) -> Beyond:
    """Return F(d) of the exact half space, or of a law."""
    u = np.linspace(0.0, np.arcsinh(FARTHEST / NEAR), KNOTS)
    d = NEAR * np.sinh(u)
    share = step_response(-d, alpha, setting=setting) if law is None else step_response(-d, alpha, law=law)
    return Beyond(CubicSpline(u, np.log(np.maximum(share, LEAST_SHARE))))


def response(share: Beyond, x: Floats, mfp: float, radius: float, window: float = np.inf) -> Floats:
    """Return L / A at distances x > 0 (...) from the edge on the screen, on the lit side; all lengths in the same unit.

    window  how far the picture shows the plane on either side of the edge; a cylinder ends by itself
    """
    if np.isinf(radius):
        dark, unseen = share(x / mfp), share((window + np.array([-1.0, 1.0]) * x[..., None]) / mfp)
        return (1.0 - dark - unseen[..., 0]) / (1.0 - unseen.sum(axis=-1))
    arc = radius * np.arcsin(x / radius)
    within = _within(share, mfp, radius)
    quarter = 0.5 * np.pi * radius
    lit = within(arc) + within(quarter - arc)
    dark = within(quarter + arc) - within(arc)
    return lit / (lit + dark)


def averaged(share: Beyond, x: Floats, pixel: float, mfp: float, radius: float, window: float = np.inf) -> Floats:
    """Return the mean of `response` over pixels (m,) whose middles are at x: what their footprints show."""
    t = 0.5 * (NODES + 1.0)
    inside = x[:, None] + pixel * (t**3 - 0.5)  # close together at the edge, where short paths are all there is
    if not np.isinf(radius):
        inside = np.minimum(inside, radius)
    return response(share, inside, mfp, radius, window) @ (1.5 * WEIGHTS * t**2)


def _within(share: Beyond, mfp: float, radius: float) -> CubicSpline:
    """Return I(s) of arcs up to half the circle, by the way from u to u of s = s0 sinh u."""
    first = 1e-3 * min(mfp, radius)
    u = np.linspace(0.0, np.arcsinh(np.pi * radius / first), ARCS)
    s = first * np.sinh(u)
    middle = 0.5 * (s[1:] + s[:-1])
    fall = -np.diff(share(2.0 * radius * np.sin(np.minimum(0.5 * s / radius, 0.5 * np.pi)) / mfp))
    total = np.append(0.0, np.cumsum(fall / np.cos(0.5 * middle / radius)))
    return lambda arc: np.interp(np.arcsinh(arc / first), u, total)


@dataclass(frozen=True)
class ReferenceLight:
    """The light of a setting, exact; InputError where no law has constants for its index."""

    setting: Setting

    def __post_init__(self) -> None:
        n = self.setting.n
        require(1.0 <= n <= REFRACTING.high, "index", f"a refractive index in [1, {REFRACTING.high:g}]", n)

    def alpha(self, reflectance: float) -> float:
        """Return the reduced albedo [-] of a reflectance A [-]."""
        return max(albedo_of(reflectance, self.setting), DARKEST)

    def beyond(self, reflectance: float) -> Beyond:
        """Return F(d) of a reflectance A [-]."""
        return beyond(self.alpha(reflectance), self.setting)


CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class Error:
    """Root mean square error of radiance over the places within reach of the edge, as a share of white [-].

    White is what a surface with A = 1 shows that is lit all over. Of the worst channel: total, and what it is made of
    in squares: `model`, the law or kernel on a plane; `curvature`, what that changes around the cylinder; `pixel`, the
    place in the middle for the mean over a pixel; `noise` of the samples.
    """

    total: float
    model: float
    curvature: float
    pixel: float
    noise: float
    channel: int
    case: Case


def error(option: Option, case: Case, light: ReferenceLight, within: Within) -> Error:
    """Return the error of an option in the worst channel."""
    return max((_of_channel(option, case, light, within, c) for c in range(3)), key=lambda one: one.total)


def _of_channel(option: Option, case: Case, light: ReferenceLight, within: Within, channel: int) -> Error:
    reflectance, mfp, plane = case.reflectance[channel], case.mfp[channel], case.flat()
    x = case.places(channel, within)
    share = light.beyond(reflectance)
    truth = averaged(share, x, case.pixel, mfp, case.radius, case.window[0])
    here = response(share, x, mfp, case.radius, case.window[0])
    if option.law is None:
        found = _mean(option, case, light, channel, x)[:, None]
    else:
        albedos = tuple(_alpha(option.law, a) for a in case.reflectance)
        found = estimates(option.law, albedos, option.number, case, channel, x)
    noise = found.var(axis=1, ddof=1) if found.shape[1] > 1 else np.zeros(len(x))
    bias = found.mean(axis=1) - truth
    flat = _mean(option, plane, light, channel, x) - response(share, x, mfp, plane.radius, plane.window[0])
    curved = _mean(option, case, light, channel, x) - here
    squares = bias**2 + noise * (1.0 - 1.0 / found.shape[1]), flat**2, (curved - flat) ** 2, (here - truth) ** 2, noise
    total, model, bent, pixel, grain = (reflectance * float(np.sqrt(np.mean(each))) for each in squares)
    return Error(total, model, bent, pixel, grain, channel, case)


def _mean(option: Option, case: Case, light: ReferenceLight, channel: int, x: Floats) -> Floats:
    """Return L / A at places (m,) without noise."""
    if option.law is not None:
        share = beyond(_alpha(option.law, case.reflectance[channel]), option.law.setting, option.law)
        return response(share, x, case.mfp[channel], case.radius, case.window[0])
    return filtered(option, case, light, channel, x) if is_filter(option) else np.ones(x.shape)


@cache
def _alpha(law: ProfileLaw, reflectance: float) -> float:
    """Return the albedo that a law's own map gives to a reflectance A [-], as its shader has it."""
    return float(law.albedo.alpha(reflectance))  # type: ignore[attr-defined]


FITTED = 6.0 * ((np.arange(60) + 0.5) / 60) ** 2  # distances [mfp], closer together at the edge
REACH = 3.0  # of the taps, in the widest sigma
STEP, TOLERANCE = 1e-6, 1e-6  # of ln of a weight or a width, for derivatives and of a search


@dataclass(frozen=True)
class OneGaussian(Separable):
    """A filter that is one Gaussian: sigma of red, green and blue [mm]."""

    sigma: Rgb = (1.0, 1.0, 1.0)

    def stretches(self, alpha: Floats, mfp: Floats) -> Floats:
        """Return the widths themselves: the fit knew albedo and mean free path."""
        return np.array(self.sigma)

    def taps(self, number: int, stretches: Floats) -> NDArray[np.float32]:
        """Return (taps, 4): what a channel's Gaussian holds nearest to each tap, and offset [mm]."""
        even = np.linspace(-1.0, 1.0, number | 1)
        offset = REACH * float(np.max(stretches)) * np.sign(even) * even**2
        between = np.concatenate([[-np.inf], 0.5 * (offset[1:] + offset[:-1]), [np.inf]])
        weight = np.diff(ndtr(between[:, None] / np.asarray(stretches)), axis=0)
        return np.column_stack([weight, offset]).astype(np.float32)


@lru_cache(maxsize=256)
def fitted(share: Beyond, count: int) -> tuple[Floats, Floats]:
    """Return weights (count,) of sum 1 [-] and sigmas (count,) [mfp]."""
    target = share(FITTED)
    quartile = np.interp(-0.25, -target, FITTED)

    def split(free: Floats) -> tuple[Floats, Floats]:
        share = np.exp(np.append(0.0, free[count:]))
        return share / share.sum(), np.exp(free[:count])

    def missed(free: Floats) -> Floats:
        weight, sigma = split(free)
        return ndtr(-FITTED[:, None] / sigma) @ weight - target

    first = np.log(quartile * np.geomspace(0.3, 4.0, count)) if count > 1 else np.log([1.5 * quartile])
    start = np.append(first, np.zeros(count - 1))
    return split(solve(differences(missed, STEP), start, tolerance=TOLERANCE).parameters)


def passes(option: Option, case: Case, light: ReferenceLight) -> list[tuple[Floats, Separable, Floats]]:
    """Return each filter of an option: its share of each channel (3,), itself, its stretches (3,) [unit]."""
    shares = [light.beyond(a) for a in case.filter_reflectance]
    mfp = np.array(case.mfp)
    if option.kind == "separable":
        kernel = Separable(setting=light.setting)
        own = np.array([kernel_quartile(strength) for strength in kernel.strength])
        return [(np.ones(3), kernel, mfp * np.array([share.quartile for share in shares]) / own)]
    of_channels = [fitted(share, option.count) for share in shares]
    filters: list[tuple[Floats, Separable, Floats]] = []
    for k in range(option.count):
        share = np.array([weight[k] for weight, _ in of_channels])
        sigma = np.array([s[k] for _, s in of_channels]) * mfp
        red, green, blue = sigma.tolist()
        filters.append((share, OneGaussian(setting=light.setting, sigma=(red, green, blue)), sigma))
    return filters


def filtered(option: Option, case: Case, light: ReferenceLight, channel: int, x: Floats) -> Floats:
    """Return L / A of a channel at places x (m,) on the lit side."""
    total = np.zeros(x.shape)
    for share, kernel, stretches in passes(option, case, light):
        taps = kernel.taps(option.number, stretches).astype(float)
        place = x[:, None] + taps[:, 3]
        lost = np.zeros(place.shape)
        if not case.is_flat:
            middle = (np.floor(place / case.pixel) + 0.5) * case.pixel  # what is seen is a pixel's middle
            seen = np.abs(middle) < case.radius
            depth = np.sqrt(np.maximum(case.radius**2 - middle**2, 0.0)) - np.sqrt(case.radius**2 - x[:, None] ** 2)
            lost = np.where(seen, np.minimum(FOLLOW / np.max(stretches) * np.abs(depth), 1.0), 1.0)
        total += share[channel] * (np.where(place > 0, 1.0, lost) @ taps[:, channel])
    return total


# Of scatter.frag: least radius [mfp], weight of the own light per sample, least cosine, where it fades to Lambert [px].
NEAREST, OWN, LEAST_COSINE, LAMBERT = 1e-6, 1e-4, 0.05, (0.05, 0.1)
# Every estimate has a shift of its own: 1024 of them, and of many samples 256: errors known to 2 and 4 %.
MOST, FULL, SEED = 1024, 65_536, 1
FAINT = 1e-300
TABLE = np.linspace(np.log(NEAREST), np.log(1e4), 1200)  # of ln x


@lru_cache(maxsize=256)
def density(law: ProfileLaw, alpha: float) -> Callable[[Floats], Floats]:
    """Return 2 pi x R_d / A of a law over x at one albedo, between values of its logarithm over ln x."""
    values = np.log(np.maximum(LawTarget(law).density(np.exp(TABLE), alpha), FAINT))
    return lambda x: np.exp(np.interp(np.log(x), TABLE, values))


@lru_cache(maxsize=256)
def drawn(law: ProfileLaw, alpha: float, samples: int) -> tuple[Floats, Floats, Floats]:
    """Return radii x = r/l, their density, and angles of every trial, (trials, samples) each."""
    trials = min(MOST, FULL // samples)
    points = shifted_points(samples, trials, SEED)
    xi = np.full(FULL, 0.5)  # one shape, one compilation
    xi[: trials * samples] = np.minimum(points[..., 0], LAST_XI).ravel()
    x = np.maximum(np.asarray(law.sampler.sample(xi, alpha)), NEAREST)
    radii, known = (values[: trials * samples].reshape(trials, samples) for values in (x, law.sampler.pdf(x, alpha)))
    return radii, known, 2.0 * np.pi * points[..., 1]


def estimates(law: ProfileLaw, alpha: tuple[float, ...], samples: int, case: Case, channel: int, x: Floats) -> Floats:
    """Return L / A (m, trials) that the channel gathers at places x (m,) on the lit side, each by its own trials."""
    length, longest = case.mfp[channel], case.mfp[case.longest]
    every = drawn(law, alpha[case.longest], samples)
    each = len(every[0]) // len(x)
    radii, known, angle = (one[: each * len(x)].reshape(len(x), each, samples) for one in every)
    side = longest * radii
    p = known / longest
    across = x[:, None, None] + side * np.cos(angle)
    shown = (p > 0) & (np.abs(across) < case.window[0]) & (np.abs(side * np.sin(angle)) < case.window[1])
    own = density(law, alpha[channel])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance, area = _met(side, across, x, case)
        weight = area * side / distance * own(distance / length) / length / p
    weight = np.where(shown, weight, 0.0)
    rest = OWN * samples
    gathered = (rest + np.sum(weight * (across > 0), axis=2)) / (rest + np.sum(weight, axis=2))
    low, high = LAMBERT
    blurred = np.clip((length / case.pixel - low) / (high - low), 0.0, 1.0)
    return 1.0 + blurred * (gathered - 1.0)


def _met(side: Floats, across: Floats, x: Floats, case: Case) -> tuple[Floats, Floats]:
    """Return how far each sample's ray goes to the tangent plane of its pixel, and its area, 0 beside the cylinder."""
    if case.is_flat:
        return side, np.ones_like(side)
    radius = case.radius
    middle = (np.floor(across / case.pixel) + 0.5) * case.pixel
    seen = np.abs(middle) < radius
    middle = np.where(seen, middle, 0.0)
    height = np.sqrt(radius**2 - middle**2)
    facing = np.maximum(height / radius, LEAST_COSINE)
    depth = height - (across - middle) * middle / (radius * facing) - np.sqrt(radius**2 - x[:, None, None] ** 2)
    return np.hypot(side, np.where(seen, depth, 0.0)), np.where(seen, 1.0 / facing, 0.0)
