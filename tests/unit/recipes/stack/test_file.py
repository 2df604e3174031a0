"""STACK.toml: three colours, published materials, images of thickness, and one line for every mistake."""

import io
import math
import os
import random
import re
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.stacks import stacks
from mcml_sim import Layer, Medium
from mcml_sim.files.whole_file import read_toml
from profilefit.errors import InputError
from profilefit.materials import BY_NAME, SOURCE
from profilefit.recipes.folder import available, fits_folder
from profilefit.recipes.stack.file import LARGEST_FILE, LayerStack, LayerTable, read_layers

STACK = """\
[[layers]]
name = "veil"
n = 1.4
mu_a = [0.1, 0.2, 0.3]
mu_s = 9
g = 0.5
thickness = 0.25
source = "measured"

[[layers]]
n = 1.3
mu_a = 1
mu_s = [1, 2, 3]
g = 0
"""
IMAGE = 'thickness = { image = "thickness.png", range = [0.05, 0.4] }'
TWO = '[[layers]]\nn = 1.3\nmu_a = { image = "thickness.png", range = [0, 1] }\nmu_s = 1\ng = 0\n'
KIND = r"8- or 16-bit grey, or a TIFF of float32, got thickness.png of another kind \(Pillow's "
SIZE = r"image must be a grey PNG or TIFF of at most 4096 x 4096 pixels, got "


@pytest.fixture
def read(tmp_path):
    """Reads the stack above, one piece of it replaced."""

    def from_file(old="", new=""):
        assert not old or STACK.count(old) == 1, "the piece to replace must be there, once"
        path = tmp_path / "skin.toml"
        path.write_text(STACK.replace(old, new) if old else new or STACK, encoding="utf-8")
        return read_layers(path, read_toml(path))

    return from_file


@pytest.fixture
def of_image(read, tmp_path):
    """Reads the stack above with an image as its first thickness."""

    def from_image(image, name="thickness.png", **options):
        if isinstance(image, bytes):
            (tmp_path / name).write_bytes(image)
        else:
            image.save(tmp_path / name, **options)
        return read("thickness = 0.25", IMAGE.replace("thickness.png", name))

    return from_image


def refused(make, message):
    """One line that begins with the file's name, and has these words."""
    with pytest.raises(InputError, match=message) as caught:
        make()
    text = str(caught.value)
    assert ": " in text
    assert text.partition(": ")[0].endswith("skin.toml")
    assert text.isprintable()
    assert len(text) < 2000


def test_three_colours(read):
    stack = read()
    assert stack.unit == "mm"
    assert stack.media == tuple(
        Medium((Layer(1.4, mu_a, 9.0, 0.5, 0.25), Layer(1.3, 1.0, mu_s, 0.0)))
        for mu_a, mu_s in ((0.1, 1.0), (0.2, 2.0), (0.3, 3.0))
    )
    assert not stack.is_grey
    assert (stack.names, stack.sources, stack.map) == (("veil", ""), ("measured", ""), None)
    veil = {"name": "veil", "n": 1.4, "mu_a": [0.1, 0.2, 0.3], "mu_s": [9.0, 9.0, 9.0], "g": 0.5, "thickness": 0.25}
    below = {"name": "", "n": 1.3, "mu_a": [1.0, 1.0, 1.0], "mu_s": [1.0, 2.0, 3.0], "g": 0.0, "thickness": None}
    assert stack.layers == [{**veil, "source": "measured"}, {**below, "source": ""}]
    assert isinstance(stack, LayerStack)
    assert read() == stack
    assert hash(read()) == hash(stack)


