"""STACK.toml: layers from the surface down in red, green and blue, read and checked; one quantity may be an image.

    unit = "mm"

    [[layers]]
    name = "epidermis"
    n = 1.4
    mu_a = [0.21, 0.21, 0.50]  # red, green, blue [1/mm]; one number is that of all three
    mu_s = [4.8, 6.0, 6.5]
    g = 0.0
    thickness = { image = "thickness.png", range = [0.05, 0.4] }  # or mu_a, between two spectra

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
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL.ImageFile import ImageFile
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import BITSPERSAMPLE, PHOTOMETRIC_INTERPRETATION, SAMPLEFORMAT, TiffImageFile
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)

from mcml_sim import Layer, Medium
from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.arrays import is_number
from profilefit.errors import InputError
from profilefit.materials import BY_NAME, SOURCE, Material
from profilefit.recipes.declared import LISTED, Declared, Line, OneOf, Range, Refused, Table, Text, words

Floats = NDArray[np.float32]
Media = tuple[Medium, Medium, Medium]  # of red, green and blue
Refusal = Callable[..., InputError]
BY_MATERIAL = ("mu_a", "mu_s", "g")  # what a material says
MAPPED = ("thickness", "mu_a")  # what may be an image
UNIT = "mm"  # of the materials, and of a file that names none
MOST_LAYERS = 20  # as many as the exact light of a stack has
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
    """The thickness of a layer from place to place: least + (most - least) values.

    values       (rows, columns) in [0, 1], read-only; row 0 is at the top of the image
    least, most  thickness where the value is 0 and where it is 1 [unit of the stack]
    layer        its number, from 0 at the surface
    """

    values: Floats
    least: float
    most: float
    layer: int = 0

    @property
    def mean(self) -> float:
        """The mean thickness of all pixels [unit of the stack]."""
        return self.least + (self.most - self.least) * float(self.values.mean(dtype=np.float64))

    def media(self, media: Media, value: float) -> Media:
        """Return the media of red, green and blue where the map has a value."""
        thickness = self.least + (self.most - self.least) * value
        return _changed(media, self.layer, [{"thickness": thickness}] * 3)


@dataclass(frozen=True, eq=False)
class AbsorptionMap:
    """The absorption of a layer from place to place, as by a share of melanin or blood: least + (most - least) values.

    values       (rows, columns) in [0, 1], read-only; row 0 is at the top of the image
    least, most  mu_a in red, green and blue where the value is 0 and where it is 1 [1/unit of the stack]
    layer        its number, from 0 at the surface
    """

    values: Floats
    least: tuple[float, float, float]
    most: tuple[float, float, float]
    layer: int = 0

    @property
    def mean(self) -> tuple[float, float, float]:
        """The mean mu_a of all pixels [1/unit of the stack]."""
        return self._at(float(self.values.mean(dtype=np.float64)))

    def media(self, media: Media, value: float) -> Media:
        """Return the media of red, green and blue where the map has a value."""
        return _changed(media, self.layer, [{"mu_a": mu_a} for mu_a in self._at(value)])

    def _at(self, value: float) -> tuple[float, float, float]:
        red, green, blue = ((1.0 - value) * a + value * b for a, b in zip(self.least, self.most, strict=True))
        return red, green, blue


LayerMap = ThicknessMap | AbsorptionMap


def _changed(media: Media, number: int, changes: list[dict[str, Any]]) -> Media:
    def changed(medium: Medium, change: dict[str, Any]) -> Medium:
        layers = list(medium.layers)
        layers[number] = replace(layers[number], **change)
        return replace(medium, layers=tuple(layers))

    red, green, blue = map(changed, media, changes)
    return red, green, blue


@dataclass(frozen=True)
class LayerStack:
    """Layers of a file.

    unit     of lengths; coefficients are in 1/unit
    media    of red, green and blue light, equal where every coefficient is one number; air above and below
    names    one a layer; that of its material where the file gives none, or ""
    sources  one a layer: where its numbers are from, or ""
    map      a layer's thickness or absorption where it is an image, whose mean stands in the media; or None
    """

    unit: str
    media: Media
    names: tuple[str, ...]
    sources: tuple[str, ...]
    map: LayerMap | None = None

    @property
    def is_grey(self) -> bool:
        """Return whether the three colours are one."""
        return self.media[0] == self.media[1] == self.media[2]

    @property
    def layers(self) -> list[dict[str, Any]]:
        """Plain data, a dict a layer: mu_a and mu_s three numbers each [1/unit]; thickness [unit], None if infinite."""
        colours = (medium.layers for medium in self.media)
        return [
            {
                **{"name": name, "n": red.n, "g": red.g, "source": source},
                **{"mu_a": [red.mu_a, green.mu_a, blue.mu_a], "mu_s": [red.mu_s, green.mu_s, blue.mu_s]},
                "thickness": red.thickness if math.isfinite(red.thickness) else None,
            }
            for name, source, red, green, blue in zip(self.names, self.sources, *colours, strict=True)
        ]


COLOURS = "a coefficient >= 0, or three of red, green and blue"
ONE: Table = {"type": "number", "minimum": 0}
THREE: Table = {"type": "array", "items": ONE, "minItems": 3, "maxItems": 3}
THRICE = BeforeValidator(lambda value: [value] * 3 if is_number(value) else value)
OF_COLOURS = WithJsonSchema({"accepted": COLOURS, "anyOf": [ONE, THREE]})
Coefficient = Annotated[float, Field(ge=0.0)]
Colours = Annotated[tuple[Coefficient, Coefficient, Coefficient], LISTED, THRICE, OF_COLOURS]


class ImageTable(Declared):
    """Thickness by an image, looked for beside the file: `range` holds where the value is 0 and where it is 1."""

    range: Annotated[Range, LISTED, words("two numbers >= 0, the smaller first")]
    image: Annotated[Line, words(IMAGE)]
    _map: ThicknessMap = PrivateAttr()

    @model_validator(mode="after")
    def _read(self, info: ValidationInfo) -> Self:
        least, most = self.range
        if not 0.0 <= least < most:
            raise Refused("two numbers >= 0, the smaller first", [least, most], "range")
        self._map = ThicknessMap(_values(Path(str(info.context)).parent, self.image), least, most)
        return self


class AbsorptionTable(Declared):
    """Absorption by an image, looked for beside the file: `range` holds where the value is 0 and where it is 1."""

    range: Annotated[tuple[Colours, Colours], LISTED, words("two coefficients, each one number or three")]
    image: Annotated[Line, words(IMAGE)]
    _map: AbsorptionMap = PrivateAttr()

    @model_validator(mode="after")
    def _read(self, info: ValidationInfo) -> Self:
        self._map = AbsorptionMap(_values(Path(str(info.context)).parent, self.image), *self.range)
        return self


class LayerTable(Declared):
    """Table [[layers]]: a layer in red, green and blue, its coefficients given or those of a material."""

    name: Text | None = None
    material: Annotated[str, OneOf(*BY_NAME)] | None = None
    n: float
    mu_a: (
        Annotated[
            Annotated[Colours, Tag("[number]")] | Annotated[AbsorptionTable, Tag("[image]")],
            Discriminator(lambda value: "[image]" if isinstance(value, dict) else "[number]"),
        ]
        | None
    ) = None
    mu_s: Colours | None = None
    g: float | None = None
    thickness: Annotated[
        Annotated[Annotated[float, Field(gt=0.0, allow_inf_nan=True)], Tag("[number]")]
        | Annotated[ImageTable, Tag("[image]")],
        Discriminator(lambda value: "[image]" if isinstance(value, dict) else "[number]"),
    ] = math.inf
    source: Line | None = None
    _colours: tuple[Layer, ...] = PrivateAttr()

    def map(self, number: int) -> LayerMap | None:
        """Return the image of one of its quantities, of a layer of that number."""
        tables = (one for one in (self.thickness, self.mu_a) if isinstance(one, ImageTable | AbsorptionTable))
        return next((replace(table._map, layer=number) for table in tables), None)

    @property
    def published(self) -> Material | None:
        """Published material, whose scattering is the reduced one."""
        return None if self.material is None else BY_NAME[self.material]

    @model_validator(mode="after")
    def _sound(self) -> Self:
        given = [key for key in BY_MATERIAL if getattr(self, key) is not None]
        if self.material is None:
            for key in BY_MATERIAL:
                if key not in given:
                    raise Refused("a finite number" if key == "g" else COLOURS, None, key)
        elif given:
            raise Refused(f"left out where {', '.join(given)} are given", self.material, "material")
        known = self.published
        mu_a, mu_s = (self.mu_a, self.mu_s) if known is None else (known.absorption, known.scattering)
        assert mu_a is not None
        assert mu_s is not None
        mu_a = mu_a._map.mean if isinstance(mu_a, AbsorptionTable) else mu_a
        d = self.thickness._map.mean if isinstance(self.thickness, ImageTable) else self.thickness
        self._colours = tuple(Layer(self.n, a, s, self.g or 0.0, d) for a, s in zip(mu_a, mu_s, strict=True))
        return self


def _few(content: Any) -> Any:
    """Return tables [[layers]] before they are looked at; Refused where they are none, too many, or of several maps."""
    if isinstance(content, list) and len(content) > MOST_LAYERS:
        raise Refused(f"at most {MOST_LAYERS}", len(content))
    if not isinstance(content, list) or not content or not all(isinstance(layer, dict) for layer in content):
        raise Refused("tables [[layers]]", content)
    images = [
        (number, key) for number, layer in enumerate(content) for key in MAPPED if isinstance(layer.get(key), dict)
    ]
    for number, key in images[1:]:
        raise Refused("one number, or three: a file has one image at most", content[number][key], number, key)
    return content


def _media(layers: tuple[LayerTable, ...]) -> tuple[Medium, Medium, Medium]:
    red, green, blue = (Medium(colour) for colour in zip(*(layer._colours for layer in layers), strict=True))
    return red, green, blue


def _stacked(layers: tuple[LayerTable, ...]) -> tuple[LayerTable, ...]:
    _media(layers)
    return layers


class Layered(Declared):
    """File with tables [[layers]], from the surface down, and the unit of its lengths."""

    unit: Text = UNIT
    layers: Annotated[tuple[LayerTable, ...], LISTED, BeforeValidator(_few), AfterValidator(_stacked)]

    @model_validator(mode="after")
    def _in_millimetres(self) -> Self:
        for number, layer in enumerate(self.layers):
            if layer.material is not None and self.unit != UNIT:
                accepted = f'left out unless unit = "{UNIT}", that of its coefficients'
                raise Refused(accepted, layer.material, "layers", number, "material")
        return self

    @cached_property
    def stack(self) -> LayerStack:
        """Layers in red, green and blue."""
        known = [(layer.name, layer.source, layer.published) for layer in self.layers]
        return LayerStack(
            self.unit,
            _media(self.layers),
            tuple(name if name is not None else of.name if of else "" for name, _, of in known),
            tuple(source if source is not None else SOURCE if of else "" for _, source, of in known),
            next((found for number, layer in enumerate(self.layers) if (found := layer.map(number))), None),
        )


def read_layers(file: Path | str, content: Table) -> LayerStack:
    """Read the stack of a file's content; only the keys `unit` and `layers` are looked at.

    InputError in one line that names file, table and key, what was got and what is accepted.
    """
    return Layered.of(str(file), {key: content[key] for key in ("unit", "layers") if key in content}).stack


def _values(folder: Path, name: str) -> Floats:
    """Return an image's values over their full scale; floating-point values are returned as they are."""

    def refused(got: str, accepted: str = IMAGE) -> InputError:
        return InputError(f"image must be {accepted}, got {name}{got}")

    content = _bytes(folder / name, refused)
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
    is_grey = image.mode in GREY_PNG
    if isinstance(image, TiffImageFile):
        tags = image.tag_v2
        kind_of = tags.get(PHOTOMETRIC_INTERPRETATION), tags.get(SAMPLEFORMAT, (1,)), tags.get(BITSPERSAMPLE)
        is_grey = kind_of in GREY_TIFF
    if not is_grey:
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


def _bytes(path: Path, refused: Refusal) -> bytes:
    """Read all of a regular file: a pipe would be waited for, and a device has no end."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise refused(f": {getattr(error, 'strerror', None) or error}") from None
    if not stat.S_ISREG(status.st_mode):
        raise refused(", which is no regular file")
    if not 0 < status.st_size <= LARGEST_FILE * 2**20:  # of no bytes are the files of /proc, some of which never end
        raise refused(f" of {status.st_size} bytes", f"a file of at most {LARGEST_FILE} MiB")
    return read_whole(path, LARGEST_FILE * 2**20)


@contextmanager
def _sound(refused: InputError) -> Iterator[None]:
    """Raise the error that is given, whatever Pillow raises at a damaged file, and hide Pillow's warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            yield
        except Exception:
            raise refused from None
