"""A folder of records, and where records lie: where one works, if there are any, else in what came with profilefit."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, OtherRecords, RecordError, SettingError
from profilefit.recipes import record
from profilefit.recipes.record import record_name, record_setting

SEARCHLIGHT = Setting()
LOCAL = Path("fits")
EVIDENCE = Path("evidence")  # what was measured with records: shader check, failures, times


def fits_folder() -> Path:
    """The recipes and records that came with this installation."""
    return shipped("fits")


def shipped(name: str) -> Path:
    """A folder that came with this installation: in the wheel, or beside the package in a checkout."""
    package = Path(str(resources.files("profilefit"))).resolve()
    inside = package / name
    return inside if inside.is_dir() else package.parent / name


def records_folder(asked: Path | None = None, quiet: bool = False) -> Path:
    """The folder that was asked for, or ./fits if it has records, or the one shipped.

    One that is not the shipped one is told of by an OtherRecords warning, since constants of a strange folder look like
    ours; of one that was asked for, not if `quiet`. InputError if it is no folder.
    """
    if asked is not None and not asked.is_dir():
        raise InputError(f"--fits must be a folder of records, got {str(asked)!r}, which is none")
    folder = known_folder(asked)
    if folder.resolve() != fits_folder().resolve() and not (quiet and asked):
        where = "" if asked else " in the folder that you are in; --fits chooses others"
        warnings.warn(f"records of {str(folder)!r}{where}", OtherRecords, stacklevel=2)
    return folder


def known_folder(asked: Path | None = None) -> Path:
    """The same without a word, there or not."""
    return asked or (LOCAL if record.available(LOCAL) else fits_folder())


def evidence_folder(records: Path, asked: Path | None = None) -> Path:
    """The folder that was asked for, or ./evidence if it is there, or the one beside the records.

    One that nobody named is told of by an OtherRecords warning. InputError if it was asked for and is no folder.
    """
    if asked is not None and not asked.is_dir():
        raise InputError(f"--evidence must be a folder, got {str(asked)!r}, which is none")
    if asked is None and EVIDENCE.is_dir():
        where = f"measurements of {str(EVIDENCE)!r} in the folder that you are in; --evidence chooses others"
        warnings.warn(where, OtherRecords, stacklevel=2)
    return asked or (EVIDENCE if EVIDENCE.is_dir() else records / EVIDENCE)


@dataclass(frozen=True)
class Records:
    """The records in a folder, or those of them that are named: each is read once, for as long as this lives.

    What is read belongs to all who ask: nobody changes it.
    """

    folder: Path
    names: tuple[str, ...] | None = None
    _contents: dict[Path, dict[str, Any]] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def of(cls, folder: Folder) -> Records:
        """The records of a folder; those that are open already stay so."""
        return folder if isinstance(folder, Records) else Records(folder)

    def named(self, names: Sequence[str] | None) -> Records:
        """Only those of these names; all that there are, if None."""
        return Records(self.folder, None if names is None else tuple(names), self._contents)

    @cached_property
    def paths(self) -> dict[str, Path]:
        """Record name -> file, in order."""
        found = record.available(self.folder)
        return found if self.names is None else {name: path for name, path in found.items() if name in self.names}

    def read(self, path: Path, whole: bool = False) -> dict[str, Any]:
        """As `record.read`, of any record."""
        if path not in self._contents:
            self._contents[path] = record.read(path, whole)
        elif whole:
            record.require_sound(self._contents[path], path, whole)
        return self._contents[path]

    def content(self, name: str, whole: bool = False) -> dict[str, Any]:
        """What the record of this name says; RecordError as of `record.read`."""
        return self.read(self.folder / f"{name}.json", whole)

    def contents(self, whole: bool = False) -> dict[str, dict[str, Any]]:
        """Record name -> what it says, of all."""
        return {name: self.read(path, whole) for name, path in self.paths.items()}

    def settings(self, base: str) -> tuple[Setting, ...]:
        """The settings that a record is there for, by its name for Setting()."""
        near = {name: self.read(path) for name, path in self.paths.items() if name.startswith(base)}
        found = {name: record_setting(content) for name, content in near.items()}
        return tuple(setting for name, setting in found.items() if record_name(base, setting) == name)

    def path(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """The record of a setting, by its name for Setting().

        SettingError that lists the settings there are; RecordError where there is none at all.
        """
        if (path := self.folder / f"{record_name(base, setting)}.json").exists():
            return path
        if known := self.settings(base):
            there = "; ".join(str(one) for one in known)
            raise SettingError(f"record {base} belongs to {there}, got a request for {setting}")
        raise RecordError(
            f"{path}: there is no such record; `profilefit regenerate {base} --out {self.folder}` makes it"
        )

    def path_or_shipped(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """The same, or the record that is shipped, where this folder has none of that setting."""
        path = self.folder / f"{record_name(base, setting)}.json"
        return path if path.exists() else Records(fits_folder()).path(base, setting)


Folder = Path | Records
"""A folder of records, by its path or open."""
