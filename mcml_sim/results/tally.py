"""Shares of the light in a layered medium, quantity by quantity, with errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.exact.single_scattering import entered
from mcml_sim.media import fresnel
from mcml_sim.media.arrays import Floats
from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import Medium
from mcml_sim.media.setting import Setting
from mcml_sim.results.estimate import Estimate
from mcml_sim.tracing.deposits import Deposits

SCALARS = (
    "specular_reflectance",
    "diffuse_reflectance",
    "absorbed",
    "transmittance",
    "diffuse_transmittance",
    "ballistic_transmittance",
    "energy",
)
BY_LAYER = ("absorbed_per_layer",)
BY_RADIUS = ("reflectance_r", "transmittance_r", "reflectance_r_overflow", "transmittance_r_overflow")
BY_DEPTH = ("absorbed_z", "absorbed_rz", "absorbed_z_overflow")
BY_ANGLE = ("reflectance_a", "reflectance_ra", "transmittance_a", "transmittance_ra")


def quantities(grid: Grid) -> tuple[str, ...]:
    """Return the names of all estimates that a grid resolves."""
    z = BY_DEPTH if grid.depths else ()
    a = BY_ANGLE if grid.angles else ()
    return (*SCALARS, *BY_LAYER, *BY_RADIUS, *z, *a)


def shapes(grid: Grid, layers: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every estimate that a grid resolves, in a medium of so many layers."""
    bins = {"r": grid.rings, "z": grid.depths, "a": grid.angles}
    ends = {name: name.rpartition("_")[2] for name in quantities(grid)}
    axes = {name: tuple(bins[axis] for axis in end) for name, end in ends.items() if set(end) <= set(bins)}
    return {name: axes.get(name, (layers,) if name in BY_LAYER else ()) for name in ends}


@dataclass(frozen=True)
class Precision:
    """Precision at which a run stops: a quantity's standard error, in every bin, is this share of its value.

    relative_error  of the standard error to the value [-], in (0, 1)
    quantity        a name of `Tally.quantities`
    """

    relative_error: float
    quantity: str = "diffuse_reflectance"

    def __post_init__(self) -> None:
        share = self.relative_error
        if isinstance(share, bool) or not (isinstance(share, (int, float, np.number)) and 0 < share < 1):
            raise InputError(f"precision must be a relative standard error in (0, 1), got {share!r}")

    def is_reached(self, estimate: Estimate) -> bool:
        """Return True if the error is small enough in every bin; a bin without light is not known at all."""
        value, error = np.asarray(estimate.value), np.asarray(estimate.standard_error)
        return bool(np.all((value > 0) & (error <= self.relative_error * value)))


