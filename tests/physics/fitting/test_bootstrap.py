"""Batches drawn with replacement scatter as the closed form says, which knows nothing of them."""

import numpy as np
import pytest

from benchmarks.refits import Bootstrap, bootstrap, energies
from mcml_sim import Grid, InputError, Setting, simulate_orders
from profilefit.fitting.estimate import fit
from profilefit.fitting.profiles import Profiles
from profilefit.laws.rational import Rational

BATCHES, PHOTONS = 48, 2**14
ALPHA = 1.0 - np.linspace(0.9, 0.25, 6) ** 2


@pytest.fixture(scope="module")
def batches():
    grid = Grid.from_edges(r=[0.0, 1.0, 1000.0])
    return [simulate_orders(grid, PHOTONS, seed=500 + batch, progress=False) for batch in range(BATCHES)]


@pytest.fixture(scope="module")
def one(batches, normalisation):
    profiles = Profiles.from_orders(batches[0].merged([0.0, 1000.0]), ALPHA)
    return fit(profiles, normalisation, "reflectance", ("b", "c"), jackknife=False)


@pytest.mark.slow
def test_the_scatter_of_batches_is_the_closed_form(batches, one):
    """A run of all batches has the error of one over sqrt(48); 48 batches know it to a tenth."""
    found = bootstrap(batches, one, number=400, seed=1)
    assert found.failed == 0
    assert found.constants.shape == (400, 2)
    ratio = found.standard_error * np.sqrt(BATCHES) / np.sqrt(np.diag(one.statistical))
    # Four of 1/sqrt(2 * 48), and 3.5 % for each of the 400 resamples' own scatter and the one batch's covariance.
    np.testing.assert_allclose(ratio, 1.0, atol=0.45)
    # Negative control: the misfit taken for noise is another number.
    wrong = np.sqrt(np.diag(one.misfit) / BATCHES)
    assert np.all(np.abs(found.standard_error / wrong - 1.0) > 0.45)


@pytest.mark.slow
def test_energies_are_those_of_the_batches(batches, one):
    found = energies(batches, one)
    assert found.shape == (BATCHES, ALPHA.size, 2)
    np.testing.assert_allclose(found[3].sum(axis=1), batches[3].reflectance(ALPHA).value, rtol=1e-12)


def test_too_little_scatter_of_few_batches_is_put_right():
    """B of B drawn with replacement have (B - 1)/B of the variance."""
    values = np.random.default_rng(3).standard_normal((500, 2))
    plain = np.cov(values, rowvar=False)
    np.testing.assert_allclose(Bootstrap(("a", "b"), values, 0, 10).covariance, plain * 10 / 9, rtol=1e-12)


@pytest.mark.slow
def test_batches_must_be_alike(batches, one):
    with pytest.raises(InputError, match="batches must be at least 10, got 3"):
        bootstrap(batches[:3], one)
    with pytest.raises(InputError, match="batches must be of different seeds, got one twice"):
        bootstrap([*batches, batches[0]], one)
    small = simulate_orders(batches[0].grid, 1000, seed=1, progress=False)
    with pytest.raises(InputError, match="batches must be of equally many photons, got different ones"):
        bootstrap([*batches, small], one)
    diffuse = [simulate_orders(batches[0].grid, 1000, s, Setting("diffuse"), progress=False) for s in range(10)]
    with pytest.raises(InputError, match=r"batches must belong to searchlight.*got another setting"):
        bootstrap(diffuse, one)
    assert isinstance(one.law, Rational)
