"""Light in water, in closed form: what of a beam is found at a depth, the blur of it, and what a view ray gathers.

Light that is turned by small angles spreads as Wells (AGARD Lecture Series 61, 1973; Mobley, Light and Water, 1994)
has it: across the beam every frequency k fades by e^{-c t + gain(k)}, the gain being what scattering does not take
out of that frequency. Henyey and Greenstein's lobe at small angles is (1 + g) / 2g times the density whose transform
is e^{-theta k}, theta = (1 - g) / sqrt(g): more than one, since the lobe ends at pi and the density does not. That
excess, the lobes that scatter backward, and the longer paths of light that was turned far are one wide term, whose
width and strength are fitted to photons (`photons`, an independent Monte Carlo).

Lengths and depths are in 1 / c, c = a + b the attenuation [1/m]: ct, cw, and k / c. omega = b / c.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls
from scipy.special import hankel1

from mcml_sim.media.arrays import (
    Floats,
    checked_numbers,
    checked_range,
    checked_whole,
    is_number,
    require,
    require_one_shape,
    shown,
)
from profilefit.errors import InputError
from profilefit.fitting.solver import differences, solve
from profilefit.laws.phases import haltrin as haltrin

Lobes = Sequence[tuple[float, float]]
ROUNDING = 1e-9  # by which weights may exceed 1


class Longer(NamedTuple):
    """Light in all the plane that longer paths take: e^-X, X = size omega (1 - omega)^absorbed D (ct)^depth.

    D is the mean of 1 - cos over all that is scattered onward. Fitted to photons of three phase functions (one, two
    and three terms of mean cosines 0.924 to 0.928), omega 0.2, 0.5, 0.8 and ct 0.5, 1, 2, 4; its errors beside.
    width is that of all wide light, in place of a lobe's theta [-], fitted at radii to 3; its error is half of what it
    moves by where they end at 1.
    """

    size: float
    absorbed: float
    depth: float
    width: float


FITTED = Longer(size=0.608, absorbed=0.599, depth=1.737, width=0.816)
FITTED_ERRORS = Longer(size=0.015, absorbed=0.007, depth=0.017, width=0.02)
# Hankel's transform along a ray of complex frequencies, where nothing oscillates: 45 degrees off the axis both the
# Bessel function and e^{-theta k t} fall. The trapezoid rule in ln k converges exponentially; this is right to 1e-9.
STEP, LEAST, MOST = 0.2, -60.0, 3.8
RAY = np.exp(0.25j * np.pi + np.arange(LEAST, MOST, STEP))
RULE = hankel1(1, RAY) * RAY * STEP
NOTHING = 1e-8  # of k t
TOGETHER = 4096  # arguments whose nodes are in memory at once
NARROWEST = 1e-12  # radius [-] from which on only unscattered light is left
SPAN = 0.999, 0.003  # of a transform, between which a sum of Gaussians follows it
FREQUENCIES = 96
MOST_GAUSSIANS = 8
MOVED, TOLERANCE = 1e-6, 1e-6  # of ln of a variance, for derivatives and of a search
GAIN = 1e-10  # of a sum of squares, that another step must gain
HALVINGS = 60
UNBOUNDED = "a number >= 0, or inf", np.inf
RANGES = {"omega": ("an albedo in [0, 1]", 1.0), "cw": UNBOUNDED, "t1": UNBOUNDED}


def beam_share(omega: ArrayLike, ct: ArrayLike, cw: ArrayLike, lobes: Lobes) -> Any:
    """Return the share of a pencil beam's light that crosses the plane at a depth downward within a radius [-].

    omega, ct, cw  albedo in [0, 1], depth >= 0 and radius >= 0 (inf: the whole plane), which broadcast
    lobes          (weight, g) of Henyey and Greenstein's terms; what the weights leave to 1 is lost

    Unscattered light is in it; the water has no surface and no end. It is also the irradiance on the axis of a shaft
    of that radius whose irradiance was 1: each point of the shaft adds what the beam has there.
    e^-ct + int_0^inf (E(k) - e^-ct) w J_1(k w) dk with the transform E
    of `water_mtf`. Against photons for omega <= 0.8 and ct <= 4: 0.7 % at any radius for phase functions as they were
    fitted, 1.6 % for others of terms with g >= 0.85; 6 % for one term of g = 0.8. It leaves out light that was
    scattered up and comes down again, which is 1 % only from omega 0.9 on.
    """
    terms = _checked_lobes(lobes)
    albedo, depth, radius = _checked(omega=omega, ct=ct, cw=cw)
    shape = np.broadcast_shapes(albedo.shape, depth.shape, radius.shape)
    some, far, wide = (np.broadcast_to(one, shape).ravel() for one in (albedo, depth, radius))
    return _within(some, far, wide, terms).reshape(shape)[()]


def water_mtf(omega: ArrayLike, ct: ArrayLike, k_over_c: ArrayLike, lobes: Lobes) -> Any:
    """Return the contrast that water leaves of a pattern of light of frequency k across it, times its mean [-].

    omega, ct, k_over_c  albedo, depth and angular frequency >= 0 [-], which broadcast;  lobes  as of `beam_share`

    E(k) = e^{-ct + G(k)} is the blur of a caustic map at its depth; E(0) is the plane's irradiance by the sun's.
        G = omega ct [sum_i w_i (N_i phi(theta_i k t) + (F_i - N_i) phi(kappa k t))] - X phi(kappa k t),
    phi(x) = (1 - e^-x) / x, theta_i = (1 - g_i) / sqrt(g_i), N_i = (1 + g_i) / 2 g_i, F_i the share of the lobe that
    goes onward, kappa and X of `Longer`. Lobes wider than kappa are taken to be as wide as that.
    """
    terms = _checked_lobes(lobes)
    albedo, depth, frequency = _checked(omega=omega, ct=ct, k_over_c=k_over_c)
    return np.exp(_gain(albedo, depth, frequency, terms) - depth)[()]


class WaterGaussians(NamedTuple):
    """A blur as a shader has it: unscattered light stays, the rest is a sum of Gaussians.

    unscattered  e^-ct [-];  variances, weights  (count,) rising [1/c^2] and [-], of e^{-r^2 / 2 v} / (2 pi v)
    error        largest difference to E(k), by E(0), over all k [-]

    The weights and unscattered light are E(0) together.
    """

    unscattered: float
    variances: Floats
    weights: Floats
    error: float

    def mtf(self, k_over_c: ArrayLike) -> Any:
        """Return E at frequencies [-]."""
        square = 0.5 * np.asarray(k_over_c, float)[..., None] ** 2
        return (self.unscattered + np.exp(-square * self.variances) @ self.weights)[()]

    def share(self, cw: ArrayLike) -> Any:
        """Return the share within a radius [-]."""
        square = 0.5 * np.asarray(cw, float)[..., None] ** 2
        return (self.unscattered - np.expm1(-square / self.variances) @ self.weights)[()]


def water_gaussians(omega: float, ct: float, lobes: Lobes, count: int) -> WaterGaussians:
    """Fit unscattered light and 1 to 8 Gaussians to `water_mtf`: least squares over frequencies even in ln k.

    Variances by least squares within bounds, and the weights, none negative, to each of them.
    """
    terms = _checked_lobes(lobes)
    albedo, depth = _checked(omega=omega, ct=ct)
    if albedo.ndim or depth.ndim:
        raise InputError(f"omega and ct must be single numbers, got {shown(omega)} and {shown(ct)}")
    straight = float(np.exp(-depth))
    number = checked_whole("count", count, lowest=1, highest=MOST_GAUSSIANS)
    whole = float(_scattered(albedo, depth, np.zeros(()), terms))
    if not whole > 0:
        return WaterGaussians(straight, np.ones(number), np.zeros(number), 0.0)
    wide = np.geomspace(1e-9, 1e9, 2000) / depth
    of_wide = _scattered(albedo, depth, wide, terms) / whole
    seen = wide[(of_wide < SPAN[0]) & (of_wide > SPAN[1])]
    frequency = np.geomspace(seen[0], seen[-1], FREQUENCIES)
    target = _scattered(albedo, depth, frequency, terms) / whole

    def weighted(logs: Floats) -> tuple[Floats, Floats]:
        """Return weights that sum to 1, and the error that they leave."""
        table = np.exp(-0.5 * np.square(frequency)[:, None] * np.exp(logs))
        rows = np.vstack([table, np.full(number, 1e3)])  # the last one, which counts for all, keeps the energy
        found = nnls(rows, np.append(target, 1e3))[0]
        found = found / np.sum(found)
        return found, table @ found - target

    ends = -2.0 * np.log(frequency[[-1, 0]])
    bounds = ends[0] - 3, ends[1] + 3
    start = ends[0] + (ends[1] - ends[0]) * (np.arange(number) + 0.5) / number
    at = differences(lambda here: weighted(here)[1], MOVED)
    logs = np.sort(solve(at, start, bounds, tolerance=TOLERANCE, gain=GAIN, longest=1.0).parameters)
    weights, _ = weighted(logs)
    residual = np.exp(-0.5 * np.square(wide)[:, None] * np.exp(logs)) @ weights - of_wide
    error = float(np.max(np.abs(residual))) * whole / (whole + straight)
    return WaterGaussians(straight, np.exp(logs), whole * weights, error)


def failing_depth(omega: ArrayLike, cw: ArrayLike, lobes: Lobes, by: float = 0.1) -> Any:
    """Return b t [-] at which e^-ct, the unscattered share, is too dark by a part of itself; inf where it never is.

    omega, cw  which broadcast;  by  by how much there is more light within the radius than e^-ct, > 0
    """
    terms = _checked_lobes(lobes)
    require(is_number(by) and 0 < by < np.inf, "by", "a number > 0", by)
    albedo, radius = np.broadcast_arrays(*_checked(omega=omega, cw=cw))
    fails = (albedo > 0) & (radius > 0)
    some, within = np.where(fails, albedo, 1.0).ravel(), np.where(fails, radius, 1.0).ravel()
    low, high = np.full(some.size, -16.0), np.full(some.size, 4.0)  # ln ct
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        depth = np.exp(middle)
        is_more = _within(some, depth, within, terms) * np.exp(depth) > 1.0 + by
        low, high = np.where(is_more, low, middle), np.where(is_more, middle, high)
    found = np.where(fails.ravel() & (high < 4.0), some * np.exp(high), np.inf)
    return found.reshape(albedo.shape)[()]


def segment_integral(c: ArrayLike, s0: ArrayLike, t0: ArrayLike, m: ArrayLike, t1: ArrayLike) -> Any:
    """Return int_0^t1 e^{-c (s0 + m t)} e^{-c (t0 + t)} dt [length]: light of a beam that a view ray brings to an eye.

    c       attenuation >= 0 [1/length];  m  cosine of the view ray to the beam, in [-1, 1]; -1 looks along it
    s0, t0  way of the light to the segment's begin, and from there to the eye, >= 0
    t1      length of the segment >= 0, inf where the integral is finite

    e^{-c (s0 + t0)} t1 phi(c (1 + m) t1), phi(x) = (1 - e^-x) / x. Written as it stands, in float32, 1 - e^-x and 1 + m
    lose all digits where the view is along the beam, which is where it is brightest. `glsl/segment.glsl` is this
    function in float32 throughout; here float32 in is float32 out, computed in float64 and rounded once.
    """
    names = {"c": c, "s0": s0, "t0": t0, "t1": t1}
    is_single = all(getattr(one, "dtype", None) == np.float32 for one in (*names.values(), m))
    rate, begin, back, length = _checked(**names)
    cosine = checked_range("m", m, "a cosine in [-1, 1]", -1.0, 1.0)
    require_one_shape(**names, m=m)
    fading = rate * (1.0 + cosine)
    if np.any(np.isinf(length) & (fading == 0)):
        raise InputError("t1 must be finite where c (1 + m) is 0 and nothing fades, got inf")
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        x = fading * length
        # Of a long segment the length itself, which may be inf, does not enter.
        whole = np.where(
            x > 1, -np.expm1(-x) / np.where(fading > 0, fading, 1.0), length * _mean_decay(np.minimum(x, 1))
        )
        found = np.exp(-rate * (begin + back)) * whole
        return found.astype(np.float32 if is_single else np.float64)[()]


def segment_between(begin: ArrayLike, end: ArrayLike, t1: ArrayLike) -> Any:
    """Return that integral of optical ways at both ends of a segment: t1 e^{-min} phi(|begin - end|) [length].

    begin, end  c (s + t) >= 0 [-] of light that is scattered there, s to the place and t on to the eye;  t1  length

    For rays that the surface turned aside: from a level surface s is depth over the cosine of the beam, so that m is
    v_z over that cosine, which may be beyond 1 or -1, and not the cosine between the two.
    """
    names = {"begin": begin, "end": end, "t1": t1}
    first, last, length = _checked(**names)
    require(not np.any(np.isinf(length)), "t1", "finite", np.inf)
    return (length * np.exp(-np.minimum(first, last)) * _mean_decay(np.abs(first - last)))[()]


def onward(g: float) -> tuple[float, float]:
    """Return F = int_0^1 p dcos, a Henyey-Greenstein lobe's share that goes onward, and int_0^1 (1 - cos) p dcos."""
    if abs(g) < 1e-3:  # p = (1 + 3 g cos) / 2
        return 0.5 + 0.75 * g, 0.25 + 0.25 * g
    root = np.sqrt(1.0 + g * g)
    share = 1.0 - (1.0 - g) / (2.0 * g) * ((1.0 + g) / root - 1.0)
    cosine = (1.0 - g * g) / (4.0 * g * g) * ((1.0 + g * g) / (1.0 - g) + (1.0 - g) - 2.0 * root)
    return float(share), float(share - cosine)


