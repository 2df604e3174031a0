"""The text of a stack is its three laws: in float64 line by line, and in float32 by OpenGL."""

import re
from dataclasses import replace

import jax
import numpy as np
import pytest

import profilefit
from mcml_sim import Layer, Medium, Setting
from profilefit.laws.gaussians import MediumGaussians
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.scenes.layers.law import single_scattering
from profilefit.shader.check.shader_law import PROFILE, _Pass
from profilefit.shader.stack_text import gaussians_text, single_text, stack_text
from tests.fixtures import functions, refused, slow
from tests.unit.shader.test_other_texts import on_opengl

NAMES = StackLaw.constant_names()
# Of each channel alpha and mfp of its layers, and near what fits of heart muscle and of skin give for its interfaces.
HEART = (
    (((0.973, 0.54), (0.85, 0.75)), (0.171, -0.189, 1.03, 1.49, 0.0267, 0.0075, 0.81, 1.08, 0.145)),
    (((0.917, 0.417), (0.6, 0.5)), (0.218, -0.48, 0.951, 1.5, 0.0582, 0.0125, 0.775, 1.16, 0.171)),
    (((0.881, 0.339), (0.52, 0.4)), (0.242, -0.598, 0.911, 1.53, 0.0683, 0.0149, 0.715, 1.13, 0.132)),
)
SKIN = (
    (
        ((0.958, 0.2), (0.995, 0.311), (0.981, 2.18)),
        (0.0258, -0.103, 1.35, 1.79, 0.122, 0.665, 0.768, 1.22, 0.43),
        (0.101, 0.014, 0.916, 5.45, 0.6, 0.347, 3.05, 1.59, 0.144),
    ),
    (
        ((0.966, 0.161), (0.9953, 0.249), (0.825, 1.75)),
        (0.049, 0.0102, 1.32, 1.67, 0.0626, 0.587, 1.06, 1.24, 0.4),
        (0.489, -0.0774, 1.06, 6.3, 0.0506, 0.294, 1.34, 0.132, 0.0078),
    ),
    (  # its first image takes light away
        ((0.929, 0.143), (0.9935, 0.216), (0.161, 0.336)),
        (0.0422, 0.0193, 1.31, 2.11, 1.55, 0.735, 2.2, 0.92, 0.191),
        (0.522, -0.133, 0.912, 0.279, 0.0001, 0.0102, 0.6, 1.92, 0.898),
    ),
)
THICKNESS = np.array([0.0, 1e-3, 0.03, 0.4, 3.0, 1e9])
X = np.geomspace(1e-3, 1e2, 101)[:, None]  # r over the first layer's mean free path
SEEN = 0.995  # of the light: farther out terms that are near each other are all there is
XI = (np.arange(2**16) + 0.5) / 2**16
# A bin of radii is that of an interval of xi for each half space's and each image's part, two where a surface refracts,
# and each end of one may lose or gain a number; the maps follow their densities to 9e-6.
PARTS, FOLLOWED = 8, 2e-5
SUMS = [
    MediumGaussians(Setting("diffuse", n=1.4), 0.5 + 0.1 * i, (0.01, 0.3 + i, 9.0), (0.2, 0.5, 0.3)) for i in range(3)
]


def stack(setting, layers, *interfaces):
    half_space = profilefit.load("hazard", setting=setting)
    *upper, law = (LayerLaw(setting, half_space, *one) for one in layers)
    for top, constants in zip(reversed(upper), reversed(interfaces), strict=True):
        law = StackLaw(setting, top, law, 1.2 * top.mfp, **dict(zip(NAMES, constants, strict=True)))
    return law


def three(channels, light="searchlight", n=1.0):
    return [stack(Setting(light, n=n), *one) for one in channels]


LAWS = {
    "two layers, matched": three(HEART),
    "two layers": three(HEART, "diffuse", 1.4),
    "three layers, matched": three((SKIN[1], SKIN[0], SKIN[1]), "diffuse"),
    "three layers": three(SKIN, "searchlight", 1.4),
    "grey": [three(HEART, n=1.4)[0]] * 3,
}
# Relative, of float32's R_d: ten operations' rounding; in skin's blue light the terms are up to ten times their sum.
ROUNDING = {**dict.fromkeys(LAWS, 1.2e-5), "three layers": 2e-5}
QUICK = ("two layers",)
LABELS = [*QUICK, *slow(*(one for one in LAWS if one not in QUICK))]
every = pytest.mark.parametrize("label", LABELS)


def twin_of(laws):
    return functions(stack_text(laws, "python", "s"))


