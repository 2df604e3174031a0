"""The file that is handed on: complete, alone, and what the law is."""

import hashlib
import json
import subprocess
import sys

import moderngl
import numpy as np
import pytest

from profilefit import catalogue
from profilefit.errors import InputError
from profilefit.inventory import find
from profilefit.shader.context import full_screen, program
from profilefit.shader.export import LANGUAGES, TARGETS, export

FITS = catalogue.fits_folder()
MAIN = """
out vec4 made;
void main() {
    made.xy = vec2(hazard_profile(0.5, 0.9, 2.0), hazard_cdf(0.5, 0.9, 2.0));
    made.zw = vec2(hazard_sample(0.5, 0.9, 2.0), hazard_alpha(0.8));
}
"""


def drawn(context, fragment):
    """The four numbers that a fragment shader makes."""
    target = context.simple_framebuffer((1, 1), components=4, dtype="f4")
    target.use()
    full_screen(context, program(context, "exported", fragment)).render(moderngl.TRIANGLES, vertices=3)
    return np.frombuffer(target.read(components=4, dtype="f4"), np.float32)


def expected(law) -> list[float]:
    sampler = law.samplers["two steps"]
    return [law.profile(0.5, 0.9, 2.0), law.cdf(0.5, 0.9, 2.0), sampler.sample(0.5, 0.9, 2.0), law.albedo.alpha(0.8)]


@pytest.mark.parametrize(("lang", "head"), [("glsl", "#version 330\n"), ("glsl-es", "#version 300 es\n")])
def test_an_exported_file_is_all_that_a_shader_needs(context, lang, head):
    named = find("hazard-diffuse", FITS)
    made = drawn(context, head + export(named, FITS, lang) + MAIN)
    np.testing.assert_allclose(made, expected(named.law), rtol=1e-5)


def test_the_python_file_needs_numpy_and_nothing_else(tmp_path):
    named = find("hazard-diffuse", FITS)
    (tmp_path / "hazard.py").write_text(export(named, FITS, "python"))
    code = """
import sys, hazard as h
print([float(v) for v in (h.hazard_profile(0.5, 0.9, 2.0), h.hazard_cdf(0.5, 0.9, 2.0), h.hazard_sample(0.5, 0.9, 2.0),
                          h.hazard_alpha(0.8))], 'profilefit' in sys.modules)
"""
    ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    numbers, imported = ran.stdout.strip().rsplit(" ", 1)
    assert imported == "False"
    np.testing.assert_allclose(json.loads(numbers), expected(named.law), rtol=1e-9)


@pytest.mark.parametrize("lang", [lang for lang in LANGUAGES if lang != "json"])
def test_every_constant_stands_there_with_its_errors_and_the_record_is_named(lang):
    named = find("hazard-n1.4", FITS)
    text = export(named, FITS, lang)
    content = json.loads((FITS / "hazard-n1.4.json").read_text())
    for name, constant in content["constants"].items():
        line = next(line for line in text.splitlines() if f"hazard_{name} =" in line)
        assert str(constant["regenerated"]) in line
        assert f"+- {constant['jackknife_error']:.2g} (jackknife)" in line
        assert f"+- {constant['statistical_error']:.2g} (photons)" in line
    for part in ("hazard_map_b", "pencil beam", "n = 1.4", content["data_digest"], "1/length^2", "from 0.04 to 0.999"):
        assert part in text
    assert hashlib.sha256((FITS / "hazard-n1.4.json").read_bytes()).hexdigest() in text
    assert "LAW_" not in text
    assert TARGETS[lang] in text.splitlines()[1]
    assert text.isascii()


def test_data_hold_the_same(tmp_path):
    made = json.loads(export(find("hazard-n1.4", FITS), FITS, "json"))
    content = json.loads((FITS / "hazard-n1.4.json").read_text())
    assert made["constants"] == {name: one["regenerated"] for name, one in content["constants"].items()}
    assert made["setting"] == {"illumination": "searchlight", "n": 1.4, "g": 0.0}
    errors = made["records"]["hazard-n1.4"]["errors"]
    assert {"statistical_error", "discretisation_error", "model_error"} <= set(errors["a0"])
    assert errors["a0"]["statistical_error"] == content["constants"]["a0"]["statistical_error"]
    assert set(made["map"]) == {"entered", "b", "c", "d"}
    assert set(made["records"]) == {"hazard-n1.4", "albedo-rational-n1.4"}


def test_printed_constants_name_their_source_and_claim_no_error():
    text = export(find("burley", FITS, "published"), FITS)
    assert "Pixar Technical Memo 15-04" in text
    line = next(line for line in text.splitlines() if "burley_s0 =" in line)
    assert line == "const float burley_s0 = 1.85;"


def test_a_map_alone_is_a_file_too():
    text = export(find("albedo-rational", FITS), FITS, "python")
    names: dict = {}
    exec(text, names)
    law = catalogue.albedo_law("rational")
    np.testing.assert_allclose(
        names["rational_alpha"](np.array([0.0, 0.3, 1.0])), law.alpha([0.0, 0.3, 1.0]), atol=1e-9
    )
    np.testing.assert_allclose(names["rational_map_reflectance"](0.7), law.reflectance(0.7), rtol=1e-9)


def test_a_printed_map_names_its_own_source():
    assert "equation (8)" in export(find("albedo liang", FITS, "published"), FITS)


def test_two_media_share_a_shader_and_each_may_be_included_twice(context):
    skin, wax = find("hazard-diffuse", FITS), find("hazard-n1.4", FITS)
    texts = [export(skin, FITS, name="skin"), export(wax, FITS, name="wax"), export(skin, FITS, name="skin")]
    head = "#version 330\n" + "".join(texts)
    calls = "skin_profile(0.5, 0.9, 2.0), wax_profile(0.5, 0.9, 2.0)"
    made = drawn(context, head + f"out vec4 made;\nvoid main() {{ made = vec4({calls}, 0.0, 0.0); }}")
    np.testing.assert_allclose(made[:2], [one.law.profile(0.5, 0.9, 2.0) for one in (skin, wax)], rtol=1e-5)


def test_what_cannot_be_exported_is_named():
    with pytest.raises(InputError, match=r"lang must be one of glsl, hlsl, glsl-es, python, json, got 'wgsl'"):
        export(find("hazard", FITS), FITS, "wgsl")
    with pytest.raises(InputError, match=r"map or record, got 'hazzard'; did you mean hazard"):
        find("hazzard", FITS)
    with pytest.raises(InputError, match=r"record 'reproduction' holds no law of a fit that converged"):
        find("reproduction", FITS)
