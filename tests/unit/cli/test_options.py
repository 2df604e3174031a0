"""What the library says, in words of the command line; and which folder of records a command takes."""

from pathlib import Path

import pytest

from profilefit.cli.options import in_options, records_folder
from profilefit.errors import InputError, OtherRecords
from profilefit.recipes.folder import fits_folder


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("out must be another folder, got out", "--out must be another folder, got out"),
        ("held alpha must be in (0, 1)", "--fix alpha must be in (0, 1)"),
        ("x.csv: no row is left between `r_min` and `r_max`", "x.csv: no row is left between --r-min and --r-max"),
        ("x.csv:1: column r: out must be", "x.csv:1: column r: out must be"),
        ("constants of a record are its own", "constants of a record are its own"),
        (
            "lang must be glsl; `profilefit report` lists `names`",
            "lang must be glsl; `profilefit report` lists `names`",
        ),
    ],
)
def test_arguments_are_named_by_their_options(told, said):
    assert in_options(told) == said


def test_content_is_gone_through_and_numbers_stay():
    told = {"data": {"notes": ("left out by `r_min`",), "rows": 3}, "result": "hold it with `held` alpha=..."}
    assert in_options(told) == {
        "data": {"notes": ["left out by --r-min"], "rows": 3},
        "result": "hold it with --fix alpha=...",
    }


def test_what_was_asked_for_comes_first_then_what_is_here_then_what_is_shipped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert records_folder() == fits_folder()
    Path("fits").mkdir()
    assert records_folder() == fits_folder(), "an empty folder has nothing to show"
    Path("fits/one.json").write_text("{}")
    with pytest.warns(OtherRecords, match="records of 'fits' in the folder that you are in; --fits chooses others"):
        assert records_folder(quiet=True) == Path("fits")
    Path("mine").mkdir()
    with pytest.warns(OtherRecords, match="records of 'mine'$"):
        assert records_folder(Path("mine")) == Path("mine")
    assert records_folder(Path("mine"), quiet=True) == Path("mine")
    assert records_folder(fits_folder()) == fits_folder()
    with pytest.raises(InputError, match=r"--fits must be a folder of records, got 'asked', which is none"):
        records_folder(Path("asked"))


def test_what_is_shipped_has_recipes_and_records():
    assert (fits_folder() / "hazard.toml").is_file()
    assert (fits_folder() / "hazard.json").is_file()
