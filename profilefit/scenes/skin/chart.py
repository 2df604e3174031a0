"""Cost of the head over the share of the screen that it covers: table 2 of Liang et al."""

from __future__ import annotations

from typing import TypeVar

import moderngl
import numpy as np

from mcml_sim.media.arrays import require
from profilefit.errors import InputError
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import INSIDE, Scene

ROWS = 270  # of the picture that is searched with
STEPS = 12  # of the bisection: the height to 1 in 4000
SPAN = 0.05, 8.0  # heights tried, in those of the scene's camera
TOLERANCE = 0.01
Zoomed = TypeVar("Zoomed", bound=Scene)


def covering(context: moderngl.Context, scene: Zoomed, share: float, size: tuple[int, int] = (1920, 1080)) -> Zoomed:
    """Return the scene zoomed so that translucent pixels are this share of the screen, to 1 %.

    Args:
        context: of OpenGL.
        scene: whose camera is zoomed.
        share: of the screen, in (0, 1) [-].
        size: columns and rows of the screen, of which only the ratio counts.
    """
    require(0 < share < 1, "share", "in (0, 1)", share)
    columns = round(ROWS * size[0] / size[1])
    near, far = (factor * scene.camera.height for factor in SPAN)
    with Stage(context, (columns, ROWS), shadow_side=16) as stage:
        for _ in range(STEPS):
            middle = np.sqrt(near * far)
            is_covered = covered(stage, scene.zoomed(middle)) > share
            near, far = (middle, far) if is_covered else (near, middle)
        zoomed = scene.zoomed(float(np.sqrt(near * far)))
        reached = covered(stage, zoomed)
    if abs(reached - share) > TOLERANCE:
        raise InputError(f"share must be one that the scene can cover by zooming, got {share!r}: {reached:.3f} is near")
    return zoomed


def covered(stage: Stage, scene: Scene) -> float:
    """Draw a scene, and return the share of the stage's pixels that are translucent [-]."""
    stage.draw(scene)
    return float(np.mean(stage.buffers().mask > INSIDE))
