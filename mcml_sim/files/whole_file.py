"""Files as a whole: read up to a bound, and whole or absent, whatever happens while they are written; JSON and TOML.

Everything that either package writes goes through here. What had the name before stays until the new file is whole:

link            is followed, and what it leads to is replaced; a dangling one gets its file
device, pipe    is written into; so is /dev/stdout, whatever that is; a pipe that nobody reads from is refused
folder, disk    is refused, and so is a socket
mode            stays that of the file before, and its owner as far as the system allows; of a new file the umask says
read-only file  is refused where the system would not let this user write into it (root it lets)
hard link       parts: this name gets the new file, the other names keep the old one

JSON and TOML that others wrote are refused in one line where no program should go on with them. The parsers of Python
take numbers beyond floating point for infinity, and recurse as deep as brackets nest; texts may hold halves of
characters that no file can be written with; a key that stands twice in JSON is taken once.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import re
import reprlib
import secrets
import shutil
import stat
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
MOST_JSON = 2**21  # bytes; the largest file that ships, where arithmetic fails, has two fifths of it
MOST_TOML = 2**18  # a thousand layers are a third of it
MOST_LEVELS = 32  # records nest seven deep
MOST_DIGITS = 300  # of a whole number, which floating point can hold
LONG_NUMBER = re.compile(r"""(?<![\w.'"])\d[\d_]{%d,}(?![\w.'"])""" % MOST_DIGITS)  # noqa: UP031
KEY = re.compile(r"""(?:"([^"\n]*)"|([\w.-]+))\s*[:=][^"'=:]*$""")  # at the end of a text, whose value is to follow
LONGEST_BEFORE = 1000  # characters between a key and its value
# The time of tomllib goes with the square of the names in a key: a.a.a.a = 1.
LONG_KEY = re.compile(
    r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}""" % MOST_LEVELS  # noqa: UP031
)
LONGEST_SHOWN = 40  # characters of a number or key in a message
TOO_DEEP = f"tables or lists nested more than {MOST_LEVELS} deep"
ALL_DIGITS = 17  # give every float64 back


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
    """Return the text of a file's bytes; InputError on more than `most`, and on a line that is not UTF-8."""
    if len(content) > most:
        raise InputError(f"{path}: expected {expected} of at most {most} bytes, got a longer file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1  # its object has no byte order mark
        got = f"the byte {error.object[error.start]:#04x}"
        raise InputError(f"{path}:{line}: expected text in UTF-8, got {got}") from None


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


def read_json(path: str | os.PathLike[str], most: int = MOST_JSON) -> Any:
    """Read a JSON file of at most so many bytes. InputError in one line, `FILE: is not JSON: ...`."""
    return _parsed(path, most, parse_json, "JSON")


def read_toml(path: str | os.PathLike[str], most: int = MOST_TOML) -> dict[str, Any]:
    """Read a TOML file of at most so many bytes. InputError in one line, `FILE: is not TOML: ...`."""
    return _parsed(path, most, parse_toml, "TOML")


def _parsed(path: str | os.PathLike[str], most: int, parse: Callable[[bytes, int], Any], kind: str) -> Any:
    content = read_whole(path, most)
    try:
        return parse(content, most)
    except ValueError as error:
        raise InputError(f"{path}: is not {kind}: {error}") from None


def parse_json(content: bytes, most: int = MOST_JSON, infinite: bool = False) -> Any:
    """Parse JSON text; ValueError in one line if it is none, or not to be trusted (see above).

    infinite  whether Infinity is a number, as Python writes it; NaN never is one
    """
    text = _text(content, most)

    def whole(literal: str) -> int:
        if len(literal) > MOST_DIGITS:
            raise _too_long(text, literal)
        return int(literal)

    def constant(name: str) -> float:
        if infinite and name == "Infinity":
            return math.inf
        raise ValueError(f"{name}, which is no number")

    try:
        value = json.loads(
            text,
            parse_float=lambda literal: _number(text, literal),
            parse_int=whole,
            parse_constant=constant,
            object_pairs_hook=_object,
        )
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    return _checked(value)


def parse_toml(content: bytes, most: int = MOST_TOML) -> dict[str, Any]:
    """Parse TOML text; ValueError in one line if it is none, or not to be trusted (see above)."""
    text = _text(content, most)
    if LONG_KEY.search(text):
        raise ValueError(TOO_DEEP)
    long = LONG_NUMBER.search(text)
    try:
        value = tomllib.loads(text, parse_float=lambda literal: _number(text, literal))
    except RecursionError:
        raise ValueError(TOO_DEEP) from None
    except ValueError as error:
        if long is None or not str(error).startswith("Exceeds the limit"):
            raise
        raise _too_long(text, long[0]) from None
    _checked(value)
    if long is not None and _has_long(value):
        raise _too_long(text, long[0])
    return value


def _text(content: bytes, most: int) -> str:
    if len(content) > most:
        raise ValueError(f"more than {most} bytes")
    return content.decode("utf-8-sig")


def _number(text: str, literal: str) -> float:
    number = float(literal)
    if math.isinf(number) and "inf" not in literal:  # TOML may say inf
        raise ValueError(f"the number {_short(literal)}, beyond floating point{_place(text, literal)}")
    return number


def _too_long(text: str, literal: str) -> ValueError:
    digits = len(literal.replace("_", "").lstrip("-"))
    return ValueError(f"a whole number of {digits} digits, of {MOST_DIGITS} at most{_place(text, literal)}")


def _place(text: str, literal: str) -> str:
    """Return the key of a number, where there is one, and the line where the number first stands in a text."""
    at = text.find(literal)
    key = KEY.search(text[max(at - LONGEST_BEFORE, 0) : at].rstrip("-+"))
    name = f", of {_short(repr(key[1] or key[2]))}" if key else ""
    return f"{name} (at line {text.count(chr(10), 0, at) + 1})"


def _has_long(value: Any) -> bool:
    """Return whether a whole number somewhere inside has more digits than floating point holds."""
    if isinstance(value, dict | list):
        return any(_has_long(inner) for inner in (value.values() if isinstance(value, dict) else value))
    return isinstance(value, int) and abs(value) >= 10**MOST_DIGITS


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        twice, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f"the key {_short(repr(twice))} twice in one object")
    return table


def _checked(value: Any) -> Any:
    """Return a parsed value; ValueError if it nests too deep, or has half a character."""
    level = [value]
    for _ in range(MOST_LEVELS + 1):
        inside: list[Any] = []
        for outer in level:
            if isinstance(outer, dict | list):
                inside += [*outer, *outer.values()] if isinstance(outer, dict) else outer
            elif isinstance(outer, str):
                outer.encode()  # UnicodeEncodeError is a ValueError, in one line
        if not inside:
            return value
        level = inside
    raise ValueError(TOO_DEEP)


def _short(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def plain(value: Any, digits: int = ALL_DIGITS) -> Any:
    """Return numbers, text, lists and dicts only; floats to so many digits; None for what is not finite."""
    if is_dataclass(value) and not isinstance(value, type):
        own = getattr(value, "as_table", None)  # of one that says itself what files have of it
        return plain(own() if callable(own) else asdict(value), digits)
    if isinstance(value, Mapping):
        return {str(key): plain(item, digits) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(item, digits) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{digits}g}") if np.isfinite(value) else None
    if value is None or isinstance(value, str):
        return value
    return str(value)


def as_json(value: Any, ascii_only: bool = False) -> str:
    """Return JSON text as --json prints it and .json files hold it: `plain`, in the order given, and a line break."""
    return json.dumps(plain(value), indent=1, ensure_ascii=ascii_only, allow_nan=False) + "\n"
