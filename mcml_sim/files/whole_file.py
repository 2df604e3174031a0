"""Files as a whole: read up to a bound, and whole or absent, whatever happens while they are written.

Everything that either package writes goes through here. What had the name before stays until the new file is whole:

link            is followed, and what it leads to is replaced; a dangling one gets its file
device, pipe    is written into; so is /dev/stdout, whatever that is; a pipe that nobody reads from is refused
folder, disk    is refused, and so is a socket
mode            stays that of the file before, and its owner as far as the system allows; of a new file the umask says
read-only file  is refused where the system would not let this user write into it (root it lets)
hard link       parts: this name gets the new file, the other names keep the old one
"""

from __future__ import annotations

import contextlib
import errno
import os
import reprlib
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from mcml_sim.errors import InputError, OutputError

UNFINISHED = ".part"  # ends the name of a file that is not whole yet, or about to be replaced
NAME_KEPT = 30  # characters of its name in that name: file systems hold 255 bytes, some of them 143
LONGEST_CHAIN = 40  # links, as in Linux
ROOM = 2**22  # bytes that a disk must have free before work begins: a command's numbers and figures are smaller
MEGABYTE = 1e6
REFUSED = {
    stat.S_ISDIR: "it is a folder",
    stat.S_ISBLK: "it is a disk, not a file",
    stat.S_ISSOCK: "it is a socket, not a file",
}


def checked_path(path: object) -> Path:
    """Return the path of that name; InputError on what is none."""
    if isinstance(path, (str, os.PathLike)):
        return Path(path)
    raise InputError(f"path must be the name of a file, got {reprlib.repr(path)}")


def read_whole(path: str | os.PathLike[str], most: int, expected: str = "a file that can be read") -> bytes:
    """Return the bytes of a file, at most `most` + 1 of them: a longer file is not read to its end.

    InputError names the file, what was `expected`, and why it cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return file.read(most + 1)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: expected {expected}, got: {reason_of(error)}") from None


def text_of(path: str | os.PathLike[str], content: bytes, most: int, expected: str) -> str:
    """Return the text of a file's bytes; InputError of more than `most`, and of the line that is not in UTF-8."""
    if len(content) > most:
        raise InputError(f"{path}: expected {expected} of at most {most} bytes, got a longer file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: expected text in UTF-8, got the byte {content[error.start]:#04x}") from None


def require_folder(folder: Path, *files: str, room: float = ROOM, make: bool = True) -> None:
    """Raise OutputError unless files can be made in a folder: better now than after an hour of photons.

    Args:
        folder: where they would be made.
        files: names in the folder that must be free, or of what can be replaced.
        room: bytes that its disk must have free.
        make: whether to make the folder; else the nearest folder above that exists is looked at.
    """
    try:
        if make:
            folder.mkdir(parents=True, exist_ok=True)
        place = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
        with tempfile.TemporaryFile(dir=place):
            pass
        disk = shutil.disk_usage(place)
        if disk.total and disk.free < room:  # some network disks say 0 of both
            got = f"{disk.free / MEGABYTE:.1f} MB are free, {room / MEGABYTE:.0f} MB may be needed"
            raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)}: {got}")
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write into {folder}: {reason_of(error)}") from None
    for name in files:
        require_target(folder / name)


def require_target(path: Path) -> None:
    """Raise OutputError if what has that name already cannot be replaced or written into; make nothing."""
    with _named(path):
        _target(path)


