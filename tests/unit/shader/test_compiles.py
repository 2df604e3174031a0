"""Every text compiles: on this machine's OpenGL as GLSL 3.30 and GLSL ES 3.00, and as HLSL where a compiler is."""

import shutil
import subprocess
from dataclasses import replace
from functools import partial

import pytest

from profilefit.errors import ShaderError
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.diffusion import BeamDiffusion
from profilefit.recipes import catalogue
from profilefit.scenes.fur.law import strand_text
from profilefit.scenes.sea.source import blur_text, segment_text
from profilefit.shader import emit
from profilefit.shader.context import program
from profilefit.shader.phase_text import phase_text
from tests.fixtures import refused, slow
from tests.unit.shader import test_stack_text as stacks
from tests.unit.shader.test_other_texts import BLURS, SEA, C

FITS = catalogue.fits_folder()
ALL = [*catalogue.profile_laws(FITS), *catalogue.albedo_laws(FITS)]
LAWS = {emit.prefix(one.law): one.law for one in ALL if not isinstance(one.law, BeamDiffusion)}
# Texts that are no law's, and calls of all their functions.
OTHERS = {
    "fur": (
        strand_text,
        "fur_shadow(u.x, u.y) + fur_shared(u.x, u.y, u.z, u.x) + fur_visibility(u.x, u.y, u.z) + fur_slice(u.x, u.y)"
        " + fur_swept(u.x, u.y, u.z, u.x, u.y, u.z)",
    ),
    "segment": (segment_text, "sea_segment_integral(u.x, u.y, u.z, u.x, u.y) + sea_segment_between(u.x, u.y, u.z)"),
    "blur": (
        lambda lang: blur_text(BLURS, C, lang),
        "sea_blur_unscattered(u.x) + sea_blur_weight1(u.x) + sea_blur_sigma3(u.x) + sea_blur_share(u.y, u.x)"
        " + sea_blur_mtf(u.z, u.x)",
    ),
    "phase": (lambda lang: phase_text(SEA, lang), "phase_pdf(u.x) + phase_sample(u.y)"),
}
STACK = " + ".join(
    [
        *(f"{{name}}_{one}(u.x, u.y, u.z)" for one in ("profile", "cdf", "sample", "pdf")),
        *(f"{{name}}_{one}(u.x, {{name}}_shape(u.y, u.z))" for one in ("density", "cumulated", "radius_density")),
        "{name}_radius(u.x, {name}_shape(u.y, u.z)) + {name}_reflectance({name}_shape(u.y, u.z))",
        "{name}_total(u.y, u.z) + {name}_once_radiance(u.y, u.z, u.x, u.z, u.y)",
    ]
)
NO_LAWS = OTHERS | {label: (partial(stacks.whole, label), STACK.format(name="stack")) for label in stacks.LAWS}
every = pytest.mark.parametrize("name", [*LAWS, *OTHERS, *stacks.LABELS])
HEADS = {"glsl": "#version 330\n", "glsl-es": "#version 300 es\nprecision highp float;\n"}
VERTEX = "void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }"
MAIN = "uniform vec3 u;\nout vec4 made;\nvoid main() {{ made = vec4({calls}); }}\n"
HLSL_MAIN = "float4 main(float3 u : TEXCOORD0) : SV_TARGET {{ float y = {calls}; return float4(y, y, y, y); }}\n"
HLSL_COMPILER = "glslangValidator"  # Debian's glslang-tools


def text(name, lang="glsl"):
    if name in NO_LAWS:
        return NO_LAWS[name][0](lang)
    law = LAWS[name]
    return emit.map_text(law, lang) if isinstance(law, AlbedoLaw) else emit.law_text(law, lang)


def calls(name):
    """Every function that the contract of the texts names."""
    if name in NO_LAWS:
        return NO_LAWS[name][1]
    if isinstance(LAWS[name], AlbedoLaw):
        return f"{name}_alpha(u.x) + {name}_map_reflectance(u.y)"
    lengths = [f"{name}_{one}(u.x, u.y, u.z)" for one in ("profile", "cdf", "sample", "pdf")]
    shape = f"{name}_shape(u.y)"
    scaled = [f"{name}_{one}(u.x, {shape})" for one in ("density", "cumulated", "radius", "radius_density")]
    return " + ".join([*lengths, *scaled, f"{name}_reflectance({shape})", f"{name}_alpha(u.x)"])


@pytest.mark.parametrize("head", HEADS)
@every
def test_glsl(context, name, head):
    fragment = HEADS[head] + 2 * text(name) + MAIN.format(calls=calls(name))
    program(context, name, fragment, HEADS[head] + VERTEX).release()


@pytest.mark.parametrize("head", HEADS)
def test_glsl_takes_two_laws_and_each_twice_but_no_prefix_for_two(context, head):
    both = text("burley") + text("hazard") + MAIN.format(calls=f"{calls('burley')} + {calls('hazard')}")
    vertex = HEADS[head] + VERTEX
    program(context, "twice", HEADS[head] + text("burley") + text("hazard") + both, vertex).release()
    other = emit.law_text(replace(LAWS["burley"], s0=3.0))
    with pytest.raises(ShaderError, match=r"shader 'mixed' does not compile, .*burley is included already"):
        program(context, "mixed", HEADS[head] + other + both, vertex)


@pytest.mark.parametrize("head", ["glsl", *slow("glsl-es")])
def test_glsl_takes_two_stacks_and_each_twice_but_no_prefix_for_two(context, head):
    vertex, two, three = HEADS[head] + VERTEX, "two layers", "three layers"
    texts = stacks.whole(two, name="heart") + text("hazard") + stacks.whole(three, name="skin")
    main = MAIN.format(calls=" + ".join([STACK.format(name="heart"), STACK.format(name="skin"), calls("hazard")]))
    program(context, "twice", HEADS[head] + 2 * texts + main, vertex).release()
    mixed = "".join(stacks.stack_text(stacks.LAWS[label]) for label in (two, three))
    with pytest.raises(ShaderError, match=r"shader 'mixed' does not compile, .*stack is included already"):
        program(context, "mixed", HEADS[head] + mixed + MAIN.format(calls="0.0"), vertex)


@every
def test_hlsl(tmp_path, name):
    """The text compiles, and all that is called; skipped where there is no compiler."""
    compiler = shutil.which(HLSL_COMPILER)
    if compiler is None:
        pytest.skip(f"{HLSL_COMPILER} is missing, which compiles HLSL; on Debian apt-get install glslang-tools")
    file = tmp_path / "made.hlsl"
    file.write_text(2 * text(name, "hlsl") + HLSL_MAIN.format(calls=calls(name)), encoding="utf-8")
    command = [compiler, "-D", "-S", "frag", "-e", "main", "-V", "-o", str(tmp_path / "made.spv"), str(file)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout


@pytest.mark.parametrize("name", ["hazard", *OTHERS])
def test_an_unknown_language_is_named(name):
    refused("lang must be one of glsl, hlsl, python, got 'wgsl'", text, name, "wgsl")
