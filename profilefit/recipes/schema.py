"""Fields of a record and their types: everything that laws, shader sources, tables and pages take from one.

A record may come from anywhere. Its texts are shown on terminals and become comments in code, its numbers become
constants: what passes here is safe for both.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from mcml_sim.media import arrays

LONGEST_TEXT = 1000  # characters; ours have 256
LONGEST_SHOWN = 60  # characters of a value in a message


def is_line(value: Any) -> bool:
    """Return whether a value is one line of printable text, without control characters or hidden ones."""
    return isinstance(value, str) and len(value) <= LONGEST_TEXT and value.isprintable()


def is_number(value: Any) -> bool:
    """Return whether a value is a number that float64 can hold; true and false are none."""
    return arrays.is_number(value) and math.isfinite(value)


@dataclass(frozen=True)
class FieldType:
    """Type of a value in a record: `accepts` decides, `words` name it in messages."""

    words: str
    accepts: Callable[[Any], bool]


def _every(accepts: Callable[[Any], bool], least: int = 0) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, list) and len(value) >= least and all(map(accepts, value))


def _is_measure(value: Any) -> bool:
    return value is None or is_number(value)


def _is_matrix(value: Any) -> bool:
    return value is None or _every(lambda row: _every(_is_measure)(row) and len(row) == len(value))(value)


TEXT = FieldType(f"one line of printable text, of {LONGEST_TEXT} characters at most", is_line)
TEXTS = FieldType("a list of texts", _every(is_line))
DIGEST = FieldType(
    "64 hexadecimal digits", lambda value: isinstance(value, str) and bool(re.fullmatch("[0-9a-f]{64}", value))
)
NUMBER = FieldType("a number", is_number)
MEASURE = FieldType("a number or null", _is_measure)  # null where it is not finite
COUNT = FieldType("a whole number", lambda v: isinstance(v, int) and not isinstance(v, bool) and 0 <= v < 2**63)
FLAG = FieldType("true or false", lambda value: isinstance(value, bool))
TABLE = FieldType("a table", lambda value: isinstance(value, dict))
LIST = FieldType("a list", lambda value: isinstance(value, list))
NUMBERS = FieldType("a list of numbers", _every(is_number, 1))
MEASURES = FieldType("a list of numbers or nulls", _every(_is_measure))
RATIOS = FieldType("a list of numbers > 0", _every(lambda value: is_number(value) and value > 0, 1))
PAIR = FieldType("a list of two numbers or nulls", lambda value: _every(_is_measure)(value) and len(value) == 2)
SPAN = FieldType("a list of two numbers", lambda value: _every(is_number)(value) and len(value) == 2)
HALVES = FieldType("a list of pairs of numbers", _every(lambda row: _every(is_number)(row) and len(row) == 2))
MATRIX = FieldType("a square matrix of numbers, or null", _is_matrix)


def shown(value: Any) -> str:
    """Return a value as a message shows it: printable and shortened."""
    try:
        text = json.dumps(value)
    except (ValueError, RecursionError, TypeError):  # Python spells no whole number beyond 4300 digits
        return f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


DEEPEST = 12  # tables and lists within one another; ours have 6
# By dotted key, * for each one inside, ? behind what may be absent; a table stands before what is in it.
Fields = Mapping[str, FieldType]
# A constant's errors in a record, and what tables and texts call them; older records have no second and third.
ERRORS = {
    "statistical_error": "photons",
    "discretisation_error": "dr",
    "model_error": "model",
    "misfit_error": "misfit",
    "jackknife_error": "jackknife",
}


def under(place: str, kinds: Mapping[str, FieldType]) -> dict[str, FieldType]:
    """Return the fields of a table at a place: the table itself, and then each name of the texts in `kinds`."""
    return {place: TABLE, **{f"{place}.{name}": kind for names, kind in kinds.items() for name in names.split()}}


# What a law is made of.
NAMED: Fields = {
    **dict.fromkeys(("law", "pipeline"), TEXT),
    "setting": TABLE,
    **dict.fromkeys(("indices?", "cosines?"), SPAN),
    "data_digest?": DIGEST,
}
CONSTANTS: Fields = under(
    "constants",
    {"*": TABLE, "*.regenerated": NUMBER, " ".join(f"*.{name}?" for name in ("published", *ERRORS)): MEASURE},
)
# What is shown besides, of whatever pipeline.
TOLD: Fields = {
    **dict.fromkeys(("name", "title", "equations", "note?", "setting.illumination"), TEXT),
    "preset": FieldType("quick or full", lambda value: value in ("quick", "full")),
    "seed": COUNT,
    **dict.fromkeys(("setting.n", "setting.g"), NUMBER),
    **under("truth", {"kind?": TEXT, "photons?": COUNT, "grid_digest?": DIGEST}),
    **under("versions?", {"*": TEXT}),
}
# A measure of laws by albedo; the worst of laws and maps at each index; and one of maps as a whole.
BY_ALBEDO = ("rel", "largest", "ks", "l1", "mse", "r2", "inversion_error")
HALVED, BY_INDEX = ("mse_halves", "r2_halves"), ("n", "g", "rel", "ks", "largest", "delta_A")
IN_MAP = "delta_A", "delta_alpha", "largest_s", "monotone", "at_one", "fold"
OF_MAP = dict.fromkeys(IN_MAP, NUMBER) | {"monotone": FLAG}
SETS = ("published", "corrected", "regenerated")
QUANTITY = FieldType(
    "radius or reflectance", lambda value: isinstance(value, str) and value in ("radius", "reflectance")
)
PARTS: Fields = {
    **under("covariance?", {"names": TEXTS, "statistical? misfit? model?": MATRIX}),
    **under("left_out?", {"rings albedos": COUNT}),
    **under("derived?", {"quantity": QUANTITY, "alpha": NUMBERS, "value statistical model": MEASURES}),
    **under("discrepancy?", {"amplitude amplitude_error length_r length_s rms": MEASURE, "result": TEXT}),
    **under("crosscheck?", {"chi2 chance": MEASURE, "rank photons": COUNT, "result": TEXT, "constants": TABLE}),
    **under("crosscheck?.constants.*", {"exact photons statistical_error z": MEASURE}),
    **under("starts?", {"count others": COUNT, "share_best": NUMBER, "result rule": TEXT, "outcomes": LIST}),
    **under("starts?.outcomes.*", {"count": COUNT, "cost_ratio": MEASURE, "result": TEXT, "constants": TABLE}),
}
PROTOCOL: Fields = {
    **under("albedos", {"low high": NUMBER, "count": COUNT, "spacing": TEXT}),
    **under("rings?", {"dr first last epsilon": NUMBER, "count": COUNT, "trim": TEXT}),
    "rings?": FieldType("a table or null", lambda value: value is None or isinstance(value, dict)),
    "held?": TEXTS,
    **dict.fromkeys(("indices?", "cosines?"), NUMBERS),
    **under("weighting", {"objective": TEXT, "energy_limit source_limit shares last_share": NUMBER}),
}
FIT: Fields = {
    **CONSTANTS,
    "constants.*.published": MEASURE,
    "constants.*.free?": FLAG,
    **under("constants.*.intervals?", {"*": TABLE, "*.*": PAIR}),
    **under("protocol", PROTOCOL),
    **under("fit", {"result": TEXT, "steps": COUNT, "condition_number": MEASURE}),
    **under("fit.residuals", {"rms largest": MEASURE, "along_r along_alpha half_waves": NUMBER}),
    "posterior": TABLE,
    **under("posterior.*", {"result": TEXT, "steps walkers": COUNT, "tau": MEASURE, "acceptance": NUMBER}),
    **under("quality", {"regenerated": TABLE, "alpha?": NUMBERS}),
    **under("quality.by_index?", {f"{name}?": NUMBERS for name in BY_INDEX}),
    **{f"quality.{one}?": TABLE for one in SETS},
    **{f"quality.{one}?.{name}?": NUMBERS for one in SETS for name in BY_ALBEDO},
    **{f"quality.{one}?.{name}?": HALVES for one in SETS for name in HALVED},
    **{f"quality.{one}?.{name}?": kind for one in SETS for name, kind in OF_MAP.items()},
    **PARTS,
}
ALBEDO: Fields = {**FIT, **{f"quality.regenerated.{name}": kind for name, kind in OF_MAP.items()}}
INVERSE: Fields = {**FIT, "quality.alpha": NUMBERS, "quality.regenerated.inversion_error": NUMBERS}
PROFILE: Fields = {
    **FIT,
    **dict.fromkeys(("quality.alpha", *(f"quality.regenerated.{name}" for name in ("rel", "ks", "l1"))), NUMBERS),
}
STAGED: Fields = {
    **PROFILE,
    **under("stages", {"coefficient_laws": TABLE}),
    **under("stages.coefficient_laws.*", {"result": TEXT, "condition_number": MEASURE}),
    **under("stages.coefficient_laws.*.constants", {"*": NUMBER}),
    **under("stages.coefficient_laws.*.standard_error?", {"*": MEASURE}),
    **under("stages.per_albedo_failures?", {"*": COUNT}),
    **under("stages.length_exponents?", {"*": NUMBER}),
}
OF_READING = {
    "equation verdict choices evidence? result?": TEXT,
    "curve_distance constant_distance": MEASURE,
    "constants published": TABLE,
    "constants.* published.*": NUMBER,
}
OF_ROW = {"material? model? channel? range_choice?": TEXT, "range_mm?": NUMBER, "mse_over_printed?": RATIOS}
EVIDENCE: Fields = {
    **under("protocol?", PROTOCOL),
    **dict.fromkeys(("readings", "table1", "halves?"), LIST),
    **under("readings.*", OF_READING),
    **under("table1.*", OF_ROW),
    **under("halves?.*", {"material? model?": TEXT, "off?": MEASURE}),
}
# Each pipeline: the objectives that its recipes can make small, and what its records hold.
PIPELINES: dict[str, tuple[tuple[str, ...], Fields]] = {
    "albedo": (("albedo", "reflectance", "relative_reflectance"), ALBEDO),
    "profile": (("energy", "relative"), PROFILE),
    "as-published": (("radial",), STAGED),
    "inverse": (("radius", "relative_radius", "share"), INVERSE),
    "evidence": ((), EVIDENCE),
}
ABSENT = object()


def problem(content: dict[str, Any], whole: bool) -> str | None:
    """Return what is wrong with a record, in one line, or None; of a `whole` one with anything that a report shows."""
    pipeline = content.get("pipeline")
    needed = [NAMED if pipeline == "evidence" else {**NAMED, **CONSTANTS}]
    if whole and is_line(pipeline):
        if pipeline not in PIPELINES:
            return f"pipeline must be one of {', '.join(PIPELINES)}, got {shown(pipeline)}"
        needed += [TOLD, PIPELINES[str(pipeline)][1]]
    found = _unfit(content) or next((text for fields in needed if (text := mistyped(content, fields))), None)
    return found or (_mismatched(content) if whole and pipeline != "evidence" else None)


def _unfit(value: Any, place: str = "", depth: int = 0) -> str | None:
    """Return, in one line, what no record may hold: text of several lines, no numbers, nests without end; else None."""
    if isinstance(value, str):
        return None if is_line(value) else f"{place or 'it'} must be {TEXT.words}, got {shown(value)}"
    if isinstance(value, int | float):
        return None if isinstance(value, bool) or is_number(value) else f"{place} must be {NUMBER.words} of float64"
    if value is None:
        return None
    if depth == DEEPEST:
        return f"{place} must not nest deeper than {DEEPEST} tables and lists"
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for name, item in items:
        if isinstance(name, str) and not is_line(name):
            return f"keys in {place or 'it'} must be {TEXT.words}, got {shown(name)}"
        if type(item) is float and math.isfinite(item):  # most of a record: its place is never told
            continue
        if text := _unfit(item, f"{place}.{name}".removeprefix("."), depth + 1):
            return text
    return None


def mistyped(content: Mapping[str, Any], fields: Fields) -> str | None:
    """Return, in one line, the first key that is absent or of another type; None where all are right."""
    for key, kind in fields.items():
        for place, value in _each(content, key.split(".")):
            if not kind.accepts(value):
                return f"{place} must be {kind.words}, got {'nothing' if value is ABSENT else shown(value)}"
    return None


def missing_constant(content: Mapping[str, Any], names: Iterable[str]) -> str | None:
    """Return, in one line, the first constant that a record lacks; None where it has all."""
    missing = next((name for name in names if name not in content["constants"]), None)
    return f"constants.{missing} must be a table, got nothing" if missing else None


def _each(value: Any, key: list[str], place: str = "") -> Iterator[tuple[str, Any]]:
    """Return every value that stands at a key, ABSENT where one must; what is above it has been checked."""
    if not key:
        yield place[1:], value
    elif value is None:  # a table that may be null
        return
    elif key[0] == "*":
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _each(item, key[1:], f"{place}.{name}")
    elif (name := key[0].rstrip("?")) in value or not key[0].endswith("?"):
        yield from _each(value.get(name, ABSENT), key[1:], f"{place}.{name}")


def _mismatched(content: dict[str, Any]) -> str | None:
    """Return, in one line, a list of the wrong length, a strange name, or a measure without its twin; else None."""
    names = content.get("covariance", {}).get("names", [])
    if strange := [name for name in names if name not in content["constants"]]:
        return f"covariance.names must be of its constants, got {strange[0]!r}"
    for kind, matrix in content.get("covariance", {}).items():
        if kind != "names" and matrix is not None and len(matrix) != len(names):
            return f"covariance.{kind} must have a row for each of {len(names)} names, got {len(matrix)}"
    derived, quality = content.get("derived", {}), content["quality"]
    by_index, alpha = quality.get("by_index", {}), len(quality.get("alpha", ()))
    found = [one for one in SETS if one in quality]
    for place, table, keys, like, length in (
        ("derived", derived, ("value", "statistical", "model"), "derived.alpha", len(derived.get("alpha", ()))),
        ("quality.by_index", by_index, BY_INDEX, "quality.by_index.n", len(by_index.get("n", ()))),
        *((f"quality.{one}", quality[one], (*BY_ALBEDO, *HALVED), "quality.alpha", alpha) for one in found),
    ):
        for key in keys:
            if key in table and len(table[key]) != length:
                return f"{place}.{key} must be as long as {like}, {length}, got {len(table[key])}"
    for one in found:
        # What is measured of the regenerated law is measured of the printed ones beside it.
        kept = [key for key in ("rel", "ks", "inversion_error") if key in quality["regenerated"]]
        kept += OF_MAP if "delta_A" in quality["regenerated"] else ()
        if missing := [key for key in kept if key not in quality[one]]:
            return f"quality.{one}.{missing[0]} must be there, as others of its kind are, got nothing"
    return None
