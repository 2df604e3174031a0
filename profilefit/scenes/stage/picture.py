"""Pictures: linear light for a screen; a scene as a technique draws it, beside its reference, with error and cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats, require

Bytes = NDArray[np.uint8]


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


class TruthError(NamedTuple):
    """Error of a reference over its mean [-]: half of the pixels and nine in ten are below the first two.

    Of a surface integral it is what half the pixel's side changes, of paths and rays the standard error; the root mean
    square is what outlines set.
    """

    half: float
    most: float
    rms: float

    @classmethod
    def of(cls, share: Floats) -> TruthError:
        """Return the error of pixels whose errors are known, each over the reference's mean [-]."""
        half, most = np.quantile(share, (0.5, 0.9)).tolist()
        return cls(half, most, float(np.sqrt(np.mean(share**2))))


UNKNOWN = TruthError(np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class RenderResult:
    """Scene, drawn beside its reference; row 0 at the top.

    picture, truth  (h, w, 3) as a screen shows them
    error  (h, w) root mean square of the channels' errors, over the mean of the reference [-]; NaN where none is
           measured. Its own root mean square is `point.rmse`, or more if the reference has noise
    chart  the point of the technique, and others with other numbers of samples, the least first
    frame, passes  milliseconds of a whole frame, each time that it was drawn (turns,); of its parts by their names
    of     light that the errors are of
    """

    picture: Bytes
    truth: Bytes
    error: Floats
    point: ChartPoint
    chart: tuple[ChartPoint, ...]
    frame: tuple[float, ...]
    truth_error: TruthError
    of: str = "scattered light"
    passes: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def averaged(fine: Floats, each: int) -> Floats:
    """Return the means (rows, columns, c) of pixels with so many rays along a side, in linear light."""
    rows, columns, channels = fine.shape
    return np.asarray(fine.reshape(rows // each, each, columns // each, each, channels).mean(axis=(1, 3)))


def to_srgb(image: ArrayLike, exposure: float = 1.0) -> Bytes:
    """Return linear light (h, w, 3) times `exposure` as 8-bit values of a screen (IEC 61966-2-1), rows as they are."""
    require(exposure > 0, "exposure", "a factor > 0", exposure)
    return np.round(srgb_codes(np.asarray(image, float) * exposure)).astype(np.uint8)


def srgb_codes(linear: ArrayLike) -> Floats:
    """Return values of a screen [8-bit steps, 0 to 255] for linear ones, white 1; they are not rounded."""
    clipped = np.clip(np.asarray(linear, float), 0.0, 1.0)
    return 255.0 * np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
