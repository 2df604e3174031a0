"""STACK.toml: layers from the surface down in red, green and blue, read and checked; a thickness may be an image.

    unit = "mm"

    [[layers]]
    name = "epidermis"
    n = 1.4
    mu_a = [0.21, 0.21, 0.50]  # red, green, blue [1/mm]; one number is that of all three
    mu_s = [4.8, 6.0, 6.5]
    g = 0.0
    thickness = { image = "thickness.png", range = [0.05, 0.4] }

    [[layers]]
    material = "marble"  # of profilefit.materials, in place of mu_a, mu_s and g
    n = 1.5

Light comes and goes through air, above the first layer and below the last one.
"""

from __future__ import annotations

import io
import logging
import math
import stat
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL.ImageFile import ImageFile
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import BITSPERSAMPLE, PHOTOMETRIC_INTERPRETATION, SAMPLEFORMAT, TiffImageFile

from mcml_sim import Layer, Medium
from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.checks import is_number
from profilefit.errors import InputError
from profilefit.materials import BY_NAME, SOURCE
from profilefit.recipes.toml_tables import Table, Tables

Floats = NDArray[np.float32]
Three = tuple[float, float, float]
Refusal = Callable[..., InputError]
LAYER_KEYS = ("name", "material", "n", "mu_a", "mu_s", "g", "thickness", "source")
BY_MATERIAL = ("mu_a", "mu_s", "g")  # what a material says
UNIT = "mm"  # of the materials, and of a file that names none
MOST_LAYERS = 20  # as many as the exact light of a stack has
LONGEST_LINE = 300  # characters of a source and of an image's path
LARGEST_SIDE = 4096  # of an image [pixels]
LARGEST_FILE = 64  # of an image [MiB]
IMAGE = f"a grey PNG or TIFF of at most {LARGEST_SIDE} x {LARGEST_SIDE} pixels"
# The two classes of Pillow by what a file begins with, rather than Image.open, which warns of large images or refuses
# them before their size can be told.
KINDS: tuple[tuple[bytes, type[ImageFile]], ...] = (
    (b"\x89PNG\r\n\x1a\n", PngImageFile),
    *((magic, TiffImageFile) for magic in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")),
)
GREY_PNG = ("L", "I;16")  # Pillow's names of 2 to 8 bits, which it scales to 8, and of 16
# Photometric interpretation (1: black is 0), sample format (1: whole, 3: floating point), and bits. Pillow takes more
# for grey: values of 12 bits, or with a sign, whose full scale is another; 16 bits of which white is 0, not inverted.
GREY_TIFF = ((1, (1,), (8,)), (1, (1,), (16,)), (1, (3,), (32,)))
FULL_SCALE = {"u1": 255.0, "u2": 65535.0}
logging.getLogger("PIL").addHandler(logging.NullHandler())  # else some of its errors are lines on stderr beside ours


@dataclass(frozen=True, eq=False)
class ThicknessMap:
    """The thickness of a first layer from place to place: least + (most - least) values.

    values       (rows, columns) in [0, 1], read-only; row 0 is at the top of the image
    least, most  thickness where the value is 0 and where it is 1 [unit of the stack]
    """

    values: Floats
    least: float
    most: float

    @property
    def mean(self) -> float:
        """The mean thickness of all pixels [unit of the stack]."""
        return self.least + (self.most - self.least) * float(self.values.mean(dtype=np.float64))


@dataclass(frozen=True)
class LayerStack:
    """Layers of a file.

    unit     of lengths; coefficients are in 1/unit
    media    of red, green and blue light, equal where every coefficient is one number; air above and below
    names    one a layer; that of its material where the file gives none, or ""
    sources  one a layer: where its numbers are from, or ""
    map      the first layer's thickness where it is an image, whose mean stands in the media; or None
    """

    unit: str
    media: tuple[Medium, Medium, Medium]
    names: tuple[str, ...]
    sources: tuple[str, ...]
    map: ThicknessMap | None = None

    @property
    def is_grey(self) -> bool:
        """Return whether the three colours are one."""
        return self.media[0] == self.media[1] == self.media[2]

    @property
    def layers(self) -> list[dict[str, Any]]:
        """Plain data, a dict a layer: mu_a and mu_s three numbers each [1/unit]; thickness [unit], None if infinite."""
        told = []
        for name, source, *colours in zip(
            self.names, self.sources, *(medium.layers for medium in self.media), strict=True
        ):
            first = colours[0]
            told.append(
                {
                    "name": name,
                    "n": first.n,
                    "mu_a": [one.mu_a for one in colours],
                    "mu_s": [one.mu_s for one in colours],
                    "g": first.g,
                    "thickness": first.thickness if math.isfinite(first.thickness) else None,
                    "source": source,
                }
            )
        return told


class _LayerTable(NamedTuple):
    """One [[layers]] of a file, as read.

    Attributes:
        colours: the layer in red, green and blue.
        name: name of the layer, "" for none.
        source: source of the numbers, in words.
        map: image of the thickness, or None.
    """

    colours: tuple[Layer, ...]
    name: str
    source: str
    map: ThicknessMap | None


def read_layers(file: Path | str, content: Table) -> LayerStack:
    """Read the stack of a file's content; only the keys `unit` and `layers` are looked at.

    InputError in one line that names file, table and key, what was got and what is accepted.
    """
    tables = Tables(str(file), {})
    if "layers" not in content:
        raise InputError(f"{file}: table [[layers]] is missing")
    return stack_of(tables, content["layers"], tables.text("", "unit", content, UNIT))


def stack_of(tables: Tables, content: Any, unit: str = UNIT) -> LayerStack:
    """Return the stack of a list of tables [[layers]] in the file that `tables` names, with lengths in `unit`.

    An image is looked for beside that file. InputError as for `read_layers`.
    """
    if not isinstance(content, list):
        raise tables.bad("", "layers", "tables [[layers]]", content)
    if len(content) > MOST_LAYERS:
        raise tables.bad("", "layers", f"at most {MOST_LAYERS}", len(content))
    if not content or not all(isinstance(layer, dict) for layer in content):
        raise tables.bad("", "layers", "tables [[layers]]", content)
    rows = [_layer(tables, number, layer, unit) for number, layer in enumerate(content, start=1)]
    red, green, blue = (
        tables.build("layers", partial(Medium, colour)) for colour in zip(*(row.colours for row in rows), strict=True)
    )
    return LayerStack(
        unit, (red, green, blue), tuple(row.name for row in rows), tuple(row.source for row in rows), rows[0].map
    )


def _layer(tables: Tables, number: int, table: Table, unit: str) -> _LayerTable:
    where = f"layers {number}"
    tables.known(where, table, LAYER_KEYS)
    n = _number(tables, where, "n", table)
    if "material" in table:
        name, source, mu_a, mu_s, g = _of_material(tables, where, table, unit)
    else:
        name, source = "", ""
        mu_a, mu_s = (_colours(tables, where, key, table) for key in ("mu_a", "mu_s"))
        g = _number(tables, where, "g", table)
    thickness, image = table.get("thickness"), None
    if isinstance(thickness, dict):
        if number > 1:
            raise tables.bad(where, "thickness", "a number > 0 below the first layer", thickness)
        image = _map(tables, where, thickness)
        d = image.mean
    else:
        d = tables.number(where, "thickness", table, math.inf)
    layers = tuple(tables.build(where, partial(Layer, n, a, s, g, d)) for a, s in zip(mu_a, mu_s, strict=True))
    return _LayerTable(
        layers,
        tables.text(where, "name", table, name),
        _line(tables, where, "source", table.get("source", source)),
        image,
    )


def _number(tables: Tables, where: str, key: str, table: Table) -> float:
    """Return a number; `Layer` checks whether such a layer can exist."""
    value = table.get(key)
    if not is_number(value):
        raise tables.bad(where, key, "a number", value)
    return float(value)


def _colours(tables: Tables, where: str, key: str, table: Table) -> Three:
    """Return a coefficient of red, green and blue [1/unit]."""
    value = table.get(key)
    if value is None:
        raise tables.bad(where, key, "a number", value)
    numbers = value if isinstance(value, list) else [value] * 3
    if len(numbers) != 3 or not all(is_number(one) and 0 <= one < math.inf for one in numbers):
        raise tables.bad(where, key, "a coefficient >= 0, or three of red, green and blue", value)
    red, green, blue = map(float, numbers)
    return red, green, blue


def _of_material(tables: Tables, where: str, table: Table, unit: str) -> tuple[str, str, Three, Three, float]:
    """Name, source, mu_a, mu_s [1/mm] and g of a published material: its scattering is the reduced one."""
    if given := [key for key in BY_MATERIAL if key in table]:
        raise tables.bad(where, "material", f"left out where {', '.join(given)} are given", table["material"])
    if unit != UNIT:
        accepted = f'left out unless unit = "{UNIT}", that of its coefficients'
        raise tables.bad(where, "material", accepted, table["material"])
    known = BY_NAME[tables.text(where, "material", table, accepted=tuple(BY_NAME))]
    return known.name, SOURCE, known.absorption, known.scattering, 0.0


def _line(tables: Tables, where: str, key: str, value: object) -> str:
    """Return the value if it is a text of one printable line."""
    if not isinstance(value, str) or not value.isprintable() or len(value) > LONGEST_LINE:
        raise tables.bad(where, key, f"a text of {LONGEST_LINE} characters at most", value)
    return value


def _map(tables: Tables, where: str, table: Table) -> ThicknessMap:
    tables.known(f"{where}.thickness", table, ("image", "range"))
    ends = table.get("range")
    numbers = isinstance(ends, list) and len(ends) == 2 and all(is_number(end) for end in ends)
    least, most = map(float, ends) if numbers and ends else (0.0, 0.0)
    if not 0 <= least < most < math.inf:
        raise tables.bad(where, "thickness.range", "two numbers >= 0, the smaller first", ends)
    if "image" not in table:
        raise tables.bad(where, "thickness.image", IMAGE, None)
    return ThicknessMap(_values(tables, where, _line(tables, where, "thickness.image", table["image"])), least, most)


def _values(tables: Tables, where: str, name: str) -> Floats:
    """Return an image's values over their full scale; floating-point values are returned as they are."""

    def refused(got: str, accepted: str = IMAGE) -> InputError:
        return InputError(f"{tables.file}: [{where}] thickness.image must be {accepted}, got {name}{got}")

    content = _bytes(tables, where, Path(tables.file).parent / name, refused)
    kind = next((kind for magic, kind in KINDS if content.startswith(magic)), None)
    if kind is None:
        raise refused(", which is neither")
    with _sound(refused(", which is damaged")):
        image = kind(io.BytesIO(content))
    if max(image.size) > LARGEST_SIDE:
        raise refused(f" of {image.size[0]} x {image.size[1]}")
    if getattr(image, "is_animated", False):  # n_frames would read all of a million pages
        raise refused(" of several pages")
    if isinstance(image, TiffImageFile) and image.info["compression"] != "raw":
        # libtiff unpacks those, which writes lines to stderr where a file is damaged.
        raise refused(f" packed by {image.info['compression']}", "uncompressed if it is a TIFF (a PNG may be packed)")
    if not _is_grey(image):
        raise refused(f" of another kind (Pillow's {image.mode})", "8- or 16-bit grey, or a TIFF of float32")
    with _sound(refused(", which is damaged")):
        found = np.asarray(image)
    with np.errstate(invalid="ignore"):  # a signalling NaN
        values = np.array(found, np.float32) / np.float32(FULL_SCALE.get(found.dtype.str[1:], 1.0))
        wrong = values[~((values >= 0) & (values <= 1))]
    if wrong.size:
        raise refused(f" with {wrong[0]:g}", "an image of values in 0 ... 1")
    values.setflags(write=False)
    return values


def _bytes(tables: Tables, where: str, path: Path, refused: Refusal) -> bytes:
    """Read all of a regular file: a pipe would be waited for, and a device has no end."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise refused(f": {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise refused(", which is no regular file")
    if not 0 < status.st_size <= LARGEST_FILE * 2**20:  # of no bytes are the files of /proc, some of which never end
        raise refused(f" of {status.st_size} bytes", f"a file of at most {LARGEST_FILE} MiB")
    return tables.build(where, lambda: read_whole(path, LARGEST_FILE * 2**20))


def _is_grey(image: ImageFile) -> bool:
    if not isinstance(image, TiffImageFile):
        return image.mode in GREY_PNG
    tags = image.tag_v2
    kind = (tags.get(PHOTOMETRIC_INTERPRETATION), tags.get(SAMPLEFORMAT, (1,)), tags.get(BITSPERSAMPLE))
    return kind in GREY_TIFF


@contextmanager
def _sound(refused: InputError) -> Iterator[None]:
    """Raise the error that is given, whatever Pillow raises at a damaged file, and hide Pillow's warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        except Exception:
            raise refused from None
