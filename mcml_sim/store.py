"""A folder of finished photon batches, from which an interrupted or enlarged run goes on.

run.json says what made the batches; batch-000000.npz, ... hold one each: only the counts that are not 0, and the
digest of run.json's contents. A file is written under another name and renamed, so it is whole or absent.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO

import jax
import jaxlib.version
import numpy as np

from mcml_sim.errors import StoreError
from mcml_sim.tally import Counts
from mcml_sim.version import __version__

MANIFEST = "run.json"
# What a killed run leaves half-written; writing a batch takes far less than this, so nobody is at work on it [s].
STALE_AFTER = 600.0
# What numpy and zip raise at a file that is not what was written.
DAMAGED = (OSError, ValueError, TypeError, LookupError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


class Store:
    """The batches in one folder, made by one kind of run.

    made_by  what the run is, JSON values; version, jaxlib, device and kind of CPU are added, since they decide bits
    shape    shape of the counts (rows, bins)

    StoreError names the file or folder, what is wrong, and what to do.
    """

    def __init__(self, folder: Path, made_by: dict[str, object], shape: tuple[int, int]) -> None:
        self.folder = folder
        self._made_by = {**made_by, **_maker()}
        self._digest = _digest(self._made_by)
        self._shape = shape
        self._open()

    def load(self, batch: int) -> Counts | None:
        """The batch as far as it was traced, or None."""
        path = self._path(batch)
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as fields:
                return self._counts(path, dict(fields))
        except FileNotFoundError:
            return None
        except DAMAGED as error:
            raise StoreError(f"{path} is damaged ({_reason(error)}); delete it to redo just that batch") from None

    def save(self, batch: int, counts: Counts) -> None:
        """Keep a batch, whole or not at all."""
        (cells,) = np.nonzero(counts.exits.ravel())
        exits = counts.exits.ravel()[cells]
        rest = np.array([counts.rouletted, counts.cut, counts.started], np.int64)
        self._write(
            self._path(batch),
            lambda file: np.savez_compressed(file, made_by=np.array(self._digest), cells=cells, exits=exits, rest=rest),
        )

    def _path(self, batch: int) -> Path:
        return self.folder / f"batch-{batch:06d}.npz"

    def _open(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._sweep()
        except OSError as error:
            raise StoreError(f"cannot use {self.folder} as a store: {_reason(error)}") from error
        path = self.folder / MANIFEST
        found = _read_manifest(path)
        if found is None:
            text = json.dumps(self._made_by, indent=1).encode()
            self._write(path, lambda file: file.write(text))
            return
        for name in sorted(self._made_by.keys() | found.keys()):
            if found.get(name) != self._made_by.get(name):
                raise StoreError(
                    f"{self.folder} was made by another run: {name} is {_short(found.get(name))} there, "
                    f"{_short(self._made_by.get(name))} here; use another folder"
                )

    def _sweep(self) -> None:
        for leftover in self.folder.glob("*.part"):
            with contextlib.suppress(FileNotFoundError):  # another run swept it first
                if time.time() - leftover.stat().st_mtime > STALE_AFTER:
                    leftover.unlink()

    def _counts(self, path: Path, fields: dict[str, np.ndarray]) -> Counts:
        if str(fields["made_by"]) != self._digest:
            raise StoreError(f"{path} was made by another run; delete it to redo just that batch")
        exits = np.zeros(self._shape, np.int64)
        exits.ravel()[fields["cells"]] = fields["exits"]
        rouletted, cut, started = map(int, fields["rest"])
        counts = Counts(exits, rouletted, cut, started)
        if not counts.is_closed:
            raise ValueError("its photons do not add up")
        return counts

    def _write(self, path: Path, write: Callable[[IO[bytes]], object]) -> None:
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            with part.open("wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, path)
        except OSError as error:
            raise StoreError(f"cannot write to store {self.folder}: {_reason(error)}") from error
        finally:
            _remove(part)


def _read_manifest(path: Path) -> dict[str, object] | None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise StoreError(f"{path} is damaged ({_reason(error)}); delete it, the batches beside it stay valid") from None
    if not isinstance(found, dict):
        raise StoreError(f"{path} is damaged (not an object); delete it, the batches beside it stay valid")
    return found


def _remove(part: Path) -> None:
    with contextlib.suppress(OSError):  # the folder is gone or closed to us: the error on its way up says so
        part.unlink()


def _maker() -> dict[str, object]:
    return {
        "mcml_sim": __version__,
        "jaxlib": jaxlib.version.__version__,
        "device": jax.default_backend(),
        "cpu": cpu_class(),
    }


def cpu_class() -> str:
    """Machine and the instruction sets that change how floats round: equal classes give equal bits."""
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    except OSError:  # not Linux
        return f"{platform.machine()} {platform.processor()}"
    return " ".join([platform.machine(), *(flag for flag in ("fma", "avx2", "avx512f") if flag in flags)])


def _digest(made_by: dict[str, object]) -> str:
    return hashlib.sha256(json.dumps(made_by, sort_keys=True).encode()).hexdigest()


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0]


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
