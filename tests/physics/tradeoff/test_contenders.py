"""The forms that are timed are the laws that are judged."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from mcml_sim import exact
from profilefit.errors import InputError
from profilefit.fitting.quality import profile_quality
from profilefit.studies.tradeoff import contenders, laws
from profilefit.studies.tradeoff.contenders import LawSpec, table_contender


@pytest.mark.slow
def test_fast_forms_are_the_laws():
    """In float32, as they are timed."""
    alpha = jnp.array([[0.1], [0.8], [0.99]])
    x, xi = jnp.geomspace(0.01, 5.0, 50), jnp.linspace(0.01, 0.99, 50)
    law = profilefit.load("burley", "published")
    for contender, sampler in zip(contenders.with_samplers(contenders.YARDSTICK, law), ("exact", "xie"), strict=True):
        profile, drawn = jax.jit(lambda c=contender: (c.profile(x, alpha), c.sample(xi, alpha)))()
        np.testing.assert_allclose(profile, law.scaled_profile(x, alpha), rtol=1e-5)
        np.testing.assert_allclose(drawn, law.samplers[sampler].scaled_sample(xi, alpha), rtol=2e-5, atol=1e-6)
        assert type(contender.judged) is type(law.samplers[sampler])
    (quantile,) = contenders.with_samplers("quantile", profilefit.load("quantile"))
    drawn, profile = jax.jit(lambda: quantile.both(xi, alpha))()
    np.testing.assert_allclose(drawn, jax.jit(lambda: quantile.sample(xi, alpha))(), rtol=1e-6)
    np.testing.assert_allclose(profile, jax.jit(lambda: quantile.profile(drawn, alpha))(), rtol=1e-5)


def test_fast_form_in_diffuse_mean_free_paths():
    law = profilefit.load("burley_diffuse_mfp", "published")
    (fast,) = contenders.with_samplers("own", law)
    r = np.geomspace(0.01, 5.0, 9)
    np.testing.assert_allclose(fast.law.profile(r, 0.8), law.profile(r, 0.8), rtol=1e-12)
    assert fast.constants == (3, 0)


def test_fast_pdf_is_that_of_the_law():
    law = profilefit.load("burley", "published")
    fast = next(contenders.with_samplers(contenders.YARDSTICK, law))
    r = np.geomspace(0.01, 5.0, 9)
    np.testing.assert_allclose(fast.sampler.pdf(r, 0.8), law.sampler.pdf(r, 0.8), rtol=1e-12)


def test_what_cannot_be_had_is_left_out_by_name():
    specs = (LawSpec(contenders.YARDSTICK, "burley", "published"), LawSpec("absent", "gaussians", "no-such-set"))
    found, left_out = contenders.contenders(specs=specs)
    assert [one.name for one in found] == [contenders.YARDSTICK, f"{contenders.YARDSTICK}, Xie's sampler"]
    assert len(left_out) == 1
    assert left_out[0].startswith("absent: constants must be one of")
    with pytest.raises(InputError, match="laws must have normalized diffusion among them"):
        contenders.contenders(specs=specs[1:])


@pytest.mark.slow
def test_table_is_the_exact_profile_to_rounding():
    table = table_contender(laws.MATERIAL)
    x = np.geomspace(0.01, 10.0, 40)
    truth = exact.profile(x, laws.MATERIAL)
    looked_up = table.profile(jnp.asarray(x, jnp.float32), jnp.float32(0.0))
    np.testing.assert_allclose(looked_up, truth, rtol=1e-5)
    np.testing.assert_allclose(table.law.profile(x, laws.MATERIAL), truth, rtol=1e-5)
    np.testing.assert_allclose(table.law.cdf(x, laws.MATERIAL), exact.cdf(x, laws.MATERIAL), rtol=1e-5)
    assert np.max(np.abs(looked_up / truth - 1.0)) > 1e-9  # in float32 it is
    assert set(table.parts) == {"profile"}
    assert profile_quality(table.law, laws.judged_albedos(2)).rel.max() < 1e-5
