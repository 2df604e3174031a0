"""Questions that tables and figures both ask of a record's content."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Content = Mapping[str, Any]
SETS = ("published", "corrected", "regenerated")
ERRORS = ("statistical_error", "discrepancy_error", "jackknife_error")


def converged(content: Content) -> bool:
    """Whether the fit says so: constants of a failed one are no law."""
    return content["fit"]["result"] == "converged"


def largest_error(constant: Content) -> float | None:
    """The largest of a constant's errors, in its own unit; None if it was held."""
    return max((constant[key] for key in ERRORS if constant.get(key) is not None), default=None)


def measured_sets(content: Content) -> list[str]:
    """The sets of constants that a record measures, printed ones first."""
    return [name for name in SETS if name in content["quality"]]


def measures(content: Content, measure: str) -> bool:
    """Whether a record knows this measure of its regenerated constants."""
    return measure in (content.get("quality") or {}).get("regenerated", {})
