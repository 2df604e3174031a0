"""The common text in numpy and HLSL, and what is not common."""

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.shader.languages import translated

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
    names = {}
    exec(translated(TEXT, "python"), names)
    x = np.array([0.5, 3.0])
    given = x.copy()
    got = names["P_value"](x, names["P_shape"](np.array(0.25)))
    np.testing.assert_allclose(got, [4.0 + 0.0025, -np.exp(0.5)], rtol=1e-15)
    np.testing.assert_array_equal(x, given)


def test_hlsl_has_its_own_constants_and_keeps_off_its_own_words():
    lines = translated(TEXT, "hlsl").splitlines()
    assert "static const float P_scale = 1e-2; // a line" in lines
    assert "    s.linear_ = P_scale * alpha;" in lines
    assert translated(TEXT, "glsl") == TEXT


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
        translated(f"float P_f(float x) {{\n    {line}\n}}\n", "python")


def test_an_unknown_language_is_an_error():
    with pytest.raises(InputError, match="lang must be one of glsl, hlsl, python, got 'wgsl'"):
        translated(TEXT, "wgsl")
