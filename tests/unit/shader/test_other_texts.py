"""Texts that are no law's are the library's functions: of phase functions, of light in water, of cones of fur."""

import json
from functools import partial

import numpy as np
import pytest

from benchmarks.fur_feet import shared_shadow
from mcml_sim.media.phase import FournierForand, HenyeyGreenstein, Isotropic, Mixture, from_table
from profilefit.recipes.kinds.phase import named
from profilefit.scenes.fur import law, truth
from profilefit.scenes.fur.law import source as fur_source
from profilefit.scenes.fur.law import strand_text
from profilefit.scenes.sea import law as water
from profilefit.scenes.sea.source import blur_text, export_blur, segment_text
from profilefit.scenes.sea.source import source as sea_source
from profilefit.shader.check.shader_law import _Pass
from profilefit.shader.law_file import LANGUAGES
from profilefit.shader.phase_text import phase_text
from profilefit.shader.phase_text import source as phase_source
from profilefit.studies.stability.cells import RoundedText
from tests.fixtures import functions, refused

DRAW = """#version 330
{text}
uniform sampler2D arguments;
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    {calls}
}}
"""


def on_opengl(context, text, calls):
    """Calls of a text's functions with four arguments, q; they make four results, `found`."""
    return _Pass(context, "text", DRAW.format(text=text, calls=calls), "f4")


RECORD = named("petzold")
SEA = RECORD.phase()
PHASES = pytest.mark.parametrize(
    "phase",
    [SEA, HenyeyGreenstein(0.9), Isotropic(), Mixture((0, 0.4, 0.6), (SEA, HenyeyGreenstein(-0.5), Isotropic()))],
    ids=["sea", "one", "isotropic", "mixture"],
)
OFF = np.append(0.0, np.geomspace(1e-7, 2.0, 4095))
XI = (np.arange(4096) + 0.5) / 4096


@PHASES
def test_phases_in_float64(phase):
    made = functions(phase_text(phase, "python"))
    np.testing.assert_allclose(made["phase_pdf"](OFF), phase.pdf(1 - OFF) + 0 * OFF, rtol=1e-8)
    # Terms one after the other, the light of each from its straight back to its straight on.
    np.testing.assert_allclose(1 - phase.invert(1 - np.sort(made["phase_sample"](XI))), XI, atol=1.5 / XI.size)


@PHASES
def test_phases_in_float32_on_opengl(context, phase):
    run = on_opengl(context, phase_text(phase), "found = vec4(phase_pdf(q.x), phase_sample(q.y), 0.0, 0.0);")
    density, drawn, *_ = run(OFF, XI, 0.0, 0.0)
    exact = functions(phase_text(phase, "python"))
    np.testing.assert_allclose(density, exact["phase_pdf"](OFF.astype(np.float32).astype(float)), rtol=3e-5)
    share = 1 - phase.invert(1 - np.sort(drawn))
    np.testing.assert_allclose(share, XI, atol=1.5 / XI.size + 1e-6)


LOBES = ((0.7, 0.95), (0.3, 0.6))
C, OMEGA, DEPTH = (0.5, 0.2, 0.4), (0.3, 0.6, 0.8), 4.0
BLURS = [water.water_gaussians(omega, c * DEPTH, LOBES, 3) for omega, c in zip(OMEGA, C, strict=True)]
WAY = np.append(0.0, np.geomspace(1e-4, 1e3, 4095))  # [m]


def test_the_segment_in_float64():
    random = np.random.default_rng(2)
    c, s0, t0, t1 = random.uniform(0.01, 2.0, (4, 1000))
    m = np.append(-1.0, random.uniform(-1.0, 1.0, 999))
    made = functions(segment_text("python"))
    for name, given in (("integral", (c, s0, t0, m, t1)), ("between", (s0, t0, t1))):
        right = getattr(water, f"segment_{name}")(*given)
        np.testing.assert_allclose(made[f"sea_segment_{name}"](*given), right, rtol=1e-8)


