"""High orders of a half space whose scattering has a direction, against what needs neither harmonics nor Krylov."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks import harmonic_system as system
from benchmarks import harmonics, high_orders
from mcml_sim import Grid, Setting, exact, simulate_orders
from mcml_sim.exact import cone, forwards
from mcml_sim.exact.single_scattering import entered

N = 1.4
LIGHTS = "searchlight", "diffuse"


def test_flight_among_harmonics_is_the_integral_over_the_sphere():
    degree, k, x = 3, 0.7, np.array([0.3, 1.2])
    t, weight = np.polynomial.legendre.leggauss(80)
    mu, phi = (one.ravel() for one in np.meshgrid(t, 2 * np.pi * (np.arange(120) + 0.5) / 120, indexing="ij"))
    weight = np.repeat(weight, 120) * 2 * np.pi / 120
    with jax.enable_x64(True):
        z = harmonics.harmonics(degree, mu, phi)
        wave = jnp.sqrt(k * k + x * x + 0j)
        turns = harmonics.rotations(degree, 1j * jnp.log((x + 1j * k) / wave))
        flights = harmonics.flights(degree, wave)
        found = jnp.einsum("xlMm,xMlk,xkMn->xlmkn", turns, flights, turns)
    for each, own in zip(x, np.asarray(found), strict=True):
        passed = weight / (1 + 1j * (k * np.sqrt(1 - mu**2) * np.cos(phi) + each * mu))
        np.testing.assert_allclose(own, np.einsum("olm,o,okn->lmkn", z, passed, z), atol=1e-12)


@pytest.fixture(scope="module")
def one_wave():
    """The half space of g = .7 at a complex wave number, and two random states."""
    k = 0.3 + 0.2j
    with jax.enable_x64(True):
        x, dx = system.depth_nodes(k, 4)
        of = system.system(jnp.asarray(system.moments(0.7, 5)), k, x, dx, system.directions(N, 5))
        parts = np.random.default_rng(0).standard_normal((2, 2, *of.leaving.shape))
        inside = np.tril(np.ones((6, 6)))
        yield of, *((parts[0] + 1j * parts[1]) * inside)


def test_what_light_does_between_scatterings_is_reciprocal_and_the_blocks_have_an_inverse(one_wave):
    of, one, other = one_wave
    there, back = (jnp.sum(a * system.applied(of, b)) for a, b in ((one, other), (other, one)))
    assert abs(there / back - 1) < 1e-12
    spread = system.in_own_frames(of, system.inverse_of_flights(of, 0.9), one)
    flown = of.root * system.in_own_frames(of, of.flight, of.root * spread)
    np.testing.assert_allclose(np.asarray(spread - 0.9 * flown), one, atol=1e-9)


@pytest.mark.slow
def test_without_direction_it_is_the_other_exact_solution():
    k, alpha = np.array([0.05, 0.4, 1.1]), np.array([0.3, 0.9, 0.999])
    found = high_orders.transforms(N, 0.0, 0, k + 0j, alpha, high_orders.Fineness(2, 8))
    with jax.enable_x64(True):
        for each, own in zip(alpha, np.moveaxis(found, 2, 0), strict=True):
            whole, _ = cone.orders(N, float(each), jnp.asarray(k))
            np.testing.assert_allclose(own, whole, rtol=1e-6)


def test_what_enters_comes_out_where_nothing_is_absorbed():
    found = high_orders.transforms(N, 0.8, 0, np.array([1e-6 + 0j]), np.array([1 - 1e-13]), high_orders.Fineness(4, 8))
    np.testing.assert_allclose(found[:, 0, 0], [entered(Setting(light, N)) for light in LIGHTS], rtol=3e-5)


def test_the_line_starts_where_light_decays():
    alphas = np.array([0.2, 0.7, 0.9, 0.99, 0.9999])
    kappas = [forwards.decay_rate(alpha, 0.0) for alpha in alphas]
    np.testing.assert_allclose(kappas[1:], exact.decay_rate(alphas[1:]), rtol=1e-10)
    found = high_orders.lines(alphas, 0.9)
    assert sorted(np.concatenate([own for _, own in found])) == list(range(5))
    assert all(np.all(line.k.imag < 1) for line, _ in found)


@pytest.mark.slow
@pytest.mark.parametrize("g", [0.5, 0.8])
def test_totals_of_photons(g, sidak):
    """And a negative control, in which the phase function is a dipole's."""
    own = np.array([0.6, 0.9, 0.99, 0.999])  # mu_s / (mu_s + mu_a)
    alpha = own * (1 - g) / (1 - own * g)
    for light, name in enumerate(LIGHTS):
        photons = simulate_orders(Grid(1.0, 1), 2**20, 5, Setting(name, N, g), progress=False).reflectance(alpha)
        for degree, agrees in ((16, True), (2, False)):
            found = high_orders.transforms(N, g, 0, np.array([1e-6 + 0j]), own, high_orders.Fineness(degree))
            z = (found[light, 0].real - photons.value) / photons.standard_error
            assert (np.abs(z).max() < sidak(4)) == agrees
