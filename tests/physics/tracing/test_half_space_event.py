"""The conservative half space of any setting against a slow obvious twin, and against what is exact."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, half_space, simulate, simulate_orders
from mcml_sim.media.medium import fresnel
from mcml_sim.runs.input_runs import Compiling
from mcml_sim.tracing import half_space_event, orders_batch, rng
from mcml_sim.tracing.order_bins import OrderBins
from tests.physics.tracing.test_layered import textbook_fresnel, turned

pytestmark = pytest.mark.slow

EDGES = np.array([0, 0.1, 0.3, 0.6, 1, 2, 4, 8.0])
SETTINGS = [Setting(n=1.4), Setting(g=0.8), Setting("diffuse", n=1.5, g=-0.5), Setting("diffuse", n=0.8, g=0.4)]
STOPS = OrderBins().stops
PHOTONS, LAST_ORDER = 150_000, 32


def entering(setting, photons, source):
    """Directions of light that got in."""
    if setting.illumination == "searchlight":
        return np.tile([0.0, 0.0, 1.0], (photons, 1))
    outside = np.sqrt(source.uniform(size=4 * photons))
    outside = outside[source.uniform(size=outside.size) >= textbook_fresnel(1.0, setting.n, np.arccos(outside))[0]]
    sine = np.sqrt(1 - outside**2) / setting.n
    inside = np.stack([sine, 0 * sine, np.sqrt(np.maximum(1 - sine**2, 0))], axis=1)[sine < 1]
    return inside[:photons]


def slow_twin(setting, photons, last_order, seed):
    """Exit radius and order in float64 with (x, y, z) and left-over steps, no roulette; order 0 beyond `last_order`."""
    source = np.random.default_rng(seed)
    rho, order = np.zeros(photons), np.zeros(photons, int)
    direction = entering(setting, photons, source)
    position = source.exponential(size=(photons, 1)) * direction
    flying = np.arange(photons)
    for n in range(1, last_order + 1):
        direction[flying] = turned(direction[flying], np.full(flying.size, setting.g), source)
        start, ray, step = position[flying], direction[flying], source.exponential(size=(flying.size, 1))
        end = start + step * ray
        up = end[:, 2] < 0
        surface = start - ray * (start[:, 2:] / np.where(up, ray[:, 2], 1)[:, None])
        reflectance, _ = textbook_fresnel(setting.n, 1.0, np.arccos(np.minimum(np.abs(ray[:, 2]), 1)))
        back = up & (source.uniform(size=up.size) < reflectance)
        left_over = step - np.linalg.norm(surface - start, axis=1, keepdims=True)
        mirrored = ray * [1, 1, -1]
        position[flying] = np.where(back[:, None], surface + left_over * mirrored, end)
        direction[flying] = np.where(back[:, None], mirrored, ray)
        out = up & ~back
        rho[flying[out]] = np.hypot(surface[out, 0], surface[out, 1])
        order[flying[out]] = n
        flying = flying[~out]
    return rho, order


def table(rho, order, last_order=LAST_ORDER):
    """Counts by radii and groups of orders, each as many as before it, to the last."""
    left = (order >= 1) & (order <= last_order)
    groups = [1, *(1 + 2 ** np.arange(1 + round(np.log2(last_order))))]
    return np.histogram2d(rho[left], order[left], bins=[[*EDGES, np.inf], groups])[0].ravel()


def traced(setting, photons):
    """Exit radius and order of the kernel, whatever the setting."""
    ends = orders_batch.trace(
        jnp.asarray(rng.batch_key(7, 0)), jnp.int32(photons), jnp.asarray(STOPS), half_space_event.half_space(setting)
    )
    return np.asarray(ends.rho)[:photons], np.asarray(ends.order)[:photons]


def deviations(fast, slow):
    """Differences of two Poisson counts in their deviations, where both together are enough."""
    enough = fast + slow > 25
    return (fast - slow)[enough] / np.sqrt((fast + slow)[enough])


@pytest.mark.parametrize(
    ("setting", "other"),
    [
        *((setting, setting) for setting in SETTINGS),
        *((Setting(n=1.4), wrong) for wrong in (Setting(n=1.4, g=0.05), Setting(n=1.3), Setting("diffuse", n=1.4))),
    ],
    ids=str,
)
def test_kernel_agrees_with_its_slow_twin_in_every_ring_and_order_and_with_no_other(setting, other, sidak):
    z = deviations(table(*traced(setting, PHOTONS)), table(*slow_twin(other, PHOTONS, LAST_ORDER, seed=3)))
    assert z.size > 25
    assert (np.abs(z).max() < sidak(z.size)) == (setting == other)


@pytest.mark.parametrize("illumination", ["searchlight", "diffuse"])
def test_it_agrees_with_the_isotropic_kernel_where_that_applies(illumination, sidak):
    key = jnp.asarray(rng.batch_key(8, 0))
    ends = orders_batch.trace(key, jnp.int32(PHOTONS), jnp.asarray(STOPS), illumination=illumination)
    isotropic = table(np.asarray(ends.rho)[:PHOTONS], np.asarray(ends.order)[:PHOTONS])
    z = deviations(table(*traced(Setting(illumination), PHOTONS)), isotropic)
    assert np.abs(z).max() < sidak(z.size)


@pytest.mark.parametrize("setting", [Setting(n=1.4, g=0.5), Setting(n=1.3)], ids=str)
def test_every_albedo_agrees_with_a_run_of_its_own(setting, sidak):
    grid = Grid.from_edges(r=EDGES)
    orders = simulate_orders(grid, 2**19, seed=1, setting=setting)
    for alpha in (0.4, 0.8, 0.95):
        tally = simulate(half_space(alpha, orders.mfp(alpha), setting.n, setting.g), grid, 2**17, seed=9)
        pairs = ((orders.profile(alpha), tally.reflectance_r), (orders.reflectance(alpha), tally.diffuse_reflectance))
        for general, own in pairs:
            error = np.hypot(general.standard_error, own.standard_error)
            sampled = np.atleast_1d(own.is_sampled() & general.is_sampled())
            z = np.atleast_1d((general.value - own.value) / error)[sampled]
            assert z.size
            assert np.abs(z).max() < sidak(8)


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_all_light_that_entered_a_conservative_half_space_comes_back(setting):
    run = simulate_orders(Grid.from_edges(r=EDGES), 2**18, seed=2, setting=setting)
    found = run.reflectance(1.0)
    assert abs(found.value + run.cut(1.0) - run.entered) < 4 * found.standard_error + 0.5 * run.cut(1.0)


@pytest.mark.parametrize("n", [0.8, 1.0, 1.4])
def test_diffuse_light_enters_at_the_exact_cosines(n):
    """Against the cumulative distribution of 2 mu T(mu), by the trapezoid rule on many more nodes."""
    critical = np.sqrt(max(1 - 1 / n**2, 0))
    mu = critical + (1 - critical) * np.linspace(0, 1, 2**21 + 1) ** 3
    density = 2 * mu * (1 - fresnel(n, 1.0, mu)[0])
    cdf = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(mu))])
    xi = np.concatenate([np.geomspace(1e-9, 1e-3, 1000), np.linspace(1e-3, 1 - 1e-6, 10_000)]).astype(np.float32)
    table = half_space_event.half_space(Setting("diffuse", n=n)).entry
    found = np.asarray(half_space_event.entering_cosine(jnp.asarray(xi), table), float)
    np.testing.assert_allclose(found, np.interp(xi.astype(float) * cdf[-1], cdf, mu), atol=2e-6)


def test_another_setting_does_not_compile_again_and_double_precision_elsewhere_does_not_change_a_bit():
    traced(Setting(n=1.31), 100)
    with Compiling() as again:
        traced(Setting("diffuse", n=1.2, g=0.3), 100)
    assert again.seconds == 0
    setting = Setting("diffuse", n=1.4, g=0.7)
    alone = traced(setting, 2000)
    with jax.enable_x64(True):
        np.testing.assert_array_equal(traced(setting, 2000), alone)
