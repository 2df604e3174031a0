"""Entries: facts about a law beside its formula, from which every list of laws is derived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, ends included unless open."""

    low: float = 0.0
    high: float = 1.0
    open_low: bool = False
    open_high: bool = False

    def holds(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the values inside."""
        given = np.asarray(values)
        above = given > self.low if self.open_low else given >= self.low
        return above & (given < self.high if self.open_high else given <= self.high)

    def __str__(self) -> str:
        return f"{'(' if self.open_low else '['}{self.low:g}, {self.high:g}{')' if self.open_high else ']'}"


EVERYWHERE = Range()
MATCHED, ANY_INDEX = Range(1.0, 1.0), Range(0.0, np.inf, open_low=True, open_high=True)
ISOTROPIC = Range(0.0, 0.0)
# Arguments that a shader source replaces by others, in words.
NEAR_CLAMPS = "R_d within 1e-6 mfp of the source to that at 1e-6 mfp; xi to 1 - 2^-24"
CLAMPS = f"{NEAR_CLAMPS}; r to 1e8 mfp"
RATIONAL, WRAPPERS = ("rational",), ("wrappers",)


@dataclass(frozen=True)
class Text:
    """The shader source of a law, in files of `profilefit/shader/glsl/`, by their names less .glsl.

    file    its own; `profilefit.shader.emit.prefix` is its name, too
    parts   files that it needs, before it in order; ends files that need it
    clamps  arguments besides A that the source replaces by others, in words
    count   how often its `//% for` blocks stand
    prefix  of its names, if not its file's name
    """

    file: str
    parts: tuple[str, ...] = RATIONAL
    ends: tuple[str, ...] = WRAPPERS
    clamps: str = ""
    count: int = 0
    prefix: str = ""


@dataclass(frozen=True)
class Entry:
    """A law or map as catalogue, recipes, shaders and reports know it.

    name     by which it is loaded, as in the tables of `profilefit.laws`; title what a reader calls it
    is_map   whether it maps between alpha and A, and is no profile
    records  names for Setting() of the records that make up its regenerated constants; a later one adds to earlier ones
    start    constants to fit from where none are printed
    alpha    albedos [-] that it holds for; profile those of its R_d, if not all of them
    xi       shares [-] that its sampler holds for; of fitted constants: print promises all
    n        refractive indices [-] that it is made for; g mean cosines
    as_fitted  whether a fitted inverse of it holds only for the albedos of its record
    own      whether it is this project's own, and must hold wherever it claims to
    text     its shader source, or why there is none
    """

    name: str = ""
    title: str = ""
    is_map: bool = False
    records: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    alpha: Range = EVERYWHERE
    profile: Range = EVERYWHERE
    xi: Range = EVERYWHERE
    n: Range = MATCHED
    g: Range = ISOTROPIC
    as_fitted: bool = False
    own: bool = False
    text: Text | str = ""

    @property
    def key(self) -> str:
        """A name that no other law or map has: "albedo liang" is the map beside the profile law."""
        return f"albedo {self.name}" if self.is_map else self.name

    @property
    def printed(self) -> str:
        """Name among the printed sets of `laws.published`."""
        return f"{self.name}_albedo" if self.is_map else self.name

    @property
    def has_text(self) -> bool:
        """True if it has a shader source."""
        return isinstance(self.text, Text)
