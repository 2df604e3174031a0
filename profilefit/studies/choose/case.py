"""One view of a material: what an error is predicted and measured for.

The ways to scatter light that are chosen from, none of them more than a few lines of a shader, are its options.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mcml_sim.media.arrays import Floats, require
from profilefit.laws.base import ProfileLaw

SAMPLES = (4, 8, 16, 32, 64, 128, 256)
TAPS = (9, 17, 33)
GAUSSIANS = (2, 3, 4)
GAUSSIAN_TAPS = (17, 33)


@dataclass(frozen=True)
class Option:
    """A way to scatter light.

    kind    "nothing", Lambert; "separable", the skin kernel stretched to the material; "gaussians", a filter for each
            of `count`; "sampled", a law's radii
    number  of taps or samples;  law  that is sampled, with the name of its record
    """

    kind: str
    number: int = 0
    count: int = 1
    law: ProfileLaw | None = None
    name: str = ""

    @property
    def label(self) -> str:
        """Name in a table."""
        of_filters = {
            "nothing": "nothing (Lambert)",
            "separable": f"separable, {self.number} taps",
            "gaussians": f"{self.count} Gaussians, {self.number} taps each",
        }
        return of_filters.get(self.kind, f"{self.name}, {self.number} samples")


NOTHING = Option("nothing")


def filters() -> list[Option]:
    """Return Lambert and all filters."""
    separable = [Option("separable", taps) for taps in TAPS]
    gaussians = [Option("gaussians", taps, count) for count in GAUSSIANS for taps in GAUSSIAN_TAPS]
    return [NOTHING, *separable, *gaussians]


def sampled(law: ProfileLaw, name: str) -> list[Option]:
    """Return the options of a law, one for each number of samples."""
    return [Option("sampled", samples, law=law, name=name) for samples in SAMPLES]


def is_filter(option: Option) -> bool:
    """Return whether an option blurs along rows and columns, without noise."""
    return option.kind in ("separable", "gaussians")


PLACES = 16  # on either side of the edge: their root mean square is within 2 % of that of all pixels
STEEPEST = math.radians(60.0)  # beyond, a pixel shows twice its own side of the surface, and no edge is looked at


@dataclass(frozen=True)
class Within:
    """Places that count: those within `mfp` mean free paths of the edge, and at least so many `pixels` of it."""

    mfp: float = 4.0
    pixels: int = 2

    def __post_init__(self) -> None:
        require(0 < self.mfp <= 100, "within.mfp", "a number of mean free paths in (0, 100]", self.mfp)
        require(1 <= self.pixels <= 100, "within.pixels", "a whole number in 1 ... 100", self.pixels)


@dataclass(frozen=True)
class Case:
    """A step edge of light along a cylinder that is seen from afar, the edge in the middle, between two pixels.

    reflectance  A of the three channels [-];  mfp  of the same [length]
    pixel        its side;  radius  of the cylinder, infinite for a plane [length]
    kernel       A that a filter is made for, of which there is one for a whole picture; by default `reflectance`
    window       half the width and height of what is seen, the edge in the middle [length]
    """

    reflectance: tuple[float, ...]
    mfp: tuple[float, ...]
    pixel: float
    radius: float = math.inf
    kernel: tuple[float, ...] | None = None
    window: tuple[float, float] = (math.inf, math.inf)

    @property
    def longest(self) -> int:
        """The channel whose radii all three gather with: of the longest mean free path."""
        return int(np.argmax(self.mfp))

    @property
    def filter_reflectance(self) -> tuple[float, ...]:
        return self.reflectance if self.kernel is None else self.kernel

    @property
    def is_flat(self) -> bool:
        return math.isinf(self.radius)

    def flat(self) -> Case:
        """Return this case on a plane."""
        return replace(self, radius=math.inf)

    def places(self, channel: int, within: Within) -> Floats:
        """Return distances from the edge on the screen (m,) of the pixels on the lit side that count, PLACES at most.

        Those on the dark side are as wrong, with the other sign.
        """
        reach = max(within.mfp * self.mfp[channel], within.pixels * self.pixel)
        if not self.is_flat:
            reach = self.radius * math.sin(min(reach / self.radius, STEEPEST))
        count = max(int(reach / self.pixel + 1e-9), 1)
        chosen = np.unique(np.linspace(0.0, count - 1.0, min(count, PLACES)).round())
        return (chosen + 0.5) * self.pixel
