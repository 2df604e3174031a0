"""Anything that was found becomes JSON that any reader takes."""

import enum
import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.files.text_file import as_json, plain


@dataclass(frozen=True)
class Found:
    value: float
    rings: np.ndarray


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf, np.float32(np.nan), None])
def test_what_is_not_finite_is_null(nothing):
    assert json.loads(as_json({"x": [nothing, 1.0]})) == {"x": [None, 1.0]}


def test_every_kind_of_number_text_and_container():
    given = {
        "found": Found(0.5, np.array([1.0, np.nan])),
        1: (np.int64(3), np.bool_(True), np.float64(0.25)),
        "path": Path("a/b"),
        "kind": enum.Enum("Kind", "ONE").ONE,
    }
    assert json.loads(as_json(given)) == {
        "found": {"value": 0.5, "rings": [1.0, None]},
        "1": [3, True, 0.25],
        "path": "a/b",
        "kind": "Kind.ONE",
    }


def test_no_digit_is_lost_unless_asked():
    value = 0.1 + 0.2
    assert plain(value) == value
    assert plain(value, 12) == 0.3
    assert json.loads(as_json(math.pi)) == math.pi


def test_the_order_given_is_kept_and_letters_may_be_spelled():
    assert as_json({"b": 1, "a": "µ"}) == '{\n "b": 1,\n "a": "µ"\n}\n'
    assert "\\u00b5" in as_json({"a": "µ"}, ascii_only=True)
