"""The reproduction says what it measured: its parts on hand-made input, its verdicts with a control that says no."""

import dataclasses
import json

import numpy as np
import pytest

from mcml_sim.media.setting import Setting
from profilefit.fitting.profiles import Profiles
from profilefit.recipes.reproduction import (
    CORRECTED_B0,
    PUBLISHED,
    ExactTruth,
    Protocol7,
    cut_radius,
    fit_coefficients,
    judge,
    law_energy,
    printed_coefficients,
    readings,
)


@pytest.fixture(scope="module")
def found():
    return readings()


def _of(found, equation, *words):
    return [r for r in found if r.equation == equation and all(w in r.choices for w in words)]


def _hand_made(value):
    """Profiles whose r R_d is `value(r)` at ring centres."""
    edges = np.arange(3001) * 0.01
    r = 0.5 * (edges[1:] + edges[:-1])
    energy = (2 * np.pi * value(r) * 0.01)[None]
    none = np.zeros_like(energy)
    return Profiles(np.array([0.5]), edges, energy, none, none + np.inf, np.zeros(1), "exact", Setting())


def test_cut_of_a_known_exponential_is_the_stride_after_its_crossing():
    r = (np.arange(3000) + 0.5) * 0.01
    # e^{-r/s} falls to .005 of its first ring at r = s ln 200 + .005: 1.06 for s = .2, 4.24 for .8, 10.6 for 2
    for scale, ring, walk, before in ((0.2, 1.065, 1.2, 1.0), (0.8, 4.25, 4.5, 4.0), (2.0, 10.605, 11.0, 10.0)):
        y = np.exp(-r / scale)
        assert cut_radius(r, y, "ring") == pytest.approx(ring, abs=0.0101)
        assert cut_radius(r, y, "walk") == pytest.approx(walk)
        assert cut_radius(r, y, "stride before") == pytest.approx(before)


def test_cut_is_the_first_low_radius_and_not_the_last():
    r = (np.arange(3000) + 0.5) * 0.01
    y = np.where((r > 1.95) & (r < 2.05), 0.0, 1.0)
    assert cut_radius(r, y, "walk") == pytest.approx(2.0)
    assert cut_radius(r, np.ones_like(r), "walk") == pytest.approx(r[-1])


@pytest.mark.slow
def test_fit_finds_a_rational_profile_whatever_it_starts_from():
    profiles = _hand_made(lambda r: np.maximum((-0.004 * r + 0.03) / (r + 0.4), 0.0))
    for protocol in (Protocol7(), Protocol7(stop="stride before")):
        assert fit_coefficients(profiles, protocol).values[0] == pytest.approx([-0.004, 0.03, 0.4], rel=1e-6)


def test_strides_stay_while_the_mean_free_path_grows():
    profiles = _hand_made(lambda r: np.exp(-r / 0.8))
    assert fit_coefficients(profiles, Protocol7()).cut == pytest.approx(4.5)
    assert fit_coefficients(profiles, Protocol7(), mfp=2.0).cut == pytest.approx(4.5)  # 9 of (6)'s units, strides of 1
    assert fit_coefficients(profiles, Protocol7(), mfp=0.1).cut == pytest.approx(4.5)  # .45, strides of .05


def test_simpson_on_the_spline_is_the_exact_ring():
    alpha = np.array([0.1, 0.9, 0.995])
    truth = ExactTruth(last_radius=3.0).profiles(alpha)
    slow = Profiles.from_exact(alpha, truth.r_edges)
    assert truth.energy == pytest.approx(slow.energy, rel=2e-5)
    assert truth.beyond == pytest.approx(slow.beyond, abs=1e-7)


@pytest.mark.parametrize(
    ("constants", "curve", "verdict"),
    [
        (0.01, 0.01, "reproduced"),
        (0.50, 0.01, "curve only"),
        (0.01, 0.06, "not reproduced"),
        (np.nan, 0.01, "curve only"),
        (0.01, np.nan, "not reproduced"),
    ],
)
def test_verdict_follows_the_figures(constants, curve, verdict):
    assert judge(constants, curve) == verdict


@pytest.mark.slow  # 61 fits
def test_verdicts_are_those_of_the_distances(found):
    for reading in found:
        assert reading.verdict == judge(reading.constant_distance, reading.curve_distance)
        assert set(reading.constants) == set(reading.published)


@pytest.mark.slow  # 61 fits
def test_a_c_and_the_albedo_map_come_out_of_the_protocol(found):
    plain = "(6) on r R_d, stop at the ring"
    for equation in ("(11)", "(15)"):
        (reading,) = _of(found, equation, plain, "exponent held")
        assert reading.verdict == "reproduced"
    assert any(r.verdict == "reproduced" for r in _of(found, "(8)"))
    assert _of(found, "(10), (12), (14)", "r R_d fitted")[0].verdict == "reproduced"


@pytest.mark.slow  # 61 fits
def test_printed_b0_does_not_and_its_correction_does(found):
    verdicts = {r.published["b0"]: r.verdict for r in _of(found, "(13) b0")}
    assert verdicts[PUBLISHED["(13)"]["b0"]] == "not reproduced"
    assert [b0 for b0, verdict in verdicts.items() if verdict == "reproduced"] == [CORRECTED_B0]


def test_printed_b0_breaks_the_papers_own_energy():
    alpha = np.array([0.2, 0.6, 0.9, 0.99])
    shares = {}
    for b0 in (PUBLISHED["(13)"]["b0"], CORRECTED_B0):
        a, b, _ = printed_coefficients(alpha, b0)
        shares[b0] = law_energy(-b / a, alpha, b0) / ExactTruth().reflectance(alpha)
    assert shares[CORRECTED_B0] == pytest.approx(1.0, abs=0.07)
    assert np.all(shares[PUBLISHED["(13)"]["b0"]] > 10.0)


@pytest.mark.slow  # 61 fits
def test_trimming_the_wrong_quantity_is_found_out(found):
    wrong = _of(found, "(11)", "(6) on R_d") + _of(found, "(15)", "(6) on R_d") + _of(found, "(11)", "2 pi r R_d on")
    assert len(wrong) == 3
    assert {r.verdict for r in wrong} == {"not reproduced"}


@pytest.mark.slow  # 61 fits
def test_diffuse_light_is_no_reading_of_the_albedo_map(found):
    diffuse = ExactTruth(setting=Setting("diffuse")).reflectance(np.array([0.1, 0.5, 0.9]))
    printed = np.array(list(PUBLISHED["(8)"].values()))
    alpha = printed[0] * diffuse / (diffuse**2 + printed[1] * diffuse + printed[2])
    assert np.all(np.abs(alpha - [0.1, 0.5, 0.9]) > 0.02)  # under normal light .0052 at most, up to A = .75
    assert all(r.curve_distance < 0.01 for r in _of(found, "(8)"))


@pytest.mark.slow  # 61 fits
def test_readings_are_plain_data(found):
    text = json.dumps([dataclasses.asdict(r) for r in found], allow_nan=False)
    assert len(json.loads(text)) == len(found)