@pytest.mark.parametrize("channel", range(3))
def test_the_blur_in_float64(channel):
    made, blur, c = functions(blur_text(BLURS, C, "python")), BLURS[channel], C[channel]
    np.testing.assert_allclose(made["sea_blur_share"](WAY, float(channel)), blur.share(c * WAY), rtol=1e-7)
    np.testing.assert_allclose(made["sea_blur_mtf"](WAY, float(channel)), blur.mtf(WAY / c), rtol=1e-9)
    numbers = {"sigma2": np.sqrt(blur.variances[1]) / c, "weight2": blur.weights[1], "unscattered": np.exp(-c * DEPTH)}
    assert {one: made[f"sea_blur_{one}"](float(channel)) for one in numbers} == pytest.approx(numbers, rel=1e-10)


def test_the_blur_in_float32_on_opengl(context):
    calls = "found = vec4(sea_blur_share(q.x, 2.0), sea_blur_mtf(q.y, 1.0), 0.0, 0.0);"
    share, mtf, *_ = on_opengl(context, blur_text(BLURS, C, "glsl"), calls)(WAY, WAY, 0.0, 0.0)
    np.testing.assert_allclose(share, BLURS[2].share(C[2] * WAY), rtol=3e-6)
    np.testing.assert_allclose(mtf, BLURS[1].mtf(WAY / C[1]), rtol=3e-6)


TEXT = strand_text("python", "law")
SINGLE, DOUBLE = RoundedText(TEXT, np.float32), RoundedText(TEXT, np.float64)
COVERED = "found = vec4(fur_shadow(q.x, q.y), fur_visibility(0.5, q.z, q.w), fur_slice(q.w, 1.5), 0.0);"
MET = """float k = {k};
    found = vec4(fur_swept(q.x, q.y, q.z, q.w, {r}, k), k, 0.0, 0.0);"""
NONE = 1e8  # of a ray that meets no cone
RADII = (1e-3, 0.02, 0.5, 3.7, 1e3)
STEPS = np.geomspace(1e-8, 1e-6, 100)
AROUND = 1.0 + np.concatenate([-STEPS, np.linspace(-1e-6, 1e-6, 1001), STEPS])  # the root's edge, where acos fails
ANGLES = np.radians(np.concatenate([np.linspace(0.0, 89.0, 90), [89.9]]))
SIZES = np.array([0.0, 0.02, -0.02, 0.05, -0.05, 1.0, -1.0, 0.5, 1e-3, 60.0])  # of which degenerate rays are made


def rounded(*values):
    """What a float32 holds, so that only arithmetic is judged."""
    return [np.array(one, np.float32).astype(float) for one in np.broadcast_arrays(*values)]


def covers():
    """radius, aside: a tip over the root's edge, one over its middle, and any up to grazing views."""
    lengths = np.geomspace(5.0, 140.0, 8)[:, None] * np.tan(ANGLES)
    asides = np.concatenate([AROUND, [0.0], lengths.ravel()])
    radii = np.array(RADII)[:, None]
    return rounded(radii, radii * asides)


def met_cleanly(start, slender, count=20000):
    """Rays (q, m, r, k) into a cone of length 1 at 0 to 89 degrees, no nearer to its outline than 5 % of its radius.

    start  "tip": from the level of the tip;  "middle": from half its height, both ways;  "near": a tenth at most away
    """
    random = np.random.default_rng([7, slender])
    theta, turn, z = random.uniform((0.0, 0.0, 0.02), (np.pi * 89 / 180, 2 * np.pi, 1.0), (count, 3)).T
    steepest = 1.0 / slender
    off, radius = random.uniform(-0.9, 0.9, count), steepest * (1.0 - z)
    level = {"tip": 1.0, "middle": 0.5, "near": z + np.cos(theta) * random.uniform(-0.1, 0.1, count)}[start]
    back = (level - z) / np.cos(theta)
    m = np.sin(theta) * np.array([np.cos(turn), np.sin(turn)])
    q = off * radius * np.array([-np.sin(turn), np.cos(turn)]) - m * back
    return rounded(*q, *m, steepest * (1.0 - level), steepest * np.cos(theta))


