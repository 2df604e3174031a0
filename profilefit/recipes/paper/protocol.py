"""The paper's fit of (7) at one albedo, each choice that it leaves unsaid as a field, and the truths it is made to.

Source: Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile (Journal of
Software); equation numbers are that paper's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import exact
from mcml_sim.media.setting import Setting
from mcml_sim.results.orders import Orders
from profilefit.fitting.profiles import Profiles, trimmed_radius, walk
from profilefit.fitting.solver import solve_batch

Floats = NDArray[np.float64]
EPSILON = 0.005  # of the trimming (6)
SEARCHLIGHT = Setting()
# MCML's usual hundredth of a mean free path; beyond 25 mfp (6) never walks for alpha <= .9986 [mfp].
RING_WIDTH, LAST_RADIUS = 0.01, 30.0


@dataclass(frozen=True)
class Protocol7:
    """Choices that (6)-(7) leave open: width of rings, place of their centre, what is trimmed where, what R' carries.

    rings    of the truth merged into one [-]
    centre   "middle", or "corrected": MCML's (i + 1/2 + 1 / (12 (i + 1/2))) dr
    trimmed  "r R_d", R'_d itself, or "R_d"
    stop     "walk" of (6); "stride before" the one where the walk ends; "ring", the first one low enough
    fitted   "r R_d", "2 pi r R_d" or "R_d"
    """

    rings: int = 1
    centre: str = "middle"
    trimmed: str = "r R_d"
    stop: str = "walk"
    fitted: str = "r R_d"

    def describe(self, ring_width: float) -> str:
        return (
            f"{self.fitted} on rings of {self.rings * ring_width:g} l, centre {self.centre}; (6) on {self.trimmed}, "
            f"stop at the {self.stop}"
        )


@dataclass(frozen=True)
class Coefficients:
    """a, b, c of (7) at each albedo: alpha (m,), values (m, 3) in units of l, cut (m,) r'_max [mfp]."""

    alpha: Floats
    values: Floats
    cut: Floats

    def at(self, alpha: Floats) -> Coefficients:
        where = np.searchsorted(self.alpha, alpha)
        return Coefficients(self.alpha[where], self.values[where], self.cut[where])


def profiles_at(profiles: Profiles, alpha: Floats) -> Profiles:
    """Return the same rings for some of the albedos only; `alpha` must be among them."""
    rows = np.searchsorted(profiles.alpha, alpha)
    return Profiles(
        profiles.alpha[rows],
        profiles.r_edges,
        profiles.energy[rows],
        profiles.standard_error[rows],
        profiles.effective_samples[rows],
        profiles.beyond[rows],
        profiles.source,
        profiles.setting,
    )


def fit_coefficients(profiles: Profiles, protocol: Protocol7, mfp: float = 1.0) -> Coefficients:
    """(7) at each albedo by unweighted least squares over the rings that (6) keeps; `mfp` in units of (6)'s strides."""
    rings, whole = protocol.rings, profiles.energy.shape[1] // protocol.rings  # what is left over at the end is dropped
    energy = profiles.energy[:, : whole * rings].reshape(profiles.alpha.size, whole, rings).sum(axis=2)
    edges, index = profiles.r_edges[: whole * rings + 1 : rings], np.arange(whole) + 0.5
    r = (index + (1 / (12 * index) if protocol.centre == "corrected" else 0.0)) * edges[1]
    value = energy / (np.pi * np.diff(edges**2))
    quantities = {"R_d": value, "r R_d": r * value, "2 pi r R_d": 2 * np.pi * r * value}
    data = quantities[protocol.fitted]
    cut = np.array([cut_radius(r * mfp, row, protocol.stop) / mfp for row in quantities[protocol.trimmed]])
    used = (r <= cut[:, None]).astype(float)
    scale = data[:, :1]
    starts = np.stack([_linear_start(r, row, keep > 0) for row, keep in zip(data / scale, used, strict=True)])
    solutions = solve_batch(_rational_misfit, starts, (np.broadcast_to(r, data.shape), data / scale, used))
    return Coefficients(profiles.alpha, np.stack([s.parameters for s in solutions]) * scale ** [1, 1, 0], cut)


