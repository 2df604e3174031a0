"""The file that is handed on: complete, alone, and what the law is."""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
import pytest

from profilefit.errors import InputError, ShippedMap
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.shader import emit
from profilefit.shader.context import full_screen, program
from profilefit.shader.law_file import LANGUAGES, TARGETS, commented, export
from tests.fixtures import functions
from tests.unit.shader.test_other_texts import EXPORTERS

FITS = catalogue.fits_folder()
HAZARD, DIFFUSE = find("hazard", FITS), find("hazard-diffuse", FITS)
MAIN = """
out vec4 made;
void main() {
    made.xy = vec2(hazard_profile(0.5, 0.9, 2.0), hazard_cdf(0.5, 0.9, 2.0));
    made.zw = vec2(hazard_sample(0.5, 0.9, 2.0), hazard_alpha(0.8));
}
"""


def drawn(context, fragment):
    target = context.simple_framebuffer((1, 1), components=4, dtype="f4")
    target.use()
    full_screen(context, program(context, "exported", fragment)).render(moderngl.TRIANGLES, vertices=3)
    return np.frombuffer(target.read(components=4, dtype="f4"), np.float32)


def expected() -> list[float]:
    law = DIFFUSE.law
    sampler = law.samplers["two steps"]
    return [law.profile(0.5, 0.9, 2.0), law.cdf(0.5, 0.9, 2.0), sampler.sample(0.5, 0.9, 2.0), law.albedo.alpha(0.8)]


def line_of(text, name):
    return next(line for line in text.splitlines() if f"{name} =" in line)


def record(name):
    data = (FITS / f"{name}.json").read_bytes()
    return json.loads(data), hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize(("lang", "head"), [("glsl", "#version 330\n"), ("glsl-es", "#version 300 es\n")])
def test_an_exported_file_is_all_that_a_shader_needs(context, lang, head):
    np.testing.assert_allclose(drawn(context, head + export(DIFFUSE, FITS, lang) + MAIN), expected(), rtol=1e-5)


def test_the_python_file_needs_numpy_and_nothing_else(tmp_path):
    (tmp_path / "hazard.py").write_text(export(DIFFUSE, FITS, "python"))
    code = """
import sys, hazard as h
print([float(v) for v in (h.hazard_profile(0.5, 0.9, 2.0), h.hazard_cdf(0.5, 0.9, 2.0), h.hazard_sample(0.5, 0.9, 2.0),
                          h.hazard_alpha(0.8))], 'profilefit' in sys.modules)
"""
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    numbers, imported = ran.stdout.strip().rsplit(" ", 1)
    assert imported == "False"
    np.testing.assert_allclose(json.loads(numbers), expected(), rtol=1e-9)


@pytest.mark.parametrize("lang", [lang for lang in LANGUAGES if lang != "json"])
def test_every_constant_stands_there_with_its_errors_and_the_record_is_named(lang):
    text = export(HAZARD, FITS, lang)
    content, digest = record("hazard")
    for name, constant in content["constants"].items():
        line = line_of(text, f"hazard_{name}")
        assert str(constant["regenerated"]) in line
        assert f"+- {constant['jackknife_error']:.2g} (jackknife)" in line
        assert f"+- {constant['model_error']:.2g} (model)" in line
    parts = ("hazard_map_b", "pencil beam", "n = 1", "1/length^2", "from 0.04 to 0.999", content["data_digest"], digest)
    assert [part for part in parts if part not in text] == []
    assert "LAW_" not in text
    assert TARGETS[lang] in text.splitlines()[1]
    assert text.isascii()


