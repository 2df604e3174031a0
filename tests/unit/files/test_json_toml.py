"""JSON and TOML of others: one line for everything that is not to be trusted; what is written any reader takes."""

import enum
import json
import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.files import whole_file
from mcml_sim.files.whole_file import MOST_LEVELS, MOST_TOML, as_json, parse_json, parse_toml, read_json, read_toml
from tests.fixtures import refused


def test_json_comes_back(tmp_path):
    path = tmp_path / "file.json"
    path.write_text('\ufeff{"a": [1, -2.5e3, null, true, "ü"], "b": {}}', encoding="utf-8")
    assert read_json(path) == {"a": [1, -2500.0, None, True, "ü"], "b": {}}
    assert parse_json(b"[" * MOST_LEVELS + b"1" + b"]" * MOST_LEVELS)
    assert parse_json(b"Infinity", infinite=True) == float("inf")


def test_toml_comes_back(tmp_path):
    path = tmp_path / "file.toml"
    path.write_text('\ufeffa = [1, -2.5e3, inf]\r\n"b".c = "ü"\n', encoding="utf-8")
    assert read_toml(path) == {"a": [1, -2500.0, float("inf")], "b": {"c": "ü"}}
    digits = "9" * 5000
    assert parse_toml(f"# {digits}\na = '{digits}'".encode()) == {"a": digits}, "a text and a comment may have them"


DEEP = f"tables or lists nested more than {MOST_LEVELS} deep"
NO_JSON = {
    b"": "Expecting value",
    b"{": "Expecting property name",
    b"\xff": "'utf-8' codec can't decode byte 0xff",
    b"[" * 100_000: DEEP,
    b'{"a":' * 100_000: DEEP,
    b"[" * 33 + b"]" * 33 + b" ": None,
    b"[" * 34 + b"]" * 34: DEEP,
    b"9" * 5000: "a whole number of 5000 digits",
    b'{"a": 1,\n "b": [0, -' + b"9" * 400 + b"]}": r"a whole number of 400 digits, .*, of 'b' \(at line 2\)",
    b"[1,\n1e400]": r"the number 1e400, beyond floating point \(at line 2\)",
    b'{"a": -Infinity}': "-Infinity, which is no number",
    b'{"a": Infinity}': "Infinity, which is no number",
    b"NaN": "NaN, which is no number",
    b'{"a": 1, "b": {"a": 2, "a": 3}}': "the key 'a' twice in one object",
    b'["\\ud800"]': "'utf-8' codec can't encode character",
    b'{"\\ud800": 1}': "'utf-8' codec can't encode character",
    b" " * (whole_file.MOST_JSON + 1): f"more than {whole_file.MOST_JSON} bytes",
}
NO_TOML = {
    b"a = ": "Invalid value",
    b"a = \xff": "'utf-8' codec can't decode byte 0xff",
    b"a = 1\na = 2": "Cannot overwrite a value",
    b"'b c' = 0\na = -" + b"9" * 5000: r"a whole number of 5000 digits, of 300 at most, of 'a' \(at line 2\)$",
    b"# n\n[t]\nmu_s = [\n1.0,\n" + b"1_0" * 200 + b"]": r"a whole number of 400 digits, .*, of 'mu_s' \(at line 5\)$",
    b"a = 1\nb = {c = -1e400}": r"the number -1e400, beyond floating point, of 'c' \(at line 2\)$",
    b"a = " + b"[" * 100_000: DEEP,
    b"a = " + b"{a = " * 50_000: DEEP,
    b"a." * 100_000 + b"a = 1": DEEP,
    b"[" + b"'a' . " * 40_000 + b"a]": DEEP,
    b"a = [" + b"[" * 32 + b"]" * 33: DEEP,
    b"#" * (MOST_TOML + 1): f"more than {MOST_TOML} bytes",
}


@pytest.mark.parametrize(
    ("parse", "text", "reason"),
    [(parse, *case) for parse, cases in ((parse_json, NO_JSON), (parse_toml, NO_TOML)) for case in cases.items()],
    ids=lambda value: repr(value[:12]) if isinstance(value, bytes) else "",
)
def test_what_is_not_to_be_trusted_is_one_line(parse, text, reason):
    started = time.perf_counter()
    if reason is None:
        parse(text)
        return
    assert len(refused(f"^{reason}", parse, text, error=ValueError)) < 200
    assert time.perf_counter() - started < 1


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (parse_json, b"[" + b"[]," * (MOST_TOML // 3) + b"[]]"),
        (parse_json, b"{" + b",".join(b'"%d":0' % i for i in range(MOST_TOML // 11)) + b"}"),
        (parse_toml, b"".join(b"a%d=1\n" % i for i in range(MOST_TOML // 9))),
        (parse_toml, b"a = '''" + b"x." * (MOST_TOML // 2 - 9) + b"x'''"),
        (parse_toml, b"a = '''" + b'" ' * (MOST_TOML // 2 - 9) + b"x'''"),
        (parse_toml, b"a = [" + b"0.5," * (MOST_TOML // 4 - 9) + b"]"),
        (parse_toml, b"[[layers]]\nn = 1\n" * (MOST_TOML // 17)),
    ],
    ids=["lists", "keys", "lines", "chain", "quotes", "numbers", "tables"],
)
def test_large_files_take_less_than_two_seconds(parse, text):
    """Nothing grows faster than the file: the slowest takes half a second of a core."""
    started = time.process_time()
    try:
        parse(text)
    except ValueError as error:
        assert str(error) == DEEP  # noqa: PT017 - a text of names between dots might be a key
    assert time.process_time() - started < 2


def test_files_are_named(tmp_path):
    for read, kind in ((read_json, "JSON"), (read_toml, "TOML")):
        refused("file: expected a file that can be read, got: No such file", read, tmp_path / "file")
        (tmp_path / "file").write_bytes(b"\0")
        refused(f"file: is not {kind}: ", read, tmp_path / "file")
        (tmp_path / "file").unlink()


@dataclass(frozen=True)
class Found:
    value: float
    rings: np.ndarray


@pytest.mark.parametrize("nothing", [math.nan, math.inf, -math.inf, np.float32(np.nan), None])
def test_what_is_not_finite_is_null(nothing):
    assert json.loads(as_json({"x": [nothing, 1.0]})) == {"x": [None, 1.0]}


def test_every_kind_of_number_text_and_container():
    numbers, kind = (np.int64(3), np.bool_(True), np.float64(0.25)), enum.Enum("Kind", "ONE").ONE
    given = {1: numbers, "path": Path("a/b"), "kind": kind, "found": Found(0.5, np.array([1.0, np.nan]))}
    told = {"1": [3, True, 0.25], "path": "a/b", "kind": "Kind.ONE", "found": {"value": 0.5, "rings": [1.0, None]}}
    assert json.loads(as_json(given)) == told


def test_no_digit_is_lost_unless_asked():
    value = 0.1 + 0.2
    assert whole_file.plain(value) == value
    assert whole_file.plain(value, 12) == 0.3
    assert json.loads(as_json(math.pi)) == math.pi


def test_the_order_given_is_kept_and_letters_may_be_spelled():
    assert as_json({"b": 1, "a": "µ"}) == '{\n "b": 1,\n "a": "µ"\n}\n'
    assert "\\u00b5" in as_json({"a": "µ"}, ascii_only=True)
