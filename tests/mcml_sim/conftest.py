"""One run that several files of tests look at, and the thresholds they share."""

import signal

import numpy as np
import pytest
from scipy.stats import norm

from mcml_sim import Grid, simulate_orders

# From far inside a mean free path to where only photons of high albedo arrive.
EDGES = np.concatenate([[0.0], np.geomspace(0.01, 30.0, 40)])


@pytest.fixture(scope="session")
def run():
    """4 batches of the order-resolved run, seed 1."""
    return simulate_orders(Grid.from_edges(r=EDGES), 2**22, seed=1)


@pytest.fixture(scope="session")
def sidak():
    """|z| that the largest of m independent normal deviates exceeds with probability 1e-3."""
    return lambda m: float(norm.isf((1 - (1 - 1e-3) ** (1 / m)) / 2))


@pytest.fixture
def python_handles_sigint():
    """As in a terminal; a process started in the background inherits a deaf ear."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
