"""Surface that a view sees, and the reference of a screen-space gather over it.

The G-buffer of a render as float64 arrays, the patch that each pixel shows, and the exact profile summed over the
whole visible surface, offline:

    L_c(o) = A_c(o) sum_i W_ci E_c(i) / sum_i W_ci,   W_ci = int over the surface in pixel i of R_d(|P - P_o|) / A_c dS

Conventions: R_d is the exact profile of a setting at the reflectance A_c(o) of the gathering point o and the mean free
path of the channel; distances are straight lines; only what the view sees counts, and the weights are normalised over
it (`share`, their sum, says how much of the profile's energy it holds: 1 on an endless plane); a pixel shows the
parallelogram of its footprint in its tangent plane, with one irradiance all over.

In place of a setting a scene may give a table of its own, which maps the surface's `reflectance` to curves: that is
then whatever the table takes it for, a number in [0, 1] a channel, and A_c(o) is what the curves have as reflectance.

W of the own pixel, where R_d is infinite, is an integral of the cdf along the edge of its parallelogram; neighbours are
divided by Gauss points, all others taken at their middle. All pairs count, near and far.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats, require
from profilefit.errors import InputError
from profilefit.scenes.stage.exact_law import DIFFUSE, FARTHEST, NEAREST, Curves, CurveTable, cubic, exact_table
from profilefit.scenes.stage.world import INSIDE, Buffers, Camera

FORWARD = np.array([0.0, 0.0, -1.0])
# Of normal and ray, at the least: a pixel on an outline has no tangent plane, and shows no more than this makes it.
LEAST_COSINE = 0.05
# A point may lie so many pixels off the one that shows it, over the cosine of normal and ray, that at least.
SHOWN, LEAST_SHOWN = 1.5, 0.25
# Pixels up to this many rows or columns away take 2 x 2 Gauss points, up to that many 4 x 4: at a mean free path of 1
# to 4 pixels the light is then within 1e-4 of the step edge's integral.
NEAR, CLOSE = 10, 3
# How far away each pixel of the window of that size is, in rows or columns.
STEPS = np.max(np.abs(np.indices((2 * NEAR + 1, 2 * NEAR + 1)) - NEAR), axis=0).ravel()
EDGE_RULE = np.polynomial.legendre.leggauss(24)
NOWHERE = (-(10**6), -(10**6))  # row and column of what is not in the image
AT_ONCE = 32  # gathering points; a few arrays of so many times the number of visible pixels stand in memory
CHECKED = 60  # pixels at which the reference is compared with one of half the pixel


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
    surface: Surface, view: View, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE, pixels: ArrayLike | None = None
) -> Gathered:
    """Return the reference at every visible pixel, or at `pixels` (m, 2) of (row, column), all visible.

    mfp  of the three channels (3,), in the unit of the positions
    table  of the curves, by the surface's `reflectance`; of a setting, that of the exact half space by A
    Raises InputError; SettingError of a setting with g. 26 000 visible pixels take about a minute on a core, 100 MiB.
    """
    lengths = np.asarray(mfp, float)
    are_lengths = lengths.shape == (3,) and np.all((lengths > 0) & np.isfinite(lengths))
    require(are_lengths, "mfp", "three lengths > 0", mfp)
    curves: CurveTable = exact_table(table) if isinstance(table, Setting) else table
    require(callable(getattr(curves, "curves", None)), "table", "a Setting, or have a method curves", table)
    chosen = np.argwhere(surface.mask) if pixels is None else _chosen(surface, pixels)
    light, share = np.empty((len(chosen), 3)), np.empty((len(chosen), 3))
    # The number of the visible pixel that stands for each pixel of the image and a margin of NEAR around it.
    scene, count = _scene(surface, view), np.count_nonzero(surface.mask)
    numbers = np.full(surface.mask.shape, count)
    numbers[surface.mask] = np.arange(count)
    numbers = np.pad(numbers, NEAR, constant_values=count)
    for start in range(0, len(chosen), AT_ONCE):
        part = chosen[start : start + AT_ONCE]
        light[start : start + AT_ONCE], share[start : start + AT_ONCE] = _some(
            surface, scene, numbers, lengths, curves, part
        )
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


def exitance_of(buffers: Buffers, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE) -> Floats:
    """Return radiant exitance (h, w, 3) in diffuse light: the reference; Lambert's where nothing scatters."""
    light = gathered(*seen(buffers), mfp, table).light
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


def own_error(fine: Buffers, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE) -> TruthError:
    """Return what half the pixel's side changes in `exitance_of`, at some pixels of a picture of even size.

    fine  the same picture with pixels of half the side
    """
    surface, view = seen(fine)
    inside = np.argwhere(surface.coarsened(2).mask)
    chosen = inside[np.random.default_rng(1).choice(len(inside), min(CHECKED, len(inside)), replace=False)]
    mean, difference = refined(surface, view, mfp, table, chosen)
    return TruthError.of(np.abs(difference) / np.mean(mean))