def judged(found, given, r0):
    """The worst error of rays that come cleanly into the part of the cone with a radius, all of them finite."""
    qx, qy, mx, my, r, k = given
    exact = DOUBLE.call("swept", *given)
    aside = np.hypot(r * mx - k * qx, r * my - k * qy)
    clean = np.abs(qx * my - qy * mx) < 0.95 * aside
    clean &= (r + k * exact > 1e-3 * r0) & (r + k * exact < r0)
    assert np.mean(clean) > 0.5
    assert np.all(np.isfinite(found))
    return float(np.max(np.abs(found - exact)[clean]))


def degenerate():
    """Rays along the axis, along the side, through the tip, tangents: (q, m) of few numbers, with what they meet."""
    return np.random.default_rng(1).choice(SIZES, (4, 40000))


def require_roots(found, given):
    """All finite, and each that is not `NONE` on the cone: of a tangent to the root of a rounding."""
    qx, qy, mx, my, r, k = given
    assert np.all(np.isfinite(found))
    assert np.all(np.abs(found) <= NONE)
    left = np.abs(np.hypot(qx + mx * found, qy + my * found) - (r + k * found))
    scale = np.hypot(qx, qy) + np.abs(r) + (np.hypot(mx, my) + np.abs(k)) * np.abs(found)
    met = np.abs(found) < NONE
    assert np.any(met)
    assert np.all(left[met] <= 1e-4 * scale[met])


def test_shadow_and_visibility_of_fur_in_float64():
    random = np.random.default_rng(2)
    made = functions(strand_text("python"))
    for lean in ((0.0, 0.0), (0.3, -0.2)):
        radius, length, theta, z, density = random.uniform((0.1, 1.0, 0.0, 0.0, 0.0), (2, 30, 1.57, 1, 2), (2000, 5)).T
        aside = length * np.hypot(np.tan(theta) - lean[0], lean[1])
        area = made["fur_shadow"](radius, aside)
        np.testing.assert_allclose(area, law.shadow(radius, length, theta, lean), rtol=1e-9)
        seen = law.visibility(density, radius, length, theta, z * length, lean)
        np.testing.assert_allclose(made["fur_visibility"](density, area, z), seen, rtol=1e-9)
    assert made["fur_slice"](0.5, 2.0) == 0.75


@pytest.mark.parametrize("theta", [0.0, 0.5, 5.0, 45.0, 80.0, 89.0])
def test_roots_are_the_truths(theta):
    """From the tips' level as there, and from any height."""
    random = np.random.default_rng(3)
    patch = truth.Patch(np.zeros((1, 2)), 1.0, 0.05, 1.0, (0.2, -0.1))
    rate = np.array([0.2 - np.tan(np.radians(theta)), -0.1])
    down, place = random.random(5000), random.uniform(-0.05, 0.05, (5000, 2))
    away = place - rate * down[:, None]
    want = truth._first(patch, away, rate)
    cross = np.abs(away @ np.array([rate[1], -rate[0]]))
    clean = np.abs(cross / (0.05 * np.hypot(*away.T)) - 1.0) > 1e-3  # no tangents, of which half the digits are left
    for begin in (0.0, down):
        q = away + rate * np.reshape(begin, (-1, 1))
        found = functions(TEXT)["law_swept"](*q.T, *rate, 0.05 * begin, 0.05) + begin
        found = np.where((found >= 0) & (found <= 1.0), found, np.inf)
        assert 500 < np.sum(np.isfinite(found)) < 4900
        np.testing.assert_allclose(found[clean], want[clean], rtol=1e-9)


def shares():
    """radius, first, second, turn: tips over the root's edge, and any to 89.9 degrees."""
    random = np.random.default_rng(8)
    slender, theta = random.uniform(5.0, 140.0, (4000, 1)), random.choice(ANGLES, (4000, 2))
    asides = slender * np.tan(theta)
    asides[:1000] = random.choice(AROUND, (1000, 2))
    turn = random.choice([0.0, 1e-4, 0.3, 2.0, 3.14], 4000)
    radius = random.choice(RADII, 4000)
    return rounded(radius, *(radius * asides.T), turn)


