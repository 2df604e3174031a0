"""Light through a part with layers on both sides: two constants, against exact plates that they were not fitted to."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Layer, Medium, exact
from profilefit.scenes.layers.law import plate_of

EPIDERMIS, DERMIS = Layer(1.4, 0.21, 4.8, 0.0, 0.25), Layer(1.4, 0.0085, 0.45, 0.0)
SKIN = Medium((EPIDERMIS, DERMIS))


@pytest.fixture(scope="module")
def plate():
    return plate_of(SKIN)


def exactly(core, thickness):
    layers = (EPIDERMIS, replace(core, thickness=thickness - 2 * EPIDERMIS.thickness), EPIDERMIS)
    return exact.solve(Medium(layers), "diffuse").transmittance


@pytest.mark.parametrize("thickness", [0.7, 1.1, 2.5, 6.0, 14.0, 30.0])
def test_plates_between_and_beyond_those_fitted(plate, thickness):
    """Within half a percent; a plate without its skins lets through another light."""
    found = float(plate.transmitted(thickness))
    assert found == pytest.approx(exactly(DERMIS, thickness), rel=5e-3)
    bare = exact.solve(Medium((replace(DERMIS, thickness=thickness),)), "diffuse").transmittance
    assert abs(found / bare - 1) > 0.1


def test_far_inside_light_dies_with_the_core(plate):
    ratio = plate.transmitted(81.0) / plate.transmitted(80.0)
    assert ratio == pytest.approx(np.exp(-float(exact.decay_rate(DERMIS.alpha)) / DERMIS.mfp), rel=1e-6)


def test_the_error_that_is_said_is_that_of_a_dark_core(plate):
    dark = Layer(1.4, 2.5, 0.48, 0.0)
    said = plate_of(Medium((EPIDERMIS, dark))).error
    assert said > 0.1
    assert plate.error < 2e-3


def test_a_part_no_thicker_than_its_skins_counts_as_these(plate):
    assert plate.transmitted(0.1) == plate.transmitted(2 * EPIDERMIS.thickness) <= 1
