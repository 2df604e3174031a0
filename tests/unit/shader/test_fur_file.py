"""The texts of cones of fur are the library's functions: in float64, in float32, on OpenGL, and compile everywhere."""

import json

import numpy as np
import pytest

from benchmarks.fur_feet import shared_shadow
from profilefit.scenes.fur import law, truth
from profilefit.scenes.fur.law import source, strand_text
from profilefit.shader.check.shader_law import _Pass
from profilefit.shader.law_file import LANGUAGES
from profilefit.studies.stability.cells import RoundedText
from tests.unit.shader.test_phase_text import functions

TEXT = strand_text("python", "law")
SINGLE, DOUBLE = RoundedText(TEXT, np.float32), RoundedText(TEXT, np.float64)
DRAW = """#version 330
{text}
uniform sampler2D arguments;
layout(location = 0) out vec4 found;
void main() {{
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    {calls}
}}
"""
COVERED = """found = vec4(fur_shadow(q.x, q.y), fur_visibility(0.5, q.z, q.w), fur_slice(q.w, 1.5), 0.0);"""
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
    given = rounded(*q, *m, steepest * (1.0 - level), steepest * np.cos(theta))
    return given


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


def test_shadow_and_visibility_in_float64():
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


def test_a_cast_ray_is_the_nearest_root():
    patch, theta = truth.random_patch(0.5, 0.3, 4.0, 6.0, seed=4), np.radians(50.0)
    start = truth.rays(patch, 2000, seed=4)
    away = start[:, None] - patch.feet
    shifts = 6.0 * np.stack(np.meshgrid([-1, 0, 1, 2], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    qx, qy = (away[..., None, :] + shifts).T
    down = functions(TEXT)["law_swept"](qx, qy, -np.tan(theta), 0.0, 0.0, 0.3 / 4.0)
    nearest = np.min(np.where((down >= 0) & (down <= 4.0), down, 4.0), axis=(0, 1))
    np.testing.assert_allclose(4.0 - nearest, truth.cast(patch, theta, start), atol=1e-7)


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
    drawn = _Pass(context, "fur", DRAW.format(text=strand_text(), calls=calls), "f4")(*given)[0]
    np.testing.assert_allclose(drawn, exact, rtol=3e-6)


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


def test_in_float32_on_opengl(context):
    text = strand_text()
    radius, aside = covers()
    z, area = rounded(np.random.default_rng(5).random(radius.shape), 3.0)
    shadow, seen, disc, _ = _Pass(context, "fur", DRAW.format(text=text, calls=COVERED), "f4")(radius, aside, area, z)
    np.testing.assert_allclose(shadow, DOUBLE.call("shadow", radius, aside), rtol=1e-6)
    np.testing.assert_allclose(seen, DOUBLE.call("visibility", 0.5, area, z), rtol=3e-6)
    np.testing.assert_allclose(disc, DOUBLE.call("slice", z, 1.5), rtol=3e-6, atol=3e-7)


@pytest.mark.parametrize(("start", "r"), [("tip", "0.0"), ("middle", "0.01")])
def test_swept_on_opengl(context, start, r):
    """k is what the shader has made of m: a texel has room for four arguments."""
    calls = MET.format(k="0.02 * sqrt(max(1.0 - q.z * q.z - q.w * q.w, 0.0))", r=r)
    given = met_cleanly(start, 50)
    found, k, _, _ = _Pass(context, "fur", DRAW.format(text=strand_text(), calls=calls), "f4")(*given[:4])
    assert judged(found, [*given[:4], np.full_like(k, float(r)), k], 0.02) < 1e-5


@pytest.mark.parametrize("r", ["0.0", "0.02"])
def test_degenerate_rays_on_opengl(context, r):
    given = rounded(*degenerate(), float(r), 0.05)
    calls = MET.format(k="0.05", r=r)
    found = _Pass(context, "fur", DRAW.format(text=strand_text(), calls=calls), "f4")(*given[:4])[0]
    require_roots(found, given)


@pytest.mark.parametrize("lang", LANGUAGES)
def test_whole_files(lang):
    text = source("fur", lang)
    if lang == "json":
        told = json.loads(text)
        assert told["law"] == "fur"
        assert "shadow(radius, aside)" in told["functions"]
        return
    for called in (
        "shadow(radius, aside)",
        "shared(radius, first, second, turn)",
        "visibility(density, shadow, z)",
        "slice(t, exponent)",
        "swept(qx, qy, ",
    ):
        assert f"fur_{called}" in text
    assert "strand_" not in text
    assert "fur_" not in source("fur", lang, "hair")
    if lang == "python":
        assert functions(text)["fur_shadow"](2.0, 0.0) == pytest.approx(4.0 * np.pi)
