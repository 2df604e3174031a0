"""Pictures of a technique and their judge: a reference, errors against it, and points of error against cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats, require
from profilefit.scenes.stage.exact_law import DIFFUSE, CurveTable
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import UNKNOWN, TruthError, exitance_of, own_error, wider_error
from profilefit.scenes.stage.reference.whole import whole_elements
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import NamedTechnique
from profilefit.scenes.stage.world import INSIDE, Scene

Bytes = NDArray[np.uint8]
TURNS = 5
EXPOSURE = 1.1  # of pictures whose lamp is chosen for it: few of their pixels are clipped by it
SQUARE = 7  # pixels of a side, over which a map of errors that are noisy takes a mean


@dataclass(frozen=True)
class ChartPoint:
    """Error and cost of a technique with so many samples of a pixel (of the separable filter: taps).

    rmse          root mean square error of the light, over the mean of the reference [-]
    milliseconds  of the technique's passes, each time that they were run (turns,)
    """

    label: str
    samples: int
    rmse: float
    milliseconds: tuple[float, ...]


@dataclass(frozen=True)
class Rendering:
    """Picture by one technique, row 0 at the bottom.

    Attributes:
        label: of the technique.
        radiance: (h, w, 3) to the eye.
        frame: milliseconds of a frame, each time that it was drawn.
        passes: milliseconds of its parts, by name.
        judged: (h, w, 3) light whose error is measured, in the reference's unit; None where it is the radiance.
    """

    label: str
    radiance: NDArray[Any]
    frame: tuple[float, ...]
    passes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    judged: NDArray[Any] | None = None


@dataclass(frozen=True)
class SceneImage:
    """Scene, drawn by one technique; row 0 at the top.

    picture  (h, w, 3) as a screen shows it
    label, samples  of the technique
    frame, passes  milliseconds of a whole frame, each time that it was drawn (turns,); of its parts by their names
    exposure  factor of the radiance
    """

    picture: Bytes
    label: str
    samples: int
    frame: tuple[float, ...]
    passes: Mapping[str, tuple[float, ...]]
    exposure: float


@dataclass(frozen=True)
class Rival:
    """Picture (h, w, 3) by another technique, with its error and cost."""

    point: ChartPoint
    picture: Bytes


@dataclass(frozen=True)
class RenderResult(SceneImage):
    """Picture beside its reference; row 0 at the top.

    truth  (rows, columns, 3) the reference, as a screen shows it
    error  (rows, columns) root mean square of the channels' errors, over the mean of the reference [-]; NaN where none
           is measured. Its own root mean square is `point.rmse`, or more if the reference has noise
    chart  the point of the technique, and others with other numbers of samples, the least first
    of     light that the errors are of
    """

    truth: Bytes
    error: Floats
    point: ChartPoint
    chart: tuple[ChartPoint, ...]
    truth_error: TruthError
    of: str = "scattered light"
    rivals: tuple[Rival, ...] = ()


@dataclass(frozen=True)
class Judge:
    """Reference of a picture (h, w, 3), row 0 at the bottom, and the pixels (h, w) whose errors count.

    truth_error  of the reference itself;  exposure  by which pictures are shown
    halves       (2, h, w, 3) independent estimates, whose mean the reference is: errors are then without their noise
    """

    reference: Floats
    mask: NDArray[np.bool_]
    truth_error: TruthError = UNKNOWN
    exposure: float = EXPOSURE
    halves: Floats | None = None

    @classmethod
    def of_halves(cls, halves: Floats, white: float) -> Judge:
        """Return the judge of all pixels of a picture that was estimated twice (2, h, w, 3), each with its own error.

        white  share of the reference's numbers that a picture does not clip [-]
        """
        reference = np.asarray(halves.mean(axis=0))
        share = np.sqrt(np.mean((halves[1] - halves[0]) ** 2, axis=-1)) / 2.0 / np.mean(reference)
        mask, exposure = np.ones(reference.shape[:2], bool), exposure_of(reference, white)
        return cls(reference, mask, TruthError.of(share), exposure, halves)

    @property
    def mean(self) -> float:
        """Mean of the reference where errors count, in its unit."""
        return float(np.mean(self.reference[self.mask]))

    def rmse(self, picture: NDArray[np.floating]) -> float:
        """Return the root mean square error of a picture (h, w, 3), over the reference's mean [-]."""
        return float(np.sqrt(np.maximum(np.mean(self._squares(picture)[self.mask]), 0.0)) / self.mean)

    def relative_error(self, picture: NDArray[np.floating]) -> Floats:
        """Return a map (h, w) of root mean squares over the channels, over the same mean [-]; NaN where none counts.

        Its own root mean square is `rmse`. With `halves` it is a mean over squares of pixels around each.
        """
        squares = self._squares(picture)
        if self.halves is not None:
            squares = np.maximum(uniform_filter(squares, SQUARE, mode="nearest"), 0.0)
        return np.where(self.mask, np.sqrt(squares) / self.mean, np.nan)

    def points(
        self,
        label: str,
        samples: Sequence[int],
        draw: Callable[[int], NDArray[np.floating]],
        time: Callable[[int], float],
        turns: int = TURNS,
    ) -> list[ChartPoint]:
        """Return error and cost of a technique with each number of samples, timed in so many turns.

        Times are taken in turns, so that what else the machine does hits all of them.

        draw, time  functions of a number: the picture (h, w, 3), and the milliseconds of passes that `draw` compiled
        """
        errors = [self.rmse(draw(number)) for number in samples]
        times = np.array([[time(number) for number in samples] for _ in range(turns)])
        return [
            ChartPoint(label, number, error, tuple(turn))
            for number, error, turn in zip(samples, errors, times.T.tolist(), strict=True)
        ]

    def result(
        self, shot: Rendering, chart: Sequence[ChartPoint], samples: int, of: str = "scattered light"
    ) -> RenderResult:
        """Return a shot, whose error is measured, beside its reference.

        chart  points of the technique, one of them of `samples`;  of  light that the errors are of
        """
        judged = shot.radiance if shot.judged is None else shot.judged
        # Whatever else than the judged light is in the picture is its own in the reference, too.
        true = self.reference if shot.judged is None else shot.radiance + (self.reference - judged) / np.pi
        return RenderResult(
            picture=to_srgb(shot.radiance[::-1], self.exposure),
            label=shot.label,
            samples=samples,
            frame=shot.frame,
            passes=shot.passes,
            exposure=self.exposure,
            truth=to_srgb(true[::-1], self.exposure),
            error=self.relative_error(judged)[::-1],
            point=next(point for point in chart if point.samples == samples),
            chart=tuple(chart),
            truth_error=self.truth_error,
            of=of,
        )

    def _squares(self, picture: NDArray[np.floating]) -> Floats:
        """Return the mean square error (h, w) over the channels, which may be below 0 where noise is left out."""
        first, second = (self.reference, self.reference) if self.halves is None else self.halves
        return np.asarray(np.mean((picture - first) * (picture - second), axis=-1))


