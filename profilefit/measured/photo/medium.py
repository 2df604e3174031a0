"""The medium behind a spot: exact light under beam, lens and surface, fitted to rings, and to those of cards.

A point is spread over a core, a Gaussian of standard deviation sigma (the beam, its 1/e^2 radius being 2 sigma, and
what a lens blurs), and over halos, h_a(r) = 3 a^3 / (2 pi (r^2 + a^2)^{5/2}), whose transform is (1 + ka) e^{-ka}:
glare that falls outwards more slowly is a mixture of them. Of light of profile R_d under a beam of power one, and a
share S of it that never enters the medium but is scattered by its surface, a picture shows

    I = k sum_c share_c (R_d + S delta) * spread_c + dark,     sum_c share_c = 1,

as means over rings. The mean of h_a over a circle of radius rho, at a distance d from its centre, is
2 a^3 (E(m) / (A - B) + (2 E(m) - K(m)) / (2 (A + B))) / (pi^2 (A - B) sqrt(A + B)), A = d^2 + rho^2 + a^2, B = 2 d rho,
m = 2 B / (A + B), E and K the complete elliptic integrals. The core blurs a halo, too: by sigma^2 / 2 times its
Laplacian, which is -d^2 h_a / da^2 + (2 / a) dh_a / da.

Coordinates: those of `model` (alpha, l*, scale), ln of the core's sigma, the surface's share, the share of each halo,
the dark level, what a lens darkens; and ln of each card's scale. What is known of them beforehand is normal. A card
that light does not enter shows beam and lens alone; of a known reflectance, and exposed alike, it gives the scale.
Errors are those of the normal approximation at the best fit; the same of a truth is the Fisher bound of a setup.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag, solve_triangular
from scipy.special import ellipe, ellipk

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.arrays import Floats
from profilefit.fitting.misfit import DETECTED, waves
from profilefit.fitting.solver import CONVERGED, Solution, best_apart, covariance, lowest, solve
from profilefit.measured import model
from profilefit.measured.instrument import Gaussian, Instrument
from profilefit.measured.model import Model, u_of
from profilefit.measured.noise import WAVE
from profilefit.measured.photo.rings import SpotRings, over_rings
from profilefit.measured.problem import ALBEDOS, BLACK, FARTHEST_LN, FARTHEST_U, LENGTHS, WHITE, Known

Hashable = tuple[bytes, tuple[int, ...]]
MEDIUM = ("mu_s'", "mu_a")
HALO, ALIKE = 0.5, np.log(2.0)  # error of a halo's share over that of all glare; ln a within which shares are alike
NARROWEST, WIDEST, RATIO = 1.0, 32.0, np.sqrt(2.0)  # widths of halos [mm], and of one over the next narrower
DARK = 1e-5  # error of the dark level
UNEVEN = 0.01  # relative error in waves along ln r that neither sectors nor brackets show
SHORTEST, LONGEST = 1 / 10, 1.0  # l where the search begins: over the core's sigma, and over the last ring's radius
COARSE = 2  # steps of least squares in all but albedo and length, at each point of the coarse search
MAX_STEPS = 80
AGAIN = 1  # descents from where one stalled, whose damping has grown beyond use
FARTHEST = 1.0  # step of what light is not straight in
ENOUGH = 1e-3  # of chi-square, that another step must gain
ROOM = 1.0  # of ln l from the end of its range, within which it has run there
WITHIN = float(stats.norm.ppf(0.975))  # standard errors from a value to an end of its interval of 95 %
AT_BLACK = "alpha runs to 0: these rings show no multiple scattering; check scale, beam, n and g"
AT_WHITE = "alpha runs to 1: these rings show no absorption; photograph a wider field, or a grey card"
RAN_AWAY = "l runs to an end of its range: these rings show no scattering in the medium; check the scale and the beam"
UNENDED = "the search did not end at a minimum: photograph cards, or expose longer"
RIVALLED = "media that differ fit the rings, too: photograph a grey card, or a spot of a narrower beam"
RIVAL = float(stats.chi2.isf(DETECTED, 1))  # of chi-square above the best, up to which another minimum is a rival
LARGEST = 100.0  # of a logarithm, where an interval ends that tells nothing
FARTHER = 5.0  # of the last ring, from where halos still bring light
NEAR = 0.1  # of a, between halos whose difference is a derivative
APART = 0.05  # in ln sigma, of cores whose weights are known
POLYNOMIALS = np.linalg.inv(np.vander(np.arange(4.0), increasing=True)).T  # (4, 4) Lagrange's, lowest power first


def ring_weights(sigma: float, halos: Sequence[float], rings: SpotRings) -> tuple[Floats, Floats, Floats]:
    """Return radii (m,) and weights (1 + halos, n, m) of 2 pi rho R_d in the mean over each ring, of core and halos.

    Third the derivative (n, m) of the core's by ln sigma. The core's lie on cubics between those of sigmas APART.
    """
    place = float(np.log(sigma)) / APART
    first = int(np.floor(place)) - 1
    share = POLYNOMIALS @ (place - first) ** np.arange(4.0)
    slope = POLYNOMIALS[:, 1:] @ (np.arange(1.0, 4.0) * (place - first) ** np.arange(3.0)) / APART
    gathered = [(one.tobytes(), one.shape) for one in rings.gathered]
    cores = [_core(float(np.exp(APART * (first + at))), *gathered) for at in range(4)]
    rho, near = cores[0][0], np.stack([one for _, one in cores])
    core, widening = np.tensordot([share, slope], near, axes=1)
    sharp, bend = _halos(tuple(halos), rho.tobytes(), rings.inner.tobytes(), rings.outer.tobytes())
    blurred = sharp - 0.5 * _blur(sigma, halos)[:, None, None] ** 2 * bend
    return rho, np.concatenate([core[None], blurred]), widening


def _blur(sigma: float, halos: Sequence[float]) -> Floats:
    """Return the blur of each halo by the core; where that is no small part of it, what the second order gives."""
    return np.minimum(sigma, 0.5 * np.array(halos))


@lru_cache(maxsize=24)
def _core(sigma: float, distances: Hashable, shares: Hashable) -> tuple[Floats, Floats]:
    d, share = (np.frombuffer(content).reshape(shape) for content, shape in (distances, shares))
    return Instrument(Gaussian(2.0 * sigma)).gathered(d, share, FARTHER * float(d.max()))


@lru_cache(maxsize=8)
def _halos(halos: tuple[float, ...], radii: bytes, inner: bytes, outer: bytes) -> tuple[Floats, Floats]:
    """Weights (halos, n, m) of halos that no core blurs, and minus their Laplacians; even over the rings' areas."""
    rho = np.frombuffer(radii)
    steps = CubicSpline(np.arange(rho.size), rho)(np.arange(rho.size), 1)  # a sum is a trapezoidal integral
    d, share = over_rings(np.frombuffer(inner), np.frombuffer(outer))

    def weights(by: float) -> Floats:
        return np.stack([np.einsum("q,nqm->nm", share, halo(by * a, d[..., None], rho)) * steps for a in halos])

    less, own, more = weights(1.0 - NEAR), weights(1.0), weights(1.0 + NEAR)
    slope, bend = 0.5 * (more - less) / NEAR, (more + less - 2.0 * own) / NEAR**2  # times a, a^2
    return own, (bend - 2.0 * slope) / np.array(halos)[:, None, None] ** 2


