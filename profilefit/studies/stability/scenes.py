"""Scenes: light in water, layers of fur, and blurs of a heart, each where it is promised to hold.

Of the sea: hits on an uneven floor, e^-ct for a beam, and the integral over a view's segment. Of fur: shadows of
shells, hits of swept slabs, and the shadow of a cone in float32. Of a heart, which needs OpenGL: poles, seams and
stretch of an atlas, and a screen seen aslant; light is blurred by one Gaussian at a time, and held against what is
known, a ball lit from one side, and an edge of light on a plane, with errors of white.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from mcml_sim.media.arrays import Floats
from profilefit.scenes.fur.law import shadow, shell_shadow, strand_text
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, LayerTechnique, trial
from profilefit.scenes.heart.atlas import BLURRED, Atlas
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.meshes import ball, bumps
from profilefit.scenes.heart.passes import gather_of
from profilefit.scenes.heart.truth import sphere_blur
from profilefit.scenes.sea.law import beam_share, failing_depth, segment_integral
from profilefit.scenes.sea.scene import PHASE, lobes_of
from profilefit.scenes.sea.source import segment_text
from profilefit.scenes.sea.waves import Waves, first_hit, random_floor, wrong_shares
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Camera, Mesh, Part, Scene, unit
from profilefit.shader import opened
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import Cells, Mask, RoundedText, absolute, axis, labelled, relative

DIGITS = 1e-6  # relative: a few roundings in float32

HITS, BEAM, SEGMENT = "rays with a wrong hit", "beam, cw 0.1", "segment"  # quantities
# Searches of a hit, as `waves.wrong_shares` calls them, 3 iterations each, with the S below which each is promised to
# be right: beyond, iterations alone find another crossing, or none. The first three are ours. From S = 1 on a ray may
# cross the floor more than once.
SEVERAL = 1.0
SEARCHES: dict[str, tuple[int | str, float]] = {
    "16 steps": (16, np.inf),
    "8 steps": (8, 3.0),
    "Newton's": ("newton", SEVERAL),
    "Newton's from 1 m, as published": ("newton_1m", SEVERAL),
    "Shah et al.'s": ("shah", SEVERAL),
}
OURS = 3
OF_HITS = (
    f"take equal steps before Newton's iteration, 8 for S from {SEVERAL:g} to 3 and 16 beyond, and "
    "begin at the floor's mean plane"
)
OF_BEAM = (
    "use profilefit.scenes.sea.beam_share, or the Gaussians of profilefit export SEA.toml: light turned by small "
    "angles stays in the beam"
)
OF_SEGMENT = "use profilefit.scenes.sea.segment_integral or profilefit export sea-segment, which keep digits at m = -1"
STEEPNESSES = (0.5, 0.9, 1.5, 3.0, 5.0, 10.0)  # slope x tangent
RAYS, WRONG = 600, 0.01  # a floor, and the share of them that may be off
# Level and nearly level floors: rms slope [-], depth [m], and the eye's height above the highest place [m].
SLOPES = (0.0, 1e-9, 1e-7, 1e-5, 1e-3)
FLOORS = (0.1, 1.0, 4.0, 5.0, 10.0, 100.0, 1000.0)
EYES = (0.01, 0.03, 0.1, 0.2, 0.5, 1.0)
VIEWS, STEPS = 20, 16  # rays per cell, steps of the search
GRAZING, HEIGHT_BOUND = 0.01, 1e-6  # least cosine of a ray to the vertical; depths that a hit may miss by
BEAM_RADIUS, DARKER = 0.1, 0.1  # cw, and the share of e^-ct by which there may be more light
ALBEDOS = (0.05, 0.1, 0.2, 0.4, 0.6, 0.8)
DEPTHS = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0)  # as far as photons were compared
TURNS = (0.0, 2.0**-24, 2.0**-23, 2.0**-20, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 1.0, 2.0)  # 1 + m: m = -1 ... 1
LENGTHS = (1e-4, 1e-2, 0.1, 1.0, 10.0, 1e3)  # c t1
RATES = (1e-3, 0.3, 2.0)  # c [1/m]
BEFORE, BACK = 1.0, 0.5  # s0, t0 [m]


def of_hits() -> Iterator[Cells]:
    """Yield the share of rays whose hit misses by more than 1 % of the depth, by our searches and published ones."""
    ways, limits = zip(*SEARCHES.values(), strict=True)
    shares = wrong_shares(list(ways), STEEPNESSES, RAYS)
    for name, own, rows in (("hits", True, slice(0, OURS)), ("hits, as published", False, slice(OURS, None))):
        axes = labelled("way", tuple(SEARCHES)[rows]), axis("S", STEEPNESSES)
        inside = np.array(STEEPNESSES) < np.array(limits)[rows, None]
        given = shares[rows], np.zeros(()), shares[rows], WRONG, inside
        yield Cells(name, own, HITS, cells.FLOAT64, axes, *given, advice=OF_HITS)


def of_level_floors() -> Cells:
    """Return the share of views whose hit on a level or nearly level floor is wrong in float32."""
    axes = axis("slope", SLOPES), axis("depth", FLOORS, "m"), axis("eye above the floor", EYES, "m")
    value = np.array([[[_missed(slope, depth, eye) for eye in EYES] for depth in FLOORS] for slope in SLOPES])
    return Cells("level floors", True, HITS, cells.FLOAT32, axes, value, np.zeros(()), value, WRONG, advice=OF_HITS)


def _missed(slope: float, depth: float, eye: float) -> float:
    """Return the share of `VIEWS` random rays whose hit in float32 is missing or misses by `HEIGHT_BOUND` depths."""
    rng = np.random.default_rng(0)
    floor = random_floor(slope, 2.0 * depth, depth) if slope else Waves(2.0 * depth, mean=-depth)
    down, turn = rng.uniform(GRAZING, 1.0, VIEWS), rng.uniform(0.0, 2.0 * np.pi, VIEWS)
    level = np.sqrt(1.0 - down * down)
    ray = np.column_stack([level * np.cos(turn), level * np.sin(turn), -down]).astype(np.float32)
    origin = np.column_stack([rng.uniform(0.0, 2.0 * depth, (VIEWS, 2)), np.full(VIEWS, floor.highest + eye)])
    given = floor.height, origin.astype(np.float32), ray, floor.lowest, floor.highest, STEPS, floor.slope
    single, double = (np.asarray(first_hit(*given, precision=one)) for one in (np.float32, np.float64))
    return float(np.mean(~(np.abs(single - double) * down <= HEIGHT_BOUND * depth)))


def of_beam() -> Cells:
    """Return e^-ct for the light of a beam within a small radius, in water as Petzold's."""
    lobes, albedo, depth = lobes_of(PHASE), np.array(ALBEDOS)[:, None], np.array(DEPTHS)
    share = beam_share(albedo, depth, BEAM_RADIUS, lobes)
    value = np.broadcast_to(np.exp(-depth), share.shape)
    inside = albedo * depth < failing_depth(albedo, BEAM_RADIUS, lobes, DARKER)
    given = value, share, relative(value, share), DARKER / (1.0 + DARKER), inside  # of all that is there
    return Cells("e^-ct", True, BEAM, cells.FLOAT64, (axis("ω", ALBEDOS), axis("ct", DEPTHS)), *given, advice=OF_BEAM)


