"""Truths on the same rings: what their errors are against, and that they are what the methods state."""

import dataclasses

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.studies.tradeoff import truth
from profilefit.studies.tradeoff.points import standings


@pytest.mark.slow
def test_reference_is_the_exact_profile():
    within = exact.cdf(truth.EDGES, truth.ALPHAS[:, None]) * np.asarray(exact.reflectance(truth.ALPHAS))[:, None]
    np.testing.assert_allclose(truth.reference()[truth.judged()], np.diff(within, axis=1)[truth.judged()], rtol=1e-9)
    assert truth.judged().any(axis=1).all()
    assert not truth.judged()[:, 0].any()  # the disc within 0.01 mfp
    assert not truth.judged()[0, -1]  # beyond 99.5 % of the energy at alpha 0.2


@pytest.mark.slow
def test_errors_are_those_of_the_rings_that_count():
    energy = truth.reference().copy()
    assert truth.errors(energy) == (0.0, 0.0)
    row, ring = np.argwhere(truth.judged())[3]
    energy[row, ring] *= 1.1
    energy[:, 0] = 7.0  # does not count
    rms, worst = truth.errors(energy)
    assert worst == pytest.approx(0.1)
    assert rms == pytest.approx(0.1 / np.sqrt(truth.judged().sum()))


@pytest.mark.slow
def test_scalar_rings_are_unions_of_even_ones():
    np.testing.assert_allclose(truth.EDGES, truth.WIDTH * truth.RINGS)

    def trace(seed, photons, mu_a, mu_s, dr, reflected):
        reflected += np.arange(reflected.size) * photons  # a ring's weight is its index

    energy = truth.scalar_tracer(trace, 10)(1).energy
    assert energy.shape == truth.reference().shape
    first, last = truth.RINGS[-2], truth.RINGS[-1]
    assert energy[0, -1] == pytest.approx(sum(range(first, last)))


def test_order_resolved_error_is_what_it_states(sidak):
    """Each ring within its own error; with the error stated ten times too small some are not."""
    answer = truth.by_orders(20_000)(1)
    z = (answer.energy / truth.reference() - 1.0) / answer.stated
    judged = np.abs(z[truth.judged()])
    limit = sidak(judged.size)
    assert judged.max() < limit
    assert 10.0 * judged.max() > limit


@pytest.mark.slow
def test_all_of_them_small():
    sizes = dataclasses.replace(truth.QUICK, scalar=(1000,), simulate=(20_000,), orders=(20_000,), turns=2)
    part = truth.measure(sizes)
    by_method = {point.method: point for point in part.panels[0].points}
    exactly = by_method.pop(truth.EXACT)
    assert exactly.worst.value < 1e-9
    assert standings(part.panels[0].points)[-1] == "front"
    for point in by_method.values():
        assert 1e-3 < point.error.value < point.worst.value < 10.0
        assert point.cost.low <= point.cost.value <= point.cost.high
    ours = by_method[truth.SIMULATE]
    assert ours.error.value == pytest.approx(ours.facts["stated"], rel=0.5)
    assert "compiling" in part.notes[-1]
    assert {p.panel for p in part.points} == {"rings", "tracers"}
