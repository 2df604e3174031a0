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


def test_a_medium_by_a_name_of_its_own(command):
    _, text, _ = command("export", "hazard", "--name", "skin")
    assert "float skin_profile(float r" in text
    assert "// skin_profile(r, alpha, mfp)" in text
    assert "hazard_" not in text


def test_what_was_only_printed_needs_no_word_for_it(command):
    for name in ("burley_diffuse_mfp", "van_de_hulst", "chiang"):
        status, text, _ = command("export", name)
        assert status == 0
        assert text.startswith(f"// {name}, published: ")


def test_bad_input_is_one_line_and_writes_nothing(command, tmp_path):
    for words, told in (
        (("hazzard",), "profilefit: name must be a law, map or record, got 'hazzard'; did you mean hazard"),
        (("gaussians:3",), "profilefit: --constants must be the path of a record (.json): "),
        (("hazard", "--name", "gl_skin"), "profilefit: name must be letters, digits and single underscores"),
        (("hazard", "--name", "skin", "--lang", "json"), "profilefit: name must be left out where lang is json"),
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
