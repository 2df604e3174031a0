"""How near the camera must be for a thing to cover a share of the screen."""

from __future__ import annotations

import moderngl
import numpy as np

from profilefit.errors import InputError
from profilefit.shader.stage.scene import Scene
from profilefit.shader.stage.stage import Stage

ROWS = 270  # of the picture that is searched with
STEPS = 12  # of the bisection: the height to 1 in 4000
SPAN = 0.05, 8.0  # heights tried, in those of the scene's camera
TOLERANCE = 0.01


def covering(context: moderngl.Context, scene: Scene, share: float, size: tuple[int, int] = (1920, 1080)) -> Scene:
    """The scene zoomed so that translucent pixels are this share of the screen, to 1 %; size only as a shape."""
    if not 0 < share < 1:
        raise InputError(f"share must be in (0, 1), got {share!r}")
    columns = round(ROWS * size[0] / size[1])
    near, far = (factor * scene.camera.height for factor in SPAN)
    with Stage(context, (columns, ROWS), shadow_side=16) as stage:
        for _ in range(STEPS):
            middle = np.sqrt(near * far)
            is_covered = covered(stage, scene.zoomed(middle)) > share
            near, far = (middle, far) if is_covered else (near, middle)
        found = scene.zoomed(float(np.sqrt(near * far)))
        reached = covered(stage, found)
    if abs(reached - share) > TOLERANCE:
        raise InputError(f"share must be one that the scene can cover by zooming, got {share!r}: {reached:.3f} is near")
    return found


def covered(stage: Stage, scene: Scene) -> float:
    """Share of the stage's pixels that are translucent [-]."""
    stage.draw(scene)
    return float(np.mean(stage.buffers().mask > 0.5))
