"""What a scene under the sea needs: by terms, splat and steps, each where its number says so."""

import copy

import numpy as np
import pytest

from mcml_sim.files.text_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.sea import scene
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE, sunlit_haze
from profilefit.scenes.sea.waves import refracted
from profilefit.studies.choose.sea import SeaNeed, sea_need, steepest_ray, steps_for

EXAMPLE = read_toml(shipped("examples") / "sea.toml")


def request(**changes):
    """The example, with other values: water_b=..."""
    told = copy.deepcopy(EXAMPLE)
    for name, value in changes.items():
        table, _, key = name.partition("_")
        told[table][key] = value
    return scene.read("sea.toml", told)


@pytest.mark.parametrize(("b", "terms"), [(0.0, SINGLE), (0.005, SINGLE), (0.03, SCALED), (0.1, BROADENED)])
def test_terms_by_what_is_scattered(b, terms):
    need = sea_need(request(water_b=[b] * 3))
    assert need.terms == terms
    assert need.haze[SCALED] <= need.haze[SINGLE]


def test_an_error_is_that_of_the_haze():
    """A view of a picture as small as a point, of water that is the same in all colours."""
    need = sea_need(request(water_a=[0.1] * 3, water_b=[0.1] * 3, camera_angle=1e-6, light_direction=[0.0, 0.0, 1.0]))
    of = request()
    along = np.subtract(of.camera.target, of.camera.eye)
    found = [
        sunlit_haze(0.5, 0.2 * -of.camera.eye[2], -along[2] / np.linalg.norm(along), of.water.lobes, kind)
        for kind in (SINGLE, BROADENED)
    ]
    assert need.haze[SINGLE] == pytest.approx(1 - found[0] / found[1], rel=1e-4)


def test_a_calm_sea_and_a_level_floor_need_the_least():
    need = sea_need(request(sea_slope=0, floor_slope=0))
    assert (need.splat, need.focus, need.light_steps, need.view_steps) == ("faces", 0.0, 0, 0)
    assert sea_need(request(sea_slope=0.03)).splat == "faces"
    assert sea_need(request(sea_slope=0.2)).splat == "cells"


def test_steps_by_the_steepest_ray():
    """Of the floor's slope times a tangent, which waves add to; views down meet it at less than those to the side."""
    world = request().world
    calm = world.calm[0]
    assert calm < steepest_ray(world) < 3.0 * calm
    assert steepest_ray(request(sea_slope=0).world) == pytest.approx(calm)
    x = np.linspace(0.0, 5.0, 173)
    _, *slope = world.sea.lattice(x, x)
    along, across, _ = refracted(world.tilt, slope, world.n)
    assert np.max(np.hypot(along, across)) <= 1.01 * steepest_ray(world)
    down = sea_need(request(camera_target=[5.9, 2.5, -3.0], camera_angle=0.2))
    assert down.view < sea_need(request()).view
    assert down.view_steps == 0
    steep = sea_need(request(floor_slope=1.0, floor_depth=8.0))
    assert steep.light == pytest.approx(request(floor_slope=1.0).world.floor.steepest * steepest_ray(world))
    assert (steep.light_steps, steep.view_steps) == (8, 16)


@pytest.mark.parametrize(("steep", "steps"), [(0.0, 0), (0.99, 0), (1.0, 8), (2.99, 8), (3.0, 16), (100.0, 16)])
def test_steps_at_the_limits(steep, steps):
    assert steps_for(steep) == steps


def test_the_tolerance_is_met_when_it_is_reached():
    haze = {SINGLE: 0.2, SCALED: 0.1}
    assert SeaNeed(haze, 0.0, 0.0, 0.0).terms == SCALED
    assert SeaNeed(haze, 0.0, 0.0, 0.0, tolerance=0.2).terms == SINGLE
    assert SeaNeed(haze, 0.0, 0.0, 0.0, tolerance=0.01).terms == BROADENED


def test_water_that_no_light_comes_through():
    eye, target = [6.0, 2.5, -800.0], [0.0, 2.5, -801.0]
    need = sea_need(request(water_a=[100.0] * 3, floor_depth=900.0, camera_eye=eye, camera_target=target))
    assert need.terms == SINGLE
