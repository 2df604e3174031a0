"""Second opinion on the exact step edge: paths through a slab, traced by mitsuba, beside the integral.

    pip install mitsuba
    python -m benchmarks.slab                     # three minutes on a core; --rays 2000 for a first look

A matched, isotropic, homogeneous slab, as good as endless, under even diffuse light, half of which a black plane just
above the surface takes away. Eyes between the two look down. The two share nothing with this project: not the
equation that was solved, not its solution, and paths run backwards, from the eye.

By reciprocity the radiance that leaves straight up at x, under diffuse light of radiance 1 on x > 0, is the power that
a pencil beam at x sends out of x > 0: A L(x) of the *searchlight*. The mean over cosine-weighted directions is A L(x)
of the *diffuse* profile.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.table import show
from mcml_sim import Setting, exact
from profilefit.scenes.stage.reference.step_edge import step_response

Floats = NDArray[np.float64]

# Single precision, one ray a call: the vectorised variants need an LLVM or a GPU of a certain age.
VARIANT = "scalar_rgb"
ALPHAS, ILLUMINATIONS = (0.5, 0.9), ("searchlight", "diffuse")
RANGE, PIXELS = 4.0, 20  # [mfp]
# Height of the plane [mfp]. Light that slips under it blurs the edge: at 0.03 by 2 % of A in the nearest strips, at
# 0.003 by less than the noise. Mitsuba sets a ray off 1e-4 (1 + |x|) from a surface that it leaves: where the plane is
# not higher than that, rays start above it; here that is so 20 mfp from the edge and farther.
GAP = 0.002
EYE = 1e-4  # height [mfp]
HALF, DEPTH = 40.0, 30.0  # of the slab [mfp]: e^-15 of the light comes through at alpha = 0.9
ROULETTE = 64  # scatterings until which every path lives


@dataclass(frozen=True)
class Comparison:
    """Answers of both over PIXELS strips of equal width in [-RANGE, RANGE].

    traced, standard_error, solved (pixels,)  A L averaged over a strip [-]; seconds of tracing
    """

    alpha: float
    illumination: str
    traced: Floats
    standard_error: Floats
    solved: Floats
    seconds: float

    @property
    def z(self) -> Floats:
        """Difference in standard errors (pixels,)."""
        return (self.traced - self.solved) / self.standard_error

    @property
    def chance(self) -> float:
        """Probability of a chi-square as large as this by noise alone [-]."""
        return float(chi2.sf(np.sum(self.z**2), self.z.size))


def edges(pixels: int, reach: float) -> Floats:
    """Return the edges of the strips [mfp]."""
    return np.linspace(-reach, reach, pixels + 1)


def solved(alpha: float, illumination: str, at: Floats) -> Floats:
    """Return A L averaged over the strips between `at`, by Gauss's rule: the edge at 0 must be one of them."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    setting = Setting(illumination)
    x = at[:-1, None] + 0.5 * np.diff(at)[:, None] * (nodes + 1.0)
    return exact.reflectance(alpha, setting) * np.asarray(step_response(x, alpha, setting=setting)) @ (0.5 * weights)


def traced(alpha: float, illumination: str, at: Floats, rays: int, seed: int) -> tuple[Floats, Floats]:
    """Return A L averaged over the strips, and its standard error, from so many rays a strip."""
    mitsuba.set_variant(VARIANT)
    scene, integrator = mitsuba.load_dict(_scene(alpha)), mitsuba.load_dict(_integrator())
    sampler = mitsuba.load_dict({"type": "independent"})
    sampler.seed(seed)
    draws = np.random.default_rng(seed).random((at.size - 1, rays, 3))
    places = at[:-1, None] + np.diff(at)[:, None] * draws[..., 0]
    found = np.empty(places.shape)
    for index in np.ndindex(found.shape):
        direction = downward_cosine(*draws[index][1:]) if illumination == "diffuse" else [0.0, 0.0, -1.0]
        ray = mitsuba.RayDifferential3f(o=[places[index], 0.0, EYE], d=direction)
        found[index] = integrator.sample(scene, sampler, ray)[0][0]
    return found.mean(axis=1), found.std(axis=1, ddof=1) / np.sqrt(rays)


def compared(
    alpha: float, illumination: str, rays: int, seed: int = 1, pixels: int = PIXELS, reach: float = RANGE
) -> Comparison:
    """Compare one albedo under one light."""
    at = edges(pixels, reach)
    begin = time.perf_counter()
    mean, error = traced(alpha, illumination, at, rays, seed)
    seconds = time.perf_counter() - begin
    return Comparison(alpha, illumination, mean, error, solved(alpha, illumination, at), seconds)


def downward_cosine(a: float, b: float) -> list[float]:
    """Draw a cosine-weighted direction into the slab."""
    sine, angle = np.sqrt(a), 2.0 * np.pi * b
    return [sine * np.cos(angle), sine * np.sin(angle), -np.sqrt(1.0 - a)]


def _integrator() -> dict[str, Any]:
    return {"type": "volpath", "max_depth": -1, "rr_depth": ROULETTE}


def _scene(alpha: float) -> dict[str, Any]:
    transform = mitsuba.ScalarTransform4f
    return {
        "type": "scene",
        "light": {"type": "constant", "radiance": _even(1.0)},
        "slab": {
            "type": "cube",
            "to_world": transform().translate([0.0, 0.0, -DEPTH / 2]).scale([HALF, HALF, DEPTH / 2]),
            "bsdf": {"type": "null"},
            "interior": {"type": "homogeneous", "albedo": _even(alpha), "sigma_t": 1.0},
        },
        "plane": {
            "type": "rectangle",  # of side 2, to x = 0
            "to_world": transform().translate([-2 * HALF, 0.0, GAP]).scale([2 * HALF, 4 * HALF, 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": _even(0.0)},
        },
    }


def _even(value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": value}


def report(found: Sequence[Comparison]) -> None:
    """Print chi-square of each, and the strips of all."""
    show(
        f"Step edge, mitsuba {mitsuba.__version__} against the integral",
        ("light", "alpha", "chi2", "strips", "chance", "largest |z|", "largest standard error / A", "seconds"),
        [
            (
                one.illumination,
                f"{one.alpha:g}",
                f"{np.sum(one.z**2):.1f}",
                str(one.z.size),
                f"{one.chance:.3f}",
                f"{np.max(np.abs(one.z)):.2f}",
                f"{np.max(one.standard_error) / exact.reflectance(one.alpha, Setting(one.illumination)):.4f}",
                f"{one.seconds:.0f}",
            )
            for one in found
        ],
    )
    middles = edges(PIXELS, RANGE)[:-1] + RANGE / PIXELS
    show(
        "A L over each strip: mitsuba, the integral, z",
        ("x [mfp]", *(f"{one.illumination} {one.alpha:g}" for one in found)),
        [
            (f"{middles[k]:+.1f}", *(f"{one.traced[k]:.5f} {one.solved[k]:.5f} {one.z[k]:+.2f}" for one in found))
            for k in range(PIXELS)
        ],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays", type=int, default=100_000, help="of each strip")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    report([compared(a, light, options.rays, options.seed) for light in ILLUMINATIONS for a in ALPHAS])


if __name__ == "__main__":
    main()
