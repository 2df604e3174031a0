"""Arrays of files that others made: what is claimed is checked before it is unpacked."""

import io
import struct
import time
import tracemalloc
import zipfile

import numpy as np
import pytest

from mcml_sim.files.npz import MOST_MEMBERS, read_npz
from tests.fixtures import refused

MOST = 10**6
ARRAYS = {"one": np.arange(6.0).reshape(2, 3), "two": np.arange(4, dtype=">i4"), "name": np.array("hazard")}


def packed(**arrays):
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def npy(dtype="<f8", shape="(3,)", data=b"\0" * 24, order="False"):
    text = f"{{'descr': '{dtype}', 'fortran_order': {order}, 'shape': {shape}, }}"
    text += " " * (117 - len(text)) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + data


def zipped(*members, method=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, data in members:
            archive.writestr(name, data)
    return file.getvalue()


def encrypted():
    content = bytearray(zipped(("one.npy", npy())))
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    return bytes(content)


def test_arrays_come_back_as_numpy_wrote_them():
    found = read_npz(packed(**ARRAYS), MOST, text=["name"])
    assert list(found) == list(ARRAYS)
    np.testing.assert_array_equal(found["one"], ARRAYS["one"], strict=True)
    np.testing.assert_array_equal(found["two"], np.arange(4, dtype=np.int32), strict=True)
    assert str(found["name"]) == "hazard"
    columns = np.asfortranarray(ARRAYS["one"])
    np.testing.assert_array_equal(read_npz(packed(one=columns), MOST)["one"], ARRAYS["one"], strict=True)


def test_only_what_is_wanted_is_looked_at():
    content = zipped(("one.npy", npy()), ("far.npy", npy(shape="(10000000000000,)")), ("read me", b"words"))
    assert list(read_npz(content, MOST, {"one": (3,), "two": None})) == ["one"]
    refused("'far' claims 80000000000000 bytes, and has 24", read_npz, content, MOST, error=ValueError)


WRONG = {
    "shape": (zipped(("one.npy", npy(shape="(1, 3)"))), r"'one' must have the shape \(3,\), got \(1, 3\)"),
    "objects": (zipped(("one.npy", npy("|O"))), "'one' is no array of numbers or text"),
    "truth values": (packed(one=np.array([True, False, True])), "'one' is no array of numbers or text"),
    "complex": (packed(one=np.zeros(3, complex)), "'one' is no array of numbers or text"),
    "long double": (packed(one=np.zeros(3, np.longdouble)), "'one' must be real numbers, got float128"),
    "text": (packed(one=np.array(["a", "b", "c"])), "'one' must be real numbers, got <U1"),
    "texts": (packed(name=np.array(["a", "b"])), r"'name' must be one text, got <U1 of shape \(2,\)"),
    "number": (packed(name=np.array(3.0)), r"'name' must be one text, got float64 of shape \(\)"),
    "header": (zipped(("one.npy", npy(shape="(3,), **{}"))), "'one' is no array of numbers or text"),
    "code": (zipped(("one.npy", npy(shape="((lambda: 3)(),)"))), "'one' is no array of numbers or text"),
    "negative": (zipped(("one.npy", npy(shape="(-3,)"))), "'one' is no array of numbers or text"),
    "many axes": (zipped(("one.npy", npy(shape="(1, 1, 1, 1, 1, 1, 1, 1, 3)"))), "'one' has a shape that no array has"),
    "digits": (zipped(("one.npy", npy(shape=f"({'9' * 40},)"))), "'one' has a shape that no array has"),
    "no header": (zipped(("one.npy", b"1, 2, 3")), "'one' is no array of numbers or text"),
    "short": (zipped(("one.npy", npy(data=b"\0" * 16))), "'one' claims 24 bytes, and has 16"),
    "long": (zipped(("one.npy", npy(data=b"\0" * 32))), "'one' claims 24 bytes, and has 32"),
    "bzip2": (zipped(("one.npy", npy()), method=zipfile.ZIP_BZIP2), "'one' is packed in a way that numpy does not use"),
    "a letter beyond all": (zipped(("name.npy", npy("<U1", "()", b"\xff" * 4))), "'name.npy' is no text"),
    "no zip file": (b"PK", "not a whole .npz file"),
    "empty": (b"", "not a whole .npz file"),
    "long name": (zipped((f"{'x' * 90}.npy", b"")), r"'x{60}\.\.\.' is no array"),
    "encrypted": (encrypted(), "'one' is encrypted"),
    "without end": (zipped(*((str(number), b"") for number in range(MOST_MEMBERS + 1))), "more than 1000 arrays"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "reason"), WRONG.values(), ids=WRONG)
def test_a_false_claim_is_one_line(content, reason):
    wanted = {"one": (3,), "name": (), "x" * 90: None}
    refused(f"^{reason}", lambda: str(read_npz(content, MOST, wanted, text=["name"])["name"]), error=ValueError)


def test_two_of_a_name_are_refused():
    with pytest.warns(UserWarning, match="Duplicate name"):
        content = zipped(("one.npy", npy()), ("one.npy", npy()))
    refused("two arrays are named 'one'", read_npz, content, MOST, error=ValueError)


def test_a_directory_that_lies_about_sizes_unpacks_no_more_than_it_said():
    """Zeros that unpack to 80 MB, in a member that says it has 24."""
    content = bytearray(zipped(("one.npy", npy(data=bytes(8 * 10**7)))))
    for entry, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        start = content.rindex(entry) + at
        content[start : start + 4] = struct.pack("<I", len(npy()))
    started = time.perf_counter()
    refused("Bad CRC-32", read_npz, bytes(content), MOST, error=ValueError)
    assert time.perf_counter() - started < 0.2


def test_a_bomb_is_not_unpacked():
    """A file that packs a thousand times: less than 20 MB more, and no time."""
    content = zipped(("one.npy", npy(shape="(12500000,)", data=bytes(10**8))))
    assert len(content) < 1.1e5
    tracemalloc.start()
    started = time.perf_counter()
    try:
        with pytest.raises(ValueError, match="its arrays claim 100000128 bytes, more than the 67108864 that are read"):
            read_npz(content, 2**26)
        assert time.perf_counter() - started < 0.5
        assert tracemalloc.get_traced_memory()[1] < 20 * 2**20
    finally:
        tracemalloc.stop()
