"""Sums of Gaussians of a stack: a sum is found again, light is as near as more of them come, and errors are right.

Errors are those on light of known noise and misfit; weights may be 0; and the quality of a sum.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Layer, Medium
from profilefit.recipes.stack import gaussians
from profilefit.recipes.stack.gaussians import SumLight, fitted, joint, refitted, ring_shares, shared_sum
from tests.fixtures import refused

HEART, BLUE = (
    Medium((Layer(1.4, mu_a, mu_s, 0.0, 0.3), Layer(1.4, below, scattered, 0.0)))
    for mu_a, mu_s, below, scattered in ((0.20, 2.2, 0.80, 1.2), (0.35, 2.6, 1.2, 1.3))
)
MEDIA = tuple(Medium((Layer(1.4, mu_a, 1.0, 0.0, 0.5), Layer(1.4, 0.3, 1.0, 0.0))) for mu_a in (0.02, 0.1))
EDGES = np.geomspace(0.02, 8.0, 61)
VARIANCES = np.array([0.01, 0.3, 6.0])
WEIGHTS = np.array([[0.2, 0.3, 0.5], [0.3, 0.6, 0.1]])
WHOLE = (0.6, 0.3)


def lights_of(variances=VARIANCES, weights=WEIGHTS, noise=0.0, random=None):
    """Light that is a sum; a run's rings have independent noise, and its A is what leaves in all."""
    found, weight = [], np.full(60, 60**-0.5)
    for own, whole in zip(weights, WHOLE, strict=False):
        energy = whole * (ring_shares(EDGES, variances) @ own)
        more = energy * noise * (0.0 if random is None else random.standard_normal(energy.size))
        inside = float(own @ -np.expm1(-0.5 * EDGES[0] ** 2 / variances))
        found.append(SumLight(EDGES, energy + more, weight, whole + more.sum(), np.full(60, noise), inside))
    return found


def constants(found):
    return np.append(found.variances, found.weights)


def off(light, variances, weights):
    """Relative errors of rings."""
    return ring_shares(light.edges, variances) @ weights * light.whole / light.energy - 1.0


def test_a_sum_is_found_again():
    light = lights_of()[0]
    best = fitted([light], 3)
    variances, (weights,) = shared_sum(best.parameters)
    np.testing.assert_allclose(variances, VARIANCES, rtol=1e-4)
    np.testing.assert_allclose(weights, WEIGHTS[0], rtol=1e-4)
    assert fitted([light], 2).cost > 1e4 * best.cost  # two are not three
    for count in (0, 9, True, 2.5):
        refused(f"1 ... 8, got {count!r}", gaussians.shared_gaussians, (HEART,), "diffuse", count)


@pytest.mark.slow
@pytest.mark.parametrize("illumination", ["diffuse", "searchlight"])
def test_more_of_them_are_nearer(illumination):
    (light,), rel = gaussians.lights_of((HEART,), illumination), []
    for count in (2, 4, 6):
        variances, (weights,) = shared_sum(fitted([light], count).parameters)
        assert sum(weights) == pytest.approx(1.0)
        assert np.all(np.diff(variances) > 0)
        rel.append(float(np.mean(np.abs(off(light, variances, weights)))))
    assert rel[0] > 0.4 > rel[1] > 0.1 > rel[2] > 0.02


@pytest.mark.slow
def test_colours_share_their_variances():
    """In one unit of length, though mean free paths differ; each is a little farther from its light than alone."""
    both = gaussians.shared_gaussians((HEART, BLUE), "diffuse", 4)
    pairs = zip(both, (HEART, BLUE), strict=True)
    first, second = (np.array(one.variance) * medium.layers[0].mfp ** 2 for one, medium in pairs)
    np.testing.assert_allclose(first, second, rtol=1e-12)
    for light, one in zip(gaussians.lights_of((HEART, BLUE), "diffuse"), both, strict=True):
        alone = fitted([light], 4).cost
        assert alone < np.sum((light.weight * off(light, first, np.array(one.weight))) ** 2) < 1.5 * alone


def test_many_fixed_ones_are_exact_light():
    """Of two colours at once, and far nearer than six that are fitted."""
    lights = gaussians.lights_of((HEART, BLUE), "diffuse")
    variances, weights = gaussians.dense(lights)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert np.all(weights >= 0)
    assert variances.size < 30
    for light, own in zip(lights, weights, strict=True):
        apart = off(light, variances, own)
        assert np.sqrt(np.mean(apart**2)) < 1e-3
        assert np.abs(apart).max() < 3e-3
    six = joint(lights, 6)
    assert np.sqrt(np.mean(off(lights[0], six.variances, six.weights[0]) ** 2)) > 0.02


