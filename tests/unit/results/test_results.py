"""Results on disk: every estimate comes back as it was."""

import json

import numpy as np
import pytest

from mcml_sim import Grid, InputError, Layer, Medium, simulate_orders
from mcml_sim.results.tally import Tally, read_results, write_results
from mcml_sim.runs.simulation import simulate
from mcml_sim.tracing.deposits import Deposits, shapes

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


@pytest.mark.slow
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


def layer(**changes):
    return {"n": 1.3, "mu_a": 1, "mu_s": 9, "g": 0.7, "thickness": 0.1} | changes


HEADERS = {
    "photons 0": ({"photons": 0}, "photons must be a whole number >= 1 and <= 1e\\+13, got 0"),
    "photons true": ({"photons": True}, "photons must be a whole number .*, got True"),
    "photons text": ({"photons": "9"}, "photons must be a whole number .*, got '9'"),
    "photons list": ({"photons": [1] * 1000}, r"photons must be a whole number .*, got \[1, 1.*\.\.\.$"),
    "photons long": ({"photons": 10**400}, "a whole number of 401 digits"),
    "seed": ({"seed": 1.5}, "seed must be a whole number >= 0, got 1.5"),
    "cut": ({"cut": "0"}, "cut must be a share of the light, got '0'"),
    "cut nan": ({"cut": float("nan")}, "NaN, which is no number"),
    "version": ({"mcml_sim": "1\x1b[2J"}, r"mcml_sim must be a version, got '1\\x1b\[2J'"),
    "format true": ({"format": True}, "format True, not 1"),
    "unknown": ({"colour": 1}, "header has the unknown key 'colour'"),
    "medium": ({"medium": [1]}, r"medium must be an object, got \[1\]"),
    "n_above": ({"medium": {"layers": [layer()], "n_above": "1", "n_below": 1}}, "n_above must be .*, got '1'"),
    "n_below": ({"medium": {"layers": [layer()], "n_above": 1}}, "medium has no key 'n_below'"),
    "layers": ({"medium": {"layers": {}, "n_above": 1, "n_below": 1}}, "layers must be a list of at most 1000, got {}"),
    "layer": ({"medium": {"layers": [3], "n_above": 1, "n_below": 1}}, "layer 1 must be an object, got 3"),
    "no layer": ({"medium": {"layers": [], "n_above": 1, "n_below": 1}}, "a medium must have 1 to 1000 layers, got 0"),
    "depth": (
        {"medium": {"layers": [layer(depth=1)], "n_above": 1, "n_below": 1}},
        "layer 1 has the unknown key 'depth'",
    ),
    "mu_a": (
        {"medium": {"layers": [layer(mu_a=True)], "n_above": 1, "n_below": 1}},
        "mu_a must be a coefficient >= 0, got True",
    ),
    "other layers": (
        {"medium": {"layers": [layer()], "n_above": 1, "n_below": 1}},
        r"'absorbed_per_layer' must have the shape \(1,\), got \(2,\)",
    ),
}
FIELDS = {
    "deep header": ({"header": np.array("[" * 100_000)}, "tables or lists nested more than 32 deep"),
    "twice": ({"header": np.array('{"format": 1, "format": 1}')}, "the key 'format' twice in one object"),
    "header": ({"header": np.array(3)}, "'header' must be one text"),
    "rings": ({"r_edges": np.arange(6.0)}, r"'reflectance_r' must have the shape \(5,\), got \(4,\)"),
    "edges": ({"r_edges": np.array([0, 2, 1, 3.0])}, "r must rise, got 1 after 2"),
    "edges inf": ({"r_edges": np.array([0, 2, np.inf])}, "r must be finite edges"),
    "edges text": ({"r_edges": np.array(["0", "1"])}, "'r_edges' must be real numbers"),
    "cells": ({"r_edges": np.arange(65537.0), "z_edges": np.arange(65537.0)}, "grid must have at most 2097152 bins"),
    "angles": ({"a_edges": np.array([0, 0.1, 1, 1.5])}, "a_edges must be even from 0 to pi/2"),
    "angles 2": ({"a_edges": np.zeros((2, 2))}, "a_edges must be even from 0 to pi/2"),
    "value": ({"reflectance_r": np.array([1, np.nan, 1, 1])}, "reflectance_r must be finite"),
    "truth": ({"reflectance_r": np.ones(4, bool)}, "'reflectance_r' is no array of numbers or text"),
    "objects": ({"reflectance_r": np.array([None] * 4)}, "'reflectance_r' is no array of numbers or text"),
    "error": ({"absorbed_standard_error": np.array(-1.0)}, "absorbed_standard_error must be >= 0"),
    "error nan": ({"absorbed_standard_error": np.array(np.nan)}, "absorbed_standard_error must be >= 0"),
    "samples": ({"energy_effective_samples": np.array(np.nan)}, "energy_effective_samples must be >= 0"),
}  # fmt: skip


@pytest.mark.parametrize(("changes", "reason"), [*HEADERS.values(), *FIELDS.values()], ids=[*HEADERS, *FIELDS])
def test_what_no_run_wrote_is_one_line(tmp_path, changes, reason):
    path = tmp_path / "out.npz"
    write_results(made_up(LAYERS, Grid(0.1, 4, 0.2, 5, na=3)), path)
    with np.load(path) as whole:
        arrays = dict(whole)
    if not set(changes) <= set(arrays):
        changes = {"header": np.array(json.dumps(json.loads(str(arrays["header"])) | changes))}
    np.savez(path, **{**arrays, **changes})
    with pytest.raises(InputError, match=rf"^\S*out.npz: expected results of mcml_sim, got: {reason}") as error:
        read_results(path)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("photons", [1, 77])
def test_few_photons_come_back_with_an_infinite_error(tmp_path, photons):
    """Of what is absorbed, errors come from the spread between groups of photons: of one group there is none."""
    tally = simulate(LAYERS, Grid(0.1, 4, 0.2, 5), photons, store=tmp_path / "store", progress=False)
    write_results(tally, tmp_path / "out.npz")
    found = read_results(tmp_path / "out.npz")
    assert found.photons == photons
    assert np.all(np.isinf(found.estimates["absorbed_rz"].standard_error))
    again = simulate(LAYERS, Grid(0.1, 4, 0.2, 5), photons, store=tmp_path / "store", progress=False)
    assert np.all(np.isinf(again.absorbed_rz.standard_error)), "the batch in the store is whole"


def test_misuse_is_named(tmp_path):
    tally = made_up(LAYERS, Grid(0.1, 4))
    orders = simulate_orders(Grid(1, 2), 10, progress=False)
    for wrong in (orders, None, tmp_path / "out.npz"):
        with pytest.raises(InputError, match=r"^tally must be what simulate gave, got [^\n]{1,40}$"):
            write_results(wrong, tally)
    for wrong in (None, 3, tally):
        with pytest.raises(InputError, match=r"^path must be the name of a file, got [^\n]{1,40}$"):
            write_results(tally, wrong)
