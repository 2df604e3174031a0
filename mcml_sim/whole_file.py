"""Files as a whole: read up to a bound, and whole or absent, whatever happens while they are written."""

from __future__ import annotations

import contextlib
import os
import reprlib
import tempfile
from pathlib import Path

from mcml_sim.errors import InputError, OutputError


def checked_path(path: object) -> Path:
    """The path of that name; InputError on what is none."""
    if isinstance(path, (str, os.PathLike)):
        return Path(path)
    raise InputError(f"path must be the name of a file, got {reprlib.repr(path)}")


def read_whole(path: str | os.PathLike[str], most: int) -> bytes:
    """A file's bytes, and no more than `most` + 1 of them: one that is longer is not read to its end.

    InputError names the file and why it cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(most + 1)
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: expected a file that can be read, got: {reason}") from None


def require_writable(path: Path) -> None:
    """OutputError unless `write_whole(path)` can work: better now than after an hour of photons. Makes its folder."""
    _target(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise OutputError(f"cannot write into {path.parent}: {error.strerror or error}") from None


def write_whole(path: Path, data: bytes) -> None:
    """Write a file under another name, then rename it: what had the name before stays until the new file is whole.

    OutputError names file and reason.
    """
    target = _target(path)
    try:
        replace_whole(target, data)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None


def replace_whole(target: Path, data: bytes) -> None:
    """The same for a file that is known to be one; OSError if it cannot be written."""
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, target)
    finally:
        with contextlib.suppress(OSError):  # renamed, or the folder is gone: then the error on its way up says so
            part.unlink()


def _target(path: Path) -> Path:
    """The file that a link leads to; never a folder or a device, which a renamed file would replace."""
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            raise OutputError(f"cannot write {path}: it is there already, and no file")
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write {path}: {getattr(error, 'strerror', None) or error}") from None
    return target
