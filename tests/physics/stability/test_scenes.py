"""Light in water, layers of fur and blurs of a heart hold where they say so; and what fails is known."""

import numpy as np
import pytest

from profilefit.errors import ShaderError
from profilefit.scenes.fur.law import shell_shadow
from profilefit.scenes.fur.ways import FITTED, LINEAR
from profilefit.scenes.heart.atlas import Atlas
from profilefit.scenes.sea.waves import first_hit
from profilefit.studies.stability import scenes
from profilefit.studies.stability.cells import Verdict, regions_of
from profilefit.studies.stability.scenes import FILLED, FULL, SLENDER, filled


def test_steps_hold_and_iterations_fail_where_rays_cross_twice(monkeypatch):
    monkeypatch.setattr(scenes, "RAYS", 200)
    ours, published = scenes.of_hits()
    sixteen, eight, newton = ours.value
    assert np.all(sixteen <= 0.01)
    assert np.all(eight[:-1] <= 0.01)
    assert np.all(newton[:2] == 0)
    assert newton[-1] > 0.3
    assert not any(one.is_failure for one in regions_of(ours))
    beyond = np.array(scenes.STEEPNESSES) >= scenes.SEVERAL
    assert np.all(beyond[np.any(ours.codes == Verdict.INACCURATE, axis=0)])  # rays that cross twice, and no others
    assert np.any(published.codes[:, ~beyond] == Verdict.INACCURATE)  # those from 1 m or without slopes, too
    assert np.all(published.value[:, -1] > 0.8)


def test_level_floors_are_hit_from_every_depth(monkeypatch):
    """No view of a level or nearly level floor misses it in float32; views that miss are counted."""
    assert scenes.of_level_floors().verdicts == {Verdict.RIGHT}

    def missing(*given, precision):
        return np.nan * first_hit(*given) if precision == np.float32 else first_hit(*given)

    monkeypatch.setattr(scenes, "first_hit", missing)
    assert scenes.of_level_floors().verdicts == {Verdict.INACCURATE}


def test_e_to_the_minus_ct_fails_from_the_depth_that_is_told():
    """Where it begins to fail is where a law that is not of these cells says: exactly the red ones."""
    beam = scenes.of_beam()
    assert np.array_equal(beam.codes == Verdict.INACCURATE, ~beam.inside)
    assert 0.2 < np.mean(beam.inside) < 0.9
    assert {one.advice for one in regions_of(beam)} == {scenes.OF_BEAM}
    assert np.max(beam.error) > 0.5


def test_the_segment_holds_from_against_the_beam_to_along_it():
    text, library, plain = scenes.of_segment()
    for one in (text, library):
        assert one.verdicts == {Verdict.RIGHT}
        assert np.max(one.error) < 1e-6
    assert not any(one.is_failure for one in regions_of(plain))
    near, far = np.array(scenes.TURNS)[:, None, None], np.array(scenes.LENGTHS)[:, None]
    along = np.broadcast_to(near == 0, plain.codes.shape)
    assert np.array_equal(plain.codes == Verdict.NOT_FINITE, along)
    x = np.broadcast_to(near * far, plain.codes.shape)
    assert np.all(plain.codes[x >= 0.1] == Verdict.RIGHT)  # 1 - e^-x has lost a digit below, and none here
    assert np.any(plain.codes[(x > 0) & (x < 0.1)] == Verdict.INACCURATE)


PLAIN_SEGMENT = """\
def law_integral(c, s0, t0, m, t1):
    x = c * (1.0 + m) * t1
    return np.exp(-c * (s0 + t0)) * (1.0 - np.exp(-x)) / x * t1
"""
PLAIN_SHADOW = """\
def law_shadow(r, d):
    beyond = r * r * (3.14159265 - np.arccos(np.minimum(r / d, 1.0))) + r * np.sqrt(np.maximum(d * d - r * r, 0.0))
    return np.where(d <= r, 3.14159265 * r * r, beyond)
"""


@pytest.mark.parametrize(
    ("of", "text", "plain"),
    [(scenes.of_segment, "segment_text", PLAIN_SEGMENT), (scenes.of_shadow, "strand_text", PLAIN_SHADOW)],
    ids=["segment", "shadow, by acos"],
)
def test_a_plain_formula_as_ours_would_be_a_failure(monkeypatch, of, text, plain):
    """Negative control."""
    monkeypatch.setattr(scenes, text, lambda *_: plain)
    assert any(one.is_failure for one in regions_of(next(of())))


