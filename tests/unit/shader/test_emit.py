"""From a law to its text, and to numpy and HLSL: constants, prefixes, blocks; laws without one, lines that are none."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import profilefit
from profilefit.errors import InputError
from profilefit.laws.gaussians import law_class
from profilefit.recipes import catalogue
from profilefit.shader import emit
from tests.fixtures import functions

BURLEY = profilefit.load("burley", "published")
OTHER_MAP = replace(BURLEY, albedo=catalogue.albedo_law("chiang", "published"))
DECLARED = re.compile(r"^const float (\w+) = (\S+);", re.MULTILINE)


def gaussians(count):
    kind = law_class(count)
    return kind(setting=BURLEY.setting, albedo=BURLEY.albedo, **kind.start())


def test_a_literal_has_a_point_and_twelve_digits():
    literals = {0.0: "0.0", 2: "2.0", -1.5: "-1.5", 1 / 3: "0.333333333333", 1234567.0: "1234567.0"}
    literals |= {1e-25: "1.0e-25", -2.5e8: "-2.5e+08"}
    assert {value: emit.literal(value) for value in literals} == literals


def test_every_constant_of_a_law_stands_in_its_text_once():
    text = emit.law_text(BURLEY, remarks={"s0": "a remark"})
    declared = DECLARED.findall(text)
    names = [name for name, _ in declared if name.startswith("burley_")]
    of_map = [f"map_{name}" for name in BURLEY.albedo.constants()]
    own = ["MAX_REFLECTANCE", *of_map, "power", *BURLEY.constants()]
    assert names == [f"burley_{name}" for name in own]
    assert dict(declared)["burley_s0"] == "1.85"
    assert "const float burley_s0 = 1.85; // a remark\n" in text


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_a_block_stands_once_for_each_number(count):
    text, name = emit.law_text(gaussians(count)), f"gaussians{count}"
    assert emit.prefix(gaussians(count)) == name
    assert re.findall(r"float rate(\d+);", text) == [str(i) for i in range(1, count + 1)]
    assert re.findall(r"float level(\d+) = level(\d+)", text) == [(str(i), str(i - 1)) for i in range(2, count + 1)]
    assert not re.search("//%|@", text)


@pytest.mark.parametrize("lang", ["glsl", "hlsl", "python"])
def test_a_prefix_replaces_every_placeholder(lang):
    for text in (emit.law_text(BURLEY, lang, "skin_2"), emit.map_text(BURLEY.albedo, lang, "skin_2")):
        assert not re.search("LAW_|burley_|rational_", text)
        assert "skin_2_alpha(" in text


def test_laws_of_other_prefixes_live_in_one_text():
    laws = {"first": BURLEY, "second": replace(BURLEY, s0=3.0), "third": gaussians(2)}
    texts = {name: emit.law_text(law, "python", name) for name, law in laws.items()}
    together = functions("".join(texts.values()))
    for name, text in texts.items():
        assert together[f"{name}_profile"](0.3, 0.8, 1.0) == functions(text)[f"{name}_profile"](0.3, 0.8, 1.0)
    assert together["first_profile"](0.3, 0.8, 1.0) != together["second_profile"](0.3, 0.8, 1.0)


FINITE, PREFIX = "constants of a shader must be finite, got", "name must be letters, digits and single underscores"
HAS = r"law must be one that has a shader source \(liang"


@pytest.mark.parametrize(
    ("message", "make"),
    [
        *((f"{FINITE} {value}", partial(emit.law_text, replace(BURLEY, s0=value))) for value in (np.nan, np.inf)),
        *(
            (PREFIX, partial(emit.law_text, BURLEY, name=name))
            for name in (" ", "my law", "2nd", "a__b", "a_", "gl_skin", "PF_skin", "LAW")
        ),
        (rf"{HAS}, burley.*hazard, quantile\), got Rational", partial(emit.law_text, BURLEY.albedo)),
        (rf"{HAS}, rational.*got Burley", partial(emit.map_text, BURLEY)),
        ("albedo of Burley must be a Rational map to become a shader, got Chiang", partial(emit.law_text, OTHER_MAP)),
    ],
)
def test_what_has_no_text_is_named(message, make):
    with pytest.raises(InputError, match=message):
        make()


TEXT = """
#ifndef P_STEPS
#define P_STEPS 3 // of doubling
#endif
const float P_scale = 1e-2; // a line
struct P_Shape {
    float linear; // [-]
    float other;
};

// what it does
P_Shape P_shape(float alpha) {
    P_Shape s;
    s.linear = P_scale * alpha;
    s.other = max(alpha,
        0.5);
    return s;
}

float P_value(float x, P_Shape s) {
    float y = x;
    bool small = x < 1.0;
    for (int i = 0; i < P_STEPS; ++i) {
        float twice = 2.0 * y;
        y = twice;
    }
    y += s.linear;
    return PF_SELECT(small, y, -exp(s.other)); // a choice
}
"""


def test_numpy_computes_what_the_text_says():
    names, x = functions(emit.translated(TEXT, "python")), np.array([0.5, 3.0])
    got = names["P_value"](x, names["P_shape"](np.array(0.25)))
    np.testing.assert_allclose(got, [4.0 + 0.0025, -np.exp(0.5)], rtol=1e-15)
    np.testing.assert_array_equal(x, [0.5, 3.0])


def test_hlsl_has_its_own_constants_and_keeps_off_its_own_words():
    lines = emit.translated(TEXT, "hlsl").splitlines()
    assert "static const float P_scale = 1e-2; // a line" in lines
    assert "    s.linear_ = P_scale * alpha;" in lines
    assert emit.translated(TEXT, "glsl") == TEXT


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("if (x > 0.0) {", "if"),
        ("while (x > 0.0) {", "while"),
        ("for (int i = 1; i < 4; ++i) {", "for"),
        ("float y = x > 0.0 ? 1.0 : 2.0;", "'?'"),
        ("bool y = x > 0.0 && x < 1.0;", "'&&'"),
        ("float y = 1 / 2.0;", "'1'"),
        ("float y = 2.0f;", "'0f'"),
        ("float y = mix(x, x, 0.5);", "'mix'"),
        ("vec2 y = vec2(x, x);", "'vec2'"),
        ("y++;", "y\\+\\+"),
        ("discard;", "discard"),
    ],
)
def test_a_line_that_is_not_common_is_an_error(line, named):
    with pytest.raises(InputError, match=f"what GLSL, HLSL and numpy share.*{named}"):
        emit.translated(f"float P_f(float x) {{\n    {line}\n}}\n", "python")
