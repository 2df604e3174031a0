"""Radius and colour of Blender's Cycles, whose four methods have changed their meaning three times since 2.79.

bssrdf_setup_radius multiplies the radius, radius times scale, by 1 / (4 pi) or by nothing. Until 2.93 both methods had
the factor. Since 3.0 Christensen-Burley's d has it and is no longer divided by s(A): bssrdf_burley_setup, which does
that, has no caller. The walk has it as Random Walk (Fixed Radius) of 3.x, Random Walk of 4.0 to 5.1 and Random Walk
(Legacy) since 5.2. Random Walk since 5.2 has none: the typed radius is the mean free path.

Since 4.0 walks enter along the refracted ray, while colours are mapped as if light entered diffusely, and leave
unrefracted: they show less than the A of their medium. Seen from the normal through roughness 1 this is exact
(`Engine.renders`), and agrees with renders of Blender 5.0 to 5.3 within 0.5 %.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.convert.colour import reflectance_of, reflectance_rough
from profilefit.convert.engine import Engine, by, diffuse
from profilefit.convert.lengths import Length, classical, falloff_diffuse, stretch, transport, unreduced_path
from profilefit.convert.maps import chiang_colour, van_de_hulst_colour, wrenninge_colour

Floats = NDArray[np.float64]

# blender/cycles, src/kernel/closure/bssrdf.h, bssrdf_setup_radius: what a radius is multiplied by.
SHRINK = 0.25 / np.pi
SHRINK_WALK_5_2 = 1.0  # since commit e5f41641 of 2026-06-02
# The same file, bssrdf_dipole_compute_alpha_prime.
SKIN_HALVINGS = 12
SKIN_DARKEST, SKIN_BRIGHTEST, SKIN_HIGHEST = 1e-4, 0.995, 0.999999
# src/scene/shader_nodes.cpp: IOR of the Subsurface Scattering node, and Subsurface IOR of Principled.
INDEX = 1.4


def walk(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius of Random Walk since 5.2 over l [-]: its inverse is the extinction, whatever g."""
    return unreduced_path(alpha, g) / SHRINK_WALK_5_2