def require_writable(path: Path, room: float = ROOM) -> None:
    """Make the folder of a file; OutputError unless `write_whole(path)` can work, as far as can be known before."""
    with _named(path):
        target = _target(path)
    if target is not None:
        require_folder(target.parent if path.is_symlink() else path.parent, room=room)


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file, whole or not at all; text in UTF-8, with half characters of file names as their escapes.

    OutputError names file and reason.
    """
    write_together({path: content})


def write_together(contents: Mapping[Path, bytes | str]) -> None:
    """Write files that belong together: all of them, or none. OutputError names the file and the reason.

    All are on the disk under other names before the first gets its own. The last one is what others are read for: if
    the machine stops while they are renamed, it is missing and never beside files that it does not belong to.
    """
    files: dict[Path, tuple[Path, Path]] = {}  # target -> the path as given, and the file that is to replace it
    streams: dict[Path, bytes] = {}
    leftovers: list[Path] = []
    try:
        for path, content in contents.items():
            with _named(path):
                data = content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content
                target = _target(path)
                if target is None:
                    streams[path] = data
                elif target in files:
                    raise OSError(errno.EEXIST, f"it is the same file as {files[target][0]}")
                else:
                    files[target] = path, _beside(target)
                    leftovers.append(files[target][1])
                    _fill(files[target][1], data, target)
        for path, data in streams.items():
            with _named(path):
                _pour(path, data)
        _exchange(files, leftovers)
    finally:
        try:
            _remove(leftovers)
        finally:  # once more, where Ctrl-C fell into it
            _remove(leftovers)


def _target(path: Path) -> Path | None:
    """Return the file to be replaced, where links lead; None for what is written into. OSError if it can be neither."""
    if _stream(path) is not None:
        return None
    target = Path(os.path.realpath(path))
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return target
    for is_kind, refused in REFUSED.items():
        if is_kind(mode):
            raise OSError(errno.EEXIST, refused)
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return target if stat.S_ISREG(mode) else None


def _stream(path: Path) -> int | None:
    """Return the open file descriptor that a path such as /dev/stdout or /dev/fd/3 stands for.

    What it is open on may be a file. To replace that would part it from whoever writes to the same stream.
    """
    own = os.path.realpath("/proc/self/fd")
    for _ in range(LONGEST_CHAIN):
        if path.name.isdecimal() and os.path.realpath(path.parent) == own:
            return int(path.name)
        if not path.is_symlink():
            break
        path = path.parent / os.readlink(path)
    return None


def _pour(path: Path, data: bytes) -> None:
    """Write into an open stream, a device, or a pipe that somebody reads from; no reader is waited for."""
    if (stream := _stream(path)) is not None:
        if sys.stdout:
            sys.stdout.flush()  # what was printed before stands before
        handle = os.dup(stream)
    else:
        try:
            handle = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
        except OSError as error:
            if error.errno == errno.ENXIO:
                raise OSError(errno.ENXIO, "it is a pipe that nobody reads from") from None
            raise
        if sys.platform != "win32":
            os.set_blocking(handle, True)
    with open(handle, "wb") as file:
        file.write(data)


def _beside(target: Path) -> Path:
    """Return a name that no file has, in the same folder."""
    return target.with_name(f".{target.name[:NAME_KEPT]}.{secrets.token_hex(4)}{UNFINISHED}")


def _fill(part: Path, data: bytes, target: Path) -> None:
    """Make the file that is to replace `target`, with its mode and its owner, and see it on the disk."""
    with part.open("xb") as file:  # x: never through a link that somebody put there
        with contextlib.suppress(FileNotFoundError):
            before = target.stat()
            for owner in (before.st_uid, -1) if sys.platform != "win32" else ():
                with contextlib.suppress(OSError):  # the group at least, where the system allows it
                    os.chown(part, owner, before.st_gid)
                    break
            part.chmod(stat.S_IMODE(before.st_mode) & 0o777)
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _exchange(files: dict[Path, tuple[Path, Path]], leftovers: list[Path]) -> None:
    """Give files the names of their targets: all or none. What had these names before is added to `leftovers`.

    One file is replaced at once. Of several the old ones are first moved aside, the last one before all others.
    """
    aside: dict[Path, Path] = {}
    placed: list[Path] = []
    try:
        for target, (path, _) in reversed(files.items()) if len(files) > 1 else ():
            if target.exists():
                aside[target] = _beside(target)
                with _named(path):
                    target.rename(aside[target])
        for target, (path, part) in files.items():
            placed.append(target)
            with _named(path):
                os.replace(part, target)
        leftovers.extend(aside.values())
    except BaseException:
        _remove(placed[::-1] if len(files) > 1 else [])
        for target, before in reversed(aside.items()):
            with contextlib.suppress(OSError):
                before.replace(target)
        raise


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with contextlib.suppress(OSError):  # renamed, or the folder is gone: then the error on its way up says so
            path.unlink()


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Turn what the system reports of a file into an OutputError in one line."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise OutputError(f"cannot write {path}: {reason_of(error)}") from None


def reason_of(error: Exception) -> str:
    """Return what went wrong with a file, in one line."""
    return (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0]