# Errors


def test_derivatives_are_those_of_the_formula():
    """The slow twin: the same formula, differentiated by jax, far from the data and beyond all light."""
    lights = lights_of(noise=0.3, random=np.random.default_rng(1))
    found = joint(lights, 2)
    lights = [one._replace(edges=np.append(one.edges[:-1], 1e3)) for one in lights]

    def off(constants):
        level, weights = constants[:2], constants[2:].reshape(2, 2)
        parts = []
        for own, light in zip(weights, lights, strict=True):
            within = 1.0 - jnp.exp(-0.5 * light.edges[:, None] ** 2 / jnp.exp(level))
            parts.append(light.weight * (light.whole * (jnp.diff(within, axis=0) @ own) / light.energy - 1.0))
        return jnp.concatenate(parts)

    def unbounded(parameters):
        logits = jnp.column_stack([jnp.zeros(2), parameters[2:].reshape(2, 1)])
        level = jnp.cumsum(jnp.array([parameters[0], jax.nn.softplus(parameters[1])]))
        return jnp.concatenate([level, jax.nn.softmax(logits, axis=1).ravel()])

    with jax.enable_x64(True):
        at = jnp.concatenate([jnp.log(found.variances), found.weights.ravel()])
        bent = jax.jit(jax.hessian(lambda constants: 0.5 * jnp.sum(off(constants) ** 2)))(at)
        values, jacobian = gaussians._off(found.variances, found.weights, lights)
        np.testing.assert_allclose(values, off(at), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(jacobian, jax.jit(jax.jacfwd(off))(at), rtol=1e-8, atol=1e-12)
        *_, own = gaussians.expanded(found.variances, found.weights, found.slopes, lights)
        np.testing.assert_allclose(own, found.slopes.T @ bent @ found.slopes, rtol=1e-8, atol=1e-12)
        parameters = np.array([-1.0, 0.5, 0.3, -0.7])
        level, weights, slopes = gaussians._of(parameters, 2)
        np.testing.assert_allclose(np.append(level, weights), unbounded(jnp.asarray(parameters)), rtol=1e-12)
        twin = jax.jit(jax.jacfwd(unbounded))(jnp.asarray(parameters))
        np.testing.assert_allclose(slopes, twin, rtol=1e-10, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3], ids=["two, which misfit", "three, which do not"])
def test_the_statistical_error_is_that_of_repeated_runs(count):
    """Over 400 runs a spread is known to 3.5 %; four standard errors, Sidak over nine constants."""
    random, noise = np.random.default_rng(5), 0.01
    lights = lights_of(noise=noise)
    found = joint(lights, count)
    runs = np.array([refitted(found, lights_of(noise=noise, random=random)) for _ in range(400)])
    runs[:, :count] = np.exp(runs[:, :count])
    known = gaussians.errors(found, lights, MEDIA, None)["statistical_error"]
    np.testing.assert_allclose(known, runs.std(axis=0), rtol=0.14)
    # Negative control: the same without the curvature of the residuals, which only a misfit has.
    inverse = np.linalg.inv(found.best.jacobian.T @ found.best.jacobian)
    plain = found.slopes @ inverse @ found.best.jacobian.T * noise / 60**0.5
    plain = np.sqrt(np.sum(plain**2, axis=1)) * np.append(found.variances, np.ones(found.weights.size))
    apart = np.max(np.abs(plain / runs.std(axis=0) - 1.0))
    assert apart > 0.3 if count == 2 else apart < 0.3


def test_a_sum_that_is_the_light_has_no_errors():
    """Nor any error of its rings; one Gaussian fewer has all of them."""
    lights = lights_of()
    found = joint(lights, 3)
    np.testing.assert_allclose(constants(found), np.append(VARIANCES, WEIGHTS), rtol=1e-6)
    known = gaussians.errors(found, lights, MEDIA, lights)
    assert known["statistical_error"] is None
    assert all(np.max(known[f"{name}_error"]) < 1e-6 for name in ("discretisation", "misfit", "jackknife"))
    for light, own in zip(lights, found.weights, strict=True):
        assert max(gaussians.quality(light, found.variances, own).values()) < 1e-6
    worse = joint(lights, 2)
    known = gaussians.errors(worse, lights, MEDIA, lights)
    for name in ("model", "misfit", "jackknife"):
        assert np.all(known[f"{name}_error"] > 3e-3 * constants(worse)), name
    assert np.max(known["discretisation_error"]) < 1e-6
    failed = worse._replace(best=replace(worse.best, result="no convergence"))
    known = gaussians.errors(failed, lights, MEDIA, lights)
    assert [name for name, one in known.items() if one is None] == ["statistical_error"]
    assert all(np.all(np.isnan(one)) for one in known.values() if one is not None)
    # The discretisation error is what other light changes.
    other = gaussians.errors(found, lights, MEDIA, lights_of(VARIANCES * 1.01))["discretisation_error"]
    np.testing.assert_allclose(other[:3], 0.01 * VARIANCES, rtol=0.01)  # of ln v, to first order
    assert np.max(other[3:]) < 1e-6


