"""The half space under a refracting surface: published totals, other ways to the same, and its tables."""

from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erfc, j0

from mcml_sim import Grid, Layer, Medium, Setting, exact, simulate_orders
from mcml_sim.errors import Notice
from mcml_sim.exact import cone, refracting
from mcml_sim.exact.by_albedo import by_alpha, profile
from mcml_sim.exact.single_scattering import entered, transform_density
from mcml_sim.exact.special_functions import panels
from mcml_sim.exact.transform import STANDARD
from tests.fixtures import slow
from tests.physics.exact.test_exact_derivatives import difference
from tests.physics.exact.test_exact_tracer import energy
from tests.physics.tracing.adding_doubling import solve as added

LIGHTS = ("searchlight", "diffuse")
RADII = np.geomspace(1e-3, 15.0, 60)
ALPHAS = np.array([0.05, 0.3, 0.8, 0.95, 0.99, 0.999])[:, None]

each_light = pytest.mark.parametrize("light", [LIGHTS[0], *slow(LIGHTS[1])])


@pytest.mark.slow
def test_giovanellis_total():
    """A total that Giovanelli published in 1955, at n = 1.5."""
    assert exact.reflectance(0.9, Setting(n=1.5)) == pytest.approx(0.219919, abs=1e-6)


def test_totals_of_adding_and_doubling():
    for alpha in (0.5, 0.99):
        twin = added(Medium((Layer(1.4, 1 - alpha, alpha, 0.0, 200.0),)), 18).reflected.sum()
        assert exact.reflectance(alpha, Setting(n=1.4)) == pytest.approx(twin, abs=2e-5)


@each_light
def test_all_that_enters_comes_back_where_nothing_is_absorbed(light):
    where = Setting(light, n=1.4)
    assert exact.reflectance(1.0, where) == pytest.approx(entered(where), rel=1e-14)
    near, far = (entered(where) - exact.reflectance(1 - loss, where) for loss in (1e-8, 1e-6))
    assert near == pytest.approx(far / 10, rel=4e-3)


@each_light
def test_light_scattered_once_is_the_closed_form(light):
    """`single_scattering` shares no code with the cone."""
    where = Setting(light, n=1.4)
    rate, weighted = transform_density(where)
    series = jax.jit(lambda k: cone.series(cone.system(1.4, k, 160, 112), 1))
    with jax.enable_x64(True):
        for size in (1.0, 10.0, 300.0):
            k = size * np.exp(0.25j * np.pi)
            once = np.asarray(series(k))[LIGHTS.index(light), 0]
            assert abs(once / (entered(where) * np.sum(weighted * rate / np.sqrt(rate**2 + k**2))) - 1) < 2e-9


@pytest.mark.slow
@pytest.mark.parametrize("light", LIGHTS)
def test_rotated_contour_meets_the_real_axis(light):
    """Light scattered once in closed form; of the rest the real transform, faded out where it is c / k^2."""
    where, alpha, r = Setting(light, n=1.4), 0.8, np.array([1.0, 1.4])
    k, dk = panels(np.append(np.append(0.0, np.geomspace(0.02, 4.0, 10)), np.arange(6.0, 120.0, 4.0)), 16)
    rate, weighted = transform_density(where)
    with jax.enable_x64(True):
        solve = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 3})  # a thousand systems
        systems = solve(lambda k: jax.lax.map(lambda one: cone.system(1.4, one, 160, 160), k, batch_size=16))(k + 0j)
        matrix, leaving, source = (np.asarray(part) for part in systems)
    adjoint = np.linalg.solve(np.eye(160) - alpha * matrix, leaving[..., None])[..., 0]
    whole = np.einsum("kx,kx->k", source[:, LIGHTS.index(light)], adjoint).real / np.pi
    once = entered(where) * np.sum(weighted * rate / np.sqrt(rate**2 + k[:, None] ** 2), axis=1)
    rest = (whole - once) * 0.5 * erfc((k - 70.0) / 14.0)
    twin = np.sum(dk * k * rest * j0(np.multiply.outer(r, k)), axis=1) / (2 * np.pi)
    twin += entered(where) * np.exp(-np.multiply.outer(r, rate)) @ (weighted * rate) / (2 * np.pi * r)
    np.testing.assert_allclose(exact.profile(r, alpha, setting=where), alpha * twin, rtol=2e-7)


@pytest.mark.slow
@each_light
@pytest.mark.parametrize("n", [1.001, 1.3, 1.4, 1.5, 3.0])
def test_more_nodes_change_nothing(light, n):
    assert np.max(exact.error_estimate(RADII, ALPHAS, setting=Setting(light, n=n))) < 1e-7


@pytest.mark.slow
@each_light
def test_a_surface_that_hardly_refracts_is_none(light):
    """The cone shares no code with the H functions of n = 1."""
    here, there = Setting(light, n=1 + 1e-12), Setting(light)
    found = exact.reflectance(ALPHAS, here)
    np.testing.assert_allclose(found, exact.reflectance(ALPHAS, there), rtol=1e-7)
    r = np.geomspace(1e-3, 5.0, 30)
    found, wanted = (exact.profile(r, ALPHAS, setting=where) for where in (here, there))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)


