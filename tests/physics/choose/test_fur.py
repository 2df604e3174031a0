"""How many layers fur needs: enough for other rays, not many more than the least, fewer of a dearer layer."""

import copy

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes.fur.scene import read
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, error_of, trial
from profilefit.studies.choose import fur
from profilefit.studies.choose.fur import FurNeed, RandomFur, cheapest, fur_need


def request(**changes):
    """With other values: fur_radius=..."""
    told = {"scene": "fur", "fur": {"density": 0.64, "radius": 0.5, "length": 10.0}, "technique": {}}
    for name, value in changes.items():
        table, _, key = name.partition("_")
        told[table][key] = value
    return read("fur.toml", copy.deepcopy(told))


@pytest.fixture
def few(monkeypatch):
    """A tenth of the rays, and an eighth of the layers."""
    monkeypatch.setattr(fur, "RAYS", 200)
    monkeypatch.setattr(fur, "PATCHES", 12)
    monkeypatch.setattr(fur, "MOST", 32)


@pytest.mark.parametrize(("degrees", "tolerance", "way"), [(45.0, 0.05, SWEPT), (60.0, 0.08, SWEPT_TWO)])
def test_layers_hold_for_other_rays_and_few_less_would_not(degrees, tolerance, way):
    looked = RandomFur(0.16, 1.0, 20.0, float(np.radians(degrees)))
    layers = looked.least_layers(way, tolerance)
    others = [
        trial(random_patch(0.16, 1.0, 20.0, looked.side, seed), looked.theta, 2500, seed) for seed in range(9000, 9008)
    ]
    assert error_of(others, way, layers) <= tolerance
    assert error_of(others, way, int(0.7 * layers)) > tolerance


def test_what_is_held_to_a_tolerance_is_above_the_mean():
    """By its noise; and of more than any is there are no layers."""
    looked = RandomFur(0.16, 1.0, 20.0, float(np.radians(45.0)))
    goal = 0.05**2
    found = looked.largest(SWEPT, 11, goal)
    mean = np.mean([one.error(SWEPT, 11) ** 2 for one in looked._made])
    assert mean < found < 1.5 * mean
    assert looked.least_layers(QUADRATIC, 0.05) is None


def test_a_patch_is_wider_than_a_rays_way():
    for degrees, length in ((0.0, 20.0), (60.0, 20.0), (85.0, 40.0)):
        looked = RandomFur(0.16, 1.0, length, float(np.radians(degrees)))
        assert looked.side >= 1.2 * length * np.tan(looked.theta) or 0.16 * looked.side**2 >= fur.MOST_STRANDS - 1
        assert 0.16 * looked.side**2 >= fur.STRANDS - 1e-9


@pytest.mark.slow
def test_more_layers_at_an_angle_and_of_longer_strands(few):
    """Head-on the nearest strand is the highest: one slab is enough."""
    of = {"technique_tolerance": 0.08}
    need = fur_need(request(**of), (0, 45, 75))
    swept = [need.layers[angle][SWEPT.name] for angle in (0, 45, 75)]
    assert swept[0] == 1
    assert swept == sorted(swept)
    assert need.layers[75][LINEAR.name] is None
    assert need.layers[45][SWEPT_TWO.name] < swept[1]
    shorter = fur_need(request(fur_length=5.0, **of), (75,))
    assert shorter.layers[75][SWEPT.name] < swept[2]
    assert need.way in (SWEPT, SWEPT_TWO)
    assert need.count == need.layers[75][need.way.name]
    assert fur_need(request(**of), (75,)).layers[75] == need.layers[75]


def test_the_cheapest_is_by_the_cost_of_a_layer(monkeypatch):
    layers = {"linear": 40, "quadratic": None, "fitted": None, "swept": 10, "swept, two strands": 8}
    assert cheapest(layers) == SWEPT
    assert cheapest({**layers, "swept, two strands": 5}) == SWEPT_TWO
    assert cheapest({**layers, "linear": 14}) == LINEAR
    assert cheapest(dict.fromkeys(layers)) is None
    need = FurNeed({75: dict.fromkeys(layers)}, 0.05)
    assert (need.way, need.count) == (None, None)
    monkeypatch.setattr(fur, "COST", {0: 1.0, 1: 1.5, 2: 1.6})
    assert cheapest(layers) == SWEPT_TWO


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"technique_tolerance": 0.005},
            "[technique] tolerance must be at least 0.01 where layers are chosen by rays, got 0.005",
        ),
        (
            {"fur_length": 60.0},
            "[fur] length must be at most 100 times the radius, 50 mm, where layers are chosen by rays, got 60",
        ),
    ],
)
def test_what_rays_do_not_tell(changes, message):
    with pytest.raises(InputError) as found:
        fur_need(request(**changes))
    assert str(found.value) == f"fur.toml: {message}"
