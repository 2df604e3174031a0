"""Results: estimates from counts of photons, and on disk, where every one comes back as it was."""

import json

import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, simulate_orders
from mcml_sim.results.estimate import Estimate, covariance_factor, estimate
from mcml_sim.results.tally import read_results, write_results
from mcml_sim.runs.simulation import simulate
from mcml_sim.tracing.order_bins import Counts
from tests.fixtures import refused
from tests.unit.results.test_mco import made_up

LAYERS = Medium((Layer(1.3, 1, 9, 0.7, 0.1), Layer(1.4, 2, 8, 0.5)), n_above=1.1, n_below=1.2)


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
    for name, kept in found.estimates.items():
        expected = tally.quantity(name)
        assert type(kept.value) is type(expected.value)
        for field in ("value", "standard_error", "effective_samples"):
            np.testing.assert_array_equal(getattr(kept, field), getattr(expected, field))


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


def test_a_damaged_file_is_named(tmp_path):
    path = tmp_path / "out.npz"
    write_results(made_up(LAYERS, Grid(0.1, 4, 0.2, 5)), path)
    whole = path.read_bytes()
    for content in (whole[: len(whole) // 2], b"not a zip file", b""):
        path.write_bytes(content)
        refused(r"out.npz: expected results of mcml_sim, got: not a whole .npz file", read_results, path)
    path.unlink()
    refused(r"out.npz: expected results of mcml_sim, got: No such file or directory", read_results, path)


def layer(**changes):
    return {"n": 1.3, "mu_a": 1, "mu_s": 9, "g": 0.7, "thickness": 0.1} | changes


def medium(*layers, **changes):
    return {"medium": {"layers": list(layers), "n_above": 1, "n_below": 1} | changes}


HEADERS = {
    "photons 0": ({"photons": 0}, "photons must be a whole number >= 1 and <= 1e\\+13, got 0"),
    "photons true": ({"photons": True}, "photons must be a whole number .*, got True"),
    "photons list": ({"photons": [1] * 1000}, r"photons must be a whole number .*, got \[1, 1.*\.\.\.$"),
    "photons long": ({"photons": 10**400}, "a whole number of 401 digits"),
    "seed": ({"seed": 1.5}, "seed must be a whole number >= 0, got 1.5"),
    "cut": ({"cut": "0"}, "cut must be a share of the light, got '0'"),
    "cut nan": ({"cut": float("nan")}, "NaN, which is no number"),
    "version": ({"mcml_sim": "1\x1b[2J"}, r"mcml_sim must be a version, got '1\\x1b\[2J'"),
    "format": ({"format": 2}, "format 2, not 1"),
    "format true": ({"format": True}, "format True, not 1"),
    "unknown": ({"colour": 1}, "header has the unknown key 'colour'"),
    "medium": ({"medium": [1]}, r"medium must be an object, got \[1\]"),
    "n_below": ({"medium": {"layers": [layer()], "n_above": 1}}, "medium has no key 'n_below'"),
    "layers": (medium(layers={}), "layers must be a list of at most 1000, got {}"),
    "layer": (medium(3), "layer 1 must be an object, got 3"),
    "depth": (medium(layer(depth=1)), "layer 1 has the unknown key 'depth'"),
    "mu_a": (medium(layer(mu_a=-1)), "mu_a must be a coefficient >= 0, got -1"),
    "other layers": (medium(layer()), r"'absorbed_per_layer' must have the shape \(1,\), got \(2,\)"),
}
FIELDS = {
    **{f"no {name}": ({name: None}, f"no {name}") for name in ("header", "absorbed_rz", "r_edges")},
    "twice": ({"header": np.array('{"format": 1, "format": 1}')}, "the key 'format' twice in one object"),
    "rings": ({"r_edges": np.arange(6.0)}, r"'reflectance_r' must have the shape \(5,\), got \(4,\)"),
    "edges": ({"r_edges": np.array([0, 2, 1, 3.0])}, "r must rise, got 1 after 2"),
    "cells": ({"r_edges": np.arange(65537.0), "z_edges": np.arange(65537.0)}, "grid must have at most 2097152 bins"),
    "angles": ({"a_edges": np.array([0, 0.1, 1, 1.5])}, "a_edges must be even from 0 to pi/2"),
    "angles 2": ({"a_edges": np.zeros((2, 2))}, "a_edges must be even from 0 to pi/2"),
    "value": ({"reflectance_r": np.array([1, np.nan, 1, 1])}, "reflectance_r must be finite"),
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
    np.savez(path, **{name: values for name, values in {**arrays, **changes}.items() if values is not None})
    refused(rf"^\S*out.npz: expected results of mcml_sim, got: {reason}", read_results, path)


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
        refused(r"^tally must be what simulate gave, got [^\n]{1,40}$", write_results, wrong, tally)
    for wrong in (None, 3, tally):
        refused(r"^path must be the name of a file, got [^\n]{1,40}$", write_results, tally, wrong)


def photon_by_photon(counts, weights, photons):
    """Weights of every photon of one row: the tally undone."""
    return np.concatenate([np.repeat(weights, counts), np.zeros(photons - counts.sum())])


def test_estimate_is_mean_and_error_of_the_photons_one_by_one():
    counts, weights, photons = np.array([[5, 0, 30], [1, 2, 3]]), np.array([0.9, 0.5, 0.25]), 100
    found = estimate(counts, weights, photons)
    for row in range(2):
        each = photon_by_photon(counts[row], weights, photons)
        assert found.value[row] == pytest.approx(each.mean())
        assert found.standard_error[row] == pytest.approx(each.std(ddof=1) / np.sqrt(photons))
        assert found.effective_samples[row] == pytest.approx(each.sum() ** 2 / np.sum(each**2))


def test_empty_bins_have_no_samples_and_equal_weights_count_as_themselves():
    found = estimate(np.zeros((1, 3), np.int64), np.ones(3), 10)
    assert (found.value[0], found.standard_error[0], found.effective_samples[0]) == (0, 0, 0)
    assert not found.is_sampled()[0]
    found = estimate(np.array([[99], [101]]), np.array([0.1]), 1000)
    np.testing.assert_allclose(found.effective_samples, [99, 101])
    np.testing.assert_array_equal(found.is_sampled(), [False, True])
    np.testing.assert_array_equal(found.is_sampled(at_least=50), [True, True])
    # Only scalar estimates are floats.
    assert float(Estimate(0.25, 0.1, 7.0)) == 0.25
    refused(r"this one has shape \(2,\)", float, Estimate(np.zeros(2), np.zeros(2), np.zeros(2)), error=TypeError)


def test_counts_beyond_float32_stay_exact_and_a_lost_photon_is_found():
    one = Counts(np.full((1, 1), 2**60 + 1), 0, 0, 2**60 + 1)
    assert (one + one).exits[0, 0] == 2**61 + 2
    good = Counts(np.array([[2, 3]]), 4, 1, 10)
    good.require_closed()
    assert not Counts(good.exits, 4, 1, 11).is_closed
    refused("lost", Counts(good.exits, 4, 1, 11).require_closed, error=RuntimeError)


def test_full_rank_factor_is_the_covariance_of_the_photons_one_by_one():
    counts = np.array([[5, 0, 30], [1, 2, 3], [0, 0, 0]])
    weights, photons = np.array([[0.9, 0.5, 0.25], [0.3, 0.2, 0.1], [1.0, 1.0, 1.0]]), 100
    factors, dropped = covariance_factor(counts, weights, photons, rank=3)
    assert dropped == 0
    for row in range(3):
        each = np.array([photon_by_photon(counts[row], w, photons) for w in weights])
        np.testing.assert_allclose(factors[row] @ factors[row].T, np.cov(each) / photons, atol=1e-15)


def test_truncation_says_what_it_drops():
    counts, weights = np.array([[5, 7, 30]]), np.array([[0.9, 0.5, 0.25], [0.3, 0.2, 0.1], [1.0, 0.1, 0.0]])
    full, _ = covariance_factor(counts, weights, 100, rank=3)
    short, dropped = covariance_factor(counts, weights, 100, rank=1)
    assert short.shape == (1, 3, 1)
    assert dropped == pytest.approx(np.max(1 - np.sum(short**2, axis=2) / np.sum(full**2, axis=2)))
    assert dropped > 0


def test_a_weak_weighting_keeps_its_variance_beside_a_strong_one():
    """Small albedos far out carry a millionth of the energy, and their errors are asked for all the same."""
    counts = np.random.default_rng(2).integers(0, 50, (6, 40))
    weights = np.array([[0.05], [0.3], [0.9], [0.99]]) ** np.arange(1, 41)
    full, _ = covariance_factor(counts, weights, 10_000, rank=4)
    short, dropped = covariance_factor(counts, weights, 10_000, rank=3)
    assert np.max(1 - np.sum(short**2, axis=2) / np.sum(full**2, axis=2)) == pytest.approx(dropped)
    assert dropped < 0.05
