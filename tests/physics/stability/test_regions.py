"""Known failures of the paper's laws are red; regions hold the red cells and no others, and say what helps."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest

from profilefit.recipes import catalogue
from profilefit.studies.stability import law_cells, layout, map_cells
from profilefit.studies.stability.cells import ADVICE, Cells, Verdict
from profilefit.studies.stability.layout import (
    ALPHA_OF,
    ARITHMETICS,
    CDF,
    FLOAT64,
    MODEL,
    REFLECTANCE_OF,
    SAMPLE,
    STORED16,
    TEXT16,
)
from profilefit.studies.stability.regions import regions_of

FITS = catalogue.fits_folder()


@pytest.fixture(scope="module")
def printed():
    """The printed laws of Liang et al.: g as it is, and the energy of (17)."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "liang, published")
    limits = law_cells.limits_of(one, FITS)
    return [law_cells.unclipped(one, limits), law_cells.own_energy(one, limits)]


@pytest.fixture(scope="module")
def of_maps():
    """All regions of the printed map (8) and of the rational one."""
    labels = {"liang, published", "albedo-rational"}
    maps = [one for one in catalogue.albedo_laws(FITS) if one.label in labels]
    return [region for one in maps for cells in map_cells.cells_of(one, FITS) for region in regions_of(cells)]


def keys(regions):
    return {(one.quantity, one.verdict) for one in regions}


@pytest.mark.slow
def test_g_is_negative_below_eps_and_the_energy_is_a_misprint(printed):
    inverse, energy = (regions_of(cells) for cells in printed)
    assert (law_cells.INVERSE, Verdict.NEGATIVE) in keys(inverse)
    assert keys(energy) == {(law_cells.ENERGY, Verdict.NOT_FINITE), (law_cells.ENERGY, Verdict.INACCURATE)}
    assert all("b0 = 0.0641" in one.advice for one in (*inverse, *energy))


@pytest.mark.slow
def test_the_map_folds_and_the_rational_one_does_not(of_maps):
    ours = [one for one in of_maps if one.subject == "albedo-rational"]
    theirs = [one for one in of_maps if one.subject != "albedo-rational"]
    assert (ALPHA_OF, Verdict.NOT_MONOTONE) in keys(theirs)
    assert (REFLECTANCE_OF, Verdict.NOT_FINITE) in keys(theirs)
    folds = [one for one in theirs if one.verdict == Verdict.NOT_MONOTONE and one.arithmetic == FLOAT64]
    assert folds[0].where.startswith("A 0.92") or folds[0].where.startswith("A 0.95")
    assert {"rational" in one.advice for one in theirs if one.arithmetic == FLOAT64} == {True}
    assert not any(one.is_failure for one in ours)
    assert {(one.arithmetic, one.advice) for one in ours} == {(STORED16, ADVICE[STORED16])}  # and no other


@pytest.mark.slow
def test_a_wrong_constant_of_another_law_is_seen():
    """Negative control: a fault in a constant of Burley's law turns more cells of cdf and radii red."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "burley, published")
    limits = law_cells.limits_of(one, FITS)

    def red(factor):
        law = eqx.tree_at(lambda law: law.s0, one.law, factor * one.law.s0)
        cells = law_cells.model_cells(replace(one, law=law), limits)
        return {each.quantity: int(np.sum(each.codes >= Verdict.INACCURATE)) for each in cells}

    right, faulty = red(1.0), red(1.3)
    assert all(faulty[name] > right[name] for name in (CDF, SAMPLE))


def test_a_wrong_constant_of_our_own_map_is_a_failure():
    one = next(one for one in catalogue.albedo_laws(FITS) if one.label == "albedo-rational")
    law = eqx.tree_at(lambda law: law.b, one.law, 1.3 * one.law.b)
    regions = [
        each
        for cells in map_cells.cells_of(replace(one, law=law), FITS)
        if cells.arithmetic == MODEL
        for each in regions_of(cells)
    ]
    assert regions
    assert all(each.is_failure for each in regions)


def small_cells(codes, **changed):
    """A tensor of half precision over l."""
    alpha, length = (
        layout.ArgumentAxis("α", "-", np.array([0.5])),
        layout.ArgumentAxis("l", "length", np.array([1.0, 2.0, 2.0**-14])),
    )
    one = np.ones((1, 3))
    cells = Cells("f", False, "cdf", TEXT16, (alpha, length), one, one, one, 0.1, one > 0, np.array([codes], np.int8))
    return replace(cells, **changed)


def test_neighbours_of_one_class_are_one_region():
    wrong, fine, not_finite = Verdict.INACCURATE, Verdict.RIGHT, Verdict.NOT_FINITE
    assert [one.count for one in regions_of(small_cells([wrong, wrong, fine]))] == [2]
    assert [one.count for one in regions_of(small_cells([wrong, fine, wrong]))] == [1, 1]
    assert [one.verdict for one in regions_of(small_cells([not_finite, wrong, wrong]))] == [wrong, not_finite]
    assert regions_of(small_cells([fine, Verdict.OUTSIDE, Verdict.BEYOND])) == []


def test_a_region_has_its_worst_cell():
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3, error=np.array([[0.2, 0.5, 0.3]])))
    assert (region.place, region.error, region.where) == ("α 0.5; l 2", 0.5, "α 0.5; all l")


def test_what_is_not_judged_is_a_region_that_says_why():
    (region,) = regions_of(small_cells([Verdict.NOT_JUDGED] * 3, unjudged="no text"))
    assert (region.verdict, region.advice) == (Verdict.NOT_JUDGED, "no text")
    assert not region.is_failure


def test_a_red_cell_of_our_own_is_a_failure():
    """Negative control: a red cell in the middle of a law that is right there."""
    one = next(one for one in catalogue.albedo_laws(FITS) if one.label == "albedo-rational")
    cells = next(cells for cells in map_cells.cells_of(one, FITS) if cells.arithmetic == FLOAT64)
    codes = cells.codes.copy()
    codes[cells.axes[0].nearest(0.5)] = Verdict.INACCURATE
    (region,) = regions_of(replace(cells, codes=codes))
    assert region.is_failure
    assert region.where == "A 0.5"


def test_regions_are_the_red_cells_and_no_others(printed):
    for cells in printed:
        red = [one for one in regions_of(cells) if one.verdict.is_red]
        assert sum(one.count for one in red) == np.sum(cells.codes >= Verdict.INACCURATE)


def test_every_arithmetic_has_its_advice():
    assert set(ADVICE) == set(ARITHMETICS)
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3))
    assert region.advice == ADVICE[TEXT16]
    (region,) = regions_of(small_cells([Verdict.INACCURATE] * 3, advice="mend it"))
    assert region.advice == "mend it"
