"""Arrays in .npz files: of others, and those that take seconds to make and are kept in the user's cache folder.

An .npz file is a zip file of .npy files, which pack well: 13 MB can hold 3 GB of zeros. So what a file claims, in the
zip file's directory and the header of each array, is held against bounds before any of it is unpacked; only arrays that
are wanted are unpacked, no further than they said. Nothing is unpickled.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import math
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Collection, Mapping

import numpy as np
import platformdirs
from numpy.typing import NDArray

from mcml_sim.errors import Notice, OutputError
from mcml_sim.files.whole_file import read_whole, write_whole

Shapes = Mapping[str, tuple[int, ...] | None]
Arrays = dict[str, NDArray[np.float64]]
MOST_MEMBERS = 1000  # of a zip file; a run's results have some fifty
MOST_AXES = 8
ENTRY = b"PK\x01\x02"  # begins each line of a zip file's directory
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # numpy's; others unpack without a bound
ENCRYPTED = 1  # a zip file's flag
SUFFIX = ".npy"
# What numpy.lib.format writes before the numbers: numpy's own parser would evaluate any other text.
HEADER = re.compile(
    rb"\x93NUMPY\x01\x00(?P<length>..)(?P<text>\{'descr': '(?P<dtype>[<>|][fiuU]\d{1,9})', "
    rb"'fortran_order': (?:True|False), 'shape': \((?P<shape>[\d, ]*)\), \} *\n)",
    re.DOTALL,
)
LONGEST_HEADER = 512  # bytes
LONGEST_NUMBER = 15  # digits of a shape
LONGEST_NAME = 60  # characters of one in a message
LAST_LETTER = 0x10FFFF
LONGEST_REASON = 200  # characters; zipfile quotes names of 65535
WIDEST = 8  # bytes of a number
MOST_KEPT = 1 << 26  # bytes of a file of the cache
# What numpy and zip raise at a file that is not what was written.
DAMAGED = (OSError, ValueError, TypeError, LookupError, EOFError, RuntimeError, OverflowError, struct.error,
           zipfile.BadZipFile, zlib.error)  # fmt: skip


def read_npz(content: bytes, most: int, shapes: Shapes | None = None, text: Collection[str] = ()) -> dict[str, NDArray]:
    """Return the arrays of an .npz file by name, in this machine's byte order; those that it lacks are left out.

    Args:
        content: of the file.
        most: bytes that all of them may fill; more is an error before any is unpacked.
        shapes: shapes by name, None for any; other arrays are not looked at. None: all that the file has.
        text: names of those that are one text each, in place of real numbers.

    ValueError says in one line what is wrong with the file.
    """
    try:
        if not zipfile.is_zipfile(io.BytesIO(content)):
            raise ValueError("not a whole .npz file")
        if content.count(ENTRY) > MOST_MEMBERS:
            raise ValueError(f"more than {MOST_MEMBERS} arrays")
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = _members(archive, shapes)
            sizes = [
                _checked_size(archive, name, member, (shapes or {}).get(name), name in text)
                for name, member in members.items()
            ]
            if sum(sizes) > most:
                raise ValueError(f"its arrays claim {sum(sizes)} bytes, more than the {most} that are read")
            return {name: _array(archive, member) for name, member in members.items()}
    except DAMAGED as error:
        raise ValueError((str(error) or type(error).__name__).splitlines()[0][:LONGEST_REASON]) from None


def _members(archive: zipfile.ZipFile, shapes: Shapes | None) -> dict[str, zipfile.ZipInfo]:
    members: dict[str, zipfile.ZipInfo] = {}
    for member in archive.infolist():
        name = member.filename.removesuffix(SUFFIX)
        if name == member.filename or (shapes is not None and name not in shapes):
            continue
        if name in members:
            raise ValueError(f"two arrays are named {_quoted(name)}")
        if member.flag_bits & ENCRYPTED:
            raise ValueError(f"{_quoted(name)} is encrypted")
        if member.compress_type not in METHODS:
            raise ValueError(f"{_quoted(name)} is packed in a way that numpy does not use")
        members[name] = member
    return members


def _checked_size(
    archive: zipfile.ZipFile, name: str, member: zipfile.ZipInfo, shape: tuple[int, ...] | None, is_text: bool
) -> int:
    """Return the bytes of a member; ValueError unless its header fits what is wanted and the directory."""
    with archive.open(member) as file:
        head = HEADER.match(file.read(LONGEST_HEADER))
    if head is None or int.from_bytes(head["length"], "little") != len(head["text"]):
        raise ValueError(f"{_quoted(name)} is no array of numbers or text as numpy writes it")
    lengths = [part.strip() for part in head["shape"].decode().rstrip(" ,").split(",")] if head["shape"] else []
    if len(lengths) > MOST_AXES or not all(re.fullmatch(rf"\d{{1,{LONGEST_NUMBER}}}", length) for length in lengths):
        raise ValueError(f"{_quoted(name)} has a shape that no array has")
    got, dtype = tuple(map(int, lengths)), np.dtype(head["dtype"].decode())
    if is_text and (dtype.kind != "U" or got != ()):
        raise ValueError(f"{_quoted(name)} must be one text, got {dtype} of shape {got}")
    if not is_text and (dtype.kind == "U" or dtype.itemsize > WIDEST):
        raise ValueError(f"{_quoted(name)} must be real numbers, got {dtype}")
    if shape is not None and got != shape:
        raise ValueError(f"{_quoted(name)} must have the shape {shape}, got {got}")
    claimed = math.prod(got) * dtype.itemsize
    if member.file_size != head.end() + claimed:
        raise ValueError(f"{_quoted(name)} claims {claimed} bytes, and has {member.file_size - head.end()}")
    return member.file_size


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray:
    with archive.open(member) as file:
        array: NDArray = np.lib.format.read_array(file, allow_pickle=False)
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    if array.dtype.kind == "U" and np.any(array.reshape(1).view(np.uint32) > LAST_LETTER):  # Python would stop there
        raise ValueError(f"{_quoted(member.filename)} is no text")
    return array


def _quoted(name: str) -> str:
    return repr(name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}...")


def kept(name: str, arrays: Collection[str], make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of that name from the cache, else from `make`. The name says all that they depend on.

    A file that is damaged is named in a warning and made anew; where none can be written, there is none.
    """
    path = platformdirs.user_cache_path("mcml_sim") / f"{name}.npz"
    if path.is_file():
        try:
            return _kept(read_whole(path, MOST_KEPT), arrays)
        except ValueError as error:
            warnings.warn(f"{path} is damaged ({error}) and made anew", Notice, stacklevel=2)
    new = make()
    with contextlib.suppress(OutputError, OSError):  # no folder to write into
        path.parent.mkdir(parents=True, exist_ok=True)
        file = io.BytesIO()
        np.savez(file, allow_pickle=False, sha256=_digest(new), **new)
        write_whole(path, file.getvalue())
    return new


def _kept(content: bytes, names: Collection[str]) -> Arrays:
    arrays = read_npz(content, MOST_KEPT, text=("sha256",))
    if not {"sha256", *names} <= arrays.keys():
        raise ValueError("an array is missing")
    chosen = {name: arrays[name] for name in names}
    if str(arrays["sha256"]) != _digest(chosen):
        raise ValueError("its numbers are not those that were written")
    return chosen


def _digest(arrays: Arrays) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in arrays.values())).hexdigest()