def test_single_numbers_are_grey_infinite_may_be_said_and_a_material_be_named(read):
    stack = read(new='unit = "cm"\nother = 1\n[[layers]]\nn = 1\nmu_a = 0.1\nmu_s = [9, 9.0, 9]\ng = 0\nthickness = 2')
    assert stack.is_grey
    assert (stack.unit, stack.media[2]) == ("cm", Medium((Layer(1.0, 0.1, 9.0, 0.0, 2.0),)))
    assert math.isinf(read("g = 0\n", "g = 0\nthickness = inf\n").media[0].layers[1].thickness)
    given, marble = "mu_a = 1\nmu_s = [1, 2, 3]\ng = 0\n", BY_NAME["marble"]
    stack = read(given, 'material = "marble"\n')
    assert [medium.layers[1] for medium in stack.media] == [
        Layer(1.3, mu_a, mu_s, 0.0) for mu_a, mu_s in zip(marble.absorption, marble.scattering, strict=True)
    ]
    assert (stack.names, stack.sources) == (("veil", "marble"), ("measured", SOURCE))
    named = read(given, 'material = "marble"\nname = "slab"\nsource = "a book"\n')
    assert (named.names[1], named.sources[1]) == ("slab", "a book")


SHIPPED = sorted((fits_folder() / "stacks").glob("*.toml"))


@pytest.mark.parametrize("path", SHIPPED, ids=[path.stem for path in SHIPPED])
def test_shipped_stacks(path):
    stack = read_layers(path, read_toml(path))
    assert all(stack.names)
    assert all(stack.sources)
    twin = {"skimmilk-on-marble": "milk on marble", "marble-on-potato": "marble on potato"}.get(path.stem, path.stem)
    if twin in stacks(0):
        assert list(stack.media) == [stacks(channel)[twin] for channel in range(3)]
    text = path.read_text(encoding="utf-8")
    if "material = " in text:
        assert all(source.startswith(SOURCE) for source in stack.sources)
    assert all("# assumed" in line for line in text.split("\n") if "thickness = " in line)


def test_stacks_are_no_recipes():
    names = ["heart", "marble-on-potato", "skimmilk-on-marble", "skimmilk-on-potato", "skin"]
    assert [path.stem for path in SHIPPED] == names
    assert not set(available(fits_folder(), "toml")) & {path.stem for path in SHIPPED}


def test_values_are_absorptions(read, tmp_path):
    """Between two spectra, of any layer; the mean stands in the media."""
    Image.fromarray(np.array([[0, 255], [255, 255]], np.uint8)).save(tmp_path / "blood.png")
    stack = read("mu_a = 1\n", 'mu_a = { image = "blood.png", range = [0.1, [0.3, 0.5, 2.1]] }\n')
    assert [medium.layers[1].mu_a for medium in stack.media] == pytest.approx([0.25, 0.4, 1.6])
    for value, expected in ((0.0, [0.1] * 3), (1.0, [0.3, 0.5, 2.1]), (0.5, [0.2, 0.3, 1.1])):
        found = stack.map.media(stack.media, value)
        assert [medium.layers[1].mu_a for medium in found] == pytest.approx(expected)
        assert [replace(medium.layers[1], mu_a=0.0) for medium in found] == [
            replace(medium.layers[1], mu_a=0.0) for medium in stack.media
        ]
        assert [medium.layers[0] for medium in found] == [medium.layers[0] for medium in stack.media]


def test_a_thickness_of_any_layer(read, tmp_path):
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(tmp_path / "thickness.png")
    stack = read("g = 0\n", f"g = 0\n{IMAGE}\n[[layers]]\nn = 1.3\nmu_a = 1\nmu_s = 1\ng = 0\n")
    assert stack.map.layer == 1
    assert [medium.layers[1].thickness for medium in stack.media] == [pytest.approx(0.225)] * 3
    assert [medium.layers[1].thickness for medium in stack.map.media(stack.media, 1.0)] == [0.4] * 3


