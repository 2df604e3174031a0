"""The fast half space against the exact one, against a slow obvious twin, and against itself in other shapes."""

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, exact
from mcml_sim.media.medium import half_space
from mcml_sim.runs.input_runs import Compiling
from mcml_sim.tracing import matched_batch, orders_batch, rng
from mcml_sim.tracing.deposits import shapes

pytestmark = pytest.mark.slow

ALPHAS = [0.0, 0.05, 0.3, 0.5, 0.9, 0.97, 0.99, 0.999]
PHOTONS = 2**17
MFP = 2.5
GRID = Grid(0.2 * MFP, 10, 0.2 * MFP, 12, na=6)
WIDER = Grid(1.1 * 0.2 * MFP, 10, 1.1 * 0.2 * MFP, 12, na=6)
UNEVEN = Grid.from_edges(r=MFP * np.array([0, 0.1, 0.5, 1.1, 3]), z=MFP * np.array([0, 0.15, 0.8, 2, 5]), na=3)


@lru_cache
def traced(alpha, grid=GRID, batches=4, seed=0, photons=PHOTONS):
    parts = [matched_batch.trace_batch(half_space(alpha, MFP), grid, seed, batch, photons) for batch in range(batches)]
    return sum(parts[1:], parts[0])


def mean(total, squares, photons):
    return total / photons, np.sqrt(np.maximum(squares - total**2 / photons, 0)) / photons


@lru_cache
def slow_twin(alpha, grid, photons=100_000, groups=50, seed=7):
    """Partial absorption without roulette in float64 (x, y, z): like Deposits, from groups of photons of their own."""
    source = np.random.default_rng(seed)
    edges_r, edges_z = (np.append(e / MFP, np.inf) for e in (grid.r_edges, grid.z_edges))
    edges_a = np.cos(grid.a_edges[::-1])
    rz, exits = np.zeros((groups, grid.rings + 1, grid.depths + 1)), np.zeros((groups, grid.rings + 1, grid.angles))
    position = np.zeros((photons, 3))
    position[:, 2] = source.exponential(size=photons)
    group, weight = np.arange(photons) * groups // photons, 1.0
    while len(position) and weight > 1e-7:
        sample = np.column_stack([group, np.hypot(position[:, 0], position[:, 1]), position[:, 2]])
        rz += (1 - alpha) * weight * np.histogramdd(sample, [np.arange(groups + 1), edges_r, edges_z])[0]
        weight *= alpha
        direction = source.normal(size=position.shape)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        end = position + source.exponential(size=(len(position), 1)) * direction
        out = end[:, 2] < 0
        at = position[out] - direction[out] * (position[out, 2:] / direction[out, 2:])
        sample = np.column_stack([group[out], np.hypot(at[:, 0], at[:, 1]), -direction[out, 2]])
        exits += weight * np.histogramdd(sample, [np.arange(groups + 1), edges_r, edges_a])[0][..., ::-1]
        position, group = end[~out], group[~out]
    return exits, rz


def deviations(total, variance, photons, by_group, twin_photons=100_000):
    """z of the difference between a sum over photons and a twin's, by bin, where both have seen enough."""
    twin, spread = by_group.sum(axis=0), by_group.var(axis=0, ddof=1) * len(by_group)
    error = np.sqrt(variance / photons**2 + spread / twin_photons**2)
    seen = (variance > 0) & (spread > 0) & (twin**2 > 100 * spread)
    return ((total / photons - twin / twin_photons)[seen]) / error[seen]


@pytest.mark.parametrize("alpha", ALPHAS)
def test_reflectance_is_the_exact_one(alpha):
    got = traced(alpha, Grid(1.0, 1), batches=2, photons=2**20)
    value, error = mean(got.reflected.sum(), got.reflected_squares.sum(), got.started)
    assert error < 5e-4
    assert abs(value + got.cut / got.started - exact.reflectance(alpha)) < 4 * error + 1e-12