def ring_means(sigma: float, halos: Sequence[float], rings: SpotRings) -> tuple[Floats, Floats]:
    """Each spread's own mean over rings (1 + halos, n) [1/area], and the core's derivative (n,) by ln sigma."""
    (inner, outer), (d, share) = (rings.inner, rings.outer), rings.gathered
    areas = np.pi * (outer - inner) * (outer + inner)
    square = (d / sigma) ** 2
    core = share * np.exp(-0.5 * square) / (2.0 * np.pi * sigma**2)
    # (1 + ka) e^{-ka} cos(k sigma), as much blurred to third order, is (1 - a d/da) of e^{-kz} at z = a + i sigma.
    a, z = np.array(halos)[:, None], (np.array(halos) + 1j * _blur(sigma, halos))[:, None]
    near, far = (z / np.sqrt(r**2 + z**2) - a * r**2 / (r**2 + z**2) ** 1.5 for r in (inner, outer))
    return np.concatenate([core.sum(axis=1)[None], (near - far).real / areas]), np.sum(core * (square - 2.0), axis=1)


def halo(a: float, d: Floats, rho: Floats) -> Floats:
    """Mean of h_a over a circle of radius rho about a point at the distance d."""
    whole, cross = d * d + rho * rho + a * a, 2.0 * d * rho
    m, less, more = 2.0 * cross / (whole + cross), whole - cross, whole + cross
    e, k = ellipe(m), ellipk(m)
    return np.asarray(2.0 * a**3 * (e / less + 0.5 * (2.0 * e - k) / more) / (np.pi**2 * less * np.sqrt(more)), float)


