"""Fur in layers holds where it says so; and what fails is known."""

import numpy as np
import pytest

from profilefit.scenes.fur.law import shell_shadow
from profilefit.scenes.fur.ways import FITTED, LINEAR
from profilefit.studies.stability import fur
from profilefit.studies.stability.cells import Verdict
from profilefit.studies.stability.fur import FILLED, FULL, SLENDER, filled
from profilefit.studies.stability.regions import regions_of


@pytest.fixture(scope="module")
def shells():
    return list(fur.of_shells())


@pytest.fixture(scope="module")
def slabs():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fur, "RAYS", 1200)
        return fur.of_slabs()


@pytest.fixture(scope="module")
def shadows():
    return list(fur.of_shadow())


def test_shells_hold_where_they_are_promised_and_else_have_gaps_or_are_another_strand(shells):
    ours, published = shells
    assert np.mean(ours.inside) > 0.4
    assert not any(one.is_failure for one in regions_of(ours))
    for one in (ours, published):  # gaps hide too little, another strand too much
        red = one.value[one.codes == Verdict.INACCURATE]
        assert np.min(red) < 1.0 < np.max(red)
    linear, quadratic = published.value
    assert np.all(linear <= 1.0 + 1e-9)
    assert np.all(quadratic[3:, -1] == pytest.approx(1.3, abs=0.03))
    for one in (ours, published):
        assert one.verdicts == {Verdict.RIGHT, Verdict.INACCURATE}


@pytest.mark.parametrize("degrees", [20.0, 50.0, 70.0, 82.0])
def test_where_fitted_shells_hold_is_right_at_other_angles(degrees):
    least = int(np.ceil(SLENDER * max(FULL, FILLED * np.tan(np.radians(degrees)))))
    assert filled(FITTED, degrees, least)
    assert not filled(FITTED, degrees, least - 1)
    assert not filled(LINEAR, degrees, least)
    for layers in (least, least + 7, 2 * least):
        found = shell_shadow(layers, FITTED.exponent_of(layers, SLENDER), 1.0, SLENDER, np.radians(degrees))
        assert found == pytest.approx(1.0, abs=fur.SHADOW_BOUND)


@pytest.mark.slow
def test_slabs_hold_below_their_limits_and_a_second_strand_is_missed_beyond(slabs):
    one, two = slabs.value
    assert not any(region.is_failure for region in regions_of(slabs))
    assert {one.verdict for one in regions_of(slabs)} == {Verdict.INACCURATE}
    assert np.all(one[0] == 0)
    assert np.all(two <= one + 0.02)
    assert one[-1, 0] > 0.3
    assert np.sum(slabs.inside[1]) > np.sum(slabs.inside[0]) > 20


def test_a_higher_limit_would_be_a_failure(monkeypatch):
    """Negative control."""
    monkeypatch.setattr(fur, "RAYS", 300)
    monkeypatch.setattr(fur, "LIMITS", dict.fromkeys(fur.LIMITS, 3.0))
    assert any(one.is_failure for one in regions_of(fur.of_slabs()))


def test_a_cones_shadow_keeps_its_digits_next_to_the_root_and_at_grazing_angles(shadows):
    text, plain = shadows
    assert text.verdicts == {Verdict.RIGHT}
    assert np.max(text.error) < 1e-6
    red = plain.codes == Verdict.INACCURATE
    assert np.all(np.abs(np.array(fur.ASIDES)[np.any(red, axis=1)] - 1.0) < 0.1)  # next to the root
    assert plain.verdicts == {Verdict.RIGHT, Verdict.INACCURATE}
    assert np.all(np.isfinite(plain.value))
    assert np.max(plain.error) > 2e-6


def test_the_formula_by_acos_as_ours_would_be_a_failure(monkeypatch):
    """Negative control."""
    monkeypatch.setattr(fur, "strand_text", lambda *_: PLAIN)
    text = next(fur.of_shadow())
    assert any(one.is_failure for one in regions_of(text))


PLAIN = """\
def law_shadow(r, d):
    beyond = r * r * (3.14159265 - np.arccos(np.minimum(r / d, 1.0))) + r * np.sqrt(np.maximum(d * d - r * r, 0.0))
    return np.where(d <= r, 3.14159265 * r * r, beyond)
"""