@pytest.mark.parametrize("alpha", [*ALPHAS, 1.0])
def test_all_light_is_accounted_for(alpha):
    got = traced(alpha)
    value, error = mean(got.accounted, got.accounted_squares, got.started)
    assert abs(value - 1) < 4 * error + 1e-12
    assert got.accounted == pytest.approx(got.reflected.sum() + got.absorbed[-1] + got.cut, rel=1e-12)
    assert got.absorbed_rz.sum() == pytest.approx(got.absorbed[-1], rel=1e-8, abs=1e-30)
    np.testing.assert_allclose(got.absorbed_rz.sum(axis=0), got.absorbed_z, rtol=1e-12, atol=1e-30)
    if alpha == 1.0:  # all comes back
        assert got.absorbed[-1] == got.absorbed_rz.sum() == 0
        assert 0 < got.cut / got.started < 0.02


def test_without_scattering_all_is_absorbed_where_the_light_first_arrives():
    got = traced(0.0)
    assert got.reflected.sum() == 0
    assert got.absorbed[-1] == got.started
    share = np.exp(-np.append(GRID.z_edges, np.inf) / MFP)
    expected = got.started * (share[:-1] - share[1:])
    assert np.abs((got.absorbed_z - expected) / np.sqrt(expected * (1 - expected / got.started))).max() < 4
    assert got.absorbed_rz[1:].sum() == 0


@pytest.mark.parametrize(
    ("alpha", "grid", "twins"), [(0.5, GRID, GRID), (0.9, GRID, GRID), (0.9, UNEVEN, UNEVEN), (0.9, GRID, WIDER)]
)
def test_every_bin_agrees_with_the_slow_twin_and_bins_that_are_off_by_10_percent_are_seen(alpha, grid, twins, sidak):
    got, (exits, rz) = traced(alpha, grid), slow_twin(alpha, twins)
    squares = got.reflected_squares - got.reflected**2 / got.started
    z = {
        "reflected": deviations(got.reflected, squares, got.started, exits),
        "rz": deviations(got.absorbed_rz, got.absorbed_rz_variance, got.started, rz),
        "z": deviations(got.absorbed_z, got.absorbed_z_variance, got.started, rz.sum(axis=1)),
    }
    for name, values in z.items():
        assert len(values) > 4, name
        # 60 and 50 degrees of freedom in the errors: Student's t is wider than a normal by a tenth out there.
        assert (np.abs(values).max() < 1.15 * sidak(len(values))) == (grid == twins), name
        assert grid != twins or np.sqrt(np.mean(values**2)) < 1.6, name


def test_errors_are_the_spread_over_seeds(sidak):
    seeds, photons = 40, 2**14
    runs = [matched_batch.trace_batch(half_space(0.9, MFP), GRID, seed, 0, photons) for seed in range(seeds)]
    checked = {
        "reflected": [r.reflected_squares - r.reflected**2 / photons for r in runs],
        "absorbed": [r.absorbed_squares - r.absorbed**2 / photons for r in runs],
        "accounted": [r.accounted_squares - r.accounted**2 / photons for r in runs],
        "absorbed_rz": [r.absorbed_rz_variance for r in runs],
        "absorbed_z": [r.absorbed_z_variance for r in runs],
    }
    for name, variances in checked.items():
        values = np.array([getattr(r, name) for r in runs])
        enough = values.mean(axis=0) > 20
        ratio = (values.var(axis=0, ddof=1) / np.mean(variances, axis=0))[enough]
        # chi^2 / 39 of each bin, and of all of them together.
        assert np.abs(np.log(ratio)).max() < sidak(ratio.size) * np.sqrt(2 / 39) * 1.3, name
        assert abs(ratio.mean() - 1) < 4 * np.sqrt(2 / 39 / min(ratio.size, 20)), name


def equal(a, b):
    for name, values in a.arrays().items():
        np.testing.assert_array_equal(values, getattr(b, name), err_msg=name)


