"""Records: fits/*.json holds what came out of a recipe, and all that is needed to judge it or to make it again.

The same recipe, seed and versions on one CPU class write the same bytes: no dates, no times, sorted keys. Samples and
curves that figures need lie beside it in an .npz of the same name.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim.files.npz import read_npz
from mcml_sim.files.text_file import MOST_JSON, parse_json
from mcml_sim.files.text_file import plain as to_plain
from mcml_sim.files.whole_file import read_whole, require_folder, write_together
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError, SettingError
from profilefit.recipes import schema
from profilefit.recipes.folder import available, fits_folder, is_file

FORMAT = 2
# What the covariance of the misfit was called in format 1, beside the discrepancy of the model, which keeps its name.
MISFIT_BEFORE, MISFIT = "discrepancy", "misfit"
ARRAYS_OF_FORMAT_1 = {f"{kind}_{MISFIT_BEFORE}": f"{kind}_{MISFIT}" for kind in ("samples", "log_density")}
# Twelve digits are beyond any error here, and within what a repeated run gives again.
DIGITS = 12
CONVERGED = "converged"
SEARCHLIGHT = Setting()
MOST_ARRAYS = 2**25  # bytes of the arrays beside it, packed or not; the largest that ship have 2^18
Problem = Callable[[dict[str, Any]], str | None]  # in words, of a record's content
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
    if not schema.is_line(path.stem):  # it is shown, and stands in exported texts
        raise RecordError(f"{str(path)!r}: the name of a record must be {schema.TEXT.words}")
    if not path.exists():
        raise RecordError(f"{path}: there is no such record; `profilefit regenerate` makes them")
    try:
        content = parse_json(read_whole(path, MOST_JSON))
    except InputError as error:
        raise RecordError(f"{path}: cannot be read ({str(error).rpartition('got: ')[2]})") from None
    except ValueError as error:
        raise RecordError(f"{path}: is not a record: {error}") from None
    if not isinstance(content, dict) or content.get("format") not in (1, FORMAT):
        found = schema.shown(content.get("format")) if isinstance(content, dict) else repr(type(content).__name__)
        raise RecordError(f"{path}: is not a record of format 1 or {FORMAT}, got {found}")
    if content["format"] == 1:
        content = _of_format_1(content)
    require_sound(content, path, whole)
    return content


def _of_format_1(content: dict[str, Any]) -> dict[str, Any]:
    """Return a record of format 1 in the words of today, whatever is wrong with it."""

    def renamed(table: Any, ending: str = "") -> Any:
        if not isinstance(table, dict):
            return table
        return {f"{MISFIT}{ending}" if key == f"{MISFIT_BEFORE}{ending}" else key: one for key, one in table.items()}

    found = {**content, "format": FORMAT}
    found |= {name: renamed(found[name]) for name in ("covariance", "posterior") if name in found}
    if isinstance(found.get("constants"), dict):
        found["constants"] = {name: renamed(one, "_error") for name, one in found["constants"].items()}
        for one in found["constants"].values():
            if isinstance(one, dict) and "intervals" in one:
                one["intervals"] = renamed(one["intervals"])
    return found


def read_of(
    path: Path, pipeline: str, words: str, shown: schema.Fields | None = None, problem: Problem | None = None
) -> dict[str, Any]:
    """Read a record of one pipeline, `words` what it is, which holds what is `shown`; RecordError on any other.

    problem  what else is wrong with its content, in one line, or None
    """
    content = read(path)
    if content["pipeline"] != pipeline:
        raise RecordError(f"{path}: must be {words}, got pipeline {content['pipeline']!r}")
    if text := schema.mistyped(content, shown or {}) or (problem(content) if problem else None):
        raise damaged(path, text)
    return content


def damaged(path: Path, text: str) -> RecordError:
    """Return the error of a record that is damaged, `text` what is wrong inside."""
    return RecordError(f"{path}: is damaged: {text}; regenerate it")


def named(name: str, folder: Path, pipeline: str) -> Path | None:
    """Return the record of a name in a folder, or the one at a path (.json) if it is of this pipeline; else None."""
    if name.endswith(".json"):
        path = Path(name)
        return path if is_file(path) and read(path)["pipeline"] == pipeline else None
    return available(folder).get(name)


def require_sound(content: dict[str, Any], path: Path, whole: bool) -> None:
    """Raise RecordError where a record lacks what `read` promises, or holds what is of another type."""
    if text := schema.problem(content, whole) or _outside(content):
        raise damaged(path, text)


def _outside(content: Mapping[str, Any]) -> str | None:
    """Return, in one line, an index or mean cosine of its own that its constants are not for; else None."""
    for name, span in SPANS.items():
        own = content["setting"].get(name)
        if span in content and schema.is_number(own) and not _within(content, span, own):
            low, high = content[span]
            return f"setting.{name} must be in ({low:g}, {high:g}], as its {span} are, got {own:g}"
    return None


def _within(content: Mapping[str, Any], span: str, value: float) -> bool:
    low, high = content.get(span) or (0.0, 0.0)
    return bool(low < value <= high)


def record_setting(content: Mapping[str, Any]) -> Setting:
    """Return the setting that a record belongs to."""
    try:
        return Setting.of(content["setting"])
    except (KeyError, TypeError, InputError):
        raise RecordError(f"record {content.get('name')!r} is damaged: it has no valid setting") from None


REFRACTING = "refracting"  # in the name of a record that holds for every index of a range
FORWARD = "forward"  # and of one that holds for every mean cosine of a range, too
SPANS = {"n": "indices", "g": "cosines"}  # a setting's numbers, and the ranges of them that a record may hold for


def covers(content: Mapping[str, Any], setting: Setting) -> bool:
    """Return whether a record's constants hold for a setting: its own or, if they span indices and g, one of these."""
    own = record_setting(content)
    there = {name: getattr(own, name) for name, span in SPANS.items() if _within(content, span, getattr(setting, name))}
    return own == replace(setting, **there)