def _gain(omega: Any, depth: Any, frequency: Any, terms: Floats) -> Any:
    """Return G(k), which may be complex; at k = inf 0."""
    share, deviation = np.array([onward(g) for g in terms[:, 1]]).T
    share, deviation = terms[:, 0] @ share, terms[:, 0] @ deviation
    excess = FITTED.size * omega * (1.0 - omega) ** FITTED.absorbed * deviation * depth**FITTED.depth
    y = frequency * depth
    narrow, removed = 0.0, 0.0
    for weight, g in terms:
        theta = (1.0 - g) / np.sqrt(g) if g > 0 else np.inf
        if theta < FITTED.width:
            strength = weight * (1.0 + g) / (2.0 * g)
            removed += strength
            narrow = narrow + strength * _mean_decay(theta * y)
    return omega * depth * narrow + (omega * depth * (share - removed) - excess) * _mean_decay(FITTED.width * y)


def _mean_decay(x: Any) -> Any:
    """Return (1 - e^-x) / x."""
    small = np.abs(x) < 1e-8
    safe = np.where(small, 1.0, x)
    with np.errstate(under="ignore"):
        return np.where(small, 1.0 - 0.5 * x, -np.expm1(-safe) / safe)


def _scattered(omega: Any, depth: Any, frequency: Any, terms: Floats) -> NDArray:
    """Return E(k) - e^-ct, without cancellation where little is scattered, and without overflow where ct is large."""
    gain, straight = _gain(omega, depth, frequency, terms), np.exp(-depth)
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        return np.where(depth > 1.0, np.exp(gain - depth) - straight, straight * np.expm1(gain))


