"""What counts as right agrees with the law in float64 where that is sure, and shows what narrower formats do."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.fitting.quality import profile_quality
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find, profile_laws
from profilefit.shader.check.bounds import ALBEDOS
from profilefit.studies.stability.cells import EXTENDED, RoundedText, Verdict
from profilefit.studies.stability.law_cells import MEASURED, Reference, computed, limits_of
from profilefit.studies.stability.layout import CDF, PDF, PROFILE, SAMPLE, TEXT16, TEXT32, ArgumentGrid

FITS = catalogue.fits_folder()


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