@dataclass(frozen=True)
class Beliefs:
    """Prior knowledge, as values with errors; lengths in the unit of the rings. None: nothing is known.

    beam     1/e^2 radius that beam and lens make together; surface and glare shares of light
    scale    of the counts, per light on the medium; halos widths of those that glare is a mixture of
    corner   share of light that a lens loses at `border`, growing as r^2
    """

    beam: Known | None = None
    surface: Known = field(default_factory=lambda: Known(0.01, 0.01))
    glare: Known = field(default_factory=lambda: Known(0.02, 0.02))
    scale: Known | None = None
    corner: Known = field(default_factory=lambda: Known(0.05, 0.05))
    border: float = 20.0
    halos: tuple[float, ...] = tuple(np.geomspace(NARROWEST, WIDEST, 11).tolist())

    def over(self, sides: tuple[int, int], pixel: float, reach: float) -> Beliefs:
        """Return beliefs for a picture of so many columns and rows, of `pixel` each, with rings out to `reach` [unit].

        Over the rings a wider halo falls like one as wide as they are, and one narrower than the core is like the core.
        """
        near = NARROWEST if self.beam is None else max(NARROWEST, 0.5 * self.beam.value)
        far = max(WIDEST, reach, 2.0 * near)
        count = 1 + round(float(np.log(far / near) / np.log(RATIO)))
        halos = tuple(np.geomspace(near, far, count).tolist())
        return replace(self, border=0.5 * pixel * float(np.hypot(*sides)), halos=halos)


@dataclass(frozen=True, eq=False)
class Card:
    """Rings of a card; reflectance is None where it is not known, or where the card was not exposed as the medium."""

    rings: SpotRings
    reflectance: Known | None = None


class SpotLight(NamedTuple):
    """Light of the medium's rings as beam and lens spread it, by spread (c of them), for a scale of 1.

    light  (c + 1, n) of the medium, last the core's derivative by ln sigma; by_medium (c, n, 2) by coordinates
    own    (c, n) light that the surface scatters; wider (n,) the core's derivative by ln sigma
    """

    light: Floats
    by_medium: Floats
    own: Floats
    wider: Floats

    def widened(self, by: float) -> SpotLight:
        """Return the light under a core wider by a change of ln sigma, to first order and not below 0."""
        light, own = self.light.copy(), self.own.copy()
        light[0], own[0] = np.maximum(light[0] + by * light[-1], 0.0), np.maximum(own[0] + by * self.wider, 0.0)
        return self._replace(light=light, own=own)


