"""Folder of finished photon batches, from which an interrupted or enlarged run goes on.

run.json says what made the batches; batch-00000000.npz, ... hold one each: the arrays of its result and the digest of
run.json's contents, sealed with a digest of the whole file. A file is written under another name and renamed, so it is
whole or absent; should the disk damage it later, the seal shows it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import json
import os
import platform
import re
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Generic, Protocol, Self, TypeVar

import jax
import jaxlib.version
import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import ELSEWHERE, RESUMES, Notice, OutputError, StoreError
from mcml_sim.files.npz import read_npz
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import UNFINISHED, parse_json, reason_of, write_whole

MANIFEST = "run.json"
# What a killed run leaves half-written; writing a batch takes far less than this, so nobody is at work on it [s].
STALE_AFTER = 600.0
# A seal is no secret, so batches are held against bounds as any file is [bytes, packed or not].
MAX_BATCH = 2**28  # the finest grid's are half of it
MAX_MANIFEST = 2**23  # 65537 edges an axis are 3 MB
# What a store's files are called, and what is left of them when a run is killed while it writes one.
KEPT = re.compile(r"run\.json|batch-[0-9]{8,}\.npz")
HALF_WRITTEN = re.compile(rf"\.?({KEPT.pattern})\..*{re.escape(UNFINISHED)}")
SEAL_BYTES = 64  # SHA-256 in hexadecimal
LONGEST_SHOWN = 60  # characters of a value in a message
SHARED_SHOWN = 12  # of them, those before the first that differs


class DamagedBatch(Notice):
    """Notice that a batch in a store is not what was written there; it is traced again."""


class Result(Protocol):
    """Result of a batch: sums over photons, which add."""

    @property
    def started(self) -> int:
        """Number of photons."""

    def __add__(self, other: Self, /) -> Self: ...

    def arrays(self) -> dict[str, NDArray]:
        """Return all of the result, by name; `made_by` is no name."""


R = TypeVar("R", bound=Result)


class Store(Generic[R]):
    """Batches in one folder, made by one kind of run.

    made_by  what the run is, JSON values; version, jaxlib, device and kind of CPU are added, since they decide bits
    read     makes a result of what its `arrays` gave; ValueError if they are not one

    A folder without batches belongs to nobody, whatever run began there. StoreError names the file or folder, what is
    wrong, and what to do.
    """

    def __init__(self, folder: Path, made_by: dict[str, object], read: Callable[[Mapping[str, NDArray]], R]) -> None:
        self.folder = folder
        self._made_by = {**made_by, **maker()}
        self._digest = hashlib.sha256(json.dumps(self._made_by, sort_keys=True).encode()).hexdigest()
        self._read = read
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._sweep()
        except OSError as error:
            raise StoreError(f"cannot use {self.folder} as a store: {reason_of(error)}") from error
        require_ours(self.folder, self._made_by)
        path, contents = self.folder / MANIFEST, json.dumps(self._made_by, indent=1).encode()
        with contextlib.suppress(OSError, ValueError):  # else it is written anew
            if _read(path, MAX_MANIFEST) == contents:
                return
        self._write(path, contents)

    def load(self, batch: int) -> R | None:
        """Return the batch as far as it was traced, or None; also with a DamagedBatch warning if it cannot be read."""
        path = self._path(batch)
        try:
            data = _read(path, MAX_BATCH)
            if data[-SEAL_BYTES:] != hashlib.sha256(data[:-SEAL_BYTES]).hexdigest().encode():
                raise ValueError("its bytes are not those that were written")
            fields = read_npz(data, MAX_BATCH, text=["made_by"])
            if str(fields.pop("made_by", "")) != self._digest:
                raise StoreError(
                    f"{path} was made by another run; if that is still at work, {ELSEWHERE}; "
                    "if not, delete that file to redo just that batch"
                )
            return self._read(fields)
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            text = f"{path} is damaged ({reason_of(error)}); just that batch is traced again"
            warnings.warn(text, DamagedBatch, stacklevel=2)
            return None

    def save(self, batch: int, result: R) -> None:
        """Keep a batch, whole or not at all; the last bytes, a zip file's comment, are the digest of all the others."""
        file = io.BytesIO()
        np.savez_compressed(file, allow_pickle=False, made_by=np.array(self._digest), **result.arrays())
        body = file.getvalue()[:-2] + SEAL_BYTES.to_bytes(2, "little")  # a zip file ends in the length of its comment
        self._write(self._path(batch), body + hashlib.sha256(body).hexdigest().encode())

    def _path(self, batch: int) -> Path:
        # 1e13 photons in batches of 2^17 are 8 digits of batches: names sort as their numbers do.
        return self.folder / f"batch-{batch:08d}.npz"

    def _sweep(self) -> None:
        for name in filter(HALF_WRITTEN.fullmatch, os.listdir(self.folder)):
            with contextlib.suppress(FileNotFoundError):  # another run swept it first
                if time.time() - (leftover := self.folder / name).stat().st_mtime > STALE_AFTER:
                    leftover.unlink()

    def _write(self, path: Path, data: bytes) -> None:
        try:
            write_whole(path, data)
        except OutputError as error:
            raise StoreError(f"{error}; what the store holds is whole, {RESUMES}") from error