def mismatch(names, law, channel):
    """Errors of profile and reflectance, relative, and of the cdf."""
    law = jax.tree.map(np.asarray, law)  # constants as arrays: laws of one kind share what jax compiles
    r = X * law.top.mfp
    profile, total = law.profile(r, THICKNESS), law.total(THICKNESS)
    share = np.abs(names["s_cdf"](r, channel, THICKNESS) - law.cdf(r, THICKNESS))
    least = 1e-8 / law.top.mfp**2  # [1/length^2]: nothing that a picture shows
    apart = np.abs(names["s_profile"](r, channel, THICKNESS) - profile) / np.maximum(profile, least)
    return apart.max(), np.abs(names["s_total"](channel, THICKNESS) / total - 1.0).max(), share.max()


@every
def test_the_twin_is_the_three_laws(label):
    names = twin_of(LAWS[label])
    for channel, law in enumerate(LAWS[label]):
        assert max(mismatch(names, law, float(channel))) < 1e-10  # twelve digits of each constant


@pytest.mark.slow
def test_a_constant_that_is_off_in_the_eighth_digit_is_found():
    red, *others = LAWS["three layers"]
    for wrong in (replace(red, g1=red.g1 * (1 + 1e-7)), replace(red, below=replace(red.below, h0=red.below.h0 + 1e-7))):
        assert max(mismatch(twin_of([wrong, *others]), red, 0.0)) > 1e-9
    assert max(mismatch(twin_of(LAWS["three layers"]), red, 1.0)) > 0.1  # another channel


def binned(names, channel, thickness, of):
    """By radius, the shares that are drawn under one thickness, and those that the density of another one has."""
    unit = names[f"s_{('red', 'green', 'blue')[channel]}_mfp"]
    edges = np.append(0.0, np.geomspace(1e-3, 50.0, 60)) * unit
    node, weight = np.polynomial.legendre.leggauss(40)
    at = edges[:-1, None] + np.diff(edges)[:, None] * (node + 1.0) / 2.0
    expected = names["s_pdf"](at, float(channel), of) @ (weight / 2.0) * np.diff(edges)
    drawn = names["s_sample"](XI, float(channel), thickness)
    return np.histogram(drawn, edges)[0] / XI.size, expected


@every
def test_the_pdf_is_the_density_of_the_samples(label):
    names, accepted = twin_of(LAWS[label]), PARTS / XI.size + FOLLOWED
    for channel in range(3):
        for thickness in THICKNESS:
            drawn, expected = binned(names, channel, thickness, thickness)
            assert np.max(np.abs(drawn - expected)) < accepted
    drawn, expected = binned(names, 2, 0.03, 0.06)
    assert np.max(np.abs(drawn - expected)) > 10 * accepted


@every
def test_samples_find_all_the_light(label):
    """2 pi r R_d / (A pdf) is 1 in the mean, but for what the ends of the parts of xi lose or gain."""
    names = twin_of(LAWS[label])

    def weights(channel, thickness, of):
        r = names["s_sample"](XI, channel, thickness)
        profile, total = names["s_profile"](r, channel, thickness), names["s_total"](channel, thickness)
        return 2.0 * np.pi * r * profile / (total * names["s_pdf"](r, channel, of))

    for channel in (0.0, 1.0, 2.0):
        for thickness in THICKNESS:
            found = weights(channel, thickness, thickness)
            accepted = PARTS * found.max() / XI.size + FOLLOWED
            assert found.mean() == pytest.approx(1.0, abs=accepted)
            assert found.std() < 1.5
    assert abs(weights(0.0, 0.0, 0.1).mean() - 1.0) > 0.05  # another density


@every
def test_float32_is_right_to_rounding(context, label):
    laws = LAWS[label]
    names, found = twin_of(laws), by_opengl(context, laws)
    xi = np.linspace(0.0, 1.0, X.size)[:, None]
    for channel, law in enumerate(laws):
        r, d = np.float32(X * law.top.mfp).astype(float), np.float32(THICKNESS).astype(float)
        profile, cdf, sample, pdf = found(r, xi, channel, d)
        share = names["s_cdf"](r, float(channel), d)
        seen = share < SEEN
        right = {what: names[f"s_{what}"](r, float(channel), d)[seen] for what in ("profile", "pdf")}
        assert np.max(np.abs(profile[seen] / right["profile"] - 1.0)) < ROUNDING[label]
        assert np.max(np.abs(pdf[seen] / right["pdf"] - 1.0)) < 1e-5
        assert np.max(np.abs(cdf - share)) < 1.5e-6
        drawn = names["s_sample"](np.float32(xi).astype(float), float(channel), d)
        # Of a part that is chosen at few numbers xi float32 tells few apart; all others it places to rounding.
        beside = np.abs(sample - drawn) * names["s_pdf"](drawn, float(channel), d)
        assert np.quantile(beside, 0.98) < 2e-5


