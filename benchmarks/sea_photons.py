"""Photons in water without end: what a beam of sun comes to at each depth, and what of a sunlit sea reaches an eye.

Written for these questions alone, in numpy, and apart from `mcml_sim`'s tracer: it shares with it the phase functions
and nothing else. Lengths are in 1 / c, c = a + b the attenuation, so that water is its phase function and its albedo
omega = b / c. Light is followed until it is absorbed under the highest albedo asked for; what each order of scattering
adds is kept apart, so that one run answers for every albedo below that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import checked_numbers, checked_whole, is_number, shown
from mcml_sim.media.phase import Phase
from mcml_sim.results.estimate import Estimate
from profilefit.errors import InputError
from profilefit.scenes.sea.paths import turn

Floats = NDArray[np.float64]
GROUPS = 16  # independent, whose spread is the error: known to 18 %
MOST_ORDERS = 2000  # of scattering: under an albedo of 0.98 light has none of it left
HIGHEST, MOST = 0.8, 0.98  # albedos


@dataclass(frozen=True)
class ByOrder:
    """Contribution of each order of scattering per photon started, in independent groups.

    groups   (groups, orders, ...), orders 0, 1, 2, ..., where every scattering keeps all of the light
    highest  albedo that the light was followed for [-]
    """

    groups: Floats
    highest: float

    def at(self, omega: float) -> Estimate:
        """Return the sum of all orders (...) under an albedo; InputError beyond the highest."""
        if not (is_number(omega) and 0 <= omega <= self.highest):
            raise InputError(f"omega must be an albedo in [0, {self.highest:g}], got {shown(omega)}")
        weights = float(omega) ** np.arange(self.groups.shape[1])
        each = np.tensordot(self.groups, weights, axes=(1, 0))
        value = np.mean(each, axis=0)
        # What does not differ between groups, as unscattered light does not, has no error but rounding.
        error = np.std(each, axis=0, ddof=1) / np.sqrt(len(each))
        effective = np.divide(value**2, error**2, out=np.full_like(value, np.inf), where=error > 0)
        return Estimate(value, error, effective)


@dataclass(frozen=True)
class BeamPhotons:
    """Light of a pencil beam that starts at depth 0 downward, per light started.

    within   (depths, radii) crosses a plane downward within a radius, unscattered light included
    plane    (depths,) crosses it downward at all;  upward  (depths,) crosses it upward
    """

    within: ByOrder
    plane: ByOrder
    upward: ByOrder


def trace_beam(
    phase: Phase, depths: ArrayLike, radii: ArrayLike, photons: int = 200_000, seed: int = 0, highest: float = HIGHEST
) -> BeamPhotons:
    """Follow a pencil beam in water that fills all space; no surface.

    depths   (n,) of planes c t > 0 [-];  radii  (m,) rising c w > 0 [-]
    highest  albedo that is asked for later, at most 0.98

    A flight adds to every plane in its way the chance that it reaches it, e^-path, in place of a count: light that
    turns back and comes again adds each time. Unscattered light is not drawn: it is e^-depth.
    """
    planes, edges, count = _rising("depths", depths), _rising("radii", radii), _photons(photons)
    survival = _survival(phase, highest)
    found = [_beam_group(phase, planes, edges, rng, n, survival) for rng, n in _groups(count, seed)]
    within, upward = (_stacked([one[i] for one in found]) for i in range(2))
    whole = np.cumsum(within, axis=-1)
    return BeamPhotons(
        ByOrder(whole[..., :-1], float(highest)),
        ByOrder(whole[..., -1], float(highest)),
        ByOrder(upward, float(highest)),
    )


def _beam_group(
    phase: Phase, planes: Floats, edges: Floats, rng: np.random.Generator, photons: int, survival: float
) -> tuple[Floats, Floats]:
    """(orders, depths, rings) downward, the last ring without end, and (orders, depths) upward."""
    unscattered = np.zeros((planes.size, edges.size + 1))
    unscattered[:, 0] = np.exp(-planes)
    down, up = [unscattered], [np.zeros(planes.size)]
    flight = _Flight(rng, photons, (0.0, 0.0, 1.0))
    worth = 1.0 / photons
    while flight.scatter(phase, survival):
        worth /= survival
        rings, above = np.zeros((planes.size, edges.size + 1)), np.zeros(planes.size)
        for row, plane in enumerate(planes):
            ahead, square, reached = flight.crossings(plane)
            falls = flight.dz[ahead] > 0
            above[row] = worth * np.sum(reached[~falls])
            ring = np.searchsorted(edges**2, square[falls])
            rings[row] = worth * np.bincount(ring, reached[falls], edges.size + 1)
        down.append(rings)
        up.append(above)
    return np.array(down), np.array(up)


def trace_view(
    phase: Phase,
    depths: ArrayLike,
    cosine: float = 0.0,
    sun: float = 0.0,
    photons: int = 200_000,
    seed: int = 0,
    highest: float = HIGHEST,
) -> ByOrder:
    """Return the radiance that comes to an eye (depths,) in a sea whose whole surface is sunlit [1/sr].

    It is per irradiance of the sun across its beam below the surface.

    depths   (n,) of eyes c t > 0 [-];  cosine  of the view to the downward vertical, 0 horizontal, 1 straight down
    sun      angle of the refracted sun to that vertical [rad], 0 ... pi/2; the view is toward its azimuth

    The water has no bottom, and light that comes up to the surface leaves. Followed backward from the eye: wherever
    its way is turned, sun may be what came. Order 1, single scattering, is known and not drawn.
    """
    eyes, count = _rising("depths", depths), _photons(photons)
    if not (is_number(cosine) and -1 <= cosine <= 1):
        raise InputError(f"cosine must be in [-1, 1], got {shown(cosine)}")
    if not (is_number(sun) and 0 <= sun < np.pi / 2):
        raise InputError(f"sun must be an angle in [0, pi/2), got {shown(sun)}")
    survival = _survival(phase, highest)
    beam = (float(np.sin(sun)), 0.0, float(np.cos(sun)))
    view = (-float(np.sqrt(1.0 - cosine**2)), 0.0, float(cosine))
    once = scattered_once(phase, eyes, view, beam)
    found = [_view_group(phase, eyes, once, view, beam, rng, n, survival) for rng, n in _groups(count, seed)]
    return ByOrder(_stacked(found), float(highest))


def scattered_once(phase: Phase, depths: Floats, view: Sequence[float], beam: Sequence[float]) -> Floats:
    """Radiance (depths,) of order 1 under an albedo of 1 [1/sr]; view, beam  (x, y, z) [-], z downward.

    p int e^{-(t + v_z s) / beam_z} e^{-s} ds, to the surface where the view goes up.
    """
    slant = 1.0 / beam[2]
    rate = 1.0 + view[2] * slant
    path = depths / -view[2] if view[2] < 0 else np.full(depths.size, np.inf)
    whole = path if abs(rate) < 1e-9 else -np.expm1(-rate * path) / rate
    return float(phase.pdf(-float(np.dot(view, beam)))) * np.exp(-depths * slant) * whole


def _view_group(
    phase: Phase,
    eyes: Floats,
    once: Floats,
    view: Sequence[float],
    beam: Sequence[float],
    rng: np.random.Generator,
    photons: int,
    survival: float,
) -> Floats:
    """(orders, depths), order 0 empty."""
    found = [np.zeros(eyes.size), once]
    flight = _Flight(rng, photons, view)
    worth = 1.0 / photons
    while flight.scatter(phase, survival):
        worth /= survival
        # Where the way goes on to, and is turned next; the sun comes from there.
        end = flight.z + flight.length * flight.dz
        turned = -(flight.dx * beam[0] + flight.dy * beam[1] + flight.dz * beam[2])
        least = np.minimum(flight.least, end)
        sunlit = worth * phase.pdf(np.clip(turned, -1.0, 1.0))
        found.append(
            np.array([np.sum((sunlit * np.exp(-(eye + end) / beam[2]))[eye + least > 0]) for eye in eyes], float)
        )
    return np.array(found)


class _Flight:
    """Light on its way, of one order at a time: where it was turned last, whereto, and how far it goes.

    x, y, z, dx, dy, dz, length  (alive,);  least  smallest z of the way so far
    """

    def __init__(self, rng: np.random.Generator, count: int, direction: Sequence[float]) -> None:
        self.rng = rng
        self.x, self.y, self.z, self.least = (np.zeros(count) for _ in range(4))
        self.dx, self.dy, self.dz = (np.full(count, float(one)) for one in direction)
        self.length = rng.exponential(size=count)
        self.order = 0

    def scatter(self, phase: Phase, survival: float) -> bool:
        """On to the end of the way, where a share of the light survives and is turned; False where none is left."""
        kept = np.flatnonzero(self.rng.random(self.x.size) < survival)
        self.order += 1
        if not kept.size or self.order > MOST_ORDERS:
            return False
        length, dx, dy, dz = self.length[kept], self.dx[kept], self.dy[kept], self.dz[kept]
        self.x, self.y = self.x[kept] + length * dx, self.y[kept] + length * dy
        self.z = self.z[kept] + length * dz
        self.least = np.minimum(self.least[kept], self.z)
        below, above = phase.deflection(2.0 * self.rng.random(kept.size) - 1.0)
        self.dx, self.dy, self.dz = turn((dx, dy, dz), below, above, 2.0 * np.pi * self.rng.random(kept.size))
        self.length = self.rng.exponential(size=kept.size)
        return True

    def crossings(self, plane: float) -> tuple[NDArray[np.intp], Floats, Floats]:
        """Return which photons fly toward a plane z, their squared radius there, and their chance to arrive."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            path = (plane - self.z) / self.dz
        ahead = np.flatnonzero(path > 0)
        way = path[ahead]
        square = (self.x[ahead] + way * self.dx[ahead]) ** 2 + (self.y[ahead] + way * self.dy[ahead]) ** 2
        return ahead, square, np.exp(-way)


