"""Which folder of records a command takes."""

from pathlib import Path

from profilefit.folder import fits_folder, records_folder


def test_what_was_asked_for_comes_first_then_what_is_here_then_what_is_shipped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert records_folder() == fits_folder()
    Path("fits").mkdir()
    assert records_folder() == fits_folder(), "an empty folder has nothing to show"
    Path("fits/one.json").write_text("{}")
    assert records_folder() == Path("fits")
    assert records_folder(Path("asked")) == Path("asked")


def test_what_is_shipped_has_recipes_and_records():
    assert (fits_folder() / "hazard.toml").is_file()
    assert (fits_folder() / "hazard.json").is_file()
