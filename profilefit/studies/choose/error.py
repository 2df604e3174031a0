"""Error of a technique at a step edge of light, and its parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import ProfileLaw
from profilefit.studies.choose.case import Case, Option, Within, is_filter
from profilefit.studies.choose.predicted import estimates, filtered
from profilefit.studies.choose.response import ReferenceLight, averaged, beyond, response

Floats = NDArray[np.float64]
CHANNELS = ("red", "green", "blue")


@dataclass(frozen=True)
class Error:
    """Root mean square error of radiance over the places within reach of the edge, as a share of white [-].

    White is what a surface with A = 1 shows that is lit all over. Of the worst channel: total, and what it is made of
    in squares: `model`, the law or kernel on a plane; `curvature`, what that changes around the cylinder; `pixel`, the
    place in the middle for the mean over a pixel; `noise` of the samples.
    """

    total: float
    model: float
    curvature: float
    pixel: float
    noise: float
    channel: int
    case: Case


def error(option: Option, case: Case, light: ReferenceLight, within: Within) -> Error:
    """Return the error of an option in the worst channel."""
    return max((_of_channel(option, case, light, within, c) for c in range(3)), key=lambda one: one.total)


def _of_channel(option: Option, case: Case, light: ReferenceLight, within: Within, channel: int) -> Error:
    reflectance, mfp, plane = case.reflectance[channel], case.mfp[channel], case.flat()
    x = case.places(channel, within)
    share = light.beyond(reflectance)
    truth = averaged(share, x, case.pixel, mfp, case.radius, case.window[0])
    here = response(share, x, mfp, case.radius, case.window[0])
    estimates = _found(option, case, light, channel, x)
    noise = estimates.var(axis=1, ddof=1) if estimates.shape[1] > 1 else np.zeros(len(x))
    bias = estimates.mean(axis=1) - truth
    flat = _mean(option, plane, light, channel, x) - response(share, x, mfp, plane.radius, plane.window[0])
    curved = _mean(option, case, light, channel, x) - here

    def rms(squares: Floats) -> float:
        return reflectance * float(np.sqrt(np.mean(squares)))

    return Error(
        total=rms(bias**2 + noise * (1.0 - 1.0 / estimates.shape[1])),
        model=rms(flat**2),
        curvature=rms((curved - flat) ** 2),
        pixel=rms((here - truth) ** 2),
        noise=rms(noise),
        channel=channel,
        case=case,
    )


def _found(option: Option, case: Case, light: ReferenceLight, channel: int, x: Floats) -> Floats:
    """Return L / A at places (m,), (m, trials)."""
    if option.law is None:
        return _mean(option, case, light, channel, x)[:, None]
    law = option.law
    red, green, blue = (_alpha(law, a) for a in case.reflectance)
    return estimates(law, (red, green, blue), option.number, case, channel, x)


def _mean(option: Option, case: Case, light: ReferenceLight, channel: int, x: Floats) -> Floats:
    """Return L / A at places (m,) without noise."""
    if option.law is not None:
        share = beyond(_alpha(option.law, case.reflectance[channel]), option.law.setting, option.law)
        return response(share, x, case.mfp[channel], case.radius, case.window[0])
    return filtered(option, case, light, channel, x) if is_filter(option) else np.ones(x.shape)


@cache
def _alpha(law: ProfileLaw, reflectance: float) -> float:
    """Return the albedo that a law's own map gives to a reflectance A [-], as its shader has it."""
    return float(law.albedo.alpha(reflectance))  # type: ignore[attr-defined]
