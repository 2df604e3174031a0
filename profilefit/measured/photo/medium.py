"""The medium behind a spot: exact light under beam, lens and surface, fitted to rings, and to those of cards.

Coordinates: those of `model` (alpha, l*, scale), ln of the core's sigma, the surface's share, the share of each halo,
the dark level, what a lens darkens; and ln of each card's scale. What is known of them beforehand is normal. A card
that light does not enter shows beam and lens alone; of a known reflectance, and exposed alike, it gives the scale.

Errors are those of the normal approximation at the best fit; the same of a truth is the Fisher bound of a setup.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import block_diag, solve_triangular

from mcml_sim.exact.light import ExactLight
from profilefit.fitting.solver import covariance, solve
from profilefit.measured import law_error, model
from profilefit.measured.misfit import DETECTED
from profilefit.measured.model import Model, u_of
from profilefit.measured.photo.glare import ring_means, ring_weights
from profilefit.measured.photo.rings import SpotRings
from profilefit.measured.problem import Known

Floats = NDArray[np.float64]
HALO, ALIKE = 0.5, np.log(2.0)  # error of a halo's share over that of all glare; ln a within which shares are alike
DARK = 1e-5  # error of the dark level
UNEVEN = 0.01  # relative error in waves along ln r that neither sectors nor brackets show
STEP = 1e-4  # of ln sigma, for derivatives
ALBEDOS = (0.5, 0.8, 0.95, 0.99)
LENGTHS = (0.02, 0.05, 0.12, 0.3)  # of the last ring's radius
MAX_STEPS = 80
FARTHEST = 1.0  # step of what light is not straight in
ENOUGH = 1e-3  # of chi-square, that another step must gain


@dataclass(frozen=True)
class Beliefs:
    """What is known beforehand, as values with errors; lengths in the unit of the rings. None: nothing.

    beam     1/e^2 radius that beam and lens make together; surface and glare shares of light
    scale    of the counts, per light that falls on the medium
    corner   share of light that a lens loses at `border`, growing as r^2
    halos    widths of the halos that glare is a mixture of
    """

    beam: Known | None = None
    surface: Known = field(default_factory=lambda: Known(0.01, 0.01))
    glare: Known = field(default_factory=lambda: Known(0.02, 0.02))
    scale: Known | None = None
    corner: Known = field(default_factory=lambda: Known(0.05, 0.05))
    border: float = 20.0
    halos: tuple[float, ...] = tuple(np.geomspace(1.0, 32.0, 11).tolist())


@dataclass(frozen=True, eq=False)
class Card:
    """Rings of a card; reflectance is None where it is not known, or where the card was not exposed as the medium."""

    rings: SpotRings
    reflectance: Known | None = None


@dataclass(frozen=True, eq=False)
class Shot:
    """What is fitted: rings of the medium, and of cards."""

    medium: SpotRings
    cards: tuple[Card, ...]
    light: ExactLight
    beliefs: Beliefs

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        halos = tuple(f"glare {a:g}" for a in self.beliefs.halos)
        own = ("alpha", "l", "scale", "core", "surface", *halos, "dark", "corner")
        return own + tuple(f"card {at + 1}" for at in range(len(self.cards)))

    @property
    def size(self) -> float:
        """Of the counts: what ln's and shares leave as the largest number."""
        return float(np.max(self.medium.value))

    def rows(self, x: Floats) -> tuple[Floats, Floats]:
        """Light of all rings (n,), and its derivatives (n, p)."""
        halos = len(self.beliefs.halos)
        sigma, surface, glare, dark = float(np.exp(x[3])), x[4], x[5 : 5 + halos], x[5 + halos]
        scale, share, corner = np.exp(x[2]), np.append(1.0 - glare.sum(), glare), x[6 + halos]
        light, by_medium, own, wider = self._spread(x, sigma)
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
            alone, wider = self._alone(rings, sigma)
            bright, slopes = scale * share @ alone, np.zeros((rings.value.size, x.size))
            slopes[:, 3] = scale * share[0] * wider
            slopes[:, 5 : 5 + halos] = scale * (alone[1:] - alone[0]).T
            slopes[:, at] = bright
            bright, slopes = self._darkened(rings, bright, slopes, corner)
            values.append(bright)
            each.append(slopes)
        return np.concatenate(values), np.vstack(each)

    def _darkened(self, rings: SpotRings, value: Floats, slopes: Floats, corner: float) -> tuple[Floats, Floats]:
        """As a lens darkens it outwards."""
        outwards = (rings.r / self.beliefs.border) ** 2
        slopes = slopes * (1.0 - corner * outwards)[:, None]
        slopes[:, 6 + len(self.beliefs.halos)] = -value * outwards
        return value * (1.0 - corner * outwards), slopes

    def _spread(self, x: Floats, sigma: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Of the medium: light (c + 1, n) by spread and, last, the core's derivative by ln sigma; slopes (c, n, 2).

        Of what the surface scatters: means (c, n) by spread, and the core's derivative (n,).
        """
        rings, shape = self.medium, (len(self.beliefs.halos) + 2, self.medium.value.size)
        rho, weights, widening = ring_weights(sigma, self.beliefs.halos, rings.inner, rings.outer)
        rows = np.concatenate([weights, widening[None]]).reshape(-1, rho.size)
        light, slopes = Model(self.light).weighed(np.array([x[0], x[1], 0.0]), rho, rows)
        return light.reshape(shape), slopes[:, :2].reshape(*shape, 2)[:-1], *self._alone(rings, sigma)

    def _alone(self, rings: SpotRings, sigma: float) -> tuple[Floats, Floats]:
        """Means (c, n) of each spread over rings, and the core's derivative (n,) by ln sigma."""
        means, wider = (ring_means(one, self.beliefs.halos, rings.inner, rings.outer)
                        for one in (sigma, sigma * np.exp(STEP)))  # fmt: skip
        return means, (wider[0] - means[0]) / STEP

    @property
    def middle(self) -> Floats:
        """What the coordinates (p,) are thought to be beforehand; 0 of which nothing is."""
        given, halos = self.beliefs, len(self.beliefs.halos)
        found = np.zeros(len(self.names))
        if given.scale is not None:
            found[2] = np.log(given.scale.value)
        if given.beam is not None:
            found[3] = np.log(0.5 * given.beam.value)
        found[4], found[6 + halos] = given.surface.value, given.corner.value
        found[5 : 5 + halos] = given.glare.value / halos
        return found

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
        """Lower root of the rows' covariance."""
        blocks = [self._covariance(one) for one in (self.medium, *(card.rings for card in self.cards))]
        found: Floats = np.linalg.cholesky(block_diag(*blocks))
        return found

    def _covariance(self, one: SpotRings) -> Floats:
        size = UNEVEN * one.value
        smooth = law_error.waves(one.r) * np.outer(size, size)
        return one.covariance + smooth + np.diag((1e-4 * one.value) ** 2 + (1e-9 * self.size) ** 2)

    def residuals(self, x: Floats) -> tuple[Floats, Floats]:
        """In standard errors (m,), those of what is known beforehand last, and their derivatives (m, p)."""
        value, slopes = self.rows(x)
        data = np.concatenate([self.medium.value, *(card.rings.value for card in self.cards)])
        ways, thought = self.knowledge
        rows = solve_triangular(self.whitening, np.column_stack([value - data, slopes]), lower=True)
        return np.append(rows[:, 0], ways @ x - thought), np.vstack([rows[:, 1:], ways])

    def starts(self) -> list[Floats]:
        """The best of a coarse search in length, for each of some albedos, the best first."""
        halos = len(self.beliefs.halos)
        x = self.middle
        if self.beliefs.beam is None:
            near = self.cards[0].rings if self.cards else self.medium
            half = near.r[int(np.argmax(near.value < 0.5 * near.value[0]))]
            x[3] = np.log(half / 1.18)
        for at, card in enumerate(self.cards, start=x.size - len(self.cards)):
            first = ring_means(float(np.exp(x[3])), (), card.rings.inner[:1], card.rings.outer[:1])
            x[at] = np.log(card.rings.value[0] / first[0, 0])
        best = []
        last = float(self.medium.outer[-1])
        for alpha in ALBEDOS:
            found = []
            for share in LENGTHS:
                x[:2] = u_of(alpha), np.log(share * last)
                if self.beliefs.scale is None:
                    x[2] = 0.0
                    light = self.rows(x)[0][: self.medium.value.size] - x[5 + halos] * self.size
                    x[2] = float(np.median(np.log(np.maximum(self.medium.value, 1e-12 * self.size) / light)))
                found.append((float(np.sum(self.residuals(x)[0] ** 2)), x.copy()))
            best.append(min(found, key=lambda one: one[0]))
        return [x for _, x in sorted(best, key=lambda one: one[0])]


@dataclass(frozen=True, eq=False)
class PhotoFit:
    """Where it ended: coordinates (p,) and their covariance (p, p); chi-square, and its degrees of freedom."""

    shot: Shot
    x: Floats
    covariance: Floats
    chi2: float
    freedom: int
    converged: bool

    @property
    def chance(self) -> float:
        """p-value of chi-square."""
        return float(stats.chi2.sf(self.chi2, self.freedom))

    @property
    def widening(self) -> float:
        """Factor on the errors, by how much residuals exceed theirs where that is no chance (Birge)."""
        return float(np.sqrt(self.chi2 / self.freedom)) if self.chance < DETECTED else 1.0

    @cached_property
    def values(self) -> dict[str, float]:
        """alpha, l, mu_s', mu_a, scale."""
        found = model.quantities(self.x[None, :3], np.full(1, np.nan))
        return {name: float(value[0]) for name, value in found.items() if name != "A"}

    @cached_property
    def errors(self) -> dict[str, float]:
        """Standard errors of the values."""
        gradients = model.slopes(self.x[:3], np.zeros(3))
        found = model.errors(gradients, self.widening**2 * self.covariance[:3, :3])
        return {name: found[name] for name in self.values}


def fitted(shot: Shot) -> PhotoFit:
    """The least squares fit of a shot: the best of those from every start."""
    ends = [_descended(shot, start) for start in shot.starts()]
    return min(ends, key=lambda one: (not one.converged, one.chi2))


def _descended(shot: Shot, start: Floats) -> PhotoFit:
    """End of damped least squares within bounds, from a start."""
    halos = len(shot.beliefs.halos)
    low, high, longest = np.full((3, start.size), np.inf) * [[-1.0], [1.0], [1.0]]
    low[0], low[4 : 5 + halos], high[0] = -12.0, 0.0, 12.0
    longest[:4], longest[7 + halos :] = FARTHEST, FARTHEST
    start = np.clip(start, low, high)
    done = solve(shot.residuals, start, (low, high), rescaled=True, gain=ENOUGH, longest=longest, most=MAX_STEPS)
    freedom = done.residuals.size - start.size
    return PhotoFit(shot, done.parameters, done.covariance, done.cost, freedom, done.converged)


def fisher(truth: Shot, x: Floats) -> Mapping[str, float]:
    """Relative errors of mu_s' and mu_a that no unbiased estimate from such rings undercuts."""
    one = PhotoFit(truth, x, covariance(truth.residuals(x)[1]), 0.0, 1, True)
    return {name: one.errors[name] / one.values[name] for name in ("mu_s'", "mu_a")}
