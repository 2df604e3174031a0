"""Sea of a scene: its water, the waves on it, the floor below it, and the light that comes in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.media.arrays import Floats, checked_numbers, require
from mcml_sim.media.medium import fresnel
from mcml_sim.media.phase import HenyeyGreenstein, Mixture
from profilefit.scenes.sea.waves import Waves, calm_ray, checked_sun, refracted, require_below
from profilefit.scenes.stage.world import Rgb

FINE = 256  # points of a side of the tile, where the sun's rays are looked at
ROUNDING = 1e-6  # by which weights may miss a sum of 1


class Jerlov(NamedTuple):
    """Absorption a and scattering b of a water of red, green and blue [1/m]."""

    a: Rgb
    b: Rgb


# Waters of Jerlov's types, as measured: C. A. Williamson and R. C. Hollins, Measured IOPs of Jerlov water types, Appl.
# Opt. 61, 9951 (2022), table 7, at 610, 550 and 460 nm. Read from its copy in the package `jerlov` 0.22.0.
JERLOV = {
    "IB": Jerlov((0.273, 0.0655, 0.0390), (0.117, 0.122, 0.133)),
    "II": Jerlov((0.277, 0.0724, 0.0588), (0.168, 0.177, 0.193)),
    "III": Jerlov((0.287, 0.0878, 0.104), (0.277, 0.287, 0.307)),
    "1C": Jerlov((0.294, 0.0988, 0.137), (0.413, 0.427, 0.452)),
    "3C": Jerlov((0.314, 0.128, 0.186), (0.624, 0.644, 0.681)),
    "5C": Jerlov((0.333, 0.159, 0.283), (1.16, 1.19, 1.26)),
}


@dataclass(frozen=True, eq=False)
class World:
    """Water, waves, floor and light; lengths in metres, z up, the sea's mean level at 0.

    a, b         absorption >= 0 and scattering >= 0 of red, green and blue [1/m], a + b > 0
    lobes        (weight, g) of Henyey and Greenstein's terms, weights that sum to 1
    n            refractive index of the water over that of the air, > 1
    sea, floor   the two surfaces, of one tile; the floor lies below the lowest trough
    reflectance  of the floor, Lambert's, 0 ... 1
    tilt         of the sun from the vertical in air, light goes toward +x [rad]
    sun          its irradiance across its rays in air;  sky  that of the level sea by a sky alike all over
    """

    a: Rgb
    b: Rgb
    lobes: tuple[tuple[float, float], ...]
    n: float
    sea: Waves
    floor: Waves
    reflectance: Rgb
    tilt: float
    sun: Rgb
    sky: Rgb

    def __post_init__(self) -> None:
        require(np.all(self.c > 0), "a + b", "> 0", self.c.tolist())
        checked_sun(self.depth, self.tilt, self.n)
        require(self.n > 1, "n", "a refractive index > 1", self.n)
        require_below(self.sea, self.floor)

    @property
    def c(self) -> Floats:
        """Attenuation (3,) [1/m]."""
        return np.add(self.a, self.b)

    @property
    def omega(self) -> Floats:
        """Albedo b / c (3,) [-]."""
        return np.asarray(self.b) / self.c

    @property
    def depth(self) -> float:
        """Depth of the floor's mean level [m]."""
        return -self.floor.mean

    @cached_property
    def phase(self) -> Mixture:
        """Phase function of the lobes."""
        weights = np.array([weight for weight, _ in self.lobes])
        shares = tuple((weights / weights.sum()).tolist())
        return Mixture(shares, tuple(HenyeyGreenstein(g) for _, g in self.lobes))

    @cached_property
    def calm(self) -> tuple[float, float]:
        """Tangent of the ray below a calm surface to the vertical, and its flux over that across the sun's rays [-]."""
        return calm_ray(self.tilt, self.n)

    @property
    def beam(self) -> Floats:
        """Unit vector (3,) along which the calm sea's ray goes down."""
        found = np.array([self.calm[0], 0.0, -1.0])
        return found / np.linalg.norm(found)

    @property
    def slant(self) -> float:
        """Length of that ray by its depth, 1 / cosine [-]."""
        return float(-1.0 / self.beam[2])

    @cached_property
    def diffuse_in(self) -> float:
        """Share of the sky's irradiance that a calm sea lets in [-]."""
        cosine = (np.arange(4096) + 0.5) / 4096
        return float(2.0 * np.mean((1.0 - fresnel(1.0, self.n, cosine)[0]) * cosine))

    @cached_property
    def spread(self) -> float:
        """Root mean square angle of the sun's rays behind the waves to the calm sea's [rad]."""
        x = np.arange(FINE) * self.sea.tile / FINE
        _, *slope = self.sea.lattice(x, x)
        along, across, flux = refracted(self.tilt, (slope[0], slope[1]), self.n)
        ways = np.stack([along, across, -np.ones(flux.shape)]) / np.sqrt(1.0 + along**2 + across**2)
        square = np.sum((ways - self.beam[:, None, None]) ** 2, axis=0)
        return float(np.sqrt(np.sum(flux * square) / np.sum(flux)))

    @property
    def shaft(self) -> float:
        """Half-width of shafts [m]: a quarter of the length of a wave with the sea's curvature by its slope."""
        slope = self.sea.rms_slope
        squares = np.sum(self.sea.vectors**2, axis=1)
        curved = float(np.sqrt(0.5 * np.sum(self.sea.amplitudes**2 * squares**2)))
        return 0.5 * np.pi * slope / curved if slope > 0 else np.inf


def checked_lobes(lobes: ArrayLike) -> None:
    """Raise InputError where lobes are no mixture of Henyey and Greenstein's terms."""
    accepted = "a list of pairs [weight, g], weights >= 0 that sum to 1, g in (-1, 1)"
    terms = checked_numbers("lobes", lobes, accepted)
    require(terms.ndim == 2 and terms.shape[1] == 2, "lobes", accepted, lobes)
    weights, g = terms.T
    good = np.all(weights >= 0) and np.all(np.abs(g) < 1) and abs(np.sum(weights) - 1) < ROUNDING
    require(good, "lobes", accepted, lobes)
