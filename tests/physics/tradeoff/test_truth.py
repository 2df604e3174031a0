"""Truths on the same rings: what their errors are against, and what the methods state; the scalar tracer."""

import dataclasses
import sys

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.studies.tradeoff import scalar, truth
from profilefit.studies.tradeoff.points import standings
from profilefit.studies.tradeoff.truth import MATCHED


@pytest.mark.slow
def test_reference_is_the_exact_profile_and_errors_are_those_of_the_rings_that_count():
    within = exact.cdf(truth.EDGES, truth.ALPHAS[:, None]) * np.asarray(exact.reflectance(truth.ALPHAS))[:, None]
    np.testing.assert_allclose(MATCHED.reference[MATCHED.judged], np.diff(within, axis=1)[MATCHED.judged], rtol=1e-9)
    assert MATCHED.judged.any(axis=1).all()
    assert not MATCHED.judged[:, 0].any()  # the disc within 0.01 mfp
    assert not MATCHED.judged[0, -1]  # beyond 99.5 % of the energy at alpha 0.2
    energy = MATCHED.reference.copy()
    assert MATCHED.errors(energy) == (0.0, 0.0)
    row, ring = np.argwhere(MATCHED.judged)[3]
    energy[row, ring] *= 1.1
    energy[:, 0] = 7.0  # does not count
    rms, worst = MATCHED.errors(energy)
    assert worst == pytest.approx(0.1)
    assert rms == pytest.approx(0.1 / np.sqrt(MATCHED.judged.sum()))


@pytest.mark.slow
def test_scalar_rings_are_unions_of_even_ones():
    np.testing.assert_allclose(truth.EDGES, truth.WIDTH * truth.BREAKS)

    def trace(seed, photons, mu_a, mu_s, dr, reflected):
        reflected += np.arange(reflected.size) * photons  # a ring's weight is its index

    energy, _ = truth.scalar_tracer(trace, 10, 1)
    assert energy.shape == MATCHED.reference.shape
    first, last = truth.BREAKS[-2], truth.BREAKS[-1]
    assert energy[0, -1] == pytest.approx(sum(range(first, last)))


@pytest.mark.slow
def test_order_resolved_error_is_what_it_states(sidak):
    """Each ring within its own error; with the error stated ten times too small some are not."""
    energy, stated = truth.by_orders(MATCHED, 20_000, 1)
    z = (energy / MATCHED.reference - 1.0) / stated
    judged = np.abs(z[MATCHED.judged])
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
    assert [panel.name for panel in part.panels] == ["rings", "tracers", "refracting", "stack"]
    for panel, worst in (("refracting", 1e-6), ("stack", 1e-5)):
        points = {point.label: point for point in part.points if point.panel == panel}
        assert points[truth.AS_IS].worst.value < worst < points["2e4 photons"].error.value


ALPHA = 0.8


def traced(function, photons, seed=3):
    reflected = np.zeros(101)
    events, absorbed = function(seed, photons, 1.0 - ALPHA, ALPHA, 0.05, reflected)
    return reflected, events, absorbed


def test_plain_loop_reflects_what_it_should():
    """Weights are at most 1, so so the variance of a photon is at most A (1 - A), and z is no less than this."""
    photons, expected = 4000, float(exact.reflectance(ALPHA))
    reflected, events, absorbed = traced(scalar.trace, photons)
    error = np.sqrt(expected * (1.0 - expected) / photons)
    assert abs(reflected.sum() / photons - expected) < 3.3 * error  # 1e-3 two-sided
    assert abs(reflected.sum() + absorbed - photons) < 0.01 * photons  # but for roulette's luck
    assert events > photons
    assert abs(reflected.sum() / photons - 1.2 * expected) > 3.3 * error  # negative control


def test_compiled_is_the_same_loop():
    pytest.importorskip("numba")
    for one, other in zip(traced(scalar.trace, 300), traced(scalar.compiled(), 300), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_without_numba_the_row_is_left_out_and_the_extra_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    scalar.compiled.cache_clear()
    try:
        found, notes = truth.contestants(truth.QUICK)
    finally:
        scalar.compiled.cache_clear()
    assert not [one for one in found if one.method == truth.SCALAR]
    assert notes == ["left out: the scalar tracer needs numba: pip install numba"]
