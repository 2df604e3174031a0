"""Whatever was found, as data that JSON holds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

import numpy as np

ALL_DIGITS = 17  # give every float64 back


def plain(value: Any, digits: int = ALL_DIGITS) -> Any:
    """Numbers, text, lists and dicts only; floats to so many digits; what is not finite becomes None."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value), digits)
    if isinstance(value, Mapping):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(item, digits) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{digits}g}") if np.isfinite(value) else None
    if value is None or isinstance(value, str):
        return value
    return str(value)


def as_json(value: Any, ascii_only: bool = False) -> str:
    """What --json prints, and what lies in .json files: `plain`, in the order given, and a line break."""
    return json.dumps(plain(value), indent=1, ensure_ascii=ascii_only, allow_nan=False) + "\n"
