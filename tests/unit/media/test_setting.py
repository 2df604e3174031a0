"""Light and surface: what is accepted, how two of them compare, how one reads."""

import dataclasses

import numpy as np
import pytest

from mcml_sim import InputError, Setting


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
