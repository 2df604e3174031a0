"""What is rendered: parts of a mesh and a texture, one light far away, a little light from everywhere, and a camera."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from profilefit.errors import InputError
from profilefit.scenes.skin import head, texture
from profilefit.scenes.skin.material import Rgb, Translucent, translucent
from profilefit.scenes.stage.camera import Camera
from profilefit.scenes.stage.mesh import Mesh


@dataclass(frozen=True)
class Part:
    """A mesh with its reflectance A (rows, columns, 3) over u and v, and its GGX roughness [-].

    is_translucent  light scatters inside; else it is Lambert's
    """

    mesh: Mesh
    reflectance: NDArray[np.float32]
    roughness: float = 0.42
    is_translucent: bool = True


@dataclass(frozen=True)
class Light:
    """direction to the light, in the world; irradiance of a surface that faces it [-], in the picture's unit."""

    direction: tuple[float, float, float] = (-0.90, 0.26, 0.36)
    irradiance: Rgb = (3.6, 3.4, 3.1)


@dataclass(frozen=True)
class Scene:
    """ambient irradiance [-] comes from everywhere, without shadows; f0 is what the surface mirrors head-on [-]."""

    parts: tuple[Part, ...]
    material: Translucent
    light: Light = field(default_factory=Light)
    ambient: Rgb = (0.16, 0.18, 0.21)
    camera: Camera = field(default_factory=Camera)
    f0: float = 0.028  # of skin, n = 1.4

    def zoomed(self, height: float) -> Scene:
        """The same seen by a camera that shows `height` [mm] at its target."""
        return replace(self, camera=replace(self.camera, height=height))


FACE = Camera(eye=(-95.0, 20.0, 690.0), target=(0.0, -6.0, 0.0), height=290.0)


def head_scene(material: str = "skin1", camera: Camera = FACE, detail: int = 1, columns: int = 2048) -> Scene:
    """A head under grazing light with a thin band before it; all of one material, freckles and stubble on the face.

    detail  of the meshes, a whole number >= 1;  columns  of the skin's texture
    """
    if detail < 1:
        raise InputError(f"detail must be a whole number >= 1, got {detail!r}")
    what = translucent(material)
    face = texture.skin(what.reflectance, columns)
    plain = texture.plain(what.reflectance)
    pale = texture.plain(np.minimum(np.multiply(what.reflectance, (1.2, 1.5, 1.8)), 0.9))
    parts = (
        Part(head.head(detail), face),
        Part(head.ear(-1, detail), plain),
        Part(head.ear(1, detail), plain),
        Part(head.neck(detail), plain),
        Part(head.band(detail), pale, roughness=0.6),
    )
    return Scene(parts, what, camera=camera)