def test_a_weight_that_would_be_negative_is_held_at_zero():
    """Of light with less than nothing of one variance: it has no errors, and any other weight were worse."""
    lights = lights_of(weights=np.array([[0.2, 0.3, 0.5], [0.54, 0.47, -0.01]]))
    near = 40  # edges up to 1, where there is light
    short = {"edges": EDGES[:near], "energy": lights[1].energy[: near - 1], "noise": np.zeros(near - 1)}
    lights[1] = lights[1]._replace(**short, weight=np.full(near - 1, (near - 1) ** -0.5))
    found = joint(lights, 3)
    assert found.weights[1, 2] == 0.0
    assert not found.free[8]
    assert np.all(found.free[:8])
    assert np.all(np.isclose(found.weights.sum(axis=1), 1.0, atol=1e-12))
    known = gaussians.errors(found, lights, MEDIA, lights)
    assert all(np.isnan(one[8]) and np.all(np.isfinite(one[:8])) for one in known.values() if one is not None)
    for share in (1e-4, 1e-3, 1e-2):
        moved = found.weights[1] * (1.0 - share) + share * np.array([0.0, 0.0, 1.0])
        pairs = zip(lights, (found.weights[0], moved), strict=True)
        worse = [gaussians.quality(light, found.variances, own)["rms"] ** 2 for light, own in pairs]
        assert sum(worse) > found.best.cost
    assert joint(lights_of(), 3).free.all()  # negative control


def test_quality_is_that_of_the_rings_and_of_what_is_inside():
    """Of one Gaussian for another, by hand."""
    (light,) = lights_of(np.array([1.0]), np.array([[1.0]]))
    found = gaussians.quality(light, np.array([1.21]), np.array([1.0]))
    x, y = np.exp(-0.5 * EDGES**2), np.exp(-0.5 * EDGES**2 / 1.21)
    off = np.diff(y) / np.diff(x) - 1.0
    assert found["rel"] == pytest.approx(np.mean(np.abs(off)))
    assert found["rms"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert found["ks"] == pytest.approx(np.max(np.abs(x - y)))
    unknown = light._replace(inside=np.nan)  # as of photons: the sum's own stands for it
    ks = gaussians.quality(unknown, np.array([1.21]), np.array([1.0]))["ks"]
    assert ks == pytest.approx(np.max(np.abs(x - y - x[0] + y[0])))


@pytest.mark.slow
def test_light_that_is_traced():
    """Of layers that scatter forward; the similar stack's sum is another, and no error is one of nodes."""
    forward = Medium(tuple(Layer(1.4, one.mu_a, 10.0 * one.mu_s, 0.9, one.thickness) for one in HEART.layers))
    light, similar = (gaussians.lights_of((medium,), "searchlight")[0] for medium in (forward, HEART))
    assert np.mean(light.noise) < 0.05
    best = fitted([light], 8)
    counts = light.weight > 0
    assert np.mean(np.abs(best.residuals[counts] / light.weight[counts])) < 0.04
    variances, (weights,) = shared_sum(fitted([similar], 8).parameters)
    lost = ring_shares(light.edges, variances) @ weights * similar.whole / light.energy - 1.0
    assert np.mean(np.abs(lost[counts])) > 0.5
    forward = Medium((Layer(1.38, 0.2, 22.0, 0.9, 0.3), Layer(1.38, 0.8, 12.0, 0.9)))
    lights = gaussians.lights_of((forward,), "diffuse")
    found = joint(lights, 4)
    known = gaussians.errors(found, lights, (forward,), None)
    assert known["discretisation_error"] is None
    for name in ("statistical", "model", "misfit", "jackknife"):
        assert np.all(known[f"{name}_error"] > 0), name
    # Two million photons know better than four Gaussians can follow.
    assert np.all(known["statistical_error"] < 0.5 * known["model_error"])