def test_values_are_thicknesses(of_image, tmp_path):
    """0, half and full scale of each kind; row 0 is the image's first; the mean stands in the media."""
    top, half = np.array([[0.0, 1.0], [1.0, 1.0]]), 0.5
    for name in ("8.png", "16.png", "8.tif", "16.tif"):
        scale, dtype = (255, "u1") if name[0] == "8" else (65535, "u2")
        stack = of_image(Image.fromarray((top * scale).astype(dtype)), name)
        np.testing.assert_array_equal(stack.map.values, top)
        assert (stack.map.values.dtype, stack.map.least, stack.map.most) == (np.float32, 0.05, 0.4)
        assert stack.map.mean == pytest.approx(0.05 + 0.35 * 0.75)
        assert [medium.layers[0].thickness for medium in stack.media] == [stack.map.mean] * 3
        assert not stack.map.values.flags.writeable
        grey = of_image(Image.fromarray(np.full((3, 5), round(half * scale), dtype)), name)
        assert grey.map.values.shape == (3, 5)
        assert grey.map.mean == pytest.approx(0.05 + 0.35 * round(half * scale) / scale, rel=1e-6)
    values = np.array([[0.0, 0.25, 1.0]], np.float32)
    stack = of_image(Image.fromarray(values), "float.tiff")
    np.testing.assert_array_equal(stack.map.values, values)
    assert (stack.map.mean, stack.layers[0]["thickness"]) == (pytest.approx(0.05 + 0.35 * 1.25 / 3.0), stack.map.mean)
    values = np.arange(0, 60000, 1000, dtype=np.uint16).reshape(6, 10)
    image = _tiff(10, 6, 16, values.astype(">u2").tobytes(), order=">")
    np.testing.assert_allclose(of_image(image, "a.tif").map.values, values / 65535.0, rtol=1e-6)


def _png(columns, rows, bits=8, colour=0, data=b"\0"):
    """A PNG that says it is so large."""
    header = struct.pack(">IIBBBBB", columns, rows, bits, colour, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(data)), (b"IEND", b""))
    whole = b"\x89PNG\r\n\x1a\n"
    for name, data in chunks:
        whole += struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    return whole


def _tiff(columns, rows, bits, data, order="<", black=1, sample_format=1, samples=1):
    """A TIFF of one strip."""
    tags = [
        *((256, columns), (257, rows), (258, bits), (259, 1), (262, black), (273, 8), (277, samples), (278, rows)),
        *((279, len(data)), (339, sample_format)),
    ]
    entries = b"".join(struct.pack(f"{order}HHII", tag, 4, 1, value) for tag, value in tags)
    mark = b"II*\0" if order == "<" else b"MM\0*"
    head = struct.pack(f"{order}H", len(tags))
    return mark + struct.pack(f"{order}I", 8 + len(data)) + data + head + entries + bytes(4)


LARGE = [
    *((_png(*size), size) for size in ((10_000, 10_000), (2**31 - 1, 2**31 - 1), (4097, 1))),
    *((_tiff(*size, 8, b""), size) for size in ((9000, 9000), (1, 2**31))),
]


@pytest.mark.parametrize(("image", "size"), LARGE, ids=[str(size) for _, size in LARGE])
def test_too_large_is_refused_undecoded(of_image, monkeypatch, image, size):
    """What a tiny file says, which Pillow's Image.open would warn of."""
    for name in ("ImageFile.ImageFile", "TiffImagePlugin.TiffImageFile"):
        monkeypatch.setattr(f"PIL.{name}.load", lambda self: pytest.fail("it was decoded"))
    refused(lambda: of_image(image), rf"\[layers 1.thickness\] {SIZE}thickness.png of {size[0]} x {size[1]}$")


def _saved(image, kind="PNG", **options):
    file = io.BytesIO()
    image.save(file, kind, **options)
    return file.getvalue()


