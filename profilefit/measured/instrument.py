"""What stands between a profile and a row of data: the beam's width, and the ring or the fibre that gathers light.

The light at a distance d from the axis of a beam of irradiance b is

    R_b(d) = int_0^inf D(rho) K(d, rho) drho,    D = 2 pi rho R_d(rho),    K the mean of b over a circle (`beam`)

(the convolution of R_d with b in polar coordinates), and a row is its mean over a ring or the end of a fibre. So a
row is a sum over nodes rho with weights that know nothing of the medium. All rows share their nodes. Points under a
pencil beam are their own; else D between nodes is a polynomial through eight of them, in t = ln(e^{rho / grain} - 1),
which is ln rho near the axis and rho itself far from it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from profilefit.measured.beam import Floats, Irradiance, Nodes, TopHat

RING = np.polynomial.legendre.leggauss(16)
NEAR = 1000.0  # outer over inner radius, up to which a ring's nodes are straight in ln d
# Shared nodes: how many a polynomial goes through, their distance in t, the first t, and grains to the last of them.
STENCIL, STEP, FIRST, GRAINS = 8, 0.2, -10.0, 120.0
COUNT = int(np.ceil((GRAINS - FIRST) / STEP)) + STENCIL


@dataclass(frozen=True)
class Instrument:
    """How the light of a row is gathered.

    beam   None of a pencil beam
    fibre  radius of the fibre's core that a point is averaged over [unit of r], which may cover the axis; 0 of a point
    """

    beam: Irradiance | None = None
    fibre: float = 0.0

    def nodes(self, inner: Floats, outer: Floats, farthest: float = 0.0) -> Nodes:
        """Radii and weights [1/unit^2 per D drho] of rows from `inner` to `outer` (n,).

        The radii (m,) are those of all rows, at least up to `farthest`, and the weights (n, m).
        """
        return self.gathered(*self._distances(inner, outer), farthest)

    def gathered(self, d: Floats, mean: Floats, farthest: float = 0.0) -> Nodes:
        """Like `nodes`, of rows that are sums over distances d (n, M) from the axis, weighted by `mean` (n, M)."""
        if self.beam is None:
            own = mean / (2.0 * np.pi * d)
            return (d[:, 0], np.diag(own[:, 0])) if d.shape[1] == 1 else _shared(zip(d, own, strict=True), farthest)
        counts = [(one[share > 0], share[share > 0]) for one, share in zip(d, mean, strict=True)]
        beams = (self.beam.nodes(one) for one, _ in counts)
        rows = ((rho, share[:, None] * weight) for (rho, weight), (_, share) in zip(beams, counts, strict=True))
        return _shared(rows, farthest)

    def _distances(self, inner: Floats, outer: Floats) -> Nodes:
        """Distances (n, M) from the axis, and how much each counts in the mean over the row's area."""
        if np.all(outer > inner):
            t, dt = 0.5 * (1.0 + RING[0]), 0.5 * RING[1]
            # Straight in ln d between edges that are near each other, else cubic from the axis.
            near = (inner > 0) & (outer < NEAR * inner)
            low = np.where(near, inner, 1.0)[:, None]
            ratio = np.log(np.where(near, outer, np.e)[:, None] / low)
            apart = (outer - inner)[:, None]
            d = np.where(near[:, None], low * np.exp(ratio * t), inner[:, None] + apart * t**3)
            step = np.where(near[:, None], d * ratio, apart * 3.0 * t**2) * dt
            return d, 2.0 * d * step / ((outer - inner) * (outer + inner))[:, None]
        if self.fibre == 0:
            return inner[:, None], np.ones((inner.size, 1))
        d, share = TopHat(self.fibre).nodes(inner)  # a circle's share of a disc, whichever of them is about the axis
        return d, 2.0 * np.pi * d * share


PENCIL = Instrument()


def _shared(each: Iterable[Nodes], farthest: float) -> Nodes:
    """The nodes and weights of all rows on common nodes, as many for any beam."""
    rows = list(each)
    grain = max(farthest, *(float(rho.max()) for rho, _ in rows)) / GRAINS
    weights = np.zeros((len(rows), COUNT))
    for row, (rho, weight) in enumerate(rows):
        at = (np.maximum(_straight(rho / grain), FIRST).ravel() - FIRST) / STEP
        first = np.clip(np.floor(at).astype(int) - STENCIL // 2 + 1, 0, COUNT - STENCIL)
        for one in range(STENCIL):
            others = [other for other in range(STENCIL) if other != one]
            basis = np.prod([(at - first - other) / (one - other) for other in others], axis=0)
            weights[row] += np.bincount(first + one, weight.ravel() * basis, COUNT)
    return grain * np.logaddexp(0.0, FIRST + STEP * np.arange(COUNT)), weights


def _straight(grains: Floats) -> Floats:
    """t of a radius > 0 in grains."""
    found: Floats = grains + np.log(-np.expm1(-grains))
    return found
