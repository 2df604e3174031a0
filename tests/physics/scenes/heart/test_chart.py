"""Points and maps of a heart's ways, on a small picture."""

import numpy as np
import pytest

from mcml_sim.files.text_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.heart import chart, scene

EXAMPLE = read_toml(shipped("examples") / "heart.toml")
KEPT = 300  # pixels


@pytest.fixture
def request_small(monkeypatch):
    """A quarter of the example's rows and columns, its truth of coarser elements."""
    monkeypatch.setattr(scene, "FINE", 8 * scene.meshes.CHARTS_END)
    return scene.read("heart.toml", EXAMPLE).changed(camera_table={"resolution": (48, 36)})


@pytest.mark.slow
def test_ways_and_frames(context, request_small):
    light = scene.light_of(request_small.stack, 6)
    with scene.reference_render(context, request_small, light, KEPT) as found:
        assert np.count_nonzero(found.judge.mask) == KEPT
        ways = chart.ways(found, request_small, {"screen": (4, 64), "none": (1,)}, turns=2)
        few, many = ways["screen"]
        assert (few.samples, many.samples) == (4, 64)
        assert many.rmse < few.rmse < ways["none"][0].rmse
        assert len(many.milliseconds) == 2
        assert many.rmse == pytest.approx(chart.error(found, "screen"))
        frames = chart.frames(found, ("split", "texture"), turns=1)
        assert list(frames) == ["split", "texture"]
        assert min(frames.values()) > 0


@pytest.mark.slow
def test_a_finer_atlas_is_nearer(context, request_small):
    """The screen by itself has none."""
    light = scene.light_of(request_small.stack, 6)
    found = chart.over_texel_and_view(context, request_small, light, (0.4, 1.6), (0.0,))
    assert found["texture"][0, 0] < 0.7 * found["texture"][1, 0]
    assert found["split"][0, 0] < found["split"][1, 0]
    assert found["screen"][0, 0] == found["screen"][1, 0]


def test_a_turned_view_sees_another_side(request_small):
    turned = chart.turned(request_small, 90.0).camera
    np.testing.assert_allclose(turned.eye, (650.0, 0.0, 0.0), atol=1e-9)
    assert turned.height == request_small.camera.height
