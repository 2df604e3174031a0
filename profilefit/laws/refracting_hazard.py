"""The hazard law under a surface that refracts: light scattered once, and the rest, each with a hazard of its own."""

from __future__ import annotations

import equinox as eqx

from mcml_sim.media.setting import Setting
from profilefit.laws.entry import CLAMPS, Entry, Text
from profilefit.laws.refracting_rational import REFRACTING, RefractingRational
from profilefit.laws.two_parts import ShapeCoefficients, TwoPartHazard


class RefractingHazard(TwoPartHazard):
    """Law of two hazard curves under a refracting interface.

    2 pi x R_d = alpha A_1 S_1 lambda_1 + (A - alpha A_1) S_2 lambda_2,   S, lambda as in `Hazard`,   x = r/l

    Under a surface that refracts, light scattered once dies with the critical angle, e^{-k_c x}, and all other light
    with kappa(alpha); one hazard cannot follow both. A_1, k_c and the strength at the source, lambda_1(0) = s_0 / A_1,
    are exact. No other light is there at the source: lambda_2(0) = 0, so w = c - kappa - a, and kappa is exact again.

    Next to the source that light grows as 2 pi x R_d -> 2 alpha^2 m x ln(1/x), m = e^{m0 + m1 (1 - alpha) + m2 (1 -
    alpha)^2} smooth in alpha, which sets h = -w (A - alpha A_1) / (alpha^2 m): A and kappa go with v = sqrt(1 - alpha)
    next to white, but R_d near the source does not. With rho the share of cosine-weighted light from inside that the
    surface reflects back (`RefractingSurface`), the shapes of light scattered again are

    a = a0 + a1 v + a2 v^2 + a3 kappa     c = (c0 + c1 v + c2 kappa)^2
    b = (q + sqrt(q^2 + 1e-4)) / 2, q = b0 + b1 v + b2 v^2, positive and smooth

    m0 = m00 + m01 rho + m02 rho^2     m1 = m10                    m2 = m21 rho + m22 rho^2
    a0 = a00 + a01 rho                 a1 = a10 + a11 rho          a2 = a20 + a21 rho        a3 = a31 rho + a32 rho^2
    b0 = b00 + b01 rho                 b1 = b10 + b11 rho          b2 = b20 + b21 rho
    c0 = c00 + c01 rho                 c1 = c10 + c12 rho^2        c2 = c20 + c21 rho + c22 rho^2

    and of light scattered once, whose shape hardly depends on n in units of 1 / lambda_1(0), y = k_c / lambda_1(0),

    h lambda_1(0) = once_h y     a / lambda_1(0) = once_a0 + once_a1 y     b / lambda_1(0)^2 = (once_b0 + once_b1 y)^2

    32 constants for every n in (1, 1.6], alpha in [0, 1] and r in [0, inf]; at one n they come to 16. `albedo` is the
    map to A (held fixed). Two exponentials and two logarithms a profile.
    """

    setting: Setting = eqx.field(static=True)
    albedo: RefractingRational = eqx.field(static=True)
    m00: float
    m01: float
    m02: float
    m10: float
    m21: float
    m22: float
    a00: float
    a01: float
    a10: float
    a11: float
    a20: float
    a21: float
    a31: float
    a32: float
    b00: float
    b01: float
    b10: float
    b11: float
    b20: float
    b21: float
    c00: float
    c01: float
    c10: float
    c12: float
    c20: float
    c21: float
    c22: float
    once_h: float
    once_a0: float
    once_a1: float
    once_b0: float
    once_b1: float
    entry = Entry(
        "hazard",
        "hazard",
        records=("hazard",),
        start={  # within a tenth of the exact profile, under either light
            **{
                "m00": -1.2,
                "m01": -0.25,
                "m02": -0.65,
                "m10": -0.4,
                "m21": 1.7,
                "m22": -2.3,
                "a00": 0.46,
                "a01": -0.32,
            },
            **{"a10": -0.6, "a11": -6.3, "a20": 0.54, "a21": 3.0, "a31": 3.8, "a32": 0.5, "b00": 0.11, "b01": -0.11},
            **{
                "b10": -0.2,
                "b11": 0.3,
                "b20": 0.07,
                "b21": -0.33,
                "c00": 0.38,
                "c01": -0.03,
                "c10": -0.97,
                "c12": -2.6,
            },
            **{
                "c20": 0.72,
                "c21": 0.48,
                "c22": 2.0,
                "once_h": 3.1,
                "once_a0": 0.79,
                "once_a1": -1.1,
                "once_b0": 0.073,
                "once_b1": -0.17,
            },
        },
        n=REFRACTING,
        own=True,
        text=Text("refracting_hazard", ("rational", "decay", "near_zero", "survival"), prefix="hazard", clamps=CLAMPS),
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return ("m00", "m10", "a00", "a10", "a20", "b00", "b10", "b20", "c00", "c10", "c20")

    def coefficients(self) -> ShapeCoefficients:
        """Return the constants of the shader source at the law's index."""
        here = self.here()
        rho, strength = here.trapped, here.source / here.once
        y = here.critical / strength
        return ShapeCoefficients(
            *(self.m00 + rho * (self.m01 + rho * self.m02), self.m10, rho * (self.m21 + rho * self.m22)),
            *(self.a00 + self.a01 * rho, self.a10 + self.a11 * rho, self.a20 + self.a21 * rho),
            rho * (self.a31 + rho * self.a32),
            *(self.b00 + self.b01 * rho, self.b10 + self.b11 * rho, self.b20 + self.b21 * rho),
            *(self.c00 + self.c01 * rho, self.c10 + self.c12 * rho**2, self.c20 + rho * (self.c21 + rho * self.c22)),
            self.once_h * y / strength,
            (self.once_a0 + self.once_a1 * y) * strength,
            ((self.once_b0 + self.once_b1 * y) * strength) ** 2,
        )

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        rho, strength = float(here.trapped), float(here.source / here.once)
        y = float(here.critical) / strength
        by_part: dict[str, dict[str, float]] = {}
        for name in self.constant_names():
            if not name.startswith("once"):  # letter, which of its coefficients, power of rho
                by_part.setdefault(name[:2], {})[name] = rho ** int(name[2])
        twice = 2.0 * float(self.once_b0 + self.once_b1 * y) * strength**2
        return {
            **by_part,
            "once_h": {"once_h": y / strength},
            "once_a": {"once_a0": strength, "once_a1": y * strength},
            "once_b": {"once_b0": twice, "once_b1": y * twice},
        }