@every
def test_float32_is_finite_at_the_ends(context, label):
    r = np.array([0.0, 1e-30, 1e-6, 0.1, 10.0, 1e8, 1e30])[:, None, None]
    xi = np.array([0.0, 1e-30, 1e-6, 0.5, 0.999, 1.0 - 6e-8, 1.0])[:, None, None]
    found = by_opengl(context, LAWS[label])(r, xi, np.arange(3.0), np.append(THICKNESS, 1e30)[:, None])
    for values in found:
        assert np.all(np.isfinite(values) & (values >= 0.0))
    profile, cdf, sample, _ = found
    assert np.all(profile[0] > 0)
    np.testing.assert_allclose(cdf[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(cdf[-1], 1.0, atol=1e-6)
    assert np.all(sample[0] == 0.0)
    np.testing.assert_array_equal(sample[-1], sample[-2])  # 1 is taken for 1 - 2^-24


def by_opengl(context, laws):
    """Profile, cdf, sample and pdf of r, xi, channel and thickness."""
    source = PROFILE.format(head="", text=stack_text(laws, name="s"), name="s", type="float")
    return _Pass(context, "stack", source, "f4")


def test_every_number_stands_in_the_text_once_by_its_name():
    text = stack_text(LAWS["three layers"], remarks={"red_w": "a remark"})
    declared = dict(re.findall(r"^const float stack_(\w+) = (\S+);", text, re.MULTILINE))
    assert len(re.findall(r"^const float stack_", text, re.MULTILINE)) == len(declared)
    assert (declared["red_w"], declared["blue_mfp"], declared["green_scale2"]) == ("0.0258", "0.143", "0.646586345382")
    assert "const float stack_red_w = 0.0258; // a remark\n" in text
    assert not re.search(r"//%|@|LAW_", text)


def whole(label, lang="glsl", name="stack"):
    count = 3 if label.startswith("three") else 2
    return stack_text(LAWS[label], lang, name) + single_text(media(count), lang, f"{name}_once")


# mu_a and mu_s (1 - g) [1/mm] of skin's layers in red, green and blue, and thickness [mm].
TISSUE = (
    ((0.21, 4.8, 0.25), (0.016, 3.2, 0.2), (0.0085, 0.45, np.inf)),
    ((0.21, 6.0, 0.25), (0.019, 4.0, 0.2), (0.1, 0.47, np.inf)),
    ((0.5, 6.5, 0.25), (0.03, 4.6, 0.2), (2.5, 0.48, np.inf)),
)
# Of the cosines of beam and eye and of the angle between, and the thickness.
ONCE = "for (int i = 0; i < 3; ++i) found[i] = s_radiance(float(i), q.w, q.x, q.y, q.z); found.w = 0.0;"


def media(count, n=1.4, g=0.0):
    """Of red, green and blue; the second layer scatters forward half as much, the last of two is skin's last."""
    gs = [0.5 * g if i == 1 else g for i in range(count)]
    used = ((*colour[: count - 1], colour[-1]) for colour in TISSUE)
    layers = ([Layer(n, a, s / (1.0 - g), g, d) for (a, s, d), g in zip(one, gs, strict=True)] for one in used)
    return [Medium(tuple(one)) for one in layers]


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("g", [0.0, 0.9])
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_light_scattered_once(context, n, g, count):
    """In directions of which some graze, as float32 holds them."""
    random = np.random.default_rng(5)
    cosines = 1.0 - np.append(random.random((2, 300)), 1.0 - 10.0 ** -random.uniform(1.0, 4.0, (2, 100)), axis=1)
    turned = np.cos(random.uniform(0.0, 2.0 * np.pi, 400))
    cos_in, cos_out, turned = (np.float32(one).astype(float) for one in (*cosines, turned))
    three = media(count, n, g)
    names = functions(single_text(three, "python", "s"))
    found = on_opengl(context, single_text(three, name="s"), ONCE)
    for thickness in np.float32(THICKNESS).astype(float):
        by_opengl = found(cos_in, cos_out, turned, thickness)
        for channel, medium in enumerate(three):
            first, *below = medium.layers
            thin = Medium((replace(first, thickness=thickness), *below) if thickness > 0 else tuple(below))
            right = single_scattering(thin, cos_in, cos_out, np.arccos(turned))
            made = names["s_radiance"](float(channel), thickness, cos_in, cos_out, turned)
            np.testing.assert_allclose(made, right, rtol=1e-9)
            np.testing.assert_allclose(by_opengl[channel], made, rtol=1e-5)
    thin = names["s_radiance"](2.0, 0.03, cos_in, cos_out, turned)
    assert np.max(np.abs(thin / right - 1.0)) > 0.01


def test_light_scattered_once_is_finite_at_the_ends(context):
    found = on_opengl(context, single_text(media(3, 1.0, 0.9), name="s"), ONCE)
    ends = np.meshgrid([0.0, 1e-30, 1.0], [0.0, 1e-30, 1.0], [-1.0, 1.0], [0.0, 1e9, 1e30])
    for values in found(*ends):
        assert np.all(np.isfinite(values) & (values >= 0.0))


def refused_laws():
    two, skin = LAWS["two layers, matched"], LAWS["three layers, matched"]
    bent = three(HEART, n=1.4)
    burley = replace(two[0], top=replace(two[0].top, law=profilefit.load("burley")))
    return {
        "laws must be three laws of a stack, of red, green and blue, got StackLaw, StackLaw": two[:2],
        "laws must be three laws of a stack, .* got StackLaw, StackLaw, LayerLaw": [*two[:2], two[2].below],
        "laws must have one number of layers in all channels, two or more, got 2, 2, 3": [*two[:2], three(SKIN)[2]],
        "one light and one n in .*, got searchlight, n = 1, g = 0; searchlight, n = 1.4, g = 0": [*two[:2], bent[2]],
        "one light and one n in all layers and channels, got diffuse, .*; searchlight": [*two[:2], skin[2]],
        "half spaces by one text, hazard or refracting_hazard, got burley, hazard": [burley, *two[1:]],
    }


def refused_media():
    good, layer = media(3), Layer(1.4, 0.1, 1.0, 0.0)
    ended = Medium((replace(layer, thickness=2.0), replace(layer, thickness=1.5)))
    unlike = Medium((replace(layer, thickness=2.0), replace(layer, n=1.5)))
    return {
        "media must be three media, of red, green and blue, got Medium, Medium": good[:2],
        "media must be three media, .* got Medium, Medium, StackLaw": [*good[:2], LAWS["grey"][0]],
        "media must have an infinite last layer, got thickness 1.5": [ended] * 3,
        r"media must be of one n in all layers and channels, .* got 1.4, 1.5": [unlike] * 3,
        r"media must be of one n in .*, got 1, 1.4": [*media(2)[:2], media(2, 1.0)[2]],
        r"1 or more over that above, got 0.8": media(2, 0.8),
        "media must have one number of layers in all channels, two or more, got 2, 2, 3": [*media(2)[:2], good[2]],
        "two or more, got 1, 1, 1": [Medium((layer,))] * 3,
    }


def test_sums_of_gaussians_are_the_laws():
    names = functions(gaussians_text(SUMS, "python", "sums"))
    x, xi = np.geomspace(1e-3, 20.0, 50), np.linspace(0.0, 0.999, 50)
    for channel, law in enumerate(SUMS):
        shape = names["sums_shape"](float(channel))
        assert names["sums_reflectance"](shape) == pytest.approx(law.total_reflectance)
        ring = 2.0 * np.pi * x * law.profile(x, 0.5) / law.total_reflectance
        np.testing.assert_allclose(names["sums_density"](x, shape), ring, rtol=1e-10)
        np.testing.assert_allclose(names["sums_cumulated"](x, shape), law.cdf(x, 0.5), rtol=1e-10)
        np.testing.assert_allclose(names["sums_radius"](xi, shape), law.sampler.sample(xi, 0.5), atol=1e-8)
    other = names["sums_shape"](0.0)  # the comparison can fail
    assert np.max(np.abs(names["sums_cumulated"](x, other) - SUMS[2].cdf(x, 0.5))) > 0.1


UNLIKE = replace(SUMS[0], variance=(1.0,), weight=(1.0,))
REFUSED_SUMS = {"got 3, 3, 1$": [*SUMS[:2], UNLIKE], "got 3, 3$": SUMS[:2], "got none$": []}
REFUSED = {stack_text: refused_laws(), single_text: refused_media(), gaussians_text: REFUSED_SUMS}


@pytest.mark.parametrize(("text", "message"), [(text, message) for text, given in REFUSED.items() for message in given])
def test_what_is_no_stack_is_refused(text, message):
    refused(message, text, REFUSED[text][message])
