"""Photographs as the sensor counted, and a bracket of them as one picture, by Bayer plane, with variances.

Raw files are read by LibRaw (rawpy), 16-bit TIFF by tifffile and EXR by OpenEXR, all three linear; a JPEG, by Pillow,
is not and is taken for sRGB. Files that state no white level have it where more pixels share the largest value than
lie just below it; else it is that of sixteen bits, and of floats more than the largest.

An exposure of relative time t records y = t x + noise of variance y / gain + read^2 [steps^2] (photon transfer). Times
are fitted, not believed: of each pair of neighbours the ratio is that of the sums over pixels that both record well.
Gain and read noise are fitted to the scatter of those pixels about it. The picture is the mean of y / t by inverse
variance, at a light that neighbouring pixels share: by its own noise, a pixel that is dark by chance would count for
more. Clipped pixels and their neighbours do not count, nor does what spills along a column of them.
"""

from __future__ import annotations

import importlib
import io
import os
import re
import stat
import struct
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps
from scipy.ndimage import binary_dilation, uniform_filter

from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.materials import CHANNELS

Plane = NDArray[np.float32]
RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw")
TIFF, EXR, JPEG = (".tif", ".tiff"), (".exr",), (".jpg", ".jpeg")
# Of a Radiance file: its first line, its kind of numbers, and the line of its size, after an empty one.
RADIANCE, XYZ, SIZE = (b"#?RADIANCE", b"#?RGBE"), b"32-bit_rle_xyze", re.compile(rb"\n\n-Y (\d{1,9}) \+X (\d{1,9})\n")
LONGEST_HEADER = 1 << 16  # of a Radiance file [bytes]
MOST_BYTES, MOST_PIXELS = 1 << 29, 120_000_000
GREY = "grey"
PLATEAU, BELOW = 12, 0.98  # pixels that share the largest value where it clips, of it, others just below
FEW, FAINT = 1000.0, 0.2  # steps, and share of the brightest plane: less is not white
STEPS, BEYOND = 65535.0, 1.2  # of sixteen bits, which floats become; over the largest of them, if that is not white
LARGEST = 1e30  # of a float
DAMAGED = (ValueError, OSError, LookupError, TypeError, RuntimeError, struct.error, zlib.error)  # of libraries' readers
PACKAGES = {"cv2": "opencv-python-headless"}  # of modules that have another name
FULL = 0.9  # of the range between black and white, from where a pixel counts as clipped
REACH = 2  # pixels of a plane about a clipped one that are left out, too
SHARED = 5  # pixels across, over which light is shared for the weights
DIM, UNCLIPPED = 0.02, 0.7  # of the range, between which a pixel says something of ratios
LEAST_PAIRS = 50  # pixels, for a ratio or a bin
BINS = 24  # of light, for photon transfer
BRIGHTER = 1.2  # times the light of another exposure, that one of a shorter time, or of the same, may have
ROUNDED = 1.0 / 12.0  # steps^2, variance of a count that has no other


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
    with _silent():
        return _raw(path) if kind in RAW else _plain(path, kind)


def linear(codes: NDArray[np.uint8]) -> Plane:
    """Return the light of a screen's 8-bit values, white 1 (IEC 61966-2-1)."""
    coded = codes.astype(np.float32) / np.float32(255.0)
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4).astype(np.float32)


def radiance(path: Path, most_bytes: int, largest: tuple[int, int]) -> Plane:
    """Return the values (rows, columns, 3) of a Radiance file (.hdr) or an EXR, as they are; its opacity is left out.

    most_bytes, largest  bounds of the file, and of its columns and rows, which are looked at before pixels are read
    InputError in one line.
    """
    try:
        status = path.stat()
        is_regular, size = stat.S_ISREG(status.st_mode), status.st_size
        content = path.read_bytes() if is_regular and 0 < size <= most_bytes else b""
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not content:
        got = f"{size} bytes" if is_regular else "no regular file"
        raise InputError(f"{path}: expected a file of 1 byte to {most_bytes >> 20} MiB, got {got}")
    with _silent():
        return _exr_radiance(path, largest) if path.suffix.lower() in EXR else _rgbe(path, content, largest)


