"""Records: what is written is read, the same twice, whole or not at all; and what measurements say of records."""

import json
import os
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from mcml_sim import __version__
from profilefit.errors import InputError, OutputError, RecordError
from profilefit.recipes import record
from profilefit.recipes.evidence import digest, measurement_origin, processor, require_apart, stale
from profilefit.recipes.folder import fits_folder
from tests.fixtures import refused
from tests.unit.recipes.stack.test_record import GONE, spoil

NAMED = {"law": "liang", "pipeline": "profile", "setting": {"illumination": "searchlight", "n": 1.0, "g": 0.0}}
CONTENT = {**NAMED, "constants": {"b": {"regenerated": 0.1}, "a": {"regenerated": 2.0}}}
ARRAYS = {"samples": np.arange(6.0).reshape(2, 3), "alpha": np.array([0.5])}


def test_round_trip(tmp_path):
    path = record.write(tmp_path / "new" / "folder", "mine", CONTENT, ARRAYS)
    assert path == tmp_path / "new" / "folder" / "mine.json"
    assert record.read(path) == {"format": record.FORMAT, "name": "mine", **CONTENT}
    arrays = record.read_arrays(path)
    assert sorted(arrays) == ["alpha", "samples"]
    np.testing.assert_array_equal(arrays["samples"], ARRAYS["samples"])
    assert record.available(path.parent) == {"mine": path}
    # The same content is the same bytes, whatever the order of keys, and whenever it is written.
    turned = {**dict(reversed(CONTENT.items())), "constants": dict(reversed(CONTENT["constants"].items()))}
    first, again = (record.write(tmp_path / d, "mine", c, ARRAYS) for d, c in (("a", CONTENT), ("b", turned)))
    os.utime(first, (0, 0))
    for suffix in (".json", ".npz"):
        assert first.with_suffix(suffix).read_bytes() == again.with_suffix(suffix).read_bytes()
    other = record.write(tmp_path / "c", "mine", {**CONTENT, "law": "burley"}, ARRAYS)
    assert other.read_bytes() != first.read_bytes()


def test_numbers_to_twelve_digits_and_nan_to_null(tmp_path):
    given = {"third": 1 / 3, "tiny": np.float64(5e-301), "flag": np.bool_(True), "zero_d": np.array(2.0)}
    wanted = {"third": 0.333333333333, "tiny": 5e-301, "flag": True, "zero_d": 2.0, "array": [[1.0, None]]}
    found = record.read(record.write(tmp_path, "mine", {**CONTENT, **given, "array": np.array([[1.0, np.nan]])}, {}))
    assert found.items() >= wanted.items()
    assert found["flag"] is True


def test_a_failure_leaves_the_old_record_and_nothing_else(tmp_path, monkeypatch):
    path = record.write(tmp_path / "old", "mine", CONTENT, ARRAYS)
    before = {one.name: one.read_bytes() for one in path.parent.iterdir()}
    (tmp_path / "file").write_text("in the way")
    refused(r"cannot write into .*file: ", record.write, tmp_path / "file", "mine", CONTENT, ARRAYS, error=OutputError)
    monkeypatch.setattr(os, "fsync", Mock(side_effect=OSError(28, "No space left on device")))
    with pytest.raises(OutputError, match=r"cannot write .*mine.json: No space left on device"):
        record.write(path.parent, "mine", {"law": "other"}, {})
    assert {one.name: one.read_bytes() for one in path.parent.iterdir()} == before
    assert record.read(path)["law"] == "liang"


NOT_READ = [
    *((content, "is not a record") for content in (b"", b"{", b"\xff\xfe\x00")),
    *(
        (content, f"is not a record of format 1 or 2, got {got}")
        for content, got in ((b"[1, 2]", "'list'"), (b"{}", "None"), (b'{"format": 99}', "99"))
    ),
    (None, "there is no such record; `profilefit regenerate` makes them"),
    ("a folder", "cannot be read"),
]