def test_what_an_eye_and_a_lamp_share(context):
    """The library's function in float64; in float32, in numpy and on OpenGL; never more than either's own shadow."""
    given = radius, first, second, turn = shares()
    exact = DOUBLE.call("shared", *given)
    some = slice(0, None, 40)
    angles = (np.arctan(one[some] / radius[some]) for one in (first, second))
    library = [shared_shadow(1.0, 1.0, *each) for each in zip(*angles, turn[some], strict=True)]
    np.testing.assert_allclose(exact[some] / radius[some] ** 2, library, rtol=1e-7)
    for one in (first, second):
        assert np.all(exact <= DOUBLE.call("shadow", radius, one) * (1.0 + 1e-9))
    np.testing.assert_allclose(SINGLE.call("shared", *given), exact, rtol=1e-6)
    calls = "found = vec4(fur_shared(q.x, q.y, q.z, q.w), 0.0, 0.0, 0.0);"
    np.testing.assert_allclose(on_opengl(context, strand_text(), calls)(*given)[0], exact, rtol=3e-6)


def test_the_shadow_in_float32():
    """The textbook's form is no number where the tip is within the root's edge, and has lost digits outside it."""
    radius, aside = covers()
    exact, found = DOUBLE.call("shadow", radius, aside), SINGLE.call("shadow", radius, aside)
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    r, d = radius.astype(np.float32), aside.astype(np.float32)
    near = np.abs(aside / radius - 1.0) < 2e-6
    with np.errstate(all="ignore"):
        textbook = r * r * (np.float32(np.pi) - np.arccos(r / d)) + r * np.sqrt(d * d - r * r)
    outside = near & np.isfinite(textbook)
    assert textbook.dtype == np.float32
    assert np.any(np.isnan(textbook[near]))
    assert np.max(np.abs(textbook / exact - 1.0)[outside]) > 1e-5


@pytest.mark.parametrize("slender", [10, 50, 140])
@pytest.mark.parametrize("start", ["tip", "middle", "near"])
def test_swept_in_float32(start, slender):
    given = met_cleanly(start, slender)
    assert judged(SINGLE.call("swept", *given), given, 1.0 / slender) < 1e-5


@pytest.mark.parametrize("r", [0.0, 0.02, 1.0])
@pytest.mark.parametrize("k", [0.0, 0.05, -0.05, 1.0])
def test_degenerate_rays(r, k):
    given = rounded(*degenerate(), r, k)
    for text in (SINGLE, DOUBLE):
        require_roots(text.call("swept", *given).astype(float), given)


@pytest.mark.parametrize("text", [SINGLE, DOUBLE])
def test_a_ray_along_the_axis_or_the_side(text):
    along = [np.array(one) for one in ((0.0, 0.01), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (-0.25, -0.25), (0.25, 0.25))]
    np.testing.assert_allclose(text.call("swept", *along), [1.0, 1.04], rtol=1e-6)
    # Along the side there is one root, or none: toward the axis, away from it, and past it at the tip's level.
    side = [
        np.array(one) for one in ((-0.5, 0.5, 0.0), (0.0, 0.0, 1.0), 3 * (0.25,), 3 * (0.0,), 3 * (0.0,), 3 * (0.25,))
    ]
    np.testing.assert_allclose(text.call("swept", *side), [1.0, NONE, NONE], rtol=1e-6)


def test_fur_in_float32_on_opengl(context):
    radius, aside = covers()
    z, area = rounded(np.random.default_rng(5).random(radius.shape), 3.0)
    shadow, seen, disc, _ = on_opengl(context, strand_text(), COVERED)(radius, aside, area, z)
    np.testing.assert_allclose(shadow, DOUBLE.call("shadow", radius, aside), rtol=1e-6)
    np.testing.assert_allclose(seen, DOUBLE.call("visibility", 0.5, area, z), rtol=3e-6)
    np.testing.assert_allclose(disc, DOUBLE.call("slice", z, 1.5), rtol=3e-6, atol=3e-7)