def _exr_radiance(path: Path, largest: tuple[int, int]) -> Plane:
    values = _exr(path, largest)
    if values.ndim != 3 or values.shape[2] not in (3, 4) or values.dtype not in (np.float32, np.float16):
        got = f"{values.dtype} of shape {values.shape}"
        raise InputError(f"{path}: expected floats of red, green and blue, got {got}")
    return np.asarray(values[..., :3], np.float32)


def _rgbe(path: Path, content: bytes, largest: tuple[int, int]) -> Plane:
    header = content[:LONGEST_HEADER]
    size = SIZE.search(header)
    if not header.startswith(RADIANCE) or size is None or XYZ in header[: size.start()]:
        raise InputError(f"{path}: expected a Radiance file of RGBE, with -Y rows +X columns, got another one")
    _require_within(path, int(size[2]), int(size[1]), largest)
    cv2 = library("cv2")
    with _refused(path, "a Radiance file", cv2.error, *DAMAGED):
        values = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None or values.ndim != 3 or values.shape[2] != 3:
        raise InputError(f"{path}: cannot be read as a Radiance file: it is damaged")
    return np.asarray(values[..., ::-1], np.float32)


def _require_within(path: Path, columns: int, rows: int, largest: tuple[int, int]) -> None:
    if not (0 < columns <= largest[0] and 0 < rows <= largest[1]):
        raise InputError(f"{path}: expected 1 ... {largest[0]} x {largest[1]} pixels, got {columns} x {rows}")


def _raw(path: Path) -> Exposure:
    rawpy = library("rawpy")
    with _refused(path, "a raw file", rawpy.LibRawError), rawpy.imread(str(path)) as raw:
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
        return replace(exposure, iso=raw.other.iso_speed or None, aperture=raw.other.aperture or None)


@contextmanager
def _silent() -> Iterator[None]:
    """Silence what libraries write that their errors say again: to standard error, and to Python's output."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        with redirect_stdout(io.StringIO()):
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
        counts = np.float32(255.0) * linear(values)
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
    names = CHANNELS if values.shape[2] == 3 else (GREY,)
    most = 255.0 if kind in JPEG else STEPS if kind in TIFF and values.dtype == np.uint16 else None
    brightest = float(counts.max())
    planes = tuple(
        BayerPlane(name, counts[..., at], _range(counts[..., at], most, brightest), (0, 0), 1)
        for at, name in enumerate(names)
    )
    return Exposure(str(path), planes, (values.shape[1], values.shape[0]), None, kind not in JPEG)


def _range(counts: Plane, most: float | None, brightest: float) -> float:
    """Return the white of a plane; `most` is that of its integers, `brightest` the largest count of any plane."""
    largest = float(counts.max())
    shared = int(np.count_nonzero(counts == largest))
    near = int(np.count_nonzero(counts > BELOW * largest)) - shared
    if shared >= max(PLATEAU, near) and largest > max(FAINT * brightest, FEW if most else 0.0):
        return largest
    return most or max(BEYOND * brightest, float(np.finfo(np.float32).tiny))


def _decoded(path: Path, kind: str) -> NDArray[Any]:
    if kind in TIFF:
        tifffile = library("tifffile")
        with _refused(path, "a TIFF", tifffile.TiffFileError, *DAMAGED), tifffile.TiffFile(path) as file:
            page = file.pages[0]
            _require_size(path, int(page.imagewidth), int(page.imagelength), int(page.samplesperpixel))
            return np.asarray(page.asarray())
    if kind in EXR:
        return _exr(path)
    try:
        with (
            _refused(path, "a picture", OSError, ValueError, SyntaxError),
            warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning),
            Image.open(path, formats=["jpeg"]) as file,
        ):
            _require_size(path, *file.size, 3)
            return np.asarray(ImageOps.exif_transpose(file).convert("RGB"))
    except Image.DecompressionBombError:
        raise InputError(f"{path}: expected at most {MOST_PIXELS} pixels, got more") from None


def _exr(path: Path, largest: tuple[int, int] | None = None) -> NDArray[Any]:
    exr = library("OpenEXR")
    with _refused(path, "an EXR", StopIteration, *DAMAGED):
        parts = exr.File(str(path), header_only=True).parts
        if len(parts) != 1:
            raise InputError(f"{path}: expected an EXR of one part, got {len(parts)}")
        (left, top), (right, bottom) = parts[0].header["dataWindow"]
        columns, rows = int(right - left) + 1, int(bottom - top) + 1
        if largest is not None:
            _require_within(path, columns, rows, largest)
        _require_size(path, columns, rows, len(parts[0].header["channels"]))
        channels = exr.File(str(path)).channels()
        return np.asarray(next(iter(channels.values())).pixels)


def _require_size(path: Path, columns: int, rows: int, values: int) -> None:
    if columns * rows > MOST_PIXELS:
        raise InputError(f"{path}: expected at most {MOST_PIXELS} pixels, got {columns} x {rows}")
    if columns * rows * values > 3 * MOST_PIXELS:
        got = f"{columns} x {rows} pixels of {values} each"
        raise InputError(f"{path}: expected at most {3 * MOST_PIXELS} values, got {got}")


def library(name: str) -> Any:
    """One that not every installation has, or an InputError that says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        package = PACKAGES.get(name, name)
        raise InputError(f"this file needs the package {package}: pip install {package}") from None


