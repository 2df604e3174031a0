"""What is printed where: JSON alone on stdout, colour on a terminal only, whole tables, and a quiet end in a pipe."""

import json
import re
import sys
from collections import Counter
from pathlib import Path

import pytest

from mcml_sim.cli.screen import typed
from profilefit.recipes import catalogue, record

FITS = catalogue.fits_folder()
COLOUR = re.compile(r"\x1b\[(?:\d+;)*3[0-7]m")


def strict(text: str):
    """What JSON says; NaN and infinities, which Python writes and others do not read, are refused."""

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def test_json_of_records_is_what_they_hold(command, done):
    out = done("report", "--json")
    assert strict(out) == {"records": {name: record.read(path) for name, path in record.available(FITS).items()}}
    assert list(strict(command("report", "hazard", "--json")[1])["records"]) == ["hazard"]


@pytest.mark.slow
def test_json_of_quality_is_measured(done):
    out = done("report", "albedo-rational", "albedo-liang", "--quality", "--json")
    told = strict(out)
    (rational,) = [one for one in told["quality"]["maps"] if one["records"] == ["albedo-rational"]]
    stated = told["records"]["albedo-rational"]["quality"]["regenerated"]["delta_A"]
    assert rational["quality"]["delta_A"] == pytest.approx(stated, rel=1e-3)
    assert rational["setting"] == {"illumination": "searchlight", "n": 1.0, "g": 0.0}
    assert (told["quality"]["profiles"], told["quality"]["samplers"]) == ([], [])


def test_json_has_null_for_what_is_not_finite(done):
    out = done("convert", "--alpha", "1", "--mfp", "1mm", "--json", said=None)
    assert strict(out)["dmfp"] == [None]


def test_a_mistake_is_no_json(command):
    status, out, err = command("report", "hazzard", "--json")
    assert (status, out) == (2, "")
    stacks = ", ".join(record.available(FITS / "stacks"))
    assert err == (
        f"profilefit: there is no record 'hazzard' in {FITS}; did you mean hazard? stacks are {stacks}, and "
        "`profilefit report` lists records\n"
    )


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("liang", "liang-whole, liang-as-published, liang-inverse-whole? "),
        ("skim", "skimmilk-on-marble, skimmilk-on-potato? "),
        ("hearts", "heart? "),
        ("zzz", None),
    ],
)
def test_an_unknown_record_names_the_nearest(command, name, near):
    _, _, err = command("report", name)
    assert (f"did you mean {near}" in err) if near else ("did you mean" not in err)
    assert err.count("\n") == 1


@pytest.mark.parametrize("width", [40, 80, *(pytest.param(one, marks=pytest.mark.slow) for one in (60, 100, 120))])
@pytest.mark.parametrize("words", [("report",), ("report", "liang-whole", "reproduction"), ("report", "skin")])
def test_tables_are_whole_at_any_width(command, done, monkeypatch, width, words):
    monkeypatch.setenv("COLUMNS", str(width))
    out = done(*words, said=None)
    assert width < 80 or max(map(len, out.splitlines())) <= width
    monkeypatch.setenv("COLUMNS", "400")
    assert Counter(out.split()) == Counter(command(*words)[1].split()), "nothing cut, nothing broken"


def test_colour_is_for_terminals_that_want_it(command, monkeypatch):
    assert "\x1b" not in command("report", "hazard")[1], "a pipe"
    monkeypatch.setenv("FORCE_COLOR", "1")  # what a terminal would get
    monkeypatch.setenv("TERM", "xterm-256color")
    assert COLOUR.search(command("report", "hazard")[1])
    monkeypatch.setenv("NO_COLOR", "1")
    assert not COLOUR.search(command("report", "hazard")[1])


def test_the_command_is_told_as_it_was_typed(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/usr/bin/profilefit", "check", "burley", "--out", "a b"])
    assert typed() == "profilefit check burley --out 'a b'"
    monkeypatch.setattr(sys, "argv", [str(Path("somewhere/mcml_sim/__main__.py")), "run"])
    assert typed() == "mcml_sim run"


def test_claims_are_shown_as_they_were_measured_last(command, tmp_path):
    told = strict(command("report", "--claims", "--json")[1])["claims"]
    status, out, _ = command("report", "--claims")
    assert status == 0
    whole = " ".join(out.split())  # a long command runs over two lines
    assert all(one["command"] in whole for one in told)
    assert out.count("≤ ") + out.count("≥ ") == len(told) > 10
    status, _, err = command("report", "--claims", "--evidence", str(tmp_path))
    assert (status, err.count("\n")) == (2, 1)
    assert "claims.json" in err
