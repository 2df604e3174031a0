import hashlib
import pickle

import numpy as np
import pytest

from mcml_sim import Grid, InputError
from tests.fixtures import refused


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
    edges = np.array([0.0, 1.0])
    own = Grid.from_edges(r=edges)
    edges[1] = 2
    assert own.r_edges[1] == 1, "it keeps its own copy"


def test_grids_differ_by_what_they_resolve():
    grids = [Grid(0.5, 2), Grid(0.5, 3), *(Grid(0.5, 2, na=na) for na in (1, 2))]
    grids += [
        Grid(0.5, 2, dz, nz, na=na) for dz, nz, na in ((0.5, 2, None), (0.5, 3, None), (0.4, 2, None), (0.5, 2, 2))
    ]
    assert (len({grid.digest for grid in grids}), len(set(grids))) == (len(grids), len(grids))
    assert grids[0] != "grid"


def test_digests_are_those_that_stores_hold_and_a_grid_tells_of_itself():
    """A store of an earlier version is recognised: rings alone hash as they did before there were other bins."""
    assert repr(Grid(0.5, 2)).startswith("Grid(2 annuli to r = 1, ")
    assert repr(Grid(0.5, 2, 0.25, 3, na=4)).startswith("Grid(2 annuli to r = 1, 3 depths to z = 0.75, 4 angles, ")
    assert Grid(0.5, 2).digest == hashlib.sha256(np.array([0.0, 0.5, 1.0]).astype("<f8").tobytes()).hexdigest()
    assert Grid(0.5, 2).digest == "9536689a4941c84ded438e9002674c39b2d5d1024a7b34232ee82e4cd4664931"
    assert Grid(0.5, 2, 0.25, 3, na=4).digest == "0e2cb61b5b804b55a01d345d56dc14d6237259ab9fd8e70d7f0790ef0f2228e9"


def test_rings_and_depths_are_even_or_as_given():
    grid = Grid(0.5, 4, 0.25, 3, na=2)
    np.testing.assert_array_equal(grid.r_edges, [0, 0.5, 1, 1.5, 2])
    np.testing.assert_allclose(np.cumsum(grid.r_areas), np.pi * grid.r_edges[1:] ** 2, rtol=1e-15)
    assert grid.rings == 4
    np.testing.assert_array_equal(grid.z_edges, [0, 0.25, 0.5, 0.75])
    np.testing.assert_array_equal(grid.z_widths, [0.25] * 3)
    uneven = Grid.from_edges(r=[0, 1, 4], z=[0, 2, 3], na=2)
    np.testing.assert_array_equal(uneven.z_widths, [2, 1])
    np.testing.assert_allclose(uneven.r_areas, [np.pi, 15 * np.pi])
    assert (uneven.rings, uneven.depths, uneven.angles) == (2, 2, 2)
    assert uneven == Grid.from_edges(r=(0.0, 1, 4), z=np.array([0, 2, 3]), na=np.int64(2))
    with pytest.raises(ValueError, match="read-only"):
        uneven.z_edges[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        uneven.a_edges[0] = 1


@pytest.mark.parametrize("na", [1, 2, 30, 1000])
def test_solid_angles_fill_the_hemisphere(na):
    grid = Grid(1, 1, na=na)
    edges = grid.a_edges
    assert (edges[0], edges[-1]) == (0, np.pi / 2)
    np.testing.assert_allclose(np.diff(edges), np.pi / 2 / na, rtol=1e-12)
    assert grid.solid_angles.sum() == pytest.approx(2 * np.pi, rel=1e-13)
    np.testing.assert_allclose(grid.solid_angles, -2 * np.pi * np.diff(np.cos(edges)), rtol=1e-9)


def test_what_is_not_resolved_is_none_and_said():
    grid = Grid(0.5, 2)
    assert (grid.z_edges, grid.a_edges, grid.depths, grid.angles) == (None, None, 0, 0)
    with pytest.raises(InputError, match="this grid resolves no depths, give it dz and nz"):
        _ = grid.z_widths
    with pytest.raises(InputError, match="this grid resolves no angles, give it na"):
        _ = grid.solid_angles
    for more in ({"dz": 0.1}, {"nz": 3}):
        refused("dz and nz must be given together, got dz = ", Grid, 0.1, 3, **more)


@pytest.mark.parametrize("width", [0, -1, np.nan, np.inf, "1", None, True])
def test_widths_must_be_positive(width):
    refused(r"dr must be a width > 0 of the bins, got", Grid, width, 3)
    if width is not None:
        refused(r"dz must be a width > 0 of the bins, got", Grid, 0.1, 3, width, 3)


@pytest.mark.parametrize("number", [0, -1, 2.5, "2", None, True, 10**9])
def test_numbers_of_bins_must_be_whole(number):
    said = "must be a whole number of bins from 1 to 65536, got"
    refused(f"nr {said}", Grid, 0.1, number)
    if number is not None:
        refused(f"nz {said}", Grid, 0.1, 3, 0.1, number)
        refused(f"na {said}", Grid, 0.1, 3, na=number)
        refused(f"na {said}", Grid.from_edges, r=[0, 1], na=number)


@pytest.mark.parametrize(
    ("edges", "reason"),
    [
        ([0.1, 1], "must start at 0, .*, got a first edge of 0.1"),
        ([0, 1, 1], "must rise, got 1 after 1"),
        ([0, 2, 1], "must rise, got 1 after 2"),
        ([0, np.inf], "must be finite edges, got inf among them"),
        ([0, np.nan], "must be finite edges, got nan among them"),
        ([0], "must be a list of 2 to 65537 edges, got an array of shape"),
        ([[0, 1]], "must be a list of 2 to 65537 edges, got an array of shape"),
        (np.arange(65538), "must be a list of 2 to 65537 edges, got an array of shape"),
        ("edges", "must be numbers, the edges of the bins, got 'edges'"),
    ],
)
def test_edges_must_rise_from_zero(edges, reason):
    refused(f"r {reason}", Grid.from_edges, r=edges)
    refused(f"z {reason}", Grid.from_edges, r=[0, 1], z=edges)
