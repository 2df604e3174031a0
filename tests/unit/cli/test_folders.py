"""Which folder of records a command takes."""

from pathlib import Path

import pytest

from profilefit.cli.options import records_folder
from profilefit.errors import InputError, OtherRecords
from profilefit.recipes.folder import fits_folder


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
