"""Needs of scenes: of a heart an atlas, of a sea terms of its water's light, a splat and steps, of fur its layers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import moderngl
import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.scenes.fur.scene import FurRequest
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import MOST, WAYS, FurTrial, LayerTechnique, least_layers, trial
from profilefit.scenes.heart.atlas import Atlas, atlas_size
from profilefit.scenes.heart.chart import SURE, occlusion_error
from profilefit.scenes.heart.meshes import CHARTS_END, off_edges
from profilefit.scenes.heart.passes import ATLAS, Balanced
from profilefit.scenes.heart.scene import HeartRequest, light_of, staged
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.sea.caustics import focus, splat_for
from profilefit.scenes.sea.haze import BROADENED, SCALED, SINGLE, sunlit_haze
from profilefit.scenes.sea.passes import axes, reach_of
from profilefit.scenes.sea.scene import SPLATS, SeaRequest
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import FINE, refracted
from profilefit.scenes.stage.reference.surface import evenly, sees, world
from profilefit.scenes.stage.world import INSIDE
from profilefit.studies.stability.scenes import SEARCHES

CHOSEN = 400  # pixels
# What is hidden has a part in an error from this share of the tolerance on: in random scenes (`python -m
# benchmarks.heart`) where the screen breaks it and less is hidden, coarse pixels do.
PART = 0.25
TEXELS = 6 * CHARTS_END  # of a side, of what light goes in


@dataclass(frozen=True)
class AtlasNeed:
    """Root mean squares over the mean light [-].

    error   of screen space alone, with many samples;  hidden  the part that hidden surface causes
    """

    error: float
    hidden: float
    tolerance: float

    @property
    def is_broken(self) -> bool:
        """Whether screen space alone exceeds the tolerance."""
        return self.error > self.tolerance

    @property
    def verdict(self) -> str:
        return "atlas" if self.is_broken and self.hidden > PART * self.tolerance else "no atlas"


def atlas_need(context: moderngl.Context, of: HeartRequest) -> AtlasNeed:
    """Return what a heart's scene needs, by sums at some hundred pixels; a minute where no record has its layers."""
    light = light_of(of, of.technique.gaussians)
    size, margin = atlas_size(of.mesh, 0.0, TEXELS, CHARTS_END)
    with staged(context, of, light) as (stage, scene), Atlas(context, size, margin) as fine:
        [part] = scene.parts
        fine.draw(stage, part)
        elements, buffers = fine.elements(), stage.buffers()
        by = Balanced.of(fine, part, light.kernel, np.inf, ATLAS, light.mfp)
        gathered = stage.scatter(by, light.mfp, SURE)
    places = world(buffers, of.camera)
    inside = buffers.mask > INSIDE
    judged = inside & off_edges(of.surface.kind, of.surface.size, places, light.mfp[0])
    at = evenly(judged if judged.any() else inside, CHOSEN)
    places, own, colour = places[at], buffers.irradiance[at].astype(float), buffers.reflectance[at].astype(float)
    off = occlusion_error(elements, sees(buffers, of.camera, elements.points), light.kernel, places, own)
    whole = summed(elements, light.kernel.variances, light.kernel.weights, places, own)
    error, hidden = (np.sqrt(np.mean(one**2)) for one in (gathered[at] - colour * whole, colour * off))
    mean = np.mean(colour * whole)
    return AtlasNeed(float(error / mean), float(hidden / mean), of.technique.tolerance)


CHEAPER = (SINGLE, SCALED)  # than what they are held against, the cheapest first
TOLERANCE = 0.1  # of the haze; a file says none
STEPS = (0, 8, 16)  # before three of Newton's iterations, which without steps are plain ones from the mean plane
HELD = {0: SEARCHES["Newton's"][1], 8: SEARCHES["8 steps"][1], 16: SEARCHES["16 steps"][1]}


@dataclass(frozen=True)
class SeaNeed:
    """The numbers that the answers rest on [-].

    haze         how far each of `CHEAPER` is off the broadened haze, in the worst colour and direction
    focus        F of the floor: light folds before it from 1 on
    light, view  S of the steepest ray of sun, and of the picture, that meets the floor
    """

    haze: Mapping[str, float]
    focus: float
    light: float
    view: float
    tolerance: float = TOLERANCE

    @property
    def terms(self) -> str:
        """The cheapest of `haze.KINDS` within the tolerance."""
        return next((kind for kind in CHEAPER if self.haze[kind] <= self.tolerance), BROADENED)

    @property
    def splat(self) -> str:
        """Splat by its name in a file."""
        return next(name for name, one in SPLATS.items() if one is splat_for(self.focus))

    @property
    def light_steps(self) -> int:
        return steps_for(self.light)

    @property
    def view_steps(self) -> int:
        return steps_for(self.view)


