"""Balance of texture and screen: a kernel split by scale, and the screen's share of what is far.

Yang et al. blend light that was blurred in texture space and on the screen by a balance function that their text
does not give. Here R = R_near + R_far: Gaussians narrower than a crossover are blurred on the screen, which has all
detail; wider ones in the atlas, which sees hidden parts; and those, too, on the screen where it sees nearly all of
their light. Both blur the same irradiance, and the weights of both parts together are those of the kernel: light is
counted once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.media.arrays import Floats, require
from profilefit.errors import InputError
from profilefit.scenes.heart.truth import surface_blur


@dataclass(frozen=True)
class Kernel:
    """Kernel sum_k w_k e^{-d^2 / 2 v_k} / (2 pi v_k): variances (N,), rising [length^2]; weights (N,) or (N, c) [-]."""

    variances: Floats
    weights: Floats

    @property
    def energy(self) -> Floats:
        """Integral over the plane, of each channel [-]."""
        return np.sum(self.weights, axis=0)


# Of sixty random scenes; 0.48 to 0.60 as scenes are drawn again (`python -m benchmarks.heart`).
CROSSOVER = 0.6


class NearFar(NamedTuple):
    """Parts of a kernel; their weights are those of the whole one."""

    near: Kernel
    far: Kernel


def split(kernel: Kernel, crossover: float) -> NearFar:
    """Return Gaussians with sigma below a crossover [length], and the others; either may be empty."""
    require(crossover >= 0, "crossover", "a length >= 0", crossover)
    is_near = np.sqrt(kernel.variances) < crossover
    near, far = (Kernel(kernel.variances[one], kernel.weights[one]) for one in (is_near, ~is_near))
    return NearFar(near, far)


def crossover_of(texel: float, pixel: float, constant: float = CROSSOVER) -> float:
    """Return where to split: constant * texel * sqrt(texel / pixel), the mean sides of what both spaces have [length].

    The coarser the atlas, the more is left to the screen; less, the coarser the screen is itself.
    """
    if not (texel > 0 and pixel > 0):
        raise InputError(f"texel and pixel must be lengths > 0, got {texel!r} and {pixel!r}")
    return constant * texel * float(np.sqrt(texel / pixel))


def screen_share(points: ArrayLike, areas: ArrayLike, seen: ArrayLike, kernel: Kernel, at: ArrayLike) -> Floats:
    """Return the share (m,) or (m, c) of the light that a kernel gathers at points which comes from what is seen [-].

    points, areas, seen  (n, 3), (n,), (n,) of the whole surface, seen 0 or 1;  at  (m, 3)
    """
    visible = np.broadcast_to(np.asarray(seen, float), np.shape(areas))
    of = (kernel.variances, kernel.weights)
    channels = np.ones(np.shape(kernel.weights)[1:])
    some, whole = (
        surface_blur(points, areas, np.multiply.outer(light, channels), *of, at=at)
        for light in (visible, np.ones_like(visible))
    )
    return some / np.maximum(whole, np.finfo(float).tiny)


def balance(near: ArrayLike, far_on_screen: ArrayLike, far_in_atlas: ArrayLike, share: ArrayLike, threshold: float):
    """Return the light of both parts: near, and far by the screen where its share is above the threshold.

    All broadcast; a smooth weight would mix in a gather that misses light, which is wrong in all of it.
    """
    return np.asarray(near) + np.where(np.asarray(share) > threshold, far_on_screen, far_in_atlas)
