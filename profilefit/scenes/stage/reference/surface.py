"""Surface that a view sees, and the reference of a screen-space gather over it.

The G-buffer of a render as float64 arrays, the patch that each pixel shows, and the exact profile summed over the
whole visible surface, offline, or over elements of the whole surface:

    L_c(o) = A_c(o) sum_i W_ci E_c(i) / sum_i W_ci,   W_ci = int over the surface in pixel i of R_d(|P - P_o|) / A_c dS

Conventions: R_d is the exact profile of a setting at the reflectance A_c(o) of the gathering point o and the mean free
path of the channel; distances are straight lines; only what the view sees counts, and the weights are normalised over
it (`share`, their sum, says how much of the profile's energy it holds: 1 on an endless plane); a pixel shows the
parallelogram of its footprint in its tangent plane, with one irradiance all over.

In place of a setting a scene may give a table of its own, which maps the surface's `reflectance` to curves: that is
then whatever the table takes it for, a number in [0, 1] a channel, and A_c(o) is what the curves have as reflectance.

The curves of all reflectances are weights of the same Gaussians (`surface_sum`), so that the sum over all pixels costs
N log N. Its error is some 1e-5 of the mean light at most pixels, and 1e-3 at outlines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats, require
from profilefit.errors import InputError
from profilefit.scenes.stage.exact_law import DIFFUSE, FARTHEST, NEAREST, CurveTable, exact_table
from profilefit.scenes.stage.reference.surface_sum import RINGS, Elements, gaussian_sums, gaussian_weights
from profilefit.scenes.stage.world import INSIDE, Buffers, Camera

FORWARD = np.array([0.0, 0.0, -1.0])
# Of normal and ray, at the least: a pixel on an outline has no tangent plane, and shows no more than this makes it.
LEAST_COSINE = 0.05
# A point may lie so many pixels off the one that shows it, over the cosine of normal and ray, that at least.
SHOWN, LEAST_SHOWN = 1.5, 0.25
CHECKED = 60  # pixels at which the reference is compared with one of half the pixel
# Gaussians of a profile: ratio of neighbouring widths, the narrowest in its mean free paths or in pixels, the widest in
# its mean free paths, or as wide as the surface; and values of the surface's reflectance whose weights are fitted.
RATIO, NARROWEST, OF_PIXEL, WIDEST, VALUES = 1.5, 0.001, 0.1, 60.0, 65


class View(NamedTuple):
    """Camera in view space: x right, y up, z < 0 before it.

    pixel  side of a pixel [length], or in perspective that at unit depth [-]: 2 tan(fov / 2) / pixels
    """

    pixel: float
    is_perspective: bool = False

    def footprint(self, position: Floats, normal: Floats) -> tuple[Floats, Floats]:
        """Return sides of the parallelogram of the tangent plane that a pixel shows, along and across rows (..., 3)."""
        ray, scale = np.broadcast_to(FORWARD, position.shape), np.full(position.shape[:-1], float(self.pixel))
        if self.is_perspective:
            depth = -position[..., 2]
            scale = self.pixel * depth
            # The background's positions are the eye's own: any ray will do there, for its footprint is 0.
            ray = np.where(depth[..., None] > 0, position, FORWARD) / np.where(depth > 0, depth, 1.0)[..., None]
        facing = np.maximum(-np.sum(normal * ray, axis=-1), LEAST_COSINE * np.linalg.norm(ray, axis=-1))
        across, along = (
            scale[..., None] * (axis + (part / facing)[..., None] * ray)
            for axis, part in zip(np.eye(3), (normal[..., 0], normal[..., 1]), strict=False)
        )
        return across, along


class Surface(NamedTuple):
    """A G-buffer (h, w, ...) in view space; what the mask leaves out is not read.

    position [length], normal (unit, towards the eye), irradiance E [any unit], reflectance A [-], each (h, w, 3), the
    last two by channel;  mask (h, w), True where the surface is seen
    For a sum over a scene's own `CurveTable` reflectance is what that maps to curves, in [0, 1] too.
    """

    position: Floats
    normal: Floats
    irradiance: Floats
    reflectance: Floats
    mask: NDArray[np.bool_]

    def elements(self, view: View) -> Elements:
        """Return the parallelograms that the visible pixels show."""
        sides = np.stack([side[self.mask] for side in view.footprint(self.position, self.normal)])
        return Elements.of_sides(self.position[self.mask], sides, self.irradiance[self.mask])

    def coarsened(self, factor: int) -> Surface:
        """Return means over blocks of factor x factor pixels, seen where all are; InputError if blocks do not fit."""
        h, w = self.mask.shape
        if factor < 1 or h % factor or w % factor:
            raise InputError(f"factor must divide {h} and {w}, got {factor}")

        position, normal, irradiance, reflectance, share = (
            averaged(np.asarray(value, float), factor) for value in (*self[:-1], self.mask[..., None])
        )
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        unit = normal / np.where(length > 0, length, 1.0)
        return Surface(position, unit, irradiance, reflectance, share[..., 0] == 1.0)


def seen(buffers: Buffers) -> tuple[Surface, View]:
    """Return the scattering part of a render's G-buffer, in view space, and the camera that it was seen by."""
    reflectance = np.clip(np.asarray(buffers.reflectance, float), 0.0, 1.0)  # a float32 may end beyond
    mask = buffers.mask > INSIDE
    position, normal, irradiance, reflectance = (
        np.where(mask[..., None], np.asarray(value, float), 0.0)
        for value in (buffers.position, buffers.normal, buffers.irradiance, reflectance)
    )
    return Surface(position, normal, irradiance, reflectance, mask), View(buffers.pixel, buffers.is_perspective)


