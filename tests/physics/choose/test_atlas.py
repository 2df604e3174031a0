"""Whether a scene needs an atlas: what the screen sees, what it misses, and the verdict that comes of it."""

import numpy as np
import pytest

from mcml_sim.files.text_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.heart import meshes, scene
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.surface import sees
from profilefit.scenes.stage.world import Camera, Part, Scene
from profilefit.studies.choose.atlas import AtlasNeed, atlas_need

EXAMPLE = read_toml(shipped("examples") / "heart.toml")


def bumps(eye: float, lamp: float, **technique):
    """A steep sheet, eye and lamp turned by angles about the upright [degrees]."""

    def towards(degrees: float) -> list[float]:
        return [float(np.sin(np.radians(degrees))), 0.0, float(np.cos(np.radians(degrees)))]

    told = {
        "scene": "heart",
        "layers": EXAMPLE["layers"],
        "surface": {"kind": "bumps", "size": 8.0, "steepness": 0.3},
        "technique": technique,
        "camera": {"resolution": [96, 72], "direction": towards(eye)},
        "light": {"direction": towards(lamp), "ambient": [0.0, 0.0, 0.0]},
    }
    return scene.read("bumps.toml", told)


@pytest.mark.slow
def test_no_atlas_where_all_is_seen(context):
    found = atlas_need(context, bumps(0.0, 30.0))
    assert found.hidden < 1e-5
    # Pixels of a third of a millimetre are coarse; by the file's own tolerance.
    assert (found.is_broken, found.verdict) == (True, "no atlas")
    assert not atlas_need(context, bumps(0.0, 30.0, tolerance=0.05)).is_broken


@pytest.mark.slow
def test_an_atlas_where_lit_walls_are_hidden(context):
    found = atlas_need(context, bumps(55.0, -55.0))
    assert found.error > found.hidden > 0.05
    assert found.verdict == "atlas"


@pytest.mark.parametrize(
    ("error", "hidden", "verdict"),
    [(0.03, 0.02, "atlas"), (0.03, 0.004, "no atlas"), (0.019, 0.018, "no atlas")],
)
def test_an_atlas_for_what_is_hidden_only(error, hidden, verdict):
    assert AtlasNeed(error, hidden, 0.02).verdict == verdict


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
def test_a_ball_shows_the_half_before_its_outline(context, kind):
    part = Part(meshes.ball(8.0), np.ones((1, 1, 3), np.float32))
    camera = Camera((30.0, 0.0, 40.0), height=20.0, kind=kind)
    random = np.random.default_rng(1)
    points = random.standard_normal((4000, 3))
    points *= 8.0 / np.linalg.norm(points, axis=1, keepdims=True)
    with Stage(context, (128, 128), 64) as stage:
        stage.draw(Scene((part,), camera=camera))
        found = sees(stage.buffers(), camera, points)
    height = points @ (0.6, 0.0, 0.8)
    outline = 64.0 / 50.0 if kind == "perspective" else 0.0
    clear = np.abs(height - outline) > 1.0
    assert np.mean(found[clear] != (height[clear] > outline)) < 0.003