@pytest.mark.parametrize(("content", "words"), NOT_READ, ids=[str(content) for content, _ in NOT_READ])
def test_what_is_no_record_is_named(tmp_path, content, words):
    path = tmp_path / "mine.json"
    if content == "a folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordError, match=rf"mine\.json: {words}") as caught:
        record.read(path)
    assert isinstance(caught.value, InputError)


@pytest.fixture
def spoilt(tmp_path):
    """Copies a shipped record in which something stands at a place, names with slashes between, or is lost."""

    def copy(name, place, value=GONE):
        path = Path(shutil.copy(fits_folder() / f"{name}.json", tmp_path / "mine.json"))
        spoil(path, place, value)
        return path

    return copy


def needed(schema):
    """Yield the dotted keys that must be there by the JSON Schema of a record, * for each inside a table."""
    for key in schema.get("required", ()):
        yield from (key, *(f"{key}.{inner}" for inner in needed(schema["properties"][key])))
    if isinstance(each := schema.get("additionalProperties"), dict):
        yield from (f"*.{inner}" for inner in needed(each))


ALWAYS, WHOLE = ([*needed(one.model_json_schema())] for one in (record.LawRecord, record.ProfileRecord))


@pytest.mark.parametrize("path", record.available(fits_folder()).values(), ids=lambda path: path.stem)
def test_shipped_records_are_whole(path):
    assert record.read(path, whole=True)["name"] == path.stem


def test_format_1_is_read_in_the_words_of_format_2(tmp_path):
    """It called the misfit's covariance discrepancy, as the model's: nothing but words differs."""
    now = record.read(fits_folder() / "burley-whole.json", whole=True)
    old = json.loads(json.dumps(now))
    old["format"] = 1
    old["covariance"]["discrepancy"] = old["covariance"].pop("misfit")
    old["posterior"]["discrepancy"] = old["posterior"].pop("misfit")
    for one in old["constants"].values():
        one["discrepancy_error"] = one.pop("misfit_error")
        one["intervals"]["discrepancy"] = one["intervals"].pop("misfit")
    path = tmp_path / "burley-whole.json"
    path.write_text(json.dumps(old))
    assert record.read(path, whole=True) == now
    arrays = record.read_arrays(fits_folder() / "burley-whole.json")
    assert {"samples_misfit", "log_density_misfit", "discrepancy_u"} <= set(arrays)
    before = {name.replace("samples_misfit", "samples_discrepancy"): value for name, value in arrays.items()}
    np.savez(path.with_suffix(".npz"), **before)
    assert set(record.read_arrays(path)) == set(arrays)
    again = record.write(tmp_path, "burley-again", {key: now[key] for key in now if key not in ("format", "name")}, {})
    assert record.read(again, whole=True) == {**now, "name": "burley-again"}


@pytest.mark.parametrize("key", WHOLE)
@pytest.mark.parametrize("value", [GONE, True], ids=["lost", "another type"])
def test_what_a_record_lacks_is_named(spoilt, key, value):
    content, place = json.loads((fits_folder() / "liang-whole.json").read_text()), []
    for name in key.split("."):
        place.append(next(iter(content)) if name == "*" else name)
        content = content[place[-1]]
    path, last = spoilt("liang-whole", "/".join(place), value), place[-1]
    got = "got True" if value is True else "got nothing|is missing"
    words = rf"mine\.json: is damaged: .*{last}(\]| must be .*,) ({got}); regenerate it"
    if key in ALWAYS or (value is True and key == "constants.*.published"):
        refused(words, record.read, path, error=RecordError)
    else:
        assert record.read(path)["law"] == "liang", "enough to make a law from"
    refused(words, record.read, path, whole=True, error=RecordError)