@pytest.mark.parametrize("grid", [GRID, Grid(0.5, 10, na=4)])
def test_lanes_and_double_precision_elsewhere_do_not_change_a_bit(grid):
    medium = half_space(0.9, MFP)
    many = matched_batch.trace_batch(medium, grid, 3, 1, 30_000, 4096)
    equal(matched_batch.trace_batch(medium, grid, 3, 1, 30_000, 512), many)
    with jax.enable_x64(True):
        equal(matched_batch.trace_batch(medium, grid, 3, 1, 30_000, 4096), many)


def test_depths_do_not_change_what_leaves():
    medium = half_space(0.9, MFP)
    a = matched_batch.trace_batch(medium, GRID, 3, 1, 30_000)
    b = matched_batch.trace_batch(medium, Grid(0.2 * MFP, 10, na=6), 3, 1, 30_000)
    for name in ("reflected", "reflected_squares", "absorbed", "accounted"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-4, err_msg=name)


@pytest.mark.parametrize(("photons", "tells_spread"), [(1, False), (100, False), (200, True)])
def test_a_few_photons_are_all_there(photons, tells_spread):
    got = matched_batch.trace_batch(half_space(0.7), GRID, 0, 0, photons)
    assert got.started == photons
    assert got.absorbed_rz.sum() == pytest.approx(got.absorbed[-1])
    assert np.all(np.isfinite(got.absorbed_rz_variance) == tells_spread)


@pytest.mark.parametrize("grid", [Grid(0.1, 7), Grid(0.1, 7, na=3), Grid(0.1, 7, 0.2, 5), UNEVEN])
def test_shapes_are_those_of_the_grid(grid):
    got = matched_batch.trace_batch(half_space(0.7), grid, 0, 0, 100).arrays()
    assert {name: array.shape for name, array in got.items()} == shapes(grid, 1)


def test_another_albedo_or_mean_free_path_compiles_nothing():
    traced(0.9)
    with Compiling() as again:
        matched_batch.trace_batch(half_space(0.123, 0.7), GRID, 0, 0, PHOTONS)
    assert again.seconds == 0


@pytest.mark.parametrize("alpha", [0.0, 1e-6, 0.1, 0.4, 0.5, 0.9, 0.999, 1.0])
def test_weights_are_powers_of_alpha_times_the_tosses_won(alpha):
    """Once they have fallen to the threshold they stay around it."""
    values = matched_batch.weights(alpha)
    if alpha in (0.4, 0.5, 0.9):
        later = values.leaving[values.stops[0] + 1 : min(values.last, matched_batch.LONG_PATH)]
        assert np.all(later < 2 * matched_batch.THRESHOLD)
        assert np.all(later > matched_batch.THRESHOLD * alpha)
    assert np.all(np.diff(values.stops) >= 0)
    assert values.stops[0] >= 1
    assert values.last <= matched_batch.MAX_ORDER
    for n in (1, 2, 3, 10, 63, 64, 100, 700):
        if n <= values.last:
            won = np.sum(values.stops[:-1] < n)
            assert values.leaving[n] == pytest.approx(alpha**n * 2.0**won)
            assert values.visiting[n] == pytest.approx(alpha ** (n - 1) * 2.0**won)


def test_fixed_point_sums_hold_the_longest_batch_and_a_lost_photon_is_noticed():
    """All visits of a batch where alpha = 1, in units, stay inside int64."""
    key = jnp.asarray(rng.batch_key(0, 0))
    values = matched_batch.weights(1.0)
    order = np.abs(np.asarray(orders_batch.trace(key, jnp.int32(2**14), jnp.asarray(values.stops)).order)[: 2**14])
    visits = np.cumsum(values.visiting)[order].mean()
    assert visits * orders_batch.BATCH_PHOTONS / matched_batch.UNIT < 2**62
    orders = np.zeros(2 * matched_batch.MAX_ORDER + 1, np.int32)
    exits, weights, visited = np.zeros((2, 1), complex), matched_batch.weights(0.5), [np.zeros(0)] * 4
    with pytest.raises(RuntimeError, match="photons were lost or made: 5 started and 0 ended"):
        matched_batch.deposited(exits, orders, weights, 5, 0.5, visited)
