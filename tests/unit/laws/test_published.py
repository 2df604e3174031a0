"""Printed constants, typed here a second time from their sources: the two copies must agree, digit for digit."""

import pytest

from mcml_sim import Setting
from profilefit.laws.published import SETS

PRINTED = {
    # Liang et al.: (9)-(11) a, (12)-(13) b, (14)-(15) c, (19)-(20) the inverse.
    ("liang", "published"): {
        "a1": -0.0064,
        "a2": 0.00316,
        "a3": 30.0,
        "b0": 0.461,
        "b1": 6.7,
        "b2": 0.45,
        "b3": 2.6,
        "b4": 1.3,
        "c1": 0.0097,
        "c2": 4.2,
        "c3": 0.166,
        "g1": 1.504,
        "g2": 2.175,
        "g3": 0.7,
        "g4": 0.19,
        "h1": 3.993,
        "h2": 3.268,
        "h3": 0.2838,
    },
    # Liang et al., (8).
    ("liang_albedo", "published"): {"p": 5.67, "q": 3.84, "w": 0.84},
    # Christensen and Burley 2015, searchlight: s = 1.85 - A + 7 |A - 0.8|^3.
    ("burley", "published"): {"s0": 1.85, "s1": 1.0, "s2": 7.0, "s3": 0.8},
    # The same, diffuse surface transmission: s = 1.9 - A + 3.5 (A - 0.8)^2.
    ("burley", "diffuse"): {"s0": 1.9, "s1": 1.0, "s2": 3.5, "s3": 0.8},
    # The same, diffuse mean free path: s = 3.5 + 100 (A - 0.33)^4.
    ("burley_diffuse_mfp", "published"): {"s0": 3.5, "s1": 100.0, "s2": 0.33},
    # Kulla and Conty 2017: s = 4.09712 + 4.20863 A - sqrt(9.59217 + 41.6808 A + 17.7126 A^2).
    ("van_de_hulst_albedo", "published"): {
        "p0": 4.09712,
        "p1": 4.20863,
        "q0": 9.59217,
        "q1": 41.6808,
        "q2": 17.7126,
    },
    # Chiang, Kutz and Burley 2016: alpha = 1 - exp(-5.09406 A + 2.61188 A^2 - 4.31805 A^3).
    ("chiang_albedo", "published"): {"e1": -5.09406, "e2": 2.61188, "e3": -4.31805},
}
UNDER_DIFFUSE_LIGHT = {("burley", "diffuse"), ("van_de_hulst_albedo", "published"), ("chiang_albedo", "published")}


@pytest.mark.parametrize("key", PRINTED, ids="-".join)
def test_constants_are_the_printed_ones(key):
    found = [s for s in SETS if (s.law, s.name) == key]
    assert len(found) == 1
    assert found[0].constants == PRINTED[key]
    assert found[0].setting == Setting("diffuse" if key in UNDER_DIFFUSE_LIGHT else "searchlight")
    assert found[0].source


def test_the_correction_moves_b0_alone():
    corrected = next(s for s in SETS if (s.law, s.name) == ("liang", "corrected"))
    assert corrected.constants == {**PRINTED["liang", "published"], "b0": 0.0641}


def test_every_set_is_pinned_here_and_named_once():
    keys = [(s.law, s.name) for s in SETS]
    assert len(set(keys)) == len(keys)
    assert set(keys) - {("liang", "corrected")} == set(PRINTED)
