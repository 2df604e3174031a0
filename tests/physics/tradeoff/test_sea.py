"""The sea's charts: broadened light is nearest, one energy an edge converges, slices are what the guide says."""

import pytest

from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE
from profilefit.studies.tradeoff import sea
from profilefit.studies.tradeoff.parts import IF_NAMED, PARTS, chosen

SMALL = sea.SeaSizes((6, 24), 100_000, (64, 128), 512, (4, 64), 2)


def errors(panel):
    return {(one.method, int(one.label)): one.error.value for one in panel.points}


@pytest.mark.slow
def test_shafts_over_samples():
    panel = sea.shafts(SMALL)
    found = errors(panel)
    assert found["slices", 64] < 0.01
    assert found["prisms", 64] < 0.1 * found["lines", 64]
    assert found["lines", 64] < 0.01
    for way in sea.SHAFTS:
        assert found[way, 64] < 0.5 * found[way, 4]
    assert all(one.worst.value > one.error.value for one in panel.points)


@pytest.mark.slow
def test_maps_before_and_beyond_the_fold(context):
    before, beyond = sea.maps(context, SMALL)
    for panel in (before, beyond):
        found = errors(panel)
        assert found[Splat.CELLS.value, 128] < found[Splat.WIREFRAME.value, 128]
        assert {one.facts["vertices"] for one in panel.points} == {64, 128}
        assert all(one.cost.low > 0 for one in panel.points)
    assert errors(before)[Splat.CELLS.value, 128] < 0.5 * errors(beyond)[Splat.CELLS.value, 128]


@pytest.mark.slow
def test_a_quick_part_is_whole():
    part = sea.measure(sea.QUICK)
    assert [one.name for one in part.panels] == ["view", "before", "beyond", "shafts"]
    found = errors(part.panels[0])
    for pieces in sea.QUICK.samples:
        assert found[BROADENED, pieces] < 0.5 * min(found[kind, pieces] for kind in (SCALED, SINGLE))


def test_it_runs_where_it_is_named():
    assert chosen([]) == [name for name in PARTS if name not in IF_NAMED]
    assert chosen(["sea", "laws"]) == ["laws", "sea"]