def _within(omega: Floats, depth: Floats, radius: Floats, terms: Floats) -> Floats:
    """Return `beam_share` of arrays (n,)."""
    found = np.exp(-depth)
    for first in range(0, radius.size, TOGETHER):
        part = slice(first, first + TOGETHER)
        some, far, wide = omega[part], depth[part], radius[part]
        whole = _scattered(some, far, np.zeros_like(far), terms)
        near = np.where((wide > NARROWEST) & np.isfinite(wide), wide, 1.0)
        # Where k t is next to nothing a transform is all of its light, and adds nothing.
        first_node = int(np.clip((np.log(NOTHING * np.min(near / (1.0 + far))) - LEAST) / STEP, 0, RAY.size - 1))
        nodes, rule = RAY[first_node:], RULE[first_node:]
        along = _scattered(some[:, None], far[:, None], nodes / near[:, None], terms)
        within = whole + np.real((along - whole[:, None]) @ rule)
        found[part] += np.where(wide > NARROWEST, np.where(np.isinf(wide), whole, within), 0.0)
    return found


def _checked(**values: ArrayLike) -> list[Floats]:
    """Return numbers that broadcast: omega in [0, 1], cw and t1 >= 0 or inf, the others finite and >= 0."""
    found = []
    for name, value in values.items():
        accepted, highest = RANGES.get(name, ("a finite number >= 0", np.finfo(float).max))
        found.append(checked_range(name, value, accepted, 0.0, highest))
    require_one_shape(**values)
    return found


def _checked_lobes(lobes: Lobes) -> Floats:
    accepted = "a list of pairs (weight, g)"
    terms = checked_numbers("lobes", lobes, accepted)
    require(terms.ndim == 2 and terms.shape[1] == 2 and len(terms), "lobes", accepted, lobes)
    weights, g = terms.T
    are_shares = np.all((weights >= 0) & (weights <= 1 + ROUNDING)) and np.sum(weights) <= 1 + ROUNDING
    require(are_shares, "weights of lobes", ">= 0 and sum to at most 1", weights.tolist())
    require(np.all(np.abs(g) < 1), "g of lobes", "in (-1, 1)", g.tolist())
    return terms
