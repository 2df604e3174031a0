"""A run traced in shares, by batch numbers: the bits of one run."""

import numpy as np
import pytest

from mcml_sim import Grid, InputError, simulate_orders, trace_share
from mcml_sim.tracing import orders_batch

GRID = Grid(0.5, 8)
PHOTONS = orders_batch.BATCH_PHOTONS + 1000  # a whole batch and the beginning of another


def files(folder):
    return {path.name: path.read_bytes() for path in folder.glob("batch-*")}


def test_shares_are_the_run_and_a_share_again_is_nothing(tmp_path):
    assert [trace_share(share, 2, GRID, PHOTONS, 9, store=tmp_path) for share in (1, 0, 0)] == [1, 1, 0]
    before = files(tmp_path)
    assert len(before) == 2
    together, alone = simulate_orders(GRID, PHOTONS, 9, store=tmp_path), simulate_orders(GRID, PHOTONS, 9)
    assert np.array_equal(together.ring_order_counts, alone.ring_order_counts)
    assert together.ledger == alone.ledger
    assert files(tmp_path) == before


def test_a_longer_run_traces_a_short_batch_again(tmp_path):
    assert [trace_share(0, 1, GRID, photons, 9, store=tmp_path) for photons in (500, 1000, 500)] == [1, 1, 0]


def test_what_is_no_share_is_said(tmp_path):
    with pytest.raises(InputError, match=r"share must be a whole number >= 0 and <= 1, got 2"):
        trace_share(2, 2, GRID, 1000, store=tmp_path)
    with pytest.raises(InputError, match=r"shares must be a whole number >= 1, got 0"):
        trace_share(0, 0, GRID, 1000, store=tmp_path)
    with pytest.raises(InputError, match=r"store must be the path of a folder, got None"):
        trace_share(0, 1, GRID, 1000, store=None)
