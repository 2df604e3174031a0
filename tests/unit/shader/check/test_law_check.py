"""Texts on the GPU give the numbers of the float64 laws, and pass their check; wrong ones do not, and say why."""

import json
import re
from functools import cache

import moderngl
import numpy as np
import pytest

import profilefit
from profilefit.errors import RecordError, ShaderError
from profilefit.recipes import catalogue
from profilefit.shader import emit, export
from profilefit.shader.check import bounds, dense_grid
from profilefit.shader.check.bounds import Bound
from profilefit.shader.check.chosen import COSINES, INDICES, chosen, printed, regenerated
from profilefit.shader.check.law_check import HALVES, OWN, check_half, check_law, check_laws, check_map
from profilefit.shader.check.law_cost import WORKS, costs
from profilefit.shader.check.shader_law import ROWS, WIDTH, ShaderLaw, ShaderMap, Values, in_half, no_half
from tests.fixtures import refused, slow

FITS = catalogue.fits_folder()
HAZARD = catalogue.find("hazard", FITS)
REFRACTING = catalogue.find("hazard-refracting", FITS, n=1.2)
BURLEY, MAP = profilefit.load("burley", "published"), catalogue.albedo_law("rational")
NAMED = {"hazard": HAZARD, "two parts": REFRACTING}
RATIONAL = catalogue.find("albedo-rational-refracting", FITS)
DENSITY, OWN_DENSITY = "return hazard_density(x, s);", f"{OWN}, 99 % of it"
FLOAT32 = 5e-6  # some ten operations, and an exponential of up to ten


@cache
def exact(name):
    return dense_grid.reference(NAMED[name].law, dense_grid.arguments())


def names(found):
    return [bound.name for bound in found.broken]


def test_a_regenerated_law_passes_with_room(context):
    found = check_law(context, HAZARD, FITS, exact=exact("hazard"))
    assert names(found) == []
    assert found.model.source == "hazard"
    assert found.inside.total == found.outside.total == 0
    assert 0 < found.rounding["rel"] < 1e-5
    assert 0 < found.spreads[OWN].half < 1e-6
    assert {bound.name for bound in found.bounds} >= {"float32 rel", "float32 ks", "bad numbers"}


@pytest.mark.slow
def test_the_gpus_numbers_have_the_records_errors(context):
    """Of a law that has an exact profile, measured anew."""
    (found,) = check_laws(context, [catalogue.find("burley-whole", FITS)], FITS)
    assert names(found) == []
    assert found.measured["rel"] == pytest.approx(found.model.values["rel"], rel=1e-5)
    assert found.measured["ks"] == pytest.approx(found.model.values["ks"], rel=1e-4)


@pytest.mark.slow
def test_a_law_of_two_parts_passes_with_room(context):
    """Its radii begin anew where the other part does, and its density is that of both."""
    found = check_law(context, REFRACTING, FITS, exact=exact("two parts"))
    assert names(found) == []
    assert found.inside.total == found.outside.total == 0
    assert max(found.rounding.values()) < 1e-6  # float32
    assert 0 < found.spreads[OWN].most < 1e-5
    assert found.measured["rel"] == pytest.approx(found.model.values["rel"], rel=1e-4)


@pytest.mark.parametrize(
    ("name", "old", "new", "broken"),
    [
        ("hazard", "s.h = exp(hazard_h0", "s.h = exp(1.02 * hazard_h0", "float32 rel"),
        ("hazard", "s.w = s.source - s.kappa", "s.w = s.source + s.kappa", "float32 ks"),
        ("hazard", "float t = -pf_log1p(-share);", "float t = -log(share - 1.0);", "float32 inversion_error"),
        ("hazard", "return exp(-here.exponent) * here.ratio * here.hazard;", "return sqrt(-1.0 - x);", "bad numbers"),
        ("hazard", "exponent + pf_log_near_one(", "exponent + 0.0 * pf_log_near_one(", "float32 inversion_error"),
        ("hazard", DENSITY, "return 1.01 * hazard_density(x, s);", OWN_DENSITY),
        *slow(
            ("two parts", "s.w = min(s.c", "s.w = min(1.02 * s.c", "float32 rel"),
            ("two parts", "shape.rest = alpha", "shape.rest = 1.01 * alpha", "float32 ks"),
            ("two parts", "float inner = PF_SELECT(share", "float inner = PF_SELECT(share + 0.01", "bad numbers"),
            ("two parts", "max(s.rest, PF_NEAREST)", "max(1.01 * s.rest, PF_NEAREST)", "float32 inversion_error"),
            ("two parts", DENSITY, "return 1.01 * hazard_density(x, s);", OWN_DENSITY),
            ("two parts", DENSITY, "return s.rest * hazard_density(x, s);", OWN_DENSITY),
        ),
    ],
)
def test_an_error_in_the_text_breaks_its_bound(context, name, old, new, broken):
    text = emit.law_text(NAMED[name].law)
    assert text.count(old) == 1
    assert broken in names(check_law(context, NAMED[name], FITS, text.replace(old, new), exact(name)))


