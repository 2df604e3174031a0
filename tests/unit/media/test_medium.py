"""Layers, media and settings: what physics allows, and a name for what it does not."""

import dataclasses
import math
import pickle

import numpy as np
import pytest

from mcml_sim import InputError, Layer, Medium, Setting, half_space
from mcml_sim.media.medium import MAX_LAYERS

TISSUE = Layer(n=1.4, mu_a=1, mu_s=99, g=0.9, thickness=0.1)


def test_derived_numbers_of_a_layer():
    assert TISSUE.mu_t == 100
    assert TISSUE.alpha == 0.99
    assert TISSUE.mfp == 0.01
    similar = TISSUE.similar
    assert (similar.g, similar.mu_a, similar.thickness) == (0, 1, 0.1)
    assert similar.mu_s == pytest.approx(9.9)


def test_clear_glass_is_a_layer():
    glass = Layer(n=1.5, mu_a=0, mu_s=0, g=1, thickness=0.1)
    assert (glass.mu_t, glass.alpha, glass.mfp) == (0, 0, math.inf)


def test_depths_of_the_interfaces():
    medium = Medium([TISSUE, TISSUE, Layer(1.4, 1, 9, 0)])
    np.testing.assert_allclose(medium.z_edges, [0, 0.1, 0.2, math.inf])
    assert medium.is_half_space
    assert not Medium((TISSUE,)).is_half_space


def test_media_are_values():
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
        (half_space(1.0, mfp=3), True),
        (half_space(0.0), True),
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


def test_half_space_takes_the_mean_free_path_of_the_light_itself():
    (layer,) = half_space(0.8, mfp=2.0, n=1.3, g=0.5).layers
    assert (layer.n, layer.g, layer.thickness) == (1.3, 0.5, math.inf)
    assert layer.mu_a == pytest.approx(0.1)
    assert layer.mu_s == pytest.approx(0.4)
    assert layer.alpha == pytest.approx(0.8)
    assert layer.mfp == pytest.approx(2.0)


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
    with pytest.raises(InputError, match=f"{message}.*, got "):
        Layer(**{"n": 1.4, "mu_a": 1, "mu_s": 9, "g": 0, "thickness": 1, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [("n", 0), ("n", -1), ("mu_a", -1e-9), ("mu_s", -1), ("g", 1), ("g", -1), ("g", 1.1), ("thickness", 0)],
)
def test_a_layer_names_what_physics_forbids(name, value):
    with pytest.raises(InputError, match=f"^{name} must be .*, got {value!r}$"):
        Layer(**{"n": 1.4, "mu_a": 1, "mu_s": 9, "g": 0, "thickness": 1, name: value})


def test_extinction_must_be_finite_too():
    with pytest.raises(InputError, match=r"mu_a \+ mu_s must be finite, got 1.7e\+308 and 1.7e\+308"):
        Layer(1, 1.7e308, 1.7e308, 0, 1)


def test_a_medium_names_what_is_wrong():
    with pytest.raises(InputError, match="layers must be Layer objects, got 3"):
        Medium((TISSUE, 3))
    with pytest.raises(InputError, match="layers must be Layer objects, got 'tissue'"):
        Medium("tissue")
    with pytest.raises(InputError, match=f"a medium must have 1 to {MAX_LAYERS} layers, got 0"):
        Medium(())
    with pytest.raises(InputError, match=f"a medium must have 1 to {MAX_LAYERS} layers, got {MAX_LAYERS + 1}"):
        Medium((TISSUE,) * (MAX_LAYERS + 1))
    with pytest.raises(InputError, match="n_above must be a refractive index > 0, got 0"):
        Medium((TISSUE,), n_above=0)
    with pytest.raises(InputError, match="n_below must be a refractive index > 0, got nan"):
        Medium((TISSUE,), n_below=math.nan)
    with pytest.raises(InputError, match="thickness may be infinite in the last layer only, got it in layer 2"):
        Medium((TISSUE, Layer(1.4, 1, 9, 0), TISSUE))
    with pytest.raises(InputError, match="an infinitely thick layer must scatter or absorb, got mu_a = mu_s = 0"):
        Medium((TISSUE, Layer(1.5, 0, 0, 0)))


@pytest.mark.parametrize("alpha", [-0.1, 1.1, math.nan, None, True])
def test_half_space_names_a_wrong_albedo(alpha):
    with pytest.raises(InputError, match=r"alpha must be a single-scattering albedo in \[0, 1\], got"):
        half_space(alpha)


@pytest.mark.parametrize("mfp", [0, -1, math.inf, math.nan, "1"])
def test_half_space_names_a_wrong_mean_free_path(mfp):
    with pytest.raises(InputError, match="mfp must be a mean free path > 0, got"):
        half_space(0.5, mfp=mfp)


def test_default_is_the_matched_searchlight():
    assert Setting() == Setting("searchlight", 1.0, 0.0)
    assert str(Setting()) == "searchlight, n = 1, g = 0"
    assert Setting().is_matched_isotropic


@pytest.mark.parametrize("other", [Setting("diffuse"), Setting(n=1.4), Setting(g=-0.5)])
def test_any_difference_makes_another_setting(other):
    assert other != Setting()
    assert hash(Setting()) == hash(Setting("searchlight"))


@pytest.mark.parametrize(
    ("setting", "matched"), [(Setting("diffuse"), True), (Setting(n=1.4), False), (Setting(g=0.1), False)]
)
def test_matched_isotropic_does_not_ask_for_the_light(setting, matched):
    assert setting.is_matched_isotropic is matched


def test_a_setting_reads_as_it_is():
    assert str(Setting("diffuse", 1.4, 0.75)) == "diffuse, n = 1.4, g = 0.75"


def test_a_setting_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign"):
        Setting().n = 1.4


@pytest.mark.parametrize("illumination", ["laser", "", None, 3, ["diffuse"]])
def test_illumination_must_be_known(illumination):
    with pytest.raises(InputError, match="illumination must be one of searchlight, diffuse, got"):
        Setting(illumination)


@pytest.mark.parametrize("n", [0.0, -1.4, np.inf, np.nan, "glass", None, True, np.complex128(1.4)])
def test_n_must_be_a_refractive_index(n):
    with pytest.raises(InputError, match="n must be a refractive index > 0, got"):
        Setting(n=n)


def test_numbers_of_numpy_are_numbers():
    assert Setting(n=np.float32(1.5), g=np.float64(0.5)) == Setting(n=1.5, g=0.5)
    assert Setting(n=np.int64(2)) == Setting(n=2.0)


@pytest.mark.parametrize("g", [-1.0, 1.0, 2.0, np.nan, "forward", None, False, np.complex128(0.5)])
def test_g_must_be_a_mean_cosine(g):
    with pytest.raises(InputError, match=r"g must be a mean cosine in \(-1, 1\), got"):
        Setting(g=g)
