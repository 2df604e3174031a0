"""The exact half space inside jax: traced, mapped, and differentiated against central differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from tests.fixtures import refused

# The last ones are out of range.
ALPHAS = np.array([[0.0], [0.05], [0.8], [0.999], [1.0], [1.1]])
R = np.array([0.0, 1e-3, 0.02, 0.7, 6.0, 15.0, np.inf, -1.0])
XI = np.array([0.0, 1e-3, 0.02, 0.4, 0.9, 0.99, 1.0, 1.1])
MFP = 1.3
NAMES = ("reflectance", "decay_rate", "profile", "cdf", "quantile")
INSIDE = np.s_[1:-2, 1:-2]  # away from the ends of both
STEP = 1e-5

pytestmark = pytest.mark.usefixtures("x64")


def everything(alpha, r, xi):
    """All that is asked of one point with its slopes in (alpha, r or xi, mfp), which compile faster together."""
    answers = {f.__name__: jax.value_and_grad(f)(alpha) for f in (exact.reflectance, exact.decay_rate)}
    for function, x in ((exact.profile, r), (exact.cdf, r), (exact.quantile, xi)):
        call = jax.value_and_grad(lambda a, x, mfp, f=function: f(x, a, mfp), (0, 1, 2))
        answers[function.__name__] = call(alpha, x, MFP)
    return answers


@pytest.fixture(scope="module")
def table():
    """`everything` at each of ALPHAS and each of R or XI."""
    with jax.enable_x64(True):
        points = np.broadcast_arrays(ALPHAS, R, XI)
        found = jax.jit(jax.vmap(everything))(*(jnp.asarray(values.ravel()) for values in points))
        return jax.tree.map(lambda leaf: np.asarray(leaf).reshape(points[0].shape), found)


def difference(function, x, step):
    """Fourth order in the step."""
    far, near = (function(x + h) - function(x - h) for h in (2 * step, step))
    return (8 * near - far) / (12 * step)


def by_name(alphas, at):
    """Numpy's answers by NAMES, at these albedos and a slice of the radii or shares, (5, alphas, radii)."""
    totals = exact.reflectance(alphas), exact.decay_rate(alphas)
    by_radius = exact.profile(R[at], alphas, MFP), exact.cdf(R[at], alphas, MFP), exact.quantile(XI[at], alphas, MFP)
    return np.stack(np.broadcast_arrays(*totals, *by_radius))


@pytest.mark.slow
def test_mapped_answers_are_those_of_numpy(table):
    for name, values in zip(NAMES, by_name(ALPHAS[:-1], np.s_[:-1]), strict=True):
        np.testing.assert_allclose(table[name][0][:-1, :-1], values, rtol=1e-11, err_msg=name)
    # What is out of range is nan where it may be traced; no radii are traced too.
    for name in NAMES[2:]:
        assert np.isnan(table[name][0][-1]).all()
        assert np.isnan(table[name][0][:, -1]).all()
    for name in NAMES[:2]:
        assert np.isnan(table[name][0]).all(axis=1).tolist() == [False] * 5 + [True]
    assert exact.profile(jnp.zeros(0), 0.5).shape == exact.reflectance(jnp.zeros((0, 2))).shape[:1] == (0,)


