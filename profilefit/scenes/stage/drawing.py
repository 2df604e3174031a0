"""Drawing of a scene's file: the picture in full size, and at the size of the reference its error beside rivals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any, Protocol

import moderngl

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.judge import (
    EXPOSURE,
    TURNS,
    ChartPoint,
    Judge,
    Rendering,
    RenderResult,
    Rival,
    SceneImage,
    points,
    to_srgb,
)
from profilefit.scenes.stage.request import ViewRequest
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import NamedTechnique, Technique

RIVALS, FRAMES = 2, 3  # other techniques in a comparison; turns in which a frame of full size is timed


class Drawing(Protocol):
    """Scene that is ready to be drawn at the size of a request, by any of its techniques."""

    @property
    def judge(self) -> Judge | None:
        """Judge with the reference; None where the drawing was opened without."""

    def shot(self, of: Any, turns: int) -> Rendering:
        """Draw the picture by the technique of a request, its frame timed in so many turns, or in none."""

    def points(self, of: Any, numbers: Sequence[int]) -> list[ChartPoint]:
        """Return error and cost of the technique of a request with each number of samples."""

    def exposure(self, radiance: Floats) -> float:
        """Return the exposure of a picture that has no reference."""


Opened = Callable[[moderngl.Context, Any, bool], AbstractContextManager[Drawing]]


@dataclass(frozen=True)
class Drawer:
    """Way to draw a scene.

    Attributes:
        opened: opens the drawing of a request, with its reference or without.
        rivals: changes of the table [technique], from which those of another kind are drawn for comparison.
        light: that errors are of.
    """

    opened: Opened
    rivals: tuple[Mapping[str, Any], ...]
    light: str = "scattered light"

    def picture(self, context: moderngl.Context, of: ViewRequest, exposure: float | None = None) -> SceneImage:
        """Draw the picture without a reference; exposure  that of the frame before, if there is one."""
        with self.opened(context, of, False) as drawing:
            shot = drawing.shot(of, FRAMES)
            factor = drawing.exposure(shot.radiance) if exposure is None else exposure
        image = to_srgb(shot.radiance[::-1], factor)
        return SceneImage(image, shot.label, of.technique.samples, shot.frame, shot.passes, factor)

    def draw(self, context: moderngl.Context, of: ViewRequest, exposure: float | None = None) -> RenderResult:
        """Draw the picture, its reference and two rivals, with errors and costs; exposure  see `picture`."""
        of.require_reference()
        small, samples = of.of_reference, of.technique.samples
        kind = getattr(of.technique, "kind", None)
        rivals = [one for one in self.rivals if one["kind"] != kind][:RIVALS]
        with self.opened(context, small, True) as drawing:
            judge = drawing.judge
            assert judge is not None
            judge = judge if exposure is None else replace(judge, exposure=exposure)
            chart = drawing.points(small, small.numbers)
            shot = drawing.shot(small, TURNS if small.size == of.size else 0)
            result = judge.result(shot, chart, samples, self.light)
            others = [self._rival(drawing, judge, small, one) for one in rivals]
        if small.size == of.size:
            return replace(result, rivals=tuple(others))
        with self.opened(context, of, False) as drawing:
            shot = drawing.shot(of, FRAMES)
            images = [
                to_srgb(drawing.shot(of.changed(technique=one), 0).radiance[::-1], judge.exposure) for one in rivals
            ]
        others = [replace(one, picture=image) for one, image in zip(others, images, strict=True)]
        picture = to_srgb(shot.radiance[::-1], judge.exposure)
        return replace(result, picture=picture, frame=shot.frame, passes=shot.passes, rivals=tuple(others))

    @staticmethod
    def _rival(drawing: Drawing, judge: Judge, of: ViewRequest, change: Mapping[str, Any]) -> Rival:
        other = of.changed(technique=dict(change))
        [point] = drawing.points(other, [other.technique.samples])
        return Rival(point, to_srgb(drawing.shot(other, 0).radiance[::-1], judge.exposure))


class RayRender(Protocol):
    """Render whose pixels are means of rays, by techniques `by` of its scene."""

    def picture(self, by: Any, samples: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels."""

    def points(self, by: Any, numbers: Sequence[int]) -> list[ChartPoint]:
        """Return error and cost of each number of samples."""

    def time(self, by: Any, samples: int) -> float:
        """Return the milliseconds of a picture."""

    def maps(self) -> dict[str, float]:
        """Draw what comes before the picture, and return the milliseconds of each part."""


@dataclass(frozen=True)
class RayDrawing:
    """Drawing by a render.

    Attributes:
        render: of a scene.
        judge: of radiance.
        technique: from a request to the technique's name and what the render takes as such.
        exposure: see `Drawing`.
    """

    render: RayRender
    judge: Judge | None
    technique: Callable[[Any], tuple[str, Any]]
    exposure: Callable[[Floats], float]

    def shot(self, of: ViewRequest, turns: int) -> Rendering:
        """See `Drawing`."""
        (label, by), samples = self.technique(of), of.technique.samples
        maps = [self.render.maps() for _ in range(turns)]
        radiance = self.render.picture(by, samples)
        view = [self.render.time(by, samples) for _ in range(turns)]
        frame = tuple(sum(before.values()) + own for before, own in zip(maps, view, strict=True))
        names = maps[0] if maps else {}
        passes = {name: tuple(one[name] for one in maps) for name in names} | ({"view": tuple(view)} if names else {})
        return Rendering(label, radiance, frame, passes)

    def points(self, of: ViewRequest, numbers: Sequence[int]) -> list[ChartPoint]:
        """See `Drawing`."""
        return self.render.points(self.technique(of)[1], numbers)


@dataclass(frozen=True)
class StageDrawing:
    """Drawing by a stage.

    Attributes:
        stage: that has drawn the scene.
        technique: from a request to the technique whose scattered light is judged, and the one that is shown.
        judge: of scattered light.
    """

    stage: Stage
    technique: Callable[[Any], tuple[NamedTechnique, Technique]]
    judge: Judge | None

    def shot(self, of: ViewRequest, turns: int) -> Rendering:
        """See `Drawing`."""
        (named, shown), sampling = self.technique(of), of.sampling
        radiance = self.stage.render(shown, named.mfp, sampling, named.alpha)
        frame = self.stage.time(shown, named.mfp, sampling, turns, "frame", named.alpha) if turns else ()
        judged = self.stage.scatter(named.by, named.mfp, sampling, named.alpha)
        return Rendering(named.label, radiance, tuple(frame), {}, judged)

    def points(self, of: ViewRequest, numbers: Sequence[int]) -> list[ChartPoint]:
        """See `Drawing`."""
        assert self.judge is not None
        return points(self.stage, self.judge, self.technique(of)[0], of.sampling, numbers)

    def exposure(self, radiance: Floats) -> float:
        """See `Drawing`."""
        return EXPOSURE
