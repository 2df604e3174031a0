"""Neighbouring cells of one class as one region: its span, its size, its worst cell and what helps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from profilefit.studies.stability.cells import ADVICE, Cells, Mask, Verdict


@dataclass(frozen=True)
class Region:
    """Cells of one subject, quantity, arithmetic and class that touch.

    count   of cells;  inside  how many of them lie where the law says that it holds
    where   span along each axis, in words;  place, value, reference, error  of the worst cell
    advice  one sentence: what helps, or why the cells are not judged
    """

    subject: str
    own: bool
    quantity: str
    arithmetic: str
    verdict: Verdict
    count: int
    inside: int
    where: str
    place: str
    value: float
    reference: float
    error: float
    bound: float
    advice: str

    @property
    def is_failure(self) -> bool:
        """Whether one of this project's laws breaks its promise."""
        return self.own and self.inside > 0 and self.verdict.is_red


def regions_of(cells: Cells) -> list[Region]:
    """Return the red regions of a tensor, largest first, and after them those that are not judged."""
    verdicts = [one for one in sorted(cells.verdicts) if one.is_red or one == Verdict.NOT_JUDGED]
    regions = [_region(cells, part, verdict) for verdict in verdicts for part in _parts(cells, verdict)]
    return sorted(regions, key=lambda one: (not one.verdict.is_red, -one.count))


def _parts(cells: Cells, verdict: Verdict) -> Iterator[Mask]:
    """Yield the connected parts of a class; all of it at once where the first axis has labels for values."""
    chosen = cells.codes == verdict
    if cells.axes[0].labels:
        yield chosen
        return
    labels, count = ndimage.label(chosen, structure=np.ones((3,) * chosen.ndim, int))
    for number in range(1, count + 1):
        yield labels == number


def _region(cells: Cells, part: Mask, verdict: Verdict) -> Region:
    held = part & cells.inside
    errors = np.where(held if np.any(held) else part, np.nan_to_num(cells.error, nan=np.inf, posinf=np.inf), -1.0)
    worst = np.unravel_index(int(np.argmax(errors)), part.shape)
    at = np.argwhere(part)
    spans = [axis.span(int(at[:, i].min()), int(at[:, i].max())) for i, axis in enumerate(cells.axes)]
    return Region(
        subject=cells.subject,
        own=cells.own,
        quantity=cells.quantity,
        arithmetic=cells.arithmetic,
        verdict=verdict,
        count=int(part.sum()),
        inside=int(held.sum()),
        where="; ".join(spans),
        place="; ".join(axis.span(int(i), int(i)) for axis, i in zip(cells.axes, worst, strict=True)),
        value=float(cells.value[worst]),
        reference=float(cells.reference[worst]),
        error=float(cells.error[worst]),
        bound=float(cells.bound),
        advice=(cells.advice or ADVICE[cells.arithmetic]) if verdict.is_red else cells.unjudged,
    )
