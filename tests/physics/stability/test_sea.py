"""Light in water holds where it says so; and what fails is known."""

import numpy as np
import pytest

from profilefit.scenes.sea.waves import first_hit
from profilefit.studies.stability import sea
from profilefit.studies.stability.cells import Verdict
from profilefit.studies.stability.regions import regions_of


@pytest.fixture(scope="module")
def hits():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sea, "RAYS", 200)
        return list(sea.of_hits())


@pytest.fixture(scope="module")
def segments():
    return list(sea.of_segment())


def test_steps_hold_and_iterations_fail_where_rays_cross_twice(hits):
    ours, published = hits
    sixteen, eight, newton = ours.value
    assert np.all(sixteen <= 0.01)
    assert np.all(eight[:-1] <= 0.01)
    assert np.all(newton[:2] == 0)
    assert newton[-1] > 0.3
    assert not any(one.is_failure for one in regions_of(ours))
    beyond = np.array(sea.STEEPNESSES) >= sea.SEVERAL
    assert np.all(beyond[np.any(ours.codes == Verdict.INACCURATE, axis=0)])  # rays that cross twice, and no others
    assert np.any(published.codes[:, ~beyond] == Verdict.INACCURATE)  # those from 1 m or without slopes, too
    assert np.all(published.value[:, -1] > 0.8)


def test_level_floors_are_hit_from_every_depth(monkeypatch):
    """No view of a level or nearly level floor misses it in float32; views that miss are counted."""
    assert sea.of_level_floors().verdicts == {Verdict.RIGHT}
    monkeypatch.setattr(
        sea,
        "first_hit",
        lambda *given, precision: np.nan * first_hit(*given) if precision == np.float32 else first_hit(*given),
    )
    assert sea.of_level_floors().verdicts == {Verdict.INACCURATE}


def test_e_to_the_minus_ct_fails_from_the_depth_that_is_told():
    """Where it begins to fail is where a law that is not of these cells says: exactly the red ones."""
    beam = sea.of_beam()
    assert np.array_equal(beam.codes == Verdict.INACCURATE, ~beam.inside)
    assert 0.2 < np.mean(beam.inside) < 0.9
    assert {one.advice for one in regions_of(beam)} == {sea.OF_BEAM}
    assert np.max(beam.error) > 0.5


def test_the_segment_holds_from_against_the_beam_to_along_it(segments):
    text, library, plain = segments
    for one in (text, library):
        assert one.verdicts == {Verdict.RIGHT}
        assert np.max(one.error) < 1e-6
    assert not any(one.is_failure for one in regions_of(plain))
    near, far = np.array(sea.TURNS)[:, None, None], np.array(sea.LENGTHS)[:, None]
    along = np.broadcast_to(near == 0, plain.shape)
    assert np.array_equal(plain.codes == Verdict.NOT_FINITE, along)
    x = np.broadcast_to(near * far, plain.shape)
    assert np.all(plain.codes[x >= 0.1] == Verdict.RIGHT)  # 1 - e^-x has lost a digit below, and none here
    assert np.any(plain.codes[(x > 0) & (x < 0.1)] == Verdict.INACCURATE)


def test_the_plain_formula_as_ours_would_be_a_failure(monkeypatch):
    """Negative control."""
    monkeypatch.setattr(sea, "segment_text", lambda *_: PLAIN)
    text = next(sea.of_segment())
    assert any(one.is_failure for one in regions_of(text))


PLAIN = """\
def law_integral(c, s0, t0, m, t1):
    x = c * (1.0 + m) * t1
    return np.exp(-c * (s0 + t0)) * (1.0 - np.exp(-x)) / x * t1
"""
