"""A heart of layers: what a file may say, how wrong each technique draws it, and its points and maps."""

from functools import partial

import numpy as np
import pytest

from benchmarks import heart
from mcml_sim.files.whole_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.heart import chart, scene
from tests.fixtures import slow
from tests.unit.scenes.scenes import changed, mistaken, refused

EXAMPLE = read_toml(shipped("examples") / "heart.toml")
SMALL = {"camera": {"resolution": [64, 48]}, "technique": {"samples": 64, "texel": 0.5}}
content = partial(changed, EXAMPLE)
KEYS = "keys must be of "
REFUSED = [
    (
        "surface.colour",
        1,
        rf"\[surface\] {KEYS}mesh, unit, scale, kind, size, steepness, paint, roughness, got 'colour'",
    ),
    ("technique.crossover", 1, rf"\[technique\] {KEYS}samples, .*, texel, tolerance, got 'crossover'"),
    ("surface.kind", "cow", r"\[surface\] kind must be one of heart, ball, bumps, got 'cow'"),
    ("surface.size", 0.0, r"\[surface\] size must be a number > 0 and <= 150, got 0.0"),
    ("surface.steepness", 0.1, r"\[surface\] steepness must be left out where kind is not bumps, got 0.1"),
    (
        "surface",
        {"kind": "ball", "paint": True},
        r"\[surface\] paint must be left out where kind is not heart, got True",
    ),
    ("surface.roughness", 2.0, r"\[surface\] roughness must be a number > 0 and <= 1, got 2.0"),
    ("technique.kind", "fog", r"\[technique\] kind must be one of split, texture, screen, none, got 'fog'"),
    ("technique.gaussians", 9, r"\[technique\] gaussians must be a whole number in 1 ... 8, got 9"),
    ("technique.texel", 0.01, r"\[technique\] texel must be a length \[mm\] of which 2048 at most make a side of"),
    ("technique.texel", float("nan"), r"\[technique\] texel must be a number > 0"),
    ("light.irradiance", [float("nan"), 1.0, 1.0], r"\[light\] irradiance must be three numbers in 0 ... 1000, got"),
    ("layers.2.g", 0.9, r"\[layers 2\] g must be 0, and mu_s reduced"),
]
KEPT = 300  # pixels


@pytest.mark.parametrize(("place", "value", "message"), REFUSED)
def test_a_mistake_is_one_line(place, value, message):
    mistaken(scene.read, "heart.toml", content(place, value), message)


@pytest.mark.slow
def test_a_view_is_as_wide_as_what_is_seen():
    wide = scene.read("heart.toml", content("surface", {"kind": "ball", "size": 30.0}) | {"camera": {}})
    assert wide.camera.height == 90.0


@pytest.fixture(params=[8, *slow(1)])
def coarse(monkeypatch, request):
    """Truth of elements eight times as wide: its error, which is stated, stays far below what is compared with it."""
    monkeypatch.setattr(scene, "FINEST", scene.FINEST // request.param)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "size", "bound"), [("bumps", 15.0, 0.02), ("heart", 30.0, 0.03)])
def test_the_split_is_nearest_to_the_truth(context, kind, size, bound):
    """Of a sheet, and of a heart whose vessels are wider than light goes; their layers are those of a record."""
    of = scene.read("heart.toml", {**content("surface", {"kind": kind, "size": size}), **SMALL})
    light = scene.light_of(of, of.technique.gaussians)
    np.testing.assert_allclose((light.kernel.energy, light.exact.energy), 1.0, atol=1e-9)
    with scene.reference_render(context, of, light) as drawn:
        judge, stage = drawn.judge, drawn.stage
        errors = {
            kind: judge.rmse(stage.scatter(drawn.technique(kind), light.mfp, of.sampling)) for kind in scene.KINDS
        }
        inside = judge.mask
        lambert = stage.scatter(drawn.technique("none"), light.mfp)[inside].mean(axis=0)
    assert judge.truth_error.rms < 0.003
    assert errors["split"] < bound
    assert errors["split"] < min(errors["texture"], errors["screen"])
    assert errors["none"] > 4.0 * errors["split"]
    np.testing.assert_allclose(judge.reference[inside].mean(axis=0), lambert, rtol=0.05)


def test_a_picture_beside_its_truth(context, coarse):
    told = content("surface", {"kind": "ball", "size": 15.0}) | {"camera": {"resolution": [64, 48]}}
    told |= {"technique": {"kind": "texture", "gaussians": 1, "samples": 4}}
    found = scene.draw(context, scene.read("ball.toml", told))
    assert (found.picture.shape, found.truth.shape) == ((48, 64, 3), (24, 32, 3))
    assert [one.point.label for one in found.rivals] == ["screen", "split"]
    assert all(one.picture.shape == found.picture.shape for one in found.rivals)
    assert found.point.label == "texture"
    assert 0.003 < found.point.rmse < 0.03


def test_a_view_of_nothing_that_is_judged_is_one_line(context):
    told = {**content("surface", {"kind": "bumps", "size": 20.0}), **SMALL}
    told["camera"] = {"resolution": [8, 6], "target": [28.0, 28.0, 0.0], "height": 2.0}
    of = scene.read("sheet.toml", told)
    drawn = scene.reference_render(context, of, scene.light_of(of, of.technique.gaussians))
    refused("the view must show some of the sheet that", drawn.__enter__)


@pytest.fixture
def request_small(monkeypatch):
    """A quarter of the example's rows and columns, its truth of coarser elements."""
    monkeypatch.setattr(scene, "FINEST", 200)
    return scene.read("heart.toml", EXAMPLE).changed(camera_table={"resolution": (48, 36)})


@pytest.mark.slow
def test_ways_and_frames(context, request_small):
    light = scene.light_of(request_small, 6)
    with scene.reference_render(context, request_small, light, KEPT) as found:
        assert np.count_nonzero(found.judge.mask) == KEPT
        ways = chart.ways(found, request_small, {"screen": (4, 64), "none": (1,)}, turns=2)
        few, many = ways["screen"]
        assert (few.samples, many.samples) == (4, 64)
        assert many.rmse < few.rmse < ways["none"][0].rmse
        assert len(many.milliseconds) == 2
        assert many.rmse == pytest.approx(chart.error(found, "screen"))
        frames = heart.frames(found, ("split", "texture"), 1, chart.SURE)
        assert list(frames) == ["split", "texture"]
        assert min(frames.values()) > 0


@pytest.mark.slow
def test_a_finer_atlas_is_nearer(context, request_small, monkeypatch):
    monkeypatch.setattr(heart, "JUDGED", KEPT)
    found = heart.over_texel_and_view(context, request_small, (0.4, 1.6), (0.0,))
    assert found["texture"][0, 0] < 0.7 * found["texture"][1, 0]
    assert found["split"][0, 0] < found["split"][1, 0]
    assert found["screen"][0, 0] == found["screen"][1, 0]


def test_a_turned_view_sees_another_side(request_small):
    turned = heart.turned(request_small, 90.0).camera
    np.testing.assert_allclose(turned.eye, (650.0, 7.5, 0.0), atol=1e-9)
    assert turned.height == request_small.camera.height
