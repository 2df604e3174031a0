"""Records: fits/*.json is what came out of a recipe, and everything needed to judge it or to make it again.

The same recipe, seed and versions on one CPU class write the same bytes: no dates, no times, sorted keys. Samples and
curves that figures need lie beside it in an .npz of the same name.
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from types import NoneType
from typing import Any

import numpy as np

from mcml_sim.plain import plain as to_plain
from mcml_sim.whole_file import require_folder, write_together
from profilefit.errors import RecordError

FORMAT = 1
# Twelve digits are beyond any error here, and within what a repeated run gives again.
DIGITS = 12
# What a record must hold, by dotted key, * for each one inside: what identifies it, then what its pipeline adds.
Kinds = Mapping[str, type | tuple[type, ...]]
NUMBER = (int, float)
MEASURE = (int, float, NoneType)  # null where it is not finite
NAMED: Kinds = {"law": str, "pipeline": str, "setting": dict}
TOLD: Kinds = {
    "name": str,
    "title": str,
    "equations": str,
    "preset": str,
    "seed": int,
    "truth": dict,
    "setting.illumination": str,
    "setting.n": NUMBER,
    "setting.g": NUMBER,
}
CONSTANTS: Kinds = {"constants": dict, "constants.*": dict}
FIT: Kinds = {
    "constants.*.regenerated": NUMBER,
    "protocol": dict,
    "protocol.weighting": dict,
    "protocol.weighting.objective": str,
    "fit": dict,
    "fit.result": str,
    "fit.steps": int,
    "fit.condition_number": MEASURE,
    "fit.residuals": dict,
    "fit.residuals.rms": MEASURE,
    "fit.residuals.largest": MEASURE,
    "fit.residuals.along_r": NUMBER,
    "fit.residuals.along_alpha": NUMBER,
    "fit.residuals.half_waves": NUMBER,
    "posterior": dict,
    "posterior.*": dict,
    "posterior.*.result": str,
    "posterior.*.steps": int,
    "posterior.*.walkers": int,
    "posterior.*.tau": MEASURE,
    "posterior.*.acceptance": NUMBER,
    "quality": dict,
    "quality.regenerated": dict,
}
PROFILE: Kinds = {**FIT, "quality.alpha": list}
STAGED: Kinds = {
    **PROFILE,
    "stages": dict,
    "stages.coefficient_laws": dict,
    "stages.coefficient_laws.*": dict,
    "stages.coefficient_laws.*.constants": dict,
    "stages.coefficient_laws.*.result": str,
    "stages.coefficient_laws.*.condition_number": MEASURE,
}
# What a recipe may ask for besides; checked where it is there.
OPTIONAL: Mapping[str, Kinds] = {
    "derived": {
        "derived": dict,
        "derived.quantity": str,
        "derived.alpha": list,
        "derived.value": list,
        "derived.statistical": list,
        "derived.model": list,
    },
    "discrepancy": {
        "discrepancy": dict,
        "discrepancy.amplitude": MEASURE,
        "discrepancy.amplitude_error": MEASURE,
        "discrepancy.length_r": MEASURE,
        "discrepancy.length_s": MEASURE,
        "discrepancy.rms": MEASURE,
        "discrepancy.result": str,
    },
    "crosscheck": {
        "crosscheck": dict,
        "crosscheck.constants": dict,
        "crosscheck.constants.*": dict,
        "crosscheck.constants.*.exact": MEASURE,
        "crosscheck.constants.*.photons": MEASURE,
        "crosscheck.constants.*.statistical_error": MEASURE,
        "crosscheck.constants.*.z": MEASURE,
        "crosscheck.chi2": MEASURE,
        "crosscheck.rank": int,
        "crosscheck.chance": MEASURE,
        "crosscheck.photons": int,
        "crosscheck.result": str,
    },
    "starts": {
        "starts": dict,
        "starts.count": int,
        "starts.share_best": NUMBER,
        "starts.result": str,
        "starts.rule": str,
        "starts.others": int,
        "starts.outcomes": list,
        "starts.outcomes.*": dict,
        "starts.outcomes.*.count": int,
        "starts.outcomes.*.cost_ratio": MEASURE,
        "starts.outcomes.*.result": str,
        "starts.outcomes.*.constants": dict,
    },
}
EVIDENCE: Kinds = {"readings": list, "readings.*": dict, "table1": list, "table1.*": dict}
SHOWN = {"albedo": FIT, "profile": PROFILE, "inverse": PROFILE, "as-published": STAGED, "evidence": EVIDENCE}
ABSENT = object()
LONGEST_SHOWN = 60  # characters of a value in a message
SPOKEN = {
    str: "text",
    dict: "a table",
    list: "a list",
    int: "a whole number",
    NUMBER: "a number",
    MEASURE: "a number or null",
}
# A constant's errors in a record, and what tables and texts call them; older records have no second and third.
ERRORS = {
    "statistical_error": "photons",
    "discretisation_error": "dr",
    "model_error": "model",
    "discrepancy_error": "misfit",
    "jackknife_error": "jackknife",
}
LIBRARIES = ("profilefit", "jax", "jaxlib", "optimistix", "emcee", "numpy", "scipy")


def write(folder: Path, name: str, content: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Path:
    """Write `name`.json and `name`.npz into `folder`, both or neither. OutputError names the file and the reason."""
    body = plain({"format": FORMAT, "name": name, **content})
    contents: dict[Path, bytes | str] = {}
    if arrays:
        file = io.BytesIO()
        np.savez_compressed(file, allow_pickle=False, **arrays)
        contents[folder / f"{name}.npz"] = file.getvalue()
    path = folder / f"{name}.json"
    contents[path] = json.dumps(body, indent=1, sort_keys=True, allow_nan=False) + "\n"
    require_folder(folder)
    write_together(contents)
    return path


def read(path: Path, whole: bool = False) -> dict[str, Any]:
    """Read a record; RecordError says which file and what is wrong with it.

    Its law, pipeline, setting and constants must be there: that is what a law is made from. A `whole` record holds
    everything that `profilefit report` shows.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RecordError(f"{path}: there is no such record; `profilefit regenerate` makes them") from None
    except OSError as error:
        raise RecordError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{path}: is not a record: {error}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise RecordError(f"{path}: is not a record of format {FORMAT}, got {found!r}")
    _require(path, content, NAMED if content.get("pipeline") == "evidence" else {**NAMED, **CONSTANTS})
    if whole:
        pipeline = content["pipeline"]
        if pipeline not in SHOWN:
            raise RecordError(f"{path}: is damaged: pipeline must be one of {', '.join(SHOWN)}, got {pipeline!r}")
        _require(path, content, {**TOLD, **SHOWN[pipeline]})
        for part in (part for part in OPTIONAL if part in content):
            _require(path, content, OPTIONAL[part])
    return content