def of_segment() -> Iterator[Cells]:
    """Yield the integral in float32: by its shader source, the function in Python, and the usual formula."""
    text = RoundedText(segment_text("python", cells.NAME), np.float32)
    axes = axis("1+m", TURNS), axis("c t1", LENGTHS), axis("c", RATES, "1/m")
    m, far, c = np.meshgrid(np.array(TURNS) - 1.0, LENGTHS, RATES, indexing="ij")
    given = c, np.full(c.shape, BEFORE), np.full(c.shape, BACK), m, far / c
    at: list[Any] = [one.astype(np.float32) for one in given]
    exactly = segment_integral(*(one.astype(float) for one in at))
    for name, own, arithmetic, value in (
        (SEGMENT, True, cells.TEXT32, text.call("integral", *at)),
        (SEGMENT, True, cells.FLOAT32, segment_integral(*at)),
        ("segment, plain", False, cells.FLOAT32, plain_integral(*at)),
    ):
        value = np.asarray(value, float)
        judged = value, exactly, relative(value, exactly), DIGITS
        yield Cells(name, own, SEGMENT, arithmetic, axes, *judged, advice=OF_SEGMENT)


def plain_integral(c: Floats, s0: Floats, t0: Floats, m: Floats, t1: Floats) -> Floats:
    """Return e^{-c (s0 + t0)} (1 - e^-x) / x t1, x = c (1 + m) t1, as it stands."""
    with np.errstate(all="ignore"):
        x = c * (1 + m) * t1
        return np.exp(-c * (s0 + t0)) * ((1 - np.exp(-x)) / x) * t1