@dataclass(frozen=True, eq=False)
class Shot:
    """Rings that are fitted: of the medium, and of cards."""

    medium: SpotRings
    cards: tuple[Card, ...]
    light: ExactLight
    beliefs: Beliefs

    @property
    def names(self) -> tuple[str, ...]:
        halos = tuple(f"glare {a:g}" for a in self.beliefs.halos)
        own = ("alpha", "l", "scale", "core", "surface", *halos, "dark", "corner")
        return own + tuple(f"card {at + 1}" for at in range(len(self.cards)))

    @property
    def size(self) -> float:
        """Size of the counts: the largest number beside logarithms and shares."""
        return float(np.max(self.medium.value))

    def rows(self, x: Floats, spread: SpotLight | None = None) -> tuple[Floats, Floats]:
        """Light of all rings (n,), and its derivatives (n, p); `spread` is that of the medium's where it is known."""
        halos = len(self.beliefs.halos)
        sigma, surface, glare, dark = float(np.exp(x[3])), x[4], x[5 : 5 + halos], x[5 + halos]
        scale, share, corner = np.exp(x[2]), np.append(1.0 - glare.sum(), glare), x[6 + halos]
        light, by_medium, own, wider = spread or self._spread(x)
        seen = light[:-1] + surface * own
        value = scale * share @ seen + dark * self.size
        slopes = np.zeros((value.size, x.size))
        slopes[:, :2] = scale * np.einsum("c,cnp->np", share, by_medium)
        slopes[:, 2] = scale * share @ seen
        slopes[:, 3] = scale * share[0] * (light[-1] + surface * wider)
        slopes[:, 4] = scale * share @ own
        slopes[:, 5 : 5 + halos] = scale * (seen[1:] - seen[0]).T
        slopes[:, 5 + halos] = self.size
        of_medium = self._darkened(self.medium, value, slopes, corner)
        values, each = [of_medium[0]], [of_medium[1]]
        for at, card in enumerate(self.cards, start=7 + halos):
            rings, scale = card.rings, np.exp(x[at])
            alone, wider = ring_means(sigma, self.beliefs.halos, rings)
            bright, slopes = scale * share @ alone, np.zeros((rings.value.size, x.size))
            slopes[:, 3] = scale * share[0] * wider
            slopes[:, 5 : 5 + halos] = scale * (alone[1:] - alone[0]).T
            slopes[:, at] = bright
            bright, slopes = self._darkened(rings, bright, slopes, corner)
            values.append(bright)
            each.append(slopes)
        return np.concatenate(values), np.vstack(each)

    def _darkened(self, rings: SpotRings, value: Floats, slopes: Floats, corner: float) -> tuple[Floats, Floats]:
        """Return light and derivatives as a lens darkens them outwards."""
        outwards = (rings.r / self.beliefs.border) ** 2
        slopes = slopes * (1.0 - corner * outwards)[:, None]
        slopes[:, 6 + len(self.beliefs.halos)] = -value * outwards
        return value * (1.0 - corner * outwards), slopes

    @cached_property
    def radii(self) -> Floats:
        """Radii (m,) at which the medium's profile is needed, whatever the core."""
        return ring_weights(float(self.medium.outer[0]), self.beliefs.halos, self.medium)[0]

    def _spread(self, x: Floats) -> SpotLight:
        density, slopes = (one[:-1] for one in Model(self.light).density(np.array([x[0], x[1], 0.0]), self.radii))
        core = float(np.exp(x[3])), self.beliefs.halos, self.medium
        _, weights, widening = ring_weights(*core)
        light = np.concatenate([weights @ density, (widening @ density)[None]])
        return SpotLight(light, weights @ slopes[:, :2], *ring_means(*core))

    @property
    def middle(self) -> Floats:
        """Prior means (p,) of the coordinates; 0 of which nothing is known."""
        given, halos = self.beliefs, len(self.beliefs.halos)
        x = np.zeros(len(self.names))
        if given.scale is not None:
            x[2] = np.log(given.scale.value)
        if given.beam is not None:
            x[3] = np.log(0.5 * given.beam.value)
        x[4], x[6 + halos] = given.surface.value, given.corner.value
        x[5 : 5 + halos] = given.glare.value / halos
        return x

    @cached_property
    def knowledge(self) -> tuple[Floats, Floats]:
        """Rows (k, p) of sums of the coordinates, and what these are thought to be (k,), in standard errors."""
        given, halos, unit = self.beliefs, len(self.beliefs.halos), np.eye(len(self.names))
        rows = [unit[4] / given.surface.error, unit[5 + halos] / DARK, unit[6 + halos] / given.corner.error]
        if given.scale is not None:
            rows.append(unit[2] * given.scale.value / given.scale.error)
        if given.beam is not None:
            rows.append(unit[3] * given.beam.value / given.beam.error)
        glare = unit[5 : 5 + halos]
        apart = np.abs(np.subtract.outer(np.log(given.halos), np.log(given.halos)))
        root = HALO * given.glare.error * np.linalg.cholesky(np.exp(-apart / ALIKE))
        rows = [*rows, glare.sum(axis=0) / given.glare.error, *solve_triangular(root, glare, lower=True)]
        middle = self.middle
        values = [row @ middle for row in rows]
        for own, card in zip(unit[unit.shape[0] - len(self.cards) :], self.cards, strict=True):
            if (known := card.reflectance) is not None:
                rows.append((own - unit[2]) * known.value / known.error)
                values.append(np.log(known.value) * known.value / known.error)
        return np.stack(rows), np.array(values)

    @cached_property
    def whitening(self) -> Floats:
        """Matrix that turns errors of the rows into independent ones of size 1: the inverse of their lower root."""
        blocks = []
        for one in (self.medium, *(card.rings for card in self.cards)):
            size = UNEVEN * one.value
            smooth = waves(one.r, WAVE) * np.outer(size, size)
            blocks.append(one.covariance + smooth + np.diag((1e-4 * one.value) ** 2 + (1e-9 * self.size) ** 2))
        root = np.linalg.cholesky(block_diag(*blocks))
        return np.asarray(solve_triangular(root, np.eye(len(root)), lower=True), float)

    def residuals(self, x: Floats, spread: SpotLight | None = None) -> tuple[Floats, Floats]:
        """Return residuals in standard errors (m,), those of prior knowledge last, and their derivatives (m, p)."""
        value, slopes = self.rows(x, spread)
        data = np.concatenate([self.medium.value, *(card.rings.value for card in self.cards)])
        ways, thought = self.knowledge
        rows = self.whitening @ np.column_stack([value - data, slopes])
        return np.append(rows[:, 0], ways @ x - thought), np.vstack([rows[:, 1:], ways])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest coordinates (p,) of a descent."""
        halos = len(self.beliefs.halos)
        low, high = np.full((2, len(self.names)), np.inf) * [[-1.0], [1.0]]
        low[4 : 5 + halos] = 0.0
        low[:2] = -FARTHEST_U, self.lengths[0] - FARTHEST_LN
        high[:2] = FARTHEST_U, self.lengths[1] + FARTHEST_LN
        return low, high

    @property
    def lengths(self) -> tuple[float, float]:
        """Range of ln l where the search begins: from well within the core to beyond the last ring."""
        return float(np.log(SHORTEST) + self._first[3]), float(np.log(LONGEST * self.medium.outer[-1]))

    @cached_property
    def _first(self) -> Floats:
        """Coordinates (p,) of the search but for the medium and the scales; sigma from the beam or half the light."""
        x = self.middle
        if self.beliefs.beam is None:
            near = self.cards[0].rings if self.cards else self.medium
            half = near.r[int(np.argmax(near.value < 0.5 * near.value[0]))]
            x[3] = np.log(half / 1.18)
        first, sigma = self.medium.value.size, float(np.exp(x[3]))
        for at, card in enumerate(self.cards, start=x.size - len(self.cards)):
            x[at] = self._scale(x, first, card.rings, ring_means(sigma, self.beliefs.halos, card.rings)[0])
            first += card.rings.value.size
        return x

    def _scale(self, x: Floats, first: int, rings: SpotRings, light: Floats) -> float:
        """Return ln of the scale that fits rings best, those from row `first` on; light (c, n) is theirs by spread."""
        glare, rows = x[5 : 5 + len(self.beliefs.halos)], slice(first, first + rings.value.size)
        both = np.column_stack([np.append(1.0 - glare.sum(), glare) @ light, rings.value])
        seen, value = (self.whitening[rows, rows] @ both).T
        norm = max(float(seen @ seen), np.finfo(float).tiny)
        return float(np.log(max(seen @ value / norm, 1e-3 * np.linalg.norm(value) / np.sqrt(norm))))

    @cached_property
    def starts(self) -> list[Floats]:
        """The best points of a coarse search over albedos and lengths, no two neighbours, the best first."""
        u, ln_l = [u_of(one) for one in ALBEDOS], np.linspace(*self.lengths, LENGTHS)
        points = np.array([[a, b, 0.0] for a in u for b in ln_l])
        sigma, densities = float(np.exp(self._first[3])), Model(self.light).densities(points, self.radii)
        _, weights, widening = ring_weights(sigma, self.beliefs.halos, self.medium)
        light = np.concatenate([weights, widening[None]]) @ densities.T
        own = ring_means(sigma, self.beliefs.halos, self.medium)
        none = np.zeros((*weights.shape[:2], 2))
        each = [self._settled(point, SpotLight(light[..., at], none, *own)) for at, point in enumerate(points)]
        costs = np.array([cost for cost, _ in each]).reshape(len(u), len(ln_l))
        return [each[at][1] for at in best_apart(costs)]

    def _settled(self, point: Floats, spread: SpotLight) -> tuple[float, Floats]:
        """Chi-square and coordinates (p,) at an albedo and a length, after COARSE steps in all others."""
        x, (low, high) = self._first.copy(), self.bounds
        x[:2] = point[:2]
        if self.beliefs.scale is None:
            x[2] = self._scale(x, 0, self.medium, spread.light[:-1] + x[4] * spread.own)
        ends = []
        for _ in range(COARSE + 1):
            rows, slopes = self.residuals(x, spread.widened(x[3] - self._first[3]))
            ends.append((float(rows @ rows), x))
            step = np.zeros(x.size)
            step[2:] = np.linalg.lstsq(slopes[:, 2:], -rows)[0]
            x = np.clip(x + np.clip(step, -FARTHEST, FARTHEST), low, high)
        return min(ends, key=lambda one: one[0])


@dataclass(frozen=True, eq=False)
class PhotoFit:
    """End of a fit: coordinates (p,), covariance (p, p); rivals have a chi-square higher by RIVAL at most."""

    shot: Shot
    x: Floats
    covariance: Floats
    chi2: float
    freedom: int
    result: str
    rivals: tuple[PhotoFit, ...] = ()

    @property
    def converged(self) -> bool:
        return self.result == CONVERGED

    @property
    def chance(self) -> float:
        """p-value of chi-square."""
        return float(stats.chi2.sf(self.chi2, self.freedom))

    @property
    def widening(self) -> float:
        """Factor on the errors, by how much residuals exceed theirs where that is no chance (Birge)."""
        return float(np.sqrt(self.chi2 / self.freedom)) if self.chance < DETECTED else 1.0

    @cached_property
    def total(self) -> tuple[float, Floats]:
        """Total reflectance A of the medium, and its derivatives (3,)."""
        density, slopes = Model(self.shot.light).density(np.array([*self.x[:2], 0.0]), self.shot.radii)
        return float(density[-1]), slopes[-1]

    @cached_property
    def values(self) -> dict[str, float]:
        """A, alpha, l, mu_s', mu_a, scale."""
        each = model.quantities(self.x[None, :3], np.array([self.total[0]]))
        return {name: float(value[0]) for name, value in each.items()}

    @cached_property
    def errors(self) -> dict[str, float]:
        """Standard errors of the values."""
        return model.errors(model.slopes(self.x[:3], self.total[1]), self.widening**2 * self.covariance[:3, :3])

    def interval(self, name: str) -> tuple[float, float]:
        """Interval of 95 % of a value: symmetric in its logarithm; no albedo is above 1."""
        value = self.values[name]
        half = min(WITHIN * self.errors[name] / value, LARGEST)
        low, high = value * np.exp(-half), value * np.exp(half)
        return low, min(high, 1.0) if name in ("A", "alpha") else high

    def holds(self, values: Mapping[str, float]) -> bool:
        """Return whether the intervals of mu_s' and mu_a hold these values."""
        return all(low <= values[name] <= high for name in MEDIUM for low, high in [self.interval(name)])


