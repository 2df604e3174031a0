"""Needs of scenes: an atlas by what the screen misses, terms, splat and steps of a sea, layers of fur."""

import copy

import numpy as np
import pytest

from mcml_sim.files.whole_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.fur import scene as fur
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, error_of, trial
from profilefit.scenes.heart import meshes
from profilefit.scenes.heart import scene as heart
from profilefit.scenes.sea import scene as sea
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE, sunlit_haze
from profilefit.scenes.sea.waves import refracted
from profilefit.scenes.stage.reference.surface import sees
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Part, Scene
from profilefit.studies.choose import scenes
from profilefit.studies.choose.scenes import RandomFur, atlas_need, fur_need, sea_need, steepest_ray
from tests.fixtures import CLEAR_SEA, refused

HEART, SEA = read_toml(shipped("examples") / "heart.toml"), CLEAR_SEA
FUR = {"scene": "fur", "fur": {"density": 0.64, "radius": 0.5, "length": 10.0}, "technique": {}}


def request(module, example, **changes):
    """An example with other values: water_b=..."""
    told = copy.deepcopy(example)
    for name, value in changes.items():
        table, _, key = name.partition("_")
        told[table][key] = value
    return module.read(f"{told['scene']}.toml", told)


def bumps(eye: float, lamp: float, **technique):
    """A steep sheet, eye and lamp turned by angles about the upright [degrees]."""

    def towards(degrees: float) -> list[float]:
        return [float(np.sin(np.radians(degrees))), 0.0, float(np.cos(np.radians(degrees)))]

    surface, dark = {"kind": "bumps", "size": 8.0, "steepness": 0.3}, [0.0, 0.0, 0.0]
    camera, light = {"resolution": [96, 72], "direction": towards(eye)}, {"direction": towards(lamp), "ambient": dark}
    told = {"surface": surface, "technique": technique, "camera": camera, "light": light}
    return heart.read("bumps.toml", {"scene": "heart", "layers": HEART["layers"], **told})


@pytest.mark.slow
def test_no_atlas_where_all_is_seen_and_one_where_lit_walls_are_hidden(context):
    found = atlas_need(context, bumps(0.0, 30.0))
    assert found.hidden < 1e-5
    # Pixels of a third of a millimetre are coarse; by the file's own tolerance.
    assert (found.is_broken, found.verdict) == (True, "no atlas")
    assert not atlas_need(context, bumps(0.0, 30.0, tolerance=0.05)).is_broken
    found = atlas_need(context, bumps(55.0, -55.0))
    assert found.error > found.hidden > 0.05
    assert found.verdict == "atlas"


def test_an_atlas_for_what_is_hidden_only():
    for error, hidden, verdict in ((0.03, 0.02, "atlas"), (0.03, 0.004, "no atlas"), (0.019, 0.018, "no atlas")):
        assert scenes.AtlasNeed(error, hidden, 0.02).verdict == verdict


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
def test_a_ball_shows_the_half_before_its_outline(context, kind):
    part = Part(meshes.ball(8.0), np.ones((1, 1, 3), np.float32))
    camera = Camera((30.0, 0.0, 40.0), height=20.0, kind=kind)
    points = np.random.default_rng(1).standard_normal((4000, 3))
    points *= 8.0 / np.linalg.norm(points, axis=1, keepdims=True)
    with Stage(context, (128, 128), 64) as stage:
        stage.draw(Scene((part,), camera=camera))
        found = sees(stage.buffers(), camera, points)
    height = points @ (0.6, 0.0, 0.8)
    outline = 64.0 / 50.0 if kind == "perspective" else 0.0
    clear = np.abs(height - outline) > 1.0
    assert np.mean(found[clear] != (height[clear] > outline)) < 0.003


