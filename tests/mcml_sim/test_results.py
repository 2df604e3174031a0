"""Results on disk: every estimate comes back as it was."""

import json

import numpy as np
import pytest

from mcml_sim import Grid, InputError, Layer, Medium, simulate_orders
from mcml_sim.deposits import Deposits, shapes
from mcml_sim.quantities import Tally
from mcml_sim.results import read_results, write_results
from mcml_sim.simulation import simulate

LAYERS = Medium((Layer(1.3, 1, 9, 0.7, 0.1), Layer(1.4, 2, 8, 0.5)), n_above=1.1, n_below=1.2)


def made_up(medium: Medium, grid: Grid) -> Tally:
    draw = np.random.default_rng(5)
    sums = {name: 1 + draw.random(shape) for name, shape in shapes(grid, len(medium.layers)).items()}
    return Tally(medium, grid, 1000, 3, Deposits(**{**sums, "started": 1000}))


@pytest.mark.parametrize(
    "grid",
    [Grid(0.1, 4), Grid(0.1, 4, na=3), Grid(0.1, 4, 0.2, 5, na=3), Grid.from_edges(r=[0, 1, 3], z=[0, 0.1, 4], na=2)],
)
def test_everything_comes_back(tmp_path, grid):
    tally = made_up(LAYERS, grid)
    write_results(tally, tmp_path / "out.npz")
    found = read_results(str(tmp_path / "out.npz"))
    assert (found.medium, found.grid, found.photons, found.seed) == (LAYERS, grid, 1000, 3)
    assert found.cut == tally.cut > 0
    assert tuple(found.estimates) == tally.quantities
    for name, estimate in found.estimates.items():
        expected = tally.quantity(name)
        assert type(estimate.value) is type(expected.value)
        for field in ("value", "standard_error", "effective_samples"):
            np.testing.assert_array_equal(getattr(estimate, field), getattr(expected, field))


def test_numpy_alone_opens_it(tmp_path):
    tally = made_up(LAYERS, Grid(0.1, 4, 0.2, 5))
    write_results(tally, tmp_path / "out.npz")
    with np.load(tmp_path / "out.npz", allow_pickle=False) as fields:
        np.testing.assert_array_equal(fields["absorbed_rz"], tally.absorbed_rz.value)
        np.testing.assert_array_equal(fields["absorbed_rz_standard_error"], tally.absorbed_rz.standard_error)
        np.testing.assert_array_equal(fields["z_edges"], tally.grid.z_edges)
        header = json.loads(str(fields["header"]))
    assert header["medium"]["layers"][0] == {"n": 1.3, "mu_a": 1, "mu_s": 9, "g": 0.7, "thickness": 0.1}
    assert (header["photons"], header["seed"], header["format"]) == (1000, 3, 1)


def test_equal_runs_give_equal_bytes(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        tally = simulate(LAYERS, Grid(0.1, 4), 1000, seed=seed, progress=False)
        write_results(tally, tmp_path / f"{name}.npz")
    a, b, c = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def damage(path, how):
    data = path.read_bytes()
    with np.load(path) as fields:
        arrays = dict(fields)
    if how == "cut":
        path.write_bytes(data[: len(data) // 2])
    elif how == "text":
        path.write_bytes(b"not a zip file")
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "missing":
        path.unlink()
    elif how == "format":
        header = {**json.loads(str(arrays["header"])), "format": 2}
        np.savez(path, **{**arrays, "header": np.array(json.dumps(header))})
    elif how == "layer":
        header = json.loads(str(arrays["header"]))
        header["medium"]["layers"][0]["mu_a"] = -1
        np.savez(path, **{**arrays, "header": np.array(json.dumps(header))})
    else:
        del arrays[how]
        np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("cut", "not a whole .npz file"),
        ("text", "not a whole .npz file"),
        ("empty", "not a whole .npz file"),
        ("missing", "No such file or directory"),
        ("format", "format 2, not 1"),
        ("layer", "mu_a must be a coefficient >= 0, got -1"),
        ("header", "header"),
        ("absorbed_rz", "absorbed_rz"),
        ("r_edges", "r_edges"),
    ],
)
def test_a_damaged_file_is_named(tmp_path, how, reason):
    path = tmp_path / "out.npz"
    write_results(made_up(LAYERS, Grid(0.1, 4, 0.2, 5)), path)
    damage(path, how)
    with pytest.raises(InputError, match=rf"out.npz: expected results of mcml_sim, got: .*{reason}"):
        read_results(path)


def test_misuse_is_named(tmp_path):
    tally = made_up(LAYERS, Grid(0.1, 4))
    orders = simulate_orders(Grid(1, 2), 10, progress=False)
    for wrong in (orders, None, tmp_path / "out.npz"):
        with pytest.raises(InputError, match=r"^tally must be what simulate gave, got [^\n]{1,40}$"):
            write_results(wrong, tally)
    for wrong in (None, 3, tally):
        with pytest.raises(InputError, match=r"^path must be the name of a file, got [^\n]{1,40}$"):
            write_results(tally, wrong)
