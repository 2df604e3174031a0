"""Error of a picture's scattered light against what it costs: points, for a report to draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.stage import By, Stage
from profilefit.scenes.stage.world import Rgb

Floats = NDArray[np.float64]
TURNS = 5


@dataclass(frozen=True)
class Judge:
    """A stage that has drawn a scene, and the truth of it; row 0 at the bottom.

    mfp    of red, green, blue [mm];  truth  (h, w, 3) radiant exitance;  mask  (h, w), where light scatters
    alpha  of the three [-], if not that of each pixel's A
    """

    stage: Stage
    mfp: Rgb
    truth: Floats
    mask: NDArray[np.bool_]
    alpha: Rgb | None = field(default=None, kw_only=True)

    def rmse(self, exitance: NDArray[np.floating]) -> float:
        """Root mean square error of (h, w, 3) where light scatters, over the mean of the truth there [-]."""
        difference = exitance[self.mask] - self.truth[self.mask]
        return float(np.sqrt(np.mean(difference**2)) / np.mean(self.truth[self.mask]))

    def relative_error(self, exitance: NDArray[np.floating]) -> Floats:
        """(h, w) root mean square over the channels, over the same mean [-], NaN elsewhere: its own RMS is `rmse`."""
        error = np.sqrt(np.mean((exitance - self.truth) ** 2, axis=-1)) / np.mean(self.truth[self.mask])
        return np.where(self.mask, error, np.nan)


def points(
    judge: Judge, label: str, by: By, sampling: Sampling, samples: Sequence[int], turns: int = TURNS
) -> list[ChartPoint]:
    """Error and cost of a technique with each number of samples.

    Times are taken in turns, so that what else the machine does hits all of them.
    """
    each = [replace(sampling, samples=number) for number in samples]
    errors = [judge.rmse(judge.stage.scatter(by, judge.mfp, one, judge.alpha)) for one in each]
    times = np.array(
        [[judge.stage.time(by, judge.mfp, one, 1, fixed_alpha=judge.alpha)[0] for one in each] for _ in range(turns)]
    )
    return [
        ChartPoint(label, one.samples, error, tuple(taken))
        for one, error, taken in zip(each, errors, times.T.tolist(), strict=True)
    ]