def _require(path: Path, content: dict[str, Any], kinds: Kinds) -> None:
    """RecordError unless all these keys are there and of these kinds."""
    for key, kind in kinds.items():
        for place, value in _each(content, key.split(".")):
            if not isinstance(value, kind) or isinstance(value, bool):
                found = "nothing" if value is ABSENT else json.dumps(value)[:LONGEST_SHOWN]
                raise RecordError(f"{path}: is damaged: {place} must be {SPOKEN[kind]}, got {found}; regenerate it")


def _each(value: Any, key: list[str], place: str = "") -> Iterator[tuple[str, Any]]:
    """Every value that stands at a key, ABSENT where there is none; what is above it has been checked."""
    if not key:
        yield place[1:], value
    elif key[0] == "*":
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _each(item, key[1:], f"{place}.{name}")
    else:
        yield from _each(value.get(key[0], ABSENT), key[1:], f"{place}.{key[0]}")


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays beside a record (`path` is the .json)."""
    file = path.with_suffix(".npz")
    try:
        with file.open("rb") as opened, np.load(opened) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except FileNotFoundError:
        raise RecordError(f"{file}: the samples and curves of this record are missing; regenerate it") from None
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise RecordError(f"{file}: is damaged ({error}); regenerate it") from None


def available(folder: Path) -> dict[str, Path]:
    """The records of a folder by name, in order."""
    return {path.stem: path for path in sorted(folder.glob("*.json"))}


def digest(*arrays: np.ndarray) -> str:
    """SHA-256 of the numbers that were fitted, to tell whether two records saw the same data."""
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()


def versions() -> dict[str, str]:
    """The libraries that decide the numbers."""
    return {name: version(name) for name in LIBRARIES}


def plain(value: Any) -> Any:
    """`mcml_sim.plain` with the digits of a record: numbers, text, lists and dicts; None for what is not finite."""
    return to_plain(value, DIGITS)
