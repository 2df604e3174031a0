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

    c = c0 + c2 (1 - g)^2 + c3 (1 - g)^3 + cn rho, d and f likewise: 12 constants [-] for n from 1.3 to 1.5, g up to
    .95, under either light. A_1 is that of the phase function.
    """

    setting: Setting = eqx.field(static=True)
    c0: float
    c2: float
    c3: float
    cn: float
    d0: float
    d2: float
    d3: float
    dn: float
    f0: float
    f2: float
    f3: float
    fn: float
    entry = Entry(
        "rational",
        "rational map",
        is_map=True,
        records=("albedo-rational",),
        start={  # within a tenth of the exact map
            **{"c0": -0.2, "c2": 6.7, "c3": -4.6, "cn": -0.1},
            **{"d0": -0.9, "d2": 4.5, "d3": -1.7, "dn": 1.3},
            **{"f0": 0.8, "f2": -5.8, "f3": 5.0, "fn": -0.2},
        },
        n=INDICES,
        g=COSINES,
        own=True,
        text=Text("refracting_rational", (), prefix="rational"),
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return ("c0", "d0", "f0")

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        forward = 1.0 - float(here.g)
        terms = {"0": 1.0, "2": forward**2, "3": forward**3, "n": float(here.trapped)}
        return {letter: {letter + name: value for name, value in terms.items()} for letter in "cdf"}

    def folded(self) -> tuple[Number, Number, Number]:
        here = self.here()
        z, rho = 1.0 - here.g, here.trapped
        return (
            self.c0 + z**2 * (self.c2 + z * self.c3) + rho * self.cn,
            self.d0 + z**2 * (self.d2 + z * self.d3) + rho * self.dn,
            self.f0 + z**2 * (self.f2 + z * self.f3) + rho * self.fn,
        )
