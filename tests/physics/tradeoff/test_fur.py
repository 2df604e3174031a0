"""Fur's charts: swept slabs are nearest aslant, shells of a quadratic threshold tend to another strand."""

import pytest

from profilefit.scenes.fur.ways import LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, WAYS
from profilefit.studies.tradeoff import fur
from profilefit.studies.tradeoff.parts import chosen


def errors(panel):
    return {(one.method, one.facts["layers"]): one.error.value for one in panel.points}


def test_a_panel_of_an_angle(context):
    sizes = fur.FurSizes((45.0,), (8, 16, 96), 64, 2)
    panel = fur.angle(context, 45.0, sizes)
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
def test_a_quick_part_is_whole():
    part = fur.measure(fur.QUICK)
    assert [one.name for one in part.panels] == ["angle-0", "angle-45", "angle-75", "ball"]
    ball = errors(part.panels[-1])
    assert ball[SWEPT_TWO.name, 48] < ball[SWEPT.name, 48] < ball[LINEAR.name, 48]


def test_it_runs_where_it_is_named():
    assert chosen(["fur", "laws"]) == ["laws", "fur"]
