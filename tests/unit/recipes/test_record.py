"""Records: what is written is read, the same twice, whole or not at all."""

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mcml_sim.files.text_file import MOST_JSON
from profilefit.errors import InputError, OutputError, RecordError
from profilefit.recipes import record, schema
from profilefit.recipes.catalogue import fits_folder

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


def test_the_same_content_is_the_same_bytes(tmp_path):
    """Whatever the order of keys, and whenever it is written."""
    turned = {**dict(reversed(CONTENT.items())), "constants": dict(reversed(CONTENT["constants"].items()))}
    first, again = (record.write(tmp_path / d, "mine", c, ARRAYS) for d, c in (("a", CONTENT), ("b", turned)))
    os.utime(first, (0, 0))
    for suffix in (".json", ".npz"):
        assert first.with_suffix(suffix).read_bytes() == again.with_suffix(suffix).read_bytes()
    other = record.write(tmp_path / "c", "mine", {**CONTENT, "law": "burley"}, ARRAYS)
    assert other.read_bytes() != first.read_bytes()


def test_numbers_to_twelve_digits_and_nan_to_null(tmp_path):
    @dataclass
    class Part:
        value: np.float64
        where: Path

    given = {"third": 1 / 3, "tiny": np.float64(5e-301), "nan": np.nan, "infinite": -np.inf, "whole": np.int64(7)}
    given |= {"flag": np.bool_(True), "array": np.array([[1.0, np.nan]]), "zero_d": np.array(2.0)}
    given |= {"pair": (1, "two", None), "part": Part(np.float64(3.0), Path("x")), 5: "key"}
    wanted = {"third": 0.333333333333, "tiny": 5e-301, "nan": None, "infinite": None, "whole": 7, "flag": True}
    wanted |= {"array": [[1.0, None]], "zero_d": 2.0, "pair": [1, "two", None], "5": "key"}
    found = record.read(record.write(tmp_path, "mine", {**CONTENT, **given}, {}))
    assert found.items() >= (wanted | {"part": {"value": 3.0, "where": "x"}}).items()
    assert found["flag"] is True
    assert "NaN" not in (tmp_path / "mine.json").read_text()


def test_a_failure_leaves_the_old_record_and_nothing_else(tmp_path, monkeypatch):
    path = record.write(tmp_path, "mine", CONTENT, ARRAYS)
    before = {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)}

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OutputError, match=r"cannot write .*mine.json: No space left on device"):
        record.write(tmp_path, "mine", {"law": "other"}, {})
    assert {name: (tmp_path / name).read_bytes() for name in os.listdir(tmp_path)} == before
    assert record.read(path)["law"] == "liang"


def test_an_interruption_leaves_nothing_behind(tmp_path, monkeypatch):
    def control_c(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", control_c)
    with pytest.raises(KeyboardInterrupt):
        record.write(tmp_path, "mine", CONTENT, ARRAYS)
    assert os.listdir(tmp_path) == []


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match=r"cannot write into .*file: "):
        record.write(tmp_path / "file", "mine", CONTENT, ARRAYS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"mine\.json: is not a record"),
        ("{", r"mine\.json: is not a record"),
        ("[1, 2]", r"mine\.json: is not a record of format 1 or 2, got 'list'"),
        ("{}", r"mine\.json: is not a record of format 1 or 2, got null"),
        ('{"format": 99}', r"mine\.json: is not a record of format 1 or 2, got 99"),
    ],
)
def test_what_is_no_record_is_named(tmp_path, text, words):
    path = tmp_path / "mine.json"
    path.write_text(text)
    with pytest.raises(RecordError, match=words):
        record.read(path)


def changed(tmp_path, name, change):
    """The path of a copy of a shipped record that a function has changed."""
    content = json.loads((fits_folder() / f"{name}.json").read_text())
    change(content)
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(content))
    return path


ALWAYS = {**schema.NAMED, **schema.CONSTANTS}
PROFILE_KEYS = {**ALWAYS, **schema.TOLD, **schema.PROFILE}


def _spoiled(tmp_path, key, spoil):
    """A shipped record of which the value at a dotted key is lost, or made true."""
    names = key.split(".")

    def change(content):
        for place, name in enumerate(names):
            names[place] = next(iter(content)) if name == "*" else name
            if place < len(names) - 1:
                content = content[names[place]]
        if spoil == "lost":
            del content[names[-1]]
        else:
            content[names[-1]] = True

    return changed(tmp_path, "liang-whole", change), names[-1]


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


