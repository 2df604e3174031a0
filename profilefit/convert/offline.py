"""Colour and length of pbrt, Mitsuba, appleseed and Arnold, and of the materials of glTF and OpenPBR."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from mcml_sim.exact.light import unreduced
from profilefit.convert.colour import reflectance_of
from profilefit.convert.engine import ISOTROPIC, Engine, by, searchlight
from profilefit.convert.lengths import scale_searchlight, transport, unreduced_path
from profilefit.convert.maps import appleseed_colour, chiang_colour, van_de_hulst_colour
from profilefit.laws.diffusion import BeamDiffusion

Floats = NDArray[np.float64]


def beam_diffusion(alpha: Floats, n: float, g: float) -> Floats:
    """Return A [-] by photon beam diffusion per light that entered, which pbrt inverts; at most 1 can be typed."""
    del g
    law = BeamDiffusion(Setting(n=n))
    return np.minimum(np.asarray(law.reflectance(alpha)) / law.entered, 1.0)


def of_entered(alpha: Floats, n: float, g: float) -> Floats:
    """Return A [-] under a pencil beam and this surface per light that entered."""
    return reflectance_of(alpha, "searchlight", n, g) / reflectance_of(1.0, "searchlight", n, g)


def albedo(alpha: Floats, n: float, g: float) -> Floats:
    """Return mu_s / (mu_s + mu_a) [-]."""
    del n
    return unreduced(alpha, g)


def appleseed_2017(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the mfp of appleseed's walk of 2017 over l [-], which it multiplies by s of the typed colour."""
    del g
    return 1.0 / scale_searchlight(chiang_colour(alpha))


_appleseed = partial(Engine, product="appleseed", fields=("reflectance", "mfp", "mfp_multiplier"), scale=1.0)
_openpbr = partial(
    Engine,
    product="OpenPBR",
    version="1.1.1",
    length=unreduced_path,
    source="AcademySoftwareFoundation/OpenPBR v1.1.1 (2026-04-17), index.html, Subsurface",
    checked="specification",
)
APPLESEED = "appleseedhq/appleseed c39aed74, src/appleseed/renderer/modeling/bssrdf"

ROWS = (
    Engine(
        name="pbrt",
        product="pbrt",
        version="3 and 4",
        method="subsurface",
        fields=("reflectance (3: Kd), with eta = n", "mfp", "scale"),
        scale=1.0,
        colour=beam_diffusion,
        length=transport,
        formula="photon beam diffusion's A per light that entered, capped at 1; l. If g > 0, type sigma_a and sigma_s",
        source="mmp/pbrt-v4 5f7a6068 (2026-06-14) materials.h, bssrdf.cpp; mmp/pbrt-v3 2f208c19 kdsubsurface.cpp",
        g=ISOTROPIC,
    ),
    Engine(
        name="mitsuba",
        product="Mitsuba",
        version="3",
        method="homogeneous",
        fields=("albedo, with phase hg of g", "sigma_t", "scale"),
        scale=1.0,
        colour=albedo,
        length=unreduced_path,
        power=-1,
        formula="mu_s / (mu_s + mu_a); mu_s + mu_a; inside a null surface (n = 1) or a dielectric one",
        source="mitsuba-renderer/mitsuba3 b45b0a93 (2026-07-29), src/media/homogeneous.cpp",
    ),
    _appleseed(
        name="appleseed",
        version="2",
        method="normalized diffusion",
        colour=searchlight,
        length=transport,
        formula="A, pencil beam, n = 1; l, which it divides by s(A) of the memo's eq. 5",
        source=f"{APPLESEED}/normalizeddiffusionbssrdf.cpp",
    ),
    _appleseed(
        name="appleseed_walk",
        version="2",
        method="random walk",
        colour=by(appleseed_colour),
        length=unreduced_path,
        formula="van de Hulst's map at alpha, with 9.59271 in place of 9.59217; 1 / (mu_s + mu_a)",
        source=f"{APPLESEED}/randomwalkbssrdf.cpp",
    ),
    _appleseed(
        name="appleseed_walk_2017",
        version="of 2017",
        method="random walk",
        colour=by(chiang_colour),
        length=appleseed_2017,
        formula="Chiang's map at alpha, 1 from 0.9989 on; l / s(typed colour) by the memo's eq. 5",
        source="appleseedhq/appleseed, randomwalkbssrdf.cpp of 2017",
    ),
    Engine(
        name="arnold",
        product="Arnold",
        version="5 to 7",
        method="standard_surface",
        fields=("subsurface_color", "subsurface_radius x subsurface_scale", ""),
        colour=None,
        length=transport,
        formula="how it maps colours is not documented; l, as the manual says mean free path",
        source="Arnold's manual, undated, in two copies",
        checked="the length by the manual's wording; the colour could not be checked",
        g=ISOTROPIC,
    ),
    Engine(
        name="gltf",
        product="glTF",
        version="draft of 2026-06",
        method="scatter",
        fields=("multiscatterColorFactor", "attenuationDistance, with attenuationColor 1/e = 0.36788", ""),
        colour=by(van_de_hulst_colour),
        length=unreduced_path,
        unit="m",
        formula="van de Hulst's map at alpha; 1 / (mu_s + mu_a) = x. For unequal x one distance d, colours exp(-d / x)",
        source="KhronosGroup/glTF pull request 2579 (review of 2026-06-29), KHR_materials_scatter 0addbb0a",
        checked="draft",
    ),
    _openpbr(
        name="openpbr",
        method="by its example",
        fields=("subsurface_color", "subsurface_radius x subsurface_radius_scale", ""),
        colour=by(van_de_hulst_colour),
        formula="van de Hulst's map at alpha, which the specification has for example; 1 / (mu_s + mu_a)",
    ),
    _openpbr(
        name="openpbr_definition",
        method="by its definition",
        fields=("subsurface_color, with specular_ior = n", "subsurface_radius x subsurface_radius_scale", ""),
        colour=of_entered,
        formula="A, pencil beam, at this n, per light that entered; 1 / (mu_s + mu_a)",
    ),
)
