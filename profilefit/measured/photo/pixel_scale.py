"""Pixels as lengths on the object: a scale, two points of a ruler, or a marker, which also shows how it is tilted."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import shown
from profilefit.errors import InputError
from profilefit.measured.data import length
from profilefit.measured.photo.exposure import Exposure, Plane, library

Floats = NDArray[np.float64]
FARTHEST = 1e6  # pixels, between two points of a ruler
PER_PIXEL = re.compile(r"(?P<length>.+?)\s*/\s*(?:px|pixel)")
NUMBER = r"[0-9]+(?:\.[0-9]+)?"
RULER = re.compile(rf"(?P<a>{NUMBER}),(?P<b>{NUMBER}):(?P<c>{NUMBER}),(?P<d>{NUMBER})\s*=\s*(?P<length>.+)")
MARKER = "aruco:"
DICTIONARY = "DICT_4X4_50"
BRIGHT = 99.0  # percentile that a preview shows white
ACCEPTED = "0.05mm/px, two points of a ruler X,Y:X,Y=10mm, or aruco:20mm (a marker of 4 x 4 by its side)"


@dataclass(frozen=True, eq=False)
class PixelScale:
    """matrix (3, 3) from columns and rows [pixels] to places on the object [unit], homogeneous."""

    matrix: Floats
    words: str

    def from_centre(self, columns: Plane, rows: Plane, centre: tuple[float, float]) -> tuple[Plane, Plane]:
        """Places of pixels about a centre [unit]; columns and rows are broadcast."""
        m = self.matrix
        middle = m @ (*centre, 1.0)
        affine = bool(np.all(m[2, :2] == 0.0))
        away = 1.0 if affine else m[2, 0] * columns + m[2, 1] * rows + m[2, 2]
        both = []
        for row, start in zip(m[:2], middle[:2] / middle[2], strict=True):
            # About the centre already where that loses no digits.
            shift = -row[:2] @ centre if affine else row[2]
            place = (np.float32(row[0]) * columns + np.float32(row[1]) * rows + np.float32(shift)) / away
            both.append(np.asarray(place if affine else place - start, np.float32))
        x, y = np.broadcast_arrays(*both)
        return x, y

    def pixel(self, centre: tuple[float, float]) -> float:
        """Size of a pixel there [unit]: the root of its area."""
        m, (c, r) = self.matrix, centre
        away = m[2] @ (c, r, 1.0)
        place = m[:2] @ (c, r, 1.0) / away
        slopes = (m[:2, :2] - np.outer(place, m[2, :2])) / away
        return float(np.sqrt(abs(np.linalg.det(slopes))))


def pixel_scale(option: str, text: str, shots: Sequence[Exposure], unit: str = "mm") -> PixelScale:
    """Return the scale of a text; InputError names the option and what it takes."""
    if match := PER_PIXEL.fullmatch(text):
        size = length(option, match["length"], unit)
        return PixelScale(np.diag([size, size, 1.0]), f"{size:g} {unit} a pixel, as told")
    if match := RULER.fullmatch(text):
        apart = float(np.hypot(float(match["c"]) - float(match["a"]), float(match["d"]) - float(match["b"])))
        if not 1.0 < apart < FARTHEST:
            raise InputError(f"{option} must have two points that are apart, on a photograph, got {shown(text)}")
        size = length(option, match["length"], unit) / apart
        return PixelScale(np.diag([size, size, 1.0]), f"{size:.4g} {unit} a pixel, by two points of a ruler")
    if text.startswith(MARKER):
        return _by_marker(option, length(option, text.removeprefix(MARKER), unit), shots, unit)
    raise InputError(f"{option} must be {ACCEPTED}, got {shown(text)}")


def _by_marker(option: str, side: float, shots: Sequence[Exposure], unit: str) -> PixelScale:
    cv2 = library("cv2")
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY)))
    for shot in shots:
        corners, _, _ = detector.detectMarkers(_preview(shot))
        if len(corners):
            break
    else:
        raise InputError(
            f"{option} must be a marker that {shots[0].source} shows, got none of {DICTIONARY}; {ACCEPTED}"
        )
    step = shots[0].planes[0].step
    points = (corners[0].reshape(4, 2) * step).astype(np.float32)
    square = side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    matrix = np.asarray(cv2.getPerspectiveTransform(points, square), float)
    plate = PixelScale(matrix, "")
    size = plate.pixel((float(points[:, 0].mean()), float(points[:, 1].mean())))
    return PixelScale(matrix, f"{size:.4g} {unit} a pixel, and the tilt, by a marker of {side:g} {unit}")


def _preview(shot: Exposure) -> NDArray[np.uint8]:
    """Eight bits of the first green or only plane."""
    counts = next((one for one in shot.planes if one.colour == "green"), shot.planes[0]).counts
    most = max(float(np.percentile(counts, BRIGHT)), 1e-9)
    return np.asarray(255.0 * np.sqrt(np.clip(counts / most, 0.0, 1.0)), np.uint8)
