"""One layer for a stack: the same medium in two pieces is one, glass over milk is not."""

import math

import numpy as np
import pytest

from mcml_sim import Layer, Medium
from profilefit.errors import InputError
from profilefit.recipes.stack.file import LayerStack
from profilefit.scenes.layers.half_space import RingShares
from profilefit.studies.choose import layers as module
from profilefit.studies.choose.case import Within
from profilefit.studies.choose.layers import OneLayer, of_each_colour, one_layer

WITHIN = Within()


def test_rings_beyond_an_edge():
    """One ring: the share of its circle beyond the edge."""
    ring = RingShares(np.array([2.0]), np.array([1.0]), np.array([0.0]))
    np.testing.assert_allclose(ring.beyond(np.array([0.0, 1.0, 3.0])), [0.5, 1.0 / 3.0, 0.0])


@pytest.mark.parametrize(("error", "verdict"), [(0.01, "enough"), (0.03, "not enough"), (0.0195, "undecided")])
def test_verdict(error, verdict):
    assert OneLayer(0.5, 0.9, 1.0, 1.0, error, 0.001, 1000, 0.0).verdict(0.02) == verdict


def test_equal_colours_are_traced_once(monkeypatch):
    """One answer of a grey stack, three of a coloured one, from as many runs as there are different media."""
    pale, dark = (Medium((Layer(1.0, mu_a, 0.9, 0.0),)) for mu_a in (0.1, 0.2))
    traced = []
    monkeypatch.setattr(module, "one_layer", lambda medium, *_, **__: traced.append(medium) or medium)
    grey = LayerStack("mm", (pale, pale, pale), ("",), ("",))
    assert of_each_colour(grey, 0.02, WITHIN) == (pale,)
    assert of_each_colour(LayerStack("mm", (pale, dark, pale), ("",), ("",)), 0.02, WITHIN) == (pale, dark, pale)
    assert traced == [pale, pale, dark]


@pytest.mark.slow
def test_two_halves_are_one_layer():
    """By exact light; traced within three standard errors of nothing. With its own mean free path and albedo."""
    stack = Medium((Layer(1.0, 0.1, 0.9, 0.0, 0.5), Layer(1.0, 0.1, 0.9, 0.0)))
    found, traced = one_layer(stack, 0.02, WITHIN), one_layer(stack, 0.02, WITHIN, 2**18)
    assert (found.photons, found.error) == (0, pytest.approx(0.0, abs=1e-6))
    assert traced.error < 3.0 * traced.standard_error
    for one, mfp in ((found, 1e-4), (traced, 0.01)):
        assert one.alpha == pytest.approx(0.9, abs=0.1 * mfp)
        assert one.mfp == pytest.approx(1.0, abs=mfp)
        assert one.verdict(0.02) == "enough"


@pytest.mark.slow
@pytest.mark.parametrize(("illumination", "off"), [("searchlight", 0.02), ("diffuse", 0.03)])
def test_exact_light_and_traced_light_say_the_same(illumination, off):
    """Skin in red light, whose lower layer is clear; its mean free path moves by 1 % from seed to seed."""
    stack = Medium((Layer(1.4, 0.21, 4.8, 0.0, 0.25), Layer(1.4, 0.0085, 0.45, 0.0)))
    found, traced = (one_layer(stack, 0.02, WITHIN, photons, illumination=illumination) for photons in (None, 2**20))
    assert found.error > 0.01
    assert traced.error == pytest.approx(found.error, abs=4.0 * traced.standard_error)
    assert traced.mfp == pytest.approx(found.mfp, rel=off)
    assert found.single == traced.single


@pytest.mark.slow
def test_a_thin_veil_is_not():
    """Negative control: thin paper far above an ink that is clear and deep."""
    stack = Medium((Layer(1.0, 0.001, 5.0, 0.0, 0.4), Layer(1.0, 0.0, 0.0, 0.0, 3.0), Layer(1.0, 0.02, 3.0, 0.0)))
    found = one_layer(stack, 0.02, WITHIN)
    assert found.error > 10.0 * found.standard_error
    assert found.verdict(0.02) == "not enough"


@pytest.mark.slow
def test_black_has_no_single_layer():
    stack = Medium((Layer(1.0, 1.0, 0.0, 0.0, math.inf),))
    with pytest.raises(InputError, match=r"layers must reflect a share in \(0, .*\) of the light, got 0.000"):
        one_layer(stack, 0.02, WITHIN, 10_000)


def test_glass_is_no_layer():
    with pytest.raises(InputError, match="layers must scatter or absorb somewhere, got 1 that are clear"):
        one_layer(Medium((Layer(1.5, 0.0, 0.0, 0.0, 1.0),)), 0.02, WITHIN)
