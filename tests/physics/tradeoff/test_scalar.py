"""The scalar tracer: a plain loop that gives the exact reflectance, and the same photons when compiled."""

import sys

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.studies.tradeoff import scalar, truth

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
    compiled = scalar.compiled()
    for one, other in zip(traced(scalar.trace, 300), traced(compiled, 300), strict=True):
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