def test_constants_at_an_index_have_the_errors_that_those_of_the_record_give_them():
    """By differences of each through the record's covariance."""
    named = find("hazard-refracting", FITS, n=1.2)
    text, law = export(named, FITS), named.law
    covariance = record("hazard-refracting")[0]["covariance"]
    names, matrix = covariance["names"], np.array(covariance["model"])
    here, values, step = law.text_constants(), law.constants(), 1e-6
    moved = [law.with_vector((name,), [values[name] + step]).text_constants() for name in names]
    for name, value in here.items():
        slopes = np.array([(one[name] - value) / step for one in moved])
        line = line_of(text, f"hazard_{name}")
        assert float(line.split()[4].rstrip(";")) == pytest.approx(value, rel=1e-11)
        error = re.search(r"\+- (\S+) \(model\)", line)
        assert float(error[1]) == pytest.approx(np.sqrt(slopes @ matrix @ slopes), rel=0.06)  # two digits are printed
    assert "n = 1.2" in text
    assert "fitted for every refractive index above 1 up to 1.6" in text


@pytest.mark.parametrize(
    ("name", "numbers"), [("hazard", "entered b c d"), ("hazard-refracting", "entered trapped once c d f")]
)
def test_data_hold_the_same(name, numbers):
    named = find(name, FITS)
    made = json.loads(export(named, FITS, "json"))
    assert made["constants"] == named.law.text_constants()
    assert made["setting"] == {"illumination": "searchlight", "n": named.setting.n, "g": 0.0}
    errors = made["records"][name]["errors"]
    assert {"statistical_error", "discretisation_error", "model_error"} <= set(errors["a0"])
    assert set(made["map"]) == set(numbers.split())
    assert set(made["records"]) == {name, name.replace("hazard", "albedo-rational")}
    if name == "hazard":
        constants = record(name)[0]["constants"]
        assert made["constants"] == {name: one["regenerated"] for name, one in constants.items()}
        assert errors["a0"]["model_error"] == constants["a0"]["model_error"]


def test_printed_constants_name_their_source_and_claim_no_error():
    text = export(find("burley", FITS, "published"), FITS)
    assert "Pixar Technical Memo 15-04" in text
    assert line_of(text, "burley_s0") == "const float burley_s0 = 1.85;"
    assert "equation (8)" in export(find("albedo liang", FITS, "published"), FITS), "a map's own source"


def test_a_map_alone_is_a_file_too():
    names = functions(export(find("albedo-rational", FITS), FITS, "python"))
    law, colour = catalogue.albedo_law("rational"), np.array([0.0, 0.3, 1.0])
    np.testing.assert_allclose(names["rational_alpha"](colour), law.alpha(colour), atol=1e-9)
    np.testing.assert_allclose(names["rational_map_reflectance"](0.7), law.reflectance(0.7), rtol=1e-9)


def test_two_media_share_a_shader_and_each_may_be_included_twice(context):
    skin, wax = DIFFUSE, find("hazard-refracting", FITS)
    texts = [export(skin, FITS, name="skin"), export(wax, FITS, name="wax"), export(skin, FITS, name="skin")]
    head = "#version 330\n" + "".join(texts)
    calls = "skin_profile(0.5, 0.9, 2.0), wax_profile(0.5, 0.9, 2.0)"
    made = drawn(context, head + f"out vec4 made;\nvoid main() {{ made = vec4({calls}, 0.0, 0.0); }}")
    np.testing.assert_allclose(made[:2], [one.law.profile(0.5, 0.9, 2.0) for one in (skin, wax)], rtol=1e-5)


def test_comments_are_comments_whatever_they_hold():
    lines = ["a\nb\rc\u2028d\x85e", "\x1b[31m é", "ends in \\", "ends in ??/ ", "\\", "", "coding: utf-7"]
    for mark in ("#", "//"):
        text = commented(lines, mark)
        told = text.splitlines()
        assert text.count("\n") == len(told) == 11
        assert all(line.startswith(mark) for line in told)
        assert text.replace("\n", "").isprintable()
        assert text.isascii()
        assert not any(line.endswith(("\\", "??/")) for line in told), "a preprocessor would join the next line to it"
    assert told[5:8] == ["// \\x1b[31m \\xe9", "// ends in", "// ends in"]


def test_the_first_two_lines_hold_nothing_from_outside():
    """There, a word of a comment changes the encoding in which Python reads a file (PEP 263)."""
    first = export(replace(HAZARD, constants="coding: utf-7"), FITS, "python").splitlines()[:4]
    assert not any("coding" in line for line in first[:2])
    assert "coding: utf-7" in first[3]