UNION, STRAND_HITS, SHADOW = "shadow over the cone's", "rms of hits over L", "shadow of a cone"  # quantities
SHELLS: tuple[LayerTechnique, ...] = (FITTED, LINEAR, QUADRATIC)  # the first is ours; the others were published
SLENDER, COVER = 20.0, 0.16  # L / r0, r0^2 n of what is looked at
# Fitted shells are promised from so many layers on, times L / r0 and times L tan(theta) / r0: fewer need an exponent
# that is far from the cone's, or leave gaps.
FULL, FILLED = 2.5, 1.5
# Swept slabs are promised below so much of y = (L tan(theta) / N) sqrt(n), the path of a ray in a slab over the
# strands' mean distance: in fur of r0^2 n from 0.04 to 0.25.
SLABS = {SWEPT: 0.65, SWEPT_TWO: 1.2}
OF_SHELLS = (
    f"use swept slabs; or p = 1 from {FILLED:g} L tan(theta) / r0 layers on, the fitted p from {FULL:g} L / r0 as well"
)
OF_SLABS = (
    f"use L tan(theta) sqrt(n) / {SLABS[SWEPT]:g} slabs, over {SLABS[SWEPT_TWO]:g} where they test two strands, so "
    "that no ray meets a second strand within a slab"
)
OF_SHADOW = (
    "use r0^2 (pi + u - atan u) of profilefit.scenes.fur.law.shadow or profilefit export fur, which keeps digits"
)
DEGREES = (0.0, 5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0)
SHELL_LAYERS, SLAB_LAYERS = (8, 16, 32, 64, 128, 256, 512), (4, 8, 16, 32, 64, 128)
SHADOW_BOUND = 0.1  # relative, of what a strand's discs hide
HIT_BOUND = 0.05  # root mean square of hits, over the length
PATCH_RAYS, STRANDS, WIDER, SEED = 2000, 500, 1.2, 3  # of a patch: strands at least, and over a ray's way
# d / r0 to 89.9 degrees at L / r0 = 100, and next to where the tip leaves the root's disc.
ASIDES = (
    *(1e-3, 0.5, 1.0 - 1e-3, 1.0 - 2.0**-24, 1.0, 1.0 + 2.0**-23, 1.0 + 2.0**-20, 1.0 + 1e-5, 1.0 + 1e-4, 1.0 + 1e-3),
    *(1.01, 1.05, 1.2, 2.0, 10.0, 100.0, 1e4, 1e2 * float(np.tan(np.radians(89.9)))),
)
ROOTS = (1e-3, 0.5, 1e3)  # any unit