GREY = Image.new("L", (8, 8), 100)
NOISE = Image.fromarray(np.random.default_rng(1).integers(0, 256, (64, 64), np.uint8))
OTHERS = {
    "colours": (_saved(Image.new("RGB", (2, 2))), KIND + "RGB"),
    "transparent": (_saved(Image.new("LA", (2, 2))), KIND + "LA"),
    "palette": (_saved(Image.new("P", (2, 2))), KIND + "P"),
    "one bit": (_saved(Image.new("1", (2, 2))), KIND + "1"),
    "colours in a TIFF": (_saved(Image.new("RGB", (2, 2)), "TIFF"), KIND + "RGB"),
    "palette in a TIFF": (_saved(Image.new("P", (2, 2)), "TIFF"), KIND + "P"),
    "32-bit whole": (_saved(Image.new("I", (2, 2)), "TIFF"), KIND + "I"),
    "12 bits": (_tiff(2, 2, 12, bytes(6)), KIND + "I;16"),
    "with a sign": (_tiff(2, 2, 8, bytes(4), sample_format=2), KIND + "L"),
    "white is 0": (_tiff(2, 2, 16, bytes(8), black=0), KIND + "I;16"),
    "a signalling NaN": (
        _tiff(1, 1, 32, struct.pack("<I", 0x7F800001), sample_format=3),
        r"image must be an image of values in 0 ... 1, got thickness.png with nan$",
    ),
    "packed": (_saved(GREY, "TIFF", compression="tiff_lzw"), r"be uncompressed if it is a TIFF .* packed by tiff_lzw$"),
    "pages": (_saved(GREY, "TIFF", save_all=True, append_images=[GREY]), SIZE + "thickness.png of several pages"),
    "moves": (_saved(GREY, save_all=True, append_images=[NOISE]), SIZE + "thickness.png of several pages"),
    "JPEG": (_saved(GREY, "JPEG"), SIZE + "thickness.png, which is neither"),
    "text": (b"P2 1 1 255 0", SIZE + "thickness.png, which is neither"),
    "empty": (b"", "a file of at most 64 MiB, got thickness.png of 0 bytes"),
    "nothing behind": (b"\x89PNG\r\n\x1a\n", SIZE + "thickness.png, which is damaged"),
    "no pixels": (_png(0, 0), SIZE + "thickness.png, which is damaged"),
    "fewer pixels": (_png(100, 100), SIZE + "thickness.png, which is damaged"),
    "cut": (_saved(NOISE)[:2000], SIZE + "thickness.png, which is damaged"),
    "cut TIFF": (_tiff(64, 64, 8, bytes(64 * 64))[:3000], SIZE + "thickness.png, which is damaged"),
    "cut strip": (_tiff(64, 64, 8, bytes(100)), SIZE + "thickness.png, which is damaged"),
    "a thousand samples": (_tiff(2, 2, 8, bytes(4), samples=1000), SIZE + "thickness.png, which is damaged"),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_images_are_refused(of_image, capfd, name):
    image, message = OTHERS[name]
    refused(lambda: of_image(image), message)
    assert capfd.readouterr() == ("", ""), "libraries print nothing beside the error"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.001, -1e-3])
def test_values_beyond_the_range_are_refused(of_image, value):
    image = Image.fromarray(np.array([[0.5, value, 0.5]], np.float32))
    words = rf"image must be an image of values in 0 ... 1, got a.tif with {value:g}$"
    refused(lambda: of_image(image, "a.tif"), words)


def test_the_largest_image_and_one_of_no_thickness(of_image, read, monkeypatch):
    """Each lies beside its file, wherever one is."""
    monkeypatch.chdir(Path(__file__).parent)
    assert of_image(GREY, "beside.png").map.mean == pytest.approx(0.05 + 0.35 * 100 / 255)
    stack = of_image(Image.new("L", (4096, 4096), 255))
    assert (stack.map.values.shape, stack.map.mean) == ((4096, 4096), pytest.approx(0.4))
    of_image(Image.new("L", (2, 2), 0))
    message = r"\[layers 1\] thickness must be > 0, or infinite in the last layer, got 0.0"
    refused(lambda: read("thickness = 0.25", IMAGE.replace("0.05", "0")), message)


