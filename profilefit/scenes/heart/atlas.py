"""Light in texture space: a surface laid out over its uv, blurred by Gaussians one after the other; its links.

Each Gaussian is blurred from the one before, by the difference of their variances, along columns and then along rows of
the atlas, as wide on the surface everywhere. Margins have the light of where the surface goes on (`links`), and the
share of a texel that is surface goes along with its light: nothing seeps in from where nothing is.

Links are beyond the edges of charts: for each texel of a margin the place inside where the surface goes on. A chart
ends where a seam was cut; the surface does not. From the edge outwards, texel by texel, a step goes on from the last
places: in space, and what of the surface lies nearest is where it ends, across a seam on its other side, over a pole
on the meridian opposite; from there on in the atlas, along the lines of that chart. Where nothing is within a step, the
surface ends as well. Links are places in the atlas, so those of a surface at rest serve all its poses.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, distance_transform_cdt, label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats, require, require_all
from profilefit.errors import InputError
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.stage.reference.surface_sum import Elements
from profilefit.scenes.stage.renderer import GpuOwner, Pass, Read, Renderer
from profilefit.scenes.stage.technique import Unwraps, maps
from profilefit.scenes.stage.world import INSIDE, Mesh, Part, Singles
from profilefit.shader.emit import text_beside

EIGHT = np.ones((3, 3))  # a texel and its neighbours
LEAST = 2  # texels of a margin: linear reads next to an edge
REACH = 3.3  # of a blur's taps, in its sigma
SHORTEST = 0.2  # of texels are shorter than those whose margins blurs are made for
LIGHT, FILLED, STRETCH = "light_map", "filled_map", "stretch_map"
BLURRED = "blurred_map"  # by a whole kernel
SUMS = ("sum_map", "other_sum_map")
NEIGHBOURS = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])  # of a texel: rows, columns
STEP = 0.75  # of a texel, along its row and its column, and off its plane: what is farther off is another surface


class Atlas(GpuOwner):
    """Maps of one size, over which one part of a stage's scene is laid out. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], margin: int):
        """Take a context, columns and rows, and the margin around charts, which blurs reach into [texels]."""
        require(0 < 2 * margin < min(size), "margin", f"texels from 1 to less than half of {min(size)}", margin)
        self.size, self.margin = size, margin
        self.renderer = Renderer(context, size)
        self._links: Singles | None = None
        self._shortest = 0.0  # what a texel leads at least, but for those at poles [mm]
        self.texel = 0.0  # mean side of a texel, once a surface was drawn [mm]

    @property
    def links(self) -> Singles:
        """Places (rows, columns, 3) whose light texels have; `draw` comes first."""
        if self._links is None:
            raise InputError("atlas must have a surface: draw comes first")
        return self._links

    @property
    def inset(self) -> tuple[float, float]:
        """Share of the atlas that u and v from 0 to 1 take."""
        columns, rows = self.size
        return 1.0 - 2.0 * self.margin / columns, 1.0 - 2.0 * self.margin / rows

    def draw(self, stage: Unwraps, part: Part, has_sky: bool = True) -> None:
        """Draw irradiance and place of a part of the scene that the stage has drawn. Links are made the first time.

        has_sky  whether irradiance has the light of the sky, as far as the screen shows what occludes it
        """
        if self._links is None:
            require_charts(part.mesh)
        self.renderer.run(*stage.unwrapping(part, self.inset, has_sky))
        if self._links is None:
            place = self.read("position_map")
            inside = place[..., 3] > INSIDE
            self._require_apart(part.mesh, inside)
            self._links = links(place[..., :3].astype(float), inside, self.margin)
        self.renderer.run(self._filled("position_map"), self._pass("stretch", STRETCH, maps("position_map", FILLED)))
        if not self.texel:
            stretch = self.read(STRETCH)
            sides = stretch[stretch[..., 2] > INSIDE, :2].astype(float)
            self._shortest = float(np.quantile(sides, SHORTEST))
            self.texel = float(np.sqrt(np.mean(np.prod(sides, axis=1))))

    def blur(self, kernel: Kernel) -> None:
        """Draw `BLURRED`: sum_k w_k times the light blurred by v_k, of all Gaussians of a kernel, with margins."""
        self.renderer.run(self._pass("begin", LIGHT, maps("irradiance_map", STRETCH)))
        weights = np.broadcast_to(np.atleast_2d(kernel.weights.T).T, (kernel.variances.size, 3))
        self.renderer.clear(SUMS[1])
        done = 0.0
        for number, (variance, weight) in enumerate(zip(kernel.variances.tolist(), weights, strict=True)):
            self.renderer.run(*self._gaussian(done, variance))
            done = variance
            into, reads = SUMS[number % 2], {LIGHT: LIGHT, "sum_map": SUMS[1 - number % 2]}
            self.renderer.run(self._pass("add", into, reads, weight=tuple(map(float, weight))))
        self.renderer.run(self._filled(SUMS[(kernel.variances.size - 1) % 2], BLURRED))

    def read(self, name: str) -> Singles:
        """Return a map (rows, columns, 4), row 0 at the bottom."""
        return self.renderer.read(name)

    def elements(self) -> Elements:
        """Return the surface that is drawn, each texel's light and area."""
        place, stretch, light = (self.read(name).astype(float) for name in ("position_map", STRETCH, "irradiance_map"))
        inside = place[..., 3] > INSIDE
        return Elements(place[inside][:, :3], stretch[inside][:, 3], light[inside][:, :3], self.texel)

    def release(self) -> None:
        self.renderer.release()

    def _require_apart(self, mesh: Mesh, inside: NDArray[np.bool_]) -> None:
        """Raise InputError where two triangles lie on one texel, or two charts nearer than their margins are wide."""
        covered = 0.5 * np.abs(_areas(mesh)).sum() * np.prod(np.multiply(self.inset, self.size))
        texels = np.count_nonzero(inside)
        edge = np.count_nonzero(inside & ~binary_erosion(inside, EIGHT))
        if not texels:
            raise InputError(f"mesh must cover texels of the atlas, got none of {self.size[0]} x {self.size[1]}")
        if covered > texels + edge:
            raise InputError(
                f"charts must not overlap, nor triangles turn over: they cover {covered:.0f} texels, of which "
                f"{texels} are one or another's"
            )
        charts, count = label(inside, EIGHT)
        away, nearest = distance_transform_cdt(charts == 0, "chessboard", return_indices=True)
        owner = charts[tuple(nearest)]
        for axis in (0, 1):
            (one, other), (there, here) = ((np.delete(of, -1, axis), np.delete(of, 0, axis)) for of in (owner, away))
            if np.any((one != other) & (there + here <= 2 * self.margin)):
                raise InputError(
                    f"charts must lie {2 * self.margin + 1} texels apart, twice the margin of this atlas and one, got "
                    f"some of {count} that are nearer"
                )

    def _gaussian(self, done: float, variance: float) -> Iterator[Pass]:
        """Yield passes from one variance to another [mm^2], in so many parts that each stays within the margin."""
        widest, sigma = self.margin / REACH, np.sqrt(variance - done)
        parts = int(np.ceil((sigma / (widest * self._shortest)) ** 2))
        for number in range(parts):
            before = float(np.sqrt(done + (variance - done) * number / parts))
            given = {"sigma": float(sigma / np.sqrt(parts)), "before": before, "widest": widest, "reach": REACH}
            for along in ((1.0, 0.0), (0.0, 1.0)):
                yield self._filled(LIGHT)
                yield self._pass("blur", LIGHT, maps(FILLED, STRETCH), along=along, **given)

    def _filled(self, name: str, into: str = FILLED) -> Pass:
        """Return the pass that fills a map's margins."""
        return self._pass("fill", into, {LIGHT: name, "link_map": self.links})

    def _pass(self, name: str, into: str, reads: Mapping[str, Read], **uniforms: object) -> Pass:
        return Pass(name, reads, into, text_beside(__name__, f"glsl/{name}.frag"), uniforms)


