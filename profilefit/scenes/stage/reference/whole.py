"""Whole surface of a scene, hidden parts included, as elements of a reference.

Each triangle of the parts that scatter is cut into equal ones, whose sides are no longer than a length. Irradiance is
that of the stage's own shader, shadows and relief included, at each centroid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.reference.surface_sum import Elements
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Mesh, Part, Scene, unit

MOST = 1 << 21  # triangles
WIDER = 1.25  # ratio of lengths that are tried until there are no more


def whole_elements(stage: Stage, scene: Scene, *lengths: float) -> list[Elements]:
    """Return the surface, in view space, of the scene that a stage has drawn, once for each length.

    Args:
        stage: that has drawn the scene.
        scene: whose parts are meant; they must not lie inside each other.
        lengths: of sides [mm], at most, unless there were more than `MOST` triangles.
    """
    parts, view = [part for part in scene.parts if part.is_translucent], scene.camera.view()
    longest = [_bounded(parts, length) for length in lengths]
    cut = [[_cut(part.mesh, length) for part in parts] for length in longest]
    meshes = [(part, mesh) for pieces in cut for part, (mesh, _) in zip(parts, pieces, strict=True)]
    light = iter(stage.irradiance(meshes))
    found = []
    for pieces in cut:
        points = np.concatenate([mesh.position for mesh, _ in pieces]) @ view[:3, :3].T + view[:3, 3]
        sides = np.concatenate([sides for _, sides in pieces], axis=1) @ view[:3, :3].T
        found.append(Elements.of_triangles(points, sides, np.concatenate([next(light) for _ in pieces])))
    return found


def _bounded(parts: Sequence[Part], length: float) -> float:
    """Return a length, or a larger one, of which there are at most `MOST` triangles."""
    while sum(int(np.sum(_cuts(part.mesh, length) ** 2)) for part in parts) > MOST:
        length *= WIDER
    return length


def _corners(values: Floats, mesh: Mesh) -> Sequence[Floats]:
    return [values[mesh.triangles[:, corner]] for corner in range(3)]


def _cuts(mesh: Mesh, length: float) -> Floats:
    """Return into how many parts each side of each triangle is cut (n,)."""
    a, b, c = _corners(mesh.position, mesh)
    longest = np.max([np.linalg.norm(one - other, axis=1) for one, other in ((a, b), (b, c), (c, a))], axis=0)
    return np.maximum(np.ceil(longest / length), 1.0)


def _cut(mesh: Mesh, length: float) -> tuple[Mesh, Floats]:
    """Return centroids of the cut triangles as vertices, and two sides (2, n, 3) of each."""
    cuts = _cuts(mesh, length).astype(int)
    parts = cuts**2
    of = np.repeat(np.arange(len(cuts)), parts)
    number = np.arange(of.size) - np.repeat(np.cumsum(parts) - parts, parts)
    # Row r of a triangle has 2 r + 1 pieces, every other of which is turned over.
    row = np.floor(np.sqrt(number)).astype(int)
    row -= row**2 > number
    row += (row + 1) ** 2 <= number
    place = number - row**2
    turned = place % 2 == 1
    column = place // 2
    # Shares of the corners: a at the top, from which rows go down; b, then c along a row.
    share_c = (column + np.where(turned, 2.0 / 3.0, 1.0 / 3.0)) / cuts[of]
    down = (row + np.where(turned, 1.0 / 3.0, 2.0 / 3.0)) / cuts[of]
    shares = np.stack([1.0 - down, down - share_c, share_c], axis=1)

    def mean(values: Floats) -> Floats:
        first, second, third = (corner[of] for corner in _corners(values, mesh))
        return np.asarray(shares[:, :1] * first + shares[:, 1:2] * second + shares[:, 2:] * third)

    a, b, c = _corners(mesh.position, mesh)
    sign = np.where(turned, -1.0, 1.0) / cuts[of]
    sides = np.stack([sign[:, None] * (b - a)[of], sign[:, None] * (c - a)[of]])
    tangent, tint = (None if values is None else mean(values) for values in (mesh.tangent, mesh.tint))
    return Mesh(mean(mesh.position), unit(mean(mesh.normal)), mean(mesh.uv), mesh.triangles, tangent, tint), sides