def test_constants_by_the_path_of_their_record_are_those_by_its_name():
    for name in ("hazard-diffuse", "burley-whole", "gaussians-6", "albedo-rational-refracting"):
        by_name = find(name, FITS)
        by_path = find("rational" if name.startswith("albedo") else by_name.name, FITS, str(FITS / f"{name}.json"))
        assert export(by_path, FITS) == export(by_name, FITS)
    text = export(find("liang", FITS, str(FITS / "liang-whole.json")), FITS)
    assert "const float liang_g1 = 1.504; // as printed" in text
    assert "(jackknife)" in line_of(text, "liang_a1")


def test_the_lines_of_the_map_are_marked():
    head = [line for line in export(HAZARD, FITS).splitlines() if line.startswith("//")]
    law, of_map = ([line for line in head if line.startswith(f"// {word}: ")] for word in ("law", "map"))
    for lines, name in ((law, "hazard"), (of_map, "albedo-rational")):
        assert lines[0].startswith(f"// {lines[0][3:6]}: record {name}: ")
        assert lines[-1].endswith(record(name)[1])
    assert not [line for line in head if "sha256" in line and line not in law + of_map]


def test_a_map_that_the_folder_lacks_is_said_to_have_come_with_the_installation(tmp_path):
    shutil.copy(FITS / "hazard.json", tmp_path)
    with pytest.warns(ShippedMap):
        named = find("hazard", tmp_path)
    assert "// map: this record came with profilefit: the folder of the law's has none" in export(named, tmp_path)
    told = json.loads(export(named, tmp_path, "json"))["records"]
    came = {name: (one["of"], one["came_with_profilefit"]) for name, one in told.items()}
    assert came == {"hazard": ("law", False), "albedo-rational": ("map", True)}
    assert "came with profilefit" not in export(HAZARD, FITS)


@pytest.mark.parametrize("name", ["hazard", "quantile", "burley", "gaussians", "liang", "dipole", "better_dipole"])
def test_the_clamps_are_those_that_it_states(name):
    named = find(name, FITS)
    text, start = export(named, FITS, "python"), emit.prefix(named.law)
    stated = next(line for line in text.splitlines() if line.startswith("# clamps: "))
    names = functions(text)
    profile, sample, cdf = (names[f"{start}_{word}"] for word in ("profile", "sample", "cdf"))
    assert "R_d within 1e-6 mfp of the source to that at 1e-6 mfp" in stated
    assert profile(0.0, 0.9, 2.0) == profile(1e-7, 0.9, 2.0) == profile(2e-6, 0.9, 2.0) != profile(4e-6, 0.9, 2.0)
    if "xi to 1 - 2^-24" in stated:
        assert np.isfinite(sample(1.0, 0.9, 1.0))
        np.testing.assert_allclose(sample(1.0, 0.9, 1.0), sample(1 - 2.0**-24, 0.9, 1.0), rtol=1e-8)
    if "r to 1e8 mfp" in stated:
        assert cdf(1e30, 0.9, 1.0) == cdf(1e8, 0.9, 1.0)
    if "alpha to at least 1e-6" in stated:
        assert cdf(0.5, 0.0, 1.0) == cdf(0.5, 1e-6, 1.0) != cdf(0.5, 1e-3, 1.0)


NO_FILES = {
    ("wgsl",): "lang must be one of glsl, hlsl, glsl-es, python, json, got 'wgsl'",
    ("json", "fog"): "name must be left out where lang is json, .*, got 'fog'",
    ("glsl", "gl_fog"): "name must be letters, digits",
}


@pytest.mark.parametrize("given", NO_FILES, ids="-".join)
@pytest.mark.parametrize("exporter", ["law", *EXPORTERS])
def test_what_no_file_can_be_is_refused_by_name(exporter, given):
    with pytest.raises(InputError, match=NO_FILES[given]):
        EXPORTERS.get(exporter, partial(export, HAZARD, FITS))(*given)