def walk_legacy(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius of Random Walk (Legacy) over l [-]: the extinction is 4 pi / (radius (1 - g))."""
    return stretch(alpha, g) / SHRINK


def isotropic(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius of both methods until 2.93 over l [-]: 4 pi."""
    return transport(alpha, g) / SHRINK


def burley(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius of Christensen-Burley since 3.0 over l [-]: 4 pi d."""
    return falloff_diffuse(alpha, g) / SHRINK


def skin(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius of Random Walk (Skin) over l [-]: the extinction depends on the colour that is typed, too."""
    return classical(skin_alpha(wrenninge_colour(alpha, g))) * stretch(alpha, g)


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


def rough_entry(alpha: Floats) -> Floats:
    """Return A [-] of a walk that light enters through the node's surface, refracted, seen from the normal."""
    return reflectance_rough(alpha, INDEX)


def skin_entry(alpha: Floats) -> Floats:
    """Return A [-] of Random Walk (Skin), half of whose light enters diffusely."""
    return 0.5 * (rough_entry(alpha) + reflectance_of(alpha, "diffuse"))


def _wrenninge(alpha: Floats, n: float, g: float) -> Floats:
    del n
    return wrenninge_colour(alpha, g)


LENGTHS = (
    Length("cycles_radius", walk),
    Length("cycles_legacy_radius", walk_legacy),
    Length("cycles_burley_radius", burley),
    Length("cycles_skin_radius", skin),
)

MEASURED = "source; measured in Blender 5.3"
FILES = "blender/cycles src/kernel/closure/bssrdf.h, src/kernel/integrator/subsurface_random_walk.h"
OLD_FILES = "blender/cycles v2.93.0 (2021-06), src/kernel/closure/bssrdf.h, src/kernel/kernel_subsurface.h"
TODAY, FROM_4, OF_3 = "release/5.2, main (5.3) of 2026-07-13", "v4.0.0 (2023-12)", "v3.0.0 (2022-01), v3.6.0"
_row = partial(Engine, product="Blender", fields=("Color", "Radius x Scale", "Unit Scale"), unit="m", scale=1.0)

ROWS = (
    _row(
        name="cycles_walk",
        version="5.2-5.3",
        method="Random Walk",
        colour=by(van_de_hulst_colour),
        length=walk,
        formula="van de Hulst's map at alpha; 1 / (mu_s + mu_a)",
        source=f"{FILES}: {TODAY}; commit e5f41641 (2026-06-02) took 1 / (4 pi) away",
        checked="source; measured in Blender 5.2 and 5.3",
        g=(-0.99, 0.99),
        renders=rough_entry,
    ),
    _row(
        name="cycles_skin",
        version="4.0-5.3",
        method="Random Walk (Skin)",
        colour=_wrenninge,
        length=skin,
        formula="Wrenninge's map at alpha and g; 1 / ((1 - g) (mu_s + mu_a) sqrt(3 (1 - alpha'))), with the dipole's "
        "alpha' of the typed colour at IOR 1.4",
        source=f"{FILES}: {FROM_4} to {TODAY}",
        checked=MEASURED,
        g=(0.0, 0.9),
        renders=skin_entry,
    ),
    _row(
        name="cycles_legacy",
        version="5.2-5.3",
        method="Random Walk (Legacy)",
        colour=_wrenninge,
        length=walk_legacy,
        formula="Wrenninge's map at alpha and g, van de Hulst's where g < 0; 4 pi / ((1 - g) (mu_s + mu_a))",
        source=f"{FILES}: {TODAY}",
        checked=MEASURED,
        g=(-0.99, 0.9),
        renders=rough_entry,
    ),
    _row(
        name="cycles_burley",
        version="3.0-5.3",
        method="Christensen-Burley",
        colour=diffuse,
        length=burley,
        formula="A, diffuse, n = 1; 4 pi d, d = l / s(A) by the memo's eq. 6",
        source=f"{FILES}: {OF_3} to {TODAY}",
        checked=MEASURED,
    ),
    _row(
        name="cycles_walk_4",
        version="4.0-5.1",
        method="Random Walk",
        colour=_wrenninge,
        length=walk_legacy,
        formula="as Random Walk (Legacy) of 5.2",
        source=f"{FILES}: {FROM_4} to v5.1.0 (2026-03)",
        checked="source; measured in Blender 5.0",
        g=(0.0, 0.9),
        renders=rough_entry,
    ),
    _row(
        name="cycles_fixed_radius",
        version="3.x",
        method="Random Walk (Fixed Radius)",
        colour=_wrenninge,
        length=walk_legacy,
        formula="as Random Walk of 4.0, but light enters diffusely",
        source=f"{FILES}: {OF_3}",
        g=(0.0, 0.9),
    ),
    _row(
        name="cycles_walk_3",
        version="3.x",
        method="Random Walk",
        colour=_wrenninge,
        length=skin,
        formula="as Random Walk (Skin) of 4.0, but light enters diffusely",
        source=f"{FILES}: {OF_3}",
        g=(0.0, 0.9),
    ),
    _row(
        name="cycles_walk_2",
        version="2.80-2.93",
        method="Random Walk",
        colour=by(chiang_colour),
        length=isotropic,
        formula="Chiang's map at alpha, 1 from 0.9989 on; 4 pi l",
        source=OLD_FILES,
    ),
    _row(
        name="cycles_burley_2",
        version="2.79-2.93",
        method="Christensen-Burley",
        colour=diffuse,
        length=isotropic,
        formula="A, diffuse, n = 1; 4 pi l, which the kernel divides by s(A) of the typed colour",
        source=OLD_FILES,
    ),
)
