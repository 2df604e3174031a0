"""Rings about a laser spot: pixels as lengths on the object, the centre of the spot, means over rings with covariance.

The scale is a number, two points of a ruler, or a marker, which also shows how the object is tilted. The centre is the
point about which far rings are even.

A ring has few pixels near the centre, and where these lie in it is chance. Its mean is that of its pixels, and it keeps
the distances at which these lie, over which the fit averages its light.

Each ring is divided into sectors, whose deviations from a polynomial in the square of the radius give the covariance of
the rings. Rings are correlated where something is uneven over many of them; with fewer sectors than rings the
covariance is shrunk towards its diagonal by as much as its correlations are noise (Schaefer and Strimmer, Stat. Appl.
Genet. Mol. Biol. 4, 2005). Near the centre a grain of speckle is wider than a sector, and sectors that share it do not
scatter, or a sector has no pixel. There a ring's variance is at least that of as many pixels, as bright, of next rings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, grey_dilation, label

from mcml_sim.media.arrays import Floats, shown
from profilefit.errors import InputError
from profilefit.measured.data import length
from profilefit.measured.instrument import RING
from profilefit.measured.photo.exposure import Exposure, Picture, Plane, library

FARTHEST = 1e6  # pixels, between two points of a ruler
PER_PIXEL = re.compile(r"(?P<length>.+?)\s*/\s*(?:px|pixel)")
NUMBER = r"[0-9]+(?:\.[0-9]+)?"
RULER = re.compile(rf"(?P<a>{NUMBER}),(?P<b>{NUMBER}):(?P<c>{NUMBER}),(?P<d>{NUMBER})\s*=\s*(?P<length>.+)")
MARKER = "aruco:"
DICTIONARY = "DICT_4X4_50"
WHITE = 99.0  # percentile that a preview shows white
ACCEPTED = "0.05mm/px, two points of a ruler X,Y:X,Y=10mm, or aruco:20mm (a marker of 4 x 4 by its side)"
BLUR = 2.0  # pixels of a plane
BRIGHT = 0.25  # of the brightest light, from where a patch is a spot of its own
SMALLEST = 12  # pixels of such a patch
ROUNDS, SETTLED = 30, 1e-3  # of the search; pixels
WIDTHS = 4.0  # radii of half the light, which must fit between spot and border
RINGS = 40  # of the search for the centre
SECTORS = 24
FACTOR = 1.12  # of the radii of neighbouring edges
FINEST = 3.0  # pixels, of a ring's width
GRAIN, NEXT = 8.0, 5  # pixels, of a sector that no grain fills; rings with such sectors that tell of the narrower
SEEN = 5.0  # standard errors of noise in the middle, from which there is a spot
DEGREE = 4  # in the square of the radius, of the light within a ring
POWERS = np.arange(DEGREE + 1)
PARTS = 32  # of a ring, of equal area, that each count at one distance


@dataclass(frozen=True, eq=False)
class PixelScale:
    """matrix (3, 3) from columns and rows [pixels] to places on the object [unit], homogeneous."""

    matrix: Floats
    words: str

    def from_centre(self, columns: Plane, rows: Plane, centre: tuple[float, float]) -> tuple[Plane, Plane]:
        """Places of pixels about a centre [unit]; columns and rows are broadcast."""
        m = self.matrix
        middle = m @ (*centre, 1.0)
        affine = bool(np.all(m[2, :2] == 0.0))
        away = 1.0 if affine else m[2, 0] * columns + m[2, 1] * rows + m[2, 2]
        both = []
        for row, start in zip(m[:2], middle[:2] / middle[2], strict=True):
            # About the centre already where that loses no digits.
            shift = -row[:2] @ centre if affine else row[2]
            place = (np.float32(row[0]) * columns + np.float32(row[1]) * rows + np.float32(shift)) / away
            both.append(np.asarray(place if affine else place - start, np.float32))
        x, y = np.broadcast_arrays(*both)
        return x, y

    def pixel(self, centre: tuple[float, float]) -> float:
        """Size of a pixel there [unit]: the root of its area."""
        m, (c, r) = self.matrix, centre
        away = m[2] @ (c, r, 1.0)
        place = m[:2] @ (c, r, 1.0) / away
        slopes = (m[:2, :2] - np.outer(place, m[2, :2])) / away
        return float(np.sqrt(abs(np.linalg.det(slopes))))


def pixel_scale(option: str, text: str, shots: Sequence[Exposure], unit: str = "mm") -> PixelScale:
    """Return the scale of a text; InputError names the option and what it takes."""
    if match := PER_PIXEL.fullmatch(text):
        size = length(option, match["length"], unit)
        return PixelScale(np.diag([size, size, 1.0]), f"{size:g} {unit} a pixel, as told")
    if match := RULER.fullmatch(text):
        apart = float(np.hypot(float(match["c"]) - float(match["a"]), float(match["d"]) - float(match["b"])))
        if not 1.0 < apart < FARTHEST:
            raise InputError(f"{option} must have two points that are apart, on a photograph, got {shown(text)}")
        size = length(option, match["length"], unit) / apart
        return PixelScale(np.diag([size, size, 1.0]), f"{size:.4g} {unit} a pixel, by two points of a ruler")
    if text.startswith(MARKER):
        return _by_marker(option, length(option, text.removeprefix(MARKER), unit), shots, unit)
    raise InputError(f"{option} must be {ACCEPTED}, got {shown(text)}")


def _by_marker(option: str, side: float, shots: Sequence[Exposure], unit: str) -> PixelScale:
    cv2 = library("cv2")
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY)))
    for shot in shots:
        counts = next((one for one in shot.planes if one.colour == "green"), shot.planes[0]).counts
        most = max(float(np.percentile(counts, WHITE)), 1e-9)
        corners, _, _ = detector.detectMarkers((255.0 * np.sqrt(np.clip(counts / most, 0.0, 1.0))).astype(np.uint8))
        if len(corners):
            break
    else:
        accepted = f"a marker that {shots[0].source} shows"
        raise InputError(f"{option} must be {accepted}, got none of {DICTIONARY}; {ACCEPTED}")
    step = shots[0].planes[0].step
    points = (corners[0].reshape(4, 2) * step).astype(np.float32)
    square = side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    matrix = np.asarray(cv2.getPerspectiveTransform(points, square), float)
    plate = PixelScale(matrix, "")
    size = plate.pixel((float(points[:, 0].mean()), float(points[:, 1].mean())))
    return PixelScale(matrix, f"{size:.4g} {unit} a pixel, and the tilt, by a marker of {side:g} {unit}")


@dataclass(frozen=True)
class Spot:
    """Spot of light: centre (column, row), distance to the nearest border, radius of half the brightest [pixels]."""

    centre: tuple[float, float]
    reach: float
    half: float


def spot(pictures: Sequence[Picture], sides: tuple[int, int], plate: PixelScale, source: str) -> Spot:
    """Find the spot in planes of one colour; InputError where a picture shows none, two, or an unmeasurable one."""
    first = pictures[0]
    known = np.isfinite(first.light)
    smooth = gaussian_filter(np.where(known, first.light, 0.0), BLUR)
    share = gaussian_filter(known.astype(np.float32), BLUR)
    with np.errstate(divide="ignore", invalid="ignore"):
        smooth = np.where(share > 0.1, smooth / share, 0.0)
    _require_centre(known, smooth, source)
    most = float(smooth.max())
    if not most > 0:
        raise InputError(f"{source}: expected a spot of light, got darkness")
    patches, count = label(smooth > BRIGHT * most)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)[1:]
    if (large := int(np.sum(sizes >= SMALLEST))) != 1:
        words = "none" if large == 0 else f"{large}, apart from one another"
        raise InputError(f"{source}: expected one spot of light, got {words}")
    rows, columns = np.nonzero(patches == 1 + int(np.argmax(sizes)))
    weight = smooth[rows, columns]
    row, column = (float(np.average(each, weights=weight)) for each in (rows, columns))
    start = column * first.step + first.offset[1], row * first.step + first.offset[0]
    half = float(np.sqrt(np.sum(smooth > 0.5 * most) / np.pi)) * first.step
    reach = _reach(start, sides)
    if reach < WIDTHS * half:
        raise InputError(
            f"{source}: expected a spot at least {WIDTHS * half:.0f} pixels from every border, got {max(reach, 0):.0f}"
        )
    centre = _evened(pictures, start, half, reach, plate)
    return Spot(centre, _reach(centre, sides), half)


def _require_centre(known: NDArray[np.bool_], smooth: NDArray[np.float32], source: str) -> None:
    """Require that what no exposure recorded lies in no bright light; a pixel that is stuck elsewhere may."""
    patches, count = label(~known)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)
    around = grey_dilation(patches, size=(3, 3))
    inside = np.unique(around[known & (smooth > BRIGHT * smooth.max())])
    most = max((int(sizes[one]) for one in inside if one > 0), default=0)
    if most >= SMALLEST or not np.any(known):
        raise InputError(
            f"{source}: expected a spot that the shortest exposure does not clip, got {most or known.size} pixels of a "
            "plane that all clip; add a shorter exposure"
        )


def _reach(centre: tuple[float, float], sides: tuple[int, int]) -> float:
    return min(*centre, sides[0] - 1 - centre[0], sides[1] - 1 - centre[1])


def _evened(
    pictures: Sequence[Picture], start: tuple[float, float], half: float, reach: float, plate: PixelScale
) -> tuple[float, float]:
    """Find the centre by dipoles of rings beyond the brightest: -I'(r) d cos at a distance d from it."""
    centre: Floats = np.array(start, float)
    pixel = plate.pixel(start)
    edges = np.geomspace(half, reach, RINGS + 1) * pixel
    for _ in range(ROUNDS):
        sums = np.zeros((4, RINGS))
        for one in pictures:
            x, y, light = places(one, plate, (float(centre[0]), float(centre[1])))
            r = np.maximum(np.hypot(x, y), 1e-6 * pixel)
            ring = np.digitize(r, edges) - 1
            good = (ring >= 0) & (ring < RINGS) & np.isfinite(light)
            ring, value = ring[good], light[good]
            for at, weight in enumerate((None, value, value * (x / r)[good], value * (y / r)[good])):
                sums[at] += np.bincount(ring, weight, RINGS)
        count, total, across, down = sums
        full = count > 0
        middle = np.sqrt(edges[1:] * edges[:-1])[full]
        mean = total[full] / count[full]
        slope = np.gradient(mean, middle)
        weight = count[full] / np.maximum(mean, 1e-3 * mean.max())
        matrix = float(np.sum(weight * slope**2))
        step = np.array([np.sum(weight * slope * -2.0 * one[full] / count[full]) for one in (across, down)]) / matrix
        step /= pixel
        size = float(np.hypot(*step))
        centre += step * min(1.0, half / max(size, 1e-12))
        if size < SETTLED:
            break
    return float(centre[0]), float(centre[1])