def own_share(curves: Curves, across: Floats, along: Floats) -> Floats:
    """Return the energy of each curve within a parallelogram around its source, of sides (m, 3) in mfp; (m,) [-].

    (1/2 pi) int cdf(rho) dphi along the edge; on a side at the distance d, rho = d cosh u and dphi = du / cosh u.
    """
    nodes, weights = EDGE_RULE
    area = np.linalg.norm(np.cross(across, along), axis=1)
    total = np.zeros(len(area))
    for side, other in ((across, along), (along, across)):
        length = np.linalg.norm(side, axis=1)
        distance, middle = 0.5 * area / length, 0.5 * np.sum(side * other, axis=1) / length
        low, high = (np.arcsinh((middle + end * length) / distance) for end in (-0.5, 0.5))
        u = low[:, None] + 0.5 * (high - low)[:, None] * (nodes + 1.0)
        part = weights * curves.share(distance[:, None] * np.cosh(u)) / np.cosh(u)
        total += (high - low) * part.sum(axis=1)  # half of it, and as much for the opposite side
    return total / (2.0 * np.pi)


class _Scene(NamedTuple):
    """Visible pixels (n + 1, ...), by row and column, and one that has no area, which stands for all that are not."""

    position: Array
    across: Array
    along: Array
    area: Array
    irradiance: Array
    place: Array


class _Points(NamedTuple):
    """Some gathering points (m, ...).

    around   visible pixels in the window, (2 NEAR + 1)^2;  own  energy within the own pixel (3,)
    profile  curves (3, intervals, 4)
    """

    position: Array
    place: Array
    around: Array
    profile: Array
    kappa: Array
    own: Array
    irradiance: Array


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


def _scene(surface: Surface, view: View) -> _Scene:
    mask = surface.mask
    across, along = view.footprint(surface.position, surface.normal)
    area = np.linalg.norm(np.cross(across, along), axis=-1)
    with jax.enable_x64(True):
        position, sides, others, areas, irradiance = (
            jnp.asarray(np.concatenate([value[mask], np.zeros((1, *value.shape[2:]))]))
            for value in (surface.position, across, along, area, surface.irradiance)
        )
        place = jnp.asarray(np.concatenate([np.argwhere(mask), [NOWHERE]]))
        return _Scene(position, sides, others, areas, irradiance, place)


def _some(
    surface: Surface,
    scene: _Scene,
    numbers: NDArray[np.int64],
    mfp: Floats,
    table: CurveTable,
    chosen: NDArray[np.int64],
) -> tuple[Floats, Floats]:
    """Return light and share of up to AT_ONCE points (m, 3); the last one fills the shape that was compiled."""
    full = np.concatenate([chosen, np.repeat(chosen[-1:], AT_ONCE - len(chosen), axis=0)])
    rows, columns = full.T
    curves = table.curves(surface.reflectance[rows, columns].ravel())
    around = np.stack([numbers[r : r + 2 * NEAR + 1, c : c + 2 * NEAR + 1].ravel() for r, c in full])
    visible = around[:, around.shape[1] // 2]
    across, along = np.asarray(scene.across)[visible], np.asarray(scene.along)[visible]
    sides = ((side[:, None] / mfp[:, None]).reshape(-1, 3) for side in (across, along))
    own = own_share(curves, *sides).reshape(AT_ONCE, 3)
    with jax.enable_x64(True):
        far = curves.profile.reshape(AT_ONCE, 3, -1, 4), curves.kappa.reshape(AT_ONCE, 3)
        arrays = scene.position[visible], full, around, *far, own, scene.irradiance[visible]
        points = _Points(*map(jnp.asarray, arrays))
        lit, share = (np.asarray(value) for value in _sums(scene, points, mfp))
    return (curves.reflectance.reshape(AT_ONCE, 3) * lit / share)[: len(chosen)], share[: len(chosen)]


@jax.jit
def _sums(scene: _Scene, points: _Points, mfp: Array) -> tuple[Array, Array]:
    """Return sum W E and sum W, each (m, 3)."""
    length = mfp[:, None]

    def at(point: _Points) -> tuple[Array, Array]:
        far = jnp.where(jnp.max(jnp.abs(scene.place - point.place), axis=1) > NEAR, scene.area, 0.0)
        lit, share = point.own * point.irradiance, point.own
        for position, area, irradiance in (
            (scene.position, far, scene.irradiance),
            _divided(scene, point.around[STEPS > CLOSE], 2),
            _divided(scene, point.around[(STEPS > 0) & (STEPS <= CLOSE)], 4),
        ):
            r = jnp.sqrt(jnp.sum((position - point.position) ** 2, axis=1))
            x = jnp.clip(r / length, NEAREST, FARTHEST)
            density = jnp.exp(cubic(point.profile, x) - point.kappa[:, None] * x) / length**2  # as `Curves.density`
            weight = area * density
            lit, share = lit + jnp.sum(weight * irradiance.T, axis=1), share + jnp.sum(weight, axis=1)
        return lit, share

    return jax.lax.map(at, points)


def _divided(scene: _Scene, pixels: Array, count: int) -> tuple[Array, Array, Array]:
    """Return positions, areas and irradiances of count x count Gauss points on each of the pixels."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    a, b = (0.5 * grid.ravel()[:, None] for grid in np.meshgrid(nodes, nodes))
    position = scene.position[pixels, None] + a * scene.across[pixels, None] + b * scene.along[pixels, None]
    area = scene.area[pixels, None] * (0.25 * np.outer(weights, weights).ravel())
    return position.reshape(-1, 3), area.ravel(), jnp.repeat(scene.irradiance[pixels], count * count, axis=0)


def averaged(fine: Floats, each: int) -> Floats:
    """Return the means (rows, columns, c) of pixels with so many rays along a side, in linear light."""
    rows, columns, channels = fine.shape
    return np.asarray(fine.reshape(rows // each, each, columns // each, each, channels).mean(axis=(1, 3)))
