"""Covariance of the rows: the data's own errors, those that the rings of one simulation share, and the model's.

A photon that leaves through one ring leaves through no other: ring energies E of one run of N photons have the
covariance -E_i E_j / (N - 1), as multinomial counts have, lost or absorbed photons being the complement. Values per
area v keep it: C = diag(sigma^2 + v^2 / (N - 1)) - v v^T / (N - 1). With the first term's root S and
b = S^-1 v / sqrt(N - 1) this is S (1 - b b^T) S, whose inverse root is (Sherman and Morrison)

    C^-1/2 = (1 + c b b^T) S^-1,   c = (1 / sqrt(1 - b^T b) - 1) / b^T b.

Without photons to share b is zero, and this divides by sigma. Where a law stands for the light its own error is a
covariance of the rows, too, and so is a lack of fit; all together are whitened by the root of their sum.

A law misses the exact profile by `rel` on average (see `quality`), in waves along ln r. Its error at the radii of the
data is taken for a Gaussian process: standard deviation RMS x rel of the light, correlation e^-1 at WAVE in ln r.
Over seventeen pairs of law and albedo (alpha from .2 to .99) the root mean square is 1.2 to 2.5 times `rel`, the
distance .1 to 2.5; tests hold the prediction against the real shift.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.fitting.misfit import waves
from profilefit.fitting.quality import ENERGY_WITHIN, profile_quality
from profilefit.laws import profile_classes
from profilefit.measured.data import Measured
from profilefit.measured.model import EXACT, Light, u_of
from profilefit.recipes.record import Folder, Records, record_setting

# b^T b is the share of the photons that the rings hold: 1 only if none is lost, and more only by rounding.
LARGEST_SHARE = 1.0 - 1e-6
RMS = 1.5
WAVE = 0.5  # of ln r
# `rel` covers radii within 99.5 % of the energy. A quarter farther out the error of the hazard law is ten times its
# `rel`; for the other laws no better number is known.
WITHIN, BEYOND = ENERGY_WITHIN, 10.0
DARKEST, WHITEST = 0.02, 0.9995  # albedos between which a law can be held against the exact profile


@dataclass(frozen=True, eq=False)
class Noise:
    """Covariance of n rows: root (n,) is the diagonal S [of the values], common (n,) the vector b [-].

    model (n, n) is that of the error of what the rows are held against, lack (n, n) that of a lack of fit; None of none
    """

    root: Floats
    common: Floats
    model: Floats | None = None
    lack: Floats | None = None

    @property
    def share(self) -> float:
        return float(self.common @ self.common)

    @property
    def data(self) -> Floats:
        """Covariance (n, n) of the data's own errors."""
        inner = np.eye(self.root.size) - np.outer(self.common, self.common)
        return inner * np.outer(self.root, self.root)

    @cached_property
    def _whole(self) -> Floats:
        """Root of the covariances of data, model and lack of fit, lower triangle, over the data's errors."""
        whole = sum((one for one in (self.model, self.lack) if one is not None), self.data)
        return np.asarray(np.linalg.cholesky(whole / np.outer(self.root, self.root)), float)

    @property
    def sigma(self) -> Floats:
        """Standard error (n,) of each row by itself."""
        return self.root * np.sqrt(1.0 - self.common**2)

    def whitened(self, rows: Floats) -> Floats:
        """Return rows (n,) or (n, k) in standard errors, independent of each other."""
        scaled = (rows.T / self.root).T
        if self.model is not None or self.lack is not None:
            whitened: Floats = solve_triangular(self._whole, scaled, lower=True, check_finite=False)
            return whitened
        if self.share == 0.0:
            return scaled
        growth = (1.0 / np.sqrt(1.0 - self.share) - 1.0) / self.share
        return scaled + growth * np.multiply.outer(self.common, self.common @ scaled)

    def in_errors(self, error: Floats | None, rows: int) -> Floats:
        """Return the covariance (rows, rows), in standard errors, of an error (n, n) of the first rows, or None."""
        joint = np.zeros((rows, rows))
        if error is not None:
            joint[: len(error), : len(error)] = self.whitened(self.whitened(error).T)
        return joint


def noise(
    data: Measured,
    light: Floats | None = None,
    widening: float = 1.0,
    model: Floats | None = None,
    lack: Floats | None = None,
) -> Noise:
    """Return the errors of data; model and lack as in `Noise`.

    light     (n,) that a fit expects: of counts it predicts the variance better than the counts
    widening  factor on every variance
    """
    expected = data.value if light is None or not data.counted else light
    others = data.photons - 1.0
    variance = (data.sigma**2 + data.value**2 / others) * expected / data.value if data.counted else data.sigma**2
    root = np.sqrt(widening * variance)
    common = expected / (np.sqrt(others) * root)
    share = float(common @ common)
    return Noise(root, common * np.sqrt(min(1.0, LARGEST_SHARE / share)) if share > 0 else common, model, lack)


@dataclass(frozen=True)
class Origin:
    """Record whose constants a law has: its file and digest, and the quality of the law that it states."""

    path: Path
    digest: str
    quality: dict[str, Any]


def origin(name: str, constants: str, setting: Setting, folder: Folder) -> Origin | None:
    """Return the record behind a law of this name; None for printed constants, laws without any, and exact light."""
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
    """Return `rel` of a law at alpha [-], its record's or measured; None where neither can be; 0 of exact light."""
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


def law_covariance(data: Measured, rel: float | None, beyond: NDArray[np.bool_]) -> Floats | None:
    """Return the covariance (n, n) of the law's own error, `rel` but in rows `beyond` (n,); None where it has none."""
    if not rel:
        return None
    size = RMS * rel * np.where(beyond, BEYOND, 1.0) * np.abs(data.value)
    return waves(data.r, WAVE, rough=True) * np.outer(size, size)
