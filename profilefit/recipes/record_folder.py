"""A folder of records, open: each is read once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mcml_sim.media.setting import Setting
from profilefit.errors import RecordError, SettingError
from profilefit.recipes import record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import SPANS, covers, record_name, record_setting, spanning_name

SEARCHLIGHT = Setting()


@dataclass(frozen=True)
class Records:
    """The records in a folder, or those of them that are named: each is read once, for as long as this lives.

    What is read is shared by all callers: nobody changes it.
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
        return tuple(
            setting
            for name, setting in found.items()
            if name in (record_name(base, setting), spanning_name(base, setting))
        )

    def name(self, base: str, setting: Setting) -> str:
        """The name of the record of a setting: its own, that of a range of indices and g where there is such and none
        of its own, and its own where there is neither."""
        own, spanning = record_name(base, setting), self.folder / f"{spanning_name(base, setting)}.json"
        if (self.folder / f"{own}.json").exists() or not spanning.exists():
            return own
        return spanning.stem if covers(self.read(spanning), setting) else own

    def path(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """The record of a setting, by its name for Setting().

        SettingError that lists the settings there are; RecordError where there is none at all.
        """
        if (path := self.folder / f"{self.name(base, setting)}.json").exists():
            return path
        if known := self.settings(base):
            there = "; ".join(self._described(base, one) for one in known)
            raise SettingError(f"record {base} belongs to {there}, got a request for {setting}")
        raise RecordError(
            f"{path}: there is no such record; `profilefit regenerate {base} --out {self.folder}` makes it"
        )

    def path_or_shipped(self, base: str, setting: Setting = SEARCHLIGHT) -> Path:
        """The same, or the record that is shipped, where this folder has none of that setting."""
        path = self.folder / f"{self.name(base, setting)}.json"
        return path if path.exists() else Records(fits_folder()).path(base, setting)

    def _described(self, base: str, setting: Setting) -> str:
        """A setting that there is a record for, in words."""
        content, words = self.content(self.name(base, setting)), str(setting)
        for name, span in SPANS.items():
            if span in content:
                low, high = content[span]
                words = words.replace(f"{name} = {getattr(setting, name):g}", f"{name} in ({low:g}, {high:g}]")
        return words


Folder = Path | Records
"""A folder of records, by its path or open."""
