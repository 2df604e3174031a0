"""Skin as sums of Gaussians: the printed sets, typed a second time, and what their authors say of them."""

import math

import numpy as np
import pytest

from profilefit.materials import CHANNELS
from profilefit.scenes.skin.law import D_EON, separable

# d'Eon and Luebke, GPU Gems 3, ch. 14: variance [mm^2], weights of red, green, blue.
PRINTED = """
0.0064  0.233  0.455  0.649
0.0484  0.100  0.336  0.344
0.187   0.118  0.198  0
0.567   0.113  0.007  0.007
1.99    0.358  0.004  0
7.41    0.078  0      0
"""


def test_the_printed_table():
    table = np.array([[float(word) for word in line.split()] for line in PRINTED.strip().splitlines()])
    np.testing.assert_array_equal(D_EON.variances, table[:, 0])
    np.testing.assert_array_equal(D_EON.weights, table[:, 1:])
    assert len(CHANNELS) == 3


def energy(skin):
    """Integral of 2 pi r R over all r, of red, green, blue [-]."""
    return np.sum(skin.weights, axis=0) * np.square(skin.stretches)


def test_weights_sum_to_one():
    """ "The Gaussian weights for each profile sum to 1.0": white light stays white."""
    np.testing.assert_allclose(energy(D_EON), 1.0, rtol=1e-12)


@pytest.mark.parametrize("skin", [D_EON, separable()], ids=["d_eon", "separable"])
def test_profile_integrates_to_its_energy(skin):
    r = np.geomspace(1e-5, 30, 4001)
    total = np.trapezoid(2 * np.pi * r[:, None] ** 2 * skin.profile(r), np.log(r), axis=0)
    np.testing.assert_allclose(total, energy(skin), rtol=1e-5)


def test_red_by_hand():
    """At the origin sum w / (2 pi v)."""
    weights, variances = (0.233, 0.1, 0.118, 0.113, 0.358, 0.078), (0.0064, 0.0484, 0.187, 0.567, 1.99, 7.41)
    expected = sum(w / (2 * math.pi * v) for w, v in zip(weights, variances, strict=True))
    assert D_EON.profile(0.0)[0] == pytest.approx(expected, rel=1e-14)
    assert D_EON.profile(np.ones((2, 5))).shape == (2, 5, 3)


def test_separable_is_red_without_the_narrowest():
    """In every channel, stretched by 0.001 + falloff, by default 1, 0.37, 0.3."""
    skin, r = separable(), 0.8
    for channel, falloff in enumerate((1.0, 0.37, 0.3)):
        scaled = r / (0.001 + falloff)
        narrowest = 0.233 * math.exp(-(scaled**2) / (2 * 0.0064)) / (2 * math.pi * 0.0064)
        assert skin.profile(r)[channel] == pytest.approx(D_EON.profile(scaled)[0] - narrowest, rel=1e-12)
    assert energy(skin)[0] == pytest.approx(0.767 * 1.001**2, rel=1e-12)
