"""Every albedo from one run, against the exact half space and against itself."""

import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from mcml_sim.results.estimate import estimate
from mcml_sim.tracing import orders_batch
from tests.fixtures import refused
from tests.physics.exact.test_exact_tracer import energy

ALPHAS = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])


def deviations(estimate_, truth):
    return (estimate_.value - truth) / np.where(estimate_.standard_error > 0, estimate_.standard_error, 1)


def test_reflectance_is_the_exact_one(run):
    found = run.reflectance(ALPHAS)
    # 4 standard errors: a chance of 6e-5 each; the albedos share their photons.
    assert np.abs(deviations(found, exact.reflectance(ALPHAS))).max() < 4
    assert np.all(found.standard_error < 2e-3 * found.value)
    assert np.abs(deviations(found, exact.reflectance(ALPHAS + 0.004))).min() > 4, "a wrong albedo is seen"
    # At 0.999 it is but for what the cap cut.
    found = run.reflectance(0.999)
    missing = exact.reflectance(0.999) - found.value
    assert -4 * found.standard_error < missing < 4 * found.standard_error + run.cut(0.999)


@pytest.mark.parametrize("alpha", [0.3, 0.5, 0.8, 0.95, 0.99])
def test_rings_that_are_sampled_hold_the_exact_energy(run, alpha, sidak):
    found = run.energy(alpha)
    sampled = found.is_sampled()
    z = deviations(found, energy(alpha, run.grid.r_edges))[sampled]
    assert sampled.sum() > 25
    assert np.abs(z).max() < sidak(sampled.sum())


def test_without_the_gate_far_rings_look_many_errors_wrong(run, sidak):
    """The photons that carry the light there were never seen, and the standard error collapsed with them."""
    found = run.energy(0.2)
    seen = (found.standard_error > 0) & ~found.is_sampled()
    z = deviations(found, energy(0.2, run.grid.r_edges))[seen]
    assert np.abs(z).max() > 2 * sidak(seen.sum())


def test_estimates_add_up(run):
    """Rings and overflow to the reflectance, the profile to the energy, and what users make of the counts."""
    total = run.energy(ALPHAS).value.sum(axis=1) + run.overflow(ALPHAS).value
    np.testing.assert_allclose(total, run.reflectance(ALPHAS).value, rtol=1e-12)
    profile, energy = run.profile(0.9), run.energy(0.9)
    np.testing.assert_allclose(profile.value * run.grid.r_areas, energy.value)
    np.testing.assert_allclose(profile.standard_error * run.grid.r_areas, energy.standard_error)
    again = run.ring_order_counts[:, 1:] @ run.weights(0.7)[1:] / run.photons
    np.testing.assert_allclose(run.energy(0.7).value, run.once(0.7)[:-1] + again)


def test_derivative_is_the_slope_of_the_profile(run, sidak):
    step = 1e-6
    for alpha in (0.2, 0.9, 0.99):
        below, above = (run.profile(a).value for a in (alpha - step, alpha + step))
        slope = (above - below) / (2 * step)
        np.testing.assert_allclose(run.profile_derivative(alpha).value, slope, rtol=1e-4, atol=1e-12 * slope.max())
    # And that of the exact energy.
    alpha, step = 0.9, 1e-4
    truth = (energy(alpha + step, run.grid.r_edges) - energy(alpha - step, run.grid.r_edges)) / (2 * step)
    found = run.profile_derivative(alpha).scaled(run.grid.r_areas)
    sampled = found.is_sampled()
    assert np.abs(deviations(found, truth)[sampled]).max() < sidak(sampled.sum())


def test_shapes_are_alpha_then_rings(run):
    rings = run.grid.rings
    assert isinstance(run.reflectance(0.5).value, float)
    assert float(run.reflectance(0.5)) == run.reflectance([0.5]).value[0]
    assert run.profile(0.5).value.shape == (rings,)
    assert run.profile([0.5, 0.6]).standard_error.shape == (2, rings)
    assert run.profile([[0.5], [0.6]]).effective_samples.shape == (2, 1, rings)
    assert run.overflow([0.5, 0.6]).value.shape == (2,)
    assert isinstance(run.cut(0.5), float)
    assert run.ring_order_counts.shape == (rings, run.orders.size)
    assert run.ring_order_counts.dtype == np.int64
    assert run.weights([0.5, 0.6]).shape == (2, run.orders.size)


def test_light_scattered_once_is_exact_and_takes_most_of_the_error_near_the_source(run):
    """The same with the photons' own first scatterings: as right, and less precise where they are most of the light."""
    plain = estimate(run.ring_order_counts, run.weights(0.5), run.photons)
    truth, found = energy(0.5, run.grid.r_edges), run.energy(0.5)
    near = slice(0, 10)
    assert np.all(found.standard_error[near] < 0.45 * plain.standard_error[near])
    assert np.abs((plain.value - truth)[near] / plain.standard_error[near]).max() < 4
    assert np.abs(deviations(found, truth)[near]).max() < 4


def test_no_albedo_no_light_and_conservative_half_spaces_return_all_but_what_is_cut(run):
    assert float(run.reflectance(0.0)) == 0
    assert np.all(run.profile_derivative(0.0).value.sum() > 0)
    found = run.reflectance(1.0)
    assert abs(found.value + run.cut(1.0) - 1) < 4 * found.standard_error + 0.2 * run.cut(1.0)


