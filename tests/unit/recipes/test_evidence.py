"""What a measured thing says of itself, and when it no longer holds."""

import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from mcml_sim import __version__
from profilefit.errors import InputError, OutputError
from profilefit.recipes.evidence import digest, measurement_origin, processor, require_apart, stale
from profilefit.recipes.folder import fits_folder


@pytest.fixture
def records(tmp_path) -> Path:
    """Two records, to be changed."""
    (tmp_path / "records").mkdir()
    for name in ("albedo-rational", "hazard"):
        shutil.copy(fits_folder() / f"{name}.json", tmp_path / "records")
    return tmp_path / "records"


def test_it_tells_command_version_date_machine_and_records(records):
    told = measurement_origin("profilefit check hazard", records)
    assert list(told) == ["command", "version", "date", "machine", "sha256"]
    assert (told["command"], told["version"]) == ("profilefit check hazard", __version__)
    assert abs(datetime.now(UTC) - datetime.fromisoformat(told["date"])) < timedelta(minutes=1)
    assert told["machine"]["processor"] == processor() != ""
    assert told["machine"]["cores"] >= 1
    assert told["sha256"] == digest(records)


def test_it_is_stale_once_a_record_changes_comes_or_goes_or_changes_its_name(records, tmp_path):
    told = measurement_origin("", records)
    shutil.copytree(records, tmp_path / "copy")
    (records / "notes.txt").write_text("no record")
    assert not stale(told, records)
    assert not stale(told, tmp_path / "copy"), "where they lie does not matter"
    assert stale({**told, "version": "0.0.1"}, records)
    assert stale({}, records)
    hazard, whole = records / "hazard.json", (records / "hazard.json").read_bytes()
    hazard.write_bytes(whole.replace(b"1", b"2", 1))
    assert stale(told, records)
    hazard.write_bytes(whole)
    moved = hazard.rename(records / "hazzard.json")
    assert stale(told, records)
    assert not stale(told, moved.rename(hazard).parent)
    hazard.unlink()
    assert stale(told, records)
    # The same bytes in a row, cut elsewhere, are other records.
    for place, cut in (("a", 1), ("b", 2)):
        (tmp_path / place).mkdir()
        for name, text in (("one", "xyz"[:cut]), ("two", "xyz"[cut:])):
            (tmp_path / place / f"{name}.json").write_text(text)
    assert digest(tmp_path / "a") != digest(tmp_path / "b")


def test_measurements_do_not_lie_among_records(records, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for out in (records, tmp_path / "records" / ".." / "records", Path("fits")):
        with pytest.raises(InputError, match="out must be another folder than that of the records, got"):
            require_apart(out, records)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot write into .*file"):
        require_apart(tmp_path / "file", records)
    require_apart(tmp_path / "new", records)
    assert (tmp_path / "new").is_dir()