DAMAGED = [
    ("liang-whole", "pipeline", "magic", "pipeline must be one of albedo, profile, .*, got 'magic'"),
    ("liang-whole", "pipeline", ["x"], r"pipeline must be a text, got \['x'\]"),
    ("liang-whole", "constants", {"a1": 3.0}, r"\[constants\] a1 must be a table \[.*a1\], got 3\.0; regenerate it"),
    ("liang-as-published", "stages", [], r"stages must be a table \[stages\], got \[\]"),
    ("hazard", "preset", "; rm x", r"preset must be one of quick, full, got '; rm x'"),
    ("reproduction", "readings", {}, r"readings must be tables \[\[readings\]\], got {}"),
    ("reproduction", "table1", ["skin"], r"table1 must be tables \[\[table1\]\], got \['skin'\]"),
    ("albedo-rational-diffuse", "crosscheck/chi2", "much", r"\[crosscheck\] chi2 must be a number or null, got 'much'"),
    ("albedo-rational-diffuse", "crosscheck/constants", {"b": 1.0}, r".*\.constants\] b must be a table .*, got 1\.0"),
    ("albedo-rational-diffuse", "starts/share_best", None, r"\[starts\] share_best must be a.* number, got nothing"),
    (
        "albedo-rational-diffuse",
        "starts/outcomes",
        [{}],
        r"\[starts\.outc.* 1\] count must be a whole number, got noth",
    ),
    # Lists that belong together are of one length.
    ("burley-whole", "quality/regenerated/rel/0", GONE, ".*rel must be as long as quality.alpha"),
    ("burley-whole", "covariance/model/0", GONE, r"\[covariance\] model must be a square matrix"),
    ("burley-whole", "covariance", lambda own: {**own, "new": [[1.0]]}, r"\[covariance\] new must be a square matrix"),
    ("burley-whole", "covariance/names", lambda names: [*names, "zz"], ".*names must be of its constants, got 'zz'"),
    ("burley-whole", "derived/value/0", GONE, r"\[derived\] value must be as long as derived.alpha"),
    ("burley-whole", "quality/published/ks", GONE, r"\[quality.published\] ks must be there"),
    ("hazard-refracting", "quality/by_index/rel/0", GONE, r".*by_index\] rel must be as long as .*.n"),
]
# Its own index and g, of which it is exported, are among those that a law spans.
OUTSIDE = [
    ("refracting", "setting/n", 1.7, r"\[setting\] n must be in \(1, 1.6\], as its indices are, got 1.7"),
    ("refracting", "setting/n", 1.0, r"\[setting\] n must be in \(1, 1.6\]"),
    ("refracting", "indices", [None, 1.6], "indices must be a list of two numbers"),
    *(("forward", "setting/g", g, f".*g must be in .*, as its cosines are, got {g:g}") for g in (0, 0.96)),
]


@pytest.mark.parametrize(
    ("name", "place", "value", "words", "whole"),
    [*((*row, True) for row in DAMAGED), *((f"hazard-{name}", *row, False) for name, *row in OUTSIDE)],
)
def test_what_a_pipeline_needs_is_named(spoilt, name, place, value, words, whole):
    with pytest.raises(RecordError, match=rf"mine\.json: is damaged: {words}"):
        record.read(spoilt(name, place, value), whole=whole)
    part = place.partition("/")[0]
    if part in ("crosscheck", "starts"):  # which a recipe may ask for, or not
        assert record.read(spoilt(name, part), whole=True)["law"] == "rational"


STRANGE = ["\x1b[31m", "\x00", "\x9b", "\u202e", "\u2066", "\ud800", "x" * 1001]
BREAKS = ["\n", "\r", "\r\n", "\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029"]


@pytest.mark.parametrize("place", ["title", "equations", "law", "a key"])
@pytest.mark.parametrize("strange", [*BREAKS, *STRANGE], ids=ascii)
def test_text_that_is_no_printable_line_is_refused(spoilt, place, strange):
    """It would become a comment in code, and would be shown on a terminal."""
    if place == "a key":
        path = spoilt("hazard", "constants", lambda own: {**own, f"a{strange}": {"regenerated": 1.0}})
    else:
        path = spoilt("hazard", place, lambda text: f"{text}{strange}import os")
    words = "damaged: .*one line of printable text|not a record: .*surrogates"
    refused(rf"mine\.json: is ({words})", record.read, path, error=RecordError)


