"""Instruments: the beam, and the ring or the fibre that gathers light, between a profile and a row of data.

K(d, rho) is the mean of a beam's irradiance b over the circle of radius rho about a point at the distance d from its
axis; b integrates to 1. A Gaussian beam of 1/e^2 radius w, b = 2 / (pi w^2) e^{-2 r^2 / w^2}, has
K = b(d - rho) I_0(4 d rho / w^2) e^{-4 d rho / w^2}; a top hat of radius a, b = 1 / (pi a^2), has K = b theta / pi,
cos theta = (d^2 + rho^2 - a^2) / (2 d rho). The light at the distance d is

    R_b(d) = int_0^inf D(rho) K(d, rho) drho,    D = 2 pi rho R_d(rho)

(the convolution of R_d with b in polar coordinates), and a row is its mean over a ring or the end of a fibre. So a
row is a sum over nodes rho with weights that know nothing of the medium. All rows share their nodes. Points under a
pencil beam are their own; else D between nodes is a polynomial through eight of them, in t = ln(e^{rho / grain} - 1),
which is ln rho near the axis and rho itself far from it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.special import i0e

from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.arrays import Floats, as_number
from profilefit.errors import InputError
from profilefit.measured.data import TOPHAT, Facts

Nodes = tuple[Floats, Floats]
PANEL = np.polynomial.legendre.leggauss(6)
PANELS, REACH = 12, 6.0  # of a Gaussian beam: as wide as its standard deviation twice, so many w to either side
GRADED, FINER = 9, 3.0  # panels into which the nearest one is divided, each that much narrower than the next
EDGE = np.polynomial.legendre.leggauss(40)  # where a circle crosses the rim of a top hat
OCTAVES = 10  # of a measured beam's radii, down from its last, as panels
STEEP, STEEPEST = 0.05, 8  # change over its brightest in a straight piece that is a panel, too; as many of these
AROUND = np.polynomial.legendre.leggauss(8)  # of a circle, in each panel
LEAST = 1e-12  # of a beam's radius, from a point to a circle about it
MAX_BYTES, MOST_ROWS = 2**20, 2000  # of a beam's file
CELLS = re.compile(r"[\s,;]+")
RING = np.polynomial.legendre.leggauss(16)
NEAR = 1000.0  # outer over inner radius, up to which a ring's nodes are straight in ln d
# Shared nodes: how many a polynomial goes through, their distance in t, the first t, and grains to the last of them.
STENCIL, STEP, FIRST, GRAINS = 8, 0.2, -10.0, 120.0
COUNT = int(np.ceil((GRAINS - FIRST) / STEP)) + STENCIL


@dataclass(frozen=True)
class Gaussian:
    """A beam of 1/e^2 radius w [unit of r]."""

    w: float

    @property
    def words(self) -> str:
        return f"a Gaussian beam of 1/e^2 radius {self.w:g}"

    def nodes(self, d: Floats) -> Nodes:
        reach = REACH * self.w
        low, high = np.maximum(d - reach, 0.0), d + reach
        edges = low[..., None] + (high - low)[..., None] * np.arange(PANELS + 1) / PANELS
        near, far = _graded(low, edges[..., 1]), between(edges[..., 1:])
        rho, weight = (np.concatenate(each, axis=-1) for each in zip(near, far, strict=True))
        b = 2.0 / (np.pi * self.w**2) * np.exp(-2.0 * ((d[..., None] - rho) / self.w) ** 2)
        return rho, weight * b * i0e(4.0 * d[..., None] * rho / self.w**2)


@dataclass(frozen=True)
class TopHat:
    """A uniform disc of radius a [unit of r]."""

    a: float

    @property
    def words(self) -> str:
        return f"a top hat of radius {self.a:g}"

    def nodes(self, d: Floats) -> Nodes:
        whole, dw = _graded(np.zeros_like(d), np.maximum(self.a - d, 0.0))
        whole = np.where(dw > 0, whole, self.a)  # off the beam nothing counts, anywhere
        low, high = np.abs(d - self.a), d + self.a
        t = 0.5 * (1.0 + EDGE[0])
        part = low[..., None] + (high - low)[..., None] * t * t * (3.0 - 2.0 * t)  # roots of K at both ends
        dp = (high - low)[..., None] * 6.0 * t * (1.0 - t) * 0.5 * EDGE[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = (d[..., None] ** 2 + part**2 - self.a**2) / (2.0 * d[..., None] * part)
        share = np.where(np.isfinite(cosine), np.arccos(np.clip(cosine, -1.0, 1.0)) / np.pi, 0.5)
        weights = np.concatenate([dw, dp * share], axis=-1) / (np.pi * self.a**2)
        return np.concatenate([whole, part], axis=-1), weights


@dataclass(frozen=True, eq=False)
class Profiled:
    """A measured beam: irradiance (n,) at radii (n,) from its axis, rising from 0, straight between them, 0 beyond."""

    r: Floats
    value: Floats

    @property
    def words(self) -> str:
        return f"a measured beam out to {self.r[-1]:g}"

    def nodes(self, d: Floats) -> Nodes:
        at, low = d[..., None], np.maximum(d - self.r[-1], 0.0)[..., None]
        edges = np.concatenate([low + self._edges, np.abs(at - self._edges), at + self._edges], axis=-1)
        rho, weight = between(np.sort(edges, axis=-1))
        rho, weight = np.maximum(rho, LEAST * self.r[-1]), weight * self._around(at, rho)
        return rho, weight / (2.0 * np.pi * np.sum(rho * weight, axis=-1))[..., None]

    @cached_property
    def _edges(self) -> Floats:
        """Radii between which b is smooth, or little of the light."""
        octaves = self.r[-1] * 0.5 ** np.arange(OCTAVES)
        change = np.abs(np.diff(self.value))
        steep = np.argsort(change)[-STEEPEST:]
        steep = steep[change[steep] > STEEP * self.value.max()]
        return np.unique(np.concatenate([[0.0], octaves, self.r[steep], self.r[steep + 1]]))

    def _around(self, d: Floats, rho: Floats) -> Floats:
        """Return the mean of b over circles, panel by panel of the distance s from the axis: none steps over a beam."""
        nearest, across = np.abs(d - rho)[..., None], (4.0 * d * rho)[..., None]
        s = np.maximum(self._edges, nearest)
        with np.errstate(divide="ignore", invalid="ignore"):  # circles about the axis, or of no radius
            turn = 2.0 * np.arcsin(np.sqrt(np.clip((s - nearest) * (s + nearest) / across, 0.0, 1.0)))
        turn = np.where(across > 0, turn, np.linspace(0.0, np.pi, s.shape[-1]))
        nodes, weights = between(turn, AROUND)
        far = np.sqrt(nearest**2 + across * np.sin(0.5 * nodes) ** 2)
        return np.asarray(np.sum(weights * np.interp(far, self.r, self.value, right=0.0), axis=-1) / np.pi, float)


# Its `nodes`: radii rho and weights K drho, (..., J) each, for distances d from the axis of any shape. `words` describe
# it in messages, without a unit.
Irradiance = Gaussian | TopHat | Profiled


def beam_of(option: str, text: str, unit: str, folder: Path = Path()) -> Irradiance:
    """Return the beam of a text, of a range its middle, in the `unit` of r; a file may lie in `folder`."""
    kind, sizes = Facts.parsed("beam", text, option, unit)
    return TopHat(*sizes) if kind == TOPHAT else Gaussian(sum(sizes) / len(sizes)) if sizes else _read(folder / kind)


def _read(path: Path) -> Profiled:
    """Read rows of a radius [unit of r] and an irradiance in any measure; a first row of names is passed over."""
    content = read_whole(path, MAX_BYTES)
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected a beam of at most {MAX_BYTES} bytes, got a longer file")
    text = content.decode("utf-8-sig", "replace")
    lines = [(at, line.partition("#")[0].strip()) for at, line in enumerate(text.splitlines(), start=1)]
    rows: list[list[float]] = []
    for number, (at, line) in enumerate((at, line) for at, line in lines if line):
        numbers = [as_number(cell) for cell in CELLS.split(line)]
        if number == 0 and any(math.isnan(one) for one in numbers):
            continue
        if len(numbers) != 2 or not all(math.isfinite(one) and one >= 0 for one in numbers):
            raise InputError(f"{path}:{at}: expected a radius >= 0 and an irradiance >= 0, got {line[:40]!r}")
        if rows and numbers[0] <= rows[-1][0]:
            raise InputError(f"{path}:{at}: expected radii that rise above {rows[-1][0]:g}, got {numbers[0]:g}")
        rows.append(numbers)
    while len(rows) > 2 and rows[-1][1] == rows[-2][1] == 0.0:  # darkness beyond the beam
        rows.pop()
    if not 2 <= len(rows) <= MOST_ROWS or not any(value > 0 for _, value in rows[:-1]):
        expected = f"2 to {MOST_ROWS} rows of radius and irradiance, with light"
        raise InputError(f"{path}: expected {expected}, got {len(rows)}")
    r, value = np.array(rows).T
    if r[0] > 0:  # a profile that begins off the axis is flat up to there
        r, value = np.append(0.0, r), np.append(value[0], value)
    return Profiled(r, value)


def between(edges: Floats, panel: Nodes = PANEL) -> Nodes:
    """Return nodes of the panels between edges (..., k) that rise, some of them without width."""
    half, middle = 0.5 * np.diff(edges)[..., None], 0.5 * (edges[..., 1:] + edges[..., :-1])[..., None]
    flat = (*edges.shape[:-1], -1)
    return (middle + half * panel[0]).reshape(flat), (half * panel[1]).reshape(flat)


def _graded(low: Floats, high: Floats) -> Nodes:
    """Return nodes between two radii (...,), finer towards the first."""
    edges, width = GRADES
    return low[..., None] + (high - low)[..., None] * edges, (high - low)[..., None] * width


GRADES = between(np.append(0.0, FINER ** np.arange(1.0 - GRADED, 0.5)))


@dataclass(frozen=True)
class Instrument:
    """Beam, None of a pencil beam, and radius of the fibre's core that a point is averaged over [unit of r]."""

    beam: Irradiance | None = None
    fibre: float = 0.0

    def nodes(self, inner: Floats, outer: Floats) -> Nodes:
        """Return radii (m,) of all rows from `inner` to `outer` (n,), and weights (n, m) [1/unit^2 per D drho]."""
        return self.gathered(*self._distances(inner, outer))

    def gathered(self, d: Floats, mean: Floats, farthest: float = 0.0) -> Nodes:
        """Return `nodes` of sums over distances d (n, M), weighted by `mean` (n, M); a beam's reach `farthest`."""
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
    """Return the nodes and weights of all rows on common nodes, as many for any beam."""
    rows = list(each)
    grain = max(farthest, *(float(rho.max()) for rho, _ in rows)) / GRAINS
    weights = np.zeros((len(rows), COUNT))
    for row, (rho, weight) in enumerate(rows):
        straight = rho / grain + np.log(-np.expm1(-rho / grain))  # t
        at = (np.maximum(straight, FIRST).ravel() - FIRST) / STEP
        first = np.clip(np.floor(at).astype(int) - STENCIL // 2 + 1, 0, COUNT - STENCIL)
        for one in range(STENCIL):
            others = [other for other in range(STENCIL) if other != one]
            basis = np.prod([(at - first - other) / (one - other) for other in others], axis=0)
            weights[row] += np.bincount(first + one, weight.ravel() * basis, COUNT)
    return grain * np.logaddexp(0.0, FIRST + STEP * np.arange(COUNT)), weights
