"""The render of Liang et al., section 5: shadow and thickness, G-buffer, scattering by a technique, combination.

    with Stage(open_context(), (512, 512)) as stage:
        stage.draw(scene)
        image = stage.render(profilefit.load("hazard", setting=Setting("diffuse")), mfp, Sampling(64))

Lengths are millimetres of one world scale. Irradiance is diffuse light, so a law of the diffuse setting is meant; one
of the searchlight setting may be passed as well, to see the difference.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Self, TypeVar

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.checks import checked_whole
from profilefit.errors import InputError
from profilefit.scenes.stage.buffers import Buffers, Singles, Targets, pixels
from profilefit.scenes.stage.gather import Law, technique
from profilefit.scenes.stage.geometry import SHADOW_SIDE, Geometry
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.technique import EXITANCE, RADIANCE, Frame, FullScreen, Pass, Technique, combination
from profilefit.scenes.stage.world import Part, Scene

Floats = NDArray[np.float64]
DEFAULT = Sampling()
By = Law | Technique
MOST_PIXELS = 16384  # of a side: what OpenGL drivers take at most
# Of the time that passed until OpenGL had finished. A driver that says less put work off beyond the query's end, as
# Mesa's llvmpipe does, and the clock on the wall is right.
TRUSTED = 0.5
LONGEST_QUERY = 4.0  # seconds: the query counts nanoseconds in 32 bits
PASSES = ("scatter", "frame")


class Stage:
    """The four passes over targets of one size, in one context. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], shadow_side: int = SHADOW_SIDE):
        """size  width, height [pixels];  shadow_side  of the shadow map [texels]"""
        self.context = context
        side = checked_whole("shadow_side", shadow_side, 1, MOST_PIXELS)
        self.size = (
            checked_whole("width", size[0], 1, MOST_PIXELS),
            checked_whole("height", size[1], 1, MOST_PIXELS),
        )
        self.compile_milliseconds: dict[str, float] = {}
        self.targets = Targets(context, self.size)
        self._geometry = Geometry(context, side)
        self._passes: dict[str, FullScreen] = {}  # by their sources
        self._released = False
        self._view: tuple[float, bool] | None = None  # side of a pixel [mm], and whether it is in perspective
        self._scene: Scene | None = None
        self._mean_reflectance: Floats | None = None

    def draw(self, scene: Scene) -> None:
        """Passes 1 and 2: the G-buffer of a scene."""
        self._alive()
        self._geometry.draw(scene, self.targets.surface)
        camera = scene.camera
        self._seen(camera.pixel(self.size[1]), camera.is_perspective, scene)

    def unwrap(self, part: Part, target: moderngl.Framebuffer, inset: tuple[float, float]) -> None:
        """A part of the scene last drawn, laid out over its uv into four float textures: positions in the world.

        inset  share of the target that u and v from 0 to 1 take
        """
        self._alive()
        if self._scene is None or not any(one is part for one in self._scene.parts):
            raise InputError("part must be one of the scene last drawn, got another one")
        self._geometry.unwrap(part, self._scene, target, inset)

    def upload(self, buffers: Buffers) -> None:
        """A G-buffer of numpy arrays in place of a scene; there is no light then, so `render` has no highlights."""
        self._alive()
        if buffers.size != self.size:
            raise InputError(f"buffers must be {self.size} pixels, as the stage is, got {buffers.size}")
        self.targets.upload(buffers)
        self._seen(buffers.pixel, buffers.is_perspective, None)

    def buffers(self) -> Buffers:
        """The G-buffer as numpy arrays."""
        return self.targets.read(*self._ready())

    def scatter(
        self,
        law: By,
        mfp: ArrayLike,
        sampling: Sampling = DEFAULT,
        fixed_alpha: ArrayLike | None = None,
        rows: tuple[int, int] | None = None,
    ) -> Singles:
        """(h, w, 3) radiant exitance, A times the blurred irradiance, in its unit; radiance is that over pi. Pass 3.

        law  with a shader source, or an `ExactLaw`, which is sampled; or a technique of another kind
        mfp  transport mean free path l* of red, green and blue, or one for all [mm]
        fixed_alpha  reduced single-scattering albedo of the three, or one for all; by default that of A, pixel by pixel
        rows  the first, and the first beyond: only these are drawn and returned, though they gather from all
        """
        first, last = rows or (0, self.size[1])
        target = self.targets.into(EXITANCE)
        target.scissor = (0, first, self.size[0], last - first)
        try:
            self._scatter(law, mfp, sampling, fixed_alpha)
        finally:
            target.scissor = (0, 0, *self.size)
        return pixels(self.targets.map(EXITANCE))[first:last, :, :3]

    def render(
        self, law: By, mfp: ArrayLike, sampling: Sampling = DEFAULT, fixed_alpha: ArrayLike | None = None
    ) -> Singles:
        """(h, w, 3) linear radiance to the camera [light's unit / sr]; arguments as for `scatter`. Passes 3 and 4."""
        self._combine(*self._scatter(law, mfp, sampling, fixed_alpha))
        return pixels(self.targets.map(RADIANCE))[..., :3]

    def time(
        self,
        law: By,
        mfp: ArrayLike,
        sampling: Sampling = DEFAULT,
        repeats: int = 5,
        passes: str = "scatter",
        fixed_alpha: ArrayLike | None = None,
    ) -> list[float]:
        """Milliseconds of each repeat, by the driver's clock where it is to be trusted; all is compiled before.

        passes  "scatter", pass 3 alone, or "frame", all four of the scene last drawn
        """
        if passes not in PASSES:
            raise InputError(f"passes must be one of {', '.join(PASSES)}, got {passes!r}")
        if passes == "frame" and self._scene is None:
            raise InputError("passes must be scatter where no scene was drawn, got 'frame'")
        by = technique(law)  # a law's source is written once, and not in the time that is taken
        self._frame(by, mfp, sampling, passes, fixed_alpha)
        return [self._timed(lambda: self._frame(by, mfp, sampling, passes, fixed_alpha)) for _ in range(repeats)]

    def release(self) -> None:
        """Frees all that the stage has on the GPU; the context is its owner's."""
        for one in self._passes.values():
            one.release()
        self._geometry.release()
        self.targets.release()
        self._passes.clear()
        self._released = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def _seen(self, pixel: float, is_perspective: bool, scene: Scene | None) -> None:
        self._view, self._scene, self._mean_reflectance = (pixel, is_perspective), scene, None

    def _alive(self) -> None:
        if self._released:
            raise InputError("stage must not be used after it was released: make another one")

    def _ready(self) -> tuple[float, bool]:
        self._alive()
        if self._view is None:
            raise InputError("stage must have a scene or buffers: draw or upload comes first")
        return self._view

    def _scatter(
        self, law: By, mfp: ArrayLike, sampling: Sampling, fixed_alpha: ArrayLike | None
    ) -> tuple[Technique, Frame]:
        by, view = technique(law), self._ready()
        frame = Frame(self.size, *view, sampling, _lengths(mfp), _albedos(fixed_alpha), self._mean, self._scene)
        by.before(self)
        for one in by.passes(frame):
            self._run(one)
        return by, frame

    def _combine(self, by: Technique, frame: Frame) -> None:
        self._run(combination(by, frame))

    def _frame(self, law: By, mfp: ArrayLike, sampling: Sampling, passes: str, fixed_alpha: ArrayLike | None) -> None:
        if passes == "frame" and self._scene is not None:
            self._geometry.draw(self._scene, self.targets.surface)
        drawn = self._scatter(law, mfp, sampling, fixed_alpha)
        if passes == "frame":
            self._combine(*drawn)

    def _timed(self, work: Callable[[], None]) -> float:
        query = self.context.query(time=True)
        self.context.finish()
        start = time.perf_counter()
        with query:
            work()
        self.context.finish()
        wall = time.perf_counter() - start
        by_driver = query.elapsed / 1e9
        return 1e3 * (by_driver if by_driver > TRUSTED * wall and wall < LONGEST_QUERY else wall)

    def _mean(self) -> Floats:
        """Mean A of what was drawn last, computed once."""
        if self._mean_reflectance is None:
            self._mean_reflectance = _mean_reflectance(self.buffers())
        return self._mean_reflectance

    def _run(self, one: Pass) -> None:
        """Compiled once; how long that took is in `compile_milliseconds`."""
        if one.source not in self._passes:
            self._passes[one.source] = made = FullScreen(self.context, one)
            self.compile_milliseconds[one.name] = made.program.milliseconds
        self._passes[one.source].run(one, self.targets)