@pytest.mark.parametrize(("b", "terms"), [(0.0, SINGLE), (0.005, SINGLE), (0.03, SCALED), (0.1, BROADENED)])
def test_terms_by_what_is_scattered(b, terms):
    need = sea_need(request(sea, SEA, water_b=[b] * 3))
    assert need.terms == terms
    assert need.haze[SCALED] <= need.haze[SINGLE]


def test_an_error_is_that_of_the_haze():
    """A view of a picture as small as a point, of water that is the same in all colours."""
    small = {"camera_angle": 1e-6, "light_direction": [0.0, 0.0, 1.0]}
    need = sea_need(request(sea, SEA, water_a=[0.1] * 3, water_b=[0.1] * 3, **small))
    of = request(sea, SEA)
    along = np.subtract(of.camera.target, of.camera.eye)
    given = 0.5, 0.2 * -of.camera.eye[2], -along[2] / np.linalg.norm(along), of.water.lobes
    single, broadened = (sunlit_haze(*given, kind) for kind in (SINGLE, BROADENED))
    assert need.haze[SINGLE] == pytest.approx(1 - single / broadened, rel=1e-4)


def test_a_calm_sea_and_a_level_floor_need_the_least():
    need = sea_need(request(sea, SEA, sea_slope=0, floor_slope=0))
    assert (need.splat, need.focus, need.light_steps, need.view_steps) == ("faces", 0.0, 0, 0)
    assert sea_need(request(sea, SEA, sea_slope=0.03)).splat == "faces"
    assert sea_need(request(sea, SEA, sea_slope=0.2)).splat == "cells"


def test_steps_by_the_steepest_ray():
    """Of the floor's slope times a tangent, which waves add to; views down meet it at less than those to the side."""
    world = request(sea, SEA).world
    calm = world.calm[0]
    assert calm < steepest_ray(world) < 3.0 * calm
    assert steepest_ray(request(sea, SEA, sea_slope=0).world) == pytest.approx(calm)
    x = np.linspace(0.0, 5.0, 173)
    _, *slope = world.sea.lattice(x, x)
    along, across, _ = refracted(world.tilt, slope, world.n)
    assert np.max(np.hypot(along, across)) <= 1.01 * steepest_ray(world)
    down = sea_need(request(sea, SEA, camera_target=[5.9, 2.5, -3.0], camera_angle=0.2))
    assert down.view < sea_need(request(sea, SEA)).view
    assert down.view_steps == 0
    steep = sea_need(request(sea, SEA, floor_slope=1.0, floor_depth=8.0))
    assert steep.light == pytest.approx(request(sea, SEA, floor_slope=1.0).world.floor.steepest * steepest_ray(world))
    assert (steep.light_steps, steep.view_steps) == (8, 16)


def test_limits_and_the_tolerance_are_met_when_they_are_reached():
    assert [scenes.steps_for(steep) for steep in (0.0, 0.99, 1.0, 2.99, 3.0, 100.0)] == [0, 0, 8, 8, 16, 16]
    haze = {SINGLE: 0.2, SCALED: 0.1}
    assert scenes.SeaNeed(haze, 0.0, 0.0, 0.0).terms == SCALED
    assert scenes.SeaNeed(haze, 0.0, 0.0, 0.0, tolerance=0.2).terms == SINGLE
    assert scenes.SeaNeed(haze, 0.0, 0.0, 0.0, tolerance=0.01).terms == BROADENED


def test_water_that_no_light_comes_through():
    eye, target = [6.0, 2.5, -800.0], [0.0, 2.5, -801.0]
    need = sea_need(request(sea, SEA, water_a=[100.0] * 3, floor_depth=900.0, camera_eye=eye, camera_target=target))
    assert need.terms == SINGLE


