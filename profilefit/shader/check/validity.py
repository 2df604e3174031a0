"""Where a law says that it holds: what lies outside is counted apart and breaks nothing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.laws.burley import Burley, BurleyDiffuseMfp
from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.laws.rational import Rational
from profilefit.recipes import record
from profilefit.recipes.inventory import Named

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, ends included unless open."""

    low: float = 0.0
    high: float = 1.0
    open_low: bool = False
    open_high: bool = False

    def holds(self, values: Floats) -> NDArray[np.bool_]:
        """Which of the values lie inside."""
        above = values > self.low if self.open_low else values >= self.low
        return above & (values < self.high if self.open_high else values <= self.high)

    def __str__(self) -> str:
        return f"{'(' if self.open_low else '['}{self.low:g}, {self.high:g}{')' if self.open_high else ']'}"


EVERYWHERE = Range()
DARKEST = float(np.float32(1e-6))  # alpha [-] that the text of Liang's law takes where it is less: at 0 it is 0/0
# As the laws' own texts say; those not named here hold for every alpha. Radii are never restricted.
OF_ALPHA: dict[type[ProfileLaw], Range] = {
    Liang: Range(low=DARKEST),
    Burley: Range(open_low=True),
    BurleyDiffuseMfp: Range(open_low=True, open_high=True),
}


@dataclass(frozen=True)
class Validity:
    """Where a profile law holds: `alpha` of its profile and cdf, `drawn` and `xi` of its sampler; None nowhere."""

    alpha: Range | None
    drawn: Range | None
    xi: Range = EVERYWHERE


def of_profile(one: Named, folder: Path) -> Validity:
    """Of a law's own statement; the fitted inverse of Liang holds for the albedos of its record and for xi >= eps.

    Below eps it draws small radii a second time, and for dark media it turns back before xi = 1: so its text says. A
    record that is of the profile alone, or of the inverse alone, states nothing of the other.
    """
    span = next((span for kind, span in OF_ALPHA.items() if isinstance(one.law, kind)), EVERYWHERE)
    if not isinstance(one.law, Liang) or not one.records:
        return Validity(span, span)
    contents = [record.read(folder / f"{name}.json") for name in one.records]
    inverse = next((content for content in contents if content["pipeline"] == "inverse"), None)
    whole = inverse is None or len(contents) > 1
    return Validity(span if whole else None, _fitted(inverse) if inverse else None, Range(low=one.law.eps))


def _fitted(content: dict[str, Any]) -> Range:
    """The albedos of a record's protocol."""
    albedos = content["protocol"]["albedos"]
    return Range(albedos["low"], albedos["high"])


def masks(valid: Validity, alpha: Floats, xi: Floats) -> tuple[Mask, Mask]:
    """Which albedos (m, 1, 1) the profile holds for, and which albedos and shares (m, n, 1) the sampler."""
    profiled, drawn = (
        np.zeros(alpha.shape, bool) if span is None else span.holds(alpha) for span in (valid.alpha, valid.drawn)
    )
    return profiled[:, None, None], drawn[:, None, None] & valid.xi.holds(xi)[:, None]


def of_map(one: Named, folder: Path) -> tuple[Range, Range]:
    """Reflectances A and albedos alpha of a map: what it was fitted to if it is Liang's, else all that light allows.

    That of Liang has no A for albedos above its largest, at the fold.
    """
    law: AlbedoLaw = one.law
    if not isinstance(law, LiangAlbedo):
        return Range(0.0, law.entered if isinstance(law, Rational) else 1.0), EVERYWHERE
    largest = float(law.alpha(law.fold))
    if not one.records:
        return EVERYWHERE, Range(0.0, largest, open_high=True)
    fitted = _fitted(record.read(folder / f"{one.records[0]}.json"))
    low, high = np.asarray(exact.reflectance([fitted.low, fitted.high], setting=law.setting))
    return Range(float(low), float(high)), Range(fitted.low, min(fitted.high, largest), open_high=True)