def test_an_index_between_has_the_worse_of_its_neighbours_errors():
    """By hand from the record; nearer to 1 than all that it has measured, the law itself is."""
    content = json.loads((FITS / "hazard-refracting.json").read_text())
    known = {n: rel for n, rel in zip(*(content["quality"]["by_index"][key] for key in ("n", "rel")), strict=True)}
    for n, near in ((1.2, (1.2,)), (1.25, (1.2, 1.3)), (1.4, (1.4,)), (1.55, (1.5, 1.6)), (1.6, (1.6,))):
        found = bounds.model_of_profile(catalogue.find("hazard-refracting", FITS, n=n), FITS)
        assert (found.values["rel"], found.source) == (max(known[one] for one in near), "hazard-refracting")


def test_a_map_passes_and_a_wrong_sign_does_not(context):
    assert names(check_map(context, RATIONAL, FITS)) == []
    text = emit.map_text(RATIONAL.law)
    wrong = text.replace("1.0 + s * (rational_map_b", "1.0 - s * (rational_map_b")
    assert wrong != text
    assert "float32 delta_A" in names(check_map(context, RATIONAL, FITS, wrong))


def test_what_the_paper_promises_is_judged_of_its_constants_alone():
    laws, maps = chosen(["liang"], "published", FITS)
    valid = bounds.valid_profile(laws[0], FITS)
    assert (str(valid.alpha), str(valid.xi)) == ("[1e-06, 1]", "[0, 1]")
    assert str(bounds.valid_map(maps[0], FITS)[0]) == "[0, 1]"
    assert str(bounds.valid_profile(catalogue.find("liang-whole", FITS), FITS).xi) == "[0.01, 1]"
    fitted, _ = bounds.valid_map(catalogue.find("albedo-liang", FITS), FITS)
    assert (fitted.low, fitted.high) == pytest.approx((0.05, 0.9), abs=1e-4)
    inverse = next(one for one in catalogue.sampled_laws(FITS) if one.label == "liang-inverse-as-published")
    assert bounds.valid_profile(inverse, FITS).alpha is None
    assert set(bounds.model_of_profile(inverse, FITS).values) == {"inversion_error"}


@pytest.mark.slow
def test_names_choose_laws_and_maps():
    laws, maps = regenerated(FITS)
    labels = {"hazard", "hazard-diffuse-refracting", "liang-whole", "liang-inverse-as-published"}
    assert labels <= {one.label for one in laws}
    assert len({(one.label, one.setting.n, one.setting.g) for one in (*laws, *maps)}) == len(laws) + len(maps)
    assert {one.setting.n for one in chosen(["hazard"], "regenerated", FITS)[0]} == {1.0, *INDICES}
    assert [one.setting.n for one in chosen(["hazard-refracting"], None, FITS)[0]] == list(INDICES)
    assert [one.label for one in chosen(["gaussians"], "regenerated", FITS)[0]] == ["gaussians-6"]
    assert len(chosen(["rational"], "regenerated", FITS)[1]) == 2 + 2 * len(INDICES) + 2 * len(COSINES), "one n has g"
    assert {one.name for one in printed("published", FITS)[0]} == {"liang", "burley", "burley_diffuse_mfp"}
    refused("name must be a law, map or record", chosen, ["nothing"], "regenerated", FITS)
    refused("constants must be regenerated or a printed set", chosen, [], "nothing", FITS)
    refused("name the record itself", chosen, ["liang"], "liang.json", FITS)
    with pytest.raises(RecordError, match="record 'reproduction' holds no law of a fit that converged"):
        chosen(["reproduction"], "regenerated", FITS)


