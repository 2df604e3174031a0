"""Records: fits/*.json holds what came out of a recipe, and all that is needed to judge it or to make it again.

The same recipe, seed and versions on one CPU class write the same bytes: no dates, no times, sorted keys. Samples and
curves that figures need lie beside it in an .npz of the same name.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from mcml_sim.files.npz import read_npz
from mcml_sim.files.whole_file import MOST_JSON, parse_json, read_whole, require_folder, write_together
from mcml_sim.files.whole_file import plain as to_plain
from mcml_sim.media.arrays import is_number, require, shown
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError, SettingError
from profilefit.recipes.declared import LONGEST_RECORDED, Declared, Keys, OneOf, Refused, Table, is_line, words
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
DEEPEST = 12  # tables and lists within one another; ours have 6
LINE = f"one line of printable text, of {LONGEST_RECORDED} characters at most"
REFRACTING = "refracting"  # in the name of a record that holds for every index of a range
FORWARD = "forward"  # and of one that holds for every mean cosine of a range, too
SPANS = {"n": "indices", "g": "cosines"}  # a setting's numbers, and the ranges of them that a record may hold for
LIBRARIES = ("profilefit", "jax", "jaxlib", "optimistix", "emcee", "numpy", "scipy")

# Fields of a record: everything that laws, shader sources, tables and pages take from one. It may come from anywhere,
# its texts are shown on terminals and become comments in code, its numbers become constants. `str` and `float` have no
# limits here, since `_require_safe` looks at every text and number of a record, at whatever key.
ABSENT: Any = None  # in place of a key that may be absent, but not null
TWO = Field(min_length=2, max_length=2)
Count = Annotated[int, Field(ge=0, lt=2**63), words("a whole number")]
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$"), words("64 hexadecimal digits")]
Measure = Annotated[float | None, words("a number or null")]  # null where it is not finite
Measures = Annotated[list[float | None], words("a list of numbers or nulls")]
Numbers = Annotated[list[float], Field(min_length=1), words("a list of numbers")]
Ratios = Annotated[list[Annotated[float, Field(gt=0)]], Field(min_length=1), words("a list of numbers > 0")]
Pair = Annotated[list[float | None], TWO, words("a list of two numbers or nulls")]
Span = Annotated[list[float], TWO, words("a list of two numbers")]
Halves = Annotated[list[Span], words("a list of pairs of numbers")]
Texts = Annotated[list[str], words("a list of texts")]
Matrix = Annotated[list[Measures] | None, words("a square matrix of numbers, or null")]
# A constant's errors in a record, and what tables and texts call them; older records have no second and third.
ERRORS = {
    "statistical_error": "photons",
    "discretisation_error": "dr",
    "model_error": "model",
    "misfit_error": "misfit",
    "jackknife_error": "jackknife",
}
OF_CONSTANT = dict.fromkeys(("published", *ERRORS), Measure)
Constant = Annotated[Table, Keys(OF_CONSTANT, regenerated=float)]
SOLVED = {"result": str, "condition_number": Measure}
# A measure of laws by albedo; the worst of laws and maps at each index; and one of maps as a whole.
BY_ALBEDO = ("rel", "largest", "ks", "l1", "mse", "r2", "inversion_error")
HALVED, BY_INDEX = ("mse_halves", "r2_halves"), ("n", "g", "rel", "ks", "largest", "delta_A")
OF_MAP = {**dict.fromkeys(("delta_A", "delta_alpha", "largest_s", "at_one", "fold"), float), "monotone": bool}
MEASURED = {**dict.fromkeys(BY_ALBEDO, Numbers), **dict.fromkeys(HALVED, Halves), **OF_MAP}
PARTS = ("value", "statistical", "model")
SETS = ("published", "corrected", "regenerated")
QUALITY = {"alpha": Numbers, "by_index": Keys(dict.fromkeys(BY_INDEX, Numbers)), **dict.fromkeys(SETS, Keys(MEASURED))}


class NamedRecord(Declared):
    """Record of any pipeline: its law, and the setting that it belongs to. It may have keys that nobody declared."""

    model_config = ConfigDict(extra="ignore")
    law: str
    pipeline: str
    setting: Annotated[Table, Keys(dict.fromkeys(SPANS, Any))]
    indices: Span = ABSENT
    cosines: Span = ABSENT
    data_digest: Digest = ABSENT

    @model_validator(mode="after")
    def _spanning(self) -> Self:
        """Refuse an index or mean cosine of its own that its constants are not for."""
        for name, span in SPANS.items():
            own, (low, high) = self.setting.get(name), getattr(self, span) or (-math.inf, math.inf)
            if is_number(own) and not low < own <= high:
                raise Refused(f"in ({low:g}, {high:g}], as its {span} are", own, "setting", name)
        return self


class LawRecord(NamedRecord):
    """Record that a law is made from."""

    constants: dict[str, Constant]

    def require_constants(self, names: Iterable[str]) -> None:
        """Refuse a record that lacks one of these constants."""
        if missing := next((name for name in names if name not in self.constants), None):
            raise Refused("a table", None, "constants", missing)


class WholeRecord(NamedRecord):
    """Record with what a report shows of every pipeline."""

    name: str
    title: str
    equations: str
    note: str = ABSENT
    preset: Annotated[str, OneOf("quick", "full")]
    seed: Count
    setting: Annotated[Table, Keys(illumination=str, n=float, g=float)]
    truth: Annotated[Table, Keys({"kind": str, "photons": Count, "grid_digest": Digest})]
    versions: dict[str, str] = ABSENT


OF_FIT = {"free": bool, "intervals": dict[str, dict[str, Pair]]}
FittedConstant = Annotated[Table, Keys({**OF_CONSTANT, **OF_FIT}, regenerated=float, published=Measure)]
RINGS = Annotated[Table, Keys(dr=float, first=float, last=float, epsilon=float, count=Count, trim=str)]
PROTOCOL = Keys(
    {"rings": RINGS | None, "held": Texts, "indices": Numbers, "cosines": Numbers},
    albedos=Keys(low=float, high=float, count=Count, spacing=str),
    weighting=Keys(objective=str, energy_limit=float, source_limit=float, shares=float, last_share=float),
)
RESIDUALS = Keys(rms=Measure, largest=Measure, along_r=float, along_alpha=float, half_waves=float)
Posterior = Annotated[Table, Keys(result=str, steps=Count, walkers=Count, tau=Measure, acceptance=float)]
QUANTITY = Annotated[str, OneOf("radius", "reflectance")]
DISCREPANCY = dict.fromkeys(("amplitude", "amplitude_error", "length_r", "length_s", "rms"), Measure)
Checked = Annotated[Table, Keys(exact=Measure, photons=Measure, statistical_error=Measure, z=Measure)]
CROSSCHECK = Keys(chi2=Measure, chance=Measure, rank=Count, photons=Count, result=str, constants=dict[str, Checked])
Outcome = Annotated[Table, Keys(count=Count, cost_ratio=Measure, result=str, constants=Table)]
STARTS = Keys(count=Count, others=Count, share_best=float, result=str, rule=str, outcomes=list[Outcome])


def _require_length(table: Table, keys: Iterable[str], like: str, other: Sequence[Any], *place: str) -> None:
    """Refuse a list of a table, which stands at a place in the record, that is not as long as another one."""
    for key in keys:
        if key in table and len(table[key]) != len(other):
            raise Refused(f"as long as {like}, {len(other)}", len(table[key]), *place, key)


class FitRecord(WholeRecord):
    """Record of a recipe that fits a law or a map."""

    constants: dict[str, FittedConstant]
    protocol: Annotated[Table, PROTOCOL]
    fit: Annotated[Table, Keys(**SOLVED, steps=Count, residuals=RESIDUALS)]
    posterior: dict[str, Posterior]
    quality: Annotated[Table, Keys(QUALITY, regenerated=Keys(MEASURED))]
    covariance: Annotated[Table, Keys({"*": Matrix}, names=Texts)] = ABSENT
    left_out: Annotated[Table, Keys(rings=Count, albedos=Count)] = ABSENT
    derived: Annotated[Table, Keys(quantity=QUANTITY, alpha=Numbers, **dict.fromkeys(PARTS, Measures))] = ABSENT
    discrepancy: Annotated[Table, Keys(**DISCREPANCY, result=str)] = ABSENT
    crosscheck: Annotated[Table, CROSSCHECK] = ABSENT
    starts: Annotated[Table, STARTS] = ABSENT

    @model_validator(mode="after")
    def _matching(self) -> Self:
        """Refuse a list of the wrong length, a strange name, or a measure without its twin."""
        covariance, derived, quality = self.covariance or {}, self.derived or {}, self.quality
        names, by_index, alpha = covariance.get("names", ()), quality.get("by_index", {}), quality.get("alpha", ())
        if strange := [name for name in names if name not in self.constants]:
            raise Refused("of its constants", strange[0], "covariance", "names")
        for kind, rows in covariance.items():
            if kind != "names" and rows is not None and {len(rows), *map(len, rows)} != {len(names)}:
                raise Refused(f"a square matrix of {len(names)} rows, as many as names", rows, "covariance", kind)
        _require_length(derived, PARTS, "derived.alpha", derived.get("alpha", ()), "derived")
        _require_length(by_index, BY_INDEX, "quality.by_index.n", by_index.get("n", ()), "quality", "by_index")
        # What is measured of the regenerated law is measured of the printed ones beside it.
        kept = [key for key in ("rel", "ks", "inversion_error") if key in quality["regenerated"]]
        kept += OF_MAP if "delta_A" in quality["regenerated"] else ()
        for name in (name for name in SETS if name in quality):
            _require_length(quality[name], (*BY_ALBEDO, *HALVED), "quality.alpha", alpha, "quality", name)
            if missing := [key for key in kept if key not in quality[name]]:
                raise Refused("there, as others of its kind are", None, "quality", name, missing[0])
        return self


class AlbedoRecord(FitRecord):
    """Record of a map between alpha and A."""

    quality: Annotated[Table, Keys(QUALITY, regenerated=Keys(MEASURED, **OF_MAP))]


class InverseRecord(FitRecord):
    """Record of a sampler of radii."""

    quality: Annotated[Table, Keys(QUALITY, alpha=Numbers, regenerated=Keys(MEASURED, inversion_error=Numbers))]


class ProfileRecord(FitRecord):
    """Record of a law of the profile."""

    quality: Annotated[
        Table, Keys(QUALITY, alpha=Numbers, regenerated=Keys(MEASURED, rel=Numbers, ks=Numbers, l1=Numbers))
    ]


Stage = Annotated[Table, Keys({"standard_error": dict[str, Measure]}, **SOLVED, constants=dict[str, float])]
STAGES = {"per_albedo_failures": dict[str, Count], "length_exponents": dict[str, float]}


class StagedRecord(ProfileRecord):
    """Record of a law that is fitted in the stages of the paper."""

    stages: Annotated[Table, Keys(STAGES, coefficient_laws=dict[str, Stage])]


OF_READING = {
    **dict.fromkeys(("equation", "verdict", "choices"), str),
    **dict.fromkeys(("curve_distance", "constant_distance"), Measure),
    **dict.fromkeys(("constants", "published"), dict[str, float]),
}
Reading = Annotated[Table, Keys({"evidence": str, "result": str}, **OF_READING)]
OF_ROW = dict.fromkeys(("material", "model", "channel", "range_choice"), str)
Row = Annotated[Table, Keys({**OF_ROW, "range_mm": float, "mse_over_printed": Ratios})]
Half = Annotated[Table, Keys({"material": str, "model": str, "off": Measure})]


class EvidenceRecord(WholeRecord):
    """Record of comparisons with the paper."""

    protocol: Annotated[Table, PROTOCOL] = ABSENT
    readings: list[Reading]
    table1: list[Row]
    halves: list[Half] = ABSENT


# Each pipeline: the objectives that its recipes can make small, and what its records hold.
PIPELINES: dict[str, tuple[tuple[str, ...], type[NamedRecord]]] = {
    "albedo": (("albedo", "reflectance", "relative_reflectance"), AlbedoRecord),
    "profile": (("energy", "relative"), ProfileRecord),
    "as-published": (("radial",), StagedRecord),
    "inverse": (("radius", "relative_radius", "share"), InverseRecord),
    "evidence": ((), EvidenceRecord),
}


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


def read(path: Path, whole: bool = False) -> Table:
    """Read a record; RecordError says which file and what is wrong with it.

    Its law, pipeline, setting and constants must be there: that is what a law is made from. A `whole` record holds
    everything that `profilefit report` shows.
    """
    content = _parsed(path)
    require_sound(content, path, whole)
    return content


def read_of(path: Path, pipeline: str, kind: str, model: type[NamedRecord]) -> Table:
    """Read a record of one pipeline, `kind` in words, that holds what its model does; RecordError on any other."""
    content = _parsed(path)
    if content.get("pipeline") != pipeline:
        require_sound(content, path)
        raise RecordError(f"{path}: must be {kind}, got pipeline {content['pipeline']!r}")
    with damage(path):
        model.of(str(path), content)
    return content


def require_sound(content: Table, path: Path, whole: bool = False) -> None:
    """Raise RecordError where a record lacks what `read` promises, or holds what is of another type."""
    pipeline = content.get("pipeline")
    model: type[NamedRecord] = NamedRecord if pipeline == "evidence" else LawRecord
    with damage(path):
        if whole and isinstance(pipeline, str):
            require(pipeline in PIPELINES, "pipeline", f"one of {', '.join(PIPELINES)}", pipeline)
            model = PIPELINES[pipeline][1]
        model.of(str(path), content)


@contextmanager
def damage(path: Path) -> Iterator[None]:
    """Raise what is wrong inside a record as RecordError."""
    try:
        yield
    except RecordError:
        raise
    except (InputError, KeyError) as error:
        text = f"{error} is missing" if isinstance(error, KeyError) else str(error).removeprefix(f"{path}: ")
        raise RecordError(f"{path}: is damaged: {text}; regenerate it") from None


def _parsed(path: Path) -> Table:
    """Return what a file says, in the words of today; RecordError where it is no record, or not safe to be shown."""
    if not is_line(path.stem):  # it is shown, and stands in exported texts
        raise RecordError(f"{str(path)!r}: the name of a record must be {LINE}")
    if not path.exists():
        raise RecordError(f"{path}: there is no such record; `profilefit regenerate` makes them")
    try:
        content = parse_json(read_whole(path, MOST_JSON))
    except InputError as error:
        raise RecordError(f"{path}: cannot be read ({str(error).rpartition('got: ')[2]})") from None
    except ValueError as error:
        raise RecordError(f"{path}: is not a record: {error}") from None
    if not isinstance(content, dict) or content.get("format") not in (1, FORMAT):
        got = shown(content.get("format") if isinstance(content, dict) else type(content).__name__)
        raise RecordError(f"{path}: is not a record of format 1 or {FORMAT}, got {got}")
    content = _of_format_1(content) if content["format"] == 1 else content
    with damage(path):
        _require_safe(content)
    return content


def _require_safe(value: Any, place: str = "", depth: int = 0) -> None:
    """Refuse text that is no printable line, numbers beyond float64, and tables that nest too deep."""
    if isinstance(value, dict | list):
        require(depth < DEEPEST, place or "it", f"nested no deeper than {DEEPEST} tables and lists", value)
        for name, item in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(name, str):
                require(is_line(name), f"keys in {place or 'it'}", LINE, name)
            if type(item) is not float or not math.isfinite(item):  # most of a record: its place is never shown
                _require_safe(item, f"{place}.{name}".removeprefix("."), depth + 1)
    elif isinstance(value, str):
        require(is_line(value), place, LINE, value)
    elif value is not None and not isinstance(value, bool):
        require(is_number(value) and math.isfinite(value), place, "a number of float64", value)


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


def named(name: str, folder: Path, pipeline: str) -> Path | None:
    """Return the record of a name in a folder, or the one at a path (.json) if it is of this pipeline; else None."""
    if name.endswith(".json"):
        path = Path(name)
        return path if is_file(path) and read(path)["pipeline"] == pipeline else None
    return available(folder).get(name)


def _within(content: Mapping[str, Any], span: str, value: float) -> bool:
    low, high = content.get(span) or (0.0, 0.0)
    return bool(low < value <= high)


def record_setting(content: Mapping[str, Any]) -> Setting:
    """Return the setting that a record belongs to."""
    try:
        return Setting.of(content["setting"])
    except (KeyError, TypeError, InputError):
        raise RecordError(f"record {content.get('name')!r} is damaged: it has no valid setting") from None


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
    """Return `whole_file.plain` with the digits of a record; None for what is not finite."""
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