def _lengths(mfp: ArrayLike) -> Floats:
    lengths = _three("mfp", mfp)
    if not np.all((lengths > 0) & (lengths < np.inf)):
        raise InputError(f"mfp must be lengths > 0 [mm], got {mfp!r}")
    return lengths


def _albedos(alpha: ArrayLike | None) -> Floats | None:
    if alpha is None:
        return None
    albedos = _three("fixed_alpha", alpha)
    if not np.all((albedos >= 0) & (albedos <= 1)):
        raise InputError(f"fixed_alpha must be albedos in [0, 1], got {alpha!r}")
    return albedos


def _three(name: str, value: ArrayLike) -> Floats:
    try:
        return np.broadcast_to(np.asarray(value, float), 3).copy()
    except (TypeError, ValueError):
        raise InputError(f"{name} must be one number or three, got {value!r}") from None


def _mean_reflectance(buffers: Buffers) -> Floats:
    """(3,) mean A where light scatters inside; 0 where that is nowhere."""
    inside = buffers.mask > 0.5
    return buffers.reflectance[inside].mean(axis=0, dtype=float) if inside.any() else np.zeros(3)


ROWS = 270  # of the picture that is searched with
STEPS = 12  # of the bisection: the height to 1 in 4000
SPAN = 0.05, 8.0  # heights tried, in those of the scene's camera
TOLERANCE = 0.01
Zoomed = TypeVar("Zoomed", bound=Scene)


def covering(context: moderngl.Context, scene: Zoomed, share: float, size: tuple[int, int] = (1920, 1080)) -> Zoomed:
    """The scene zoomed so that translucent pixels are this share of the screen, to 1 %; size only as a shape."""
    if not 0 < share < 1:
        raise InputError(f"share must be in (0, 1), got {share!r}")
    columns = round(ROWS * size[0] / size[1])
    near, far = (factor * scene.camera.height for factor in SPAN)
    with Stage(context, (columns, ROWS), shadow_side=16) as stage:
        for _ in range(STEPS):
            middle = np.sqrt(near * far)
            is_covered = covered(stage, scene.zoomed(middle)) > share
            near, far = (middle, far) if is_covered else (near, middle)
        found = scene.zoomed(float(np.sqrt(near * far)))
        reached = covered(stage, found)
    if abs(reached - share) > TOLERANCE:
        raise InputError(f"share must be one that the scene can cover by zooming, got {share!r}: {reached:.3f} is near")
    return found


def covered(stage: Stage, scene: Scene) -> float:
    """Share of the stage's pixels that are translucent [-]."""
    stage.draw(scene)
    return float(np.mean(stage.buffers().mask > 0.5))