def require_ours(folder: Path, made_by: dict[str, object]) -> None:
    """Raise StoreError if that is no folder, or holds batches of a run other than `made_by`; nothing is written."""
    here = {**made_by, **maker()}
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"cannot use {folder} as a store: it is there already, and no folder")
    if not batches(folder):  # it is of a run that ended before its first
        return
    there = manifest(folder)
    if there is None:
        return
    # The kind of run is compared first, since it explains other differences.
    for name in sorted(here.keys() | there.keys(), key=lambda name: (name != "kind", name)):
        if there.get(name) != here.get(name):
            theirs, ours = _apart(there.get(name), here.get(name))
            raise StoreError(
                f"{folder} was made by another run: {name} is {theirs} there, {ours} here; "
                f"{ELSEWHERE}, or delete it if that run is over"
            )


def batches(folder: Path) -> list[int]:
    """Return the numbers of the batches in a folder, of whatever run."""
    numbers = (path.stem.removeprefix("batch-") for path in folder.glob("batch-*.npz"))
    return sorted(int(number) for number in numbers if number.isdecimal())


def strange(folder: Path) -> list[str]:
    """Return the names in a folder that no store has put there; none if there is no folder."""
    if not folder.is_dir():
        return []
    ours = [name for name in os.listdir(folder) if KEPT.fullmatch(name) or HALF_WRITTEN.fullmatch(name)]
    if not batches(folder) and "mcml_sim" not in (manifest(folder) or {"mcml_sim": None}):
        ours.remove(MANIFEST)
    return sorted(set(os.listdir(folder)) - set(ours))


def discard(folder: Path) -> None:
    """Remove what a store keeps, and its folder if nothing else is in it."""
    with contextlib.suppress(OSError):  # left behind, it is in nobody's way but another run's, which says so
        for name in os.listdir(folder):
            if KEPT.fullmatch(name) or HALF_WRITTEN.fullmatch(name):
                (folder / name).unlink(missing_ok=True)
        folder.rmdir()


def _read(path: Path, most: int) -> bytes:
    """Return the bytes of a file; ValueError if they are more than so many."""
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise ValueError(f"more than {most} bytes")
    return content


def manifest(folder: Path) -> dict[str, object] | None:
    """Return the manifest of a folder of batches, None if there is none; StoreError if that is damaged."""
    path = folder / MANIFEST
    try:
        content = parse_json(_read(path, MAX_MANIFEST), MAX_MANIFEST, infinite=True)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        reason = reason_of(error)
    else:
        if isinstance(content, dict):
            return content
        reason = "not an object"
    raise StoreError(f"{path} is damaged ({reason}); delete it, the batches beside it stay valid")


def maker() -> dict[str, object]:
    """Return what decides the bits of a batch besides the run itself: equal makers give equal bits."""
    return {
        "mcml_sim": __version__,
        "jaxlib": jaxlib.version.__version__,
        "device": jax.devices()[0].device_kind,
        "cpu": cpu_class(),
    }


@functools.cache
def cpu_class() -> str:
    """Return machine and instruction sets that change how floats round: equal classes give equal bits."""
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    except OSError:  # not Linux
        return f"{platform.machine()} {platform.processor()}"
    return " ".join([platform.machine(), *(flag for flag in ("fma", "avx2", "avx512f") if flag in flags)])


def _apart(theirs: object, ours: object) -> tuple[str, str]:
    """Return two values, long ones from shortly before where they differ."""
    there, here = json.dumps(theirs), json.dumps(ours)
    if max(len(there), len(here)) <= LONGEST_SHOWN:
        return there, here
    differ = (at for at, (a, b) in enumerate(zip(there, here, strict=False)) if a != b)
    start = max(next(differ, 0) - SHARED_SHOWN, 0)
    end = start + LONGEST_SHOWN
    before = "..." if start else ""
    theirs, ours = (before + text[start:end] + ("..." if end < len(text) else "") for text in (there, here))
    return theirs, ours