def test_damaged_images_are_one_line(of_image, capfd):
    """Bytes changed or cut, from a seed: read or refused, and nothing is printed."""
    rng, accepted, told = random.Random(1), 0, []
    values = np.random.default_rng(1).random((16, 16), np.float32)
    wholes = [
        *(_saved(NOISE), _saved(Image.fromarray((values * 65535).astype(np.uint16)))),
        *(_saved(Image.fromarray(values), "TIFF"), _saved(NOISE, "TIFF")),
    ]
    for _ in range(400):
        data = bytearray(rng.choice(wholes))
        for _ in range(rng.randint(1, 4)):
            data[rng.choice((rng.randrange(len(data)), rng.randrange(200)))] = rng.randrange(256)
        if rng.random() < 0.2:
            del data[rng.randrange(len(data)) :]
        try:
            stack = of_image(bytes(data))
        except InputError as error:
            told.append(str(error))
        else:
            accepted += 1
            assert np.all((stack.map.values >= 0) & (stack.map.values <= 1))
    assert all(text.isprintable() for text in told)
    assert accepted > 20  # neither all nor none, or nothing was tried
    assert len(told) > 20
    assert capfd.readouterr() == ("", "")


def test_only_regular_files_of_some_size_are_read(read, tmp_path):
    def by_image(name):
        return lambda: read("thickness = 0.25", IMAGE.replace("thickness.png", name))

    os.mkfifo(tmp_path / "pipe.png")
    with (tmp_path / "large.png").open("wb") as file:
        file.truncate(LARGEST_FILE * 2**20 + 1)
    refused(by_image("absent.png"), SIZE + "absent.png: No such file or directory$")
    refused(by_image("x" * 299), SIZE + "x*: File name too long")
    for name in (r".", "", "/dev/zero", "pipe.png"):
        refused(by_image(name), f"{SIZE}{re.escape(name)}, which is no regular file")
    for name, size in (("/proc/kmsg", 0), ("large.png", 67108865)):
        refused(by_image(name), f"a file of at most 64 MiB, got {name} of {size} bytes")


