"""Model error: how far the law's own distance from the exact profile can move what is fitted with it.

A law misses the exact profile by `rel` on average (see `quality`), in waves along ln r. Its error at the radii of the
data is taken for a Gaussian process: standard deviation RMS x rel of the light, correlation e^-1 at WAVE in ln r.
Over seventeen pairs of law and albedo (hazard, normalized diffusion, four Gaussians, beam diffusion; alpha from .2 to
.99) the root mean square is 1.2 to 2.5 times `rel`, the distance .1 to 2.5; tests hold the prediction against the real
shift.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.setting import Setting
from profilefit.fitting.quality import ENERGY_WITHIN, profile_quality
from profilefit.laws import profile_classes
from profilefit.measured.data import Measured
from profilefit.measured.exact_light import EXACT
from profilefit.measured.model import Light, u_of
from profilefit.measured.noise import Noise
from profilefit.recipes.record import Folder, Records, record_setting

Floats = NDArray[np.float64]
RMS = 1.5
WAVE = 0.5
# `rel` covers radii within 99.5 % of the energy. A quarter farther out the error of the hazard law is ten times its
# `rel`; for the other laws no better number is known.
WITHIN, BEYOND = ENERGY_WITHIN, 10.0
DARKEST, WHITEST = 0.02, 0.9995  # albedos between which a law can be held against the exact profile


@dataclass(frozen=True)
class Origin:
    """The record whose constants a law has: its file and digest, and what it measured of the law in this setting."""

    path: Path
    digest: str
    quality: dict[str, Any]


def origin(name: str, constants: str, setting: Setting, folder: Folder) -> Origin | None:
    """The record behind a law of this name; None of printed constants, of laws without any, and of exact light."""
    if name == EXACT:
        return None
    records, bases = Records.of(folder), profile_classes()[name].entry.records
    if constants.endswith(".json"):
        path = Path(constants)
    elif constants == "regenerated" and bases:
        path = records.path(bases[0], setting)
    else:
        return None
    content = records.read(path)
    quality = (content.get("quality") or {}) if record_setting(content) == setting else {}
    return Origin(path, hashlib.sha256(path.read_bytes()).hexdigest(), quality)


def relative_error(law: Light, alpha: float, source: Origin | None) -> float | None:
    """`rel` of the law at alpha [-]: its record's, or measured against the exact profile; None where neither can be.

    0 of exact light.
    """
    if isinstance(law, ExactLight):
        return 0.0
    measured = (source.quality.get("regenerated") or {}).get("rel") if source else None
    if source is not None and measured:
        known = np.array(measured, float)
        where = [u_of(one) for one in source.quality["alpha"]]
        return float(np.interp(-u_of(min(max(alpha, DARKEST), WHITEST)), -np.array(where), known))
    if not law.setting.is_solved:
        return None
    return float(profile_quality(law, [min(max(alpha, DARKEST), WHITEST)]).rel[0])


def covariance(data: Measured, rel: float | None, beyond: NDArray[np.bool_]) -> Floats | None:
    """(n, n) of the law's own error in the rows of data, relative to their values; None where it has none."""
    if not rel:
        return None
    size = RMS * rel * np.where(beyond, BEYOND, 1.0) * np.abs(data.value)
    return rough_waves(data.r) * np.outer(size, size)


def waves(r: Floats, length: float = WAVE) -> Floats:
    """Correlations (n, n) of an error in smooth waves along ln r, of this length [ln r]; 0 makes rows independent."""
    return np.asarray(np.exp(-0.5 * _apart(r, length) ** 2), float)


def rough_waves(r: Floats, length: float = WAVE) -> Floats:
    """Correlations (n, n) of an error of this length along ln r with which rows are weighed; 0 makes rows independent.

    With those of `waves`, which are smooth, neighbouring rows would be trusted for what they say beside the error.
    """
    return np.asarray(np.exp(-_apart(r, length)), float)


def _apart(r: Floats, length: float) -> Floats:
    """Distances (n, n) of rows in ln r over a length; infinite for any two rows where that is 0."""
    distance = np.abs(np.subtract.outer(np.log(r), np.log(r)))
    return distance / length if length else np.where(np.eye(r.size) > 0, 0.0, np.inf)


def whitened(shape: Floats, size: Floats, noise: Noise, rows: int) -> Floats:
    """Covariance (rows, rows), in standard errors, of an error of correlations `shape` (n, n) and of `size` (n,).

    The first n rows have that noise; the others know nothing of the law's shape.
    """
    joint = np.zeros((rows, rows))
    joint[: size.size, : size.size] = noise.whitened(noise.whitened(shape * np.outer(size, size)).T)
    return joint
