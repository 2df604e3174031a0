"""Texts on the GPU give the numbers of the float64 laws, in any shape and number; what does not compile says why."""

import re

import moderngl
import numpy as np
import pytest

import profilefit
from profilefit.errors import ShaderError
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.shader import emit, export
from profilefit.shader.check.law_cost import costs
from profilefit.shader.check.shader_law import ROWS, WIDTH, ShaderLaw, ShaderMap, in_half, no_half

BURLEY = profilefit.load("burley", "published")
RATIONAL = catalogue.albedo_law("rational")
FLOAT32 = 5e-6  # some ten operations, and an exponential of up to ten


def test_all_four_functions_are_the_laws(context):
    r, alpha, mfp = np.geomspace(0.01, 5.0, 7)[:, None], np.array([0.1, 0.6, 0.95]), 2.0
    xi = np.linspace(0.05, 0.95, 7)[:, None]
    found = ShaderLaw(context, BURLEY).values(r, xi, alpha, mfp)
    assert found.profile.shape == (7, 3)
    np.testing.assert_allclose(found.profile, BURLEY.profile(r, alpha, mfp), rtol=FLOAT32)
    np.testing.assert_allclose(found.cdf, BURLEY.cdf(r, alpha, mfp), atol=FLOAT32)
    np.testing.assert_allclose(found.sample, BURLEY.sampler.sample(xi, alpha, mfp), rtol=FLOAT32)
    np.testing.assert_allclose(found.pdf, BURLEY.sampler.pdf(r, alpha, mfp), rtol=FLOAT32)


def test_a_map_goes_both_ways(context):
    there, values = ShaderMap(context, RATIONAL), np.linspace(0.0, 1.0, 33)
    np.testing.assert_allclose(there.alpha(values), RATIONAL.alpha(values), atol=FLOAT32)
    np.testing.assert_allclose(there.reflectance(values[:-1]), RATIONAL.reflectance(values[:-1]), atol=FLOAT32)


@pytest.mark.parametrize(("n", "most"), [(1.0, 1.0), (1.4, 0.923188)])
def test_a_colour_that_no_surface_lets_out_is_the_brightest(context, n, most):
    """The largest A is a constant of the source, stated in the head; on the GPU, too, a larger one has its albedo."""
    named = find("hazard-diffuse", catalogue.fits_folder(), n=n)
    text = export(named, catalogue.fits_folder())
    assert f"\n// hazard_MAX_REFLECTANCE = {most:.3g}: no half space of this n reflects more\n" in text
    assert float(re.search(r"const float hazard_MAX_REFLECTANCE = (\S+);", text)[1]) == pytest.approx(most, abs=1e-6)
    colour = np.array([-1.0, 0.0, 0.3, 0.8, 0.9, most, 0.95, 1.0, 2.0])
    there = ShaderMap(context, named.law.albedo).alpha(colour)
    np.testing.assert_allclose(there, named.law.albedo.alpha(np.clip(colour, 0.0, most)), atol=FLOAT32)
    assert np.all(there[colour >= most] == 1.0)


def test_more_arguments_than_a_texture_holds(context):
    """Each in its own place, the last alone in a row."""
    alpha = np.linspace(0.1, 0.9, WIDTH * ROWS + 1)
    found = ShaderLaw(context, BURLEY).cdf(0.7, alpha)
    picked = np.array([0, WIDTH - 1, WIDTH, alpha.size - 2, alpha.size - 1])
    np.testing.assert_allclose(found[picked], BURLEY.cdf(0.7, alpha[picked]), atol=FLOAT32)


def test_what_was_bound_is_bound_again_and_nothing_is_left_behind(context):
    """moderngl keeps in `objects` what is dropped without a release; a texture is dropped so here, to see that."""
    own = context.simple_framebuffer((4, 4), components=4)
    own.use()
    own.viewport = (1, 0, 2, 3)
    context.gc_mode = "context_gc"
    try:
        assert costs(context, [], BURLEY)
        shader = ShaderLaw(context, BURLEY)
        before = shader.cdf(0.7, 0.5)
        del shader
        own_drops = _unreleased(context)
        context.texture((1, 1), 4)
        assert (len(own_drops), len(_unreleased(context))) == (0, 1)
    finally:
        context.gc_mode = None
    assert context.viewport == (1, 0, 2, 3)
    context.clear(0.75, 0.0, 0.0, 1.0)
    assert set(own.read(components=1)) == {191}
    assert ShaderLaw(context, BURLEY).cdf(0.7, 0.5) == before


def _unreleased(context):
    """What was dropped since the last time without a release, which it gets now."""
    found = [one for one in context.objects if not isinstance(one, moderngl.InvalidObject)]
    context.objects.clear()
    for one in found:
        one.release()
    return found


def test_results_may_be_stored_in_half_precision(context):
    r = np.geomspace(0.01, 1.0, 50)
    error = np.abs(ShaderLaw(context, BURLEY, results="f2").profile(r, 0.5) / BURLEY.profile(r, 0.5) - 1.0)
    assert 1e-4 < np.max(error) <= 2.0**-10  # eleven bits, rounded or cut


def test_a_broken_text_names_law_line_and_the_drivers_message(context):
    text = emit.law_text(BURLEY).replace("float third = exp(", "float third = expo(")
    with pytest.raises(ShaderError, match=r"'burley'.*line \d+.*float third = expo\(.*expo"):
        ShaderLaw(context, BURLEY, text)


def test_a_text_in_half_precision_has_no_other_number_left():
    text = in_half(emit.law_text(profilefit.load("hazard")))
    assert not re.search(r"\bfloat\b", text)
    code = "\n".join(line.partition("//")[0] for line in text.splitlines())
    bare = re.sub(r"float16_t\([\d.eE+-]+\)", "", code)
    assert not re.search(r"(?<![\w.])(\d+\.\d*|\d+e-?\d+)", bare)
    assert "float16_t(1e-6)" in code
    assert "i < HAZARD_STEPS" in code


def test_what_offers_no_half_precision_says_so_in_one_line(context):
    line = no_half(context)
    assert line.startswith("float16 arithmetic: not offered by ")
    assert "\n" not in line
