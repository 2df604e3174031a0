"""Provenance of a measurement: the command that repeats it, when, where, and from which records.

Records say nothing of dates or machines, so that the same run writes the same bytes. What is measured on a machine (a
shader's errors, times, where arithmetic fails) depends on it, and on the records whose constants it took.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import require_folder
from profilefit.errors import InputError
from profilefit.recipes import record
from profilefit.recipes.folder import LOCAL


def measurement_origin(command: str, folder: Path) -> dict[str, Any]:
    """Describe a measurement made just now, by `command`, with the constants of the records in `folder`.

    command, version [of profilefit], date [UTC, ISO 8601], machine {processor, cores}, and sha256 [of the records]
    """
    return {
        "command": command,
        "version": __version__,
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": {"processor": processor(), "cores": os.cpu_count() or 1},
        "sha256": digest(folder),
    }


def stale(origin: Mapping[str, Any], folder: Path) -> bool:
    """Return whether `made` was measured of other records than those in `folder`, or by another version."""
    return (origin.get("version"), origin.get("sha256")) != (__version__, digest(folder))


def digest(folder: Path) -> str:
    """Return the SHA-256 over the records of a folder: their names, lengths and bytes, in order."""
    sha = hashlib.sha256()
    for name, path in record.available(folder).items():
        content = path.read_bytes()
        sha.update(f"{name}\0{len(content)}\0".encode())
        sha.update(content)
    return sha.hexdigest()


def require_apart(out: Path, records: Path, *files: str) -> None:
    """Raise InputError where a measurement's .json in `out` would pass for a record; OutputError where none can be."""
    taken = {records.resolve(), LOCAL.resolve()}
    if out.resolve() in taken:
        raise InputError(f"out must be another folder than that of the records, got {out}")
    require_folder(out, *files)


def processor() -> str:
    """Return the processor's name, as the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        return platform.processor() or platform.machine()
    named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()