def filled(way: LayerTechnique, degrees: Floats, layers: Floats) -> Mask:
    """Return where shells are promised to hide what a cone does."""
    tangent = np.tan(np.radians(degrees))
    return np.asarray((way == FITTED) & (layers >= SLENDER * np.maximum(FULL, FILLED * tangent)))


def of_shells() -> Iterator[Cells]:
    """Yield what a strand's discs hide over what its cone does: of the fitted exponent, and of the published ones."""
    for name, own, ways in (("shells", True, SHELLS[:1]), ("shells, as published", False, SHELLS[1:])):
        value = np.empty((len(ways), len(DEGREES), len(SHELL_LAYERS)))
        for i, j, k in np.ndindex(value.shape):
            n, turn = SHELL_LAYERS[k], float(np.radians(DEGREES[j]))
            value[i, j, k] = shell_shadow(n, ways[i].exponent_of(n, SLENDER), 1.0, SLENDER, turn)
        inside = np.array([filled(way, np.array(DEGREES)[:, None], np.array(SHELL_LAYERS)) for way in ways])
        axes = labelled("way", (way.name for way in ways)), axis("θ", DEGREES, "degrees"), axis("N", SHELL_LAYERS)
        given = value, np.ones(()), relative(value, np.ones_like(value)), SHADOW_BOUND, inside
        yield Cells(name, own, UNION, cells.FLOAT64, axes, *given, advice=OF_SHELLS)


def of_slabs() -> Cells:
    """Return the error of first hits' heights on one patch an angle, by slabs that test one strand and two."""
    value = np.empty((len(SLABS), len(DEGREES), len(SLAB_LAYERS)))
    for i, turn in enumerate(np.radians(DEGREES).tolist()):
        side = max(WIDER * SLENDER * np.tan(turn), float(np.sqrt(STRANDS / COVER)))
        rays = trial(random_patch(COVER, 1.0, SLENDER, side, SEED), turn, PATCH_RAYS, SEED)
        value[:, i] = [[rays.error(way, n) for n in SLAB_LAYERS] for way in SLABS]
    moved = SLENDER * np.tan(np.radians(DEGREES))[:, None] / np.array(SLAB_LAYERS) * COVER**0.5  # y
    inside = moved < np.array(list(SLABS.values()))[:, None, None]
    axes = labelled("way", (way.name for way in SLABS)), axis("θ", DEGREES, "degrees"), axis("N", SLAB_LAYERS)
    given = value, np.zeros(()), value, HIT_BOUND, inside
    return Cells("slabs", True, STRAND_HITS, cells.FLOAT64, axes, *given, advice=OF_SLABS)


def of_shadow() -> Iterator[Cells]:
    """Yield a cone's shadow in float32: by its shader source, and by the formula as textbooks have it."""
    text = RoundedText(strand_text("python", cells.NAME), np.float32)
    aside, radius = np.meshgrid(ASIDES, ROOTS, indexing="ij")
    root = radius.astype(np.float32)
    away = (aside * root.astype(float)).astype(np.float32)
    # A tip that leans by the length is seen that far aside from above, to the last digit.
    exactly = np.asarray(shadow(root.astype(float), away.astype(float), 0.0, (1.0, 0.0)))
    axes = axis("d/r0", ASIDES), axis("r0", ROOTS, "length")
    for name, own, arithmetic, value in (
        ("cone's shadow", True, cells.TEXT32, text.call("shadow", root, away)),
        ("cone's shadow, by acos", False, cells.FLOAT32, by_acos(root, away)),
    ):
        value = np.asarray(value, float)
        judged = value, exactly, relative(value, exactly), DIGITS
        yield Cells(name, own, SHADOW, arithmetic, axes, *judged, advice=OF_SHADOW)


