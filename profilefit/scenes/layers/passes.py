"""Passes of layered objects: samples of a stack's law with the thickness of each pixel; light scattered once.

The G-buffer's `reflectance_map` holds a share of the way from the least thickness of the first layer to the most, or of
what else varies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mcml_sim import Medium
from mcml_sim.media.arrays import Floats
from profilefit.laws.base import ProfileLaw
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.scenes.layers.law import Plate, single_scattering
from profilefit.scenes.layers.truth import LEFT, StackTable
from profilefit.scenes.stage.exact_law import columns, row, table_text
from profilefit.scenes.stage.renderer import SUM, Pass, Read, text
from profilefit.scenes.stage.technique import EXITANCE, LAW, Frame, Gather, LawText, Technique, maps
from profilefit.scenes.stage.world import Singles
from profilefit.shader.emit import law_text, literal, prefix, text_beside
from profilefit.shader.stack_text import single_text, stack_text

SCATTERED = "scattered_map"
COSINES, SHARES = 32, 16  # of the table of what leaves after one scattering; times cosine, between them right to 2e-4
ROWS = 32  # of a table of exact light, over a map's values
LEAST = 1e-9  # mean free paths that stand for no first layer
GRAZING = 1e-3  # cosine that stands for 0, where a quadrature is of no use
# Quadratures over directions: cosines in (0, 1) and azimuths in (0, pi), since both sides of the plane are alike.
NODE, WEIGHT = np.polynomial.legendre.leggauss(24)
MU, TURN = 0.5 * (NODE + 1.0), 0.5 * np.pi * (NODE + 1.0)


def thickness_text(least: float, most: float) -> str:
    """Return GLSL of the thickness at a pixel, an expression of `surface`."""
    return f"mix({literal(least)}, {literal(most)}, surface.r)"


@dataclass(frozen=True, eq=False)
class StackGather(Gather):
    """Samples of a stack's law; light through thin parts as plates let it through, which have the layers on both sides.

    plates  of red, green, blue
    """

    plates: tuple[Plate, ...] = ()

    def through(self) -> LawText:
        rates, skins, strengths, offsets = (
            ", ".join(map(literal, column)) for column in list(zip(*self.plates, strict=True))[:4]
        )
        text = f"""
struct {LAW}_Shape {{ int channel; float length; }};
const vec3 plate_rate = vec3({rates}), plate_skins = vec3({skins});
const vec3 plate_strength = vec3({strengths}), plate_offset = vec3({offsets});
float {LAW}_cumulated(float x, {LAW}_Shape s) {{
    int c = s.channel;
    float depth = plate_rate[c] * max(x * s.length - plate_skins[c], 0.0) + plate_offset[c];
    return 1.0 - 2.0 * plate_strength[c] * exp(-depth) / (1.0 - exp(-2.0 * depth));
}}
"""
        return LawText("plates", text, {}, f"{LAW}_Shape(c, mfp[c])", "1.0")


def of_stack(laws: Sequence[StackLaw], least: float, most: float, plates: Sequence[Plate]) -> StackGather:
    """Return samples of a stack's law with the thickness at each pixel."""
    shape = f"{LAW}_shape(float(c), {thickness_text(least, most)})"
    law = LawText("stack", stack_text(laws, name=LAW), {}, shape, f"{LAW}_reflectance(shape)")
    return StackGather(law, tuple(plates))


def of_table(table: StackTable, plates: Sequence[Plate]) -> StackGather:
    """Return samples of exact light by tables, of the nearest of ROWS values of the map at each pixel."""
    values = np.repeat(np.linspace(0.0, 1.0, ROWS), len(CHANNELS))
    curves, (t, x) = table.curves(values), columns()
    every = np.broadcast_to(x, (values.size, x.size))
    shares = np.maximum.accumulate(curves.share(every), axis=1)
    rings = 2.0 * np.pi * x * curves.density(every)
    rows = [row(_radii(t, x, share), ring, share) for share, ring in zip(shares, rings, strict=True)]
    drawn, known = (np.stack(column) for column in zip(*rows, strict=True))
    text = table_text(LAW, curves.reflectance)
    shape = f"{LAW}_Shape(c + {len(CHANNELS)} * int(surface.r * {ROWS - 1}.0 + 0.5))"
    textures = {f"{LAW}_drawn": drawn, f"{LAW}_known": known}
    return StackGather(LawText("table", text, textures, shape, f"{LAW}_reflectance(shape)"), tuple(plates))