def _stacked(groups: list[Floats]) -> Floats:
    """Stack groups of different numbers of orders; those that ended early are filled up with zeros."""
    most = max(len(one) for one in groups)
    return np.array([np.concatenate([one, np.zeros((most - len(one), *one.shape[1:]))]) for one in groups])


def _groups(photons: int, seed: int) -> list[tuple[np.random.Generator, int]]:
    each = -(-photons // GROUPS)
    return [(np.random.default_rng([seed, group]), each) for group in range(GROUPS)]


def _photons(photons: int) -> int:
    return checked_whole("photons", photons, lowest=GROUPS, highest=10**9)


def _survival(phase: Phase, highest: float) -> float:
    if not isinstance(phase, Phase):
        raise InputError(f"phase must be a phase function of mcml_sim.phase, got {shown(phase)}")
    if not (is_number(highest) and 0 < highest <= MOST):
        raise InputError(f"highest must be an albedo in (0, {MOST:g}], got {shown(highest)}")
    return float(highest)


def _rising(name: str, value: ArrayLike) -> Floats:
    accepted = f"a list of finite numbers > 0{', rising' if name == 'radii' else ''}"
    numbers = checked_numbers(name, value, accepted)
    if numbers.ndim != 1 or not numbers.size or not np.all((numbers > 0) & np.isfinite(numbers)):
        raise InputError(f"{name} must be {accepted}, got {shown(value)}")
    if name == "radii" and np.any(np.diff(numbers) <= 0):
        raise InputError(f"{name} must be {accepted}, got {shown(value)}")
    return numbers
