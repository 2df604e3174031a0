"""One photograph as the sensor counted: Bayer planes apart, black taken off, nothing interpolated, no curve.

Raw files are read by LibRaw (rawpy), 16-bit TIFF by tifffile and EXR by OpenEXR, all three linear; a JPEG, by Pillow,
is not, is taken for sRGB, and the answer says so. What is read is bounded before it is read.

Files that state no white level have it where more pixels share the largest value than lie just below it; else it is
that of sixteen bits, and of floats more than the largest.
"""

from __future__ import annotations

import importlib
import os
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from profilefit.errors import InputError

Plane = NDArray[np.float32]
RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw")
TIFF, EXR, JPEG = (".tif", ".tiff"), (".exr",), (".jpg", ".jpeg")
MOST_BYTES, MOST_PIXELS = 1 << 29, 120_000_000
COLOURS, GREY = ("red", "green", "blue"), "grey"
PLATEAU, BELOW = 12, 0.98  # pixels that share the largest value where it clips, of it, others just below
FEW, FAINT = 1000.0, 0.2  # steps, and share of the brightest plane: less is not white
STEPS, BEYOND = 65535.0, 1.2  # of sixteen bits, which floats become; over the largest of them, if that is not white
LARGEST = 1e30  # of a float
DAMAGED = (ValueError, OSError, LookupError, TypeError, RuntimeError, struct.error, zlib.error)  # of libraries' readers
PACKAGES = {"cv2": "opencv-python-headless", "OpenEXR": "OpenEXR", "rawpy": "rawpy", "tifffile": "tifffile"}


@dataclass(frozen=True, eq=False)
class BayerPlane:
    """Counts above black (rows, columns) of one filter's pixels; range is white less black.

    offset  (row, column) of the first one in the whole picture; step from one to the next
    """

    colour: str
    counts: Plane
    range: float
    offset: tuple[int, int]
    step: int


@dataclass(frozen=True, eq=False)
class Exposure:
    """Photograph of so many columns and rows (`sides`).

    seconds, iso and aperture (an f-number) are None where the file does not state them
    """

    source: str
    planes: tuple[BayerPlane, ...]
    sides: tuple[int, int]
    seconds: float | None
    linear: bool
    iso: float | None = None
    aperture: float | None = None


