"""The paper's table of errors, recomputed: MSE and R^2 of r R_d against the truth, for two halves of the range and all.

Source: Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile (Journal of
Software), table 1. It states neither channel, range, ring width, nor which R^2, and "skin" is one of two materials:
each choice is a row here, and nothing decides between them but the distance to print.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.profiles import Profiles
from profilefit.laws.base import ProfileLaw
from profilefit.materials import BY_NAME, CHANNELS, Material
from profilefit.recipes.reproduction import (
    CORRECTED_B0,
    PUBLISHED,
    cut_radius,
    even_rings,
    law_energy,
    printed_coefficients,
)

Floats = NDArray[np.float64]
PRINTED_B0 = PUBLISHED["(13)"]["b0"]
NORMALIZED_DIFFUSION = "normalized diffusion"
# model name -> (b0 of (13), whether (18) divides)
RATIONAL_MODELS = {
    "paper as printed": (PRINTED_B0, False),
    "paper as printed, with (18)": (PRINTED_B0, True),
    "paper, b0 = .0641": (CORRECTED_B0, False),
    "paper, b0 = .0641, with (18)": (CORRECTED_B0, True),
}
# The materials of table 1 and which of ours they may be.
CANDIDATES = {"ketchup": ("ketchup",), "apple": ("apple",), "marble": ("marble",), "skin": ("skin1", "skin2")}
# material -> model -> MSE of r <= 1/2, of r > 1/2 and of all [1/mm^2], then R^2 of the same [-]
PRINTED = {
    "ketchup": {
        "diffusion": ((9.7448e-8, 4.5326e-9, 5.0975e-8), (0.9898, 0.5027, 0.9934)),
        "paper": ((7.1351e-8, 1.1414e-8, 4.1373e-8), (0.9916, 0.8809, 0.9942)),
    },
    "apple": {
        "diffusion": ((2.5702e-5, 1.7925e-6, 1.3741e-5), (0.9801, 0.5010, 0.9853)),
        "paper": ((6.8160e-6, 7.7950e-7, 3.7812e-6), (0.9941, 0.8581, 0.9954)),
    },
    "marble": {
        "diffusion": ((2.4810e-5, 1.7023e-6, 1.3256e-5), (0.9789, 0.5012, 0.9844)),
        "paper": ((6.7710e-6, 7.2461e-7, 3.7478e-6), (0.9936, 0.8476, 0.9950)),
    },
    "skin": {
        "diffusion": ((1.8591e-6, 4.5615e-8, 9.5236e-7), (0.9855, 0.5038, 0.9912)),
        "paper": ((7.7719e-7, 1.5203e-7, 4.6461e-7), (0.9944, 0.8982, 0.9960)),
    },
}
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Table1Row:
    """One model of one channel over one range.

    range_choice       how `range_mm`, r'_max [mm], was chosen; rings are those of the truth
    mse                of r <= r'_max / 2, of the rest, of all [1/mm^2]
    r2                 by definition, the same three: "determination" 1 - SSE/SST, "explained" SSR / (SSR + SSE),
                       "correlation" squared
    mse_over_printed   the same three [-]
    r2_minus_printed   by definition, the same three [-]
    """

    material: str
    channel: str
    model: str
    range_choice: str
    range_mm: float
    mse: Triple
    r2: dict[str, Triple]
    mse_over_printed: Triple
    r2_minus_printed: dict[str, Triple]


@dataclass(frozen=True)
class HalvesCheck:
    """Return whether two printed halves average to the printed whole: a test of print alone.

    off  mean of the halves over the whole, less 1 [-]; second_half_needed  the second half that would make it 0
    """

    material: str
    model: str
    off: float
    second_half_needed: float


def table1(regenerated: Mapping[str, ProfileLaw] = MappingProxyType({})) -> tuple[Table1Row, ...]:
    """Every candidate material, channel, range and model; `regenerated` are further models by name."""
    found: list[Table1Row] = []
    for printed, names in CANDIDATES.items():
        for material in map(BY_NAME.__getitem__, names):
            profiles = even_rings(np.array(material.alpha))
            for channel in range(len(CHANNELS)):
                found += _channel_rows(printed, material, channel, profiles, regenerated)
    return tuple(found)


def printed_halves() -> tuple[HalvesCheck, ...]:
    """Check that the printed halves average to the printed whole.

    The halves hold equally many rings (give or take one), so their mean must be the whole.
    """
    return tuple(
        HalvesCheck(material, model, (mse[0] + mse[1]) / 2 / mse[2] - 1, 2 * mse[2] - mse[0])
        for material, models in PRINTED.items()
        for model, (mse, _) in models.items()
    )


def mean_squared_errors(law: Floats, data: Floats) -> Triple:
    """Return values of the first half of the samples, the second half and all."""
    first, second, whole = (float(np.mean((law[s] - data[s]) ** 2)) for s in _halves(data.size))
    return first, second, whole


def r_squared(law: Floats, data: Floats) -> dict[str, Triple]:
    """R^2 by three definitions, equal for a linear regression and for nothing else, halves and all."""
    by_part = [_r_squared_of(law[s], data[s]) for s in _halves(data.size)]
    return {name: (by_part[0][name], by_part[1][name], by_part[2][name]) for name in by_part[0]}


def normalized_diffusion(r: Floats, reflectance: float, mfp: float) -> Floats:
    """Return r R_d [1/length] of Christensen and Burley (2015) under a pencil beam: s = 1.85 - A + 7 |A - .8|^3."""
    s = 1.85 - reflectance + 7 * abs(reflectance - 0.8) ** 3
    return reflectance * s / (8 * np.pi * mfp) * (np.exp(-s * r / mfp) + np.exp(-s * r / (3 * mfp)))


def rational(r: Floats, alpha: float, reflectance: float, mfp: float, b0: float, corrected: bool) -> Floats:
    """Return r R_d [1/length] of (7), zero beyond r_max, divided by cdf(r_max) of (18) if `corrected`."""
    a, b, c = printed_coefficients(np.array(alpha), b0)
    x = r / mfp
    value = np.maximum((a * x + b) / (x + c), 0.0) / mfp
    return value * reflectance / law_energy(-b / a, np.array(alpha), b0) if corrected else value


def _channel_rows(
    printed: str, material: Material, channel: int, profiles: Profiles, regenerated: Mapping[str, ProfileLaw]
) -> list[Table1Row]:
    alpha, mfp = material.alpha[channel], material.mfp[channel]
    r = profiles.r * mfp
    data = profiles.value[channel] * profiles.r / mfp
    reflectance = float(profiles.reflectance[channel])
    laws = {NORMALIZED_DIFFUSION: normalized_diffusion(r, reflectance, mfp)}
    for model, (b0, corrected) in RATIONAL_MODELS.items():
        laws[model] = rational(r, alpha, reflectance, mfp, b0, corrected)
    laws |= {model: r * np.asarray(law.profile(r, alpha, mfp)) for model, law in regenerated.items()}
    ranges = {
        "(6) on r R_d": cut_radius(r, data, "walk"),
        "one stride before (6)": cut_radius(r, data, "stride before"),
        "diffusion's MSE nearest to print": _nearest_range(r, laws[NORMALIZED_DIFFUSION], data, printed),
    }
    return [
        _row(printed, material.name, CHANNELS[channel], model, choice, end, law[r <= end], data[r <= end])
        for choice, end in ranges.items()
        for model, law in laws.items()
    ]


def _row(printed, material, channel, model, choice, end, law: Floats, data: Floats) -> Table1Row:
    mse, r2 = mean_squared_errors(law, data), r_squared(law, data)
    printed_mse, printed_r2 = PRINTED[printed]["diffusion" if model.startswith(NORMALIZED_DIFFUSION) else "paper"]
    ratio = _each(lambda x, y: x / y, mse, printed_mse)
    gaps = {name: _each(lambda x, y: x - y, values, printed_r2) for name, values in r2.items()}
    return Table1Row(material, channel, model, choice, end, mse, r2, ratio, gaps)


def _nearest_range(r: Floats, law: Floats, data: Floats, printed: str) -> float:
    """Return the range r'_max [mm] whose three diffusion MSEs are nearest to print.

    The candidates are whole numbers of mm, and halves below 5 mm as in (6).
    """
    ends = np.concatenate([np.arange(0.5, 5.0, 0.5), np.arange(5.0, 31.0)])
    ends = ends[ends <= r[-1]]
    target = np.log(PRINTED[printed]["diffusion"][0])
    misfits = [np.sum((np.log(mean_squared_errors(law[r <= e], data[r <= e])) - target) ** 2) for e in ends]
    return float(ends[np.argmin(misfits)])


def _r_squared_of(law: Floats, data: Floats) -> dict[str, float]:
    residual = np.sum((law - data) ** 2)
    explained = np.sum((law - data.mean()) ** 2)
    joint = np.sum((law - law.mean()) * (data - data.mean())) ** 2
    spread = np.sum((law - law.mean()) ** 2) * np.sum((data - data.mean()) ** 2)
    return {
        "determination": float(1 - residual / np.sum((data - data.mean()) ** 2)),
        "explained": float(explained / (explained + residual)),
        "correlation": float(joint / spread) if spread > 0 else 0.0,
    }


def _halves(size: int) -> tuple[slice, slice, slice]:
    return slice(0, size // 2), slice(size // 2, size), slice(0, size)


def _each(operation, values: Triple, others: Triple) -> Triple:
    first, second, whole = (float(operation(v, o)) for v, o in zip(values, others, strict=True))
    return first, second, whole
