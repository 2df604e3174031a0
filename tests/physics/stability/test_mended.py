"""What the atlas found in our own laws and functions, and what was mended."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting, exact
from profilefit.convert import alpha_of, reflectance_of
from profilefit.errors import InputError
from profilefit.laws.quantile import depth, radius
from profilefit.laws.stack import StackTerms
from profilefit.recipes import catalogue
from profilefit.scenes.layers.law import single_scattering
from profilefit.studies.stability import stacks


def test_a_dark_medium_keeps_the_digits_of_its_reflectance():
    """1 - sqrt(1 - alpha) has none left below 1e-16; A is proportional to alpha there."""
    law = catalogue.albedo_law("rational")
    alpha = np.array([1e-300, 1e-20, 1e-12])
    np.testing.assert_allclose(law.reflectance(alpha) / alpha, law.reflectance(1e-6) / 1e-6, rtol=1e-5)
    single = jax.tree.map(jnp.float32, law).reflectance(jnp.float32(1e-10))
    assert float(single) == pytest.approx(law.reflectance(1e-10), rel=1e-6)


@pytest.mark.slow
def test_the_density_of_hazards_radii_in_single_precision():
    law = catalogue.load("hazard")
    x = np.array([0.0, 1e-9, 1e-5, 3e-3, 0.1, 10.0, 30.0, 1e6, 1e30, np.inf])
    single = jax.tree.map(jnp.float32, law).sampler
    alpha = np.array([[0.0], [0.5], [1.0]])
    exactly = law.sampler.pdf(x, alpha)
    made = np.asarray(single.pdf(jnp.asarray(np.minimum(x, 1e38), jnp.float32), jnp.asarray(alpha, jnp.float32)))
    assert np.all(np.isfinite(exactly) & np.isfinite(made) & (made >= 0))
    seen = exactly > 1e-30
    np.testing.assert_allclose(made[seen], exactly[seen], rtol=3e-4)


@pytest.mark.slow
def test_the_radius_of_quantile_is_inverted_up_to_white():
    law, x = catalogue.load("quantile"), np.geomspace(1e-25, 1e8, 60)
    alpha = np.array([0.0, 0.5, 1 - 1e-9, 1 - 1e-12, 1 - 2.0**-53, 1.0])[:, None]
    with jax.enable_x64(True):
        curve = law.curve(jnp.asarray(alpha))
        back = np.asarray(radius(depth(jnp.asarray(x), curve), curve)[0])
    np.testing.assert_allclose(back, np.broadcast_to(x, back.shape), rtol=1e-13)


@pytest.mark.slow
def test_no_share_is_negative_next_to_the_source():
    law = catalogue.load("hazard", setting=Setting("diffuse", n=1.4))
    share = law.cdf(np.geomspace(1e-18, 1e-14, 50)[None], np.linspace(0, 1, 41)[:, None])
    assert np.min(share) == 0.0  # rounding gave -1e-17


def test_gaussians_have_no_density_at_infinity():
    assert catalogue.load("gaussians:2").sampler.pdf(np.inf, 0.5) == 0.0


def test_the_exact_half_space_at_huge_radii():
    """Products of 1e300 with wave numbers were not finite."""
    for x in (1e120, 1e300, np.finfo(float).max):
        assert exact.profile(x, 0.9) == 0.0
        assert exact.cdf(x, 0.9) == 1.0


@pytest.mark.slow
def test_a_colour_next_to_white_has_an_albedo():
    reflectance = 1.0 - 2.0 ** -np.array([10.0, 24.0, 40.0, 53.0])
    for light in ("searchlight", "diffuse"):
        found = alpha_of(reflectance, light)
        np.testing.assert_allclose(reflectance_of(found, light), reflectance, rtol=0, atol=1.5e-8)


@pytest.mark.parametrize("mfp", [1e-101, 1e101, 0.0])
def test_lengths_without_a_square_are_refused(mfp):
    with pytest.raises(InputError, match=r"mfp must be > 0, from 1e-100 to 1e\+100"):
        catalogue.load("hazard").profile(1.0, 0.5, mfp)
    with pytest.raises(InputError, match=r"mfp must be a mean free path > 0, from 1e-100 to 1e\+100"):
        exact.profile(1.0, 0.5, mfp)


def test_light_that_grazes_a_matched_surface_keeps_its_digits():
    """Its cosine inside was that of 1 - sine^2, which had lost 6e-5 of 1e-6."""
    medium = Medium((Layer(1.0, 0.1, 0.9, 0.0, 1.0), Layer(1.0, 0.1, 0.9, 0.0)))
    into, out = np.array([1e-9, 1e-6, 1e-3]), np.array([1e-9, 1e-6, 0.5])[:, None]
    right = 0.9 / (4.0 * np.pi) * into / (into + out)
    np.testing.assert_allclose(single_scattering(medium, into, out, 0.0), right, rtol=1e-12)


def test_no_radius_of_a_stack_has_a_negative_density():
    """1 - c (1 / c), compiled, was -1e-16: the share of a first layer of no thickness, all that is left far out."""
    law, zero = stacks.end(*stacks.ENDS[0]).law, np.zeros(1000)
    came = np.random.default_rng(1).random(1000)

    def first(of):
        return law.shares(of)[0]

    with jax.enable_x64(True):
        share = jax.jit(first)(StackTerms(*[jnp.asarray(zero)] * 8, jnp.asarray(came)))
        assert np.all(np.asarray(share) == 0.0)