def fitted(shot: Shot) -> PhotoFit:
    """Fit a shot by least squares: the lowest minimum that a search finds, and its rivals."""
    end = lowest((_descended(shot, start) for start in shot.starts), compared=len(model.NAMES))
    first, *others = (_ended(shot, one) for one in (end, *end.others))
    within = RIVAL * first.widening**2
    rivals = tuple(one for one in others if one.chi2 - first.chi2 < within and not first.holds(one.values))
    return replace(first, rivals=rivals, result=RIVALLED if rivals and first.converged else first.result)


def _descended(shot: Shot, start: Floats) -> Solution:
    """End of damped least squares within bounds, from a start."""
    longest = np.full(start.size, np.inf)
    longest[:4], longest[start.size - len(shot.cards) :] = FARTHEST, FARTHEST
    for _ in range(1 + AGAIN):
        done = solve(shot.residuals, start, shot.bounds, rescaled=True, gain=ENOUGH, longest=longest, most=MAX_STEPS)
        if done.converged:
            break
        start = done.parameters
    return done


def _ended(shot: Shot, done: Solution) -> PhotoFit:
    """Return a descent's end as a fit, whose verdict says where there is no medium."""
    (u, ln_l), (low, high) = done.parameters[:2], (one[1] for one in shot.bounds)
    ran = not low + ROOM < ln_l < high - ROOM
    ended = CONVERGED if done.converged else UNENDED
    result = AT_BLACK if u > BLACK else AT_WHITE if u < WHITE else RAN_AWAY if ran else ended
    freedom = done.residuals.size - done.parameters.size
    return PhotoFit(shot, done.parameters, done.covariance, done.cost, freedom, result)


def fisher(truth: Shot, x: Floats) -> Mapping[str, float]:
    """Return relative errors of mu_s' and mu_a that no unbiased estimate from such rings undercuts."""
    one = PhotoFit(truth, x, covariance(truth.residuals(x)[1]), 0.0, 1, CONVERGED)
    return {name: one.errors[name] / one.values[name] for name in MEDIUM}
