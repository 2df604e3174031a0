"""What is printed where: JSON alone on stdout, colour on a terminal only, whole tables, and a quiet end in a pipe; and
what is written: whole files, whose refusals are one line, pairs, and examples.
"""

import json
import os
import re
import sys
from collections import Counter
from pathlib import Path

import pytest

from mcml_sim.cli.screen import typed
from profilefit.errors import OutputError
from profilefit.recipes import catalogue, record
from profilefit.recipes.catalogue import fits_folder
from profilefit.report.figures.canvas import canvas, save
from tests.fixtures import EXAMPLES

FITS = catalogue.fits_folder()
COLOUR = re.compile(r"\x1b\[(?:\d+;)*3[0-7]m")


def strict(text: str):
    """What JSON says; NaN and infinities, which Python writes and others do not read, are refused."""

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def test_json_of_records_is_what_they_hold(command, done):
    records = {name: record.read(path) for name, path in record.available(FITS).items()}
    assert strict(done("report", "--json")) == {"records": records}
    assert list(strict(command("report", "hazard", "--json")[1])["records"]) == ["hazard"]
    told = strict(done("convert", "--alpha", "1", "--mfp", "1mm", "--json", said=None))
    assert told["dmfp"] == [None], "null for what is not finite"


@pytest.mark.slow
def test_json_of_quality_is_measured(done):
    told = strict(done("report", "albedo-rational", "albedo-liang", "--quality", "--json"))
    (rational,) = [one for one in told["quality"]["maps"] if one["records"] == ["albedo-rational"]]
    stated = told["records"]["albedo-rational"]["quality"]["regenerated"]["delta_A"]
    assert rational["quality"]["delta_A"] == pytest.approx(stated, rel=1e-3)
    assert rational["setting"] == {"illumination": "searchlight", "n": 1.0, "g": 0.0}
    assert (told["quality"]["profiles"], told["quality"]["samplers"]) == ([], [])


def test_a_mistake_is_no_json(refused):
    said = f"profilefit: there is no record 'hazzard' in {FITS}; did you mean hazard? stacks are "
    rest = f"{', '.join(record.available(FITS / 'stacks'))}, and `profilefit report` lists records\n"
    assert refused("report hazzard --json", said) == said + rest


def test_an_unknown_record_names_the_nearest(refused):
    liang = "liang-whole, liang-as-published, liang-inverse-whole? "
    for name, near in {"liang": liang, "skim": "skimmilk-on-marble, skimmilk-on-potato? ", "hearts": "heart? "}.items():
        refused(f"report {name}", f"did you mean {near}")
    assert "did you mean" not in refused("report zzz", "")


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


def test_claims_are_shown_as_they_were_measured_last(command, done, tmp_path):
    told = strict(command("report", "--claims", "--json")[1])["claims"]
    out = done("report", "--claims", said=None)
    whole = " ".join(out.split())  # a long command runs over two lines
    assert all(one["command"] in whole for one in told)
    assert out.count("≤ ") + out.count("≥ ") == len(told) > 10
    status, _, err = command("report", "--claims", "--evidence", str(tmp_path))
    assert (status, err.count("\n")) == (2, 1)
    assert "claims.json" in err


def test_what_cannot_be_written_is_one_line(refused):
    """To read a pipe, whose tables were to be filled in, would wait for ever."""
    os.mkfifo("pipe")
    said = "profilefit: cannot write pipe: it is a pipe that nobody reads from\n"
    assert refused("export burley --out pipe", said) == said
    said = "--markdown must be a file whose tables are filled in, got pipe, which is none"
    assert refused("report burley-whole --markdown pipe", said) == f"profilefit: {said}\n"


def test_a_figure_or_a_record_is_both_of_its_files_or_none(tmp_path):
    (tmp_path / "one.svg").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*one\.svg: it is a folder"):
        save(canvas(1.0, layout=None), tmp_path, "one")
    (tmp_path / "two.json").mkdir()
    path = fits_folder() / "burley-whole.json"
    with pytest.raises(OutputError, match=r"cannot write .*two\.json: it is a folder"):
        record.write(tmp_path, "two", record.read(path), record.read_arrays(path))
    assert {one.name for one in tmp_path.iterdir()} == {"one.svg", "two.json"}


def test_every_example_is_copied_and_named(done, refused):
    Path("file").write_text("")
    refused("examples --out file/inside", "profilefit: cannot write")
    out = done("examples")
    assert out.splitlines() == [f"examples/{name}" for name in EXAMPLES]
    assert all(Path("examples", name).read_bytes() == Path(path).read_bytes() for name, path in EXAMPLES.items())


@pytest.mark.parametrize("there", ["file", "link"])
def test_what_is_there_is_never_replaced_and_nothing_is_half_copied(refused, there):
    Path("trial").mkdir()
    taken = Path("trial/skin.toml")
    taken.write_text("mine") if there == "file" else taken.symlink_to("nowhere")
    said = "cannot write into trial: skin.toml would be replaced; use --out with another folder"
    assert refused("examples --out trial", said) == f"profilefit: {said}\n"
    assert [path.name for path in Path("trial").iterdir()] == ["skin.toml"]
    assert taken.is_symlink() or taken.read_text() == "mine"