@dataclass(frozen=True, eq=False)
class Tally:
    """Shares of the light that came in, by where it went; lengths in the unit of the medium.

    Every quantity is an Estimate: value, standard error, effective samples. Bins hold means over themselves, never
    values at their middles. Those of radius leave out what fell beyond the last ring (`..._overflow`); what was
    transmitted without scattering is a ray, not a profile, and kept apart. InputError where the grid does not
    resolve what is requested.
    """

    medium: Medium
    grid: Grid
    photons: int
    seed: int
    deposits: Deposits
    """Sums that all estimates come from, for photons of weight 1 that have entered."""
    illumination: str = "searchlight"
    """Illumination, "searchlight" or "diffuse", as in `Setting`."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all estimates that this grid resolves."""
        return quantities(self.grid)

    def quantity(self, name: str) -> Estimate:
        """Return the estimate of that name."""
        require_quantity(name, self.grid)
        return cast(Estimate, getattr(self, name))

    @property
    def specular_reflectance(self) -> Estimate:
        """Light that the surface sends back before any of it enters [-]: Fresnel's formula, without error."""
        return Estimate(1 - self._entering, 0.0, math.inf)

    @property
    def diffuse_reflectance(self) -> Estimate:
        """Light that entered and left through the top, beyond the last ring included [-].

        As in MCML also what was never scattered but thrown back by an interface below; it leaves at r = 0.
        """
        return self._leaving("reflected", (0, 1))

    @property
    def transmittance(self) -> Estimate:
        """Light that left through the bottom, diffuse and ballistic [-]."""
        return self._exits(
            self.deposits.transmitted.sum() + self.deposits.ballistic,
            self.deposits.transmitted_squares.sum() + self.deposits.ballistic_squares,
        )

    @property
    def diffuse_transmittance(self) -> Estimate:
        """Light that was scattered and left through the bottom [-]."""
        return self._leaving("transmitted", (0, 1))

    @property
    def ballistic_transmittance(self) -> Estimate:
        """Light that was never scattered and left through the bottom [-]."""
        return self._exits(self.deposits.ballistic, self.deposits.ballistic_squares)

    @property
    def absorbed(self) -> Estimate:
        """Light absorbed in all layers [-]."""
        return self._exits(self.deposits.absorbed[-1], self.deposits.absorbed_squares[-1])

    @property
    def absorbed_per_layer(self) -> Estimate:
        """Light absorbed in each layer [-], (layers,)."""
        return self._exits(self.deposits.absorbed[:-1], self.deposits.absorbed_squares[:-1])

    @property
    def energy(self) -> Estimate:
        """Specular + diffuse reflectance + absorbed + transmittance + cut: 1 but for roulette's luck [-]."""
        entered = self._exits(self.deposits.accounted, self.deposits.accounted_squares)
        return replace(entered, value=entered.value + 1 - self._entering)

    @property
    def cut(self) -> float:
        """Light terminated at the scattering limit, still inside [-]; part of `energy`."""
        return float(self.deposits.cut) / self.photons * self._entering

    @property
    def reflectance_r(self) -> Estimate:
        """Diffuse reflectance by radius, R_d [1/length^2], (rings,)."""
        return self._by_radius("reflected")

    @property
    def transmittance_r(self) -> Estimate:
        """Diffuse transmittance by radius [1/length^2], (rings,)."""
        return self._by_radius("transmitted")

    @property
    def reflectance_r_overflow(self) -> Estimate:
        """Diffuse reflectance beyond the last ring [-]."""
        return self._overflow("reflected")

    @property
    def transmittance_r_overflow(self) -> Estimate:
        """Diffuse transmittance beyond the last ring [-]."""
        return self._overflow("transmitted")

    @property
    def reflectance_a(self) -> Estimate:
        """Diffuse reflectance by exit angle, all radii [1/sr], (angles,): per solid angle, not divided by a cosine."""
        return self._leaving("reflected", (0,)).scaled(1 / self.grid.solid_angles)

    @property
    def transmittance_a(self) -> Estimate:
        """Diffuse transmittance by exit angle, all radii [1/sr], (angles,)."""
        return self._leaving("transmitted", (0,)).scaled(1 / self.grid.solid_angles)

    @property
    def reflectance_ra(self) -> Estimate:
        """Diffuse reflectance by radius and exit angle [1/(length^2 sr)], (rings, angles)."""
        return self._by_radius_and_angle("reflected")

    @property
    def transmittance_ra(self) -> Estimate:
        """Diffuse transmittance by radius and exit angle [1/(length^2 sr)], (rings, angles)."""
        return self._by_radius_and_angle("transmitted")

    @property
    def absorbed_z(self) -> Estimate:
        """Light absorbed by depth, at all radii [1/length], (depths,)."""
        widths = self.grid.z_widths
        return self._spread(self.deposits.absorbed_z[:-1], self.deposits.absorbed_z_variance[:-1]).scaled(1 / widths)

    @property
    def absorbed_rz(self) -> Estimate:
        """Light absorbed by radius and depth [1/length^3], (rings, depths)."""
        volumes = self.grid.r_areas[:, None] * self.grid.z_widths
        sums, variance = self.deposits.absorbed_rz[:-1, :-1], self.deposits.absorbed_rz_variance[:-1, :-1]
        return self._spread(sums, variance).scaled(1 / volumes)

    @property
    def absorbed_z_overflow(self) -> Estimate:
        """Light absorbed below the last depth, at all radii [-]."""
        _ = self.grid.z_widths
        return _scalar(self._spread(self.deposits.absorbed_z[-1], self.deposits.absorbed_z_variance[-1]))

    @property
    def _entering(self) -> float:
        """Share of the light that enters [-]."""
        if self.illumination == "diffuse":
            return entered(Setting(self.illumination, n=self.medium.layers[0].n / self.medium.n_above))
        return 1 - fresnel.specular_reflectance(self.medium)

    def _by_radius(self, what: str) -> Estimate:
        return _rows(self._leaving(what, (1,)), slice(-1)).scaled(1 / self.grid.r_areas)

    def _overflow(self, what: str) -> Estimate:
        return _scalar(_rows(self._leaving(what, (1,)), -1))

    def _by_radius_and_angle(self, what: str) -> Estimate:
        bins = self.grid.r_areas[:, None] * self.grid.solid_angles
        return _rows(self._leaving(what, ()), slice(-1)).scaled(1 / bins)

    def _leaving(self, what: str, axes: tuple[int, ...]) -> Estimate:
        """Return the light out of one side, summed over `axes` (0: radius, 1: angle)."""
        sums, squares = getattr(self.deposits, what), getattr(self.deposits, f"{what}_squares")
        return self._exits(sums.sum(axis=axes), squares.sum(axis=axes))

    def _exits(self, sums: Floats, squares: Floats) -> Estimate:
        """Return the estimate from each photon's weight and its square, which every photon gives at most once."""
        if self.photons == 1:  # alone it says nothing of its error
            return self._spread(sums, np.full(np.shape(sums), math.inf))
        spread = np.maximum(squares - sums**2 / self.photons, 0)
        return self._spread(sums, spread * (self.photons / (self.photons - 1)))

    def _spread(self, sums: Floats, variance: Floats) -> Estimate:
        """Return the estimate from a sum over photons and the variance of that sum."""
        sums, variance = np.asarray(sums, np.float64), np.asarray(variance, np.float64)
        squares = variance + sums**2 / self.photons
        effective = np.divide(sums**2, squares, out=np.zeros_like(sums), where=squares > 0)
        share = self._entering / self.photons
        return _scalar(Estimate(share * sums, share * np.sqrt(variance), effective))


def require_quantity(name: str, grid: Grid) -> None:
    """Raise InputError unless a grid resolves the quantity of that name."""
    if name not in quantities(grid):
        raise InputError(f"quantity must be one of {', '.join(quantities(grid))}, got {name!r}")


def _rows(estimate: Estimate, rows: slice | int) -> Estimate:
    return Estimate(*(np.asarray(part)[rows] for part in _parts(estimate)))


def _scalar(estimate: Estimate) -> Estimate:
    """Return floats in place of arrays without a dimension."""
    return estimate if np.ndim(estimate.value) else Estimate(*map(float, _parts(estimate)))


def _parts(estimate: Estimate) -> tuple[float | Floats, float | Floats, float | Floats]:
    return estimate.value, estimate.standard_error, estimate.effective_samples
