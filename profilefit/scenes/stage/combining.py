"""Pass 4: what scattered, what the surface mirrors and what shines through, as radiance; and as a picture."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.skin.scene import Scene
from profilefit.scenes.skin.separable_kernel import Separable, transmitted_text
from profilefit.scenes.stage.buffers import FullScreen, Targets
from profilefit.scenes.stage.camera import unit
from profilefit.scenes.stage.exact_law import ExactLaw
from profilefit.scenes.stage.scattering import LAW, View, name_of, tables_of, text_of
from profilefit.shader.emit import stage_text

Floats = NDArray[np.float64]


class Combining:
    """The last pass, with a law for the light that shines through."""

    def __init__(self, context: moderngl.Context, law: ProfileLaw | ExactLaw | Separable):
        text = transmitted_text(LAW) if isinstance(law, Separable) else text_of(law)
        name = "separable" if isinstance(law, Separable) else name_of(law)
        self._pass = FullScreen(context, f"combine {name}", f"#version 330\n{text}\n{stage_text('combine.frag')}")
        self.name, self.milliseconds = self._pass.name, self._pass.milliseconds
        self._tables = tables_of(context, law)

    def run(self, targets: Targets, view: View, scene: Scene | None, mfp: Floats, fixed_alpha: Floats) -> None:
        """Without a scene there is no light to mirror or to shine through."""
        values = {
            **view.values(),
            "mfp": tuple(mfp),
            "fixed_alpha": tuple(fixed_alpha),
            **_lit(scene),
        }
        textures = {**targets.maps, "exitance_map": targets.exitance, **self._tables}
        self._pass.run(targets.into[targets.radiance], textures, values)

    def release(self) -> None:
        self._pass.release()
        for table in self._tables.values():
            table.release()


def _lit(scene: Scene | None) -> dict[str, object]:
    if scene is None:
        return {"toward_light": (0.0, 0.0, 1.0), "light": (0.0, 0.0, 0.0), "f0": 0.0}
    toward = scene.camera.view()[:3, :3] @ unit(scene.light.direction)
    return {"toward_light": tuple(toward), "light": scene.light.irradiance, "f0": scene.f0}


def to_srgb(image: ArrayLike, exposure: float = 1.0) -> NDArray[np.uint8]:
    """Linear (h, w, 3) times `exposure`, as 8-bit values for a screen (IEC 61966-2-1); same order of rows."""
    if not exposure > 0:
        raise InputError(f"exposure must be a factor > 0, got {exposure!r}")
    return np.round(srgb_codes(np.asarray(image, float) * exposure)).astype(np.uint8)


def srgb_codes(linear: ArrayLike) -> Floats:
    """Values of a screen [8-bit steps, 0 to 255] for linear ones, white 1, not rounded: fractions of a step count."""
    clipped = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return 255.0 * np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
