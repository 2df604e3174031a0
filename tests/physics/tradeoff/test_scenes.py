"""Charts of the sea and of fur: what is nearest, what converges, and what tends to something else."""

import pytest

from profilefit.scenes.fur.ways import LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, WAYS
from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE
from profilefit.studies.tradeoff import scenes
from profilefit.studies.tradeoff.parts import chosen

SMALL = scenes.SeaSizes((6, 24), 100_000, (64, 128), 512, (4, 64), 2)


def errors(panel):
    return {(one.method, int(one.label)): one.error.value for one in panel.points}


@pytest.mark.slow
def test_shafts_over_samples():
    panel = scenes.shafts(SMALL)
    found = errors(panel)
    assert found["slices", 64] < 0.01
    assert found["prisms", 64] < 0.1 * found["lines", 64]
    assert found["lines", 64] < 0.01
    for way in scenes.SHAFTS:
        assert found[way, 64] < 0.5 * found[way, 4]
    assert all(one.worst.value > one.error.value for one in panel.points)


@pytest.mark.slow
def test_maps_before_and_beyond_the_fold(context):
    before, beyond = scenes.maps(context, SMALL)
    for panel in (before, beyond):
        found = errors(panel)
        assert found[Splat.CELLS.value, 128] < found[Splat.WIREFRAME.value, 128]
        assert {one.facts["vertices"] for one in panel.points} == {64, 128}
        assert all(one.cost.low > 0 for one in panel.points)
    assert errors(before)[Splat.CELLS.value, 128] < 0.5 * errors(beyond)[Splat.CELLS.value, 128]


@pytest.mark.slow
def test_a_quick_sea_is_whole():
    part = scenes.measure_sea(scenes.QUICK_SEA)
    assert [one.name for one in part.panels] == ["view", "before", "beyond", "shafts"]
    found = errors(part.panels[0])
    for pieces in scenes.QUICK_SEA.samples:
        assert found[BROADENED, pieces] < 0.5 * min(found[kind, pieces] for kind in (SCALED, SINGLE))


def test_it_runs_where_it_is_named():
    assert chosen(["fur", "laws", "sea"]) == ["laws", "sea", "fur"]


def test_a_panel_of_an_angle(context):
    sizes = scenes.FurSizes((45.0,), (8, 16, 96), 64, 2)
    panel = scenes.angle(context, 45.0, sizes)
    found = errors(panel)
    assert len(found) == len(WAYS) * len(sizes.layers)
    assert all(one.cost.low > 0 for one in panel.points)
    # The laboratory's figures: .395 and .269 by 8 and 16 linear shells, .294 and .198 by 8 and 96 quadratic ones.
    for way, layers, expected in ((LINEAR, 8, 0.395), (LINEAR, 16, 0.27), (QUADRATIC, 8, 0.294), (QUADRATIC, 96, 0.2)):
        assert found[way.name, layers] == pytest.approx(expected, rel=0.08)
    assert found[SWEPT.name, 16] <= 0.02
    assert found[SWEPT_TWO.name, 16] < 0.5 * found[SWEPT.name, 16]
    assert found[LINEAR.name, 96] > found[SWEPT.name, 16]


@pytest.mark.slow
def test_a_quick_fur_is_whole():
    part = scenes.measure_fur(scenes.QUICK_FUR)
    assert [one.name for one in part.panels] == ["angle-0", "angle-45", "angle-75", "ball"]
    ball = errors(part.panels[-1])
    assert ball[SWEPT_TWO.name, 48] < ball[SWEPT.name, 48] < ball[LINEAR.name, 48]