def _radii(t: Floats, x: Floats, share: Floats) -> Floats:
    """Return x at which all but e^-t of the light is within; beyond what a table tells, as it goes on."""
    depth = -np.log(np.maximum(1.0 - share, LEFT))
    told = np.searchsorted(depth, depth[-1])  # the first column with all that is told
    ln = np.interp(t, depth[: told + 1], np.log(x[: told + 1]))
    first = t < depth[0]  # R_d is as good as even there, or as 1 / r: next to none of the light
    far = t > depth[told]
    before = np.searchsorted(depth, depth[told] - 1.0)
    rate = (x[told] - x[before]) / (depth[told] - depth[before])
    return np.where(far, x[told] + rate * (t - depth[told]), np.where(first, x[0] * t / depth[0], np.exp(ln)))


def of_half_space(law: ProfileLaw) -> Gather:
    """Return samples of one half space everywhere, that of the stage's `fixed_alpha`, with the law's reflectance."""
    shape = f"{LAW}_shape(fixed_alpha[c])"
    return Gather(LawText(prefix(law), law_text(law, name=LAW), {}, shape, f"{LAW}_reflectance(shape)"))


@dataclass(frozen=True, eq=False)
class WithSingle(Technique):
    """A technique whose light scattered once leaves as it does, not in all directions alike.

    A law has all scattered light leave as a white wall's does. To what it gives this adds the radiance of the light
    that was scattered once, exactly, and takes away that light's exitance over pi: no energy comes or goes.

    media  of red, green, blue;  least, most  thickness of the first layer where the map is 0 and 1
    """

    by: Technique
    media: tuple[Medium, Medium, Medium]
    least: float
    most: float

    @cached_property
    def table(self) -> Singles:
        """Table of exitances, a quadrature of seconds."""
        return once_table(self.media, self.least, self.most)

    def passes(self, frame: Frame) -> Sequence[Pass]:
        inner = [replace(one, writes=SCATTERED) if one.writes == EXITANCE else one for one in self.by.passes(frame)]
        head = f"#define THICKNESS(surface) ({thickness_text(self.least, self.most)})\n"
        head = f"{single_text(self.media, name='once')}{head}{text_beside(__name__, 'single.glsl')}"
        surface: dict[str, Read] = {**maps("reflectance_map", "position_map", "normal_map"), "once_table": self.table}
        perspective = {"perspective": float(frame.is_perspective)}
        source = head + text_beside(__name__, "single.frag")
        reads = {**surface, SCATTERED: SCATTERED}
        passes = [*inner, Pass("single", reads, EXITANCE, source, {**frame.light, **perspective})]
        for lamp in frame.lamps:
            source = head + text("shadow.glsl") + text_beside(__name__, "single_lamp.frag")
            reads, uniforms = {**surface, "shadow_map": lamp.shadow}, {**lamp.uniforms, **perspective}
            passes.append(Pass("single lamp", reads, EXITANCE, source, uniforms, kept=SUM))
        return passes

    def through(self) -> LawText:
        return self.by.through()

    def lengths(self, frame: Frame) -> Floats:
        return self.by.lengths(frame)


def once_table(media: Sequence[Medium], least: float, most: float) -> Singles:
    """Return (SHARES, COSINES, 3) exitance of light scattered once, over irradiance [-]; cosines 0 to 1 along rows."""
    cosine = np.maximum(np.linspace(0.0, 1.0, COSINES), GRAZING)
    thickness = np.linspace(least, most, SHARES)
    rows = [[once(one.with_first(max(d, LEAST * one.layers[0].mfp)), cosine) for one in media] for d in thickness]
    return np.moveaxis(np.array(rows), 1, 2).astype(np.float32)


def once(medium: Medium, cosine: Floats) -> Floats:
    """Return the share of the light of each direction, cosines (m,), that leaves above after one scattering [-]."""
    radiance = single_scattering(medium, cosine[:, None, None], MU[:, None], TURN)
    return np.einsum("moa,o,a->m", np.asarray(radiance), 0.5 * WEIGHT * MU, np.pi * WEIGHT) / cosine


def diffusely_once(medium: Medium) -> float:
    """Return the share of diffuse light that leaves above after one scattering [-]."""
    return float(np.sum(WEIGHT * MU * once(medium, MU)))


def alike_error(medium: Medium) -> float:
    """Return the error of having light scattered once leave like all other light, equally in all directions.

    Mean over diffuse light and diffusely placed eyes of |pi L - its exitance|, as a share of white [-]. No root mean
    square: where nothing refracts a few grazing directions would be all of it.
    """
    radiance = np.asarray(single_scattering(medium, MU[:, None, None], MU[:, None], TURN))
    apart = np.pi * radiance / MU[:, None, None] - once(medium, MU)[:, None, None]
    of_mu = WEIGHT * MU  # 2 mu dmu on (0, 1)
    return float(np.einsum("ioa,i,o,a->", np.abs(apart), of_mu, of_mu, 0.5 * WEIGHT))
