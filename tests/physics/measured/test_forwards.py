"""Fits of media that scatter forwards: g given, known as a range, or not thought of."""

import jax
import numpy as np
import pytest

from benchmarks import half_spaces, own_data
from mcml_sim import Layer, Medium, Setting
from mcml_sim.exact import forwards
from profilefit.measured import fit
from profilefit.measured.data import Measured
from profilefit.measured.model import exact_light
from profilefit.measured.premises import Premises
from profilefit.report.tables.fit_tables import fit_lines
from tests.fixtures import slow

TISSUE = Setting(n=1.4, g=0.9)
MU_A, MU_S = 0.2, 10.0  # reduced, per cm


@pytest.fixture(scope="module")
def photons():
    """2e8 photons of tissue, in cm, as a simulation's rings."""
    found = half_spaces.reference(TISSUE)
    length = 1.0 / (MU_A + MU_S / (1 - TISSUE.g))
    energy = found.energy(MU_S / (1 - TISSUE.g) * length)
    edges, areas = found.grid.r_edges * length, found.grid.r_areas * length**2
    seen = np.asarray(energy.effective_samples) > 1000
    value, error = np.asarray(energy.value), np.asarray(energy.standard_error)
    seen &= (edges[1:] * (MU_A + MU_S) > 0.02) & (error > 0)
    rings = [one[seen] for one in (edges[:-1], edges[1:], value / areas, np.maximum(error, 2e-3 * value) / areas)]
    medium = Medium((Layer(1.4, MU_A, MU_S / (1 - TISSUE.g), TISSUE.g),))
    many = np.full(rings[0].size, np.inf)
    return Measured("tissue", "", *rings, many, "photons", "cm", medium=medium, illumination="searchlight")


def off(found):
    return found.values["mu_a"] / MU_A - 1, found.values["mu_s'"] / MU_S - 1


def test_photons_of_tissue_give_their_medium(photons):
    """2 % and 1 % from all rings, 4 % and 2 % from those beyond two transport mean free paths."""
    result = fit(photons, walk=False)
    assert result.fit.spec.law.setting == TISSUE, "of the simulation"
    near, far = off(result.fit), off(fit(photons.within(0.2, None), walk=False).fit)
    assert abs(near[0]) < 0.02
    assert abs(near[1]) < 0.01
    assert abs(far[0]) < 0.04
    assert abs(far[1]) < 0.02
    isotropic = fit(photons, setting=Setting(n=1.4), walk=False).fit
    assert abs(off(isotropic)[0]) > 0.04, "a negative control: similarity"


@pytest.mark.parametrize("ranges", [{"n": (1.35, 1.45), "g": (0.7, 0.95)}, *slow({}, {"g": (0.3, 0.95)})], ids=str)
def test_what_is_open_widens_the_errors(ranges):
    one = own_data.TISSUE
    data = own_data.rows(one, np.random.default_rng(3))
    given = fit(data, setting=one.setting, walk=False).fit
    found = fit(
        data, setting=Premises(Setting(n=1.4, g=float(np.mean(ranges.get("g", 0.9)))), ranges=ranges), walk=False
    )
    errors = found.fit.errors(found.fit.total_covariance)
    own = given.errors(given.total_covariance)
    assert (errors["mu_a"] > 1.05 * own["mu_a"]) == bool(ranges)
    assert abs(found.fit.values["mu_a"] - 0.02) < 3 * errors["mu_a"]
    lines = [line.plain for line in fit_lines(found)]
    assert any(line.startswith("known as ranges: ") for line in lines) == bool(ranges)


@pytest.mark.parametrize("alpha", [0.5, 0.99])
def test_light_goes_on_beyond_the_table(alpha):
    """Beyond its farthest radius light of a fit is the table's, which decays on without a step."""
    setting = Setting(n=1.4, g=0.8)
    light, whole = exact_light(setting), forwards.light(setting)
    x = float(whole.farthest) * np.array([1.0 - 1e-9, 1.0 + 1e-9, 1.5])
    with jax.enable_x64(True):
        found, right = (np.asarray(one.ring_density(x, np.array(alpha))) for one in (light, whole))
    np.testing.assert_allclose(found, right, rtol=1e-12)
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_what_nobody_said_is_said_to_be_assumed():
    data = own_data.rows(own_data.TISSUE, np.random.default_rng(3))
    result = fit(data, walk=False)
    assert result.tissue.values["mu_a"] == pytest.approx(0.02, rel=0.1)
    told = next(line.plain for line in fit_lines(result) if "assumed; n = 1.4 and g = 0.9" in line.plain)
    assert told.startswith("n = 1 and g = 0 are assumed; ")
    assert told.endswith("give `n` and `g`, or a range")


@pytest.mark.slow
def test_intervals_hold_the_truth():
    """In 100 media, n and g given; 95 % of them within the binomial's 1e-3."""
    for one in own_data.coverage(100, False, jobs=2).values():
        assert one.held > 0.86
        assert one.wider < 3
