"""Small scenes, balls under one light; scenes' files with one thing changed; and what is refused."""

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from profilefit.scenes.skin import material
from profilefit.scenes.stage.subject import head
from profilefit.scenes.stage.world import Camera, Light, Part, Scene, parameters, sheet
from tests.fixtures import refused

RADIUS = 10.0


def ball(centre=(0.0, 0.0, 0.0), radius=RADIUS):
    u, v = parameters(60, 90)
    mesh = sheet(radius * head.ball(u, v), u, v, closed=True)
    return Part(replace(mesh, position=mesh.position + np.array(centre)), material.plain((0.8, 0.5, 0.3)))


def scene(direction, *parts, kind="orthographic"):
    camera = Camera(eye=(0.0, 0.0, 100.0), height=30.0, kind=kind)
    light = Light(direction, (1.0, 1.0, 1.0))
    return Scene(parts or (ball(),), light, (0.1, 0.1, 0.1), camera)


def outward(mesh):
    """Share of a mesh's triangles, but for those at a pole, that turn as their normals."""
    a, b, c = (mesh.position[mesh.triangles[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    agree = np.einsum("ij,ij->i", face, mesh.normal[mesh.triangles[:, 0]])
    return np.mean(agree[np.linalg.norm(face, axis=1) > 1e-6] > 0)


def changed(example: dict[str, Any], place: str = "", value: Any = None) -> dict[str, Any]:
    """A copy, with another value at a dotted place, lists counted from 1; None takes what is there away."""
    found = deepcopy(example)
    if place:
        *above, last = place.split(".")
        part = found
        for name in above:
            part = part[int(name) - 1 if isinstance(part, list) else name]
        if value is None:
            del part[last]
        else:
            part[last] = value
    return found


def refusals(call, *cases):
    """A test that a call, in which all it takes is named, refuses each of these changes, by the message beside it."""

    @pytest.mark.parametrize(("given", "message"), cases)
    def test(given, message):
        refused(message, call, **given)

    return test


def mistaken(read, file: str, content: dict[str, Any], message: str) -> None:
    """Content that is refused in one line, which begins with the file's name."""
    assert refused(message, read, file, content).startswith(f"{file}: ")
