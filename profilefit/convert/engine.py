"""Fields of a renderer for a medium: a colour and a length, by product, version and method, as `engines.toml` has them.

Most engines turn the typed colour into an albedo by a map of their own, so that the number to type is the map's inverse
at the medium's alpha, and not its A. Engines that blur with a profile multiply by the colour: for these it is A under
an index-matched surface, whatever n the medium has. What a renderer then shows is A only where light enters as the map
assumes: `Engine.renders` has what Cycles' walks show instead.

Cycles' four methods have changed their meaning three times since 2.79, as their rows say. bssrdf_setup_radius takes
the radius, radius times scale, times 1 / (4 pi) or as it is; bssrdf_burley_setup, which divides by s(A), has had no
caller since 3.0. Since 4.0 walks enter along the refracted ray, while colours are mapped as if light entered diffusely,
and leave unrefracted: they show less than the A of their medium. Seen from the normal through roughness 1 this is
exact, and agrees with renders of Blender 5.0 to 5.3 within 0.5 %.

Unreal's rasteriser takes a mean free path since 5.1 and a diffuse one before. It draws d = dmfp / s_dmfp(A), dmfp being
mfp s_dmfp(A) / (0.6 s_searchlight(A)): an l of 1 is typed as 0.6. Profiles from before 5.1 were drawn 10/3 wider than
their numbers, as the code that upgrades them says. Its path tracer multiplies by 0.6 again and walks with what was
typed, so that rasteriser and path tracer want different numbers for one medium.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mcml_sim import Setting
from mcml_sim.exact.light import unreduced
from mcml_sim.files.whole_file import parse_toml
from mcml_sim.media.arrays import Floats
from profilefit.convert import lengths
from profilefit.convert.colour import MAPS, mapped_colour, reflectance_of, reflectance_rough, wrenninge_colour
from profilefit.convert.lengths import Factor, Length
from profilefit.laws.diffusion import BeamDiffusion

Colour = Callable[[Floats, float, float], Floats]  # of reduced albedo, index n of the surface, and g
METRES = {"um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}

# Cycles' src/kernel/closure/bssrdf.h, bssrdf_setup_radius: what a radius is multiplied by.
SHRINK = 0.25 / np.pi
# The same file, bssrdf_dipole_compute_alpha_prime.
SKIN_HALVINGS = 12
SKIN_DARKEST, SKIN_BRIGHTEST, SKIN_HIGHEST = 1e-4, 0.995, 0.999999
# src/scene/shader_nodes.cpp: IOR of the Subsurface Scattering node, and Subsurface IOR of Principled.
INDEX = 1.4
# Unity-Technologies/Graphics, .../Runtime/Material/DiffusionProfile/DiffusionProfileSettings.cs: UpdateKernel.
HDRP_SHARE = 0.997
# r/d within which normalized diffusion has that share of its light.
HDRP_REACH = float(brentq(lambda t: 0.25 * np.exp(-t) + 0.75 * np.exp(-t / 3.0) - (1.0 - HDRP_SHARE), 0.0, 100.0))
# Unreal Engine SubsurfaceProfile.cpp: Dmfp2MfpMagicNumber, and SUBSURFACE_KERNEL_SIZE / CmToMm.
UNREAL_MAGIC = 0.6
UNREAL_SHRINK = 3.0 / 10.0


def skin_alpha(colour: ArrayLike, index: float = INDEX) -> Floats:
    """Return the alpha' [-] that Cycles takes a skin's colour for, as coarse as its twelve halvings make it.

    They solve C = alpha'/2 (1 + e^(-4/3 K s)) e^-s, s = sqrt(3 (1 - alpha')): the dipole, Jensen and Buhler 2002.
    """
    a = np.asarray(colour, float)
    low, high = np.zeros_like(a), np.ones_like(a)
    for _ in range(SKIN_HALVINGS):
        middle = 0.5 * (low + high)
        dark = dipole_reflectance(middle, index) < a
        low, high = np.where(dark, middle, low), np.where(dark, high, middle)
    return np.where(a < SKIN_DARKEST, 0.0, np.where(a >= SKIN_BRIGHTEST, SKIN_HIGHEST, middle))


def dipole_reflectance(alpha: ArrayLike, index: float) -> Floats:
    """Return the total reflectance of the standard dipole at reduced albedo alpha' [-] and relative index [-]."""
    values = np.asarray(alpha, float)
    fresnel = -1.440 / index**2 + 0.710 / index + 0.668 + 0.0636 * index
    s = np.sqrt(3.0 * (1.0 - values))
    return 0.5 * values * (1.0 + np.exp(-4.0 / 3.0 * (1.0 + fresnel) / (1.0 - fresnel) * s)) * np.exp(-s)


def _beam_diffusion(alpha: Floats, n: float, g: float) -> Floats:
    """Return A [-] by photon beam diffusion per light that entered, which pbrt inverts; at most 1 can be typed."""
    law = BeamDiffusion(Setting(n=n))
    return np.minimum(np.asarray(law.reflectance(alpha)) / law.entered, 1.0)