def steps_for(steepness: float) -> int:
    """Return the fewest of `STEPS` that are held to be right at S [-]."""
    return next((one for one in STEPS if steepness < HELD[one]), STEPS[-1])


def sea_need(of: SeaRequest) -> SeaNeed:
    """Return what a scene needs, by closed forms: nothing is drawn."""
    world = of.world
    down = -_views(of)[:, 2]
    above = of.camera.eye[2] - world.floor.mean
    # Cosine to the vertical of the steepest view that meets the floor no farther away than one sees; a picture's least
    # is at a corner.
    least = max(above / reach_of(world), float(np.min(down)))
    return SeaNeed(
        haze=_haze(of, world),
        focus=focus(world.sea, world.depth, world.n, world.tilt),
        light=world.floor.steepest * steepest_ray(world),
        view=world.floor.steepest * float(np.sqrt(max(1.0 / least**2 - 1.0, 0.0))),
    )


def steepest_ray(world: World) -> float:
    """Return tangent to the vertical of the sun's steepest ray below the waves [-]."""
    x = np.arange(FINE) * world.sea.tile / FINE
    _, *slope = world.sea.lattice(x, x)
    along, across, flux = refracted(world.tilt, (slope[0], slope[1]), world.n)
    return float(np.max(np.where(flux > 0, np.hypot(along, across), 0.0)))


def _haze(of: SeaRequest, world: World) -> dict[str, float]:
    """Return the worst errors of the haze toward the picture's middle and corners, below a level sea and a calm ray."""
    depth = -of.camera.eye[2] * world.slant
    worst = dict.fromkeys(CHEAPER, 0.0)
    for view in _views(of):
        cosine = float(view @ world.beam)
        for c, omega in zip(world.c.tolist(), world.omega.tolist(), strict=True):
            broadened = sunlit_haze(omega, c * depth, cosine, world.lobes, BROADENED)
            for kind in CHEAPER if broadened > 0 else ():
                error = abs(sunlit_haze(omega, c * depth, cosine, world.lobes, kind) / broadened - 1.0)
                worst[kind] = max(worst[kind], error)
    return worst


def _views(of: SeaRequest) -> Floats:
    """Return unit vectors (5, 3) to the middle of the picture and to its corners."""
    right, up, forward = axes(of.camera, of.size)
    sides = ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1))
    views = np.array([forward + x * right + y * up for x, y in sides])
    return np.asarray(views / np.linalg.norm(views, axis=1, keepdims=True))


ANGLES = (0, 30, 45, 60, 75, 85)  # of the view to the normal [degrees]
WORST = 75  # the layers of a picture are those of this angle: what a ball shows beyond is a rim of 3 % of its radius
# Of a layer, over that of shells, by the strands that it tests: `python -m benchmarks.fur --only cost`, in software.
COST = {0: 1.0, 1: 1.5, 2: 2.0}

STRANDS, MOST_STRANDS = 500, 1 << 15  # of a patch, at least and at most
WIDER = 1.2  # than a ray's way over the skin: it comes by no strand twice
PATCHES, RAYS = 24, 1000  # at most, and rays on each
WORK = 1200  # patches times layers, at most
FEWEST, CLEAR = 5, 4.0  # patches, and standard errors from the tolerance, after which no more are looked at
# Standard errors by which the mean must be within the tolerance; a share of it that is not worth more rays.
SAFE, NEGLIGIBLE = 2.0, 0.08
COARSE = 20  # numbers of layers are found to one in so many
LEAST_TOLERANCE = 0.01  # of less, too few of the rays are wrong to tell how many
LONGEST = 100.0  # L over the strands' mean distance: rays are followed in steps of half of it