def record_name(base: str, setting: Setting) -> str:
    """Return the name of the record of a setting: albedo-rational, -diffuse, -n1.4, -diffuse-n1.4, -g0.8."""
    parts = [base] if setting.illumination == SEARCHLIGHT.illumination else [base, setting.illumination]
    numbers = {name: getattr(setting, name) for name in SPANS}
    other = {name: value for name, value in numbers.items() if value != getattr(SEARCHLIGHT, name)}
    return "-".join([*parts, *(f"{name}{np.format_float_positional(one, trim='-')}" for name, one in other.items())])


def spanning_name(base: str, setting: Setting) -> str:
    """Return the name of the record for every index of a range, for example hazard-refracting or -diffuse-refracting.

    Under anisotropic scattering the record holds for every g, too, for example hazard-forward or -diffuse-forward.
    """
    spanning = REFRACTING if setting.g == 0.0 else FORWARD
    return f"{record_name(base, replace(setting, n=1.0, g=0.0))}-{spanning}"


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays beside a record (`path` is the .json)."""
    file = path.with_suffix(".npz")
    try:
        with file.open("rb") as opened:
            found = read_npz(opened.read(MOST_ARRAYS + 1), MOST_ARRAYS)
    except FileNotFoundError:
        raise RecordError(f"{file}: the samples and curves of this record are missing; regenerate it") from None
    except (OSError, ValueError) as error:
        raise RecordError(f"{file}: is damaged ({error}); regenerate it") from None
    return {ARRAYS_OF_FORMAT_1.get(name, name): array for name, array in found.items()}


def digest(*arrays: np.ndarray) -> str:
    """Return the SHA-256 of the numbers that were fitted, which shows whether two records are of the same data."""
    sha = hashlib.sha256()
    for array in arrays:
        sha.update(np.ascontiguousarray(array).tobytes())
    return sha.hexdigest()


def first_failure(results: Iterable[str]) -> str:
    """Return the first of several fits' results that is not converged; "converged" where all are."""
    return next((result for result in results if result != CONVERGED), CONVERGED)