@pytest.mark.parametrize("key", [key for key in PROFILE_KEYS if not key.endswith("*") and "?" not in key])
@pytest.mark.parametrize("spoil", ["lost", "another type"])
def test_what_a_record_lacks_is_named(tmp_path, key, spoil):
    path, last = _spoiled(tmp_path, key, spoil)
    got = "nothing" if spoil == "lost" else "true"
    if key in ALWAYS or (spoil != "lost" and f"{key}?" in ALWAYS):
        with pytest.raises(
            RecordError, match=rf"mine\.json: is damaged: .*{last} must be .*, got {got}; regenerate it"
        ):
            record.read(path)
    else:
        assert record.read(path)["law"] == "liang", "enough to make a law from"
    with pytest.raises(RecordError, match=rf"mine\.json: is damaged: .*{last} must be .*, got {got}; regenerate it"):
        record.read(path, whole=True)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("liang-whole", {"pipeline": "magic"}, 'pipeline must be one of albedo, profile, .*, got "magic"'),
        ("liang-whole", {"pipeline": ["x"]}, r"pipeline must be one line of printable text, .*, got \[\"x\"\]"),
        ("liang-whole", {"constants": {"a1": 3.0}}, r"constants\.a1 must be a table, got 3\.0; regenerate it"),
        ("liang-as-published", {"stages": []}, r"stages must be a table, got \[\]"),
        ("hazard", {"preset": "; rm x"}, r'preset must be quick or full, got "; rm x"'),
        ("reproduction", {"readings": {}}, r"readings must be a list, got {}"),
        ("reproduction", {"table1": ["skin"]}, r'table1\.0 must be a table, got "skin"'),
    ],
)
def test_each_pipeline_has_its_own_needs(tmp_path, name, change, words):
    path = changed(tmp_path, name, lambda content: content.update(change))
    with pytest.raises(RecordError, match=rf"mine\.json: is damaged: {words}"):
        record.read(path, whole=True)


@pytest.mark.parametrize(
    ("part", "key", "value", "words"),
    [
        ("crosscheck", "chi2", "much", r'crosscheck\.chi2 must be a number or null, got "much"'),
        ("crosscheck", "constants", {"b": 1.0}, r"crosscheck\.constants\.b must be a table, got 1\.0"),
        ("starts", "share_best", None, r"starts\.share_best must be a number, got null"),
        ("starts", "outcomes", [{}], r"starts\.outcomes\.0\.count must be a whole number, got nothing"),
    ],
)
def test_what_a_recipe_may_ask_for_is_whole_if_it_is_there(tmp_path, part, key, value, words):
    path = changed(tmp_path, "albedo-rational-diffuse", lambda content: content[part].update({key: value}))
    with pytest.raises(RecordError, match=rf"mine\.json: is damaged: {words}"):
        record.read(path, whole=True)
    path = changed(tmp_path, "albedo-rational-diffuse", lambda content: content.pop(part))
    assert record.read(path, whole=True)["law"] == "rational"


STRANGE = ["\x1b[31m", "\x00", "\x9b", "\u202e", "\u2066", "\ud800", "x" * 1001]
BREAKS = ["\n", "\r", "\r\n", "\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029"]