def cut_radius(r: Floats, quantity: Floats, stop: str) -> float:
    """r'_max in the unit of r."""
    if stop == "ring":
        low = quantity <= EPSILON * np.max(quantity)
        return float(r[np.argmax(low)]) if low.any() else float(r[-1])
    end = trimmed_radius(r, quantity, EPSILON)
    visited = walk(float(r[-1]))
    return float(visited[visited < end - 1e-9][-1]) if stop == "stride before" else end


def _linear_start(r: Floats, y: Floats, used: NDArray[np.bool_]) -> Floats:
    """Return a, b, c from y (r + c) = a r + b, which is linear in all three.

    A plain guess is returned where that gives no pole left of zero.
    """
    columns = np.stack([r, np.ones_like(r), -y], axis=1)[used]
    found = np.linalg.lstsq(columns, (y * r)[used], rcond=None)[0]
    return np.asarray(found if found[2] > 0 else [-0.05, 0.5, 0.5], np.float64)


def _rational_misfit(p, item):
    r, data, used = item
    return used * ((p[0] * r + p[1]) / (r + p[2]) - data)


class Truth(Protocol):
    """Source of reflectances and fine even rings."""

    def reflectance(self, alpha: Floats) -> Floats:
        """Return the total diffuse reflectance A (m,) [-] at albedos alpha (m,)."""

    def profiles(self, alpha: Floats) -> Profiles:
        """On even rings from 0."""


@dataclass(frozen=True)
class ExactTruth:
    """The half space without noise, on rings of `ring_width` up to `last_radius` [mfp]."""

    ring_width: float = RING_WIDTH
    last_radius: float = LAST_RADIUS
    setting: Setting = SEARCHLIGHT

    def reflectance(self, alpha: Floats) -> Floats:
        return np.asarray(exact.reflectance(alpha, setting=self.setting))

    def profiles(self, alpha: Floats) -> Profiles:
        """Ring energies by Simpson's rule on a spline of ln(2 pi r R_d): within 1e-5 of the exact integrals."""
        half = np.arange(2 * round(self.last_radius / self.ring_width) + 1) * self.ring_width / 2
        nodes = np.geomspace(half[1] / 2, half[-1], 120)
        values = 2 * np.pi * nodes * np.asarray(exact.profile(nodes, alpha[:, None], setting=self.setting))
        density = np.exp(CubicSpline(np.log(nodes), np.log(values), axis=1)(np.log(np.maximum(half, nodes[0]))))
        energy = self.ring_width / 6 * (density[:, :-2:2] + 4 * density[:, 1::2] + density[:, 2::2])
        inside = np.asarray(exact.cdf(half[2], alpha, setting=self.setting))  # r ln r at the source defeats Simpson
        energy[:, 0] = self.reflectance(alpha) * inside
        beyond = self.reflectance(alpha) - energy.sum(axis=1)
        none = np.zeros_like(energy)
        return Profiles(alpha, half[::2], energy, none, none + np.inf, beyond, "exact", self.setting)


@dataclass(frozen=True)
class TallyTruth:
    """Reflectances and rings of photons: an order-resolved run on fine even rings up to 25 mfp or more."""

    orders: Orders

    def reflectance(self, alpha: Floats) -> Floats:
        return np.asarray(self.orders.reflectance(alpha).value)

    def profiles(self, alpha: Floats) -> Profiles:
        # Without the covariance between albedos, which no reading uses and sixty albedos would wait minutes for.
        energy = self.orders.energy(alpha)
        return Profiles(
            alpha,
            self.orders.grid.r_edges,
            np.asarray(energy.value),
            np.asarray(energy.standard_error),
            np.asarray(energy.effective_samples),
            np.asarray(self.orders.overflow(alpha).value),
            "orders",
            self.orders.setting,
            self.orders.photons,
        )