def atlas_size(mesh: Mesh, texel: float, most: int, step: int = 1) -> tuple[tuple[int, int], int]:
    """Return columns and rows of an atlas whose texels have about a side [mm], no side above so many; and its margin.

    step  of which columns and rows within the margin are multiples, as `most` is
    As fine as it takes for charts to lie two such margins and a texel apart.
    """
    a, b, c = (mesh.position[mesh.triangles[:, one]] for one in range(3))
    p, q, r = (mesh.uv[mesh.triangles[:, one]] for one in range(3))
    flat = _areas(mesh)
    good = np.abs(flat) > 0
    by_u = ((b - a) * (r - p)[:, 1:] - (c - a) * (q - p)[:, 1:])[good] / flat[good, None]
    by_v = ((c - a) * (q - p)[:, :1] - (b - a) * (r - p)[:, :1])[good] / flat[good, None]
    area = np.abs(flat[good])
    extent = np.array([np.sqrt(np.average(np.sum(one**2, axis=1), weights=area)) for one in (by_u, by_v)])
    texels = extent / max(texel, extent.max() / most)
    texels = np.maximum(texels * max(1.0, (2 * LEAST + 1) / _apart(mesh, texels)), 8)
    inner = step * np.ceil(np.round(texels) / step).astype(int)
    margin = int(np.clip(min(inner.min() // 12, (_apart(mesh, inner) - 1) // 2), LEAST, 24))
    columns, rows = (inner + 2 * margin).tolist()
    return (columns, rows), margin


def require_charts(mesh: Mesh) -> None:
    """Raise InputError on a mesh that cannot be laid out."""
    count = len(mesh.position)
    if mesh.uv.shape != (count, 2) or not np.all(np.isfinite(mesh.uv)):
        raise InputError(f"mesh must have a finite uv at each of {count} vertices, got an array of {mesh.uv.shape}")
    require_all("uv", mesh.uv, (mesh.uv >= 0) & (mesh.uv <= 1), "in [0, 1]")
    flat = _areas(mesh)
    if not np.all(np.abs(flat) > 0):
        at = int(np.argmin(np.abs(flat)))
        raise InputError(f"triangles must have an area in the atlas, got 0 of triangle {at} of {len(flat)}")


def _areas(mesh: Mesh) -> Floats:
    """Return twice the areas of triangles in the atlas, below 0 of those that turn over (n,)."""
    p, q, r = (mesh.uv[mesh.triangles[:, one]] for one in range(3))
    return (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]


def _apart(mesh: Mesh, inner: Floats) -> float:
    """Return the least gap between the boxes of two charts [texels]."""
    count = len(mesh.position)
    first, second, third = mesh.triangles.T
    edges = np.concatenate([first, second]), np.concatenate([second, third])
    charts, of = connected_components(coo_array((np.ones(edges[0].size), edges), (count, count)), directed=False)
    low, high = np.full((2, charts, 2), np.inf)
    np.minimum.at(low, of, mesh.uv * inner)
    np.minimum.at(high, of, -mesh.uv * inner)
    gaps = np.max(low[:, None] + high[None, :], axis=-1)  # of the one behind the other, along rows or columns
    gaps = np.maximum(gaps, gaps.T)
    return float(np.min(gaps[~np.eye(charts, dtype=bool)], initial=np.inf))


def links(position: Floats, inside: NDArray[np.bool_], margin: int) -> Singles:
    """Return (rows, columns, 3): column and row of the place whose light a texel has, fractional, and 1; 0 where none.

    position  (rows, columns, 3) [length], of the texels that are inside a chart;  margin  how far links go [texels]
    """
    rows, columns = inside.shape
    where = np.argwhere(inside)
    tree = cKDTree(position[inside])
    place = np.zeros((rows, columns, 2))  # row, column
    place[inside] = where
    point = np.where(inside[..., None], position, 0.0)
    known = inside.copy()
    frames = _frames(position, inside)
    for _ in range(margin):
        found = []
        for step in NEIGHBOURS:
            at = np.argwhere(~known)
            one, two = at - step, at - 2 * step
            good = _has(known, one) & _has(known, two)
            at, one, two = at[good], tuple(one[good].T), tuple(two[good].T)
            if not len(at):
                continue
            three = at - 3 * step
            bent = _has(known, three)[:, None]  # a row may be a narrow circle: a parabola, where three places are known
            before = np.where(bent, point[tuple(np.clip(three, 0, np.array(inside.shape) - 1).T)], 0.0)
            to, there, good = _stepped(place[one], place[two], ~inside[one] & ~inside[two], inside, position, frames)
            ahead = np.where(bent, 3.0 * (point[one] - point[two]) + before, 2.0 * point[one] - point[two])
            distance, nearest = tree.query(ahead)
            texel = tuple(where[nearest].T)
            offset = ahead - position[texel]
            side = np.linalg.norm(frames[texel], axis=-1).max(axis=-1)
            shift, along = _in_plane(frames[texel], offset)
            close = (distance < 2.0 * side) & np.all(np.abs(shift) < STEP, axis=1)
            to = np.where(good[:, None], to, where[nearest] + shift)
            there = np.where(good[:, None], there, position[texel] + along)
            good |= close
            found.append((at[good], to[good], there[good]))
        fresh = np.zeros_like(known)
        for at, to, there in reversed(found):  # the first step wins where several reach a texel
            index = tuple(at.T)
            place[index], point[index], fresh[index] = to, there, True
        if not fresh.any():
            break
        known |= fresh
    return np.concatenate([place[..., ::-1], known[..., None]], axis=-1).astype(np.float32)


def _stepped(
    one: Floats, two: Floats, linked: NDArray[np.bool_], inside: NDArray[np.bool_], position: Floats, frames: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Return the next place in the atlas after two that are `linked`, its point, and whether it is inside a chart."""
    to = 2.0 * one - two
    nearest = np.rint(to).astype(int)
    good = linked & (np.max(np.abs(one - two), axis=1) < 2.0) & _has(inside, nearest)
    texel = tuple(np.where(good[:, None], nearest, 0).T)
    offset = np.where(good[:, None], to - nearest, 0.0)
    return to, position[texel] + np.einsum("na,nax->nx", offset, frames[texel]), good


def _has(known: NDArray[np.bool_], at: NDArray[np.int64]) -> NDArray[np.bool_]:
    within = np.all((at >= 0) & (at < known.shape), axis=1)
    clipped = np.clip(at, 0, np.array(known.shape) - 1)
    return within & known[tuple(clipped.T)]


def _frames(position: Floats, inside: NDArray[np.bool_]) -> Floats:
    """Return (rows, columns, 2, 3) steps of one row and one column [length]; central where both neighbours are in."""
    frames = np.zeros((*inside.shape, 2, 3))
    for axis in (0, 1):
        ahead, behind = (np.roll(position, -shift, axis) for shift in (1, -1))
        has_ahead, has_behind = (np.roll(inside, -shift, axis) for shift in (1, -1))
        last, first = [slice(None)] * 2, [slice(None)] * 2
        last[axis], first[axis] = -1, 0  # type: ignore[call-overload]
        has_ahead[tuple(last)], has_behind[tuple(first)] = False, False
        both, only = has_ahead & has_behind, has_ahead | has_behind
        difference = np.where(has_ahead[..., None], ahead, position) - np.where(has_behind[..., None], behind, position)
        frames[..., axis, :] = np.where(only[..., None], difference / np.where(both, 2.0, 1.0)[..., None], 0.0)
    return frames


def _in_plane(frames: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """Return rows and columns of an offset in the plane of a texel, and its part there, which at a pole they lack."""
    gram = frames @ np.swapaxes(frames, -1, -2)
    scale = np.trace(gram, axis1=-2, axis2=-1)
    safe = gram + 1e-9 * np.where(scale > 0, scale, 1.0)[:, None, None] * np.eye(2)
    normal = np.cross(frames[:, 0], frames[:, 1])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1.0)
    along = offset - np.sum(offset * normal, axis=1, keepdims=True) * normal
    return np.asarray(np.linalg.solve(safe, frames @ offset[..., None])[..., 0], float), along