def by_acos(radius: NDArray, aside: NDArray) -> NDArray:
    """Return r0^2 (pi - acos(r0 / d)) + r0 sqrt(d^2 - r0^2) where d > r0, else pi r0^2."""
    one = radius.dtype.type
    with np.errstate(all="ignore"):
        beyond = radius**2 * (one(np.pi) - np.arccos(radius / aside)) + radius * np.sqrt(aside**2 - radius**2)
    return np.where(aside <= radius, one(np.pi) * radius**2, beyond)


WITHIN = 2.0  # sigma from a pole that are not promised: lines of the atlas turn there
FINE = 1.5  # texels of a sigma that are promised: of less, the edge is as wide as a texel
AT_POLES = "use charts without poles, such as the faces of a cube, or blur on the screen"
COARSE = "use a finer atlas, or blur that Gaussian on the screen"
BOUND = 0.02  # of white: what shows
RADIUS, TEXELS, MARGIN = 8.0, (192, 96), 24  # of the ball [mm], its atlas, columns and rows
SIGMAS = (0.02, 0.05, 0.1, 0.2, 0.4)  # [radius]; a texel of the equator is 0.033
LATITUDES = (0.0, 30.0, 60.0, 75.0, 83.0, 89.0)
FROM_SEAM = (0, 2, 10, 60)  # columns
LAMP = (0.6, 0.64, 0.48)
ROWS, RATIOS = 128, (1, 2, 4, 8, 16)  # of a plane's atlas, and rows over columns
WIDTHS = (2.0, 6.0, 18.0)  # sigma of a plane's light, in rows
ANGLES = (0.0, 30.0, 60.0, 75.0, 80.0, 85.0, 87.0, 88.0, 89.0)  # of the eye from the normal
PLACES = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)  # from the edge [sigma]
VIEW, SIGMA, SAMPLES = (192, 64), 6.0, 256  # pixels; sigma [pixels, of a plane that faces the eye]


def heart_cells() -> Iterator[Cells]:
    """Yield a ball's atlas over sigma, latitude and place, a plane's over stretch, and a screen over angles."""
    with opened() as context:
        yield of_ball(context)
        yield of_stretch(context)
        yield of_view(context)


def of_ball(context: moderngl.Context) -> Cells:
    """Return the atlas of a ball under a lamp."""
    part = _part(ball(RADIUS))
    rows = [MARGIN + int((0.5 + one / 180.0) * TEXELS[1]) for one in LATITUDES]
    columns = [MARGIN + one for one in FROM_SEAM]
    size, pairs = (TEXELS[0] + 2 * MARGIN, TEXELS[1] + 2 * MARGIN), []
    with Stage(context, (16, 16), 16) as stage, Atlas(context, size, MARGIN) as atlas:
        stage.draw(Scene((part,)))
        atlas.draw(stage, part)
        towards = atlas.read("normal_map")[..., :3].astype(float) @ np.array(LAMP)
        for sigma in SIGMAS:
            light = _blurred(atlas, 1.0 + towards, sigma * RADIUS)
            exactly = sphere_blur(RADIUS, towards, [(sigma * RADIUS) ** 2], [1.0])
            pairs.append([one[np.ix_(rows, columns)] for one in (light, exactly)])
    value, reference = np.stack(pairs, axis=1)
    axes = axis("σ/R", SIGMAS), axis("latitude", LATITUDES, "degrees"), axis("from the seam", FROM_SEAM, "texels")
    away = np.radians(90.0 - np.array(LATITUDES))[:, None] >= WITHIN * np.array(SIGMAS)[:, None, None]
    given = value, reference, absolute(value, reference), BOUND, away
    return Cells("atlas of a ball", True, "light, blurred", cells.TEXT32, axes, *given, advice=AT_POLES)


