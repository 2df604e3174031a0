"""Photographs of a laser spot that were never taken: what a camera would record of a medium, a card, or nothing.

Light about the spot is round: its transform is that of the profile, exact or of traced photons, times those of beam and
lens, by quadrature of Hankel's integrals. The camera sees it tilted, darker towards its corners, through speckle; a
pixel counts electrons, spills what is too much over its neighbours in a column, and is read with noise, in steps, up to
its white level.

Halos are Moffat's, h = (b - 1) / (pi a^2) (1 + r^2 / a^2)^-b, whose transform is
2 (ka / 2)^{b-1} K_{b-1}(ka) / Gamma(b - 1); b = 5/2 are those of `glare`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter
from scipy.special import gamma, j0, j1, kv

from mcml_sim.media.arrays import Floats
from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import Layer, Medium
from mcml_sim.media.setting import Setting
from mcml_sim.runs.simulation import simulate
from profilefit.errors import InputError
from profilefit.measured.instrument import between
from profilefit.measured.model import exact_light

Counts = NDArray[np.uint16]
PATTERN = (("red", "green"), ("green", "blue"))  # of a Bayer sensor's first two rows
PANELS, ORDER = 260, 10  # of the quadratures, which have more where J_0 turns by more than TURN in a panel [rad]
TURN, MOST_VALUES = 16.0, 4e8  # and the most values of J_0: ten seconds
PANEL = np.polynomial.legendre.leggauss(ORDER)
CUT = 8.0  # k sigma beyond which the core's transform is nothing
NEAR, FAR = 1e-5, 80.0  # l*, of the profile's
TRACED_NEAR, TRACED_RINGS = 0.01, 250  # l*, of rings that photons are counted in
RADII = 400  # at which a picture's light is found
SPILLS = 200  # pixels along a column that an overfull one may reach


@dataclass(frozen=True)
class SpotOptics:
    """Beam and lens; lengths in mm.

    beam     1/e^2 radius; core standard deviation of the lens's blur
    surface  share of the light that the surface scatters; glare that in the halo, width its a, falling its b
    """

    beam: float = 0.5
    core: float = 0.05
    surface: float = 0.01
    glare: float = 0.02
    width: float = 4.0
    falling: float = 1.5

    @property
    def sigma(self) -> float:
        return float(np.hypot(0.5 * self.beam, self.core))

    def transform(self, k: Floats) -> Floats:
        """Return the transform of beam and lens at k [1/mm]."""
        order = self.falling - 1.0
        x = np.maximum(k * self.width, 1e-12)
        halo = 2.0 * (0.5 * x) ** order * kv(order, x) / gamma(order)
        return np.asarray(np.exp(-0.5 * (k * self.sigma) ** 2) * (1.0 - self.glare + self.glare * halo), float)


@dataclass(frozen=True)
class SpotCamera:
    """A sensor and its lens.

    sides    columns and rows; pitch of a pixel on the object [mm]; gain [electrons a step], read noise [electrons]
    bits     of the converter; black its level where there is no light; full well [electrons]
    uneven   standard deviation of the pixels' sensitivities [-]; corner share of the light that the corners lose
    tilt     of the object about the sensor's rows [degrees]; speckle contrast [-], of grains of so many pixels
    centre   of the spot from the middle [pixels]
    """

    sides: tuple[int, int] = (4000, 3000)
    pitch: float = 0.02
    gain: float = 4.0
    read: float = 3.0
    bits: int = 12
    black: int = 256
    well: float = 1e5
    uneven: float = 0.005
    corner: float = 0.1
    tilt: float = 0.0
    speckle: float = 0.1
    grain: float = 1.5
    centre: tuple[float, float] = (0.0, 0.0)

    @property
    def white(self) -> int:
        return (1 << self.bits) - 1


@dataclass(frozen=True)
class SimulatedExposure:
    """An exposure. `seconds` are those that the camera states, which need not be those that it took."""

    counts: Counts
    seconds: float
    black: int
    white: int


def light(
    alpha: float, length: float, setting: Setting, optics: SpotOptics, r: Floats, photons: int = 0, seed: int = 0
) -> Floats:
    """Return I(r) [1/mm^2] of a medium of reduced albedo and l* [mm], per light on it; exact, or by traced photons."""
    k, weight = _waves(optics, float(r.max()))
    if photons:  # the transform of traced rings, taken as constant within a ring
        layer = Layer(n=setting.n, mu_a=(1.0 - alpha) / length, mu_s=alpha / length / (1.0 - setting.g), g=setting.g)
        edges = np.append(0.0, np.geomspace(TRACED_NEAR, FAR, TRACED_RINGS)) * length
        tally = simulate(Medium((layer,)), Grid.from_edges(r=edges), photons, seed, progress=False)
        disc = 2.0 * np.pi * edges * j1(np.multiply.outer(np.maximum(k, 1e-12), edges)) / np.maximum(k, 1e-12)[:, None]
        medium = np.asarray(np.diff(disc, axis=1) @ tally.reflectance_r.value, float)
    else:
        medium = _transform(alpha, length, setting, k.tobytes())
    return _inverse((medium + optics.surface) * optics.transform(k), k, weight, r)


def card(optics: SpotOptics, r: Floats) -> Floats:
    """Return I(r) [1/mm^2] of a white card that light does not enter."""
    k, weight = _waves(optics, float(r.max()))
    return _inverse(optics.transform(k), k, weight, r)


@lru_cache(maxsize=8)
def _transform(alpha: float, length: float, setting: Setting, k: bytes) -> Floats:
    """Return int D(rho) J_0(k rho) drho, D = 2 pi rho R_d, at k [1/mm]."""
    whole = np.frombuffer(k)
    edges = np.append(np.geomspace(NEAR, 1.0, 30), np.linspace(1.0, FAR, PANELS // 2)[1:]) * length
    rho, weight = between(_turned(np.append(0.0, edges), float(whole.max())), PANEL)
    with jax.enable_x64(True):
        light = exact_light(setting).ring_density(jnp.asarray(rho / length), jnp.asarray(alpha))
    density = np.asarray(light) / length
    parts = np.array_split(whole, max(16, whole.size * rho.size >> 22))  # of 32 MiB
    return np.concatenate([j0(np.multiply.outer(part, rho)) @ (weight * density) for part in parts])


def require_resolved(length: float, optics: SpotOptics, far: float) -> None:
    """InputError of an l* [mm] whose exact light takes too many nodes, under such a beam and out to `far` [mm]."""
    waves, _ = _waves(optics, far)
    nodes = FAR * length * CUT / optics.sigma / TURN * ORDER
    if waves.size * nodes > MOST_VALUES:
        most = length * MOST_VALUES / (waves.size * nodes)
        raise InputError(
            f"mu_s + mu_a must be >= {1.0 / most:.2g} 1/mm under a beam this narrow in a picture this wide, got "
            f"{1.0 / length:.2g}"
        )


def _waves(optics: SpotOptics, far: float) -> tuple[Floats, Floats]:
    """Return k [1/mm] and their weights, for light out to `far` [mm]."""
    return between(_turned(np.linspace(0.0, CUT / optics.sigma, PANELS + 1), far), PANEL)


def _turned(edges: Floats, rate: float) -> Floats:
    """Edges of panels, cut where J_0 turns by more than TURN between them: by `rate` a unit."""
    pieces = np.ceil(np.diff(edges) * rate / TURN).clip(1.0)
    at = np.append(0.0, np.cumsum(pieces))
    return np.asarray(np.interp(np.arange(at[-1] + 1.0), at, edges), float)


def _inverse(transformed: Floats, k: Floats, weight: Floats, r: Floats) -> Floats:
    rows = np.array_split(r, max(1, r.size * k.size >> 22))
    return np.concatenate([j0(np.multiply.outer(row, k)) @ (weight * k * transformed) for row in rows]) / (2.0 * np.pi)


def exposures_of(
    radial: Mapping[str, tuple[Floats, Floats]],
    camera: SpotCamera,
    electrons: float,
    times: Mapping[float, float],
    seed: int,
) -> list[SimulatedExposure]:
    """Simulate a bracket of exposures.

    radial     radii [mm], out to the corners, and light (n,) [1/mm^2] by channel
    electrons  a second where light is 1 [1/mm^2]; times: seconds that it took, by those that the camera states
    """
    rng = np.random.default_rng(seed)
    columns, rows = camera.sides
    x, y = np.meshgrid(np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32))
    middle = 0.5 * (columns - 1), 0.5 * (rows - 1)
    across, down = x - middle[0] - camera.centre[0], y - middle[1] - camera.centre[1]
    r = camera.pitch * np.hypot(across, down / np.float32(np.cos(np.radians(camera.tilt))))
    corner = ((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / (middle[0] ** 2 + middle[1] ** 2)
    sees = (1.0 - camera.corner * corner) * (1.0 + camera.uneven * rng.standard_normal(r.shape, dtype=np.float32))
    if camera.speckle != 0:  # speckle of mean 1, in grains
        noise = gaussian_filter(rng.standard_normal(camera.sides[::-1], dtype=np.float32), camera.grain, mode="wrap")
        noise *= camera.speckle / noise.std()
        sees *= np.exp(noise - 0.5 * camera.speckle**2)
    expected = np.empty(r.shape, np.float32)
    for row, column in np.ndindex(2, 2):
        at = (slice(row, None, 2), slice(column, None, 2))
        # Light of few photons rings about zero where there is none.
        expected[at] = np.maximum(CubicSpline(*radial[PATTERN[row][column]])(r[at]), 0.0)
    expected *= np.float32(electrons) * sees
    return [
        SimulatedExposure(_recorded(expected * np.float32(real), camera, rng), stated, camera.black, camera.white)
        for stated, real in times.items()
    ]


def radii(farthest: float, optics: SpotOptics) -> Floats:
    """Return radii at which a picture's light is computed, from the axis out to `farthest` [mm]."""
    return np.append(0.0, np.geomspace(0.02 * optics.sigma, farthest, RADII))


def _recorded(expected: NDArray[np.float32], camera: SpotCamera, rng: np.random.Generator) -> Counts:
    """Draw counts of so many expected electrons."""
    # A Poisson number of more than a hundred is a normal one to a percent of its error.
    many = expected.copy()
    many += np.sqrt(expected) * rng.standard_normal(expected.shape, dtype=np.float32)
    few = expected < 100.0
    many[few] = rng.poisson(expected[few])
    _spill(many, camera.well)
    many += np.float32(camera.read) * rng.standard_normal(expected.shape, dtype=np.float32)
    return np.clip(np.rint(many / camera.gain + camera.black), 0, camera.white).astype(np.uint16)


def _spill(electrons: NDArray[np.float32], well: float) -> None:
    """Move what is too much for a pixel to its neighbours in the column, half up and half down."""
    for _ in range(SPILLS):
        over = electrons > well
        if not over.any():
            return
        rows = np.flatnonzero(over.any(axis=1))
        low, high = max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, len(electrons))
        part = electrons[low:high]
        excess = np.maximum(part - well, 0.0)
        part -= excess
        part[1:] += 0.5 * excess[:-1]
        part[:-1] += 0.5 * excess[1:]
