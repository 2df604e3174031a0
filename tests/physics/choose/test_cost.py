"""Estimated milliseconds: the published frames come back, and what they scale with."""

import json
from dataclasses import replace

import pytest

from benchmarks.choose import ratios_json
from profilefit.errors import InputError
from profilefit.recipes import catalogue
from profilefit.studies.choose import cost
from profilefit.studies.choose.case import NOTHING, Option, sampled
from profilefit.studies.choose.cost import COVERED, PUBLISHED, Ratios, milliseconds

SEVENTEEN = Option("separable", 17)


def test_published_frames_come_back():
    """Within 3 %, by which the three are no straight line."""
    for share, ms in zip(COVERED, PUBLISHED["separable"], strict=True):
        frame = milliseconds(SEVENTEEN, cost.shipped(), screen_share=share)
        assert frame.estimate == pytest.approx(ms, rel=0.03)
        assert (frame.least, frame.most) == pytest.approx((frame.estimate, frame.estimate))


def test_scales_with_pixels_and_speed():
    ratios = cost.shipped()
    own = milliseconds(SEVENTEEN, ratios).estimate
    assert milliseconds(SEVENTEEN, ratios, pixels=3840 * 2160).estimate == pytest.approx(4.0 * own)
    quick = milliseconds(SEVENTEEN, ratios, "rtx-4090")
    assert quick.estimate == pytest.approx(own * 1.862 / 82.6)
    assert quick.least == pytest.approx(quick.estimate)
    assert quick.most == pytest.approx(own * 112 / 1008)  # where it waits for its memory


def test_the_range_of_software_s_ratios_holds_the_published_frames():
    """Of normalized diffusion, by which it was made; of a GPU that was measured nothing but its own speed is open."""
    burley = Option("sampled", 17, law=catalogue.load("burley"))
    ratios = cost.shipped()
    for share, ms, base in zip(COVERED, PUBLISHED["burley"], PUBLISHED["separable"], strict=True):
        frame = milliseconds(burley, ratios, screen_share=share)
        assert frame.least < frame.estimate < ms / base * milliseconds(SEVENTEEN, ratios, screen_share=share).estimate
        assert ms <= 1.03 * frame.most
    assert milliseconds(NOTHING, ratios).least < milliseconds(NOTHING, ratios).estimate
    own = milliseconds(burley, replace(ratios, spread=1.0))
    assert own.least == own.estimate == own.most


def test_order(hazard):
    """Nothing, a filter, two filters; more samples cost more."""
    ratios = cost.shipped()
    times = [milliseconds(one, ratios).estimate for one in (NOTHING, SEVENTEEN, Option("gaussians", 17, 2))]
    assert times == sorted(times)
    of_samples = [milliseconds(one, ratios).estimate for one in sampled(hazard, "hazard-diffuse")]
    assert of_samples == sorted(of_samples)


def test_what_was_measured_is_kept():
    made = Ratios("a device", 0.5, {"separable": 0.1}, {"separable": 0.01})
    assert Ratios(**json.loads(ratios_json(made))) == made
    assert made.of(NOTHING) == 0.5
    assert made.of(Option("gaussians", 10, 3)) == pytest.approx(0.5 + 3 * 0.2)


def test_misuse(hazard):
    with pytest.raises(InputError, match=r"gpu must be one of switch, .* got 'voodoo'"):
        milliseconds(SEVENTEEN, cost.shipped(), "voodoo")
    made = Ratios("a device", 0.5, {"separable": 0.1}, {"separable": 0.01})
    with pytest.raises(InputError, match=r"option must be one whose cost was measured \(separable\), got 'hazard'"):
        made.of(Option("sampled", 16, law=hazard))