@each_light
def test_quantile_undoes_cdf_and_profile_is_its_slope(light):
    where = Setting(light, n=1.4)
    share = exact.cdf(RADII, ALPHAS, setting=where)
    assert np.all(np.diff(share, axis=1) > 0)
    inner = share < 1 - 1e-6
    radius = exact.quantile(share, ALPHAS, setting=where)
    assert np.abs(radius / RADII - 1)[inner].max() < 1e-9
    above, below = (exact.cdf(RADII * ratio, ALPHAS, setting=where) for ratio in (1.0001, 1 / 1.0001))
    slope = (above - below) / (2 * np.log(1.0001))
    ring = 2 * np.pi * RADII**2 * exact.profile(RADII, ALPHAS, setting=where) / exact.reflectance(ALPHAS, where)
    np.testing.assert_allclose(slope[inner], ring[inner], rtol=1e-5)


@pytest.mark.slow
@each_light
def test_photons_agree(light, sidak):
    where = Setting(light, n=1.4)
    run = simulate_orders(Grid.from_edges(r=np.append(0.0, np.geomspace(0.02, 8.0, 25))), 2**22, seed=31, setting=where)
    for alpha, other in ((0.5, where), (0.9, where), (0.9, Setting(light, n=1.41))):
        seen = run.energy(alpha)
        z = (seen.value - energy(alpha, run.grid.r_edges, other)) / seen.standard_error
        assert (np.abs(z).max() < sidak(z.size)) == (other == where)


@each_light
def test_derivatives_are_those_of_differences(light):
    with jax.enable_x64(True):
        at = tuple(map(jnp.float64, (0.9, 1.3, 1.2)))
        where = Setting(light, n=1.4)
        by_each = jax.grad(lambda a, r, m: exact.profile(r, a, m, where), argnums=(0, 1, 2))(*at)
    for index, slope in enumerate(by_each):

        def value(x, index=index):
            alpha, r, mfp = (x if one == index else float(old) for one, old in enumerate(at))
            return exact.profile(r, alpha, mfp, where)

        assert slope == pytest.approx(difference(value, float(at[index]), 1e-3), rel=1e-8)


@pytest.mark.slow
@each_light
def test_derivatives_by_n_are_those_of_differences(light):
    def quantities(n):
        where = Setting(light, n=n)
        profile = exact.profile(1.3, 0.9, setting=where)
        return profile, exact.reflectance(0.9, where), exact.quantile(0.7, 0.9, 1.0, where)

    slopes = [difference(lambda n, one=one: quantities(n)[one], 1.4, 4e-3) for one in range(3)]
    with jax.enable_x64(True):
        values, found = jax.jvp(quantities, (jnp.float64(1.4),), (jnp.float64(1.0),))
        backwards = jax.grad(lambda n: quantities(n)[0])(jnp.float64(1.4))
    np.testing.assert_allclose(values, quantities(1.4), rtol=1e-12)
    np.testing.assert_allclose(found, slopes, rtol=1e-8)
    assert backwards == pytest.approx(float(found[0]), rel=1e-12)


def test_a_table_is_kept_and_a_damaged_one_is_named_and_made_anew(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    small = STANDARD.scaled(0.25)
    made = []
    anew = lru_cache(refracting.new_table)
    monkeypatch.setattr(refracting, "new_table", lambda *all: made.append(all) or anew(*all))
    refracting.kept_table.cache_clear()
    first = refracting.kept_table(1.4, small)
    refracting.kept_table.cache_clear()
    again = refracting.kept_table(1.4, small)
    assert len(made) == 1
    assert all(np.array_equal(*pair) for pair in zip(first, again, strict=True))
    (path,) = tmp_path.rglob("*.npz")
    for damaged in (path.read_bytes()[:-50], b"", changed(path)):
        path.write_bytes(damaged)
        refracting.kept_table.cache_clear()
        with pytest.warns(Notice, match=r"half-space-n1\.4.* is damaged"):
            assert np.array_equal(refracting.kept_table(1.4, small).lines, first.lines)
    assert len(made) == 4
    refracting.kept_table.cache_clear()
    path.unlink()
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/nowhere")
    assert np.array_equal(refracting.kept_table(1.4, small).lines, first.lines)
    refracting.kept_table.cache_clear()


def changed(path):
    """The same file with one number changed by one bit."""
    arrays = dict(np.load(path))
    arrays["lines"].view(np.uint64).flat[7] ^= 1
    other = path.with_name("other.npz")
    np.savez(other, **arrays)
    content = other.read_bytes()
    other.unlink()
    return content


@pytest.mark.slow
def test_fewer_nodes_are_seen():
    """Negative control of the error estimate."""
    where = Setting(n=1.4)
    coarse = by_alpha(profile, RADII, ALPHAS, where, STANDARD.scaled(0.5))
    assert np.abs(coarse / exact.profile(RADII, ALPHAS, setting=where) - 1).max() > 1e-6