# Colours that are typed; "diffuse" and "searchlight" are A under that light and an index-matched surface, "entered" is
# A under a pencil beam and the medium's surface, per light that entered.
COLOURS: dict[str, Colour] = {
    **{name: partial(mapped_colour, name) for name in MAPS},
    "Wrenninge": lambda alpha, n, g: wrenninge_colour(alpha, g),
    "diffuse": lambda alpha, n, g: reflectance_of(alpha, "diffuse", 1.0, g),
    "searchlight": lambda alpha, n, g: reflectance_of(alpha, "searchlight", 1.0, g),
    "beam diffusion": _beam_diffusion,
    "entered": lambda alpha, n, g: (
        reflectance_of(alpha, "searchlight", n, g) / reflectance_of(1.0, "searchlight", n, g)
    ),
    "albedo": lambda alpha, n, g: unreduced(alpha, g),
}
# Lengths that are typed, over l [-]; each row of `engines.toml` has its formula in words.
FACTORS: dict[str, Factor] = {
    "l": lengths.transport,
    "unreduced": lengths.unreduced_path,
    "falloff": partial(lengths.falloff, "diffuse"),
    "Cycles' legacy": lambda alpha, g: lengths.stretch(alpha, g) / SHRINK,
    "Cycles 2": lambda alpha, g: lengths.transport(alpha, g) / SHRINK,
    "Cycles' Burley": lambda alpha, g: lengths.falloff("diffuse", alpha) / SHRINK,
    "Cycles' skin": lambda alpha, g: (
        lengths.classical(skin_alpha(wrenninge_colour(alpha, g)), g) * lengths.stretch(alpha, g)
    ),
    "HDRP's radius": lambda alpha, g: HDRP_REACH * lengths.falloff("diffuse", alpha),
    "HDRP's walk": lambda alpha, g: 1.0 / lengths.scale("diffuse", mapped_colour("Chiang", alpha)),
    "Unreal's": lambda alpha, g: UNREAL_MAGIC * lengths.transport(alpha, g),
    "Unreal's before 5.1": lambda alpha, g: (
        UNREAL_SHRINK * lengths.scale_dmfp(reflectance_of(alpha, "searchlight")) * lengths.falloff("searchlight", alpha)
    ),
    "appleseed's walk of 2017": lambda alpha, g: 1.0 / lengths.scale("searchlight", mapped_colour("Chiang", alpha)),
}
# A [-] of a walk that light enters through the node's surface, refracted, seen from the normal; of the skin's walk half
# of the light enters diffusely.
RENDERS: dict[str, Callable[[Floats], Floats]] = {
    "rough entry": lambda alpha: reflectance_rough(alpha, INDEX),
    "skin entry": lambda alpha: 0.5 * (reflectance_rough(alpha, INDEX) + reflectance_of(alpha, "diffuse")),
}
TYPED_LENGTHS = (
    Length("cycles_radius", FACTORS["unreduced"]),
    Length("cycles_legacy_radius", FACTORS["Cycles' legacy"]),
    Length("cycles_burley_radius", FACTORS["Cycles' Burley"]),
    Length("cycles_skin_radius", FACTORS["Cycles' skin"]),
    Length("hdrp_distance", FACTORS["falloff"]),
    Length("hdrp_radius", FACTORS["HDRP's radius"]),
    Length("unreal_mfp", FACTORS["Unreal's"]),
    Length("unreal_dmfp", FACTORS["Unreal's before 5.1"]),
)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Two numbers that fields of a renderer take for a medium.

    name     key of the row in --json
    version  of the product, that the numbers hold for
    fields   names of the colour, of the length and of the world's scale in the product; the last may be ""
    colour   what is typed; None where no source says
    length   what is typed over the transport mean free path [-]
    power    -1 where the inverse of that length is typed
    unit     that the length's field has; "" for whatever one unit of the scene is
    scale    value of the world's scale with which the field has that unit
    formula  how both numbers follow
    source   of the formulas, with version or date
    checked  against what: source, measurement, an unofficial copy, a manual's wording
    g        range that the product takes, or that the source was read for
    renders  A [-] that it shows of the albedo, seen from the normal, where that is neither its A nor unknown
    """

    name: str
    product: str
    version: str
    method: str
    fields: tuple[str, str, str]
    colour: Colour | None
    length: Factor
    power: int = 1
    unit: str = ""
    scale: float | None = None
    formula: str
    source: str
    checked: str = "source"
    g: tuple[float, float] = (-1.0, 1.0)
    renders: Callable[[Floats], Floats] | None = None

    @property
    def title(self) -> str:
        """Product, version and method."""
        return f"{self.product} {self.version} {self.method}"

    def typed_colour(self, alpha: Floats, n: float = 1.0, g: float = 0.0) -> Floats | None:
        """Return the colour to type [-]: None where no source says, NaN where the product has no such g."""
        if self.colour is None:
            return None
        return np.asarray(self.colour(alpha, n, g)) if self._takes(g) else np.full_like(alpha, np.nan)

    def typed_length(self, alpha: Floats, mfp: Floats, g: float = 0.0, unit: str = "") -> Floats:
        """Return the length to type, of an mfp in this unit; in that of mfp where either has none."""
        if not self._takes(g):
            return np.full_like(alpha, np.nan)
        units = METRES[unit] / METRES[self.unit] if unit and self.unit else 1.0
        return (units * mfp * self.length(alpha, g)) ** self.power

    def rendered(self, alpha: Floats, g: float = 0.0) -> Floats | None:
        """Return the A [-] that the product shows of this medium; None where that is its A, or unknown."""
        return self.renders(alpha) if self.renders and g == 0.0 else None

    def _takes(self, g: float) -> bool:
        return self.g[0] <= g <= self.g[1]


def _engines() -> Iterator[Engine]:
    """Yield the rows of `engines.toml` in order, each with what its product's rows share and the functions it names."""
    products = parse_toml((resources.files("profilefit.convert") / "engines.toml").read_bytes())
    for product in products.values():
        for own in product.pop("rows"):
            row: dict[str, Any] = {"colour": None, "renders": None, **product, **own}
            row |= {key: tuple(row[key]) for key in ("fields", "g") if key in row}
            row |= {key: table[row[key]] for key, table in (("colour", COLOURS), ("renders", RENDERS)) if row[key]}
            yield Engine(**{**row, "length": FACTORS[row["length"]]})


ENGINES = tuple(_engines())
