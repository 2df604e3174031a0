"""The most informative additional measurement: predicted errors of the least certain quantity, by Fisher information.

A measurement with derivatives g by the coordinates and standard error sigma adds g g^T / sigma^2 to the information.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.solver import covariance
from profilefit.measured.fitting import MediumFit
from profilefit.measured.identifiability import relative_errors
from profilefit.measured.law_error import WITHIN
from profilefit.measured.model import NAMES, SCALE

Floats = NDArray[np.float64]
REFERENCE_ERROR = 0.01  # relative error of a total reflectance or of a reference standard that is easily had
REPEATS = 4
# Radii, in mean free paths, where one more point could be measured; only those within 99.5 % of the energy.
NEAREST, FARTHEST, RADII = 0.03, 60.0, 32


@dataclass(frozen=True)
class Candidate:
    """A measurement that could be made.

    kind      "point", "reflectance", "scale" or "repeats"; inner, outer radii of a point or ring [unit], else NaN
    value     predicted value; error its assumed standard error
    relative  predicted relative errors of mu_s', mu_a and a free scale with it [-]
    """

    kind: str
    inner: float
    outer: float
    value: float
    error: float
    relative: dict[str, float]

    @property
    def worst(self) -> tuple[str, float]:
        name = max(self.relative, key=lambda one: self.relative[one])
        return name, self.relative[name]


@dataclass(frozen=True)
class DesignRanking:
    """The least certain quantity with its relative error, and the best candidate of each kind, best first."""

    name: str
    now: float
    candidates: tuple[Candidate, ...]


def rank_designs(fit: MediumFit) -> DesignRanking:
    """Rank additional measurements by the largest relative error that would remain."""
    now = relative_errors(fit, fit.total_covariance)
    name = max(now, key=lambda one: now[one])
    best: dict[str, Candidate] = {}
    for one in [*_points(fit), *_others(fit)]:
        if one.kind not in best or one.worst[1] < best[one.kind].worst[1]:
            best[one.kind] = one
    return DesignRanking(name, now[name], tuple(sorted(best.values(), key=lambda one: one.worst[1])))


def _points(fit: MediumFit) -> list[Candidate]:
    """One more point or ring anywhere, as precise as the data are, in the median."""
    data, model = fit.data, fit.problem.model
    width = float(np.median((data.outer - data.inner) / (data.outer + data.inner)))
    r = fit.values["l"] * np.geomspace(NEAREST, FARTHEST, RADII)
    r = r[model.shares(fit.point, r * (1.0 + width)) < WITHIN]
    inner, outer = r * (1.0 - width), r * (1.0 + width)
    light, slopes = model.linearised(fit.point, inner, outer)
    errors = data.relative_error * light[:-1]
    rows = zip(inner, outer, light[:-1], errors, slopes[:-1], strict=True)
    return [_candidate(fit, "point", float(a), float(b), float(v), float(e), slope) for a, b, v, e, slope in rows]


def _others(fit: MediumFit) -> list[Candidate]:
    (*_, reflectance), slopes = fit.predicted[0], fit.predicted[1]
    scale = fit.values["scale"]
    four = relative_errors(fit, _repeated(fit))
    out = [Candidate("repeats", np.nan, np.nan, float(REPEATS), np.nan, four)]
    if fit.spec.total is None and fit.data.medium is None:  # a simulation states it already
        error = REFERENCE_ERROR * reflectance
        out.append(_candidate(fit, "reflectance", np.nan, np.nan, float(reflectance), error, slopes[-1]))
    if SCALE in fit.spec.free and fit.spec.scale is None:
        slope = scale * np.eye(len(NAMES))[SCALE]
        out.append(_candidate(fit, "scale", np.nan, np.nan, scale, REFERENCE_ERROR * scale, slope))
    return out


def _repeated(fit: MediumFit) -> Floats:
    """Covariance of the coordinates where the data's errors are those of REPEATS profiles, and the others stay."""
    stay = fit.law_rows + fit.lack_rows
    rows = stay + (np.eye(len(stay)) - stay) / REPEATS
    return _covariance(fit, np.linalg.solve(np.linalg.cholesky(rows), fit.jacobian))


def _candidate(
    fit: MediumFit, kind: str, inner: float, outer: float, value: float, error: float, slope: Floats
) -> Candidate:
    joint = _covariance(fit, np.vstack([fit.jacobian, slope[list(fit.spec.free)] / error]))
    return Candidate(kind, inner, outer, value, error, relative_errors(fit, joint))


def _covariance(fit: MediumFit, jacobian: Floats) -> Floats:
    """Covariance (3, 3) of the coordinates from derivatives (m, p) by the free ones, and by what ranges leave open."""
    free, joint = list(fit.spec.free), np.zeros((len(NAMES), len(NAMES)))
    joint[np.ix_(free, free)] = covariance(jacobian)
    return joint + fit.of_ranges
