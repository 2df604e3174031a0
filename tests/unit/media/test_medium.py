"""Layers, media, settings and interfaces: what physics allows, and a name for what it does not."""

import dataclasses
import math
import pickle

import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import InputError, Layer, Medium, Setting, half_space
from mcml_sim.media.medium import MAX_LAYERS, fresnel, specular_reflectance
from tests.fixtures import refused

TISSUE = Layer(n=1.4, mu_a=1, mu_s=99, g=0.9, thickness=0.1)
NO_NUMBERS = (np.nan, None, True, False, np.complex128(0.5), np.complex128(1.4))


def test_derived_numbers_of_a_layer():
    assert (TISSUE.mu_t, TISSUE.alpha, TISSUE.mfp) == (100, pytest.approx(9.9 / 10.9), pytest.approx(1 / 10.9))
    assert {Layer(1.4, 0.0, mu_s, g).alpha for mu_s in (49.0, 1.9, 3.8) for g in (0.0, 0.9)} == {1.0}
    similar = TISSUE.similar
    assert (similar.g, similar.mu_a, similar.thickness, similar.mu_s) == (0, 1, 0.1, pytest.approx(9.9))
    glass = Layer(n=1.5, mu_a=0, mu_s=0, g=1, thickness=0.1)
    assert (glass.mu_t, glass.alpha, glass.mfp) == (0, 0, math.inf)


def test_media_are_values_and_have_interfaces():
    medium = Medium([TISSUE, TISSUE, Layer(1.4, 1, 9, 0)])
    np.testing.assert_allclose(medium.z_edges, [0, 0.1, 0.2, math.inf])
    assert medium.is_half_space
    assert not Medium((TISSUE,)).is_half_space
    medium = Medium([TISSUE, TISSUE], n_above=1.1)
    assert medium == Medium((TISSUE, TISSUE), 1.1, 1)
    assert medium != Medium((TISSUE, TISSUE))
    assert hash(medium) == hash(pickle.loads(pickle.dumps(medium)))
    assert Medium(TISSUE).layers == (TISSUE,)
    with pytest.raises(AttributeError):
        medium.n_above = 2


@pytest.mark.parametrize(
    ("medium", "matched"),
    [
        (half_space(0.9), True),
        (half_space(0.0, mfp=3), True),
        (half_space(0.9, n=1.4), False),
        (half_space(0.9, g=0.5), False),
        (Medium((Layer(1.4, 1, 9, 0),), n_above=1.4), True),
        (Medium((Layer(1.4, 1, 9, 0),), n_above=1.4, n_below=2), True),
        (Medium((Layer(1, 1, 9, 0, 5.0),)), False),
        (Medium((Layer(1, 1, 9, 0, 5.0), Layer(1, 1, 9, 0))), False),
    ],
)
def test_which_media_are_matched_isotropic_half_spaces(medium, matched):
    assert medium.is_matched_isotropic_half_space == matched


def test_half_space_takes_the_reduced_albedo_and_the_transport_mean_free_path():
    (layer,) = half_space(0.8, mfp=2.0, n=1.3, g=0.5).layers
    assert (layer.n, layer.g, layer.thickness, layer.mu_a) == (1.3, 0.5, math.inf, pytest.approx(0.1))
    assert (layer.mu_s, layer.alpha, layer.mfp) == (pytest.approx(0.8), pytest.approx(0.8), pytest.approx(2.0))


@pytest.mark.parametrize("value", [math.nan, math.inf, "1", None, True, np.True_, np.complex128(0.5)])
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("n", "n must be a refractive index > 0"),
        ("mu_a", "mu_a must be a coefficient >= 0"),
        ("mu_s", "mu_s must be a coefficient >= 0"),
        ("g", r"g must be a mean cosine in \(-1, 1\)"),
        ("thickness", "thickness must be > 0"),
    ],
)
def test_a_layer_names_what_is_no_number(name, message, value):
    if (name, value) == ("thickness", math.inf):
        value = -math.inf
    refused(f"{message}.*, got ", Layer, **{"n": 1.4, "mu_a": 1, "mu_s": 9, "g": 0, "thickness": 1, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("n", 0), ("n", -1), ("mu_a", -1e-9), ("mu_s", -1), ("g", 1), ("g", -1), ("g", 1.1), ("thickness", 0)],
)
def test_a_layer_names_what_physics_forbids(name, value):
    with pytest.raises(InputError, match=f"^{name} must be .*, got {value!r}$"):
        Layer(**{"n": 1.4, "mu_a": 1, "mu_s": 9, "g": 0, "thickness": 1, name: value})


