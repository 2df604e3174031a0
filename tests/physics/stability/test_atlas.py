"""The whole atlas: nothing red in our own laws inside their range, and advice for all that is red."""

import pytest

from profilefit.errors import InputError
from profilefit.recipes import catalogue
from profilefit.studies.stability import atlas, law_cells, map_cells, misuse, stacks
from profilefit.studies.stability.cells import ADVICE

FITS = catalogue.fits_folder()


@pytest.mark.slow
def test_jobs_by_name():
    assert [name for name, _ in atlas.jobs(["liang"], FITS, False)] == [
        *("liang, published", "liang, corrected", "liang-whole", "liang-as-published", "liang-inverse-as-published"),
        *("map liang, published", "albedo-liang"),
    ]
    assert [name for name, _ in atlas.jobs(["exact", "hazard-refracting"], FITS, False)] == [
        "hazard-refracting",
        "exact",
    ]
    everything = [name for name, _ in atlas.jobs([], FITS, False)]
    assert set(atlas.QUICK) | set(atlas.FUNCTIONS) - set(atlas.IF_NAMED) | set(atlas.DERIVED) | {"albedo-liang"} <= set(
        everything
    )
    assert len(everything) == len(set(everything))
    assert not set(atlas.IF_NAMED) & set(everything)
    for one in ("sea", "fur"):
        assert [name for name, _ in atlas.jobs([one], FITS, True)] == [one]
    with pytest.raises(InputError, match=r"name must be a law, map or record .*, got 'hazzard'"):
        atlas.jobs(["hazzard"], FITS, False)


def _law(region):
    """The name of the law that a region is of."""
    return region.subject.split("-")[0].split(",")[0]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_ours_hold_and_every_failure_has_its_advice():
    parts = list(atlas.run(atlas.jobs([], FITS, False)))
    regions = [one for part in parts for one in part.regions]
    assert [(one.subject, one.quantity, one.arithmetic, one.place) for one in regions if one.is_failure] == []
    assert [(one.subject, one.quantity) for one in regions if one.verdict.is_red and not one.advice] == []
    assert [one for part in parts for one in part.fits if one.is_failure] == []
    assert [(one.subject, one.advice) for one in regions if one.own and _law(one) in one.advice] == []
    assert {law_cells.OF_LIANG, map_cells.OF_MAPS, stacks.OF_LAWS, misuse.CHECK, *ADVICE.values()} <= {
        one.advice for one in regions
    }