@dataclass(frozen=True)
class FurNeed:
    """The least layers by angle [degrees] and way's name: None where more than `most` are needed.

    tolerance  rms error of the heights of first hits over the length [-];  angle  that a picture's layers are of
    """

    layers: Mapping[int, Mapping[str, int | None]]
    tolerance: float
    angle: int = WORST
    most: int = MOST

    def cheapest(self, angle: int) -> LayerTechnique | None:
        """Return the way of the least layers times cost at an angle; None if no way is within the tolerance there."""
        return cheapest(self.layers[angle])

    @property
    def way(self) -> LayerTechnique | None:
        """The cheapest of a picture."""
        return self.cheapest(self.angle)

    @property
    def count(self) -> int | None:
        """Number of layers of that way."""
        return None if self.way is None else self.layers[self.angle][self.way.name]


def cheapest(layers: Mapping[str, int | None]) -> LayerTechnique | None:
    """Return the way whose layers, by its name, cost the least together; None if none has any."""
    costs = {way: count * COST[way.tested] for way in WAYS if (count := layers[way.name]) is not None}
    return min(costs, key=lambda way: costs[way], default=None)


@dataclass(frozen=True, eq=False)
class RandomFur:
    """Upright strands, seen at an angle to the normal [rad]: patches of them, made as they are asked for.

    density  of strands [1/length^2];  radius, length  of one
    """

    density: float
    radius: float
    length: float
    theta: float
    seed: int = 0
    _made: list[FurTrial] = field(init=False, default_factory=list)

    @property
    def side(self) -> float:
        """Side of a patch. Where it has its most strands a ray may come to its end, but hardly ever unseen."""
        way = WIDER * self.length * float(np.tan(self.theta))
        least, most = (float(np.sqrt(count / self.density)) for count in (STRANDS, MOST_STRANDS))
        return min(max(way, least), most)

    def trial(self, number: int) -> FurTrial:
        """Return rays on one of the patches."""
        while len(self._made) <= number:
            one = 1000 * self.seed + len(self._made)
            patch = random_patch(self.density, self.radius, self.length, self.side, one)
            self._made.append(trial(patch, self.theta, RAYS, one))
        return self._made[number]

    def largest(self, way: LayerTechnique, layers: int, goal: float) -> float:
        """Return an upper limit of the mean square of so many layers' errors, by as many patches as decide on a goal.

        Of all rays, with a chance of some 98 %.
        """
        squares: list[float] = []
        mean, noise = 0.0, np.inf
        for number in range(max(min(PATCHES, WORK // layers), FEWEST)):
            squares.append(self.trial(number).error(way, layers) ** 2)
            if len(squares) >= FEWEST:
                mean, noise = float(np.mean(squares)), float(np.std(squares, ddof=1)) / len(squares) ** 0.5
                if abs(mean - goal) > CLEAR * noise or SAFE * noise < NEGLIGIBLE * goal:
                    break
        return mean + SAFE * noise

    def least_layers(self, way: LayerTechnique, tolerance: float) -> int | None:
        """Return the fewest layers that hold, to one in `COARSE`; None if no number up to `MOST` does."""
        goal = tolerance**2
        return least_layers(lambda layers: self.largest(way, layers, goal), goal, MOST, COARSE)


def fur_need(of: FurRequest, angles: Iterable[int] = ANGLES) -> FurNeed:
    """Return what a file's strands need, upright on a flat skin.

    angles  [degrees], in [0, 90), `WORST` among them

    Strands that lean by f along the view's way over the skin are as upright ones seen at the tangent |tan(theta) - f|.
    """
    strands, tolerance, rays = of.fur, of.technique.tolerance, "where layers are chosen by rays, got"
    if tolerance < LEAST_TOLERANCE:
        least = f"{of.file}: [technique] tolerance must be at least {LEAST_TOLERANCE:g}"
        raise InputError(f"{least} {rays} {tolerance:g}")
    if strands.length > (longest := LONGEST * strands.density**-0.5):
        most = f"{of.file}: [fur] length must be at most {LONGEST:g} times the strands' mean distance, {longest:g} mm,"
        raise InputError(f"{most} {rays} {strands.length:g}")
    layers: dict[int, dict[str, int | None]] = {}
    for angle in angles:
        fur = RandomFur(strands.density, strands.radius, strands.length, float(np.radians(angle)), strands.seed)
        layers[angle] = {way.name: fur.least_layers(way, tolerance) for way in WAYS}
    return FurNeed(layers, tolerance)
