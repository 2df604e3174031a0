"""Blurs of a heart hold where they say so; and what fails is known."""

import numpy as np
import pytest

from profilefit.errors import ShaderError
from profilefit.scenes.heart.atlas import Atlas
from profilefit.studies.stability import heart
from profilefit.studies.stability.cells import Verdict
from profilefit.studies.stability.regions import regions_of

pytestmark = pytest.mark.slow  # an instrument


@pytest.fixture(scope="module")
def cells():
    try:
        return list(heart.cells_of())
    except ShaderError as error:
        pytest.skip(str(error))


def test_poles_and_coarse_texels_fail_and_nothing_else(cells):
    regions = [one for each in cells for one in regions_of(each)]
    assert {one.advice for one in regions} == {heart.AT_POLES, heart.COARSE}
    assert {(one.subject, one.verdict) for one in regions} == {
        ("atlas of a ball", Verdict.INACCURATE),
        ("atlas that is stretched", Verdict.INACCURATE),
    }
    assert not any(one.is_failure for one in regions)
    ball, stretch, view = cells
    assert np.max(ball.error[ball.inside]) < 0.02 < np.max(ball.error) < 0.1
    assert np.max(stretch.error[stretch.inside]) < 0.01
    assert np.max(view.error) < 0.01


def test_a_seam_is_no_place_of_its_own(cells):
    """A column from the seam is off by what others of its latitude are."""
    ball = cells[0]
    away = np.max(ball.error[:, :4, 1:], axis=2)
    assert np.all(ball.error[:, :4, 0] < 2.0 * away + 1e-3)


def test_an_atlas_without_links_fails_at_its_seam(cells, monkeypatch):
    """Negative control: what is red then is red where it was promised."""
    unlinked = Atlas.links.fget

    def links(self):
        found = unlinked(self)
        place = self.read("position_map")[..., 3:] > 0.5
        return np.where(place, found, 0.0).astype(np.float32)

    monkeypatch.setattr(Atlas, "links", property(links))
    with heart.opened() as context:
        ball = heart.of_ball(context)
    assert Verdict.INACCURATE in ball.verdicts
    assert any(one.is_failure for one in regions_of(ball))