@contextmanager
def _refused(path: Path, kind: str, *errors: type[Exception]) -> Iterator[None]:
    """Raise a library's errors in its words, where none of ours say it already."""
    try:
        yield
    except InputError:
        raise
    except errors as error:
        words = error.args[0] if error.args else error
        text = words.decode("utf-8", "replace") if isinstance(words, bytes) else str(words)
        first = (text.splitlines() or [type(error).__name__])[0][:100]
        raise InputError(f"{path}: cannot be read as {kind}: {first}") from None


@dataclass(frozen=True)
class Sensor:
    """Gain [electrons a step] and read noise [steps] of a sensor."""

    gain: float
    read: float


@dataclass(frozen=True)
class Picture:
    """One Bayer plane of a bracket: light [steps a unit of time] and its variance, nan where no exposure has it.

    offset  (row, column) of the plane's first pixel in the whole picture, step between its pixels
    """

    light: Plane
    variance: Plane
    offset: tuple[int, int]
    step: int


class Times(NamedTuple):
    """Times of exposures (m,), relative to the longest, and the covariance (m, m) of their logarithms."""

    value: Floats
    covariance: Floats


def times(shots: Sequence[Exposure]) -> Times:
    """Estimate times from what the exposures record; InputError where neighbours share no pixels."""
    stated = [one.seconds or 0.0 for one in shots]
    light = [sum(float(each.counts.mean()) for each in one.planes) for one in shots]
    order = np.lexsort((light, stated)) if all(stated) else np.argsort(light)
    value, covariance = np.ones(len(shots)), np.zeros((len(shots),) * 2)
    for at in range(len(shots) - 2, -1, -1):
        shorter, longer = order[at], order[at + 1]
        ratio, error = _ratio(shots[shorter], shots[longer])
        value[shorter] = value[longer] * ratio
        covariance[np.ix_(order[: at + 1], order[: at + 1])] += error**2
    return Times(value, covariance)


def _ratio(shorter: Exposure, longer: Exposure) -> tuple[float, float]:
    """Return the ratio of two exposures' times, the shorter one's first, and its relative error."""
    above = below = pairs = 0.0
    chosen = []
    for one, other in zip(shorter.planes, longer.planes, strict=True):
        level = uniform_filter(
            other.counts, SHARED, mode="nearest"
        )  # by their own, pixels bright by chance would count
        good = (level < UNCLIPPED * other.range) & (level > DIM * other.range) & _unclipped(other, REACH)
        chosen.append((one.counts[good].astype(float), other.counts[good].astype(float)))
        above += float(chosen[-1][0].sum())
        below += float(chosen[-1][1].sum())
        pairs += int(good.sum())
    longer_is_stated = shorter.seconds and longer.seconds and shorter.seconds < longer.seconds
    if pairs >= LEAST_PAIRS and above > BRIGHTER * below:
        raise InputError(
            f"{shorter.source}: expected less light than {longer.source} has, which "
            f"{'states a longer time' if longer_is_stated else 'is brighter on the whole'}, got "
            f"{above / below:.3g} times as much"
        )
    if pairs < LEAST_PAIRS or not above > 0:
        raise InputError(
            f"{shorter.source}: expected a scene that {longer.source} shares with it, neither dark nor clipped, in "
            f"{LEAST_PAIRS} pixels, got {pairs if above > 0 else 0:.0f}; take exposures in steps of a factor of eight "
            "or less"
        )
    ratio = above / below
    scatter = sum(float(np.sum((one - ratio * other) ** 2)) for one, other in chosen)
    return ratio, float(np.sqrt(scatter)) / above


