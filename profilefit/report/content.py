"""Questions that tables and figures both ask of a record's content."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Content = Mapping[str, Any]
SETS = ("published", "corrected", "regenerated")
# A constant's errors in a record, and what tables call them; records before this had no second and third.
ERRORS = {
    "statistical_error": "photons",
    "discretisation_error": "dr",
    "model_error": "model",
    "discrepancy_error": "misfit",
    "jackknife_error": "jackknife",
}


def converged(content: Content) -> bool:
    """Whether the fit says so: constants of a failed one are no law."""
    return content["fit"]["result"] == "converged"


def largest_error(constant: Content) -> float | None:
    """The largest of a constant's errors, in its own unit; None if it was held."""
    return max((constant[key] for key in ERRORS if constant.get(key) is not None), default=None)


def known_errors(constants: Content) -> dict[str, str]:
    """Those of `ERRORS` that a record's constants, by name, tell of."""
    return {key: word for key, word in ERRORS.items() if any(key in one for one in constants.values())}


def measured_sets(content: Content) -> list[str]:
    """The sets of constants that a record measures, printed ones first."""
    return [name for name in SETS if name in content["quality"]]


def measures(content: Content, measure: str) -> bool:
    """Whether a record knows this measure of its regenerated constants."""
    return measure in (content.get("quality") or {}).get("regenerated", {})
