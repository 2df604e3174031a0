"""Scattering distance and colour of Unity's HDRP and of Unreal, rasterised and path traced.

HDRP's rasteriser draws normalized diffusion with the typed d; its path tracer walks with l = d s(A), s the diffuse one.

Unreal's rasteriser takes a mean free path since 5.1 and a diffuse one before. It draws d = dmfp / s_dmfp(A), dmfp being
mfp s_dmfp(A) / (0.6 s_searchlight(A)): an l of 1 is typed as 0.6. Profiles from before 5.1 were drawn 10/3 wider than
their numbers, as the code that upgrades them says. Its path tracer multiplies by 0.6 again and walks with what was
typed, so that rasteriser and path tracer want different numbers for one medium.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from profilefit.convert.colour import reflectance_of
from profilefit.convert.engine import ISOTROPIC, Engine, by, diffuse, searchlight
from profilefit.convert.lengths import (
    Length,
    falloff_diffuse,
    falloff_searchlight,
    scale_diffuse,
    scale_dmfp,
    transport,
)
from profilefit.convert.maps import chiang_colour, hyperion_colour

Floats = NDArray[np.float64]

# Unity-Technologies/Graphics, .../Runtime/Material/DiffusionProfile/DiffusionProfileSettings.cs: UpdateKernel.
HDRP_SHARE = 0.997
# r/d within which normalized diffusion has that share of its light.
HDRP_REACH = float(brentq(lambda t: 0.25 * np.exp(-t) + 0.75 * np.exp(-t / 3.0) - (1.0 - HDRP_SHARE), 0.0, 100.0))
# Unreal Engine SubsurfaceProfile.cpp: Dmfp2MfpMagicNumber, and SUBSURFACE_KERNEL_SIZE / CmToMm.
UNREAL_MAGIC = 0.6
UNREAL_SHRINK = 3.0 / 10.0


def hdrp_radius(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the radius within which HDRP draws 99.7 % of the light, its Max Radius, over l [-]."""
    return HDRP_REACH * falloff_diffuse(alpha, g)


def hdrp_traced(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the scattering distance over l [-] of the path tracer, which multiplies it by s of the typed colour."""
    del g
    return 1.0 / scale_diffuse(chiang_colour(alpha))


def unreal(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the mean free path of the rasteriser since 5.1 over l [-]."""
    return UNREAL_MAGIC * transport(alpha, g)


def unreal_old(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the diffuse mean free path of the rasteriser before 5.1 over l [-]."""
    return UNREAL_SHRINK * scale_dmfp(reflectance_of(alpha, "searchlight")) * falloff_searchlight(alpha, g)


LENGTHS = (
    Length("hdrp_distance", falloff_diffuse),
    Length("hdrp_radius", hdrp_radius),
    Length("unreal_mfp", unreal),
    Length("unreal_dmfp", unreal_old),
)

COPY = "unofficial copy of the source"
_unity = partial(
    Engine,
    product="Unity HDRP",
    version="to 17.2",
    fields=("base colour", "Scattering Color x Multiplier (before 14: Scattering Distance)", "World Scale"),
    unit="mm",
    scale=1.0,
)
_unreal = partial(
    Engine,
    product="Unreal",
    fields=("Base Color, Surface Albedo", "Mean Free Path Color x Mean Free Path Distance", "World Unit Scale"),
    unit="cm",
    scale=0.1,
)

ROWS = (
    _unity(
        name="hdrp",
        method="rasteriser",
        colour=diffuse,
        length=falloff_diffuse,
        formula="A, diffuse, n = 1; d = l / s(A) by the memo's eq. 6; the picker's numbers are not sRGB",
        source="Unity-Technologies/Graphics DiffusionProfileSettings.cs 0777f7c, SubsurfaceScattering.compute 0ad4df7",
    ),
    _unity(
        name="hdrp_path_tracer",
        method="path tracer",
        colour=by(chiang_colour),
        length=hdrp_traced,
        formula="Chiang's map at alpha, 1 from 0.9989 on; l / s(typed colour); walks end after 16 steps",
        source="Unity-Technologies/Graphics .../Runtime/RenderPipeline/Raytracing/Shaders/SubSurface.hlsl",
    ),
    _unreal(
        name="unreal",
        version="5.1-5.8",
        method="rasteriser",
        colour=searchlight,
        length=unreal,
        formula="A, pencil beam, n = 1; 0.6 l; Enable Mean Free Path is on",
        source="Unreal Engine 5.8.0 SubsurfaceProfile.cpp, BurleyNormalizedSSSCommon.ush",
        checked=COPY,
    ),
    _unreal(
        name="unreal_path_tracer",
        version="5.8",
        method="path tracer",
        colour=by(hyperion_colour),
        length=transport,
        formula="map of Hyperion at alpha, for internal reflection at n = 1.4; l",
        source="Unreal Engine 5.8.0 PathTracingCore.ush, PathTracingMaterialHitShader.usf",
        checked=COPY,
        g=ISOTROPIC,
    ),
    _unreal(
        name="unreal_before_5_1",
        version="before 5.1",
        method="rasteriser",
        colour=searchlight,
        length=unreal_old,
        formula="A, pencil beam, n = 1; 0.3 s_dmfp(A) l / s(A) by the memo's eqs. 8 and 5, a diffuse mean free path",
        source="Unreal Engine 5.2 SubsurfaceProfile.cpp, UpgradeDiffuseMeanFreePathToMeanFreePath",
        checked=f"{COPY}; 0.3 inferred from how it upgrades old profiles",
    ),
)