@pytest.mark.slow
def test_slopes_in_albedo_and_in_radius_and_share_are_central_differences(table):
    alphas = ALPHAS[1:-2]
    differences = difference(lambda a: by_name(a, np.s_[1:-2]), alphas, 1e-3 * alphas * (1 - alphas))
    for name, along in zip(NAMES, differences, strict=True):
        slope = table[name][1] if name in NAMES[:2] else table[name][1][0]
        np.testing.assert_allclose(slope[INSIDE], along, rtol=1e-7, atol=1e-9, err_msg=name)
    for name, x, room in (("profile", R, R), ("cdf", R, R), ("quantile", XI, XI * (1 - XI))):
        function, inner = getattr(exact, name), np.s_[1:-2]
        along = difference(lambda v, f=function: f(v, ALPHAS[1:-2], MFP), x[inner], 1e-4 * room[inner])
        np.testing.assert_allclose(table[name][1][1][INSIDE], along, rtol=1e-8, atol=1e-10, err_msg=name)
    # Slopes in mfp are those of a scale: R_d(r; l) = R_d(r / l; 1) / l^2, and the like.
    profile, cdf, quantile = (
        [table[n][0][INSIDE], *(s[INSIDE] for s in table[n][1])] for n in ("profile", "cdf", "quantile")
    )
    r = R[1:-2]
    np.testing.assert_allclose(cdf[3], -r / MFP * cdf[2], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(quantile[3], quantile[0] / MFP, rtol=1e-12)
    np.testing.assert_allclose(profile[3], -(2 * profile[0] + r * profile[2]) / MFP, rtol=1e-9)


@pytest.mark.slow
def test_slopes_at_the_ends(table):
    """Finite where the law is smooth, infinite where it is not: 1 - A ends in a root, and the cdf divides by A."""
    black, conservative, r = table["profile"][1][0][0], table["profile"][1][0][4], np.s_[1:-2]
    assert table["reflectance"][1][0, 0] == pytest.approx(exact.reflectance(1e-7) / 1e-7, rel=1e-5)
    np.testing.assert_allclose(black[r], exact.profile(R[r], 1e-9, MFP) / 1e-9, rtol=1e-6)
    below = difference(lambda a: exact.profile(R[3], a, MFP), 1 - 2 * STEP, STEP)
    assert conservative[3] == pytest.approx(below, rel=3e-2)  # the next term is of order sqrt(STEP)
    assert np.isfinite([table[name][1][0][0, :-1] for name in ("cdf", "quantile")]).all()
    assert table["reflectance"][1][4, 0] == np.inf
    assert table["decay_rate"][1][4, 0] == -np.inf
    assert np.all(table["cdf"][1][0][4, r] == -np.inf)
    assert np.all(table["quantile"][1][0][4, r] == np.inf)
    # And at the ends of radius and share: 2 pi r R_d is alpha/2 at the source; at infinity nothing is left.
    ratio = exact.reflectance(0.8) / 0.8
    profile, cdf, quantile = (table[name][1][1][2] for name in ("profile", "cdf", "quantile"))
    assert cdf[0] == pytest.approx(0.5 / (ratio * MFP), rel=1e-4)  # r ln r: 1e-5 at 1e-6 mfp
    assert quantile[0] == pytest.approx(2 * ratio * MFP, rel=1e-4)
    assert profile[-2] == cdf[-2] == quantile[-2] == 0


@pytest.mark.parametrize("illumination", ["searchlight", pytest.param("diffuse", marks=pytest.mark.slow)])
def test_the_slope_at_one_point_is_a_central_difference(illumination):
    setting = Setting(illumination)
    found = jax.grad(lambda a: exact.profile(0.7, a, setting=setting))(0.8)
    assert found == pytest.approx(difference(lambda a: exact.profile(0.7, a, setting=setting), 0.8, 1e-4), rel=1e-8)


@pytest.mark.slow
def test_second_derivatives():
    """In radius and albedo at once, forward over forward; rounding leaves 1e-7 of the differences."""
    slope = lambda f: lambda t: jax.jvp(f, (t,), (1.0,))[1]  # noqa: E731
    along = lambda t: exact.profile(0.7 + t, 0.8 + t)  # noqa: E731
    near, far = (along(h) - 2 * along(0.0) + along(-h) for h in (1e-3, 2e-3))
    assert jax.jit(slope(slope(along)))(0.0) == pytest.approx((16 * near - far) / 12e-6, rel=1e-6)


def test_numbers_inside_a_jitted_function_stay_numbers():
    """They are worked out while it is traced, and no tracer is left behind in what is kept."""
    found = jax.jit(lambda x: x + exact.profile(0.7, 0.41) + exact.reflectance(0.41))(0.0)
    assert found == pytest.approx(exact.profile(0.7, 0.41) + exact.reflectance(0.41), rel=1e-15)


def test_single_precision_is_refused():
    double = jnp.ones(2)
    within = r"must be a float64 array within jax\.enable_x64\(True\), got "
    refused(f"^r {within}float32$", exact.profile, jnp.ones(2, jnp.float32), 0.5)
    with jax.enable_x64(False):
        for call in (exact.reflectance, exact.decay_rate, lambda a: exact.quantile(0.5, a)):
            refused(f"^alpha {within}float32 outside of it$", call, jnp.asarray(0.5))
        refused(f"^mfp {within}float64 outside of it$", exact.cdf, 1.0, 0.5, double)