@pytest.mark.parametrize(("start", "r"), [("tip", "0.0"), ("middle", "0.01")])
def test_swept_on_opengl(context, start, r):
    """k is what the shader has made of m: a texel has room for four arguments."""
    calls = MET.format(k="0.02 * sqrt(max(1.0 - q.z * q.z - q.w * q.w, 0.0))", r=r)
    given = met_cleanly(start, 50)
    found, k, _, _ = on_opengl(context, strand_text(), calls)(*given[:4])
    assert judged(found, [*given[:4], np.full_like(k, float(r)), k], 0.02) < 1e-5


@pytest.mark.parametrize("r", ["0.0", "0.02"])
def test_degenerate_rays_on_opengl(context, r):
    given = rounded(*degenerate(), float(r), 0.05)
    found = on_opengl(context, strand_text(), MET.format(k="0.05", r=r))(*given[:4])[0]
    require_roots(found, given)


EXPORTERS = {
    "phase": partial(phase_source, RECORD),
    "segment": partial(sea_source, "sea-segment"),
    "blur": partial(export_blur, BLURS, C, DEPTH),
    "fur": partial(fur_source, "fur"),
}
FUR = ("shadow(radius, aside)", "shared(radius, first, second, turn)", "visibility(density, shadow, z)")
# What stands in each whole file.
PARTS = {
    "phase": (
        *(RECORD.content["data_digest"], str(RECORD.content["constants"]["4-terms.held.w1"]["regenerated"])),
        *("(jackknife)", "root mean square of ln(p / table) 0.068"),
    ),
    "segment": ("sea_segment_integral(c, s0, t0, m, t1)",),
    "blur": ("after 4 m of water", "attenuation of red, green, blue 0.5, 0.2, 0.4 [1/m]"),
    "fur": tuple(f"fur_{called}" for called in (*FUR, "slice(t, exponent)", "swept(qx, qy, ")),
}


@pytest.mark.parametrize("lang", [lang for lang in LANGUAGES if lang != "json"])
@pytest.mark.parametrize("name", EXPORTERS)
def test_whole_files(name, lang):
    text, renamed = EXPORTERS[name](lang), EXPORTERS[name](lang, "fog")
    assert [part for part in PARTS[name] if part not in text] == []
    assert "strand_" not in text
    assert {"phase": "fog_pdf", "blur": "fog_share("}.get(name, "fog_") in renamed
    assert {"segment": "sea_", "fur": "fur_"}.get(name, "LAW_") not in renamed


def test_files_of_data():
    told = {name: json.loads(export("json")) for name, export in EXPORTERS.items()}
    assert RECORD.content["data_digest"] in EXPORTERS["phase"]("json")
    assert from_table(told["phase"]["phase"]) == SEA
    assert (told["segment"]["law"], told["fur"]["law"]) == ("sea-segment", "fur")
    green = told["blur"]["numbers"]["green"]
    assert green["unscattered"] + sum(green["weight"]) == pytest.approx(BLURS[1].mtf(0.0))
    assert "shadow(radius, aside)" in told["fur"]["functions"]


def test_python_files_compute():
    made = functions("\n".join(EXPORTERS[name]("python") for name in ("phase", "segment", "fur")))
    assert made["petzold_pdf"](0.5) == pytest.approx(SEA.pdf(0.5))
    assert made["sea_segment_integral"](1.0, 0.0, 0.0, -1.0, 2.0) == 2.0
    assert made["fur_shadow"](2.0, 0.0) == pytest.approx(4.0 * np.pi)


REFUSED = {
    "phase must be terms of Henyey and Greenstein to become a shader": partial(phase_text, FournierForand(1.1, 3.6)),
    "at most 4 terms to become a shader, got 5": partial(phase_text, Mixture((0.2,) * 5, (SEA.phases[0],) * 5)),
    "blurs must be three of one number of Gaussians, .*, got 3, 3$": partial(blur_text, BLURS[:2], C),
    "blurs must be three .*, got none": partial(blur_text, [], C),
    "blurs must be three of one number of Gaussians, .*, got 3, 3, 2": lambda: blur_text(
        [*BLURS[:2], water.water_gaussians(0.5, 1.0, LOBES, 2)], C
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_refused(message):
    refused(message, REFUSED[message])
