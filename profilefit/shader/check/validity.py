"""Where a law says that it holds: what lies outside is counted apart and breaks nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.entry import EVERYWHERE, Entry, Range
from profilefit.recipes.inventory import Named
from profilefit.recipes.record_folder import Folder, Records

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Validity:
    """Where a profile law holds: `alpha` of its profile and cdf, `drawn` and `xi` of its sampler; None nowhere."""

    alpha: Range | None
    drawn: Range | None
    xi: Range = EVERYWHERE


def of_profile(one: Named, folder: Folder) -> Validity:
    """Of a law's own statement; a fitted inverse may hold for the albedos of its record only, and for some of xi.

    A record that is of the profile alone, or of the inverse alone, states nothing of the other.
    """
    entry: Entry = one.law.entry
    if not (entry.as_fitted and one.records):
        return Validity(entry.alpha, entry.alpha)
    contents = [Records.of(folder).content(name) for name in one.records]
    inverse = next((content for content in contents if content["pipeline"] == "inverse"), None)
    whole = inverse is None or len(contents) > 1
    return Validity(entry.alpha if whole else None, _fitted(inverse) if inverse else None, entry.xi)


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


def of_map(one: Named, folder: Folder) -> tuple[Range, Range]:
    """Reflectances A and albedos alpha of a map: by its own statement, and of its record where it holds no further."""
    law: AlbedoLaw = one.law
    if not (law.entry.as_fitted and one.records):
        return law.reflectances, law.albedos
    fitted = _fitted(Records.of(folder).content(one.records[0]))
    low, high = np.asarray(exact.reflectance([fitted.low, fitted.high], setting=law.setting))
    return Range(float(low), float(high)), Range(fitted.low, min(fitted.high, law.albedos.high), open_high=True)