def test_shells_hold_where_they_are_promised_and_else_have_gaps_or_are_another_strand():
    ours, published = scenes.of_shells()
    assert np.mean(ours.inside) > 0.4
    assert not any(one.is_failure for one in regions_of(ours))
    for one in (ours, published):  # gaps hide too little, another strand too much
        red = one.value[one.codes == Verdict.INACCURATE]
        assert np.min(red) < 1.0 < np.max(red)
        assert one.verdicts == {Verdict.RIGHT, Verdict.INACCURATE}
    linear, quadratic = published.value
    assert np.all(linear <= 1.0 + 1e-9)
    assert np.all(quadratic[3:, -1] == pytest.approx(1.3, abs=0.03))


@pytest.mark.parametrize("degrees", [20.0, 50.0, 70.0, 82.0])
def test_where_fitted_shells_hold_is_right_at_other_angles(degrees):
    least = int(np.ceil(SLENDER * max(FULL, FILLED * np.tan(np.radians(degrees)))))
    assert filled(FITTED, degrees, least)
    assert not filled(FITTED, degrees, least - 1)
    assert not filled(LINEAR, degrees, least)
    for layers in (least, least + 7, 2 * least):
        found = shell_shadow(layers, FITTED.exponent_of(layers, SLENDER), 1.0, SLENDER, np.radians(degrees))
        assert found == pytest.approx(1.0, abs=scenes.SHADOW_BOUND)


@pytest.mark.slow
def test_slabs_hold_below_their_limits_and_a_second_strand_is_missed_beyond(monkeypatch):
    monkeypatch.setattr(scenes, "PATCH_RAYS", 1200)
    slabs = scenes.of_slabs()
    one, two = slabs.value
    assert not any(region.is_failure for region in regions_of(slabs))
    assert {one.verdict for one in regions_of(slabs)} == {Verdict.INACCURATE}
    assert np.all(one[0] == 0)
    assert np.all(two <= one + 0.02)
    assert one[-1, 0] > 0.3
    assert np.sum(slabs.inside[1]) > np.sum(slabs.inside[0]) > 20


def test_a_higher_limit_would_be_a_failure(monkeypatch):
    """Negative control."""
    monkeypatch.setattr(scenes, "PATCH_RAYS", 300)
    monkeypatch.setattr(scenes, "SLABS", dict.fromkeys(scenes.SLABS, 3.0))
    assert any(one.is_failure for one in regions_of(scenes.of_slabs()))


def test_a_cones_shadow_keeps_its_digits_next_to_the_root_and_at_grazing_angles():
    text, plain = scenes.of_shadow()
    assert text.verdicts == {Verdict.RIGHT}
    assert np.max(text.error) < 1e-6
    red = plain.codes == Verdict.INACCURATE
    assert np.all(np.abs(np.array(scenes.ASIDES)[np.any(red, axis=1)] - 1.0) < 0.1)  # next to the root
    assert plain.verdicts == {Verdict.RIGHT, Verdict.INACCURATE}
    assert np.all(np.isfinite(plain.value))
    assert np.max(plain.error) > 2e-6


@pytest.fixture(scope="module")
def cells():
    try:
        return list(scenes.heart_cells())
    except ShaderError as error:
        pytest.skip(str(error))


@pytest.mark.slow  # an instrument
def test_poles_and_coarse_texels_fail_and_nothing_else_nor_a_seam(cells):
    regions = [one for each in cells for one in regions_of(each)]
    assert {one.advice for one in regions} == {scenes.AT_POLES, scenes.COARSE}
    assert {(one.subject, one.verdict) for one in regions} == {
        ("atlas of a ball", Verdict.INACCURATE),
        ("atlas that is stretched", Verdict.INACCURATE),
    }
    assert not any(one.is_failure for one in regions)
    ball, stretch, view = cells
    assert np.max(ball.error[ball.inside]) < 0.02 < np.max(ball.error) < 0.1
    assert np.max(stretch.error[stretch.inside]) < 0.01
    assert np.max(view.error) < 0.01
    away = np.max(ball.error[:, :4, 1:], axis=2)  # a column from the seam is off by what others of its latitude are
    assert np.all(ball.error[:, :4, 0] < 2.0 * away + 1e-3)


@pytest.mark.slow  # an instrument
def test_an_atlas_without_links_fails_at_its_seam(cells, monkeypatch):
    """Negative control: what is red then is red where it was promised."""
    unlinked = Atlas.links.fget

    def links(self):
        found = unlinked(self)
        place = self.read("position_map")[..., 3:] > 0.5
        return np.where(place, found, 0.0).astype(np.float32)

    monkeypatch.setattr(Atlas, "links", property(links))
    with scenes.opened() as context:
        ball = scenes.of_ball(context)
    assert Verdict.INACCURATE in ball.verdicts
    assert any(one.is_failure for one in regions_of(ball))
