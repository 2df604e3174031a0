"""Predicted errors against rendered ones: a few scenes, all scenes, and a prediction that is wrong."""

import json
from dataclasses import replace

import pytest

from benchmarks import choose
from benchmarks.choose import Compared, verified
from benchmarks.choose_render import Measured
from profilefit.studies.choose.case import NOTHING, Case, Within


@pytest.mark.slow
def test_three_scenes_are_predicted(context):
    for name, scene in choose.scenes(3, seed=5):
        found = verified(context, name, scene)
        assert found.within_factor, found.own
        assert not found.wasteful
        # Negative control: twice the error would not pass for it.
        wrong = replace(found.own.predicted.error, total=2.0 * found.own.predicted.error.total)
        other = Compared(replace(found.own.predicted, error=wrong), found.own.measured)
        assert not 1.0 / choose.FACTOR < other.ratio < choose.FACTOR


@pytest.mark.slow
def test_measured_error_is_known_where_nothing_is_blurred(context):
    """Lambert's error does not depend on the screen, and rises with the mean free path in pixels."""
    case = Case((0.6, 0.4, 0.2), (1.0, 0.7, 0.5), 0.5)

    def error(case, size):
        with Measured(context, case, choose.SETTING, Within(), size) as view:
            return view.error(NOTHING)

    found = error(case, (64, 64))
    assert found == pytest.approx(error(case, (96, 80)), rel=0.01)
    assert error(replace(case, pixel=4.0), (32, 64)) < 0.9 * found


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_thirty_scenes(tmp_path, capsys):
    numbers = tmp_path / "numbers.json"
    choose.main(["--json", str(numbers)])
    printed = capsys.readouterr().out
    assert "scenes where the prediction is beyond that: 0" in printed
    assert "scenes where a cheaper option serves: 0" in printed
    assert len(json.loads(numbers.read_text())) == choose.SCENES
