"""Names and words of measures, and which of their values is the worst."""

from dataclasses import fields

import pytest

from profilefit.fitting.measures import MEASURES, OF_MAP, OF_PROFILE
from profilefit.fitting.quality import AlbedoQuality, Quality
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records


def test_the_worst_is_the_largest_but_where_large_is_good():
    assert MEASURES["rel"].worst([0.1, 0.3, 0.2]) == 0.3
    assert MEASURES["r2"].worst([0.1, 0.3, 0.2]) == 0.1
    assert MEASURES["delta_A"].worst(0.5) == 0.5


@pytest.mark.parametrize("kind", [Quality, AlbedoQuality])
def test_every_measure_of_a_quality_has_words(kind):
    whole = {field.name for field in fields(kind)} - {"alpha", "mse_halves", "r2_halves"}
    assert whole <= set(MEASURES)


def test_records_tell_those_that_laws_are_judged_by():
    told = [
        content["quality"]["regenerated"]
        for content in Records(fits_folder()).contents().values()
        if "quality" in content
    ]
    for name in (*OF_PROFILE, *OF_MAP):
        assert any(name in one for one in told)


def test_a_unit_stands_behind_what_has_one():
    assert MEASURES["mse"].meaning == "of r R_d [1/mfp²]"
    assert MEASURES["ks"].meaning == MEASURES["ks"].formula
    assert (MEASURES["inversion_error"].header, MEASURES["rel"].header) == ("error", "rel")