def versions() -> dict[str, str]:
    """Return the versions of the libraries that decide the numbers."""
    return {name: version(name) for name in LIBRARIES}


def plain(value: Any) -> Any:
    """Return `text_file.plain` with the digits of a record; None for what is not finite."""
    return to_plain(value, DIGITS)


@dataclass(frozen=True)
class Records:
    """Records in a folder, or those of them that are named: each is read once, for as long as this lives.

    What is read is shared by all callers: nobody changes it.
    """

    folder: Path
    names: tuple[str, ...] | None = None
    _contents: dict[Path, dict[str, Any]] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def of(cls, folder: Folder) -> Records:
        """Open the records of a folder; those that are open already stay so."""
        return folder if isinstance(folder, Records) else Records(folder)

    def named(self, names: Sequence[str] | None) -> Records:
        """Return only those of these names; all that there are, if None."""
        return Records(self.folder, None if names is None else tuple(names), self._contents)

    @cached_property
    def paths(self) -> dict[str, Path]:
        """Record name -> file, in order."""
        found = available(self.folder)
        return found if self.names is None else {name: path for name, path in found.items() if name in self.names}

    def read(self, path: Path, whole: bool = False) -> dict[str, Any]:
        """Read any record once."""
        if path not in self._contents:
            self._contents[path] = read(path, whole)
        elif whole:
            require_sound(self._contents[path], path, whole)
        return self._contents[path]

    def content(self, name: str, whole: bool = False) -> dict[str, Any]:
        """Return what the record of this name says; RecordError as of `read`."""
        return self.read(self.folder / f"{name}.json", whole)

    def contents(self, whole: bool = False) -> dict[str, dict[str, Any]]:
        """Return what all records say, by name."""
        return {name: self.read(path, whole) for name, path in self.paths.items()}

    def settings(self, base: str) -> tuple[Setting, ...]:
        """Return the settings that a record is there for, by its name for Setting()."""
        near = {name: record_setting(self.read(path)) for name, path in self.paths.items() if name.startswith(base)}
        return tuple(of for name, of in near.items() if name in (record_name(base, of), spanning_name(base, of)))

    def name(self, base: str, setting: Setting) -> str:
        """Return the name of a setting's record.

        A record of the setting itself comes first, then one of a range of indices and g. Where there is neither, the
        name is the setting's.
        """
        own, spanning = record_name(base, setting), self.folder / f"{spanning_name(base, setting)}.json"
        if (self.folder / f"{own}.json").exists() or not spanning.exists():
            return own
        return spanning.stem if covers(self.read(spanning), setting) else own

    def path(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """Return the record of a setting, by its name for Setting().

        SettingError that lists the settings there are; RecordError where there is none at all.
        """
        if (path := self.folder / f"{self.name(base, setting)}.json").exists():
            return path
        if known := self.settings(base):
            there = "; ".join(self._described(base, one) for one in known)
            raise SettingError(f"record {base} belongs to {there}, got a request for {setting}")
        makes = f"`profilefit regenerate {base} --out {self.folder}` makes it"
        raise RecordError(f"{path}: there is no such record; {makes}")

    def path_or_shipped(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """Return the record of a setting, or the one that is shipped, where this folder has none of that setting."""
        path = self.folder / f"{self.name(base, setting)}.json"
        return path if path.exists() else Records(fits_folder()).path(base, setting)

    def _described(self, base: str, setting: Setting) -> str:
        """Return a setting that there is a record for, in words."""
        content, words = self.content(self.name(base, setting)), str(setting)
        for name, span in SPANS.items():
            if span in content:
                low, high = content[span]
                words = words.replace(f"{name} = {getattr(setting, name):g}", f"{name} in ({low:g}, {high:g}]")
        return words


Folder = Path | Records
"""A folder of records, by its path or open."""