KEYS = ", ".join(LayerTable.model_fields)
D, A, M = "thickness = 0.25", "mu_a = [0.1, 0.2, 0.3]", "[[layers]]\nn = 1\nmaterial = "
TEXT, RANGE = "must be a text of {} characters at most", r"\[layers 1.thickness\] range must be .* got"
# A piece of the stack, what is said of the first layer, and what takes the piece's place: as it is shown.
IN_FIRST = [
    (D, "thickness must be a number > 0, got", {"-0.1": "-0.1$", "nan": "nan", "true": "True", "[1, 2]": r"\[1, 2\]"}),
    (A, "mu_a must be a coefficient >= 0, or three .*, got", {"": "nothing"}),
    (A, "mu_a must be a coefficient >= 0, or three of", {"[0.1, 0.2, -3]": ""}),
    (A, "mu_a must be .* got", {"[0.1, 0.2]": r"\[0.1, 0.2\]", "inf": "inf"}),
    (A, "mu_a must be .* got", {"[[1, 2, 3]]": r"\[\[1, 2, 3\]\]", "[1, 2, true]": r"\[1, 2, True\]"}),
    ("n = 1.4", "n must be a refractive index > 0, got", {"-1": "-1"}),
    ("n = 1.4", "n must be a finite number, got", {"": "nothing", "[1.4, 1.4, 1.4]": r"\[1.4", "inf": "inf"}),
    ("g = 0.5", "g must be a finite number, got", {"": "nothing"}),
    ("g = 0.5", r"g must be a mean cosine in \(-1, 1\), got", {"1": "1"}),
    ('name = "veil"', f"name {TEXT.format(60)}, got", {'"a\\nb"': r"'a\\nb'", "['veil']": r"\['veil'\]"}),
    ('source = "measured"', f"source {TEXT.format(300)}", {'"\\u001b[31m"': r", got '\\x1b", f'"{"x" * 301}"': ""}),
    ('source = "measured"', f"source {TEXT.format(300)}, got", {"1979-05-27": "datetime"}),
]
WRONG = [
    *(
        (piece, f"{piece.partition(' ')[0]} = {given}" * bool(given), rf"\[layers 1\] {said} ?{got}")
        for piece, said, cases in IN_FIRST
        for given, got in cases.items()
    ),
    *(
        (D, IMAGE.replace(old, new), f"{RANGE} {got}")
        for old, new, got in (
            *(("0.05", "0.5", r"\[0.5, 0.4\]"), ("0.05", "-1", r"\[-1.0, 0.4\]"), ("0.05", "true", r"\[True, 0.4\]")),
            *(("0.4", "inf", r"\[0.05, inf\]"), ("0.4", "nan", r"\[0.05, nan\]")),
            *(("[0.05, 0.4]", "0.4", "0.4"), ("[0.05, 0.4]", "[]", r"\[\]")),
        )
    ),
    (D, "", r"\[layers\] thickness may be infinite in the last layer only, got it in layer 1"),
    (D, "depth = 1", rf"\[layers 1\] keys must be of {KEYS}, got 'depth'"),
    (D, "thickness = {}", r"\[layers 1.thickness\] range must be two numbers >= 0, .* got nothing"),
    (D, "thickness = { range = [0, 1] }", r"\[layers 1.thickness\] image must be .*, got nothing"),
    (D, IMAGE.replace("range", "ranges"), r"\[layers 1.thickness\] keys must be of range, image, got"),
    (D, IMAGE.replace('"thickness.png"', "3"), r"\[layers 1.thickness\] image must be .* got 3"),
    (D, IMAGE.replace(".png", "\\u0000"), r"\[layers 1.thickness\] image must be .*'thickness\\x00'"),
    (D, IMAGE.replace("thickness.png", "x" * 400), r"image must be a grey PNG .* got 'xx*"),
    ("g = 0\n", f"g = 0\n{IMAGE}\n{TWO}", r"\[layers 3\] mu_a must be one number, or three: a file .*, got {"),
    (A, "mu_a = {red = 1}", r"\[layers 1.mu_a\] keys must be of range, image, got 'red'"),
    (A, "mu_a = { range = [0, 1] }", r"\[layers 1.mu_a\] image must be .*, got nothing"),
    *(
        (A, f'mu_a = {{ image = "thickness.png", range = {given} }}', rf"range must be two .*, got {re.escape(given)}")
        for given in ("[0]", "[0, -1]", "[[1, 2], 3]", "[0, nan]")
    ),
    ("mu_s = 9", "mu_s = 9\nmaterial = 'marble'", r"\[layers 1\] material must be left out where mu_a, mu_s, g are"),
    (A, "mu_a = 1e308\n[x]", r"\[layers 1\] mu_s must be a coefficient .*, got nothing"),
    ("", "n = 1", r"table \[\[layers\]\] is missing"),
    *(
        ("", given, rf"layers must be tables \[\[layers\]\], got {got}")
        for given, got in (
            *(("layers = 3", "3"), ("layers = []", r"\[\]"), ("layers = [[]]", r"\[\[\]\]")),
            ("[layers]\nn = 1", "{'n': 1}"),
        )
    ),
    ("", "unit = 3\n[[layers]]\nn = 1", rf"unit {TEXT.format(60)}, got 3"),
    ("", "[[layers]]\nn = 1\nmu_a = 0\nmu_s = 0\ng = 0", r"\[layers\] an infinitely thick layer must scatter"),
    ("", "[[layers]]\nn = 1\nmu_a = 1e308\nmu_s = 1e308\ng = 0", r"\[layers 1\] mu_a \+ mu_s must be finite"),
    ("", "[[layers]]\nmaterial = 'marble'", r"\[layers 1\] n must be a finite number, got nothing"),
    ("", f"{M}'wood'", r"\[layers 1\] material must be one of apple, .*, got 'wood'"),
    ("", f"{M}['marble']", r"\[layers 1\] material must be one of .*, got \['marble'\]"),
    ("", f"unit = 'cm'\n{M}'marble'", 'material must be left out unless unit = "mm", .* got'),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "message"), WRONG, ids=[(new or old).replace("\n", " ")[:40] for old, new, _ in WRONG]
)
def test_mistakes_are_one_line(read, old, new, message):
    refused(lambda: read(old, new), message)


def test_layers_are_counted_before_they_are_looked_at():
    """A million of nothing in particular."""
    many = {"layers": [None] * 10**6}
    refused(lambda: read_layers("skin.toml", many), "^skin.toml: layers must be at most 20, got 1000000$")
