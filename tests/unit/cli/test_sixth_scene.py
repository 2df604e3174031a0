"""A sixth scene is its folder, tests/unit/scenes/toy, and one line: the command reads, draws and judges it."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib import image

from profilefit.scenes import SCENES

FILE = 'scene = "toy"\n[technique]\nsamples = 4\nchart = [1, 16]\n[camera]\nresolution = [24, 8]\n'


@pytest.fixture
def toy(monkeypatch, tmp_path):
    monkeypatch.setitem(SCENES, "toy", ("tests.unit.scenes.toy.scene", "toy.toml"))  # the line
    path = tmp_path / "toy.toml"
    path.write_text(FILE, encoding="utf-8")
    return str(path)


def test_it_is_drawn_by_the_command(done, opengl, toy):
    told = json.loads(done("scene", toy, "--out", "drawn", "--json", "--quiet"))
    assert sorted(path.name for path in Path("drawn").iterdir()) == [
        *(f"toy{end}" for end in ("-chart.png", "-error.png", "-truth.png", ".json", ".png"))
    ]
    assert [one["samples"] for one in told["chart"]] == [1, 4, 16]
    one, four, sixteen = (one["rmse"] for one in told["chart"])
    assert told["rmse"] == four
    np.testing.assert_allclose((four / one, sixteen / four), 0.25, rtol=0.02)  # samples at left ends: 1 / n
    picture, truth = (image.imread(f"drawn/toy{end}.png")[..., :3] for end in ("", "-truth"))
    assert picture.shape == truth.shape == (8, 24, 3)
    np.testing.assert_allclose(picture, truth, atol=2 / 255)
    assert np.all(np.diff(truth[0, :, 0]) < 0)


def test_its_mistakes_are_one_line(command, toy):
    Path(toy).write_text(FILE.replace("[technique]", "k = -1\n[technique]"), encoding="utf-8")
    assert command("scene", toy, "--out", "drawn") == (2, "", f"profilefit: {toy}: k must be a number > 0, got -1\n")