UNSAFE = [
    ('"data_digest": "0"', "data_digest must be 64 hexadecimal digits, got '0'"),
    (
        '"constants": {"s0": {"regenerated": "1; evil()"}}',
        r"\[constants\.s0\] regenerated must be a .*number, got '1; ev",
    ),
    ('"constants": {"s0": {"regenerated": 1e400}}', r"is not a record: the number 1e400, beyond floating point"),
    ('"constants": {"s0": {"regenerated": 1, "model_error": "x"}}', r"model_error must be a number or null, got 'x'"),
    (f'"note": {"[" * 20}{"]" * 20}', r"note.* must be nested no deeper than 12 tables and lists"),
]


@pytest.mark.parametrize(("change", "words"), UNSAFE, ids=[change[:30] for change, _ in UNSAFE])
def test_what_no_law_can_be_made_of_is_named(tmp_path, change, words):
    rest = json.dumps({"format": record.FORMAT, **NAMED, **({} if "constants" in change else {"constants": {}})})[1:]
    path = tmp_path / "mine.json"
    path.write_text("{" + rest[:-1] + ", " + change + "}")
    said = refused(rf"mine\.json: .*{words}", record.read, path, error=RecordError)
    assert len(said) < 300 + len(str(tmp_path))


def test_damaged_arrays_are_named(tmp_path):
    path = record.write(tmp_path, "mine", CONTENT, {})
    refused(r"mine\.npz: .*are missing; regenerate it", record.read_arrays, path, error=RecordError)
    path.with_suffix(".npz").write_bytes(b"no arrays")
    refused(r"mine\.npz: .*is damaged \(.*\); regenerate it", record.read_arrays, path, error=RecordError)


def test_no_flipped_byte_gets_past_as_another_error(tmp_path):
    """Zip files say in many ways what is wrong with them: each becomes a RecordError, or changes nothing."""
    path = record.write(tmp_path, "mine", CONTENT, ARRAYS)
    file = path.with_suffix(".npz")
    whole, named = file.read_bytes(), 0
    for at in range(len(whole)):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            arrays = record.read_arrays(path)
        except RecordError:
            named += 1
        else:
            assert all(np.array_equal(arrays[name], ARRAYS[name]) for name in arrays if name in ARRAYS)
    assert named > len(whole) / 2


def test_digest_tells_numbers_apart_and_versions_name_what_decides_them():
    a, b = np.arange(4.0), np.array([1.0, 2.0])
    assert record.digest(a, b) == record.digest(a[::-1][::-1], b)
    assert record.digest(a, b) != record.digest(a, b + 1e-15)
    assert len(record.digest()) == 64
    assert {"profilefit", "jax", "jaxlib", "optimistix", "emcee", "numpy", "scipy"} == set(record.versions())


# What a measured thing says of itself, and when it no longer holds


def test_a_measurement_tells_of_its_records_and_is_stale_once_one_changes_comes_or_goes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "records").mkdir()
    for name in ("albedo-rational", "hazard"):
        shutil.copy(fits_folder() / f"{name}.json", tmp_path / "records")
    records = tmp_path / "records"
    told = measurement_origin("profilefit check hazard", records)
    assert list(told) == ["command", "version", "date", "machine", "sha256"]
    assert (told["command"], told["version"]) == ("profilefit check hazard", __version__)
    assert abs(datetime.now(UTC) - datetime.fromisoformat(told["date"])) < timedelta(minutes=1)
    assert told["machine"]["processor"] == processor() != ""
    assert told["machine"]["cores"] >= 1
    assert told["sha256"] == digest(records)
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
    # Measurements do not lie among records.
    for out in (records, tmp_path / "records" / ".." / "records", Path("fits")):
        refused("out must be another folder than that of the records, got", require_apart, out, records)
    require_apart(tmp_path / "new", records)
    assert (tmp_path / "new").is_dir()
