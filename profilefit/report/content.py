"""Questions that tables and figures both ask of a record's content."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from profilefit.schema import ERRORS, SETS

Content = Mapping[str, Any]
ADDED = ("statistical", "discretisation", "model", "jackknife")  # errors, of which the larger of the last two counts
TOTAL = "photons, rings, and the larger of model and jackknife"


def converged(content: Content) -> bool:
    """Whether the fit says so: constants of a failed one are no law."""
    return content["fit"]["result"] == "converged"


def largest_error(constant: Content) -> float | None:
    """The largest of a constant's errors, in its own unit; None if it was held."""
    return max((constant[key] for key in ERRORS if constant.get(key) is not None), default=None)


def total_error(constant: Content) -> float | None:
    """Photons, ring width, the larger of model and jackknife, together in squares; None if held or without model error.

    Model and jackknife are two views of what the law cannot follow: they do not add.
    """
    if constant.get("model_error") is None:
        return None
    photons, rings, model, jackknife = (constant.get(f"{name}_error") or 0.0 for name in ADDED)
    return math.hypot(photons, rings, max(model, jackknife))


def z_score(constant: Content) -> float | None:
    """(published - regenerated) / `total_error`; None where there is no printed value or no error."""
    error, published = total_error(constant), constant.get("published")
    return (published - constant["regenerated"]) / error if error and published is not None else None


def known_errors(constants: Content) -> dict[str, str]:
    """Those of `ERRORS` that a record's constants, by name, tell of."""
    return {key: word for key, word in ERRORS.items() if any(key in one for one in constants.values())}


def measured_sets(content: Content) -> list[str]:
    """The sets of constants that a record measures, printed ones first."""
    return [name for name in SETS if name in content["quality"]]


def measures(content: Content, measure: str) -> bool:
    """Whether a record knows this measure of its regenerated constants."""
    return measure in (content.get("quality") or {}).get("regenerated", {})
