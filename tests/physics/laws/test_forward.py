"""The half space of one medium that scatters forward: its closed part, its energy, and light it was not fitted to."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.exact import single_scattering
from profilefit.laws.two_parts import ForwardHalfSpace
from profilefit.recipes.stack.fit import Tracing, ring_edges, stack_law, traced, traced_half_space

G = 0.9
# Constants as a fit to tissue gives them.
LAW = ForwardHalfSpace(Setting("searchlight", n=1.4, g=G), 0.95, 0.38, 1.0, 0.5, 0.1, 0.5, 0.4, 0.1, 0.15)
TISSUE = Layer(1.4, 0.2, 48.0, G)


@pytest.fixture(autouse=True)
def float64():
    with jax.enable_x64(True):
        yield


@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
@pytest.mark.parametrize("g", [0.0, 0.5, 0.9])
def test_light_next_to_the_source_was_scattered_once(light, g):
    """2 pi x R_d at the source: s_0 / (1 - g), in transport mean free paths, whatever was fitted."""
    own = Setting(light, n=1.4, g=g)
    law = ForwardHalfSpace(own, *list(LAW.constants().values()))
    x = 1e-7
    found = 2 * np.pi * x * float(law.scaled_profile(jnp.asarray(x), jnp.asarray(0.0)))
    assert found == pytest.approx(0.95 * single_scattering.source_strength(own) / (1 - g), rel=1e-4)
    if g == 0:
        parts = law.parts(jnp.asarray(0.0))
        assert float(parts.share) * law.total_reflectance == pytest.approx(0.95 * single_scattering.reflected(own))


def test_profile_is_the_slope_of_the_energy_which_tends_to_all_of_it():
    x, alpha = jnp.geomspace(1e-3, 30, 200), jnp.asarray(0.0)
    slope = jax.vmap(jax.grad(lambda at: LAW.unscaled_energy(at, alpha)))(x)
    np.testing.assert_allclose(2 * np.pi * x * LAW.scaled_profile(x, alpha), slope, rtol=1e-9)
    assert float(LAW.unscaled_energy(jnp.asarray(np.inf), alpha)) == LAW.total_reflectance
    assert float(LAW.unscaled_energy(jnp.asarray(0.0), alpha)) == 0


@pytest.mark.slow
def test_radii_have_the_density_that_is_said():
    """The mean of the law over its sampler's density is 1; over that of another medium it is not."""
    xi, alpha = (np.arange(100_000) + 0.5) / 100_000, jnp.asarray(0.0)
    x = LAW.sampler.scaled_sample(jnp.asarray(xi), alpha)
    weight = 2 * np.pi * x * LAW.scaled_profile(x, alpha) / LAW.total_reflectance
    assert float(jnp.mean(weight / LAW.sampler.scaled_pdf(x, alpha))) == pytest.approx(1, abs=2e-4)
    other = ForwardHalfSpace(LAW.setting, 0.7, 0.12, *list(LAW.constants().values())[2:])
    assert abs(float(jnp.mean(weight / other.sampler.scaled_pdf(x, alpha))) - 1) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
def test_a_fitted_half_space_is_light_that_it_was_not_fitted_to(light):
    setting = Setting(light, n=1.4)
    law = traced_half_space(TISSUE, setting, Tracing(1, 2**20))
    fresh = traced(Medium((TISSUE,)), light, ring_edges(TISSUE, (TISSUE,)), 2**20, seed=2)
    counts = (fresh.weight > 0) & (fresh.edges[:-1] > 0.1 * law.mfp)

    def off(one):
        return np.diff(np.asarray(one(fresh.edges)))[counts] / fresh.energy[counts] - 1

    # Both runs have noise; what is left of the squares beyond it is the law's: 1 % of a ring at most, on average.
    mine = off(law.within)
    assert np.mean(mine**2) < 2 * np.mean(fresh.noise[counts] ** 2) + 0.01**2
    assert abs(law.reflectance - fresh.whole) < 4 * np.sqrt(2) * fresh.error
    similar = TISSUE.similar
    isotropic = off(
        lambda r: exact.cdf(r, similar.alpha, similar.mfp, setting) * exact.reflectance(similar.alpha, setting)
    )
    assert np.mean(isotropic**2) > 0.1**2


@pytest.mark.slow
def test_a_stack_that_scatters_forward_is_light_that_it_was_not_fitted_to():
    """Heart muscle, green, under its epicardium: the similar stack's A is a sixth too high."""
    medium = Medium((Layer(1.38, 0.2, 22.0, G, 0.3), Layer(1.38, 0.8, 12.0, G)))
    law = stack_law(medium)
    fresh = traced(medium, "searchlight", ring_edges(medium.layers[0], medium.layers), 2**21, seed=3)
    counts = (fresh.weight > 0) & (fresh.edges[:-1] > 0.1 * law.top.mfp)
    within = np.asarray(law.cdf(fresh.edges)) * law.reflectance
    off = np.diff(within)[counts] / fresh.energy[counts] - 1
    assert np.mean(np.abs(off)) < 0.03
    assert law.reflectance == pytest.approx(fresh.whole, rel=0.01)
    similar = Medium(tuple(layer.similar for layer in medium.layers))
    assert exact.solve(similar).reflectance > 1.12 * fresh.whole
