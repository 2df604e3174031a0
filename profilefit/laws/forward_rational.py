"""The map between alpha and A where scattering has a direction, of which g is an argument."""

from __future__ import annotations

import equinox as eqx

from mcml_sim.media.setting import Setting
from profilefit.laws.entry import Entry, Range, Text
from profilefit.laws.refracting_rational import FoldedRational
from profilefit.laws.surface import Number

INDICES, COSINES = (
    Range(1.3, 1.5, open_low=True),
    Range(0.0, 0.95, open_low=True),
)  # n and g [-] that the constants hold for


class ForwardRational(FoldedRational):
    """`FoldedRational` with g as an argument: similarity in the reduced albedo holds next to white only.

    c = c0 + cg (1 - g) + cgg (1 - g)^2 + cn rho, d and f likewise: 12 constants [-] for n from 1.3 to 1.5, g up to .95,
    under either light. A_1 is that of the phase function.
    """

    setting: Setting = eqx.field(static=True)
    c0: float
    cg: float
    cgg: float
    cn: float
    d0: float
    dg: float
    dgg: float
    dn: float
    f0: float
    fg: float
    fgg: float
    fn: float
    entry = Entry(
        "rational",
        "rational map",
        is_map=True,
        records=("albedo-rational",),
        start={  # within a tenth of the exact map
            **{"c0": -0.2, "cg": 2.0, "cgg": 0.1, "cn": 0.1},
            **{"d0": -0.2, "dg": 2.5, "dgg": 0.1, "dn": 0.1},
            **{"f0": 0.7, "fg": -0.7, "fgg": -0.1, "fn": 0.01},
        },
        n=INDICES,
        g=COSINES,
        own=True,
        text=Text("refracting_rational", (), prefix="rational", clamps="A to the light that enters"),
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return ("c0", "d0", "f0")

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        forward = 1.0 - float(here.g)
        terms = {"0": 1.0, "g": forward, "gg": forward**2, "n": float(here.trapped)}
        return {letter: {letter + name: value for name, value in terms.items()} for letter in "cdf"}

    def folded(self) -> tuple[Number, Number, Number]:
        here = self.here()
        z, rho = 1.0 - here.g, here.trapped
        return (
            self.c0 + z * (self.cg + z * self.cgg) + rho * self.cn,
            self.d0 + z * (self.dg + z * self.dgg) + rho * self.dn,
            self.f0 + z * (self.fg + z * self.fgg) + rho * self.fn,
        )
