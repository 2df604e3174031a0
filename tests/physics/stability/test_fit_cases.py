"""Fits from anywhere: shares that converge, and a name for each that does not."""

from dataclasses import replace

import numpy as np
import pytest

from profilefit.recipes import catalogue
from profilefit.studies.stability import fit_cases


@pytest.mark.slow
def test_the_rational_map_is_found_from_anywhere():
    cases = {
        (one.case, one.value): one for one in fit_cases.fits_of(catalogue.albedo_law("rational"), "reflectance", "r", 6)
    }
    random = cases[fit_cases.STARTS, "× e^(0.69 normal)"]
    assert random.converged > 0.5
    assert random.spread < 1e-6
    noise = [cases[fit_cases.NOISE, f"{photons:.0e} photons"].spread for photons in (1e4, 1e6, 1e8)]
    assert noise[0] > noise[1] > noise[2] > 0
    nonsense = [one for (case, _), one in cases.items() if case == fit_cases.NONSENSE]
    assert nonsense
    assert all(one.converged == 0 and one.results[0][0] for one in nonsense)
    assert not any(one.is_failure for one in cases.values())


def test_wider_rings_keep_the_last_radius_and_the_light():
    usual = fit_cases.even_rings(fit_cases.ORDINARY, fit_cases.LAST)
    wide = fit_cases.merged_rings(usual, 8)
    assert wide.r_edges[-1] == usual.r_edges[-1] == fit_cases.LAST
    np.testing.assert_allclose(np.unique(wide.r_edges), usual.r_edges[::8])
    np.testing.assert_allclose(wide.cdf[:, -1], usual.cdf[:, -1], rtol=1e-6)
    np.testing.assert_allclose(wide.energy[:, 8], np.sum(usual.energy[:, 8:16], axis=1), rtol=1e-6)
    assert wide.energy.shape == usual.energy.shape
    assert np.all(wide.energy[wide.used == 0] == 0)


def test_a_fit_that_accepts_nonsense_is_a_failure():
    case = fit_cases.FitCase("f", fit_cases.NONSENSE, "NaN in the data", 1.0, 1.0, 0.0, "a", (("converged", 1),))
    assert case.is_failure
    assert not replace(case, converged=0.0, results=(("the residual is not finite there", 1),)).is_failure
    assert replace(case, converged=0.0, results=(("", 1),)).is_failure
