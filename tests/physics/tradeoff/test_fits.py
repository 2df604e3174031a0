"""Distances of fitted laws from their noise-free limit."""

import numpy as np
import pytest

from profilefit.recipes import catalogue
from profilefit.studies.tradeoff import fits
from profilefit.studies.tradeoff.fits import FittedConstants, Trial


@pytest.fixture(scope="module")
def law():
    return catalogue.load("liang", "corrected")


def test_change_is_that_of_the_energies(law):
    """a and b a hundredth larger, and c as it was: so is every ring's energy."""
    assert fits.change(law, law) == (0.0, 0.0)
    larger = fits.with_constants(law, {name: 1.01 * getattr(law, name) for name in ("a1", "a2", "b0")})
    energy, counts = fits.judged()
    share = np.diff(fits.energy_within(law), axis=1)[counts] / energy[counts]
    rms, worst = fits.change(larger, law)
    assert rms == pytest.approx(0.01 * np.sqrt(np.mean(share**2)), rel=1e-9)
    assert worst == pytest.approx(0.01 * share.max(), rel=1e-9)


def test_standardised_is_in_standard_errors():
    limit = FittedConstants({"a": 1.0, "b": 2.0}, {}, "converged")
    found = FittedConstants({"a": 1.3, "b": 1.2}, {"a": 0.1, "b": 0.2}, "converged")
    assert fits.standardised(found, limit) == pytest.approx(np.sqrt((9.0 + 16.0) / 2.0))
    assert np.isnan(fits.standardised(limit, limit))


def test_points_have_the_spread_of_the_seeds_and_failures_are_told():
    trials = [Trial(0.1 * k, 1.0, 0.01 * k, 0.1 * k, 1.0, k != 2) for k in (1, 2, 3)]
    alone, whole = (fits.point_of(panel, "way", 10**6, trials) for panel in ("fit", "whole"))
    assert alone.cost.value == pytest.approx(0.2)
    assert whole.cost.value == pytest.approx(1.2)
    assert alone.error.value == pytest.approx(0.02)
    assert alone.error.low < alone.error.value < alone.error.high
    assert alone.label == "1e6 photons"
    assert alone.facts["converged"] == 2
    notes = fits.notes_of({("way", 10**6): trials}, {"way": 3.0})
    assert notes == (
        "1 of 3 did not converge: way, 1e+06 photons",
        "first fits, which compile, not in the times [s]: way 3.0",
    )


@pytest.mark.slow
def test_more_photons_move_the_law_less():
    part = fits.measure(fits.FitSizes((1_000_000, 20_000_000), (), 3))
    alone = {(point.method, point.facts["photons"]): point for point in part.panels[0].points}
    for method in (fits.ALL_AT_ONCE, fits.TWO_STAGES):
        few, many = alone[method, 1_000_000], alone[method, 20_000_000]
        assert many.error.value < few.error.value
        assert few.facts["converged"] == many.facts["converged"] == 3
    whole = part.panels[1].points
    assert all(point.cost.value > alone[point.method, point.facts["photons"]].cost.value for point in whole)