def of_stretch(context: moderngl.Context) -> Cells:
    """Return an edge of light on a plane whose columns are wider than its rows: the worst texel of each."""
    value, reference = np.empty((2, len(RATIOS), len(WIDTHS), 2))
    part = _part(bumps(ROWS / 3.0, 0.0, float(ROWS), 8))
    with Stage(context, (16, 16), 16) as stage:
        stage.draw(Scene((part,)))
        for i, ratio in enumerate(RATIOS):
            inner, margin = ROWS // ratio, min(24, max(2, ROWS // ratio // 4))
            with Atlas(context, (inner + 2 * margin, ROWS + 2 * margin), margin) as atlas:
                atlas.draw(stage, part)
                place = atlas.read("position_map")
                for j, edge in np.ndindex(len(WIDTHS), 2):
                    along = place[..., edge].astype(float)
                    light = _blurred(atlas, (along > 0).astype(float), WIDTHS[j])
                    exactly = _edge(along, WIDTHS[j])
                    here = np.argwhere((place[..., 3] > 0.5) & (np.abs(along) < 0.25 * ROWS))
                    at = tuple(here[int(np.argmax(np.abs(light - exactly)[tuple(here.T)]))])
                    value[i, j, edge], reference[i, j, edge] = light[at], exactly[at]
    axes = axis("column / row", RATIOS), axis("σ", WIDTHS, "rows"), labelled("edge", ("across columns", "across rows"))
    fine = np.array(WIDTHS)[:, None] >= FINE * np.array(RATIOS)[:, None, None] * np.array([1.0, 0.0])
    given = value, reference, absolute(value, reference), BOUND, fine
    return Cells("atlas that is stretched", True, "light, blurred", cells.TEXT32, axes, *given, advice=COARSE)


def of_view(context: moderngl.Context) -> Cells:
    """Return an edge of light on a plane seen aslant, blurred on the screen."""
    value, reference = np.empty((2, len(ANGLES), len(PLACES)))
    kernel = Kernel(np.array([SIGMA**2]), np.ones((1, 3)))
    part = _part(bumps(1e4, 0.0, 3e4, 8))
    with Stage(context, VIEW, 16) as stage:
        for i, angle in enumerate(np.radians(ANGLES).tolist()):
            eye = 1e5 * unit((np.sin(angle), 0.0, np.cos(angle)))
            camera = Camera((float(eye[0]), 0.0, float(eye[2])), height=float(VIEW[1]), kind="orthographic")
            stage.draw(Scene((part,), camera=camera))
            buffers = stage.buffers()
            across = (np.arange(VIEW[0]) + 0.5 - 0.5 * VIEW[0]) / np.cos(angle)
            buffers.irradiance[:] = (across > 0)[None, :, None]
            stage.upload(buffers)
            mean = stage.scatter(gather_of(kernel, (1.0,) * 3), 1.0, Sampling(SAMPLES))[..., 0].mean(axis=0)
            at = [int(np.argmin(np.abs(across - place * SIGMA))) for place in PLACES]
            value[i], reference[i] = mean[at], _edge(across[at], SIGMA)
    axes = axis("angle", ANGLES, "degrees"), axis("from the edge", PLACES, "σ")
    given = value, reference, absolute(value, reference), BOUND
    return Cells("screen seen aslant", True, "light, blurred", cells.TEXT32, axes, *given, advice=COARSE)


def _edge(along: Floats, sigma: float) -> Floats:
    """Return an edge of light blurred by a Gaussian, at distances from it."""
    return 0.5 + 0.5 * erf(along / (np.sqrt(2.0) * sigma))


def _part(mesh: Mesh) -> Part:
    return Part(mesh, np.ones((1, 1, 3), np.float32))


def _blurred(atlas: Atlas, light: Floats, sigma: float) -> Floats:
    """Return an irradiance (rows, columns) blurred by one Gaussian [mm]."""
    texels = np.repeat(light[..., None], 4, axis=-1).astype(np.float32)
    atlas.renderer.write("irradiance_map", texels)
    atlas.blur(Kernel(np.array([sigma**2]), np.ones(1)))
    return atlas.read(BLURRED)[..., 0].astype(float)
