"""`profilefit export` as a user meets it: what it writes, what it refuses, and in how many lines."""

from pathlib import Path

from profilefit import catalogue
from profilefit.inventory import find
from profilefit.shader.export import export

FITS = catalogue.fits_folder()


def test_prints_the_text_or_writes_it(command):
    text = export(find("hazard-diffuse", FITS), FITS, "hlsl")
    assert command("export", "hazard-diffuse", "--lang", "hlsl") == (0, text, "")
    assert command("export", "hazard-diffuse", "--lang", "hlsl", "--out", "hazard.hlsl") == (0, "", "")
    assert Path("hazard.hlsl").read_text() == text


def test_a_law_with_constants_of_ones_choice(command):
    _, published, _ = command("export", "burley", "--constants", "published")
    _, regenerated, _ = command("export", "burley")
    assert "burley_s0 = 1.85;" in published
    assert "record burley-whole" in regenerated
    assert "record burley-whole" not in published


def test_bad_input_is_one_line_and_writes_nothing(command, tmp_path):
    for words, told in (
        (("hazzard",), "profilefit: name must be a law or a record, one of liang, burley, "),
        (("hazard", "--lang", "wgsl"), "profilefit: lang must be one of glsl, hlsl, glsl-es, python, json, got 'wgsl'"),
        (("hazard", "--constants", "old"), "profilefit: constants must be one of regenerated, "),
        (("hazard", "--out", "no/such/folder.glsl"), "profilefit: cannot write no/such/folder.glsl: No such file"),
        (("hazard", "--fits", "nowhere", "--constants", "x.json"), "profilefit: x.json: there is no such record"),
    ):
        status, out, err = command("export", *words)
        assert (status, out) == (2, "")
        assert err.startswith(told)
        assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
