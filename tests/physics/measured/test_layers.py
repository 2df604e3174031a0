"""A stack of layers fitted to a profile: what photons say of it, and what rings near the beam cannot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from mcml_sim import Layer, Medium, Setting, exact
from profilefit.errors import InputError
from profilefit.measured import read
from profilefit.measured.data import Measured, widening
from profilefit.measured.instrument import PENCIL
from profilefit.measured.layers import fit_layers, solved_rows
from profilefit.measured.premises import Premises, premises
from profilefit.measured.problem import Known

DATA = Path(__file__).parents[3] / "examples"
STACK = Medium((Layer(1.4, 0.02, 2.0, 0.0, 1.0), Layer(1.4, 0.003, 1.0, 0.0)))
GUESS = Medium((Layer(1.0, 10.0, 10.0, 0.0, 0.05), Layer(1.0, 0.1, 10.0, 0.0)))  # of two_layers.mco, in cm


def rings(medium, edges, error, seed):
    value = solved_rows(medium, "searchlight", PENCIL, edges[:-1].tobytes(), edges[1:].tobytes())
    noisy = value * (1 + error * np.random.default_rng(seed).standard_normal(value.size))
    known = np.full(value.size, np.inf)
    return Measured("made up", "", edges[:-1], edges[1:], noisy, error * value, known, "as given", "mm")


@pytest.mark.slow
def test_photons_give_the_layer_that_they_crossed():
    """1e6 photons, whose errors are bounds; the thickness is .03 cm, mu_a 5 per cm."""
    data = read(DATA / "two_layers.mco")
    assert any(note.startswith("the file's 2 layers, from above: n 1, mu_a 5,") for note in data.notes)
    found = fit_layers(data, GUESS, ["d1", "mu_a1"], premises(data))
    assert found.result == "converged"
    assert found.chance > 0.5, "errors are bounds"
    for (low, high), truth in zip(found.intervals, (0.03, 5.0), strict=True):
        assert low < truth < high
        assert high < 1.1 * low
    assert found.medium.layers[1] == GUESS.layers[1], "held"


@pytest.mark.slow
def test_rings_near_the_beam_say_nothing_of_what_is_below():
    medium = Medium((Layer(1.4, 0.02, 2.0, 0.0, 4.0), Layer(1.4, 0.05, 1.0, 0.0)))
    where = Premises(Setting(n=1.4))
    near = fit_layers(rings(medium, np.geomspace(0.1, 2.0, 16), 0.02, 1), medium, ["mu_a1", "mu_a2"], where)
    assert near.loose == ("mu_a2",)
    far = fit_layers(rings(medium, np.geomspace(0.1, 40.0, 31), 0.02, 1), medium, ["mu_a1", "mu_a2"], where)
    assert far.loose == ()
    assert abs(np.log(far.values[1] / 0.05)) < 4 * far.errors[1]
    assert far.products[0][1] < far.products[1][1], "best first"
    scaled = fit_layers(rings(medium, np.geomspace(0.1, 40.0, 31), 0.02, 1), medium, ["mu_a2"], where, Known(1, 0.05))
    assert scaled.names == ("mu_a2", "scale")
    assert abs(scaled.values[1] - 1) < 0.1


@pytest.mark.slow
def test_a_scale_known_far_from_one_is_where_the_search_begins():
    data = rings(STACK, np.geomspace(0.1, 5.0, 9), 0.02, 3)
    scaled = replace(data, value=1000.0 * data.value, sigma=1000.0 * data.sigma)
    found = fit_layers(scaled, STACK, ["mu_a1"], Premises(Setting(n=1.4)), Known(1000.0, 20.0))
    assert found.result == "converged"
    assert abs(found.values[1] - 1000.0) < 3 * 20.0
    assert found.premises.setting == Setting(n=1.4)


@pytest.mark.slow
def test_errors_of_few_replicates_are_estimates():
    """The same rows, their errors known or estimated from three replicates each: a few rows agree by accident."""
    known = rings(STACK, np.geomspace(0.1, 5.0, 9), 0.02, 3)
    estimated = replace(known, freedom=np.full(known.value.size, 4.0), pooled=8.0)
    sure, unsure = (fit_layers(data, STACK, ["mu_a1"], Premises(Setting(n=1.4))) for data in (known, estimated))
    assert unsure.errors[0] == pytest.approx(sure.errors[0] * np.sqrt(widening(estimated.freedom, 1)), rel=0.05)
    wider, narrower = (np.ptp(np.log(one.intervals[0])) / one.errors[0] for one in (unsure, sure))
    assert (wider, narrower) == pytest.approx((2 * stats.t.ppf(0.975, 8.0), 2 * stats.norm.ppf(0.975)))
    assert unsure.chi2 < sure.chi2
    assert unsure.chance > sure.chance


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("n = 1.4", r"made\.csv:1: n must be 1 or left out, as of the layers that are fitted, got 1\.4"),
        ("g = 0.8", r"made\.csv:1: g must be 0 or left out, as of the layers that are fitted, got 0\.8"),
        ("n = 1.33:1.45", r"made\.csv:1: n must be one number where layers are fitted, got a range"),
        ("beam = 1mm:2mm", r"made\.csv:1: beam must be one width where layers are fitted, got a range"),
    ],
)
def test_what_a_table_states_is_what_the_layers_are(tmp_path, statement, message):
    path = tmp_path / "made.csv"
    path.write_text(f"# {statement}\nr [mm],value,sigma\n1,.5,.01\n2,.2,.01\n3,.1,.01\n")
    data = read(path)
    with pytest.raises(InputError, match=message):
        fit_layers(data, GUESS, ["d1"], premises(data))


@pytest.mark.slow
def test_its_light_is_that_of_finer_nodes():
    r = np.geomspace(0.1, 10, 6)
    wanted = exact.solve(STACK).profile(r)
    np.testing.assert_allclose(solved_rows(STACK, "searchlight", PENCIL, r.tobytes(), r.tobytes()), wanted, rtol=1e-4)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        (["n1"], "free must name quantities such as d1, mu_a2 or mu_s2, got 'n1'"),
        ([""], "free must name quantities such as d1, mu_a2 or mu_s2, got ''"),
        (["mu_a3"], "free must name one of 2 layers, got 'mu_a3'"),
        (["d2"], "free must name quantities > 0 that are finite, each once, got d2 = inf"),
        (["d1", "d1"], "free must name quantities > 0 that are finite, each once, got it twice"),
    ],
)
def test_what_cannot_be_free_is_named(free, message):
    data = read(DATA / "two_layers.mco")
    with pytest.raises(InputError, match=message):
        fit_layers(data, GUESS, free, premises(data))
