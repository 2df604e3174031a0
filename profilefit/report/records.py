"""The records of a folder as tables and figures need them: content, arrays, the fitted law, posterior, errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.errors import RecordError
from profilefit.fitting.quality import MEASURES
from profilefit.laws.base import Constants
from profilefit.recipes import catalogue, record
from profilefit.recipes.recipe import Albedos
from profilefit.recipes.record import ERRORS, SETS
from profilefit.recipes.targets import albedo_values

Content = Mapping[str, Any]
ADDED = ("statistical", "discretisation", "model", "jackknife")  # errors, of which the larger of the last two counts
TOTAL = "photons, dr, and the larger of model and jackknife"


def converged(content: Content) -> bool:
    """Return whether the fit says so: constants of a failed one are no law."""
    return content["fit"]["result"] == "converged"


def largest_error(constant: Content) -> float | None:
    """Return the largest of a constant's errors, in its own unit; None if it was held."""
    return max((constant[key] for key in ERRORS if constant.get(key) is not None), default=None)


def total_error(constant: Content) -> float | None:
    """Return photons, ring width, the larger of model and jackknife, together in squares; None without model error.

    Model and jackknife are two views of what the law cannot follow: they do not add.
    """
    if constant.get("model_error") is None:
        return None
    photons, rings, model, jackknife = (constant.get(f"{name}_error") or 0.0 for name in ADDED)
    return math.hypot(photons, rings, max(model, jackknife))


def z_score(constant: Content) -> float | None:
    """Return (published - regenerated) / `total_error`; None where there is no printed value or no error."""
    error, published = total_error(constant), constant.get("published")
    return (published - constant["regenerated"]) / error if error and published is not None else None


def known_errors(constants: Iterable[Content], numbered: bool = False) -> dict[str, str]:
    """Return those of `ERRORS` that any constant has, or `numbered`, has a number for: exact light has no photons."""
    known = {key for one in constants for key in one if not numbered or one[key] is not None}
    return {key: word for key, word in ERRORS.items() if key in known}


def measured_sets(content: Content) -> list[str]:
    """Return the sets of constants that a record measures, printed ones first."""
    return [name for name in SETS if name in content["quality"]]


def judged_sets(content: Content) -> list[str]:
    """Return those of `measured_sets` that are laws: regenerated constants of a failed fit are none."""
    return [name for name in measured_sets(content) if name != "regenerated" or converged(content)]


def measures(content: Content, measure: str) -> bool:
    """Return whether a record knows this measure of its regenerated constants."""
    return measure in (content.get("quality") or {}).get("regenerated", {})


def index_words(content: Content, name: str = "n") -> str:
    """Return the n, or g, that a record is of, or those that its constants span: "1", "(1, 1.6]"."""
    span = content.get(record.SPANS[name])
    return f"({span[0]:g}, {span[1]:g}]" if span else f"{content['setting'][name]:g}"


def at_index(content: Content) -> str:
    """Return for a title the index, and g, at which a record that spans several is reported; nothing for others."""
    spanned = [name for name, span in record.SPANS.items() if content.get(span)]
    return "".join(f", {name} = {content['setting'][name]:g}" for name in spanned)


def by_index(content: Content) -> Mapping[str, list[float]]:
    """Return the worst measures of a record at each index n, and g, that it was judged at; empty if it is of one."""
    worst: Mapping[str, list[float]] = (content.get("quality") or {}).get("by_index", {})
    return worst


def worst(content: Content, which: str, measure: str) -> float:
    """Return the worst over alpha of a set of constants, of regenerated ones over n and g where a record spans them."""
    spanned = by_index(content).get(measure, []) if which == "regenerated" else []
    values = [content["quality"][which][measure], spanned]
    return MEASURES[measure].worst(np.concatenate([np.atleast_1d(one) for one in values]))


# Draws of the posterior that a band is made of: enough for its 95 % edges to a tenth of the band.
DRAWS = 200
LEVEL = 0.95


@dataclass(frozen=True)
class Fitted:
    """One record with the law that its constants make.

    content, arrays  of the record; law the regenerated one
    """

    content: dict[str, Any]
    arrays: dict[str, Floats]
    law: Any

    @property
    def albedos(self) -> Floats:
        """Reduced albedos that were fitted (n,) [-]; RecordError where the protocol is damaged."""
        file = f"{self.content['name']}.json: protocol.albedos"
        declared = Albedos.of(file, self.content["protocol"]["albedos"], RecordError)
        return albedo_values(declared, self.law.setting)

    def band(self, evaluate: Callable[[Any], ArrayLike], kind: str = "misfit") -> tuple[Floats, Floats] | None:
        """Return the 95 % band (low, high) of `evaluate(law)` over posterior draws; None where the record has no chain.

        `evaluate` is given a law whose constants are (draws, 1), and must answer (draws, n).
        """
        samples, names = self.arrays.get(f"samples_{kind}"), self.content.get("covariance", {}).get("names")
        if samples is None or names is None or not converged(self.content):
            return None
        some = samples[np.linspace(0, len(samples) - 1, min(DRAWS, len(samples))).astype(int)].astype(float)
        curves = evaluate(self.law.with_vector(tuple(names), some.T[:, :, None]))
        low, high = np.nanquantile(np.asarray(curves), [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0)
        return low, high


@dataclass(frozen=True)
class Source(record.Records):
    """Records with their arrays and the laws that they make."""

    _fitted: dict[str, Fitted] = field(default_factory=dict, repr=False, compare=False)

    def fitted(self, name: str) -> Fitted | None:
        """Return a record and its law; None if the folder has none of that name. RecordError if it is damaged."""
        if name not in self.paths:
            return None
        if name not in self._fitted:
            content, path = self.content(name), self.paths[name]
            load = catalogue.albedo_law if content["pipeline"] == "albedo" else catalogue.load
            of = content["law"], str(path), record.record_setting(content), self
            self._fitted[name] = Fitted(content, record.read_arrays(path), load(*of))
        return self._fitted[name]

    def needed(self, name: str) -> Fitted:
        """Return a record and its law; RecordError if the folder has none of that name."""
        fitted = self.fitted(name)
        if fitted is None:
            raise RecordError(f"{self.folder} has no record {name!r}; `profilefit regenerate` makes it")
        return fitted

    def usable(self, name: str) -> Fitted | None:
        """Return a record whose fit converged, or None: constants of a failed fit are no law to draw."""
        fitted = self.fitted(name)
        return fitted if fitted is not None and converged(fitted.content) else None


def coefficients(law: Any, alpha: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return a [1/mfp], b [-], c [mfp] of (7) in double precision."""
    with jax.enable_x64(True):
        a, b, c = (np.asarray(value, float) for value in law.coefficients(np.asarray(alpha, float)))
    return a, b, c


def unscaled(law: Constants, r: Floats, alpha: float) -> Floats:
    """Return r R_d [1/mfp] of (7) at radii `r` [mfp], before the correction (18), and zero beyond r_max."""
    a, b, c = coefficients(law, alpha)
    return np.maximum((a * r + b) / (r + c), 0.0)


@cache
def exact_profile(alpha: float, setting: Setting, low: float, high: float) -> tuple[Floats, Floats]:
    """Return radii [mfp], even in their logarithm, and the exact R_d [1/mfp^2] there: the slow part, so kept."""
    r = np.geomspace(low, high, 160)
    return r, np.asarray(exact.profile(r, alpha, setting=setting))
