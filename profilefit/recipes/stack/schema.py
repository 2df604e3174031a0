"""What the record of a stack must hold for a report, which shows all that it says and makes no law of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from profilefit.errors import RecordError
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes.kinds import COUNT, LIST, MEASURE, NUMBER, NUMBERS, TABLE, TEXT
from profilefit.recipes.schema import TOLD, Kinds, mistyped
from profilefit.recipes.stack.record import of_stack

# Of each interface: what it is wrong by at thicknesses that were not fitted, and how its fit ended.
BY_THICKNESS = ("thickness", "rel", "ks", "delta_A")
OF_INTERFACES: Kinds = {
    **dict.fromkeys(("quality", "fit", "starts"), LIST),
    **dict.fromkeys(("quality.*", "fit.*", "starts.*"), TABLE),
    **{f"quality.*.{name}": NUMBERS for name in BY_THICKNESS},
    "fit.*.result": TEXT,
    "fit.*.condition_number": MEASURE,
    **dict.fromkeys(("fit.*.steps", "starts.*.as_good", "starts.*.count"), COUNT),
}
# What `profilefit report` shows of a stack.
SHOWN: Kinds = {
    **TOLD,
    "unit": TEXT,
    "layers": LIST,
    "layers.*": TABLE,
    "layers.*.name": TEXT,
    "layers.*.thickness": MEASURE,
    **dict.fromkeys(("layers.*.n", "layers.*.g"), NUMBER),
    **dict.fromkeys(("layers.*.mu_a", "layers.*.mu_s"), NUMBERS),
    **dict.fromkeys(("quality", "quality.regenerated", "interfaces"), TABLE),
    **dict.fromkeys(("quality.regenerated.rel", "quality.regenerated.ks"), NUMBERS),
    "quality.regenerated.delta_A": NUMBER,
    **{f"interfaces.{channel}": TABLE for channel in CHANNELS},
    **{f"interfaces.{channel}.{key}": kind for channel in CHANNELS for key, kind in OF_INTERFACES.items()},
}


def read(path: Path) -> dict[str, Any]:
    """All that a record says; RecordError on one that is damaged."""
    content = of_stack(path)
    if text := mistyped(content, SHOWN) or _mismatched(content):
        raise RecordError(f"{path}: is damaged: {text}; regenerate it")
    return content


def interfaces(content: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """The colour and number of each interface of a record, from the surface down, colour by colour."""
    return ((channel, number) for channel in CHANNELS for number in range(1, len(content["layers"])))


def _mismatched(content: Mapping[str, Any]) -> str | None:
    """Lists that must be as long as others, constants that must be there."""
    count = len(content["layers"]) - 1
    for channel in CHANNELS:
        one = content["interfaces"][channel]
        for key in ("quality", "fit", "starts"):
            if len(one[key]) != count:
                return f"interfaces.{channel}.{key} must be {count}, one an interface, got {len(one[key])}"
        if any(len({len(each[name]) for name in BY_THICKNESS}) > 1 for each in one["quality"]):
            return f"interfaces.{channel}.quality must have {', '.join(BY_THICKNESS)} of one length"
    names = (
        f"{channel}.{number}.{name}" for channel, number in interfaces(content) for name in StackLaw.constant_names()
    )
    missing = next((name for name in names if name not in content["constants"]), None)
    return f"constants.{missing} must be a table, got nothing" if missing else None
