"""The hazard law and its map with g as an argument: near exact light at g that were not fitted, exact at both ends."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from mcml_sim.errors import SettingError
from mcml_sim.exact import single_scattering
from mcml_sim.exact.light import reduced, unreduced
from profilefit import albedo_law, load
from profilefit.fitting.quality import profile_quality
from tests.fixtures import slow

TISSUE = Setting(n=1.4, g=0.8)  # of no g that was fitted
LIGHTS = ("searchlight", "diffuse")
REDUCED = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.85, 0.95, 0.98, 0.995, 0.999])
R = np.geomspace(1e-3, 1e3, 13)
ALPHA = np.array([0.1, 0.6, 0.99, 0.9999])[:, None]


@pytest.mark.parametrize(
    ("g", "rel"),
    [(0.05, 0.015), (0.8, 0.0175), *slow((0.2, 0.0125), (0.5, 0.0125), (0.9, 0.02), (0.95, 0.025))],
)
@pytest.mark.parametrize("light", LIGHTS)
def test_near_exact_light(light, g, rel):
    """From .01 l* to 99.5 % of the light, any albedo."""
    law = load("hazard", setting=Setting(light, 1.4, g))
    found = profile_quality(law, REDUCED)
    assert np.max(found.rel) < rel
    assert np.max(found.ks) < 0.006
    alpha = unreduced(REDUCED, g)
    off = law.albedo.reflectance(alpha) - exact.reflectance(alpha, law.setting)
    assert np.max(np.abs(off)) < 0.003
    assert np.max(np.abs(off) / exact.reflectance(alpha, law.setting)) < 0.007


@pytest.mark.parametrize("n", [1.36, *slow(1.33, 1.45)])
@pytest.mark.parametrize("light", [LIGHTS[0], *slow(*LIGHTS[1:])])
def test_near_exact_light_at_other_indices(light, n):
    for g in (0.4, 0.85):
        found = profile_quality(load("hazard", setting=Setting(light, n, g)), REDUCED[::2])
        assert np.max(found.rel) < 0.025
        assert np.max(found.ks) < 0.006


@pytest.mark.parametrize("g", [0.8, *slow(0.5, 0.95)])
def test_albedos_have_derivatives_by_reflectance(g):
    albedo, step = load("hazard", setting=Setting("diffuse", 1.4, g)).albedo, 1e-6
    with jax.enable_x64(True):
        for whole in (0.01, 0.1, 0.15, 0.3, 0.9):
            slope = float(jax.grad(albedo.alpha)(jnp.float64(whole)))
            assert slope == pytest.approx(
                (albedo.alpha(whole + step) - albedo.alpha(whole - step)) / (2 * step), rel=1e-5
            )


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.301, 1.5])
@pytest.mark.parametrize("light", LIGHTS)
def test_beyond_the_indices_of_exact_light_photons_judge(light, n):
    setting, alpha = Setting(light, n, 0.8), unreduced(np.array([0.5, 0.9, 0.99]), 0.8)
    edges = np.concatenate([[0.0], np.geomspace(0.1, 60.0, 33)])
    photons = simulate_orders(Grid.from_edges(r=edges), 2**19, 3, setting)
    law = load("hazard", setting=setting)
    for one in alpha:
        found = photons.energy(one)
        own = law.albedo.reflectance(one) * np.diff(law.cdf(edges, one))
        seen = found.standard_error < 0.03 * found.value
        off = np.abs(own / np.where(seen, found.value, 1.0) - 1.0)[seen]
        assert np.mean(off) < 0.035 + np.mean(found.standard_error[seen] / found.value[seen])
        assert abs(law.albedo.reflectance(one) / photons.reflectance(one).value - 1.0) < 0.01


def test_similarity_is_told_from_it():
    """A negative control: the law of isotropic light at the same reduced albedo and l*."""
    alpha, length = reduced(unreduced(0.3, 0.8), 0.8)
    r = np.geomspace(0.3, 8.0, 20)
    wanted = exact.profile(r, unreduced(0.3, 0.8), setting=TISSUE)
    own = load("hazard", setting=TISSUE).profile(r, unreduced(0.3, 0.8)) / wanted - 1.0
    other = load("hazard", setting=replace(TISSUE, g=0.0)).profile(r, alpha, length) / wanted - 1.0
    assert np.mean(np.abs(own)) < 0.02
    assert np.mean(np.abs(other)) > 0.33
    for light in LIGHTS:
        isotropic = exact.reflectance(0.3, Setting(light, 1.4))
        assert isotropic / exact.reflectance(unreduced(0.3, 0.8), Setting(light, 1.4, 0.8)) > 5 / 3


def test_a_negative_h_is_not_finite_next_to_the_source():
    """A fit takes such a step back: one that stayed ended at 17 times the least cost, and was called converged."""
    law = replace(load("hazard", setting=Setting(n=1.4, g=0.05)), once_h0=9.6, once_hg=-10.4)
    assert float(law.coefficients().once_h) < 0
    assert not np.any(np.isfinite(law.profile(np.array([1e-3, 1e-2]), 0.5)))


@pytest.mark.parametrize("setting", [TISSUE, Setting("diffuse", 1.31, 0.95), Setting(n=1.5, g=0.1)], ids=str)
def test_the_ends_are_exact(setting):
    law, nearest = load("hazard", setting=setting), 1e-9
    alpha = ALPHA[:, 0]
    source = 2 * np.pi * nearest * law.profile(nearest, alpha)
    np.testing.assert_allclose(source, alpha * single_scattering.source_strength(setting), rtol=1e-6)
    assert law.albedo.reflectance(1.0) == pytest.approx(single_scattering.entered(setting), rel=1e-12)
    assert law.albedo.reflectance(1e-9) / 1e-9 == pytest.approx(single_scattering.reflected(setting), rel=1e-6)
    np.testing.assert_allclose(law.cdf([0.0, 1e9], 0.9), [0, 1], atol=1e-12)
    assert np.all(np.diff(law.cdf(R, ALPHA), axis=1) >= 0)
    assert np.all(law.profile(R, ALPHA) >= 0)


def test_albedos_and_lengths_are_those_of_the_medium():
    """As those of `exact`; its shader source has reduced ones, as `in_reduced`."""
    law = load("hazard", setting=TISSUE)
    own, (by, length) = law.in_reduced(), reduced(ALPHA, 0.8)
    np.testing.assert_allclose(law.profile(R, ALPHA, 2.0), own.profile(R, by, 2.0 * length), rtol=1e-12)
    np.testing.assert_allclose(law.cdf(R, ALPHA, 2.0), own.cdf(R, by, 2.0 * length), rtol=1e-11)
    np.testing.assert_allclose(law.albedo.reflectance(ALPHA), own.albedo.reflectance(by), rtol=1e-12)
    np.testing.assert_allclose(law.total(by), own.albedo.reflectance(by), rtol=1e-6)  # as the scaled functions
    np.testing.assert_allclose(law.albedo.alpha(law.albedo.reflectance(ALPHA)), ALPHA, rtol=1e-9)
    assert own.text_constants() == law.text_constants()
    assert own.text_numbers() == law.text_numbers()
    energy = np.trapezoid(2 * np.pi * R**2 * law.profile(R, 0.9), np.log(R))
    assert energy == pytest.approx(
        law.albedo.reflectance(0.9), rel=0.05
    )  # coarse, but no factor 1 - alpha g of an mfp is lost


@pytest.mark.parametrize("g", [0.6, *slow(0.1, 0.95)])
def test_its_sampler_draws_its_light(g):
    law, xi = load("hazard", setting=Setting(n=1.4, g=g)), np.linspace(0.001, 0.999, 301)
    for steps, most in (("one step", 3e-3), ("two steps", 1e-4)):
        sampler = law.samplers[steps]
        assert np.max(np.abs(sampler.undone(sampler.sample(xi, ALPHA), xi, ALPHA) - xi)) < most


@pytest.mark.parametrize("name", ["hazard", "rational"])
def test_its_text_has_the_derivatives_of_its_constants(name):
    law = (load if name == "hazard" else albedo_law)(name, setting=TISSUE)
    for text, slopes in law.folds().items():
        for constant, slope in slopes.items():
            up, down = (replace(law, **{constant: getattr(law, constant) + step}) for step in (1e-5, -1e-5))
            difference = (up.text_constants()[text] - down.text_constants()[text]) / 2e-5
            assert difference == pytest.approx(slope, rel=1e-6, abs=1e-9)


def test_where_it_does_not_hold_it_says_so():
    for setting in (Setting(n=1.6, g=0.8), Setting(n=1.4, g=0.97), Setting(n=1.4, g=-0.2), Setting(g=0.8)):
        with pytest.raises(SettingError, match=r"n in \(1.3, 1.5\], g in \(0, 0.95\]"):
            load("hazard", setting=setting)
