"""Fits to light of beams that have a width: with the width they hold the truth, without it they say what is amiss."""

import numpy as np
import pytest

from benchmarks import own_data
from mcml_sim import Setting
from profilefit.measured.data import Measured
from profilefit.measured.fitting import fitted
from profilefit.measured.identifiability import beam_width, identifiability
from profilefit.measured.instrument import PENCIL, Gaussian, Instrument
from profilefit.measured.model import Model, exact_light, u_of
from profilefit.measured.problem import FitSpec

LIGHT = exact_light(Setting())
ALPHA, MFP = 0.93817, 0.5  # A = .5
TRUTH = {"alpha": ALPHA, "l": MFP, "scale": 1.0}
EDGES = np.arange(0.0, 10.01, 0.25)


def rings(instrument, noise=0.002, seed=1, nearest=0.0, alpha=ALPHA, mfp=MFP, edges=EDGES) -> Measured:
    edges = edges[edges >= nearest]
    inner, outer = edges[:-1], edges[1:]
    point = np.array([[u_of(alpha), np.log(mfp), 0.0]])
    value = Model(LIGHT, instrument).predicted(point, inner, outer)[0, :-1]
    drawn = value * (1.0 + noise * np.random.default_rng(seed).standard_normal(value.size))
    known = np.full(value.size, np.inf)
    return Measured("made up", "", inner, outer, drawn, noise * value, known, "as given", "mm")


def fit(data, instrument=PENCIL, held=None):
    return fitted(data, FitSpec(LIGHT, held or {}, instrument=instrument))


@pytest.mark.parametrize("nearest", [0.0, 2.0])
def test_with_its_beam_a_fit_of_any_scale_holds_the_truth(nearest):
    """A Gaussian beam of .5 mm and rings with .2 % noise, of a medium with A .5 and l .5 mm."""
    instrument = Instrument(Gaussian(0.5))
    found = fit(rings(instrument, nearest=nearest), instrument)
    assert found.minimum.converged
    assert not found.misfit.detected
    assert found.rivals == ()
    for one in identifiability(found).intervals:
        assert one.low < TRUTH[one.name] < one.high, one.name


def test_without_its_beam_the_data_say_that_it_has_a_width():
    found = fit(rings(Instrument(Gaussian(0.5))), held={"scale": 1.0})
    off = abs(found.plain.values["mu_a"] - (1 - ALPHA) / MFP) / found.plain.errors(found.plain.total_covariance)["mu_a"]
    assert off > 10, "negative control: by the data's errors alone the answer is wrong"
    width = beam_width(found)
    assert width.noticed
    assert width.w == pytest.approx(0.5, rel=0.1)


def test_a_pencil_beam_is_not_accused_and_the_width_that_would_matter_does():
    found = fit(rings(PENCIL), held={"scale": 1.0})
    width = beam_width(found)
    assert not width.noticed
    assert width.telling is not None
    there = fit(rings(PENCIL), Instrument(Gaussian(width.telling)), held={"scale": 1.0})
    moved = (
        abs(there.values[width.moved] - found.values[width.moved]) / found.errors(found.total_covariance)[width.moved]
    )
    assert moved == pytest.approx(1.0, abs=0.3)
    assert beam_width(there) is None, "it has a beam"


def test_a_misfit_of_a_pencil_beam_is_not_taken_for_a_width():
    """Light of tissue under a pencil beam, with a wave of .4 % along ln r and noise of .1 %."""
    found = fitted(own_data.wavy(), FitSpec(exact_light(own_data.SMOOTH.setting), own_data.SCALE))
    assert found.misfit.detected
    assert not beam_width(found).noticed
    assert beam_width(found.plain).chance < 1e-8, "negative control: by the data's errors alone"


@pytest.mark.slow
def test_pencil_beams_are_accused_as_rarely_as_stated():
    """Forty media: a chance of 5 % each, exceeded by more than seven with a chance of 1e-3."""
    source, accused = np.random.default_rng(7), 0
    for seed in range(40):
        alpha, mfp = 1.0 - np.exp(source.uniform(np.log(0.003), np.log(0.4))), np.exp(source.uniform(-1.5, 0.7))
        found = fit(rings(PENCIL, 0.01, seed, alpha=alpha, mfp=mfp), held={"scale": 1.0})
        width = beam_width(found)
        accused += width is not None and width.noticed
    assert accused <= 7
