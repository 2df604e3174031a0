"""Lengths with their units, as people write them: 1.2mm, 30 um."""

from __future__ import annotations

import re

from mcml_sim.media.checks import shown
from profilefit.errors import InputError
from profilefit.measured.data import LARGEST, SMALLEST

# In millimetres.
UNITS = {
    "nm": 1e-6,
    "um": 1e-3,
    "µm": 1e-3,  # the micro sign
    "μm": 1e-3,  # the Greek letter, which looks alike
    "mm": 1.0,
    "cm": 10.0,
    "m": 1000.0,
    "in": 25.4,
    "inch": 25.4,
}
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*)")
PER_AREA = re.compile(
    r"1?\s*/\s*\(?\s*(?P<over>[^\W\d_]+)\s*(?:(?:\^|\*\*)?\s*2|²)\s*\)?"
    r"|(?P<power>[^\W\d_]+)\s*(?:(?:\^|\*\*)?\s*\(?[-−]2\)?|⁻²)"
)


def checked_unit(name: str, unit: str) -> str:
    """A unit of length that is known; InputError names what `name` was given."""
    if unit in UNITS:
        return unit
    raise InputError(f"{name} must be a unit of length ({', '.join(UNITS)}), got {shown(unit)}")


def length(name: str, text: str, unit: str, accepted: str = "a length > 0 such as 1.2mm") -> float:
    """Return a length > 0 such as 1.2mm, in `unit`; a bare number is in `unit` already.

    InputError says that `name` must be what is `accepted`, and that `SMALLEST` and `LARGEST` bound it.
    """
    match = NUMBER.fullmatch(text.strip())
    if match is None or not float(match[1]) > 0 or (match[2] and match[2] not in UNITS):
        raise InputError(f"{name} must be {accepted} (units: {', '.join(UNITS)}), got {shown(text)}")
    if match[2] and not unit:
        raise InputError(
            f"{name} must be without a unit where the data has none (`unit` gives it one), got {shown(text)}"
        )
    found = float(match[1]) * (factor(match[2], unit) if match[2] and match[2] != unit else 1.0)
    if not SMALLEST <= found <= LARGEST:
        raise InputError(f"{name} must lie between {SMALLEST:g} and {LARGEST:g} {unit or 'in size'}, got {shown(text)}")
    return found


def factor(source: str, target: str) -> float:
    """How many `target` a `source` is."""
    return UNITS[source] / UNITS[target]


def area_unit(text: str) -> str | None:
    """The unit of length in 1/mm^2, 1/mm², 1/mm2, mm^-2 or mm⁻²; None if the text is no such thing."""
    match = PER_AREA.fullmatch(text.strip())
    unit = (match["over"] or match["power"]) if match else None
    return unit if unit in UNITS else None
