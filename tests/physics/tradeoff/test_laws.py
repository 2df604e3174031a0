"""Times and errors of a few laws, small."""

import numpy as np
import pytest

import profilefit
from profilefit.studies.tradeoff import contenders, laws
from profilefit.studies.tradeoff.stopwatch import Rates

SMALL = laws.LawSizes(points=2000, costly=200, albedos=1000, turns=3, judged=1)


def test_costly_samplers_are_not_timed():
    (beam,) = contenders.with_samplers("beam", profilefit.load("beam_diffusion", "published"))
    counted = laws.counts(beam)
    assert counted["profile"].transcendental > laws.MANY
    works = laws.works(beam, counted, SMALL)
    assert set(works) == {"profile"}
    assert works["profile"](0) == SMALL.costly


def test_time_is_over_the_yardsticks_in_each_turn():
    """A turn that takes all works twice as long widens nothing."""
    rates = Rates({"both of yard": [1e9, 0.5e9, 1e9], "both of law": [0.5e9, 0.25e9, 0.5e9]})
    found = laws.nanoseconds(rates, "both of law", "both of yard")
    assert (found.value, found.low, found.high) == pytest.approx((2.0, 2.0, 2.0))


@pytest.mark.slow
def test_rows_become_points():
    specs = [one for one in contenders.SPECS if one.label in (contenders.YARDSTICK, "Liang, corrected")]
    found, _ = contenders.contenders(specs=specs)
    rows = laws.measured(found, SMALL)
    profile, both = (laws.points_of(rows, part) for part in laws.TITLES)
    assert [point.method for point in profile] == [one.name for one in found if not one.another]
    assert [point.method for point in both] == [one.name for one in found]
    assert profile[0].facts["times_yardstick"] == 1.0
    liang = profile[1]
    assert liang.facts["constants"] == 18
    assert liang.error.value == pytest.approx(rows[-1].rel.mean())
    assert liang.worst.value >= liang.error.value > 0.05
    assert liang.cost.low <= liang.cost.value <= liang.cost.high
    assert np.isfinite(liang.cost.value)
