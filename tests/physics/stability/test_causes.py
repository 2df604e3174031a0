"""What the laws of the paper are known to fail at is red, with its cause; what no cause fits is unexplained."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest

from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.studies.stability import layout, map_cells, misuse, model_cells
from profilefit.studies.stability.cells import Cells, Verdict
from profilefit.studies.stability.law_cells import limits_of
from profilefit.studies.stability.layout import ALPHA_OF, CDF, FLOAT64, MODEL, REFLECTANCE_OF, SAMPLE, TEXT16
from profilefit.studies.stability.regions import CAUSES, UNEXPLAINED, explained, regions_of

FITS = catalogue.fits_folder()


@pytest.fixture(scope="module")
def printed():
    """The printed laws of Liang et al.: g as it is, and the energy of (17)."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "liang, published")
    limits = limits_of(one, FITS)
    return [model_cells.unclipped(one, limits), model_cells.own_energy(one, limits)]


@pytest.fixture(scope="module")
def of_maps():
    """All regions of the printed map (8) and of the rational one."""
    wanted = {"liang, published", "albedo-rational"}
    found = [one for one in catalogue.albedo_laws(FITS) if one.label in wanted]
    return [region for one in found for cells in map_cells.cells_of(one, FITS) for region in regions_of(cells)]


def keys(regions):
    return {(one.quantity, one.verdict, one.cause.key) for one in regions}


@pytest.mark.slow
def test_g_is_negative_below_eps_and_the_energy_is_a_misprint(printed):
    inverse, energy = (regions_of(cells) for cells in printed)
    assert (model_cells.INVERSE, Verdict.NEGATIVE, "g < 0 for xi < eps") in keys(inverse)
    assert keys(energy) == {
        (model_cells.ENERGY, Verdict.NOT_FINITE, "r_max is 0/0"),
        (model_cells.ENERGY, Verdict.INACCURATE, "misprint of b0"),
        (model_cells.ENERGY, Verdict.INACCURATE, "shape of (7)"),  # darker than any fit
    }


@pytest.mark.slow
def test_the_map_folds_and_the_rational_one_does_not(of_maps):
    ours = [one for one in of_maps if one.subject == "albedo-rational"]
    theirs = [one for one in of_maps if one.subject != "albedo-rational"]
    assert (ALPHA_OF, Verdict.NOT_MONOTONE, "fold of (8)") in keys(theirs)
    assert (REFLECTANCE_OF, Verdict.NOT_FINITE, "no A above the fold") in keys(theirs)
    folds = [one for one in theirs if one.cause.key == "fold of (8)" and one.arithmetic == FLOAT64]
    assert folds[0].where.startswith("A 0.92") or folds[0].where.startswith("A 0.95")
    assert not any(one.is_failure for one in ours)
    assert {one.cause.key for one in ours} == {"alpha near 1 in half"}  # and no other


@pytest.mark.slow
def test_none_of_them_is_unexplained(printed, of_maps):
    regions = [*of_maps, *(region for cells in printed for region in regions_of(cells))]
    assert [one for one in regions if one.is_unexplained] == []


@pytest.fixture(scope="module")
def burley():
    """The printed law of Burley against the half space: as it is, and with a fault in a constant."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "burley, published")
    limits = limits_of(one, FITS)

    def regions(factor):
        law = eqx.tree_at(lambda law: law.s0, one.law, factor * one.law.s0)
        return [each for cells in model_cells.cells_of(replace(one, law=law), limits) for each in regions_of(cells)]

    return regions


@pytest.mark.slow
def test_a_wrong_constant_is_not_explained_by_the_model(burley):
    """Negative control: the record states what the law's own error is, and a fault is more than that."""
    assert not any(one.is_unexplained for one in burley(1.0))
    faulty = burley(1.3)
    assert {one.quantity for one in faulty if one.is_unexplained} >= {CDF, SAMPLE}


def test_a_wrong_constant_of_our_own_map_is_a_failure():
    one = next(one for one in catalogue.albedo_laws(FITS) if one.label == "albedo-rational")
    law = eqx.tree_at(lambda law: law.b, one.law, 1.3 * one.law.b)
    found = [
        each
        for cells in map_cells.cells_of(replace(one, law=law), FITS)
        if cells.arithmetic == MODEL
        for each in regions_of(cells)
    ]
    assert found
    assert all(each.is_failure and each.is_unexplained for each in found)


def red_cells(**changed):
    """A tensor of half precision, red where l is 1 and where it is not accepted; the text in float32 is right."""
    alpha, length = (
        layout.ArgumentAxis("α", "-", np.array([0.5])),
        layout.ArgumentAxis("l", "length", np.array([1.0, 2.0**-14])),
    )
    one = np.ones((1, 2))
    codes = np.array([[Verdict.RIGHT, Verdict.INACCURATE]], np.int8)
    cells = Cells(
        "f", False, "cdf", TEXT16, (alpha, length), one, one, one, 0.1, one > 0, codes, dtype=np.float16,
        twin=np.full((1, 2), Verdict.RIGHT, np.int8),
    )  # fmt: skip
    return [region.cause.key for region in regions_of(replace(cells, **changed))]


def test_formats_explain_only_what_another_format_mends():
    """Each cause of a format, and beside it what it does not explain."""
    wrong = np.full((1, 2), Verdict.INACCURATE, np.int8)
    assert red_cells() == ["l^2 leaves the format"]
    assert red_cells(codes=wrong) == ["eleven bits"]  # also where l = 1
    assert red_cells(codes=wrong, twin=wrong) == ["unexplained"]  # a fault of the text itself
    assert red_cells(codes=wrong, twin=None) == ["unexplained"]


def test_a_text_may_fail_only_where_the_law_refuses():
    found = [cells for cells in misuse.of_law(find("burley", FITS)) if cells.refused is not None]
    assert all(np.all(cells.refused) for cells in found)
    codes = np.full(found[0].shape, Verdict.NOT_FINITE, np.int8)
    assert {one.cause.key for one in regions_of(replace(found[0], codes=codes))} == {"sources do not check"}
    careless = replace(found[0], codes=codes, refused=np.zeros(found[0].shape, bool))
    assert {one.cause.key for one in regions_of(careless)} == {"unexplained"}


def test_what_is_not_judged_is_a_region_that_says_why():
    aside = np.full((1, 2), Verdict.NOT_JUDGED, np.int8)
    assert red_cells(codes=aside, unjudged="no text") == ["not judged"]


def test_a_failure_of_another_kind_is_unexplained():
    """Negative control: a red cell in the middle of a law that is right there, where no cause holds."""
    one = next(one for one in catalogue.albedo_laws(FITS) if one.label == "albedo-rational")
    cells = next(cells for cells in map_cells.cells_of(one, FITS) if cells.arithmetic == FLOAT64)
    middle = cells.axes[0].nearest(0.5)
    codes = cells.codes.copy()
    codes[middle] = Verdict.INACCURATE
    (region,) = regions_of(replace(cells, codes=codes))
    assert region.cause is UNEXPLAINED
    assert region.is_failure
    assert region.where == "A 0.5"


def test_regions_are_the_red_cells_and_no_others(printed):
    for cells in printed:
        causes = explained(cells)
        regions = regions_of(cells)
        red = [one for one in regions if one.verdict.is_red]
        assert sum(one.count for one in red) == np.sum(cells.codes >= Verdict.INACCURATE) == np.sum(causes >= 0)


def test_every_cause_says_what_helps():
    assert len({one.key for one in CAUSES}) == len(CAUSES)
    for one in CAUSES:
        assert one.words
        assert one.remedy
    assert MODEL != FLOAT64