def points(
    stage: Stage, judge: Judge, named: NamedTechnique, sampling: Sampling, samples: Sequence[int], turns: int = TURNS
) -> list[ChartPoint]:
    """Return error and cost of a stage's technique with each number of samples."""

    def draw(number: int) -> NDArray[np.floating]:
        return stage.scatter(named.by, named.mfp, replace(sampling, samples=number), named.alpha)

    def time(number: int) -> float:
        return stage.time(named.by, named.mfp, replace(sampling, samples=number), 1, fixed_alpha=named.alpha)[0]

    return judge.points(named.label, samples, draw, time, turns)


def whole_judge(stage: Stage, scene: Scene, mfp: ArrayLike, table: CurveTable | Setting) -> Judge:
    """Return the judge of a scene that a stage has drawn: the integral over its whole surface, hidden parts included.

    scene  whose parts do not lie inside each other;  mfp, table  see `surface_judge`
    """
    buffers, camera = stage.true_buffers(), scene.camera
    side = camera.pixel(stage.size[1]) * (camera.distance if camera.is_perspective else 1.0)
    whole, wider = whole_elements(stage, scene, side, 2.0 * side)
    error = wider_error(buffers, mfp, table, whole, wider)
    return Judge(exitance_of(buffers, mfp, table, whole), buffers.mask > INSIDE, error)


def surface_judge(
    stage: Stage, scene: Scene, mfp: ArrayLike, table: CurveTable | Setting = DIFFUSE, has_error: bool = True
) -> Judge:
    """Return the judge of a scene that a stage has drawn: the surface integral, all over its pixels.

    scene  drawn once more, with pixels of half the side, if the error of the reference is to be estimated
    mfp    of the three channels (3,) [mm];  table  of curves, or the setting of the exact half space
    """
    error = UNKNOWN
    if has_error:  # of the sum over pixels alone, without the noise of the screen's occlusion
        with Stage(stage.context, (2 * stage.size[0], 2 * stage.size[1])) as fine:
            fine.draw(replace(scene, has_occlusion=False))
            error = own_error(fine.buffers(), mfp, table)
    buffers = stage.true_buffers()
    return Judge(exitance_of(buffers, mfp, table), buffers.mask > INSIDE, error)


def exposure_of(light: NDArray[np.floating], white: float) -> float:
    """Return the exposure by which so large a share of the numbers is at most white."""
    return float(1.0 / max(np.quantile(light, white), 1e-30))


def to_srgb(image: ArrayLike, exposure: float = 1.0) -> Bytes:
    """Return linear light (h, w, 3) times `exposure` as 8-bit values of a screen (IEC 61966-2-1), rows as they are."""
    require(exposure > 0, "exposure", "a factor > 0", exposure)
    return np.round(srgb_codes(np.asarray(image, float) * exposure)).astype(np.uint8)


def srgb_codes(linear: ArrayLike) -> Floats:
    """Return values of a screen [8-bit steps, 0 to 255] for linear ones, white 1; they are not rounded."""
    clipped = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return 255.0 * np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
