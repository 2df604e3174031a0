"""Picture that a render is judged by: a view of the head, the exact answer, two measures of error."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path

import flip_evaluator
import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from profilefit.scenes.skin.scene import FACE, Head, head_scene
from profilefit.scenes.stage import surface
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.judge import EXPOSURE, Judge
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.surface import UNKNOWN, TruthError, exitance_of, own_error
from profilefit.scenes.stage.world import Buffers, Rgb

Floats = NDArray[np.float64]
# Brow, nose, its shadow, freckles and the band before it: 60 mm of the head, so that of 192 rows one shows 0.29 mm, and
# the shortest mean free path is 2.2 pixels: below two the stage fades to Lambert, which the truth does not.
CLOSE = replace(FACE, target=(14.0, 24.0, 50.0), height=60.0)
REFERENCE = Path(surface.__file__)  # a kept answer is that of another code if this file has changed


@dataclass(frozen=True, kw_only=True)
class Judged(Judge):
    """Stage that has drawn the view, mean free paths [mm], and the exact answer."""

    stage: Stage
    mfp: Rgb

    @property
    def own_error(self) -> TruthError | None:
        """Error of the exact answer, None if not measured."""
        return None if self.truth_error is UNKNOWN else self.truth_error

    def flip(self, exitance: NDArray[np.floating]) -> float:
        """Return the mean of FLIP over the translucent pixels (Andersson et al. 2020) [0, 1], at 67 pixels a degree."""
        pair = (np.ascontiguousarray(shown(image), np.float32) for image in (self.reference, exitance))
        difference, _, _ = flip_evaluator.evaluate(*pair, "LDR", applyMagma=False)
        return float(np.mean(difference[::-1][self.mask]))  # `shown` has row 0 at the top


@contextmanager
def judged(
    context: moderngl.Context,
    size: tuple[int, int],
    kept: Path | None,
    quick: bool,
    scene: Head | None = None,
    scale: float = 1.0,
    setting: Setting = DIFFUSE,
) -> Iterator[Judged]:
    """Return a view at a size [pixels]. The reference takes minutes: `kept` is where it lies, or will.

    quick  leaves out the error of the reference itself;  scene  the close view, if none
    scale  mean free paths over those of the material, for a head of 1 / scale its size [-]
    setting  of the exact answer
    """
    scene = scene or head_scene(camera=CLOSE)
    red, green, blue = scene.material.mfp
    mfp = scale * red, scale * green, scale * blue
    with Stage(context, size) as stage:
        stage.draw(scene)
        buffers = stage.buffers()
        error = UNKNOWN if quick else _own_error(context, scene, mfp, setting, size)
        truth = _kept(kept, buffers, mfp, setting)
        yield Judged(truth, buffers.mask > 0.5, error, stage=stage, mfp=mfp)


def shown(exitance: NDArray[np.floating]) -> Floats:
    """Return sRGB in [0, 1] of the radiance, row 0 at the top."""
    linear = np.clip(EXPOSURE / np.pi * np.asarray(exitance, float)[::-1], 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)  # IEC 61966-2-1


def _kept(path: Path | None, buffers: Buffers, mfp: Rgb, setting: Setting) -> Floats:
    seen_by = (
        *(np.asarray(getattr(buffers, field.name)).tobytes() for field in fields(buffers)),
        np.array(mfp).tobytes(),
        str(setting).encode(),
    )
    digest = hashlib.sha256(b"".join((REFERENCE.read_bytes(), *seen_by))).hexdigest()
    if path is not None and path.exists():
        with np.load(path) as content:
            if str(content["digest"]) == digest:
                return content["truth"]
    truth = exitance_of(buffers, mfp, setting)
    if path is not None:
        np.savez_compressed(path, truth=truth, digest=digest)
    return truth


def _own_error(context: moderngl.Context, scene: Head, mfp: Rgb, setting: Setting, size: tuple[int, int]) -> TruthError:
    with Stage(context, (2 * size[0], 2 * size[1])) as fine:
        fine.draw(scene)
        return own_error(fine.buffers(), mfp, setting)
