"""A balance that was put in is found again, and so is a blend."""

import numpy as np
import pytest

from benchmarks.heart_fit import SplitLight, errors, fitted
from profilefit.errors import InputError
from profilefit.scenes.heart import crossover_of


def test_a_balance_is_found_again():
    """Scenes whose light is right at one split only: the constant is that of the split, and its refits say so."""
    random = np.random.default_rng(3)
    sigma = np.geomspace(0.02, 5.0, 24)
    scenes = []
    for _ in range(20):
        texel, pixel = random.uniform(0.2, 0.6), random.uniform(0.1, 0.3)
        right = np.count_nonzero(sigma < crossover_of(texel, pixel, 0.8))
        off = 0.01 * (1.0 + np.abs(np.arange(25) - right))[:, None, None] * np.ones((25, 6, 3))
        ones, none = np.ones((6, 3)), np.zeros((25, 6, 3))
        scenes.append(
            SplitLight(
                ones,
                ones,
                none,
                2.0 + off,
                1.0 + off,
                np.ones((25, 6)),
                ones[:, 0],
                texel,
                pixel,
                sigma,
                0 * ones,
                np.inf,
            )
        )
    best, refits = fitted(errors(scenes))
    assert best.constant == pytest.approx(0.8, rel=0.1)
    assert best.threshold > 1.0  # the screen's far light is wrong everywhere
    assert np.ptp(refits[:, 0]) < 0.2


def test_a_blend_in_hindsight():
    """Truth that is a blend is found; by the angle alone it is not."""
    random = np.random.default_rng(2)
    texture, screen = random.random((2, 50, 3))
    facing, ones = random.random(50), np.ones((50, 3))
    truth = texture + (0.2 + 0.5 * facing)[:, None] * (screen - texture)
    far, atlas = np.stack([screen] * 5), np.stack([texture] * 5)
    one = SplitLight(truth, ones, 0 * far, far, atlas, np.ones((5, 50)), facing, 0.1, 0.1, np.ones(4), 0 * ones, np.inf)
    assert one.rms(one.blended(np.ones(50), facing)) < 1e-12
    assert 0.01 < one.rms(one.blended(np.ones(50))) < one.rms(texture)


def test_the_crossover():
    assert crossover_of(0.4, 0.1, 0.5) == pytest.approx(0.4)
    with pytest.raises(InputError, match=r"texel and pixel must be lengths > 0, got 0\.4 and nan"):
        crossover_of(0.4, np.nan)
