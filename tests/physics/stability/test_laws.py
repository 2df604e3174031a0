"""Cells of laws and maps: what counts as right, what narrower formats do, and known failures of the paper's laws."""

from dataclasses import replace

import equinox as eqx
import numpy as np
import pytest

from profilefit.fitting.quality import profile_quality
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find, profile_laws
from profilefit.shader.check.bounds import ALBEDOS
from profilefit.studies.stability import law_cells, map_cells
from profilefit.studies.stability.cells import (
    ADVICE,
    ALPHA_OF,
    EXTENDED,
    FLOAT64,
    MODEL,
    QUANTITIES,
    REFLECTANCE_OF,
    STORED16,
    TEXT16,
    TEXT32,
    ArgumentGrid,
    RoundedText,
    Verdict,
    regions_of,
)
from profilefit.studies.stability.law_cells import MEASURED, Reference, computed, limits_of

FITS = catalogue.fits_folder()
PROFILE, CDF, SAMPLE, PDF = QUANTITIES


def small(dtype, x=(0.01, 1.0, 10.0), alpha=(0.3, 0.9), xi=(0.1, 0.5, 0.9)):
    grid = ArgumentGrid.of(dtype)

    def cut(axis, values):
        return replace(axis, values=np.asarray(values, dtype).astype(float))

    return ArgumentGrid(dtype, cut(grid.alpha, alpha), cut(grid.x, x), cut(grid.xi, xi), cut(grid.mfp, (1.0, 2.0)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hazard", "quantile"])
def test_right_is_the_law(name):
    """Of radii the two steps of hazard's text are right to 2e-8 in xi."""
    law, at = catalogue.load(name), small(np.float64)
    right, (r, xi, alpha, mfp) = Reference(law, at), at.arguments
    np.testing.assert_allclose(right.of(PROFILE), law.profile(r, alpha, mfp), rtol=1e-9)
    np.testing.assert_allclose(right.of(CDF), law.cdf(r, alpha, mfp), rtol=1e-10)
    sampler = law.samplers.get("two steps", law.sampler)
    np.testing.assert_allclose(right.of(SAMPLE), sampler.sample(xi, alpha, mfp), rtol=1e-6)
    np.testing.assert_allclose(right.of(PDF), sampler.pdf(r, alpha, mfp), rtol=1e-4)
    assert np.max(right.misplaced(np.asarray(sampler.sample(xi, alpha, mfp)))) < 1e-7
    assert np.min(right.misplaced(1.1 * np.asarray(sampler.sample(xi, alpha, mfp)))) > 1e-3


@pytest.mark.slow
def test_errors_that_no_record_tells_are_as_measured():
    for name, stated in MEASURED.items():
        one = next(one for one in profile_laws(FITS) if one.name == name)
        quality = profile_quality(one.law, ALBEDOS)
        assert np.max(quality.rel) == pytest.approx(stated["rel"], rel=0.01)
        assert np.max(quality.ks) == pytest.approx(stated["ks"], rel=0.01)


def test_the_source_is_infinite_and_a_sum_of_gaussians_is_not():
    at = small(np.float64, x=(0.0, 1.0))
    assert np.all(np.isinf(Reference(catalogue.load("hazard"), at).of(PROFILE)[:, 0]))
    assert np.all(np.isfinite(Reference(catalogue.load("gaussians:2"), at).of(PROFILE)))


def test_single_precision_is_right_and_half_is_not():
    """A text in half far out, and next to the source, is no number."""
    one, x = find("hazard", FITS), (0.0, 1.0, 60000.0)
    limits = limits_of(one, FITS)
    for cells in computed(one, limits, TEXT32, small(np.float32, x)):
        assert np.all(cells.codes <= Verdict.BEYOND), cells.quantity
    half = {cells.quantity: cells for cells in computed(one, limits, TEXT16, small(np.float16, x))}
    assert any(Verdict.NOT_FINITE in cells.verdicts for cells in half.values())
    assert not any(cells.failures.any() for cells in half.values())  # half is measured, nothing is held to it


def test_a_text_keeps_its_type():
    law = catalogue.load("quantile")
    for dtype in (np.float16, np.float32, EXTENDED):
        text = RoundedText(law, dtype)
        assert text.call("profile", np.array([1.0]), np.array([0.5]), np.array([1.0])).dtype == dtype


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
