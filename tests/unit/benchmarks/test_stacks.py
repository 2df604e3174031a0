"""Stacks that laws are judged by, and the table of the paper's misprints."""

from dataclasses import replace

import numpy as np

from benchmarks import stacks, zhao
from profilefit.scenes.layers.law import single_scattering


def test_random_stacks_lie_where_it_is_said():
    media = [stacks.random_stack(number) for number in range(200)]
    assert stacks.random_stack(3) == media[3]
    assert {len(medium.layers) for medium in media} == {2, 3, 4}
    layers = [layer for medium in media for layer in medium.layers]
    alpha, thick = np.array([(one.alpha, one.thickness / one.mfp) for one in layers]).T
    assert 0.3 <= alpha.min() < 0.4 < 0.99 < alpha.max() <= 0.999
    finite = thick[np.isfinite(thick)]
    assert 0.1 <= finite.min() < 0.2 < 2.5 < finite.max() <= 3.0
    assert all(1.0 <= layer.n <= 1.5 for layer in layers)
    assert sum(len(stacks.stacks(channel)) for channel in range(3)) == 12


def test_misprints_cost_and_corrections_converge():
    """Error of Zhao et al.'s sum with 4 and 16 samples over twelve stacks, g = 0: as printed, each misprint, none."""
    media = [medium for channel in range(3) for medium in stacks.stacks(channel).values()]
    exact = [float(single_scattering(medium, 0.7, 0.5, 1.0)) for medium in media]

    def error(corrections, samples):
        sums = [
            zhao.single_sum(medium, 0.7, 0.5, 1.0, samples, 6.0 * medium.layers[0].mfp, corrections) for medium in media
        ]
        return float(np.sqrt(np.mean((np.array(sums) / exact - 1) ** 2)))

    corrected = error(zhao.CORRECTED, 16)
    assert corrected < 0.1 < error(zhao.CORRECTED, 4)
    assert error(zhao.PRINTED, 16) > 10
    misprints = [name for name in zhao.Corrections.switches() if name != "dipole_sign"]
    errors = [error(replace(zhao.CORRECTED, **{name: False}), 16) for name in misprints]
    assert sum(one > 2 * corrected for one in errors) == 4  # all but those of the phase function, unseen at g = 0