@pytest.mark.parametrize("place", ["title", "equations", "law", "a key"])
@pytest.mark.parametrize("strange", [*BREAKS, *STRANGE], ids=ascii)
def test_text_that_is_no_printable_line_is_refused(tmp_path, place, strange):
    """It would become a comment in code, and would be shown on a terminal."""

    def spoilt(content):
        if place == "a key":
            content["constants"][f"a{strange}"] = {"regenerated": 1.0}
        else:
            content[place] += f"{strange}import os"

    path = changed(tmp_path, "hazard", spoilt)
    with pytest.raises(
        RecordError, match=r"mine\.json: is (damaged: .*one line of printable text|not a record: .*surrogates)"
    ) as caught:
        record.read(path)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('"data_digest": "0"', r"data_digest must be 64 hexadecimal digits, got \"0\""),
        (
            '"constants": {"s0": {"regenerated": "1; evil()"}}',
            r'constants\.s0\.regenerated must be a number, got "1; ev',
        ),
        ('"constants": {"s0": {"regenerated": 1e400}}', r"is not a record: the number 1e400, beyond floating point"),
        (
            '"constants": {"s0": {"regenerated": 1, "model_error": "x"}}',
            r'model_error must be a number or null, got "x"',
        ),
        ('"constants": {"s0": {"regenerated": NaN}}', r"is not a record: NaN, which is no number"),
        ('"constants": {"s0": {"regenerated": ' + "9" * 5000 + "}}", r"is not a record: a whole number of 5000 digits"),
        ('"note": ' + "[" * 20 + "]" * 20, r"note.* must not nest deeper than 12 tables and lists"),
        ('"note": ' + "[" * 100_000 + "]" * 100_000, r"is not a record: "),
        ('"note": "' + "x" * MOST_JSON + '"', r"is not a record: more than 2097152 bytes"),
    ],
    ids=range(9),
)
def test_what_no_law_can_be_made_of_is_named(tmp_path, change, words):
    rest = json.dumps({"format": record.FORMAT, **NAMED, **({} if "constants" in change else {"constants": {}})})[1:]
    path = tmp_path / "mine.json"
    path.write_text("{" + rest[:-1] + ", " + change + "}")
    with pytest.raises(RecordError, match=rf"mine\.json: .*{words}") as caught:
        record.read(path)
    assert len(str(caught.value)) < 300 + len(str(tmp_path))


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("burley-whole", lambda c: c["quality"]["regenerated"]["rel"].pop(), "rel must be as long as quality.alpha"),
        ("burley-whole", lambda c: c["covariance"]["model"].pop(), "covariance.model must be a square matrix"),
        ("burley-whole", lambda c: c["covariance"]["names"].append("zz"), "names must be of its constants, got 'zz'"),
        ("burley-whole", lambda c: c["derived"]["value"].pop(), "derived.value must be as long as derived.alpha"),
        ("burley-whole", lambda c: c["quality"]["published"].pop("ks"), "quality.published.ks must be there"),
        ("hazard-refracting", lambda c: c["quality"]["by_index"]["rel"].pop(), "by_index.rel must be as long as .*.n"),
    ],
)
def test_lists_that_belong_together_are_of_one_length(tmp_path, name, change, words):
    with pytest.raises(RecordError, match=words):
        record.read(changed(tmp_path, name, change), whole=True)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("refracting", {"setting": {"n": 1.7}}, r"setting.n must be in \(1, 1.6\], as its indices are, got 1.7"),
        ("refracting", {"setting": {"n": 1.0}}, r"setting.n must be in \(1, 1.6\]"),
        ("refracting", {"indices": [None, 1.6]}, "indices must be a list of two numbers"),
        *(("forward", {"setting": {"g": g}}, rf"g must be in .*, as its cosines are, got {g:g}") for g in (0, 0.96)),
    ],
)
def test_what_a_law_of_many_indices_and_g_needs(tmp_path, name, change, words):
    """Its own index and g, of which it is exported, are among those."""

    def own(content):
        content |= {**change, "setting": {**content["setting"], **change.get("setting", {})}}

    with pytest.raises(RecordError, match=words):
        record.read(changed(tmp_path, f"hazard-{name}", own))


def test_records_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(RecordError, match=r"gone\.json: there is no such record; `profilefit regenerate` makes them"):
        record.read(tmp_path / "gone.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RecordError, match=r"binary\.json: is not a record"):
        record.read(tmp_path / "binary.json")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(RecordError, match=r"folder\.json: cannot be read"):
        record.read(tmp_path / "folder.json")


@pytest.mark.parametrize("damage", ["missing", "empty", "text", "cut short", "a byte flipped"])
def test_damaged_arrays_are_named(tmp_path, damage):
    path = record.write(tmp_path, "mine", CONTENT, {"noise": np.random.default_rng(0).standard_normal(1000)})
    file = path.with_suffix(".npz")
    whole = file.read_bytes()
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 0xFF
    pieces = {
        "empty": b"",
        "text": b"no arrays",
        "cut short": whole[: len(whole) // 2],
        "a byte flipped": bytes(flipped),
    }
    file.unlink()
    if damage in pieces:
        file.write_bytes(pieces[damage])
    words = "are missing; regenerate it" if damage == "missing" else r"is damaged \(.*\); regenerate it"
    with pytest.raises(RecordError, match=rf"mine\.npz: .*{words}"):
        record.read_arrays(path)


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


def test_digest_tells_numbers_apart():
    a, b = np.arange(4.0), np.array([1.0, 2.0])
    assert record.digest(a, b) == record.digest(a[::-1][::-1], b)
    assert record.digest(a, b) != record.digest(a, b + 1e-15)
    assert len(record.digest()) == 64


def test_versions_name_what_decides_the_numbers():
    assert {"profilefit", "jax", "jaxlib", "optimistix", "emcee", "numpy", "scipy"} == set(record.versions())


def test_a_record_error_is_an_input_error():
    assert issubclass(RecordError, InputError)
    assert json.loads(json.dumps(record.plain({"a": np.nan}))) == {"a": None}