@pytest.mark.parametrize(("degrees", "tolerance", "way"), [(45.0, 0.05, SWEPT), (60.0, 0.08, SWEPT_TWO)])
def test_layers_hold_for_other_rays_and_few_less_would_not(degrees, tolerance, way):
    looked = RandomFur(0.16, 1.0, 20.0, float(np.radians(degrees)))
    layers = looked.least_layers(way, tolerance)
    seeds = range(9000, 9008)
    others = [trial(random_patch(0.16, 1.0, 20.0, looked.side, seed), looked.theta, 2500, seed) for seed in seeds]
    assert error_of(others, way, layers) <= tolerance
    assert error_of(others, way, int(0.7 * layers)) > tolerance


def test_what_is_held_to_a_tolerance_is_above_the_mean():
    """By its noise; and of more than any is there are no layers."""
    looked = RandomFur(0.16, 1.0, 20.0, float(np.radians(45.0)))
    found = looked.largest(SWEPT, 11, 0.05**2)
    mean = np.mean([one.error(SWEPT, 11) ** 2 for one in looked._made])
    assert mean < found < 1.5 * mean
    assert looked.least_layers(QUADRATIC, 0.05) is None


def test_a_patch_is_wider_than_a_rays_way():
    for degrees, length in ((0.0, 20.0), (60.0, 20.0), (85.0, 40.0)):
        looked = RandomFur(0.16, 1.0, length, float(np.radians(degrees)))
        assert looked.side >= 1.2 * length * np.tan(looked.theta) or 0.16 * looked.side**2 >= scenes.MOST_STRANDS - 1
        assert 0.16 * looked.side**2 >= scenes.STRANDS - 1e-9


@pytest.mark.slow
def test_more_layers_at_an_angle_and_of_longer_strands(monkeypatch):
    """Head-on the nearest strand is the highest: one slab is enough."""
    for name, value in {"RAYS": 200, "PATCHES": 12, "MOST": 32}.items():  # a tenth of the rays, an eighth of the layers
        monkeypatch.setattr(scenes, name, value)
    of = {"technique_tolerance": 0.08}
    need = fur_need(request(fur, FUR, **of), (0, 45, 75))
    swept = [need.layers[angle][SWEPT.name] for angle in (0, 45, 75)]
    assert swept[0] == 1
    assert swept == sorted(swept)
    assert need.layers[75][LINEAR.name] is None
    assert need.layers[45][SWEPT_TWO.name] < swept[1]
    shorter = fur_need(request(fur, FUR, fur_length=5.0, **of), (75,))
    assert shorter.layers[75][SWEPT.name] < swept[2]
    assert need.way in (SWEPT, SWEPT_TWO)
    assert need.count == need.layers[75][need.way.name]
    assert fur_need(request(fur, FUR, **of), (75,)).layers[75] == need.layers[75]


def test_the_cheapest_is_by_the_cost_of_a_layer(monkeypatch):
    layers = {"linear": 40, "quadratic": None, "fitted": None, "swept": 10, "swept, two strands": 8}
    assert scenes.cheapest(layers) == SWEPT
    assert scenes.cheapest({**layers, "swept, two strands": 5}) == SWEPT_TWO
    assert scenes.cheapest({**layers, "linear": 14}) == LINEAR
    assert scenes.cheapest(dict.fromkeys(layers)) is None
    need = scenes.FurNeed({75: dict.fromkeys(layers)}, 0.05)
    assert (need.way, need.count) == (None, None)
    monkeypatch.setattr(scenes, "COST", {0: 1.0, 1: 1.5, 2: 1.6})
    assert scenes.cheapest(layers) == SWEPT_TWO


@pytest.mark.parametrize(
    ("changes", "accepted", "got"),
    [
        ({"technique_tolerance": 0.005}, "[technique] tolerance must be at least 0.01", "0.005"),
        ({"fur_length": 130.0}, "[fur] length must be at most 100 times the strands' mean distance, 125 mm,", "130"),
    ],
)
def test_what_rays_do_not_tell(changes, accepted, got):
    message = f"fur.toml: {accepted} where layers are chosen by rays, got {got}"
    assert refused("^fur", fur_need, request(fur, FUR, **changes)) == message
