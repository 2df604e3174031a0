"""The render's charts, small."""

import json

import numpy as np
import pytest

from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.stage.stage import Stage

pytest.importorskip("flip_evaluator", reason="FLIP needs the package flip-evaluator")

from benchmarks import render, render_errors, render_pictures, render_table2, render_variance
from benchmarks.render_laws import contenders
from benchmarks.render_pictures import shots
from benchmarks.render_view import CLOSE, Judged


@pytest.fixture(scope="module")
def scene():
    return head_scene(camera=CLOSE, columns=256)


@pytest.fixture
def few():
    laws = contenders()
    return {key: laws[key] for key in ("hazard", "separable")}


@pytest.mark.slow
def test_errors_fall_with_samples_and_are_drawn(context, scene, few, tmp_path, capsys):
    """Judged by 256 samples of the hazard law in place of the exact picture, which takes long."""
    with Stage(context, (96, 96), shadow_side=64) as stage:
        stage.draw(scene)
        mfp = tuple(2.0 * length for length in scene.material.mfp)
        truth = stage.scatter(few["hazard"].law, mfp, few["hazard"].drawn(256, seed=9)).astype(float)
        judge = Judged(truth, stage.buffers().mask > 0.5, stage=stage, mfp=mfp)
        found = render_errors.measured(judge, few, (1, 16), 2, 2)
        rows = [shots(judge, [(few["hazard"], 4)], 1)]
        render_pictures.draw(judge, rows, tmp_path / "picture.png", ("four",), "this")
    assert np.all(found["hazard"].rmse[1] < 0.5 * found["hazard"].rmse[0])
    assert np.all(found["hazard"].flip[1] < found["hazard"].flip[0])
    assert np.all(found["hazard"].milliseconds > 0)
    assert found["separable"].rmse.shape == (2, 1)
    render_errors.report("Laws", few, found, "separable")
    assert "Laws: FLIP" in capsys.readouterr().out
    render_errors.draw(few, found, tmp_path / "error.png", "this")
    for name in ("picture", "error"):
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_command_repeats_its_numbers(tmp_path, capsys):
    found = []
    for _ in range(2):
        render.main(["fig14", "--quick", "--size", "24x24", "--json", str(tmp_path / "numbers.json")])
        assert capsys.readouterr().out.startswith("on ")
        found.append([one["rmse"] for one in json.loads((tmp_path / "numbers.json").read_text())["pictures"][0]])
    assert found[0] == found[1]


def test_measures_are_0_for_the_truth_and_know_a_difference():
    """Also of one that is off the mask only: nobody judges that."""
    truth = np.random.default_rng(1).random((32, 32, 3))
    mask = np.zeros((32, 32), bool)
    mask[:16] = True
    judge = Judged(truth, mask, stage=None, mfp=(1.0, 1.0, 1.0))
    assert (judge.rmse(truth), judge.flip(truth)) == (0, pytest.approx(0, abs=1e-6))
    assert judge.rmse(1.1 * truth) == pytest.approx(0.1 * np.sqrt(4 / 3), rel=0.05)  # of even numbers in [0, 1]
    assert judge.flip(0.5 * truth) > 0.05
    elsewhere = truth.copy()
    elsewhere[26:] = 0.0
    assert judge.rmse(elsewhere) == 0
    assert judge.flip(elsewhere) < 0.01 < judge.flip(truth * mask[::-1, :, None])


def test_error_bars_and_ratios_are_those_of_the_numbers():
    one = render_errors.Measured((4,), np.array([[1.0, 3.0]]), np.array([[2.0, 2.0]]), np.array([[5.0, 7.0, 9.0]]))
    mean, spread = one.error("rmse")
    assert (mean[0], spread[0], one.time[0]) == (2.0, 1.0, 5.0)
    times = {"scatter": {"separable": np.array([1.0, 2.0, 4.0]), "hazard": np.array([2.0, 5.0, 12.0])}}
    assert str(render_table2.Timed(0.5, times).ratio("scatter", "hazard")) == "2.50 (2.00 ... 3.00)"


@pytest.mark.slow
def test_table_2_covers_what_it_says(context, scene, few, capsys):
    found = render_table2.timed(context, scene.zoomed(290.0), few, (64, 36), 1, (0.5,))
    assert found[0].covered == pytest.approx(0.5, abs=0.05)  # of so few pixels
    render_table2.report("Table", few, found)
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("separable")]
    assert [row[2:] for row in rows] == [["1.00", "1.00", "1.00", "1.00"]] * 2  # ratio, paper


def test_bias_is_told_from_noise():
    """Estimates of known bias and variance; without taking the noise of the mean away, bias^2 would be 0.0625 more."""
    noise = np.random.default_rng(2).standard_normal((3, 4000, 16))
    bias2, spread, variance = render_variance.parts_of(0.5 + noise, np.zeros((3, 4000)))
    np.testing.assert_allclose(bias2, 0.25, atol=4 * spread.max())
    np.testing.assert_allclose(spread, np.sqrt((4 * 0.25 / 16 + 2 / 256) / 4000), rtol=0.1)
    np.testing.assert_allclose(variance, 1.0, rtol=0.03)  # 4000 x 15 degrees of freedom: 0.6 %


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["errors", "--size", "0x9"], "size must be WxH in pixels"),
        (["errors", "--figure", "a.pdf"], "figure must be a .png file"),
        (["nonsense"], "invalid choice"),
    ],
)
def test_wrong_arguments_are_told(arguments, message, capsys):
    with pytest.raises(SystemExit, match="2"):
        render.main(arguments)
    assert message in capsys.readouterr().err
