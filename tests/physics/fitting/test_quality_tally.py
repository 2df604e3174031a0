"""Measures against photons, for settings without an exact answer: right where there is one to compare with."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from profilefit.fitting import quality
from profilefit.recipes import quality_tally
from profilefit.recipes.targets import RUN_EDGES, ring_edges

ALPHA = np.array([0.5, 0.9])


@pytest.fixture(scope="module")
def light():
    return simulate_orders(Grid.from_edges(r=RUN_EDGES), 2**20, seed=21, progress=False)


class Exactly:
    """The exact half space in the form of a law."""

    setting = Setting()
    profile = staticmethod(exact.profile)
    cdf = staticmethod(exact.cdf)


def test_ring_energies_are_the_integrals():
    edges = ring_edges(quality_tally.RINGS)[1:40]
    found = quality_tally.ring_energies(Exactly(), edges, 0.8)
    np.testing.assert_allclose(found, exact.reflectance(0.8) * np.diff(exact.cdf(edges, 0.8)), rtol=1e-7, atol=0)


@pytest.mark.slow
def test_the_truth_has_no_error_but_the_photons(light):
    found = quality_tally.profile_quality(Exactly(), light, ALPHA)
    # The mean of forty |z| is within a third of its expectation; ks is the largest of as many correlated errors.
    np.testing.assert_allclose(found.rel, found.rel_noise, rtol=0.5)
    assert np.all(found.ks < 4 * found.ks_noise)
    assert np.all(found.ks > 0)


@pytest.mark.slow
def test_a_law_has_the_errors_that_the_exact_measures_find(burley, light):
    found, known = quality_tally.profile_quality(burley, light, ALPHA), quality.profile_quality(burley, ALPHA)
    # Rings average over R_d, and the last one ends before 99.5 %: a tenth of the error; noise adds in squares.
    np.testing.assert_allclose(found.rel, known.rel, rtol=0.1)
    assert np.all(known.rel > 10 * found.rel_noise)
    np.testing.assert_allclose(found.ks, known.ks, atol=4 * found.ks_noise.max(), rtol=0.02)
    np.testing.assert_allclose(found.l1, known.l1, rtol=0.1)


def test_maps(normalisation, light):
    found = quality_tally.albedo_quality(normalisation, light)
    assert 0 < found.delta_A < 4 * found.delta_A_noise
    assert (found.monotone, found.at_one, found.fold) == (True, 1.0, 1.0)
    other = quality_tally.albedo_quality(replace(normalisation, c=normalisation.c * 1.05), light)
    known = quality.albedo_quality(replace(normalisation, c=normalisation.c * 1.05))
    assert other.delta_A == pytest.approx(known.delta_A, abs=4 * other.delta_A_noise)
    assert other.delta_A > 10 * other.delta_A_noise
