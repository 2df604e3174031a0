"""The hazard law where scattering has a direction: g is an argument, as the index of the surface is."""

from __future__ import annotations

import equinox as eqx

from mcml_sim.media.setting import Setting
from profilefit.laws.entry import CLAMPS, Entry, Text
from profilefit.laws.forward_rational import COSINES, INDICES, ForwardRational
from profilefit.laws.surface import Number
from profilefit.laws.two_parts import ShapeCoefficients, TwoPartHazard


class ForwardHazard(TwoPartHazard):
    """`TwoPartHazard` with g as an argument, in the reduced albedo a and l*.

    In these light changes little with g, and smoothly up to g = 1: light scattered once is that of p / (1 - g), exact,
    and each of the other shapes a straight line in 1 - g, and in rho, the share of cosine-weighted light from inside
    that the surface reflects back (`RefractingSurface`): with k any of them,

    k = k0 + kg (1 - g) + kn rho     m0 m1 m2, a0 a1 a2 (a3 = 0), b0 b1 b2, c0 c1 c2 of light scattered again;
    once_h lambda / y, once_a / lambda, sqrt(once_b) / lambda of light scattered once

    with lambda = s_0 / A_1 its strength at the source and y = k_c / lambda. 45 constants for n from 1.3 to 1.5, g up to
    .95, alpha in [0, 1] and r in [0, inf]; at one n and g they come to 15. kappa is that of isotropic light.
    """

    setting: Setting = eqx.field(static=True)
    albedo: ForwardRational = eqx.field(static=True)
    m00: float
    m0g: float
    m0n: float
    m10: float
    m1g: float
    m1n: float
    m20: float
    m2g: float
    m2n: float
    a00: float
    a0g: float
    a0n: float
    a10: float
    a1g: float
    a1n: float
    a20: float
    a2g: float
    a2n: float
    b00: float
    b0g: float
    b0n: float
    b10: float
    b1g: float
    b1n: float
    b20: float
    b2g: float
    b2n: float
    c00: float
    c0g: float
    c0n: float
    c10: float
    c1g: float
    c1n: float
    c20: float
    c2g: float
    c2n: float
    once_h0: float
    once_hg: float
    once_hn: float
    once_a0: float
    once_ag: float
    once_an: float
    once_b0: float
    once_bg: float
    once_bn: float
    entry = Entry(
        "hazard",
        "hazard",
        records=("hazard",),
        start={  # within a tenth of exact light
            **{"m00": -1.4, "m0g": 1.1, "m0n": -1.9},
            **{"m10": -0.4, "m1g": 0.0, "m1n": 0.0},
            **{"m20": 0.6, "m2g": -1.0, "m2n": -0.4},
            **{"a00": 0.4, "a0g": 0.0, "a0n": -0.1},
            **{"a10": -0.5, "a1g": 1.2, "a1n": 0.3},
            **{"a20": 0.1, "a2g": -0.0, "a2n": 0.2},
            **{"b00": 0.2, "b0g": 0.0, "b0n": -0.2},
            **{"b10": -0.0, "b1g": -0.2, "b1n": 0.0},
            **{"b20": -0.2, "b2g": 0.1, "b2n": 0.2},
            **{"c00": 0.5, "c0g": 0.1, "c0n": 0.0},
            **{"c10": -1.5, "c1g": -0.3, "c1n": -0.8},
            **{"c20": 1.4, "c2g": 0.3, "c2n": 0.5},
            **{"once_h0": 3.4, "once_hg": -0.6, "once_hn": 0.0},
            **{"once_a0": 0.25, "once_ag": 0.0, "once_an": 0.0},
            **{"once_b0": 0.1, "once_bg": -0.1, "once_bn": 0.0},
        },
        n=INDICES,
        g=COSINES,
        own=True,
        text=Text("refracting_hazard", ("rational", "decay", "near_zero", "survival"), prefix="hazard", clamps=CLAMPS),
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return tuple(f"{name}0" for name in SHAPES)

    def coefficients(self) -> ShapeCoefficients:
        here, k = self.here(), self._shapes()
        strength = here.source / here.once
        k["once_h"] = k["once_h"] * here.critical / strength**2
        k["once_a"] = k["once_a"] * strength
        k["once_b"] = (k["once_b"] * strength) ** 2
        return ShapeCoefficients(a3=0.0, **k)

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        strength = float(here.source / here.once)
        slopes = {
            "once_h": float(here.critical) / strength**2,
            "once_a": strength,
            "once_b": 2.0 * float(self._shapes()["once_b"]) * strength**2,
        }
        terms = {"0": 1.0, "g": 1.0 - float(here.g), "n": float(here.trapped)}
        return {name: {name + term: value * slopes.get(name, 1.0) for term, value in terms.items()} for name in SHAPES}

    def _shapes(self) -> dict[str, Number]:
        """Return k of each."""
        z, rho = 1.0 - self.here().g, self.here().trapped
        return {
            name: getattr(self, f"{name}0") + z * getattr(self, f"{name}g") + rho * getattr(self, f"{name}n")
            for name in SHAPES
        }


SHAPES = tuple(name for name in ShapeCoefficients._fields if name != "a3")