def test_every_photon_is_in_the_ledger_and_seeds_have_photons_of_their_own(run):
    ledger = run.ledger
    assert ledger.started == run.photons == 2**22
    assert ledger.exited == run.counts.exits.sum()
    assert ledger.exited + ledger.rouletted + ledger.cut == ledger.started
    a, b, c = (simulate_orders(Grid(0.5, 4), 20_000, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(a.counts.exits, b.counts.exits)
    assert np.any(a.counts.exits != c.counts.exits)


@pytest.mark.slow
def test_covariance_is_the_scatter_of_batches(sidak):
    """200 small batches against the closed form of their sum; the error of a sample covariance is Wishart's."""
    grid, alphas, photons, batches = Grid.from_edges(r=[0, 0.2, 1, 4]), np.array([0.3, 0.6, 0.9, 0.98]), 20_000, 200
    parts = [orders_batch.trace_batch(grid, 11, batch, photons) for batch in range(batches)]
    total = sum(parts[1:], parts[0])
    run = simulate_orders(grid, 1)  # for its weights only
    weights = run.weights(alphas)
    energies = np.array([estimate(part.exits[:-1, 1:], weights[:, 1:], photons).value for part in parts])
    from_orders = type(run)(grid, photons * batches, 11, Setting(), total)
    factors, dropped = from_orders.covariance_factor(alphas, rank=4)
    assert dropped < 1e-12
    for ring in range(3):
        closed = factors[ring] @ factors[ring].T * batches
        scatter = np.cov(energies[:, :, ring], rowvar=False)
        spread = np.sqrt((closed**2 + np.outer(np.diag(closed), np.diag(closed))) / (batches - 1))
        assert np.abs((scatter - closed) / spread).max() < sidak(3 * 10)
        # Without the correlation of albedos the same scatter is far off.
        assert np.abs((scatter - np.diag(np.diag(closed))) / spread).max() > sidak(3 * 10)


@pytest.mark.slow
def test_covariance_of_many_albedos_fits_in_rank_8(run):
    alphas = np.linspace(0.05, 0.995, 32)
    factors, dropped = run.covariance_factor(alphas)
    assert factors.shape == (run.grid.rings, 32, 8)
    assert dropped < 1e-3
    variance = run.energy(alphas).standard_error ** 2
    big = variance > 1e-2 * variance.max(axis=0)
    np.testing.assert_allclose(np.sum(factors**2, axis=2).T[big], variance[big], rtol=0.02)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, np.nan, [0.5, 2], "half", None])
def test_albedo_must_be_in_0_to_1(run, alpha):
    estimates = run.reflectance, run.profile, run.profile_derivative, run.energy, run.overflow
    for method in (*estimates, run.cut, run.weights):
        refused(r"alpha must be a reduced albedo in \[0, 1\], got", method, alpha)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        (
            "photons",
            [0, -5, 2.5, np.nan, np.inf, "many", None, True, 10**20],
            r"photons must be a whole number >= 1 and <= 1e\+13, got",
        ),
        ("seed", [-1, 0.5], "seed must be a whole number >="),
        ("workers", [0, 1.5], "workers must be a whole number >="),
        ("store", [3], "store must be the path of a folder, got 3"),
        ("setting", [None, "diffuse"], r"setting must be a mcml_sim\.Setting, got"),
        ("grid", [[0, 1, 2]], r"must be a mcml_sim\.Grid"),
        ("grid", [Grid(0.1, 3000, 0.1, 3000)], "at most 2097152 bins, got 3000 annuli x 3000 depths"),
        (
            "grid",
            [Grid.from_edges(r=[0, 1, 1 + 1e-12, 2])],
            r"annuli wider than 1e-05 of their place.*got one from 1\.0 to 1\.0",
        ),
        ("grid", [Grid.from_edges(r=[0, *e]) for e in ([1e-40, 1], [1e40])], "must have edges from 1e-30 to 1e"),
    ],
)
def test_bad_input_is_named(name, values, message):
    for value in values:
        refused(message, simulate_orders, **{"grid": Grid(0.1, 3), "photons": 10, name: value})


def test_one_photon_says_nothing_of_its_error_and_photons_may_be_powers_of_ten():
    assert simulate_orders(Grid(0.1, 3), 1).reflectance(0.9).standard_error == np.inf
    assert simulate_orders(Grid(0.1, 3), 1e3).photons == 1000


@pytest.mark.slow
def test_fifty_seeds_have_no_bias(sidak):
    """The mean of 50 z is within 3 of its own standard errors, 1/sqrt(50); 3e8 photons."""
    runs = [simulate_orders(Grid(50.0, 1), 6 * 2**20, seed=1000 + seed) for seed in range(50)]
    truth = exact.reflectance(ALPHAS)
    z = np.array([deviations(run.reflectance(ALPHAS), truth) for run in runs])
    assert np.abs(z.mean(axis=0)).max() < 3 / np.sqrt(50)
    # And the standard errors are right: chi^2 of 50 degrees, within 4 of its deviations of 0.1 each.
    assert np.abs(np.mean(z**2, axis=0) - 1).max() < 4 * np.sqrt(2 / 50)
