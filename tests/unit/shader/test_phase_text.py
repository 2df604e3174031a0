"""The text of a phase function is that phase function: in float64, in float32 by OpenGL, and it compiles everywhere."""

import json

import numpy as np
import pytest

from mcml_sim.media.phase import FournierForand, HenyeyGreenstein, Isotropic, Mixture, from_table
from profilefit.errors import InputError
from profilefit.recipes.kinds.phase import named
from profilefit.shader.check.shader_law import _Pass
from profilefit.shader.law_file import LANGUAGES
from profilefit.shader.phase_text import export_phase, phase_text

RECORD = named("petzold")
SEA = RECORD.phase()
PHASES = pytest.mark.parametrize(
    "phase",
    [SEA, HenyeyGreenstein(0.9), Isotropic(), Mixture((0, 0.4, 0.6), (SEA, HenyeyGreenstein(-0.5), Isotropic()))],
    ids=["sea", "one", "isotropic", "mixture"],
)
OFF = np.append(0.0, np.geomspace(1e-7, 2.0, 4095))
XI = (np.arange(4096) + 0.5) / 4096
DRAW = """#version 330
{text}
uniform sampler2D arguments;
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    found = vec4(phase_pdf(q.x), phase_sample(q.y), 0.0, 0.0);
}}
"""


def functions(text):
    names: dict = {}
    exec(text, names)
    return names


@PHASES
def test_float64(phase):
    made = functions(phase_text(phase, "python"))
    np.testing.assert_allclose(made["phase_pdf"](OFF), phase.pdf(1 - OFF) + 0 * OFF, rtol=1e-8)
    # Terms one after the other, the light of each from its straight back to its straight on.
    drawn = np.sort(made["phase_sample"](XI))
    np.testing.assert_allclose(1 - phase.invert(1 - drawn), XI, atol=1.5 / XI.size)


@PHASES
def test_float32_on_opengl(context, phase):
    run = _Pass(context, "phase", DRAW.format(text=phase_text(phase)), "f4")
    density, drawn, *_ = run(OFF, XI, 0.0, 0.0)
    off = OFF.astype(np.float32).astype(float)
    exact = functions(phase_text(phase, "python"))
    np.testing.assert_allclose(density, exact["phase_pdf"](off), rtol=3e-5)
    share = 1 - phase.invert(1 - np.sort(drawn))
    np.testing.assert_allclose(share, XI, atol=1.5 / XI.size + 1e-6)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_a_whole_file(lang):
    text = export_phase(RECORD, lang)
    assert RECORD.content["data_digest"] in text
    if lang == "json":
        assert from_table(json.loads(text)["phase"]) == SEA
        return
    assert str(RECORD.content["constants"]["4-terms.held.w1"]["regenerated"]) in text
    assert "(jackknife)" in text
    assert "root mean square of ln(p / table) 0.068" in text
    if lang == "python":
        assert functions(text)["petzold_pdf"](0.5) == pytest.approx(SEA.pdf(0.5))
    assert "sea_pdf" in export_phase(RECORD, lang, "sea")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: phase_text(FournierForand(1.1, 3.6)),
            "phase must be terms of Henyey and Greenstein to become a shader",
        ),
        (lambda: phase_text(Mixture((0.2,) * 5, (SEA.phases[0],) * 5)), "at most 4 terms to become a shader, got 5"),
    ],
)
def test_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
