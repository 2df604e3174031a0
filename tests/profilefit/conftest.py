"""Laws and light that several files of tests look at, and the thresholds they share."""

import jax
import numpy as np
import pytest
from scipy.stats import norm

from mcml_sim import Grid, Setting, simulate_orders
from profilefit.laws.burley import Burley
from profilefit.laws.liang import Liang
from profilefit.laws.published import SETS
from profilefit.laws.rational import Rational

# A law's tests must not move with the records: this map is within 3e-6 of the exact A, its digits are frozen here.
NORMALISATION = Rational(Setting(), 0.45058, 2.35857, 1.36799)
EDGES = np.concatenate([[0.0], np.geomspace(0.02, 30.0, 25)])


@pytest.fixture(scope="session")
def sidak():
    """|z| that the largest of m independent normal deviates exceeds with probability 1e-3."""
    return lambda m: float(norm.isf((1 - (1 - 1e-3) ** (1 / m)) / 2))


@pytest.fixture
def x64():
    """Double precision for tests that call jax themselves."""
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="session")
def normalisation():
    return NORMALISATION


def _published(law, name):
    return next(dict(s.constants) for s in SETS if (s.law, s.name) == (law, name))


@pytest.fixture(scope="session")
def liang():
    """As printed, with b0 = 0.0641."""
    return Liang(Setting(), NORMALISATION, **_published("liang", "corrected"))


@pytest.fixture(scope="session")
def liang_printed():
    return Liang(Setting(), NORMALISATION, **_published("liang", "published"))


@pytest.fixture(scope="session")
def burley():
    return Burley(Setting(), NORMALISATION, **_published("burley", "published"))


@pytest.fixture(scope="session")
def white_run():
    """2^20 photons of the white half space, seed 2, in 25 rings."""
    return simulate_orders(Grid.from_edges(r=EDGES), 2**20, seed=2)