def read(path: Path) -> Exposure:
    """InputError, in one line, of what is no photograph that can be measured."""
    kind = path.suffix.lower()
    if kind not in (*RAW, *TIFF, *EXR, *JPEG):
        accepted = f"a raw file ({', '.join(RAW[:4])} ...), a TIFF, an EXR or a JPEG"
        raise InputError(f"{path}: expected {accepted}, got {kind or 'no suffix'!r}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if not 0 < size <= MOST_BYTES:
        raise InputError(f"{path}: expected a photograph of 1 byte to {MOST_BYTES >> 20} MiB, got {size} bytes")
    with _without_words():
        return _raw(path) if kind in RAW else _plain(path, kind)


def _raw(path: Path) -> Exposure:
    rawpy = library("rawpy")
    try:
        with rawpy.imread(str(path)) as raw:
            _require_size(path, raw.sizes.width, raw.sizes.height, 1)
            if raw.raw_pattern is None or raw.raw_pattern.shape != (2, 2):
                raise InputError(f"{path}: expected a sensor of a Bayer pattern, two by two, got another")
            counts, pattern = raw.raw_image_visible, raw.raw_pattern
            names = {"R": "red", "G": "green", "B": "blue"}
            colours = [names.get(chr(code), "") for code in raw.color_desc]
            own = [[colours[int(which)] for which in row] for row in pattern]
            black = [[float(raw.black_level_per_channel[int(which)]) for which in row] for row in pattern]
            seconds = float(raw.other.shutter_speed)
            exposure = of_sensor(str(path), counts, own, black, float(raw.white_level), seconds or None)
            exposure = replace(exposure, iso=raw.other.iso_speed or None, aperture=raw.other.aperture or None)
    except rawpy.LibRawError as error:
        raise _refused(path, "a raw file", error) from None
    return exposure


@contextmanager
def _without_words() -> Iterator[None]:
    """Libraries write to standard error by themselves what their errors say again."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def of_sensor(
    source: str,
    counts: NDArray[Any],
    pattern: Sequence[Sequence[str]],
    black: Sequence[Sequence[float]],
    white: float,
    seconds: float | None,
) -> Exposure:
    """Return the exposure of a Bayer sensor's counts (rows, columns); colours and black levels by row and column."""
    rows, columns = counts.shape[0] // 2 * 2, counts.shape[1] // 2 * 2  # planes of as many pixels each
    planes = tuple(
        BayerPlane(
            pattern[row][column],
            counts[row:rows:2, column:columns:2].astype(np.float32) - np.float32(black[row][column]),
            white - black[row][column], (row, column), 2,
        )
        for row in (0, 1)
        for column in (0, 1)
    )  # fmt: skip
    return Exposure(source, planes, (counts.shape[1], counts.shape[0]), seconds, True)


def _plain(path: Path, kind: str) -> Exposure:
    """Return a picture of one or three values a pixel."""
    values = _decoded(path, kind)
    values = values[..., None] if values.ndim == 2 else values
    if values.ndim != 3 or values.shape[2] not in (1, 3):
        raise InputError(f"{path}: expected one or three values a pixel, got an array of shape {values.shape}")
    if kind in JPEG and values.dtype == np.uint8:
        coded = values.astype(np.float32) / 255.0
        counts = np.float32(255.0) * np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        counts = counts.astype(np.float32)
    elif kind in TIFF and values.dtype == np.uint16:
        counts = values.astype(np.float32)
    elif values.dtype in (np.float32, np.float16):
        if not np.all(np.abs(values) < LARGEST):
            raise InputError(f"{path}: expected finite numbers, got others")
        counts = np.float32(STEPS) * values.astype(np.float32)
    else:
        raise InputError(
            f"{path}: expected linear values, 16 bits or floats each, got {values.dtype} of an unknown curve"
        )
    names = COLOURS if values.shape[2] == 3 else (GREY,)
    most = 255.0 if kind in JPEG else STEPS if kind in TIFF and values.dtype == np.uint16 else None
    brightest = float(counts.max())
    planes = tuple(
        BayerPlane(name, counts[..., at], _range(counts[..., at], most, brightest), (0, 0), 1)
        for at, name in enumerate(names)
    )
    return Exposure(str(path), planes, (values.shape[1], values.shape[0]), None, kind not in JPEG)


def _range(counts: Plane, most: float | None, brightest: float) -> float:
    """White of a plane (rows, columns) of a file that does not state it.

    most  of its integers, None of floats; brightest the largest count of any plane
    """
    largest = float(counts.max())
    shared = int(np.count_nonzero(counts == largest))
    near = int(np.count_nonzero(counts > BELOW * largest)) - shared
    if shared >= max(PLATEAU, near) and largest > max(FAINT * brightest, FEW if most else 0.0):
        return largest
    return most or max(BEYOND * brightest, float(np.finfo(np.float32).tiny))


def _decoded(path: Path, kind: str) -> NDArray[Any]:
    if kind in TIFF:
        tifffile = library("tifffile")
        try:
            with tifffile.TiffFile(path) as file:
                page = file.pages[0]
                _require_size(path, int(page.imagewidth), int(page.imagelength), int(page.samplesperpixel))
                return np.asarray(page.asarray())
        except (tifffile.TiffFileError, *DAMAGED) as error:
            raise _refused(path, "a TIFF", error) from None
    if kind in EXR:
        exr = library("OpenEXR")
        try:
            parts = exr.File(str(path), header_only=True).parts
            if len(parts) != 1:
                raise InputError(f"{path}: expected an EXR of one part, got {len(parts)}")
            (left, top), (right, bottom) = parts[0].header["dataWindow"]
            _require_size(path, int(right - left) + 1, int(bottom - top) + 1, len(parts[0].header["channels"]))
            channels = exr.File(str(path)).channels()
            return np.asarray(next(iter(channels.values())).pixels)
        except (StopIteration, *DAMAGED) as error:
            raise _refused(path, "an EXR", error) from None
    try:
        with (
            warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning),
            Image.open(path, formats=["jpeg"]) as file,
        ):
            _require_size(path, *file.size, 3)
            return np.asarray(ImageOps.exif_transpose(file).convert("RGB"))
    except Image.DecompressionBombError:
        raise InputError(f"{path}: expected at most {MOST_PIXELS} pixels, got more") from None
    except (OSError, ValueError, SyntaxError) as error:
        raise _refused(path, "a picture", error) from None


def _require_size(path: Path, columns: int, rows: int, values: int) -> None:
    """Before it is read: not more than MOST_PIXELS, of three values each."""
    if columns * rows > MOST_PIXELS:
        raise InputError(f"{path}: expected at most {MOST_PIXELS} pixels, got {columns} x {rows}")
    if columns * rows * values > 3 * MOST_PIXELS:
        raise InputError(
            f"{path}: expected at most {3 * MOST_PIXELS} values, got {columns} x {rows} pixels of {values} each"
        )


def library(name: str) -> Any:
    """One that not every installation has, or an InputError that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = PACKAGES[name]
        raise InputError(f"this photograph needs the package {package}: pip install {package}") from None


def _refused(path: Path, kind: str, error: Exception) -> InputError:
    """Return an error in a library's words, where none of ours say it already."""
    if isinstance(error, InputError):
        return error
    words = error.args[0] if error.args else error
    text = words.decode("utf-8", "replace") if isinstance(words, bytes) else str(words)
    first = (text.splitlines() or [type(error).__name__])[0][:100]
    return InputError(f"{path}: cannot be read as {kind}: {first}")
