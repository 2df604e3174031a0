"""Light that water leaves on its way, by three techniques, and light that it scatters toward an eye.

Single scattering takes all that is scattered out of a ray for lost; its scaled form keeps the forward peak (Joseph,
Wiscombe & Weinman, J. Atmos. Sci. 33, 2452, 1976). Neither holds in the sea, whose light is scattered by small angles
many times. Here it is broadened twice, on its way from the sun and on its way to the eye, each as a beam is
(`law.beam_share`), and turned once between: L = b p int E(s) E(t) dt. A turn by a small angle is itself one of those
that broaden, and is not to be counted among the others again: of turns with the cosine c the share e^{-(1 - c) / TURN}
comes from light that was not scattered before, e^{-cs} in place of E(s).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipe

from mcml_sim.media.arrays import Floats, require
from profilefit.scenes.sea.law import Lobes, beam_share, water_mtf

BROADENED, SCALED, SINGLE = KINDS = ("broadened", "scaled", "single")
# Fitted to all orders of light of Petzold's three terms, omega 0.2 to 0.8 and ct 0.5 to 3.5, within 60 degrees of the
# sun: rms 7 %, of omega to 0.5 5 %. The scene had no part in it.
TURN = 0.09
FINE = 400  # of a quadrature along a view, even in the square root of its length
AZIMUTHS = 48
FARTHEST = 40.0  # of it [-]
DARKEST = 700.0  # optical length in a table where nothing is left: a shader cannot take one inf from another


def ways(omega: ArrayLike, ct: ArrayLike, cw: ArrayLike, lobes: Lobes, kind: str) -> tuple[Floats, Floats, Floats]:
    """Return optical lengths -ln(share left) [-] that stand for c t: of what is sharp, of a shaft, and of wide light.

    omega, ct, cw  albedo, length and half-width of the shaft [-], which broadcast;  lobes  as of `law.beam_share`
    kind           one of `KINDS`; the last two leave the same of all three
    """
    require(kind in KINDS, "kind", f"one of {', '.join(KINDS)}", kind)
    some, far, wide = np.broadcast_arrays(*(np.asarray(one, float) for one in (omega, ct, cw)))
    if kind == BROADENED:
        with np.errstate(divide="ignore"):
            whole = -np.log(water_mtf(some, far, 0.0, lobes))
            if np.all(np.isinf(wide)):
                return np.asarray(far), whole, whole
            # Where next to nothing is left, rounding must not take more than the unscattered light is.
            narrow = -np.log(np.maximum(beam_share(some, far, wide, lobes), np.exp(-far)))
            return np.asarray(far), narrow, whole
    peak = sum(weight * g * g for weight, g in lobes) if kind == SCALED else 0.0
    scaled = far * (1.0 - some * peak)
    return scaled, scaled, scaled


def sunlit_haze(omega: float, ct: float, cosine: float, lobes: Lobes, kind: str) -> float:
    """Return radiance toward an eye in a calm, deep sea under an overhead sun, by the sun's irradiance there [1/sr].

    ct  depth of the eye [-];  cosine  of the view to the downward vertical, 0 horizontal, 1 straight down

    The same closed forms by quadrature that the scene's shader has in pieces.
    """
    farthest = min(FARTHEST, ct / -cosine if cosine < 0 else np.inf)
    root = (np.arange(FINE) + 0.5) / FINE
    t = farthest * root**2
    back = ways(omega, t, np.inf, lobes, kind)[2]
    sharp, _, wide = ways(omega, np.maximum(ct + cosine * t, 0.0), np.inf, lobes, kind)
    near = unscattered(-cosine)
    coming = near * np.exp(-sharp) + (1.0 - near) * np.exp(-wide)
    density = sum(w * (1 - g * g) / (4 * np.pi * (1 + g * g + 2 * g * cosine) ** 1.5) for w, g in lobes)
    return float(omega * density * np.sum(np.exp(-back) * coming * 2.0 * root / FINE) * farthest)


def unscattered(cosine: ArrayLike) -> Any:
    """Return the share of turns with this cosine whose light was not scattered before [-]."""
    return np.exp(-(1.0 - np.asarray(cosine, float)) / TURN)[()]


def turned(lobes: Lobes, view: Floats, light: Floats) -> tuple[Floats, Floats]:
    """Return phase function of light that turns into a view, the mean over azimuths between both [1/sr]: two (v, n).

    view, light  (v,), (n,) cosines to one upright

    Of light that was not scattered before, and of the rest. (A - B cos phi)^{-3/2} integrates to an elliptic integral
    of the second kind, so the sharpest lobe is right; the rest has no peak.
    """
    v, n = view[:, None], light
    along, across = v * n, np.sqrt((1.0 - v * v) * (1.0 - n * n))
    whole, rest = np.zeros_like(along), np.zeros_like(along)
    for weight, g in lobes:
        a, b = 1.0 + g * g - 2.0 * g * along, 2.0 * g * across
        size = weight * (1.0 - g * g) / (4.0 * np.pi)
        whole += size * 2.0 / np.pi * ellipe(2.0 * b / (a + b)) / ((a - b) * np.sqrt(a + b))
        for azimuth in (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS:
            cosine = along + across * np.cos(azimuth)
            rest += size / AZIMUTHS * (1.0 - unscattered(cosine)) * (1.0 + g * g - 2.0 * g * cosine) ** -1.5
    return np.maximum(whole - rest, 0.0), rest


def table(c: Floats, omega: Floats, width: float, lobes: Lobes, kind: str, lengths: Floats) -> NDArray[np.float32]:
    """Return (3, n, 4) for glsl/view.frag: `ways` in rows, of red, green and blue, over lengths (n,) [m]."""
    columns: list[Any] = [
        ways(some, rate * lengths, rate * width, lobes, kind) for rate, some in zip(c, omega, strict=True)
    ]
    found = np.zeros((3, lengths.size, 4), np.float32)
    found[..., :3] = np.minimum(np.moveaxis(np.array(columns), 0, -1), DARKEST)
    return found
