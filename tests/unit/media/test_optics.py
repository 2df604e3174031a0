import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Layer, Medium
from mcml_sim.media import fresnel


def polarised(n1, n2, angle):
    """Textbook reflectances across and along the plane of incidence, by the angles themselves (Snell, Fresnel)."""
    refracted = np.arcsin(n1 / n2 * np.sin(angle))
    across = (np.sin(angle - refracted) / np.sin(angle + refracted)) ** 2
    along = (np.tan(angle - refracted) / np.tan(angle + refracted)) ** 2
    return across, along


@pytest.mark.parametrize(("n1", "n2"), [(1.0, 1.5), (1.5, 1.0), (1.37, 1.4)])
def test_fresnel_is_the_mean_of_the_textbooks_polarisations(n1, n2):
    angle = np.linspace(0.01, 0.99, 50) * (np.arcsin(min(n2 / n1, 1.0)))
    reflectance, cosine = fresnel.fresnel(n1, n2, np.cos(angle))
    np.testing.assert_allclose(reflectance, np.mean(polarised(n1, n2, angle), axis=0), rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(1 - cosine**2) * n2, n1 * np.sin(angle), rtol=1e-9)


def test_fresnel_at_normal_incidence():
    reflectance, cosine = fresnel.fresnel(1.0, 1.5, 1.0)
    assert reflectance == pytest.approx(0.04)
    assert cosine == 1.0


def test_half_of_the_light_is_polarised_at_brewsters_angle():
    angle = np.arctan(1.5)
    across, along = polarised(1.0, 1.5, angle)
    assert along == pytest.approx(0, abs=1e-30)
    assert fresnel.fresnel(1.0, 1.5, np.cos(angle))[0] == pytest.approx(across / 2)


def test_beyond_the_critical_angle_everything_is_reflected():
    critical = np.sqrt(1 - (1 / 1.5) ** 2)
    reflectance, cosine = fresnel.fresnel(1.5, 1.0, np.array([0.0, 0.3, critical - 1e-9, critical + 1e-6]))
    np.testing.assert_array_equal(reflectance[:3], 1)
    np.testing.assert_array_equal(cosine[:3], 0)
    assert reflectance[3] < 1
    assert 0 < cosine[3] < 0.01


def test_grazing_light_is_reflected_unless_the_indices_are_equal():
    assert fresnel.fresnel(1.0, 1.5, 0.0)[0] == 1
    assert fresnel.fresnel(1.4, 1.4, 0.0) == (0, 0)


def test_equal_indices_neither_reflect_nor_bend():
    cosine = np.random.default_rng(0).random(1000).astype(np.float32)
    reflectance, refracted = fresnel.fresnel(np.float32(1.37), np.float32(1.37), cosine)
    assert np.all(reflectance == 0)
    np.testing.assert_array_equal(refracted, cosine)


def test_fresnel_of_jax_arrays_is_that_of_numpy_in_single_precision():
    cosine = np.linspace(0, 1, 1001)
    for n1, n2 in ((1.0, 1.5), (1.5, 1.0)):
        single = fresnel.fresnel(jnp.float32(n1), jnp.float32(n2), jnp.asarray(cosine, jnp.float32))
        for fast, exact in zip(single, fresnel.fresnel(n1, n2, cosine), strict=True):
            assert fast.dtype == jnp.float32
            # Near the critical angle both rise as a square root, and 1e-7 in the cosine becomes 3e-4.
            assert np.all(np.isfinite(fast))
            assert np.abs(np.asarray(fast, float) - exact).max() < 2e-3
            assert np.median(np.abs(np.asarray(fast, float) - exact)) < 1e-6


def test_a_first_layer_of_tissue_reflects_as_its_surface():
    medium = Medium((Layer(1.37, 1, 100, 0.9, 0.1), Layer(1.5, 1, 10, 0, 0.1)))
    assert fresnel.specular_reflectance(medium) == pytest.approx((0.37 / 2.37) ** 2)


@pytest.mark.parametrize("below", ["tissue", "nothing"])
def test_glass_reflects_with_all_orders_between_its_faces(below):
    glass, tissue = Layer(1.5, 0, 0, 0, 0.1), Layer(1.37, 1, 10, 0, 0.1)
    medium = Medium((glass, tissue), 1.1) if below == "tissue" else Medium((glass,), 1.1, 1.37)
    top, bottom = (0.4 / 2.6) ** 2, (0.13 / 2.87) ** 2
    series = top + sum((1 - top) ** 2 * bottom * (top * bottom) ** k for k in range(20))
    assert fresnel.specular_reflectance(medium) == pytest.approx(series, rel=1e-12)


def test_a_matched_surface_reflects_nothing():
    assert fresnel.specular_reflectance(Medium((Layer(1.0, 1, 1, 0),))) == 0
