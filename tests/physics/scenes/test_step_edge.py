"""The step edge on the GPU: the exact profile gives the exact integral, also aslant, and ours its noise."""

import numpy as np
import pytest

import profilefit
from benchmarks.planes import step_edge
from mcml_sim import Setting, exact
from profilefit.scenes.stage.exact_law import ExactLaw
from profilefit.scenes.stage.pattern import KINDS, Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.step_edge import step_response
from tests.physics.scenes import edges

ALPHA = 0.8
A = exact.reflectance(ALPHA, edges.DIFFUSE)


@pytest.fixture(scope="module")
def exact_law():
    return ExactLaw((ALPHA,))


@pytest.fixture(scope="module")
def hazard():
    return profilefit.load("hazard", setting=edges.DIFFUSE)


@pytest.fixture
def small(context):
    """16 x 128 pixels: enough for paths within a pixel."""
    with Stage(context, (16, 128), shadow_side=16) as stage:
        yield stage


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "channels"), [("importance", "longest"), ("importance blue", "mixture")])
def test_step_edge_is_the_exact_integral(stage, exact_law, sidak, kind, channels):
    """With the exact profile; all columns within 4 mfp, mean over rows and seeds within its standard error."""
    stage.upload(step_edge((128, 128), 1.0, A))
    runs = [
        stage.scatter(exact_law, 5.0, Sampling(64, kind, channels, seed=seed))[32:96, 44:84] / A for seed in range(8)
    ]
    column = np.mean(runs, axis=1)[..., 0]  # blue noise makes rows depend on each other, not seeds
    x = (np.arange(44, 84) + 0.5 - 64) / 5.0
    error = column.std(axis=0, ddof=1) / np.sqrt(8) + 2e-4  # and what the screen cuts off, beyond 12 mfp
    z = (column.mean(axis=0) - edges.answer(x, ALPHA)) / error
    assert np.abs(z).max() < 1.6 * sidak(x.size)  # t with 7 degrees of freedom: 5.4 where a normal deviate has 3.3
    off = (column.mean(axis=0) - edges.answer(x, ALPHA - 0.1)) / error
    assert np.abs(off).max() > 2 * 1.6 * sidak(x.size)


def gathered(context, law, alpha, size, seeds, kind="importance blue"):
    """L / A within 4 mfp of the edge, (seeds, 32 rows, columns), by 64 samples, and the exact answer (columns,)."""
    mfp, middle = 5.0, size[0] // 2
    columns = slice(middle - 20, middle + 20)
    with Stage(context, size, shadow_side=16) as stage:
        stage.upload(step_edge(size, 1.0, 1.0))
        runs = [stage.scatter(law, mfp, Sampling(64, kind, seed=seed), alpha) for seed in range(seeds)]
    x = (np.arange(-20, 20) + 0.5) / mfp
    rows = slice(size[1] // 2 - 16, size[1] // 2 + 16)
    return np.array(runs)[:, rows, columns, 0], edges.answer(x, alpha)


def rmse(light, truth):
    return np.sqrt(np.mean((light - truth) ** 2))


# White-ish light goes far: the screen must hold it.
EDGES = [(0.8, (128, 96), 8), pytest.param(0.95, (512, 512), 32, marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "size", "seeds"), EDGES)
def test_our_law_is_as_good_as_the_exact_quantile(context, hazard, alpha, size, seeds):
    """The same points: noise at most 1.1 times as large, and a bias of at most 0.3 % of A; uniform radii have more."""
    exact_light, truth = gathered(context, ExactLaw((alpha,)), alpha, size, seeds)
    ours, _ = gathered(context, hazard, alpha, size, seeds)
    floor = rmse(exact_light, truth)
    assert rmse(ours, truth) < 1.1 * floor
    # Points in common take most of the noise away: what differs is the laws.
    assert np.abs(np.mean(ours - exact_light, axis=(0, 1))).max() < 0.003
    assert np.abs(np.mean(ours - truth, axis=(0, 1))).max() < 0.003
    uniform, _ = gathered(context, ExactLaw((alpha,)), alpha, size, 2, "uniform")
    assert rmse(uniform, truth) > 1.1 * floor
    other = profilefit.load("hazard", setting=Setting())
    searchlight, _ = gathered(context, other, alpha, size, 2)
    assert np.abs(np.mean(searchlight - exact_light[:2], axis=(0, 1))).max() > 0.003


def at_the_edge(small, law, mfp, kind):
    """Mean of L / A half a pixel on the dark side, over 128 rows and eight seeds, and its standard error."""
    runs = [small.scatter(law, mfp, Sampling(64, kind, seed=seed), ALPHA)[:, 7, 0] for seed in range(8)]
    means = np.mean(runs, axis=1, dtype=float)
    return means.mean(), means.std(ddof=1) / np.sqrt(8)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_short_paths_gather_until_nothing_leaves_a_pixel(small, exact_law, kind):
    """Right from a fifth of a pixel, where Lambert would be off by 0.02 of A, at 0.6 pixels by 0.14."""
    small.upload(step_edge((16, 128), 1.0, 1.0))
    cut = 0.0025 if kind == "uniform" else 0.0  # of its radii, which end at 99.5 % of the energy; the dark half of that
    for mfp in (0.2, 0.3, 0.6):
        truth = step_response(-0.5 / mfp, ALPHA, setting=edges.DIFFUSE)
        mean, error = at_the_edge(small, exact_law, mfp, kind)
        assert abs(mean - truth) < 5.4 * error + cut, mfp  # t with 7 degrees of freedom, at a chance of 1e-3
        assert truth > 0.02 > 10 * error


@pytest.mark.slow
def test_short_paths_fade_to_lambert_without_a_seam(small, exact_law):
    """Between a twentieth and a tenth of a pixel, never more than 0.003 of A off."""
    edge = step_edge((16, 128), 1.0, 1.0)
    small.upload(edge)
    for mfp in (0.001, 0.02, 0.05):
        np.testing.assert_array_equal(small.scatter(exact_law, mfp, Sampling(64), ALPHA), edge.irradiance)
        assert step_response(-0.5 / mfp, ALPHA, setting=edges.DIFFUSE) < 0.001
    lengths = np.linspace(0.05, 0.11, 12)
    light = np.array([at_the_edge(small, exact_law, mfp, "importance")[0] for mfp in lengths])
    truth = step_response(-0.5 / lengths, ALPHA, setting=edges.DIFFUSE)
    assert np.all((light >= 0) & (np.abs(light - truth) < 0.003))
    assert np.all((np.diff(light) > 0) & (np.diff(light) < 0.006))


LONG = 8.0  # mean free path [mm]
ASLANT, MIDDLE = (64, 128), (slice(48, 80), slice(24, 40))
BOUND = 0.006  # of A: at 85 degrees a pixel is 1.4 mfp, and is lit in its middle or not; standard errors are 0.001


def bias(context, law, degrees, depth, area=True, seeds=4):
    """Largest mean error of the step edge over columns of 32 pixels, seeds and 256 samples, as a share of A."""
    buffers, distance = edges.aslant(ASLANT, 1.0, A, degrees, depth)
    truth = edges.answer(distance[MIDDLE] / LONG, ALPHA)
    with Stage(context, ASLANT, shadow_side=16) as stage:
        stage.upload(buffers)
        runs = [stage.scatter(law, LONG, Sampling(256, area=area, seed=seed))[MIDDLE][..., 0] for seed in range(seeds)]
    return np.abs(np.mean(np.array(runs) / A - truth, axis=(0, 1))).max()


@pytest.mark.slow
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