def places(picture: Picture, plate: PixelScale, centre: tuple[float, float]) -> tuple[Plane, Plane, Plane]:
    """Return places of a plane's pixels about the centre [unit], and their light, (n,) each."""
    rows, columns = picture.light.shape
    across = (np.arange(columns, dtype=np.float32) * picture.step + picture.offset[1])[None]
    down = (np.arange(rows, dtype=np.float32) * picture.step + picture.offset[0])[:, None]
    x, y = plate.from_centre(across, down, centre)
    return x.ravel(), y.ravel(), picture.light.ravel()


@dataclass(frozen=True, eq=False)
class SpotRings:
    """Rings of inner and outer radii (n,) [unit], the light of each, and its covariance (n, n).

    pixels  distances (n, m) of a ring's pixels from the centre, and the share of the pixels at each; None: even by area
    """

    inner: Floats
    outer: Floats
    value: Floats
    covariance: Floats
    pixels: tuple[Floats, Floats] | None = None

    @property
    def gathered(self) -> tuple[Floats, Floats]:
        """Distances (n, m) whose light each ring averages, and how much each counts."""
        if self.pixels is not None:
            return self.pixels
        d, share = over_rings(self.inner, self.outer)
        return d, np.broadcast_to(share, d.shape)

    @property
    def r(self) -> Floats:
        return 0.5 * (self.inner + self.outer)

    @property
    def shows_spot(self) -> bool:
        """True if the middle is brighter than the outer half of the rings, by more than their noise explains."""
        if self.value.size < 2:
            return False
        areas, far = np.pi * (self.outer - self.inner) * (self.outer + self.inner), slice(self.value.size // 2, None)
        noise = np.median((np.diag(self.covariance) * areas)[far])
        return bool(self.value[0] - np.median(self.value[far]) > SEEN * np.sqrt(noise / areas[0]))


def edges_of(reach: float, pixel: float) -> Floats:
    """Return radii from the centre to `reach`, at least FINEST pixels apart [unit]."""
    edges = [0.0]
    while (following := max(edges[-1] * FACTOR, edges[-1] + FINEST * pixel)) < reach:
        edges.append(following)
    return np.array(edges)


def rings(pictures: Sequence[Picture], centre: tuple[float, float], edges: Floats, plate: PixelScale) -> SpotRings:
    """Return rings of the planes of one colour, between edges [unit]."""
    count = edges.size - 1
    cells, parts = count * SECTORS, count * PARTS
    kept = []
    powers, products = np.zeros((2 * DEGREE + 1, count)), np.zeros((DEGREE + 1, count))
    places_of, light_of = np.zeros((2, parts)), np.zeros((2, count))
    squares = edges**2
    for one in pictures:
        x, y, light = places(one, plate, centre)
        square = x * x + y * y
        ring = np.digitize(np.sqrt(square), edges) - 1
        good = (ring >= 0) & (ring < count) & np.isfinite(light)
        x, y, square, light, ring = x[good], y[good], square[good], light[good], ring[good]
        share = (square - squares[ring]) / np.diff(squares)[ring]
        across = 2.0 * share - 1.0
        part = ring * PARTS + np.clip(PARTS * share, 0, PARTS - 1).astype(int)
        places_of += np.bincount(part, minlength=parts), np.bincount(part, square, parts)
        light_of += np.bincount(ring, light, count), np.bincount(ring, light.astype(float) ** 2, count)
        sector = ((np.arctan2(y, x) + np.pi) * (SECTORS / (2.0 * np.pi))).astype(int) % SECTORS
        kept.append((ring, across, ring * SECTORS + sector, light))
        for power in range(2 * DEGREE + 1):
            powers[power] += np.bincount(ring, across**power, count)
        for power in range(DEGREE + 1):
            products[power] += np.bincount(ring, light * across**power, count)
    inverse = np.linalg.pinv(np.moveaxis(powers[np.add.outer(POWERS, POWERS)], 2, 0))
    polynomials = np.einsum("nij,jn->in", inverse, products)  # (DEGREE + 1, n), lowest power first
    sums = np.zeros((2, cells))
    for ring, across, cell, light in kept:
        residual = light - np.sum(polynomials[:, ring] * across ** POWERS[:, None], axis=0)
        sums += np.bincount(cell, minlength=cells), np.bincount(cell, residual, cells)
    many, total = sums.reshape(2, count, SECTORS)
    pixels, whole = many.sum(axis=1), np.all(many > 0, axis=1)
    covariance, residual = np.zeros((count, count)), total[whole] / many[whole]
    covariance[np.ix_(whole, whole)] = shrunk(residual - residual.mean(axis=1)[:, None])
    narrow = ~whole | (np.pi * (edges[1:] + edges[:-1]) < SECTORS * GRAIN * plate.pixel(centre))
    covariance = _of_grains(covariance, pixels, light_of, narrow)
    number, square = places_of.reshape(2, count, PARTS)
    distance = np.sqrt(np.where(number > 0, square / np.maximum(number, 1.0), squares[1:, None]))
    seen = (pixels > 0) & (np.diag(covariance) > 0)
    each = np.maximum(pixels, 1.0)
    return SpotRings(
        edges[:-1][seen], edges[1:][seen], (light_of[0] / each)[seen], covariance[np.ix_(seen, seen)],
        (distance[seen], (number / each[:, None])[seen]),
    )  # fmt: skip


def _of_grains(covariance: Floats, pixels: Floats, light: Floats, narrow: NDArray[np.bool_]) -> Floats:
    """Return the covariance (n, n) of rings, raised in `narrow` rings to what the others suggest.

    light  (2, n) sums of the light of `pixels` (n,), and of its square
    """
    variance = np.diag(covariance)
    # Relative variance of a pixel, grains included: a mean over pixels of light y has that times (sum y^2) / n^2.
    spread = light[1] / np.maximum(pixels, 1.0) ** 2
    tells = ~narrow & (light[0] > 0)
    if not np.any(tells):
        tells = (variance > 0) & (light[0] > 0)
    least = np.median((variance[tells] / spread[tells])[:NEXT]) * spread if np.any(tells) else np.zeros(pixels.size)
    missing = np.where(narrow & (variance == 0), least, 0.0)
    wider = np.sqrt(np.maximum(least / np.where(variance > 0, variance, np.inf), 1.0))
    widening = np.where(narrow, wider, 1.0)
    return covariance * np.outer(widening, widening) + np.diag(missing)


def shrunk(residual: Floats) -> Floats:
    """Covariance (n, n) of means over sectors from their deviations (n, sectors)."""
    sectors = residual.shape[1]
    variance = np.sum(residual**2, axis=1) / (sectors - 1)
    scaled = residual / np.sqrt(np.maximum(variance, np.finfo(float).tiny))[:, None]
    products = scaled[:, None] * scaled[None]
    correlation = products.sum(axis=2) / (sectors - 1)
    noise = np.sum((products - products.mean(axis=2, keepdims=True)) ** 2, axis=2) * sectors / (sectors - 1) ** 3
    apart = ~np.eye(len(residual), dtype=bool)
    share = float(np.clip(noise[apart].sum() / max(np.sum(correlation[apart] ** 2), 1e-12), 0.05, 1.0))
    kept = np.where(apart, (1.0 - share) * correlation, 1.0)
    size = np.sqrt(variance / sectors)
    return np.asarray(kept * np.outer(size, size), float)


def over_rings(inner: Floats, outer: Floats) -> tuple[Floats, Floats]:
    """Distances (n, q) and shares (q,) of a ring's area."""
    t, share = 0.5 * (1.0 + RING[0]), 0.5 * RING[1]
    return np.sqrt(inner[:, None] ** 2 + ((outer - inner) * (outer + inner))[:, None] * t), share