def shares(light: Floats, relative: Floats, own: Sensor, most: Floats) -> Floats:
    """Return shares (n, m) of exposures (m,) in a picture of light (n,), where more than `most` steps (m,) clip."""
    steps = np.maximum(np.multiply.outer(light, relative), 0.0)
    weight = np.where(steps < most, relative**2 / (steps / own.gain + own.read**2), 0.0)
    total = weight.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(weight, total, out=np.zeros_like(weight), where=total > 0), float)


def sensor(shots: Sequence[Exposure], relative: Floats) -> Sensor:
    """Photon transfer: the variance of y_a - (t_a / t_b) y_b over bins of light, against what electrons would have."""
    rows, squares, weights = [], [], []
    order = np.argsort(relative)
    for a, b in pairwise(order):
        ratio = relative[a] / relative[b]
        for one, other in zip(shots[a].planes, shots[b].planes, strict=True):
            good = (other.counts < FULL * other.range) & (other.counts > 0)
            if np.count_nonzero(good) < LEAST_PAIRS:
                continue
            light, residual = other.counts[good], one.counts[good] - ratio * other.counts[good]
            edges = np.unique(np.quantile(light, np.linspace(0.0, 1.0, BINS + 1)))
            at = np.clip(np.searchsorted(edges, light, side="right") - 1, 0, edges.size - 2)
            for each in range(edges.size - 1):
                inside = residual[at == each]
                if inside.size < LEAST_PAIRS:
                    continue
                middle = float(light[at == each].mean())
                rows.append((ratio * middle + ratio**2 * middle, 1.0 + ratio**2))
                squares.append(max(float(np.mean((inside - inside.mean()) ** 2)), ROUNDED * (1.0 + ratio**2)))
                weights.append(np.sqrt(inside.size) / squares[-1])
    if len(rows) < 2:
        return Sensor(1.0, 1.0)
    matrix, weight = np.array(rows), np.array(weights)
    best, *_ = np.linalg.lstsq(matrix * weight[:, None], np.array(squares) * weight, rcond=None)
    return Sensor(1.0 / max(float(best[0]), 1e-9), float(np.sqrt(max(best[1], ROUNDED))))


def merged(shots: Sequence[Exposure], relative: Floats, own: Sensor) -> list[Picture]:
    """Return the planes of a bracket, light in steps of the longest exposure."""
    pictures = []
    for at, plane in enumerate(shots[0].planes):
        total = np.zeros(plane.counts.shape, np.float32)
        precision = np.zeros(plane.counts.shape, np.float32)
        light = _rough(shots, relative, at)
        for shot, time in zip(shots, relative, strict=True):
            one = shot.planes[at]
            variance = np.maximum(light * time, 0.0) / own.gain + own.read**2
            weight = np.where(_unclipped(one, REACH), time**2 / variance, 0.0).astype(np.float32)
            total += weight * one.counts / np.float32(time)
            precision += weight
        with np.errstate(divide="ignore", invalid="ignore"):
            pictures.append(Picture(total / precision, 1.0 / precision, plane.offset, plane.step))
    return pictures


def _unclipped(plane: BayerPlane, reach: int) -> NDArray[np.bool_]:
    """Pixels so far from those that clip."""
    return ~binary_dilation(plane.counts >= FULL * plane.range, iterations=reach)


def _rough(shots: Sequence[Exposure], relative: Floats, at: int) -> Plane:
    """Light that neighbouring pixels share, of the longest exposure that has it."""
    rough: Plane = np.full(shots[0].planes[at].counts.shape, np.nan, np.float32)
    for shot, time in sorted(zip(shots, relative, strict=True), key=lambda pair: pair[1]):
        one = shot.planes[at]
        smooth = uniform_filter(one.counts, SHARED, mode="nearest") / np.float32(time)
        rough = np.where(_unclipped(one, REACH + SHARED // 2) | np.isnan(rough), smooth, rough)
    return rough
