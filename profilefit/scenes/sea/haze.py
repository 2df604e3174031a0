"""What water leaves of light on its way, in three ways to count it, and what it scatters toward an eye.

Single scattering takes all that is scattered out of a ray for lost; its scaled form keeps the forward peak (Joseph,
Wiscombe & Weinman, J. Atmos. Sci. 33, 2452, 1976). Neither holds in the sea, whose light is scattered by small angles
many times. Here it is broadened twice, on its way from the sun and on its way to the eye, each as a beam is
(`law.beam_share`), and turned once between: L = b p int E(s) E(t) dt.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.errors import InputError
from profilefit.scenes.sea.law import Lobes, beam_share, water_mtf

Floats = NDArray[np.float64]
BROADENED, SCALED, SINGLE = KINDS = ("broadened", "scaled", "single")
FINE = 400  # of a quadrature along a view, even in the square root of its length
FARTHEST = 40.0  # of it [-]


def ways(omega: ArrayLike, ct: ArrayLike, cw: ArrayLike, lobes: Lobes, kind: str) -> tuple[Floats, Floats, Floats]:
    """Optical lengths -ln(share left) [-] that stand for c t: of what is sharp, of a shaft, and of wide light.

    omega, ct, cw  albedo, length and half-width of the shaft [-], which broadcast;  lobes  as of `law.beam_share`
    kind           one of `KINDS`; the last two leave the same of all three
    """
    if kind not in KINDS:
        raise InputError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}")
    some, far, wide = np.broadcast_arrays(*(np.asarray(one, float) for one in (omega, ct, cw)))
    if kind == BROADENED:
        with np.errstate(divide="ignore"):
            narrow = -np.log(
                np.maximum(beam_share(some, far, wide, lobes), np.exp(-far))
            )  # rounding, where nothing is left
            return np.asarray(far), narrow, -np.log(water_mtf(some, far, 0.0, lobes))
    peak = sum(weight * g * g for weight, g in lobes) if kind == SCALED else 0.0
    scaled = far * (1.0 - some * peak)
    return scaled, scaled, scaled


def sunlit_haze(omega: float, ct: float, cosine: float, lobes: Lobes, kind: str) -> float:
    """Radiance toward an eye in a calm, deep sea under an overhead sun, by the sun's irradiance there [1/sr].

    ct  depth of the eye [-];  cosine  of the view to the downward vertical, 0 horizontal, 1 straight down

    The same closed forms by quadrature that the scene's shader has in pieces.
    """
    farthest = min(FARTHEST, ct / -cosine if cosine < 0 else np.inf)
    root = (np.arange(FINE) + 0.5) / FINE
    t = farthest * root**2
    back, down = (ways(omega, one, np.inf, lobes, kind)[2] for one in (t, np.maximum(ct + cosine * t, 0.0)))
    turned = sum(w * (1 - g * g) / (4 * np.pi * (1 + g * g + 2 * g * cosine) ** 1.5) for w, g in lobes)
    return float(omega * turned * np.sum(np.exp(-back - down) * 2.0 * root / FINE) * farthest)


def table(c: Floats, omega: Floats, width: float, lobes: Lobes, kind: str, lengths: Floats) -> NDArray[np.float32]:
    """(3, n, 4) for glsl/view.frag: `ways` in rows, of red, green and blue, over lengths (n,) [m]."""
    columns: list[Any] = [
        ways(some, rate * lengths, rate * width, lobes, kind) for rate, some in zip(c, omega, strict=True)
    ]
    found = np.zeros((3, lengths.size, 4), np.float32)
    found[..., :3] = np.moveaxis(np.array(columns), 0, -1)
    return found
