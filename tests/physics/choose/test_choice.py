"""Which option is chosen, from which cases; its milliseconds; and one layer in place of a stack."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.choose import ratios_json
from mcml_sim import Layer, Medium, Setting
from profilefit.errors import InputError
from profilefit.recipes import catalogue
from profilefit.recipes.stack.file import LayerStack
from profilefit.scenes.layers.half_space import RingShares
from profilefit.studies.choose import cost
from profilefit.studies.choose import layers as module
from profilefit.studies.choose.case import NOTHING, Case, Option, Within, sampled
from profilefit.studies.choose.choice import Predicted, cases, chosen, laws
from profilefit.studies.choose.cost import COVERED, PUBLISHED, Milliseconds, Ratios, milliseconds
from profilefit.studies.choose.error import Error
from profilefit.studies.choose.layers import OneLayer, of_each_colour, one_layer
from tests.fixtures import refused, slow

CASE = Case((0.5, 0.5, 0.5), (1.0, 1.0, 1.0), 0.1)


def predicted(*pairs):
    """(ms, error) of options, cheapest first."""
    return [
        Predicted(Option("separable", i), Milliseconds(ms, ms, ms), Error(e, e, 0.0, 0.0, 0.0, 0, CASE))
        for i, (ms, e) in enumerate(pairs)
    ]


WITHIN_LIMITS = {"meets_tolerance": True, "meets_budget": True}
OPTIONS = predicted((1.0, 0.2), (2.0, 0.03), (3.0, 0.05), (4.0, 0.015), (5.0, 0.018), (6.0, 0.004))


@pytest.mark.parametrize(
    ("tolerance", "ms", "expected"),
    [
        # Of the cheaper ones the most accurate; not the next, which is worse, but the next that is better.
        (0.02, 5.0, {"chosen": 3, "nearest": 3, "cheaper": 1, "dearer": 5, **WITHIN_LIMITS}),
        # No money for it: the cheapest within the tolerance is named.
        (0.02, 3.5, {"chosen": None, "nearest": 3, "meets_tolerance": True, "meets_budget": False}),
        # None is good enough: the most accurate within the budget, or of all.
        (0.001, 5.0, {"chosen": None, "nearest": 3}),
        (0.001, None, {"nearest": 5, "dearer": None}),
        (0.5, 5.0, {"cheaper": None}),
    ],
    ids=["the cheapest that serves", "too dear", "none is good enough", "at any price", "all are good enough"],
)
def test_choice(scene, tolerance, ms, expected):
    choice = chosen(replace(scene, tolerance=tolerance, budget=replace(scene.budget, ms=ms)), OPTIONS)
    for name, value in expected.items():
        assert getattr(choice, name) is (OPTIONS[value] if type(value) is int else value)


def test_a_hair_is_not_worth_its_price(scene):
    """Of options that are as good, to what a prediction can tell, the cheapest."""
    choice = chosen(replace(scene, tolerance=0.001), predicted((1.0, 0.2), (2.0, 0.0101), (4.9, 0.01)))
    assert choice.nearest.ms == 2.0


def test_cases_go_through_the_ranges(scene):
    """Both ends of everything, steps of the mean free path in pixels between, one kernel for all."""
    wide = replace(
        scene,
        reflectance=((0.4, 0.8), (0.3, 0.5), (0.2, 0.2)),
        mfp=((1.0, 2.0), (0.7, 0.7), (0.5, 0.5)),
        pixel=(0.1, 1.0),
        resolution=(100, 50),
    )
    found = list(cases(wide))
    paths = sorted({one.mfp[0] / one.pixel for one in found})
    assert (paths[0], paths[-1]) == pytest.approx((1.0, 20.0))
    assert np.max(np.diff(np.log(paths))) <= math.log(4.0)
    assert {one.reflectance for one in found} == {(0.4, 0.3, 0.2), (0.8, 0.5, 0.2)}
    assert {one.kernel for one in found} == {(0.6000000000000001, 0.4, 0.2)}
    assert {one.radius for one in found} == {math.inf, 5.0}
    assert found[0].window == pytest.approx((50.0, 25.0))
    assert len(found) == 2 * 2 * len(paths)
    far = replace(scene, pixel=(2.0, 2.0))  # a curve below the pixels is not looked at
    assert [one.radius for one in cases(far)] == [math.inf]


def test_laws_of_a_setting():
    assert list(laws(Setting("diffuse"))) == ["burley-whole-diffuse", "hazard-diffuse", "quantile-diffuse"]
    names = ("burley-whole-diffuse", "hazard-diffuse-refracting", "quantile-diffuse")
    for n in (1.02, 1.37, 1.6):
        found = laws(Setting("diffuse", n=n))
        assert [(name, law.setting.n) for name, law in found.items()] == list(zip(names, (1.0, n, 1.0), strict=True))


SEVENTEEN = Option("separable", 17)


def test_scales_with_pixels_and_speed_and_rises_with_what_is_done(hazard):
    """Nothing, a filter, two filters; more samples cost more."""
    ratios = cost.shipped()
    for options in ((NOTHING, SEVENTEEN, Option("gaussians", 17, 2)), sampled(hazard, "hazard-diffuse")):
        times = [milliseconds(one, ratios).estimate for one in options]
        assert times == sorted(times)
    own = milliseconds(SEVENTEEN, ratios).estimate
    assert milliseconds(SEVENTEEN, ratios, pixels=3840 * 2160).estimate == pytest.approx(4.0 * own)
    quick = milliseconds(SEVENTEEN, ratios, "rtx-4090")
    assert quick.estimate == pytest.approx(own * 1.862 / 82.6)
    assert quick.least == pytest.approx(quick.estimate)
    assert quick.most == pytest.approx(own * 112 / 1008)  # where it waits for its memory


def test_published_frames_come_back_and_the_range_of_software_s_ratios_holds_them():
    """The filter's within 3 %, by which the three are no straight line; normalized diffusion's by the range that was
    made by them. Of a GPU that was measured nothing but its own speed is open."""
    burley = Option("sampled", 17, law=catalogue.load("burley"))
    ratios = cost.shipped()
    for share, base, ms in zip(COVERED, PUBLISHED["separable"], PUBLISHED["burley"], strict=True):
        filtered, frame = (milliseconds(one, ratios, screen_share=share) for one in (SEVENTEEN, burley))
        assert filtered.estimate == pytest.approx(base, rel=0.03)
        assert (filtered.least, filtered.most) == pytest.approx((filtered.estimate, filtered.estimate))
        assert frame.least < frame.estimate < ms / base * filtered.estimate
        assert ms <= 1.03 * frame.most
    assert milliseconds(NOTHING, ratios).least < milliseconds(NOTHING, ratios).estimate
    own = milliseconds(burley, replace(ratios, spread=1.0))
    assert own.least == own.estimate == own.most


def test_what_was_measured_is_kept(hazard):
    made = Ratios("a device", 0.5, {"separable": 0.1}, {"separable": 0.01})
    assert Ratios(**json.loads(ratios_json(made))) == made
    assert (made.of(NOTHING), made.of(Option("gaussians", 10, 3))) == (0.5, pytest.approx(0.5 + 3 * 0.2))
    refused(r"gpu must be one of switch, .* got 'voodoo'", milliseconds, SEVENTEEN, cost.shipped(), "voodoo")
    with pytest.raises(InputError, match=r"option must be one whose cost was measured \(separable\), got 'hazard'"):
        made.of(Option("sampled", 16, law=hazard))


WITHIN = Within()


def test_rings_beyond_an_edge():
    """One ring: the share of its circle beyond the edge."""
    ring = RingShares(np.array([2.0]), np.array([1.0]), np.array([0.0]))
    np.testing.assert_allclose(ring.beyond(np.array([0.0, 1.0, 3.0])), [0.5, 1.0 / 3.0, 0.0])


@pytest.mark.parametrize(("error", "verdict"), [(0.01, "enough"), (0.03, "not enough"), (0.0195, "undecided")])
def test_verdict(error, verdict):
    assert OneLayer(0.5, 0.9, 1.0, 1.0, error, 0.001, 1000, 0.0).verdict(0.02) == verdict


def test_equal_colours_are_traced_once(monkeypatch):
    """One answer of a grey stack, three of a coloured one, from as many runs as there are different media."""
    pale, dark = (Medium((Layer(1.0, mu_a, 0.9, 0.0),)) for mu_a in (0.1, 0.2))
    traced = []
    monkeypatch.setattr(module, "one_layer", lambda medium, *_, **__: traced.append(medium) or medium)
    grey = LayerStack("mm", (pale, pale, pale), ("",), ("",))
    assert of_each_colour(grey, 0.02, WITHIN) == (pale,)
    assert of_each_colour(LayerStack("mm", (pale, dark, pale), ("",), ("",)), 0.02, WITHIN) == (pale, dark, pale)
    assert traced == [pale, pale, dark]


@pytest.mark.slow
def test_two_halves_are_one_layer():
    """By exact light; traced within three standard errors of nothing. With its own mean free path and albedo."""
    stack = Medium((Layer(1.0, 0.1, 0.9, 0.0, 0.5), Layer(1.0, 0.1, 0.9, 0.0)))
    found, traced = one_layer(stack, 0.02, WITHIN), one_layer(stack, 0.02, WITHIN, 2**18)
    assert (found.photons, found.error) == (0, pytest.approx(0.0, abs=1e-6))
    assert traced.error < 3.0 * traced.standard_error
    for one, mfp in ((found, 1e-4), (traced, 0.01)):
        assert one.alpha == pytest.approx(0.9, abs=0.1 * mfp)
        assert one.mfp == pytest.approx(1.0, abs=mfp)
        assert one.verdict(0.02) == "enough"


@pytest.mark.slow
@pytest.mark.parametrize(("illumination", "off"), [("searchlight", 0.02), ("diffuse", 0.03)])
def test_exact_light_and_traced_light_say_the_same(illumination, off):
    """Skin in red light, whose lower layer is clear; its mean free path moves by 1 % from seed to seed."""
    stack = Medium((Layer(1.4, 0.21, 4.8, 0.0, 0.25), Layer(1.4, 0.0085, 0.45, 0.0)))
    found, traced = (one_layer(stack, 0.02, WITHIN, photons, illumination=illumination) for photons in (None, 2**20))
    assert found.error > 0.01
    assert traced.error == pytest.approx(found.error, abs=4.0 * traced.standard_error)
    assert traced.mfp == pytest.approx(found.mfp, rel=off)
    assert found.single == traced.single


@pytest.mark.slow
def test_a_thin_veil_is_not():
    """Negative control: thin paper far above an ink that is clear and deep."""
    stack = Medium((Layer(1.0, 0.001, 5.0, 0.0, 0.4), Layer(1.0, 0.0, 0.0, 0.0, 3.0), Layer(1.0, 0.02, 3.0, 0.0)))
    found = one_layer(stack, 0.02, WITHIN)
    assert found.error > 10.0 * found.standard_error
    assert found.verdict(0.02) == "not enough"


@pytest.mark.parametrize(
    ("layer", "photons", "message"),
    [
        *slow((Layer(1.0, 1.0, 0.0, 0.0, math.inf), 10_000, r"reflect a share in \(0, .*\) of the light, got 0.000")),
        (Layer(1.5, 0.0, 0.0, 0.0, 1.0), None, "scatter or absorb somewhere, got 1 that are clear"),
    ],
    ids=["black", "glass"],
)
def test_black_and_glass_have_no_single_layer(layer, photons, message):
    refused(f"layers must {message}", one_layer, Medium((layer,)), 0.02, WITHIN, photons)
