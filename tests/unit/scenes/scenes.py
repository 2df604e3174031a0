"""Small scenes: balls under one light."""

from dataclasses import replace

import numpy as np

from profilefit.scenes.skin import material
from profilefit.scenes.stage import head
from profilefit.scenes.stage.world import Camera, Light, Part, Scene, parameters, sheet

RADIUS = 10.0


def ball(centre=(0.0, 0.0, 0.0), radius=RADIUS):
    u, v = parameters(60, 90)
    mesh = sheet(radius * head.ball(u, v), u, v, closed=True)
    return Part(replace(mesh, position=mesh.position + np.array(centre)), material.plain((0.8, 0.5, 0.3)))


def scene(direction, *parts, kind="orthographic"):
    camera = Camera(eye=(0.0, 0.0, 100.0), height=30.0, kind=kind)
    light = Light(direction, (1.0, 1.0, 1.0))
    return Scene(parts or (ball(),), light, (0.1, 0.1, 0.1), camera)
