"""Files as a careless or a hostile hand leaves them, of every kind that is read, from a seed.

The same seed gives the same bytes. What a payload would do, were it run anywhere, is to make a file named CANARY.
"""

from __future__ import annotations

import copy
import io
import json
import math
import random
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[3]


@cache
def _text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


CANARY = "CANARY"
# All that ends a line for Python's splitlines, Python itself, GLSL, HLSL or a browser.
LINE_ENDS = ("\n", "\r", "\r\n", "\v", "\f", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029")
# A C preprocessor joins the next line to one that ends so, a comment's too; ??/ is a backslash to some of them.
JOINED = ("\\", "\\ ", "\\\t", "??/", "??/ ")
CODE = (
    f'import os; os.system("touch {CANARY}")',
    f'__import__("os").system("touch {CANARY}")',
    f"open('{CANARY}', 'w')",
    "float evil = 1.0;",
    "#define hazard_burden evil",
    '#include "evil"',
)
TEXTS = (
    *(f"one{end}{code}" for end in LINE_ENDS for code in CODE),
    *(f"one{end}" for end in (*LINE_ENDS, *JOINED)),
    *("", " ", "\0", "\t", "\b", "\x7f", "\x1b[31mred", "\x1b]0;title\a", "\x9b31m", "\x1b[2J", "\ud800", "\udcff"),
    *("\u202eevil", "\u2066evil\u2069", "\u200b", "\ufeff", "e\u0301" * 40, "\U0001f4a5", "Σ", "١"),
    *("*/", "/*", "//", '"""', "'''", '"', "'", "`", "#", "`` ` ``", "\\n", "\\u000a", "${x}", "$title", "{0}", "%s"),
    *(f'<script>fetch("{CANARY}")</script>', "</script>", "</SCRIPT ><b>", "<!--", "-->", "<![CDATA[", "]]>", "&lt;"),
    *("<!-- quality -->", "<!-- /quality -->", "<img src=x onerror=alert(1)>", '" onmouseover="alert(1)', "</td><td>"),
    *("[bold]one[/bold]", "[link=file:///etc/passwd]one[/link]", "[/]", "[", "a|b", "\\|", "| --- |", "# one", "> one"),
    *("../../one", "/etc/passwd", "..", "~/one", f"$(touch {CANARY})", f"; touch {CANARY}", "-o", "--out=/dev/null"),
    *("1.0; evil", "1.0\nevil", "nan", "inf", "1e400", "0x10", "1_0", "LAW_", "@i", "//% for 9\n@i\n//% end", "x|"),
    *("PF_SELECT", "x" * 10_000, "x " * 10_000, "0" * 64, "F" * 64, "0" * 63),
)  # fmt: skip
WORDS = (
    *("converged", "failed", "profile", "albedo", "evidence", "as-published", "inverse", "hazard", "liang", "diffuse"),
)  # fmt: skip
# As they stand in a file: numbers that are large, tiny or none, and nests that are deep.
NUMBERS = (
    *("0", "-0.0", "1", "-1", "2", "3.5", "1e-300", "5e-324", "1e16", "1e22", "1e300", "1e308", "1e400", "-1e400"),
    *("NaN", "Infinity", "-Infinity", "9007199254740993", "9" * 400, "9" * 5000, "-" + "9" * 5000, "0." + "3" * 5000),
)
DEEP = 100_000
NESTS = ("[" * DEEP + "]" * DEEP, '{"a":' * DEEP + "1" + "}" * DEEP, "[" * DEEP, "[[]," * 2000 + "1" + "]" * 2000)
FILE_NAMES = (
    *("\nimport os", "\x1b[31mred", "<img src=x onerror=alert(1)>", "\\", "[bold]a", "*", "\u202ea", ".b", "|", "`"),
)  # fmt: skip
TOML_WORDS = (
    *NUMBERS, *("nan", "inf", "-inf", "true", "1_000", "0x10", "1979-05-27T07:32:00Z", "[]", "{}", "{a = 1}", "[[1]]"),
    *("[1, 2]", "[2, 1]", "[1, 2, 3]", "[0.1, true]", '["a"]', "'''a", '"', "=", "[" * DEEP, "{a=" * DEEP, "[" * 500),
)  # fmt: skip
TOML_LINES = (
    *("[choose]", "[[layers]]", "[layers]", "layers = 3", "choose = 3", "unknown = 1", "[", "]", "=", "a = ", '"" = 1'),
    *(f"{'a.' * DEEP}b = 1", f"[{'a.' * 3000}b]", f"{'k' * DEEP} = 1", f"x = {'9' * 5000}", "x = 1\nx = 2"),
    "\x1b[31m = 1",
)  # fmt: skip
CELLS = (
    *("0", "-1", "1e400", "-1e308", "5e-324", "nan", "inf", "1_000", "", '"', '"a', '"1"', "1,5", "1.5.5", "٣", "0x10"),
    *("\x1b[31m", "a\u2028b", "\0", "=cmd|' /C calc'!A0", "x" * DEEP, "9" * 5000, ",", ";", "\t", "#", '"\n"'),
    *("[", "[a.u.]", "r", "value", "sigma", "value1", "value_2", "r_in", "r_out", "r [mm]", "r [furlong]", "r (mm)"),
    "value [1/cm^2]",
)  # fmt: skip
CELL_LINES = (
    *("", ",", ",,", "1,2,3,4", "#", "a,b,c", "r,value,sigma", "," * 60_000, "1," * 60_000, '"' * 1001, "\0", "1 2 3"),
    ",".join(["r", *(f"value{i}" for i in range(1, 60_000))]),
)
MCI_WORDS = (
    *NUMBERS, *("nan", "inf", "1e8", "-1", "0", "A", "B", "slab.mco", "thesis.tex", "../evil.mco", "/dev/null"),
    *("a\x1b[31m.mco", "a\u2028.mco", "a\0", "x" * 300, "é" * 255, ".", "..", "~", "$(touch CANARY)", "-1e400", "1_0"),
)  # fmt: skip
MCI_LINES = ("1.0", "1", "0 0", "1 2 3 4 5", "slab.mco A", "#", "1.0  10  90  0.75  0.02", "9" * 5000, "x" * DEEP)
MCI_2 = """mcmli2.0 # version
air 1.0 0 0 0
skin 1.4 1 100 0.9
fat 1.44 0.5 10 0
end
one.mco A
air
skin 0.1
fat 1E8
air
end
pencil
0
0.01 0.02 0.1
3 4 1 2
Rd_r A_rz
1000 0:10
1E-4
1
end
"""
MCO_2 = "mcmloA2.0\n" + MCI_2.replace("1000 0", "1000000 0")
MCO_2 += "RAT\n0.028\n0.028 0\n0.238 0\n0.64 0\n0 0\n0.09 0\nRd_r\n12.5\n3.25\n1.5\n0.25\n"
MCI_2_WORDS = (
    *("end", "air", "skin", "isotropic", "pencil", "Rd_t", "Td_ra", "\\", "10:00", "1e6", "0", "fat 0.1", "a b c"),
)  # fmt: skip
FACTS = ("n = 1.4", "anisotropy: 0.8", "beam radius [mm] = 0.5", "light = searchlight", "Sample: 3")
FACT_LINES = (
    *("# n =", "# n = 1.5", "# unit = cm", "# unit = furlong", "# fibre = 0.2mm", "# beam = none.csv", "# = 3", "# :"),
    *(f"# n = {'9' * 5000}", f"# g: {'9' * 5000}", "# beam = 1e400 mm", "# fibre = 1e-300", f"# {'n' * DEEP} = 1"),
    *("# beam = fwhm:0.2mm:0.3mm", "# beam = tophat:", "# beam = fwhm:", "# n = 1.3:1.4:1.5", f"# x = {'=' * DEEP}"),
    *(f"# {'(' * DEEP} = 1", f"# {'[' * 1000}n{']' * 1000} = 1", "# light = sun", "# N: 1e6", "# \x1b[31m = 1", "#=="),
)  # fmt: skip
TOKEN = re.compile(r'"[^"\n]*"|[^\s,;=\[\]{}#"]+')


def damaged(rng: random.Random, data: bytes) -> bytes:
    """A file's bytes cut, flipped, grown, or in another encoding."""
    at = rng.randrange(len(data)) if data else 0
    some = bytes(rng.randrange(256) for _ in range(rng.randint(1, 8)))
    flipped = bytearray(data)
    for _ in range(rng.randint(1, 4) if data else 0):
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    ways: tuple[bytes, ...] = (
        *(data[:at], data[at:], data[:at] + some + data[at:], data[:at] + data[at + len(some) :], bytes(flipped)),
        *(data + data, data + some, some + data, b"\xef\xbb\xbf" + data, data[:at] + b"\0" + data[at:], b"", some),
        *(b"\xff\xfe" + data, data.replace(b"\n", b"\r"), data.replace(b"\n", b"\r\n")),
        data[:at] + b"\xed\xa0\x80" + data[at:],
    )  # fmt: skip
    return rng.choice(ways)


def any_text(rng: random.Random, before: str = "") -> str:
    """An odd text, alone or in what stood there."""
    odd, at = rng.choice(TEXTS), rng.randint(0, len(before))
    return rng.choice((odd, before + odd, before[:at] + odd + before[at:], rng.choice(WORDS)))


class Tree:
    """JSON that is changed place by place; what JSON cannot say (1e400, a nest) is put in as text."""

    def __init__(self, rng: random.Random, content: Any) -> None:
        self.rng, self.content, self.literal = rng, copy.deepcopy(content), dict[str, str]()

    def change(self) -> None:
        """Change one place: replace, rename, remove or add."""
        rng = self.rng
        if rng.random() < 0.4 and (texts := list(_texts(self.content))):
            holder, key = rng.choice(texts)
            holder[key] = any_text(rng, holder[key])
            return
        holder, key = self._somewhere()
        way = rng.random()
        if way < 0.5:
            holder[key] = self._odd(holder[key])
        elif way < 0.65:
            del holder[key]
        elif isinstance(holder, dict):
            value = holder.pop(key) if way < 0.8 else self._odd(holder[key])
            holder[any_text(rng, key)] = value
        else:
            holder.insert(rng.randrange(len(holder) + 1), self._odd(holder[key]))

    def spelled(self) -> bytes:
        """The file."""
        as_ascii = self.rng.random() < 0.7
        text = json.dumps(self.content, indent=self.rng.choice((None, 1)), ensure_ascii=as_ascii)
        for mark, literal in self.literal.items():
            text = text.replace(f'"{mark}"', literal)
        if self.rng.random() < 0.05:  # a key twice: the last one counts
            text = text.replace("{", '{"title": "one\\nimport os", ', 1) + self.rng.choice(("", "\n", " ", "{}", "\0"))
        return text.encode("utf-8", "surrogatepass")

    def _somewhere(self) -> tuple[Any, Any]:
        """A place, the likelier the higher it stands."""
        holder = self.content
        while True:
            key = self.rng.choice(list(holder)) if isinstance(holder, dict) else self.rng.randrange(len(holder))
            inside = holder[key]
            if not (isinstance(inside, dict | list) and inside) or self.rng.random() < 0.2:
                return holder, key
            holder = inside

    def _odd(self, value: Any) -> Any:
        rng = self.rng
        if isinstance(value, int | float) and rng.random() < 0.4:
            return value * rng.choice((-1, 0, 10, 1.5, 1e-12, 1e12))
        if isinstance(value, list) and value and rng.random() < 0.6:
            return rng.choice((value[:-1], value[:1], value + value, [value], [*value, None], value[::-1]))
        way = rng.random()
        if way < 0.03:
            return self._literal(rng.choice(NESTS))
        if way < 0.4:
            return self._literal(rng.choice(NUMBERS))
        if way < 0.6:
            return any_text(rng, value if isinstance(value, str) else "")
        return copy.deepcopy(
            rng.choice((None, True, False, [], {}, [1, 2], {"a": 1}, [[]], [None], "", value, self.content))
        )

    def _literal(self, text: str) -> str:
        mark = f"@literal {len(self.literal)}@"
        self.literal[mark] = text
        return mark


def _texts(content: Any) -> Iterator[tuple[Any, Any]]:
    """Every place that holds a text."""
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        if isinstance(value, str):
            yield content, key
        elif isinstance(value, dict | list):
            yield from _texts(value)


def json_mutant(rng: random.Random, content: Any) -> bytes:
    """A JSON file with one to three places changed, or its bytes damaged."""
    tree = Tree(rng, content)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        if tree.content:
            tree.change()
    return damaged(rng, tree.spelled()) if rng.random() < 0.08 else tree.spelled()


def text_mutant(rng: random.Random, text: str, words: Sequence[str], lines: Sequence[str], comment: str = "#") -> bytes:
    """A text with one to three words or lines changed, or its bytes damaged; no words behind a comment's mark."""
    found = text.split("\n")
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        at, other = rng.randrange(len(found)), rng.randrange(len(found))
        way = rng.random()
        if way < 0.55:
            codes = [one.partition(comment)[0] if comment else one for one in found]
            if places := [(line, *word.span()) for line, code in enumerate(codes) for word in TOKEN.finditer(code)]:
                line, begin, end = rng.choice(places)
                word = rng.choice((rng.choice(words), rng.choice(words), _scaled(rng, found[line][begin:end])))
                found[line] = found[line][:begin] + word + found[line][end:]
        elif way < 0.65 and len(found) > 1:
            del found[at]
        elif way < 0.75:
            found.insert(at, found[other])
        elif way < 0.85:
            found[at], found[other] = found[other], found[at]
        else:
            found.insert(at, rng.choice(lines))
    data = "\n".join(found).encode("utf-8", "surrogatepass")
    return damaged(rng, data) if rng.random() < 0.1 else data


def _scaled(rng: random.Random, word: str) -> str:
    """Another number where there is one."""
    try:
        return f"{float(word) * rng.choice((0.5, 2, 10, -1, 0, 1e-9, 1e9)):.6g}"
    except ValueError:
        return word


def toml_mutant(rng: random.Random, text: str) -> bytes:
    """A scene or a recipe: odd words and lines, odd texts quoted as TOML quotes them."""
    quoted = tuple(json.dumps(any_text(rng)) for _ in range(8))  # JSON's escapes are TOML's, lone surrogates apart
    return text_mutant(rng, text, (*TOML_WORDS, *quoted), TOML_LINES)


class Pickled:
    """What runs when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, ...]]:
        return open, (CANARY, "w")


def npz_mutant(rng: random.Random, arrays: Mapping[str, np.ndarray]) -> bytes:
    """An .npz file: members changed, missing, doubled, lying about their shape or size, far larger than the file."""
    members = [(f"{name}.npy", _npy(array)) for name, array in arrays.items()]
    method = rng.choice((*[zipfile.ZIP_STORED] * 6, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(members))
        name, data = members[at]
        array = arrays.get(name.removesuffix(".npy"), np.zeros(3))
        way = rng.randrange(9)
        if way < 3:
            members[at] = (name, _npy(_odd_array(rng, array)))
        elif way == 3:
            members[at] = (name, _lying(rng, data))
        elif way == 4:
            del members[at]
        elif way == 5:
            others = ("../../evil.npy", "/etc/evil.npy", "evil\x1b[31m.npy", name.removesuffix(".npy"), "x" * 999)
            members[at] = (rng.choice(others), data)
        elif way == 6:
            members.insert(at, rng.choice(((name, data), (name, _npy(_odd_array(rng, array))), ("more.npy", data))))
        elif way == 7 and array.dtype.kind == "U" and array.ndim == 0:
            members[at] = (name, _npy(_odd_header(rng, str(array))))
        else:
            members[at] = (name, damaged(rng, data))
        if not members:
            break
    whole = _zipped(members, method)
    if rng.random() < 0.02:
        return _with_bomb(rng, members)
    if rng.random() < 0.08:
        whole = _other_sizes(rng, whole)
    return damaged(rng, whole) if rng.random() < 0.1 else whole


def _npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array(file, array, allow_pickle=True)
    return file.getvalue()


def _odd_array(rng: random.Random, array: np.ndarray) -> np.ndarray:
    """The same with another type, shape or value, or something else altogether."""
    as_number = array if array.dtype.kind == "f" else np.arange(3.0)
    spoilt = as_number.astype(float).reshape(-1)
    if spoilt.size:
        spoilt[rng.randrange(spoilt.size)] = rng.choice((np.nan, np.inf, -np.inf, -1.0, 0.0, 1e300, 5e-324, 1e-30))
    with np.errstate(all="ignore"):
        ways: tuple[np.ndarray, ...] = (
            *(spoilt.reshape(as_number.shape), spoilt.reshape(as_number.shape), -as_number, as_number * 1e300),
            *(as_number * 0, as_number[..., :-1] if as_number.ndim else as_number, as_number.reshape(-1)[:0]),
            *(as_number[None], as_number.T, np.float64(1.0).reshape(()), as_number.reshape(-1)[::-1], np.zeros((3, 0))),
            *(as_number.astype("f2"), as_number.astype(">f8"), as_number.astype("c16") + 1j, as_number.astype("i8")),
            *(as_number.astype("?"), as_number.astype("U"), as_number.astype("S"), np.array([Pickled()], object)),
            *(np.zeros(3, "M8[s]"), np.zeros(3, [("a", "f8")]), np.array(any_text(rng)), np.array([b"\xff"])),
        )  # fmt: skip
    return rng.choice(ways)


def _odd_header(rng: random.Random, text: str) -> np.ndarray:
    """JSON inside a member."""
    try:
        return np.array(json_mutant(rng, json.loads(text)).decode("utf-8", "replace"))
    except ValueError:
        return np.array(any_text(rng))


def _lying(rng: random.Random, data: bytes) -> bytes:
    """A member whose header says what its bytes are not."""
    shapes = (
        *("(100000000000000,)", "(10000000, 10000000)", "(-1,)", "(1e9,)", "(True,)", "()", "(3", "(2**40,)"),
        *("None", "3"),
    )  # fmt: skip
    claims = [("<f8", shape) for shape in shapes] + [(kind, "(3,)") for kind in ("|O", "<U1000000000", "<f99", "")]
    told = (
        *(f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}" for kind, shape in claims),
        *(f"__import__('os').system('touch {CANARY}')", "{}", "[" * 1000, "'" * 999, "{'descr': '<f8'}", "1" * 5000),
    )
    body = data[128:] if rng.random() < 0.5 else b"cos\nsystem\n(S'touch CANARY'\ntR."
    header = rng.choice(told).encode() + b"\n"
    start = rng.choice((b"\x93NUMPY\x01\x00", b"\x93NUMPY\x01\x00", b"\x93NUMPY\x09\x00", b"\x93NUMPX\x01\x00"))
    return start + struct.pack("<H", min(len(header) * rng.choice((1, 1, 1, 40)), 65535)) + header + body


def _zipped(members: Sequence[tuple[str, bytes]], method: int) -> bytes:
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w", method, compresslevel=1) as archive:
        warnings.filterwarnings("ignore", "Duplicate name")
        for name, data in members:
            archive.writestr(zipfile.ZipInfo(name), data, method)  # with its date fixed
    return file.getvalue()


@cache
def _bomb(size: int = 2**29) -> tuple[bytes, int]:
    """A member of zeros, deflated to a thousandth, and its CRC."""
    head = _npy(np.zeros(0)).replace(b"'shape': (0,)", f"'shape': ({size // 8},)".encode())
    head = head[:8] + struct.pack("<H", len(head) - 10) + head[10:]
    deflate, crc = zlib.compressobj(1, zlib.DEFLATED, -15), zlib.crc32(head)
    block, parts = bytes(2**24), [deflate.compress(head)]
    for _ in range(size // len(block)):
        parts.append(deflate.compress(block))
        crc = zlib.crc32(block, crc)
    return b"".join([*parts, deflate.flush()]), crc


def _with_bomb(rng: random.Random, members: Sequence[tuple[str, bytes]], size: int = 2**29) -> bytes:
    """One member, or one more, that unpacks to half a gigabyte; half of them say that they are small."""
    data, crc = _bomb(size)
    name = rng.choice([name for name, _ in members] + ["more.npy"])
    file = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(file, "w") as archive:
        warnings.filterwarnings("ignore", "Duplicate name")
        for other, body in members:
            if other != name:
                archive.writestr(zipfile.ZipInfo(other), body)
        at = file.tell()
        info = zipfile.ZipInfo(name)
        info.header_offset, info.CRC, info.compress_size = at, crc, len(data)
        info.file_size = rng.choice((size + 128, 100))
        info.compress_type = zipfile.ZIP_DEFLATED
        file.write(info.FileHeader(zip64=False) + data)
        archive.filelist.append(info)
        archive.NameToInfo[name] = info
        archive.start_dir = file.tell()
    return file.getvalue()


def _other_sizes(rng: random.Random, whole: bytes) -> bytes:
    """The same with sizes in the directory that are not those of the members."""
    changed = bytearray(whole)
    for at in [one.start() for one in re.finditer(b"PK\x01\x02", whole)]:
        if rng.random() < 0.5:
            place = rng.choice((8, 10, 16, 20, 24, 42))  # flags, method, CRC, sizes, offset
            size = 2 if place < 16 else 4
            changed[at + place : at + place + size] = rng.choice((0, 1, 100, 2**16 - 1)).to_bytes(size, "little")
    return bytes(changed)


@cache
def records() -> dict[str, Any]:
    """Shipped records of every kind, the one of readings cut to a few."""
    names = "albedo-rational albedo-liang albedo-rational-diffuse-refracting burley-whole gaussians-2 quantile hazard"
    names += " hazard-diffuse liang-inverse-whole liang-as-published reproduction"
    found = {name: json.loads(_text(f"fits/{name}.json")) for name in names.split()}
    for key in ("readings", "table1"):
        found["reproduction"][key] = found["reproduction"][key][:12]
    return found


def record(seed: int) -> tuple[str, bytes]:
    """The name of a record's file, without its ending, and what is in it."""
    rng = random.Random(seed)
    name = rng.choice(list(records()))
    odd = rng.choice(FILE_NAMES) if rng.random() < 0.04 else ""
    return name + odd, json_mutant(rng, records()[name])


@cache
def _arrays(path: str) -> dict[str, np.ndarray]:
    with np.load(ROOT / path) as found:
        return dict(found)


def arrays(path: str) -> Callable[[int], bytes]:
    """Return what mutates an .npz of the repository."""
    return lambda seed: npz_mutant(random.Random(seed), _arrays(path))


def table(seed: int) -> bytes:
    """A .csv of `profilefit fit`: values with errors, replicates, or rings."""
    rng = random.Random(seed)
    plain = _text("examples/phantom.csv")
    rows = [line.split(",") for line in plain.splitlines()[2:]]
    replicates = [f"{r},{v},{float(v) * 1.02:.5g},{float(v) * 0.97:.5g}" for r, v, _ in rows]
    rings = [f"{r},{float(r) * 1.2:.5g},{v},{s}" for r, v, s in rows]
    headed = {"r [mm],value1,value2,value3": replicates, "r_in [mm];r_out;value;sigma": rings}
    texts = (plain, *("\n".join([head, *lines]) for head, lines in headed.items()))
    text = rng.choice(texts)
    return text_mutant(rng, text.replace(",", ";") if ";" in text else text, CELLS, CELL_LINES)


def of_text(
    text: str, words: Sequence[str] = CELLS, lines: Sequence[str] = CELL_LINES, comment: str = "#"
) -> Callable[[int], bytes]:
    """Return what mutates a text, or the file of that path in the repository."""
    return lambda seed: text_mutant(random.Random(seed), text if "\n" in text else _text(text), words, lines, comment)


def words(text: str, *more: str) -> Callable[[int], bytes]:
    """Return what mutates an .mci or .mco, whose text this is, or its path in the repository."""
    return of_text(text, (*MCI_WORDS, *more), (*MCI_LINES, *more))


# A .csv of `profilefit fit` whose comments state facts; one of a measured beam; a text file of a TLS850.
facts = of_text(
    "".join(f"# {line}\n" for line in FACTS) + _text("examples/phantom.csv"), (*CELLS, *NUMBERS), FACT_LINES, ""
)
beam = of_text("r, irradiance\n" + "".join(f"{0.05 * at:g}, {math.exp(-0.02 * at * at):.4g}\n" for at in range(30)))
PLACES = ((record, pixel) for record in range(1, 10) for pixel in range(1, 33))
ROWS = (f"{at} {pixel} {math.exp(-0.3 * pixel) * (1 + 0.01 * at):.4g}" for at, pixel in PLACES)
translucency = of_text("\n".join(["Record Pixel Value", *ROWS]))


def toml(path: str) -> Callable[[int], bytes]:
    """Return what mutates a .toml of the repository."""
    return lambda seed: toml_mutant(random.Random(seed), _text(path))


def tree(path: str) -> Callable[[int], bytes]:
    """Return what mutates a .json of the repository."""
    return lambda seed: json_mutant(random.Random(seed), json.loads(_text(path)))


@cache
def _mesh(kind: str) -> bytes:
    """Return a small ball with a texture and a normal map, as a file of a kind."""
    import trimesh

    ball = trimesh.creation.icosphere(1, 10.0)
    pixels = Image.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3))
    look = trimesh.visual.material.PBRMaterial(baseColorTexture=pixels, normalTexture=pixels, roughnessFactor=0.3)
    uv = 0.05 * (ball.vertices[:, :2] + 10.0)
    textured = trimesh.Trimesh(ball.vertices, ball.faces, process=False)
    textured.visual = trimesh.visual.TextureVisuals(uv=uv, material=look)
    made = textured.export(file_type="glb") if kind == "glb" else ball.export(file_type=kind)
    return made.encode() if isinstance(made, str) else bytes(made)


def mesh(kind: str) -> Callable[[int], bytes]:
    """Return what mutates a mesh file: bytes of any kind; of a GLB the JSON in every other one."""

    def mutant(seed: int) -> bytes:
        rng, data = random.Random(seed), _mesh(kind)
        if kind == "obj" and seed % 2:
            return text_mutant(
                rng, data.decode(), ("f", "v", "vt", "vn", "usemtl", *NUMBERS), ("f 1 2 3", "mtllib a.mtl")
            )
        if kind != "glb" or seed % 2 == 0:
            return damaged(rng, data)
        (length,) = struct.unpack("<I", data[12:16])
        header = json_mutant(rng, json.loads(data[20 : 20 + length]))
        header += b" " * (-len(header) % 4)
        rest = data[20 + length :]
        return data[:8] + struct.pack("<III", 20 + len(header) + len(rest), len(header), 0x4E4F534A) + header + rest

    return mutant


def recipe(seed: int) -> bytes:
    """A .toml of `profilefit regenerate`."""
    rng = random.Random(seed)
    name = rng.choice(("burley-whole", "albedo-rational", "liang-as-published", "quantile"))
    return toml_mutant(rng, _text(f"fits/{name}.toml"))
