import pickle

import numpy as np
import pytest

from mcml_sim import Grid, InputError


def test_even_rings_have_the_edges_and_areas_of_circles():
    grid = Grid(0.5, 4)
    np.testing.assert_array_equal(grid.r_edges, [0, 0.5, 1, 1.5, 2])
    np.testing.assert_allclose(np.cumsum(grid.r_areas), np.pi * grid.r_edges[1:] ** 2, rtol=1e-15)
    assert grid.rings == 4


def test_grids_are_equal_by_value_and_cannot_change():
    grid, same, other = Grid(0.5, 2), Grid.from_edges(r=[0, 0.5, 1]), Grid.from_edges(r=[0, 0.5, np.nextafter(1, 2)])
    assert grid == same
    assert hash(grid) == hash(same)
    assert grid.digest == same.digest
    assert grid != other
    assert grid.digest != other.digest
    assert pickle.loads(pickle.dumps(grid)) == grid
    with pytest.raises(ValueError, match="read-only"):
        grid.r_edges[0] = 1
    with pytest.raises(AttributeError):
        grid.r_edges = same.r_edges


def test_grid_keeps_its_own_copy_of_the_edges():
    edges = np.array([0.0, 1.0])
    grid = Grid.from_edges(r=edges)
    edges[1] = 2
    assert grid.r_edges[1] == 1


@pytest.mark.parametrize("dr", [0, -1, np.nan, np.inf, "1", None, True])
def test_ring_width_must_be_positive(dr):
    with pytest.raises(InputError, match=r"dr must be a ring width > 0, got"):
        Grid(dr, 3)


@pytest.mark.parametrize("nr", [0, -1, 2.5, None, True, 10**9])
def test_ring_number_must_be_whole(nr):
    with pytest.raises(InputError, match=r"nr must be a whole number of rings from 1 to 65536, got"):
        Grid(0.1, nr)


@pytest.mark.parametrize(
    ("edges", "reason"),
    [
        ([0.1, 1], "start at 0"),
        ([0, 1, 1], "must rise, got 1 after 1"),
        ([0, 2, 1], "must rise, got 1 after 2"),
        ([0, np.nan], "finite"),
        ([0, np.inf], "finite"),
        ([0], "2 to"),
        ([[0, 1]], "shape"),
        ("edges", "numbers"),
    ],
)
def test_edges_must_rise_from_zero(edges, reason):
    with pytest.raises(InputError, match=reason):
        Grid.from_edges(r=edges)
