"""Error against cost of shafts of sun under waves, as a view ray gathers them: lines, prisms, slices; quadrature.

The sea's surface is level but turns the sun aside, ever the same along y: the ray that enters at X is at X + q(X) z in
the depth z, q = tilt + a sum of waves. What scatters once toward the eye is then an integral over X alone, without the
infinite irradiance of folds: a ray that crosses the view ray where it has gone t adds its flux dX over |v_x - v_z q|.
Li et al. (J. Image Graphics 16(8), 1497, 2011) draw lines, then square prisms; a caustic map a depth serves both.

Lengths in 1 / c, as in `law`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcml_sim.media.arrays import Floats, checked_whole
from mcml_sim.media.phase import Phase
from profilefit.scenes.sea.law import segment_between

FINE = 1 << 16  # prisms a period, whose sum is the reference: second order in their width, right to 1e-5
PIXELS, RAYS_A_PIXEL = 512, 16  # of a caustic map, a period


@dataclass(frozen=True)
class Bundle:
    """Rays under a surface with waves: the one that enters at X goes by q(X) = tilt + sum a sin(2 pi n X + phase).

    tilt   tangent of the refracted sun [-];  waves  (a, n, phase): slope of the rays [-], whole number a period, [rad]
    The period, the sun's irradiance on the level surface, and c are 1 times `period`, 1 and `c`.
    """

    tilt: float
    waves: tuple[tuple[float, int, float], ...]
    period: float = 1.0
    c: float = 1.0

    def slope(self, x: Floats) -> Floats:
        """Return q at X [-]."""
        turn = 2.0 * np.pi / self.period
        return self.tilt + sum((a * np.sin(turn * n * x + phase) for a, n, phase in self.waves), np.zeros_like(x))


@dataclass(frozen=True)
class ViewRay:
    """Ray from an eye at (x, z), z >= 0 the depth, along a unit vector (v_x, v_y, v_z), under water for a length t."""

    x: float
    z: float
    direction: tuple[float, float, float]
    length: float


def by_lines(bundle: Bundle, view: ViewRay, phase: Phase, count: int) -> float:
    """Return the radiance scattered once into the view ray, by the sun's irradiance and b [length/sr].

    By `count` lines a period, each the flux of its cell: those that the view ray meets.
    """
    x, flux = _rays(bundle, view, count, middle=True)
    q = bundle.slope(x)
    met = _met(view, x, q)
    inside = (met >= 0) & (met <= view.length)
    x, q, met = x[inside], q[inside], met[inside]
    way = bundle.c * ((view.z + view.direction[2] * met) * np.sqrt(1.0 + q * q) + met)
    across = np.abs(view.direction[0] - view.direction[2] * q)
    return float(np.sum(_scattered(view, q, phase) * flux / across * np.exp(-way)))


def by_prisms(bundle: Bundle, view: ViewRay, phase: Phase, count: int) -> float:
    """Return that radiance by `count` prisms a period between neighbouring rays, each integrated over its chord.

    A prism keeps its flux as its area changes with depth; of one irradiance in all of it, it would make light.
    """
    edge, flux = _rays(bundle, view, count, middle=False)
    q, ends = bundle.slope(edge), _met(view, edge, bundle.slope(edge))
    middle = 0.5 * (edge[1:] + edge[:-1])
    own = bundle.slope(middle)
    across = view.direction[0] - view.direction[2] * own
    low, high = np.minimum(ends[:-1], ends[1:]), np.maximum(ends[:-1], ends[1:])
    first, last = np.clip(low, 0.0, view.length), np.clip(high, 0.0, view.length)
    # A cell beside a ray that runs along the view has its ends on either side of it, at plus and minus infinity.
    along = view.direction[0] - view.direction[2] * q
    met = (high > 0) & (low < view.length) & (along[1:] * along[:-1] > 0)
    own, across, low, high, first, last = (one[met] for one in (own, across, low, high, first, last))
    chord, whole = last - first, high - low
    slant = np.sqrt(1.0 + own * own)
    begin, end = (bundle.c * ((view.z + view.direction[2] * t) * slant + t) for t in (first, last))
    # Chords that fold to nothing keep their flux: what the whole cell has, by the part of it that is seen.
    part = np.where(whole > 0, chord / np.where(whole > 0, whole, 1.0), 1.0)
    gathered = flux / np.abs(across) * part * segment_between(np.maximum(begin, 0), np.maximum(end, 0), 1.0)
    return float(np.sum(_scattered(view, own, phase) * gathered))


def by_slices(bundle: Bundle, view: ViewRay, phase: Phase, count: int) -> float:
    """Return that radiance by `count` caustic maps, each in the middle of a piece of the ray; one if it is horizontal.

    The piece is laid onto the map along the sun: what is seen there is the mean over its pixels, times the integral of
    the segment. The map also holds the mean direction of its light, for the phase function.
    """
    number = checked_whole("count", count, lowest=1, highest=10**6)
    v_x, _, v_z = view.direction
    step, pixel = view.length / number, bundle.period / PIXELS
    gathered = 0.0
    for t in step * (np.arange(number) + 0.5):
        depth = view.z + v_z * t
        middle, half = view.x + v_x * t, 0.5 * step * abs(v_x - v_z * bundle.tilt)
        half = max(half, 0.5 * pixel)  # no piece sees less than a pixel
        flux, slopes = np.diff(flux_below(bundle, float(depth), np.array([middle - half, middle + half])))[:, 0]
        q = np.array(slopes / flux if flux > 0 else bundle.tilt)
        slant = float(np.sqrt(1.0 + q * q))
        ends = ((view.z + v_z * at) * slant + at for at in (t - 0.5 * step, t + 0.5 * step))
        begin, end = (max(bundle.c * one, 0.0) for one in ends)
        gathered += float(_scattered(view, q, phase)) * flux / (2.0 * half) * segment_between(begin, end, step)
    return gathered


def flux_below(bundle: Bundle, depth: float, x: Floats) -> Floats:
    """Return (2, n) flux from 0 to x (n,) at a depth [length], as a caustic map's running sum has it, and flux times q.

    Over a period it is a period.
    """
    rays = PIXELS * RAYS_A_PIXEL
    start = bundle.period * (np.arange(rays) + 0.5) / rays
    q = bundle.slope(start)
    landed = np.mod(start + depth * q, bundle.period) / bundle.period
    pixel = np.minimum((landed * PIXELS).astype(int), PIXELS - 1)
    turns, rest = np.divmod(np.asarray(x, float) / bundle.period, 1.0)
    found = []
    for weights in (np.ones(rays), q):
        sums = np.concatenate([[0.0], np.cumsum(np.bincount(pixel, weights, PIXELS))]) / rays
        found.append(bundle.period * (turns * sums[-1] + np.interp(rest * PIXELS, np.arange(PIXELS + 1), sums)))
    return np.array(found)


def _scattered(view: ViewRay, q: Floats, phase: Phase) -> Floats:
    """Return the phase function toward the eye times the way along a ray by depth, 1 / cosine [1/sr]."""
    slant = np.sqrt(1.0 + q * q)
    cosine = -(view.direction[0] * q + view.direction[2]) / slant
    return np.asarray(phase.pdf(np.clip(cosine, -1.0, 1.0)) * slant)


def _met(view: ViewRay, x: Floats, q: Floats) -> Floats:
    """Return the way t along the view to where it meets the ray that entered at X; inf where both are parallel."""
    across = view.direction[0] - view.direction[2] * q
    with np.errstate(divide="ignore", invalid="ignore"):
        return (x + view.z * q - view.x) / across


def _rays(bundle: Bundle, view: ViewRay, count: int, middle: bool) -> tuple[Floats, float]:
    """Return X of all rays that may meet the view, as edges or middles of cells, and the flux of a cell [length]."""
    number = checked_whole("count", count, lowest=1, highest=10**7)
    ends = (view.x, view.x + view.direction[0] * view.length)
    depths = (view.z, view.z + view.direction[2] * view.length)
    drift = max(depths) * (abs(bundle.tilt) + sum(abs(a) for a, _, _ in bundle.waves))
    width = bundle.period / number
    first = int(np.floor((min(ends) - drift) / width)) - 1
    last = int(np.ceil((max(ends) + drift) / width)) + 1
    cells = np.arange(first, last + (0 if middle else 1), dtype=np.float64)
    return width * (cells + (0.5 if middle else 0.0)), width
