"""Red cells that touch and share class and cause, as one region: where it lies, its worst cell, why, and what helps.

Cells that are not judged make up regions of their own, whose cause says why.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from profilefit.studies.stability.cause import UNEXPLAINED, Cause, nowhere
from profilefit.studies.stability.causes_of_fur import FUR
from profilefit.studies.stability.causes_of_heart import HEART
from profilefit.studies.stability.causes_of_liang import LIANG
from profilefit.studies.stability.causes_of_models import FORMAT, MODELS
from profilefit.studies.stability.causes_of_sea import SEA
from profilefit.studies.stability.causes_of_stacks import STACKS
from profilefit.studies.stability.cells import Cells, Mask, Verdict, red

# The first that holds is told: what is special before what is general.
CAUSES: tuple[Cause, ...] = (*LIANG, *MODELS, *STACKS, *HEART, *SEA, *FUR, *FORMAT)


NOT_JUDGED = "not judged"


@dataclass(frozen=True)
class Region:
    """Cells of one subject, quantity, arithmetic, class and cause.

    count   of cells; inside how many of them where the law says that it holds
    where   its span along each axis, in words; place, value, reference, error  of its worst cell
    """

    subject: str
    own: bool
    quantity: str
    arithmetic: str
    verdict: Verdict
    cause: Cause
    count: int
    inside: int
    where: str
    place: str
    value: float
    reference: float
    error: float
    bound: float

    @property
    def is_failure(self) -> bool:
        """Whether one of our own laws breaks its word."""
        return self.own and self.inside > 0 and self.verdict.is_red

    @property
    def is_unexplained(self) -> bool:
        return self.cause is UNEXPLAINED


def regions_of(cells: Cells) -> list[Region]:
    """The red regions of a tensor, largest first, and after them those that are not judged."""
    aside = cells.codes == Verdict.NOT_JUDGED
    why = Cause(NOT_JUDGED, cells.unjudged, "", nowhere)
    rest = [_region(cells, part, Verdict.NOT_JUDGED, why) for part in _parts(aside)] if np.any(aside) else []
    if not np.any(red(cells.codes)):
        return rest
    causes = explained(cells)
    found = []
    pairs = zip(cells.codes.flat, causes.flat, strict=True)
    for verdict, cause in sorted({(int(code), int(cause)) for code, cause in pairs if cause >= 0}):
        alike = (cells.codes == verdict) & (causes == cause)
        parts = [alike] if cells.axes[0].labels else _parts(alike)
        found += [_region(cells, part, Verdict(verdict), _cause(cause)) for part in parts]
    return [*sorted(found, key=lambda one: -one.count), *rest]


def explained(cells: Cells) -> NDArray[np.int16]:
    """For each red cell the index of the first of `CAUSES` that holds, their number if none does; -1 elsewhere."""
    left = red(cells.codes)
    found = np.where(left, len(CAUSES), -1).astype(np.int16)
    for index, cause in enumerate(CAUSES):
        if not np.any(left):
            break
        if cells.verdicts & cause.verdicts:
            with np.errstate(all="ignore"):
                here = (
                    left & np.broadcast_to(cause.holds(cells), left.shape) & np.isin(cells.codes, list(cause.verdicts))
                )
            found[here] = index
            left = left & ~here
    return found


def summed(regions: Sequence[Region]) -> dict[Verdict, int]:
    """Cells of each class that has regions."""
    counts: dict[Verdict, int] = {}
    for one in regions:
        counts[one.verdict] = counts.get(one.verdict, 0) + one.count
    return counts


def _cause(index: int) -> Cause:
    return CAUSES[index] if index < len(CAUSES) else UNEXPLAINED


def _parts(alike: Mask) -> Iterator[Mask]:
    labels, count = ndimage.label(alike, structure=np.ones((3,) * alike.ndim, int))
    for number in range(1, count + 1):
        yield labels == number


def _region(cells: Cells, part: Mask, verdict: Verdict, cause: Cause) -> Region:
    held = part & cells.inside
    judged = np.where(held if np.any(held) else part, np.nan_to_num(cells.error, nan=np.inf, posinf=np.inf), -1.0)
    worst = np.unravel_index(int(np.argmax(judged)), part.shape)
    at = np.argwhere(part)
    spans = [axis.span(int(at[:, i].min()), int(at[:, i].max())) for i, axis in enumerate(cells.axes)]
    return Region(
        subject=cells.subject,
        own=cells.own,
        quantity=cells.quantity,
        arithmetic=cells.arithmetic,
        verdict=verdict,
        cause=cause,
        count=int(part.sum()),
        inside=int(held.sum()),
        where="; ".join(spans),
        place="; ".join(axis.span(int(i), int(i)) for axis, i in zip(cells.axes, worst, strict=True)),
        value=float(cells.value[worst]),
        reference=float(cells.reference[worst]),
        error=float(cells.error[worst]),
        bound=float(cells.bound),
    )