def world(buffers: Buffers, camera: Camera) -> Floats:
    """Return places (h, w, 3) of the world that a camera sees [mm]."""
    view = camera.view()
    return np.asarray((buffers.position.astype(float) - view[:3, 3]) @ view[:3, :3], float)


def evenly(mask: NDArray[np.bool_], most: int) -> tuple[NDArray[np.intp], ...]:
    """Return rows and columns of at most so many pixels of a mask, spread over all of it."""
    found = np.argwhere(mask)
    return tuple(found[np.linspace(0, len(found) - 1, min(most, len(found))).astype(int)].T)


def sees(buffers: Buffers, camera: Camera, points: ArrayLike) -> NDArray[np.bool_]:
    """Return (n,) whether a view sees points (n, 3) of the world [mm]: no other surface lies in front of them."""
    view = camera.view()
    place = np.asarray(points, float) @ view[:3, :3].T + view[:3, 3]
    rows, columns = buffers.mask.shape
    depth = -place[:, 2] if camera.is_perspective else np.ones(len(place))
    side = camera.pixel(rows) * np.maximum(depth, np.finfo(float).tiny)
    column, row = (np.floor(place[:, axis] / side + 0.5 * of).astype(int) for axis, of in ((0, columns), (1, rows)))
    within = (depth > 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    at = np.where(within, row, 0), np.where(within, column, 0)
    there = buffers.position[at].astype(float)
    ray = there if camera.is_perspective else np.array([[0.0, 0.0, -1.0]])
    facing = np.abs(np.sum(buffers.normal[at] * ray, axis=1)) / np.linalg.norm(ray, axis=1).clip(np.finfo(float).tiny)
    near = SHOWN * side / np.maximum(facing, LEAST_SHOWN)
    return within & (buffers.mask[at] > INSIDE) & (np.linalg.norm(place - there, axis=1) < near)


@dataclass(frozen=True)
class Gathered:
    """Light that points gather, L [unit of E], and `share`, the energy of R_d / A that the visible surface holds [-].

    Both (m, 3) at m chosen pixels, or (h, w, 3), 0 where nothing is visible.
    """

    light: Floats
    share: Floats


def gathered(
    surface: Surface,
    view: View,
    mfp: ArrayLike,
    table: CurveTable | Setting = DIFFUSE,
    pixels: ArrayLike | None = None,
    whole: Elements | None = None,
) -> Gathered:
    """Return the reference at every visible pixel, or at `pixels` (m, 2) of (row, column), all visible.

    mfp  of the three channels (3,), in the unit of the positions
    table  of the curves, by the surface's `reflectance`; of a setting, that of the exact half space by A
    whole  elements from which light is gathered, in view space, in place of those that are seen
    Raises InputError; SettingError of a setting with g. `benchmarks.render reference` prints what a picture takes.
    """
    lengths = np.asarray(mfp, float)
    are_lengths = lengths.shape == (3,) and np.all((lengths > 0) & np.isfinite(lengths))
    require(are_lengths, "mfp", "three lengths > 0", mfp)
    curves: CurveTable = exact_table(table) if isinstance(table, Setting) else table
    require(callable(getattr(curves, "curves", None)), "table", "a Setting, or have a method curves", table)
    chosen = np.argwhere(surface.mask) if pixels is None else _chosen(surface, pixels)
    if not len(chosen):
        return Gathered(*np.zeros((2, *(surface.mask.shape if pixels is None else (0,)), 3)))
    elements = surface.elements(view) if whole is None else whole
    at, own, values = (value[tuple(chosen.T)] for value in (surface.position, surface.irradiance, surface.reflectance))
    sums = CurveSums.fitted(curves, values, lengths, elements)
    light, share = np.zeros((2, *values.shape))
    for number, found in enumerate(gaussian_sums(elements, at, own, sums.sigmas)):
        weight = sums.weight(values, number)
        light += weight * found[:, 1:]
        share += weight * found[:, :1]
    light *= sums.reflectance(values) / share
    if pixels is not None:
        return Gathered(light, share)
    full = np.zeros((2, *surface.mask.shape, 3))
    full[0, surface.mask], full[1, surface.mask] = light, share
    return Gathered(*full)


def refined(
    fine: Surface, view: View, mfp: ArrayLike, table: CurveTable | Setting, pixels: ArrayLike
) -> tuple[Floats, Floats]:
    """Return light at pixels (m, 2) of a coarser view, from a surface twice as fine, and the error without it.

    view  the fine one. -> the means of the fine light over each pixel (m, 3), and the coarse light less these (m, 3):
    an estimate of the error of the coarse one, and a bound for that of the fine one.
    """
    coarse, wide = fine.coarsened(2), view._replace(pixel=2 * view.pixel)
    chosen = _chosen(coarse, pixels)
    parts = (2 * chosen[:, None] + [(0, 0), (0, 1), (1, 0), (1, 1)]).reshape(-1, 2)
    mean = gathered(fine, view, mfp, table, parts).light.reshape(len(chosen), -1, 3).mean(axis=1)
    return mean, gathered(coarse, wide, mfp, table, chosen).light - mean


def exitance_of(
    buffers: Buffers, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE, whole: Elements | None = None
) -> Floats:
    """Return radiant exitance (h, w, 3) in diffuse light: the reference; Lambert's where nothing scatters."""
    light = gathered(*seen(buffers), mfp, table, whole=whole).light
    inside = (buffers.mask > INSIDE)[..., None]
    return np.where(inside, light, buffers.irradiance.astype(float) * buffers.reflectance)


class TruthError(NamedTuple):
    """Error of a reference over its mean [-]: half of the pixels and nine in ten are below the first two.

    Of a surface integral it is what half the pixel's side changes, of paths and rays the standard error; the root mean
    square is what outlines set.
    """

    half: float
    most: float
    rms: float

    @classmethod
    def of(cls, share: Floats) -> TruthError:
        """Return the error of pixels whose errors are known, each over the reference's mean [-]."""
        half, most = np.quantile(share, (0.5, 0.9)).tolist()
        return cls(half, most, float(np.sqrt(np.mean(share**2))))


UNKNOWN = TruthError(np.nan, np.nan, np.nan)


def wider_error(
    buffers: Buffers, mfp: ArrayLike, table: CurveTable | Setting, whole: Elements, wider: Elements
) -> TruthError:
    """Return what elements of twice the side change in `exitance_of`, at some pixels: a bound of its error."""
    surface, view = seen(buffers)
    chosen = np.stack(evenly(surface.mask, CHECKED), axis=1)
    light, other = (gathered(surface, view, mfp, table, chosen, one).light for one in (whole, wider))
    return TruthError.of(np.abs(other - light) / np.mean(light))


def own_error(fine: Buffers, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE) -> TruthError:
    """Return what half the pixel's side changes in `exitance_of`, at some pixels of a picture of even size.

    fine  the same picture with pixels of half the side
    """
    surface, view = seen(fine)
    inside = np.argwhere(surface.coarsened(2).mask)
    if not len(inside):
        return UNKNOWN
    chosen = inside[np.random.default_rng(1).choice(len(inside), min(CHECKED, len(inside)), replace=False)]
    mean, difference = refined(surface, view, mfp, table, chosen)
    return TruthError.of(np.abs(difference) / np.mean(mean))


class CurveSums(NamedTuple):
    """Curves of a table as sums of the same Gaussians, at even values of what maps to curves.

    Attributes:
        sigmas: (N,) standard deviations [length].
        low, high: (3,) ends of the values, red, green, blue [-].
        weights: (VALUES, 3, N) of the Gaussians, whose sum is the curve over A [-].
        total: A of each value (VALUES, 3) [-].
    """

    sigmas: Floats
    low: Floats
    high: Floats
    weights: Floats
    total: Floats

    @classmethod
    def fitted(cls, table: CurveTable, values: Floats, mfp: Floats, elements: Elements) -> CurveSums:
        """Fit the curves of values (m, 3) between their least and their largest."""
        low, high = values.min(axis=0), values.max(axis=0)
        each = low + (high - low) * np.linspace(0.0, 1.0, VALUES)[:, None]
        least = min(NARROWEST * float(mfp.min()), OF_PIXEL * elements.spacing)
        most = max(WIDEST * float(mfp.max()), float(np.linalg.norm(np.ptp(elements.points, axis=0))))
        sigmas = np.asarray(least * RATIO ** np.arange(int(np.ceil(np.log(most / least) / np.log(RATIO))) + 1))
        first, last = np.clip(1.5 * sigmas[[0, -1]] / [mfp.max(), mfp.min()], NEAREST, FARTHEST)
        x = np.geomspace(first, last, RINGS)
        curves = table.curves(each.ravel())
        within = curves.share(np.broadcast_to(x, (each.size, RINGS)))
        edges = np.concatenate([[0.0], x, [np.inf]])
        shares = np.maximum(np.diff(within, axis=1, prepend=0.0, append=1.0), 0.0)
        variances = (sigmas / mfp[:, None]) ** 2
        weights = np.array([gaussian_weights(edges, one, variances[i % 3]) for i, one in enumerate(shares)])
        weights[:, 0] += 1.0 - weights.sum(axis=1)  # of the cusp at the source, which no Gaussian has
        return cls(sigmas, low, high, weights.reshape(VALUES, 3, -1), curves.reflectance.reshape(VALUES, 3))

    def weight(self, values: Floats, number: int) -> Floats:
        """Return the weight (m, 3) of one Gaussian at values, linear between those that were fitted [-]."""
        place = (values - self.low) / np.where(self.high > self.low, self.high - self.low, 1.0) * (VALUES - 1)
        first = np.clip(place.astype(int), 0, VALUES - 2)
        part, channel = place - first, np.arange(3)
        here, there = (self.weights[at, channel, number] for at in (first, first + 1))
        return np.asarray((1.0 - part) * here + part * there)

    def reflectance(self, values: Floats) -> Floats:
        """Return A (m, 3) at values [-]."""
        way = np.linspace(0.0, 1.0, VALUES)
        share = (values - self.low) / np.where(self.high > self.low, self.high - self.low, 1.0)
        return np.stack(
            [CubicSpline(way, total)(one) for total, one in zip(self.total.T, share.T, strict=True)], axis=1
        )


def _chosen(surface: Surface, pixels: ArrayLike) -> NDArray[np.int64]:
    chosen = np.asarray(pixels)
    if chosen.ndim != 2 or chosen.shape[1] != 2 or not np.issubdtype(chosen.dtype, np.integer):
        raise InputError(f"pixels must be pairs (row, column) of whole numbers, got an array of shape {chosen.shape}")
    inside = np.all((chosen >= 0) & (chosen < surface.mask.shape), axis=1)
    good = inside.copy()
    good[inside] = surface.mask[tuple(chosen[inside].T)]
    if not good.all():
        raise InputError(f"pixels must be visible ones, got {tuple(int(i) for i in chosen[~good][0])}")
    return chosen.astype(np.int64)


def averaged(fine: Floats, each: int) -> Floats:
    """Return the means (rows, columns, c) of pixels with so many rays along a side, in linear light."""
    rows, columns, channels = fine.shape
    return np.asarray(fine.reshape(rows // each, each, columns // each, each, channels).mean(axis=(1, 3)))
