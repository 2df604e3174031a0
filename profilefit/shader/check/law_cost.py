"""Cost of a law on the device at hand: ns per evaluation, and its ratio to normalized diffusion in the same turns.

A pixel loops over many evaluations, so that the loop and not the drawing takes the time; what depends on alpha only is
computed once before the loop, as a renderer does per pixel, but in `material`. The laws take turns, and ratios are
medians over turns: machines are shared, and their clocks change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import NamedTuple

import moderngl
import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.laws.base import ProfileLaw
from profilefit.shader import emit
from profilefit.shader.check.shader_law import Board
from profilefit.shader.context import check_errors, full_screen, program, seconds

YARDSTICK = "burley"
SIZE = 256, 128
TURNS = 7
ENOUGH = 0.01  # s that a work takes in one turn, at least: the clock and the driver's calls are negligible then
MOST_ROUNDS = 2**16
# What one evaluation is: x = r/l and xi change at each, s is the law's shape. "estimate" is a sample of (22): a radius
# r, its density, and the law's at the distance d of a surface that is not flat.
WORKS = {
    "profile": "float x = 10.0 * u + 0.001; sum += P_density(x, s) / x;",
    "sample": "sum += P_radius(u, s);",
    "both": "float x = P_radius(u, s) + 1e-6; sum += P_density(x, s) / x;",
    "estimate": """float r = P_radius(u, s) + 1e-6; float d = sqrt(r * r + 0.01);
        sum += r * P_density(d, s) / (d * max(P_radius_density(r, s), 1e-9));""",
    "material": "s = P_shape(0.05 + 0.9 * u); float x = P_radius(u, s) + 1e-6; sum += P_density(x, s) / x;",
}
LOOP = """#version 330
{text}
uniform int rounds;
layout(location = 0) out vec4 found;
void main() {{
    float start = fract(dot(gl_FragCoord.xy, vec2(0.7548776662, 0.5698402910)));
    {prefix}_Shape s = {shape};
    float sum = 0.0;
    for (int i = 0; i < rounds; ++i) {{
        float u = fract(start + 0.6180339887 * float(i));
        {work}
    }}
    found = vec4(sum);
}}
"""


class TimedText(NamedTuple):
    """A text whose functions are timed, and the prefix of their names.

    shape  GLSL of the shape before the loop; `start` in [0, 1) is another in each pixel
    """

    text: str
    prefix: str
    shape: str


@dataclass(frozen=True)
class Cost:
    """Cost by the names of `WORKS`: ns of one evaluation in the fastest turn, and the median ratio to the yardstick."""

    ns: dict[str, float]
    ratio: dict[str, float]


def costs(context: moderngl.Context, laws: Sequence[ProfileLaw], yardstick: ProfileLaw) -> dict[str, Cost]:
    """Return the costs of each law's shader source, by `emit.source`: constants do not change them.

    yardstick  law that is counted as 1
    """
    texts = {emit.source(law): timed_text(law) for law in (yardstick, *laws)}
    return text_costs(context, texts, emit.source(yardstick))


def timed_text(law: ProfileLaw) -> TimedText:
    """Return the source of a law, at an albedo for each pixel."""
    prefix = emit.prefix(law)
    return TimedText(emit.law_text(law), prefix, f"{prefix}_shape(0.05 + 0.9 * start)")


def text_costs(
    context: moderngl.Context, texts: Mapping[str, TimedText], yardstick: str, works: Iterable[str] = WORKS
) -> dict[str, Cost]:
    """Return the costs of each text, by its name.

    yardstick  name of the text that is counted as 1
    works      names of `WORKS`: "material" is for laws only
    """
    timed: dict[str, dict[str, tuple[Floats, Floats]]] = {name: {} for name in texts}
    with ExitStack() as held:
        board = Board(context, SIZE)
        held.callback(board.release)
        held.enter_context(board.bound())
        for work in works:
            loops = {name: _Loop(context, name, text, work) for name, text in texts.items()}
            for loop in loops.values():
                held.callback(loop.release)
            for name, loop in loops.items():
                timed[name][work] = loop.beside(loops[yardstick])
        check_errors(context, "the loops that are timed")
    return {
        name: Cost(
            {work: 1e9 * float(np.min(own)) for work, (own, _) in turns.items()},
            {work: float(np.median(own / other)) for work, (own, other) in turns.items()},
        )
        for name, turns in timed.items()
    }


class _Loop:
    """One work of one text."""

    def __init__(self, context: moderngl.Context, name: str, timed: TimedText, work: str) -> None:
        source = LOOP.format(**timed._asdict(), work=WORKS[work].replace("P_", f"{timed.prefix}_"))
        self._context = context
        self._program = program(context, f"{name}: {work}", source)
        self._triangle = full_screen(context, self._program)

        self._rounds = 4
        self._seconds()  # compiles
        while self._seconds() < ENOUGH and self._rounds < MOST_ROUNDS:
            self._rounds *= 2

    def beside(self, other: _Loop) -> tuple[Floats, Floats]:
        """Seconds of one evaluation of this one, and of the other, in turns (TURNS,)."""
        turns = np.array([(self._each(), other._each() if other is not self else 0.0) for _ in range(TURNS)])
        return turns[:, 0], turns[:, 1 if other is not self else 0]

    def release(self) -> None:
        self._triangle.release()
        self._program.release()

    def _each(self) -> float:
        return self._seconds() / (SIZE[0] * SIZE[1] * self._rounds)

    def _seconds(self) -> float:
        self._program["rounds"] = self._rounds
        return seconds(self._context, lambda: self._triangle.render(moderngl.TRIANGLES, vertices=3))
