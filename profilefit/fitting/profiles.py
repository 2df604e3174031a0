"""Profiles: reflectance profiles of several albedos, averaged over rings (annuli), with errors: the data of every fit.

The radius at which the paper trims a profile before fitting is found by the search (6), called walk here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import exact
from mcml_sim.errors import InputError
from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.grid import Grid
from mcml_sim.media.setting import Setting
from mcml_sim.results.orders import Orders

# Albedos of one ring are reweightings of the same photons and nearly dependent: few directions carry their variance,
# and each record states the largest share of any one variance that is left out.
COVARIANCE_RANK = 8
# A reweighted ring that rests on fewer photons than this has a standard error that is itself unknown by a tenth,
# and that collapses where the heavy photons are missing altogether.
FEWEST_EFFECTIVE_SAMPLES = 50.0


@dataclass(frozen=True)
class Covariance:
    """Covariance of ring energies between rings and albedos, in the closed form of a multinomial tally.

    factor   (rings + 1, alphas, rank): within ring i, cov(E_i(a), E_i(b)) = (L_i L_i^T)_ab; the light beyond last
    energy   (alphas, rings + 1) energies E that were counted: between rings cov(E_i(a), E_j(b)) =
             -E_i(a) E_j(b) / (photons - 1)
    dropped  the largest share of any one variance that the truncation to `rank` leaves out
    """

    factor: Floats
    energy: Floats
    photons: int
    dropped: float

    @property
    def rank(self) -> int:
        return self.factor.shape[-1]

    def sandwich(self, weights: Floats) -> Floats:
        """Return the covariance (p, p) of the sums over alphas and rings of `weights` (p, alphas, n) times ring energy.

        Rings at the end that only one of the two knows count for nothing.
        """
        rings = min(weights.shape[-1], len(self.factor))
        within = np.einsum("pai,iak->pik", weights[..., :rings], self.factor[:rings])
        ring = np.einsum("pai,ai->pi", weights[..., :rings], self.energy[:, :rings])
        total = ring.sum(axis=1)
        between = np.outer(total, total) - ring @ ring.T
        return np.einsum("pik,qik->pq", within, within) - between / max(self.photons - 1, 1)


@dataclass(frozen=True)
class Profiles:
    """Reflectance profiles in units of the transport mean free path (l* = 1).

    alpha, r_edges     (m,) reduced albedos [-], (n + 1,) ring edges from 0 [mfp]
    energy             (m, n) energy reflected through each ring, per unit incident [-]: the integral of 2 pi r R_d
    standard_error     (m, n) of `energy`; zero where the truth has no noise
    effective_samples  (m, n) photons that the estimate really rests on; infinite where it has no noise
    beyond             (m,) energy reflected beyond the last edge [-]
    covariance         between all rings and albedos; None where the truth has no noise, or where it was not requested
    source             what made them: "orders" (photons), "exact"
    settings           of each profile (m,), where several are joined; none where all are of `setting`
    """

    alpha: Floats
    r_edges: Floats
    energy: Floats
    standard_error: Floats
    effective_samples: Floats
    beyond: Floats
    source: str
    setting: Setting
    photons: int | None = None
    covariance: Covariance | None = None
    settings: tuple[Setting, ...] = ()

    @classmethod
    def joined(cls, parts: Sequence[Profiles], setting: Setting) -> Profiles:
        """Return profiles without noise of several indices and g, each of the same albedos and rings.

        `setting` is the one to which the record of a fit will belong.
        """
        first, same = parts[0], np.array_equal
        if not all(same(first.alpha, one.alpha) and same(first.r_edges, one.r_edges) for one in parts):
            raise InputError("profiles of several settings must have the same albedos and rings, got others")
        rows: dict[str, Any] = {
            name: np.concatenate([getattr(one, name) for one in parts])
            for name in ("alpha", "energy", "standard_error", "effective_samples", "beyond")
        }
        settings = tuple(one.setting for one in parts for _ in first.alpha)
        return cls(**rows, r_edges=first.r_edges, source=first.source, setting=setting, settings=settings)

    @classmethod
    def from_orders(cls, orders: Orders, alpha: ArrayLike, correlated: bool = True) -> Profiles:
        """Reweight one order-resolved run to every albedo in `alpha`; with `correlated`, their covariance too.

        InputError of a run with g, whose rings are of no one l*.
        """
        if orders.setting.g != 0:
            raise InputError(f"orders must be of light that scatters isotropically, got g = {orders.setting.g:g}")
        albedos = _albedos(alpha)
        energy = orders.energy(albedos)
        value = np.asarray(energy.value)
        beyond = np.asarray(orders.overflow(albedos).value)
        covariance = None
        if correlated:
            rank = min(COVARIANCE_RANK, albedos.size)
            factor, dropped = orders.covariance_factor(albedos, rank, overflow=True)
            counted = np.column_stack([value, beyond]) - orders.once(albedos)
            covariance = Covariance(factor, counted, orders.photons, dropped)
        noise = np.asarray(energy.standard_error), np.asarray(energy.effective_samples)
        rings, setting = orders.grid.r_edges, orders.setting
        return cls(albedos, rings, value, *noise, beyond, "orders", setting, orders.photons, covariance)

    @classmethod
    def from_exact(cls, alpha: ArrayLike, r_edges: ArrayLike, setting: Setting | None = None) -> Profiles:
        """Integrate the exact half space over rings, without noise."""
        where = setting or Setting()
        albedos, edges = _albedos(alpha), Grid.from_edges(r=r_edges).r_edges
        total = np.asarray(exact.reflectance(albedos, setting=where))
        inside = total[:, None] * np.asarray(exact.cdf(edges, albedos[:, None], setting=where))
        energy = np.diff(inside, axis=1)
        zero, infinite = np.zeros_like(energy), np.full_like(energy, np.inf)
        return cls(albedos, edges, energy, zero, infinite, total - inside[:, -1], "exact", where)

    @property
    def r_areas(self) -> Floats:
        """Ring areas [mfp^2], (n,)."""
        return np.pi * np.diff(self.r_edges**2)

    @property
    def r(self) -> Floats:
        """Ring centres [mfp], (n,)."""
        return 0.5 * (self.r_edges[1:] + self.r_edges[:-1])

    @property
    def value(self) -> Floats:
        """Ring averages of R_d [1/mfp^2], (m, n)."""
        return self.energy / self.r_areas

    @property
    def reflectance(self) -> Floats:
        """Total reflectance A [-], (m,)."""
        return self.energy.sum(axis=1) + self.beyond

    @property
    def cdf(self) -> Floats:
        """Share of the reflected energy within each edge, (m, n + 1)."""
        inside = np.concatenate([np.zeros((self.alpha.size, 1)), np.cumsum(self.energy, axis=1)], axis=1)
        return inside / self.reflectance[:, None]

    @property
    def albedo_samples(self) -> Floats:
        """(m,) equally weighted photons that would give the reflectance within the rings this relative error."""
        total, variance = self.energy.sum(axis=1), np.sum(self.standard_error**2, axis=1)
        return np.divide(total**2, variance, out=np.full_like(total, np.inf), where=variance > 0)

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """(m, n) rings with enough effective samples for their standard error to mean something."""
        return self.effective_samples >= FEWEST_EFFECTIVE_SAMPLES


def _albedos(alpha: ArrayLike) -> Floats:
    values = np.atleast_1d(np.asarray(alpha, float))
    require(values.ndim == 1 and np.all((values > 0) & (values <= 1)), "alpha", "a list of albedos in (0, 1]", alpha)
    return values


# (end of stretch, stride) of the walk outward from r = 0, in the paper's length unit; 1 beyond the last.
STRIDES = ((0.5, 0.05), (1.0, 0.1), (2.0, 0.2), (5.0, 0.5))


def walk(last: float) -> Floats:
    """Return the radii that the search visits, from 0 to the first beyond `last`."""
    radii = [0.0]
    begin = 0.0
    for end, stride in STRIDES:
        radii += [begin + stride * (i + 1) for i in range(round((end - begin) / stride))]
        begin = end
    radii += list(np.arange(begin + 1.0, last + 1.0))
    return np.array(radii)


def trimmed_radius(r: Floats, quantity: Floats, epsilon: float = 0.005) -> float:
    """Return r'_max of (6): the first r of the walk where `quantity` (n,) at centres `r` is <= epsilon its largest.

    The paper compares with the value at 0, which r R_d has not. Where the walk never gets that low it is the last r.
    """
    steps = walk(float(r[-1]))
    steps = steps[steps <= r[-1]]
    low = np.interp(steps, r, quantity) <= epsilon * np.max(quantity)
    return float(steps[np.argmax(low)]) if low.any() else float(r[-1])
