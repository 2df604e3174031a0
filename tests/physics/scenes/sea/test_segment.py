"""The integral over a segment of a view ray, in float32 and as its text, for every direction of the beam."""

from pathlib import Path

import numpy as np
import pytest

from profilefit.errors import InputError
from profilefit.scenes import sea
from profilefit.scenes.sea.law import segment_between, segment_integral
from profilefit.shader.check.shader_law import Board
from profilefit.shader.context import full_screen, program
from profilefit.shader.emit import read_text, translated

TEXT = read_text("common") + read_text("near_zero") + (Path(sea.__file__).parent / "glsl/segment.glsl").read_text()
HEIGHT, WIDTH = 128, 512
MAIN = """
uniform sampler2D ways; // c, s0, t0, m
uniform sampler2D lengths; // t1, begin, end
layout(location = 0) out vec4 found;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 q = texelFetch(ways, at, 0);
    vec4 l = texelFetch(lengths, at, 0);
    found = vec4(segment_integral(q.x, q.y, q.z, q.w, l.x), segment_between(l.y, l.z, l.x), 0.0, 0.0);
}
"""


@pytest.fixture(scope="module")
def arguments():
    """c (s0 + t0) <= 4, m dense toward -1 and at its float32 neighbours, c t1 from 1e-4 to 1e3."""
    random = np.random.default_rng(3)
    count = HEIGHT * WIDTH
    near = np.array([0.0, 2.0**-24, 2.0**-23, 3 * 2.0**-24, 1e-5, 1e-3, 1.0, 2.0])
    m = np.concatenate([near, 2.0 ** random.uniform(-24, 1, count - near.size)]) - 1.0
    c, whole, part = 10 ** random.uniform(-3, 1, count), random.uniform(0, 4, count), random.random(count)
    columns = (c, whole * part / c, whole * (1 - part) / c, m, 10 ** random.uniform(-4, 3, count) / c)
    return tuple(one.astype(np.float32) for one in columns)


def exactly(c, s0, t0, m, t1):
    """In long doubles, of the very numbers."""
    c, s0, t0, m, t1 = (np.asarray(one, np.longdouble) for one in (c, s0, t0, m, t1))
    x = c * (1 + m) * t1
    return np.exp(-c * (s0 + t0)) * t1 * np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1)


def worst(found, truth):
    return float(np.max(np.abs(found / truth - 1)))


def test_in_float32(arguments):
    found = segment_integral(*arguments)
    assert found.dtype == np.float32
    assert worst(found, exactly(*arguments)) < 1e-7
    # Negative control: as it stands.
    c, s0, t0, m, t1 = arguments
    with np.errstate(invalid="ignore", divide="ignore"):
        plain = np.exp(-c * (s0 + t0)) * (1 - np.exp(-c * (1 + m) * t1)) / (c * (1 + m))
    assert np.isnan(plain[0])
    assert worst(plain[1:], exactly(*arguments)[1:]) > 0.1


def test_the_text_in_numpy_float32(arguments):
    made = {}
    exec(compile(translated(TEXT, "python"), "segment.py", "exec"), made)
    found = made["segment_integral"](*arguments)
    assert found.dtype == np.float32
    assert worst(found, exactly(*arguments)) < 7e-7


def test_the_text_on_the_gpu(context, arguments):
    """Mesa's exponential is right to 2e-7 or so, and three of them stand in it."""
    ends = np.random.default_rng(4).uniform(0, 4, (2, arguments[0].size)).astype(np.float32)
    ends[1, ::3] = ends[0, ::3]
    lengths = np.stack([arguments[4], *ends, ends[0]], axis=1)
    found = drawn(context, np.stack(arguments[:4], axis=1), lengths)
    assert np.all(np.isfinite(found))
    assert worst(found[:, 0], exactly(*arguments)) < 2e-6
    low, x = np.min(ends, axis=0).astype(float), np.abs(np.diff(ends.astype(float), axis=0)[0])
    truth = arguments[4] * np.exp(-low) * np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1), 1)
    assert worst(found[:, 1], truth) < 2e-6
    assert worst(found[1:, 0], found[:-1, 0]) > 1


def drawn(context, ways, lengths):
    code = program(context, "segment", "#version 330\n" + TEXT + MAIN)
    given = [context.texture((WIDTH, HEIGHT), 4, one.astype("f4").tobytes(), dtype="f4") for one in (ways, lengths)]
    board, triangle = Board(context, (WIDTH, HEIGHT)), full_screen(context, code)
    try:
        for unit, (name, one) in enumerate(zip(("ways", "lengths"), given, strict=True)):
            one.use(unit)
            code[name] = unit
        with board.bound():
            triangle.render(vertices=3)
        return np.frombuffer(board.frame.read(components=4, dtype="f4"), "f4").reshape(-1, 4)
    finally:
        for one in (triangle, code, board, *given):
            one.release()


def test_against_a_sum_along_the_segment():
    s = (np.arange(200_000) + 0.5) / 200_000
    for c, s0, t0, m, t1 in ((0.7, 1.0, 2.0, 0.3, 4.0), (0.7, 1.0, 2.0, -1.0, 4.0), (3.0, 0.0, 0.1, 1.0, 2.0)):
        by_sum = t1 * np.mean(np.exp(-c * (s0 + m * t1 * s) - c * (t0 + t1 * s)))
        assert segment_integral(c, s0, t0, m, t1) == pytest.approx(by_sum, rel=1e-9)
        both = segment_between(c * (s0 + t0), c * (s0 + m * t1 + t0 + t1), t1)
        assert both == pytest.approx(by_sum, rel=1e-9)


def test_limits():
    assert segment_integral(2.0, 0.0, 0.0, 0.5, np.inf) == pytest.approx(1 / 3, rel=1e-12)
    assert segment_integral(0.0, 5.0, 1.0, 0.5, 7.0) == 7.0
    assert segment_integral(2.0, 1.0, 0.5, -1.0, 3.0) == pytest.approx(3 * np.exp(-3.0), rel=1e-12)
    assert segment_integral(2.0, 1.0, 0.5, 0.2, 0.0) == 0.0
    assert np.ndim(segment_integral(2.0, 1.0, 0.5, 0.2, 1.0)) == 0
    assert segment_integral(2.0, np.ones((3, 1)), 0.5, np.linspace(-1, 1, 4), 1.0).shape == (3, 4)
    single = np.float32(1.0)
    assert segment_integral(single, single, single, -single, single).dtype == np.float32


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"c": -1.0}, "c must be"),
        ({"c": np.nan}, "c must be"),
        ({"s0": -0.1}, "s0 must be"),
        ({"t0": np.inf}, "t0 must be"),
        ({"t1": -1.0}, "t1 must be"),
        ({"t1": np.inf, "m": -1.0}, "t1 must be finite"),
        ({"t1": np.inf, "c": 0.0}, "t1 must be finite"),
        ({"m": 1.0001}, "m must be"),
        ({"m": np.nan}, "m must be"),
        ({"m": "x"}, "m must be"),
    ],
)
def test_what_no_segment_has(change, named):
    with pytest.raises(InputError, match=named):
        segment_integral(**{"c": 1.0, "s0": 1.0, "t0": 1.0, "m": 0.5, "t1": 1.0, **change})
    with pytest.raises(InputError, match="begin must be"):
        segment_between(-1.0, 1.0, 1.0)
