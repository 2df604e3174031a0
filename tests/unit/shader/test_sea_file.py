"""The texts of light in water are the library's functions: in float64, on OpenGL, and they compile everywhere."""

import json

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes.sea import law
from profilefit.scenes.sea.source import blur_text, export_blur, segment_text, source
from profilefit.shader.check.shader_law import _Pass
from profilefit.shader.law_file import LANGUAGES
from tests.unit.shader.test_phase_text import functions

LOBES = ((0.7, 0.95), (0.3, 0.6))
C, OMEGA, DEPTH = (0.5, 0.2, 0.4), (0.3, 0.6, 0.8), 4.0
BLURS = [law.water_gaussians(omega, c * DEPTH, LOBES, 3) for omega, c in zip(OMEGA, C, strict=True)]
DRAW = """#version 330
{text}
uniform sampler2D arguments;
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    found = vec4(sea_blur_share(q.x, 2.0), sea_blur_mtf(q.y, 1.0), sea_segment_integral(0.4, 1.0, 0.5, q.z, 3.0), 0.0);
}}
"""
WAY = np.append(0.0, np.geomspace(1e-4, 1e3, 4095))  # [m]


def test_the_segment_in_float64():
    random = np.random.default_rng(2)
    c, s0, t0, t1 = random.uniform(0.01, 2.0, (4, 1000))
    m = np.append(-1.0, random.uniform(-1.0, 1.0, 999))
    made = functions(segment_text("python"))
    np.testing.assert_allclose(
        made["sea_segment_integral"](c, s0, t0, m, t1), law.segment_integral(c, s0, t0, m, t1), rtol=1e-8
    )
    np.testing.assert_allclose(made["sea_segment_between"](s0, t0, t1), law.segment_between(s0, t0, t1), rtol=1e-8)


@pytest.mark.parametrize("channel", range(3))
def test_the_blur_in_float64(channel):
    made, blur, c = functions(blur_text(BLURS, C, "python")), BLURS[channel], C[channel]
    np.testing.assert_allclose(made["sea_blur_share"](WAY, float(channel)), blur.share(c * WAY), rtol=1e-7)
    np.testing.assert_allclose(made["sea_blur_mtf"](WAY, float(channel)), blur.mtf(WAY / c), rtol=1e-9)
    sigma = made["sea_blur_sigma2"](float(channel))
    assert sigma == pytest.approx(np.sqrt(blur.variances[1]) / c, rel=1e-10)
    assert made["sea_blur_weight2"](float(channel)) == pytest.approx(blur.weights[1], rel=1e-10)
    assert made["sea_blur_unscattered"](float(channel)) == pytest.approx(np.exp(-c * DEPTH), rel=1e-10)


def test_in_float32_on_opengl(context):
    text = segment_text("glsl") + blur_text(BLURS, C, "glsl")
    m = np.linspace(-1.0, 1.0, WAY.size).astype(np.float32).astype(float)
    share, mtf, segment, _ = _Pass(context, "sea", DRAW.format(text=text), "f4")(WAY, WAY, m, 0.0)
    np.testing.assert_allclose(share, BLURS[2].share(C[2] * WAY), rtol=3e-6)
    np.testing.assert_allclose(mtf, BLURS[1].mtf(WAY / C[1]), rtol=3e-6)
    np.testing.assert_allclose(segment, law.segment_integral(0.4, 1.0, 0.5, m, 3.0), rtol=3e-6)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_whole_files(lang):
    segment, blur = source("sea-segment", lang), export_blur(BLURS, C, DEPTH, lang)
    if lang == "json":
        assert json.loads(segment)["law"] == "sea-segment"
        green = json.loads(blur)["numbers"]["green"]
        assert green["unscattered"] + sum(green["weight"]) == pytest.approx(BLURS[1].mtf(0.0))
        return
    assert "sea_segment_integral(c, s0, t0, m, t1)" in segment
    assert "after 4 m of water" in blur
    assert "attenuation of red, green, blue 0.5, 0.2, 0.4 [1/m]" in blur
    assert "sea_" not in source("sea-segment", lang, "fog")
    assert "fog_share(" in export_blur(BLURS, C, DEPTH, lang, "fog")
    if lang == "python":
        assert functions(segment)["sea_segment_integral"](1.0, 0.0, 0.0, -1.0, 2.0) == 2.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: blur_text(BLURS[:2], C), "blurs must be three of one number of Gaussians, .*, got 3, 3"),
        (lambda: blur_text([], C), "blurs must be three .*, got none"),
        (
            lambda: blur_text([*BLURS[:2], law.water_gaussians(0.5, 1.0, LOBES, 2)], C),
            "blurs must be three of one number of Gaussians, .*, got 3, 3, 2",
        ),
    ],
)
def test_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