def test_a_medium_names_what_is_wrong():
    refused(r"mu_a \+ mu_s must be finite, got 1.7e\+308 and 1.7e\+308", Layer, 1, 1.7e308, 1.7e308, 0, 1)
    refused("layers must be Layer objects, got 3", Medium, (TISSUE, 3))
    refused("layers must be Layer objects, got 'tissue'", Medium, "tissue")
    refused(f"a medium must have 1 to {MAX_LAYERS} layers, got 0", Medium, ())
    refused(f"a medium must have 1 to {MAX_LAYERS} layers, got {MAX_LAYERS + 1}", Medium, (TISSUE,) * (MAX_LAYERS + 1))
    refused("n_above must be a refractive index > 0, got 0", Medium, (TISSUE,), n_above=0)
    refused("n_below must be a refractive index > 0, got nan", Medium, (TISSUE,), n_below=math.nan)
    with pytest.raises(InputError, match="thickness may be infinite in the last layer only, got it in layer 2"):
        Medium((TISSUE, Layer(1.4, 1, 9, 0), TISSUE))
    with pytest.raises(InputError, match="an infinitely thick layer must scatter or absorb, got mu_a = mu_s = 0"):
        Medium((TISSUE, Layer(1.5, 0, 0, 0)))


def test_settings_are_values():
    assert (Setting(), str(Setting())) == (Setting("searchlight", 1.0, 0.0), "searchlight, n = 1, g = 0")
    assert str(Setting("diffuse", 1.4, 0.75)) == "diffuse, n = 1.4, g = 0.75"
    assert hash(Setting()) == hash(Setting("searchlight"))
    assert Setting(n=np.float32(1.5), g=np.float64(0.5)) == Setting(n=1.5, g=0.5)
    assert Setting(n=np.int64(2)) == Setting(n=2.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign"):
        Setting().n = 1.4


@pytest.mark.parametrize(
    ("setting", "matched"),
    [(Setting("diffuse"), True), (Setting(n=1.4), False), (Setting(g=-0.5), False), (Setting(g=0.1), False)],
    ids=str,
)
def test_any_difference_makes_another_setting_and_light_does_not_unmatch_it(setting, matched):
    assert setting != Setting()
    assert Setting().is_matched_isotropic
    assert setting.is_matched_isotropic is matched


@pytest.mark.parametrize(
    ("make", "values", "message"),
    [
        (half_space, [-0.1, 1.1, math.nan, None, True], r"alpha must be a reduced albedo in \[0, 1\]"),
        (lambda mfp: half_space(0.5, mfp), [0, -1, np.inf, np.nan, "1"], "mfp must be a transport mean free path > 0"),
        (Setting, ["laser", "", None, 3, ["diffuse"]], "illumination must be one of searchlight, diffuse"),
        (lambda n: Setting(n=n), [0.0, -1.4, np.inf, "glass", *NO_NUMBERS], "n must be a refractive index > 0"),
        (lambda g: Setting(g=g), [-1.0, 1.0, 2.0, "forward", *NO_NUMBERS], r"g must be a mean cosine in \(-1, 1\)"),
    ],
    ids=["albedo", "mean free path", "illumination", "index", "mean cosine"],
)
def test_bad_arguments_are_named(make, values, message):
    for value in values:
        refused(f"{message}, got", make, value)


def polarised(n1, n2, angle):
    """Textbook reflectances across and along the plane of incidence, by the angles themselves (Snell, Fresnel)."""
    refracted = np.arcsin(n1 / n2 * np.sin(angle))
    across = (np.sin(angle - refracted) / np.sin(angle + refracted)) ** 2
    along = (np.tan(angle - refracted) / np.tan(angle + refracted)) ** 2
    return across, along


@pytest.mark.parametrize(("n1", "n2"), [(1.0, 1.5), (1.5, 1.0), (1.37, 1.4)])
def test_fresnel_is_the_mean_of_the_textbooks_polarisations(n1, n2):
    angle = np.linspace(0.01, 0.99, 50) * (np.arcsin(min(n2 / n1, 1.0)))
    reflectance, cosine = fresnel(n1, n2, np.cos(angle))
    np.testing.assert_allclose(reflectance, np.mean(polarised(n1, n2, angle), axis=0), rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(1 - cosine**2) * n2, n1 * np.sin(angle), rtol=1e-9)


def test_fresnel_at_angles_that_stand_out():
    """Normal, Brewster's, beyond the critical angle, and grazing."""
    reflectance, cosine = fresnel(1.0, 1.5, 1.0)
    assert reflectance == pytest.approx(0.04)
    assert cosine == 1.0
    angle = np.arctan(1.5)
    across, along = polarised(1.0, 1.5, angle)
    assert along == pytest.approx(0, abs=1e-30)
    assert fresnel(1.0, 1.5, np.cos(angle))[0] == pytest.approx(across / 2)
    critical = np.sqrt(1 - (1 / 1.5) ** 2)
    reflectance, cosine = fresnel(1.5, 1.0, np.array([0.0, 0.3, critical - 1e-9, critical + 1e-6]))
    np.testing.assert_array_equal(reflectance[:3], 1)
    np.testing.assert_array_equal(cosine[:3], 0)
    assert reflectance[3] < 1
    assert 0 < cosine[3] < 0.01
    assert fresnel(1.0, 1.5, 0.0)[0] == 1
    # Equal indices neither reflect nor bend.
    assert fresnel(1.4, 1.4, 0.0) == (0, 0)
    cosine = np.random.default_rng(0).random(1000).astype(np.float32)
    reflectance, refracted = fresnel(np.float32(1.37), np.float32(1.37), cosine)
    assert np.all(reflectance == 0)
    np.testing.assert_array_equal(refracted, cosine)


def test_fresnel_of_jax_arrays_is_that_of_numpy_in_single_precision():
    cosine = np.linspace(0, 1, 1001)
    for n1, n2 in ((1.0, 1.5), (1.5, 1.0)):
        single = fresnel(jnp.float32(n1), jnp.float32(n2), jnp.asarray(cosine, jnp.float32))
        for fast, exact in zip(single, fresnel(n1, n2, cosine), strict=True):
            assert fast.dtype == jnp.float32
            # Near the critical angle both rise as a square root, and 1e-7 in the cosine becomes 3e-4.
            assert np.all(np.isfinite(fast))
            assert np.abs(np.asarray(fast, float) - exact).max() < 2e-3
            assert np.median(np.abs(np.asarray(fast, float) - exact)) < 1e-6


def test_tissue_reflects_as_its_surface_and_glass_with_all_orders_between_its_faces():
    medium = Medium((Layer(1.37, 1, 100, 0.9, 0.1), Layer(1.5, 1, 10, 0, 0.1)))
    assert specular_reflectance(medium) == pytest.approx((0.37 / 2.37) ** 2)
    assert specular_reflectance(Medium((Layer(1.0, 1, 1, 0),))) == 0, "a matched one reflects nothing"
    glass, tissue = Layer(1.5, 0, 0, 0, 0.1), Layer(1.37, 1, 10, 0, 0.1)
    top, bottom = (0.4 / 2.6) ** 2, (0.13 / 2.87) ** 2
    series = top + sum((1 - top) ** 2 * bottom * (top * bottom) ** k for k in range(20))
    for medium in (Medium((glass, tissue), 1.1), Medium((glass,), 1.1, 1.37)):
        assert specular_reflectance(medium) == pytest.approx(series, rel=1e-12)
