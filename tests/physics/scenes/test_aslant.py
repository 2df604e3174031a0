"""A plane that is seen aslant is the same plane: samples stand for the area that they show."""

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.scenes.stage.exact_law import ExactLaw
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from tests.physics.scenes import edges

pytestmark = pytest.mark.slow

ALPHA, MFP = 0.8, 8.0
A = exact.reflectance(ALPHA, edges.DIFFUSE)
SIZE, MIDDLE = (64, 128), (slice(48, 80), slice(24, 40))
BOUND = 0.006  # of A: at 85 degrees a pixel is 1.4 mfp, and is lit in its middle or not; standard errors are 0.001


@pytest.fixture(scope="module")
def exact_law():
    return ExactLaw((ALPHA,))


def bias(context, law, degrees, depth, area=True, seeds=4):
    """Largest mean error of the step edge over columns of 32 pixels, seeds and 256 samples, as a share of A."""
    buffers, distance = edges.aslant(SIZE, 1.0, A, degrees, depth)
    truth = edges.answer(distance[MIDDLE] / MFP, ALPHA)
    with Stage(context, SIZE, shadow_side=16) as stage:
        stage.upload(buffers)
        runs = [stage.scatter(law, MFP, Sampling(256, area=area, seed=seed))[MIDDLE][..., 0] for seed in range(seeds)]
    return np.abs(np.mean(np.array(runs) / A - truth, axis=(0, 1))).max()


@pytest.mark.parametrize("depth", [None, 150.0])
@pytest.mark.parametrize("degrees", [60.0, 75.0, 80.0, 85.0])
def test_a_plane_aslant_is_the_same_plane(context, alter, exact_law, degrees, depth):
    """In parallel and in perspective; not where samples do not stand for their area, or not for all of it."""
    assert bias(context, exact_law, degrees, depth) < BOUND
    if degrees < 80.0:
        assert bias(context, exact_law, degrees, depth, area=False, seeds=1) > 2 * BOUND
    else:
        alter("LEAST_COSINE = 0.05;", "LEAST_COSINE = 0.25;")
        assert bias(context, exact_law, degrees, depth, seeds=1) > 2 * BOUND