def test_bad_numbers_are_counted_by_kind():
    """On a grid of two albedos, four radii and shares, one length."""
    r = np.arange(4.0)[None, :, None]
    at = dense_grid.Arguments(np.array([0.2, 0.8])[:, None, None], r, 0.2 * r, np.array([1.0]))
    rising = np.broadcast_to(1.0 + r, (2, 4, 1)).copy()
    profile, cdf, sample = 5.0 - rising, rising / 4.0, rising.copy()
    profile[0, 2, 0] = 3.5  # up by a half
    profile[1, 3, 0] = np.inf  # not a step up besides
    cdf[0, 1, 0] = cdf[0, 0, 0] - 2.0 * dense_grid.ULP  # rounding
    cdf[1, 2, 0] = np.nan
    sample[0, 0, 0] = -1.0
    everywhere = np.ones((2, 4, 1), bool)
    found = dense_grid.counted(Values(profile, cdf, sample, rising), at, everywhere, everywhere)
    assert (found.nan, found.infinite, found.negative, found.wrong_way) == (1, 1, 1, 2)
    assert found.where == "profile, r/l 2, α 0.2"
    bright = everywhere & (at.alpha > 0.5)
    inside = dense_grid.counted(Values(profile, cdf, sample, rising), at, bright, bright)
    assert (inside.nan, inside.infinite, inside.negative) == (1, 1, 0)
    assert found.less(inside).negative == 1


def test_errors_that_are_no_number_are_the_largest():
    at = dense_grid.Arguments(np.full((3, 1, 1), 0.5), np.array([[[1.0]]]), np.array([[[0.5]]]), np.array([1.0]))
    error = np.array([0.1, np.nan, 0.2]).reshape(3, 1, 1)
    found = dense_grid.spread(error, np.ones((3, 1, 1), bool), at)
    assert (found.largest, found.half) == (np.inf, 0.2)
    assert dense_grid.spread(error, np.zeros((3, 1, 1), bool), at) is None
    assert Bound("x", float("nan"), 1.0).broken
    assert not Bound("x", 1.0, 1.0).broken
    assert str(Bound("x", 3.0, 1.5, "r 2")) == "x: 3 at r 2; bound 1.5, 2 times that"


def test_the_grid_has_both_ends():
    assert (dense_grid.ALPHA[0], dense_grid.ALPHA[-1]) == (0.0, 1.0)
    assert (dense_grid.X[0], dense_grid.XI[0], dense_grid.XI[-1]) == (0.0, 0.0, 1.0)
    assert dense_grid.X[-1] >= 1e29
    assert dense_grid.X.size == dense_grid.XI.size
    for values in (dense_grid.ALPHA, dense_grid.X, dense_grid.XI):
        assert np.all(np.diff(values) > 0)
        assert np.array_equal(values, values.astype(np.float32))


@pytest.mark.slow
def test_costs_are_counted_in_normalized_diffusion(context):
    found = costs(context, [HAZARD.law, REFRACTING.law], BURLEY)
    assert set(found) == {"burley", "hazard", "refracting_hazard"}
    assert found["burley"].ratio == dict.fromkeys(WORKS, 1.0)
    assert all(value > 0 for cost in found.values() for value in (*cost.ns.values(), *cost.ratio.values()))


@pytest.mark.slow
def test_a_stored_reflectance_loses_less_than_a_stored_albedo(context):
    found = check_half(context, HAZARD)
    assert 1e-5 < found.rel[HALVES[1]] < 0.5 * found.rel[HALVES[0]] < 0.01


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
    there, values = ShaderMap(context, MAP), np.linspace(0.0, 1.0, 33)
    np.testing.assert_allclose(there.alpha(values), MAP.alpha(values), atol=FLOAT32)
    np.testing.assert_allclose(there.reflectance(values[:-1]), MAP.reflectance(values[:-1]), atol=FLOAT32)


@pytest.mark.parametrize(("n", "most"), [(1.0, 1.0), (1.4, 0.923188)])
def test_a_colour_that_no_surface_lets_out_is_the_brightest(context, n, most):
    """The largest A is a constant of the source, stated in the head; on the GPU, too, a larger one has its albedo."""
    named = catalogue.find("hazard-diffuse", FITS, n=n)
    text = export(named, FITS)
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
    text = in_half(emit.law_text(HAZARD.law))
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
