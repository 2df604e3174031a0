"""Needs of a scene under the sea: terms of the water's light, a splat, steps to a hit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.sea.caustics import focus, splat_for
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE, sunlit_haze
from profilefit.scenes.sea.passes import axes, reach_of
from profilefit.scenes.sea.scene import SPLATS, SeaRequest
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import FINE, refracted
from profilefit.studies.stability.sea import LIMITS

Floats = NDArray[np.float64]
CHEAPER = (SINGLE, SCALED)  # than what they are held against, the cheapest first
TOLERANCE = 0.1  # of the haze; a file says none
STEPS = (0, 8, 16)  # before three of Newton's iterations, which without steps are plain ones from the mean plane
HELD = {0: LIMITS["newton"], 8: LIMITS[8], 16: LIMITS[16]}


@dataclass(frozen=True)
class SeaNeed:
    """The numbers that the answers rest on [-].

    haze         how far each of `CHEAPER` is off the broadened haze, in the worst colour and direction
    focus        F of the floor: light folds before it from 1 on
    light, view  S of the steepest ray of sun, and of the picture, that meets the floor
    """

    haze: Mapping[str, float]
    focus: float
    light: float
    view: float
    tolerance: float = TOLERANCE

    @property
    def terms(self) -> str:
        """The cheapest of `haze.KINDS` within the tolerance."""
        return next((kind for kind in CHEAPER if self.haze[kind] <= self.tolerance), BROADENED)

    @property
    def splat(self) -> str:
        """Splat by its name in a file."""
        return next(name for name, one in SPLATS.items() if one is splat_for(self.focus))

    @property
    def light_steps(self) -> int:
        return steps_for(self.light)

    @property
    def view_steps(self) -> int:
        return steps_for(self.view)


def steps_for(steepness: float) -> int:
    """Return the fewest of `STEPS` that are held to be right at S [-]."""
    return next((one for one in STEPS if steepness < HELD[one]), STEPS[-1])


def sea_need(of: SeaRequest) -> SeaNeed:
    """Return what a scene needs, by closed forms: nothing is drawn."""
    world = of.world
    return SeaNeed(
        haze=_haze(of, world),
        focus=focus(world.sea, world.depth, world.n, world.tilt),
        light=world.floor.steepest * steepest_ray(world),
        view=world.floor.steepest * _steepest_view(of, world),
    )


def steepest_ray(world: World) -> float:
    """Return tangent to the vertical of the sun's steepest ray below the waves [-]."""
    x = np.arange(FINE) * world.sea.tile / FINE
    _, *slope = world.sea.lattice(x, x)
    along, across, flux = refracted(world.tilt, (slope[0], slope[1]), world.n)
    return float(np.max(np.where(flux > 0, np.hypot(along, across), 0.0)))


def _haze(of: SeaRequest, world: World) -> dict[str, float]:
    """Return the worst errors of the haze toward the picture's middle and corners, below a level sea and a calm ray."""
    depth = -of.camera.eye[2] * world.slant
    worst = dict.fromkeys(CHEAPER, 0.0)
    for view in _views(of):
        cosine = float(view @ world.beam)
        for c, omega in zip(world.c.tolist(), world.omega.tolist(), strict=True):
            broadened = sunlit_haze(omega, c * depth, cosine, world.lobes, BROADENED)
            for kind in CHEAPER if broadened > 0 else ():
                error = abs(sunlit_haze(omega, c * depth, cosine, world.lobes, kind) / broadened - 1.0)
                worst[kind] = max(worst[kind], error)
    return worst


def _views(of: SeaRequest) -> Floats:
    """Return unit vectors (5, 3) to the middle of the picture and to its corners."""
    right, up, forward = axes(of.camera, of.size)
    sides = ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
    views = np.array([forward + x * right + y * up for x, y in sides])
    return np.asarray(views / np.linalg.norm(views, axis=1, keepdims=True))


def _steepest_view(of: SeaRequest, world: World) -> float:
    """Return tangent to the vertical of the steepest view that meets the floor no farther away than one sees [-]."""
    down = -_views(of)[:, 2]
    above = of.camera.eye[2] - world.floor.mean
    least = max(above / reach_of(world), float(np.min(down)))  # cosine; the least of a picture is at a corner
    return float(np.sqrt(max(1.0 / least**2 - 1.0, 0.0)))
