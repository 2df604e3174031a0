"""What a G-buffer must be where light scatters; nothing is asked elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planes import flat, step_edge
from profilefit.errors import InputError


def spoilt(name, value, mask=1.0):
    """A plane with one bad pixel, and the mask there."""
    plane = replace(flat((4, 3), 1.0, 0.5), visibility=np.ones((3, 4)), roughness=np.ones((3, 4)))
    array, inside = np.array(getattr(plane, name)), np.array(plane.mask)
    array[1, 2], inside[1, 2] = value, mask
    return replace(plane, mask=inside, **({} if name == "mask" else {name: array}))


@pytest.mark.parametrize(
    "name", ["irradiance", "reflectance", "position", "normal", "thickness", "visibility", "roughness"]
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_all_are_finite_where_light_scatters(name, value):
    with pytest.raises(InputError, match=rf"{name} must be finite where mask > 0.5, got {value}"):
        spoilt(name, value)
    assert spoilt(name, value, mask=0.5).size == (4, 3)


@pytest.mark.parametrize("value", [-0.1, 1.5])
def test_reflectance_is_a_share(value):
    with pytest.raises(InputError, match=rf"reflectance must be in \[0, 1\] where mask > 0.5, got {value}"):
        spoilt("reflectance", value)
    assert spoilt("reflectance", value, mask=0.0).size == (4, 3)
    assert spoilt("reflectance", np.float32(1.0) + np.finfo(np.float32).eps).size == (4, 3)  # a filter's rounding


def test_misuse():
    plane = flat((4, 3), 1.0, 0.5)
    with pytest.raises(InputError, match="mask must be finite, got nan"):
        replace(plane, mask=np.full((3, 4), np.nan))
    with pytest.raises(InputError, match=r"pixel must be a length > 0 \[mm\], got 0"):
        replace(plane, pixel=0.0)
    with pytest.raises(InputError, match=r"normal must have shape \(3, 4, 3\), as mask has, got \(4, 4, 3\)"):
        replace(plane, normal=np.zeros((4, 4, 3), np.float32))
    with pytest.raises(InputError, match=r"even number of columns.* got 5"):
        step_edge((5, 4), 1.0, 0.5)
