"""Fur that no closed form is for: feet apart or in tufts; and a lamp next to the eye.

What is seen is exp(-kappa n (1 - z / L)^2 A), where kappa is 1 for feet that are independent of each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.fur_patches import spaced_patch, tufted_patch
from profilefit.fitting.solver import differences, solve
from profilefit.scenes.fur.law import shadow, visibility
from profilefit.scenes.fur.truth import Patch, cast, random_patch, struck

Floats = NDArray[np.float64]
Rows = list[tuple[str | float, ...]]
RADIUS = 0.05
PATCHES, SIDE = 16, 5.0
LATTICE = 50  # rays of a patch along a side, one anywhere in each of its squares
RAYS = LATTICE**2
DENSITIES, DEGREES, HEIGHTS = (16.0, 64.0, 144.0), (0.0, 30.0, 60.0, 75.0), (0.0, 0.3, 0.6)
LEAST, STEP = 0.02, 1e-6  # seen, of which kappa is told; of a constant, for derivatives
PACKING, EACH, SPREAD = 0.5, 8, 0.5  # n d^2; strands of a tuft; its radius by the tufts' mean distance
LAMP_DENSITIES, EYES, LAMPS = (16.0, 64.0), (0.0, 45.0), (0.0, 15.0, 30.0, 60.0)


def _spaced(density: float, side: float, seed: int) -> Patch:
    return spaced_patch(density, RADIUS, 1.0, side, PACKING, seed)


def _tufted(density: float, side: float, seed: int) -> Patch:
    return tufted_patch(density, RADIUS, 1.0, side, EACH, SPREAD * (EACH / density) ** 0.5, seed)


KINDS: dict[str, Callable[[float, float, int], Patch]] = {
    f"apart, n d^2 = {PACKING:g}": _spaced,
    f"tufts of {EACH}": _tufted,
}


class Feet(NamedTuple):
    """Feet that are not independent: what is seen is exp(-kappa n (1 - z / L)^2 A), kappa = (1 + size q^power)^sign.

    q = r0 sqrt(n) (1 - z / L), the strands' radius at their height over their distance. Fitted to rays, 30 to 75
    degrees, r0 sqrt(n) 0.2 to 0.6 (`--only feet-laws`); seen head on kappa is nearer 1.
    """

    size: float
    power: float
    sign: int

    def factor(self, thick: float) -> float:
        """Return kappa [-] of thick = q, by which the density in `visibility` is multiplied."""
        return float((1.0 + self.size * thick**self.power) ** self.sign)


# Feet that are at least sqrt(0.5 / n) apart; and tufts of 8 over discs of half the tufts' mean distance.
FEET = {"apart": Feet(2.06, 1.49, 1), "tufts": Feet(2.16, 1.23, -1)}


def shared_shadow(radius: float, length: float, eye: float, lamp: float, turn: float = 0.0) -> float:
    """Return the area that an upright cone hides of the skin from an eye and from a lamp at once [length^2].

    eye, lamp  angles to the normal in [0, pi / 2);  turn  between them about the normal in [0, pi] [rad]

    r0^2 (pi + tan a - a), a = max(0, min(a1, a2, (a1 + a2 - turn) / 2)), cos a_i = r0 / d_i: both are a disc and a
    spike, which shrinks as secants of the angle about the disc's middle. Turned by 0 the shorter is within the longer.
    What an eye sees is lit by exp(-n (1 - z / L)^2 (A(lamp) - shared)), more than `visibility` says: the hot spot.
    """
    ends = [float(np.arccos(min(radius / max(length * np.tan(at), radius), 1.0))) for at in (eye, lamp)]
    a = max(min(*ends, 0.5 * (sum(ends) - turn)), 0.0)
    return float(radius**2 * (np.pi + np.tan(a) - a))


class Seen(NamedTuple):
    """Shares of rays that meet nothing above each height, and their standard errors over patches."""

    share: Floats
    error: Floats


def seen(
    make: Callable[[float, int], Patch],
    theta: float,
    heights: Sequence[float],
    patches: int = PATCHES,
    least_side: float = SIDE,
) -> Seen:
    """Trace patches that `make` makes of a side and a seed, so wide that no ray comes by a strand twice."""
    side, found = max(least_side, 1.3 * float(np.tan(theta))), []
    for seed in range(patches):
        patch = make(side, seed)
        first = cast(patch, theta, spread(patch, seed))
        found.append([float(np.mean(first <= z)) for z in heights])
    return Seen(np.mean(found, axis=0), np.std(found, axis=0, ddof=1) / patches**0.5)


def spread(patch: Patch, seed: int) -> Floats:
    """Return where rays pass the tips (RAYS, 2), more evenly than those of `rays`."""
    cell = np.stack(np.meshgrid(np.arange(LATTICE), np.arange(LATTICE)), axis=-1).reshape(-1, 2)
    return (cell + np.random.default_rng([seed, 5]).random(cell.shape)) * (patch.side / LATTICE)


class Factor(NamedTuple):
    """Factor kappa, and what it is of."""

    kind: str
    density: float
    degrees: float
    z: float
    kappa: float
    error: float

    @property
    def thick(self) -> float:
        """Density r0 sqrt(n) of the strands at their height."""
        return RADIUS * self.density**0.5 * (1.0 - self.z)


@cache
def factors() -> list[Factor]:
    found = []
    for kind, make in KINDS.items():
        for density in DENSITIES:
            for degrees in DEGREES:
                theta = float(np.radians(degrees))
                share, error = seen(partial(make, density), theta, HEIGHTS)
                for z, one, off in zip(HEIGHTS, share, error, strict=True):
                    strands = density * (1.0 - z) ** 2 * float(shadow(RADIUS, 1.0, theta))
                    if one > LEAST:
                        kappa, noise = -float(np.log(one)) / strands, float(off / one) / strands
                        found.append(Factor(kind, density, degrees, z, kappa, noise))
    return found


def feet() -> Rows:
    """Return kappa over height for each kind, density and angle, and its largest standard error."""
    found: Rows = []
    for kind in KINDS:
        for density in DENSITIES:
            for degrees in DEGREES:
                own = {f.z: f for f in factors() if (f.kind, f.density, f.degrees) == (kind, density, degrees)}
                if own:
                    each = [own[z].kappa if z in own else "" for z in HEIGHTS]
                    errors = [own[z].error if z in own else "" for z in HEIGHTS]
                    found.append((kind, RADIUS * density**0.5, degrees, *each, *errors))
    return found


def feet_laws() -> Rows:
    """Fit kappa = (1 + a q^b)^(+-1), q = r0 sqrt(n) (1 - z / L), oblique; and as one constant."""
    found: Rows = []
    for (kind, _), power in zip(KINDS.items(), (1.0, -1.0), strict=True):
        own = [f for f in factors() if f.kind == kind and f.degrees > 0.0]
        q, kappa, noise = (np.array([getattr(f, name) for f in own]) for name in ("thick", "kappa", "error"))
        weight = 1.0 / np.hypot(noise, 0.02 * kappa)

        def left(c: Floats, q: Floats = q, kappa: Floats = kappa, weight: Floats = weight, p: float = power) -> Floats:
            return np.asarray(((1.0 + np.exp(c[0]) * q ** c[1]) ** p - kappa) * weight)

        best = solve(differences(left, STEP), np.array([0.0, 1.0]))
        (log, b), errors = best.parameters.tolist(), np.sqrt(np.diag(best.covariance) * best.variance)
        a, off = float(np.exp(log)), np.abs(best.residuals / weight / kappa)
        head_on = [f for f in factors() if f.kind == kind and f.degrees == 0.0]
        there = max(abs((1.0 + a * f.thick**b) ** power / f.kappa - 1.0) for f in head_on)
        found.append(
            (
                kind,
                "1 + a q^b" if power > 0 else "1 / (1 + a q^b)",
                *(a, a * float(errors[0]), b, float(errors[1])),
                *(float(np.sqrt(np.mean(off**2))), float(off.max()), there),
                *(float(kappa.mean()), float(kappa.std(ddof=1))),
            )
        )
    return found


def lamps() -> Rows:
    """Return light that comes to what an eye sees, on the skin and on sides of strands that face the lamp.

    Over the mean of `visibility`, and over exp(-n (1 - z / L)^2 (A of the lamp - shared shadow)), with their noise.
    """
    found: Rows = []
    for density in LAMP_DENSITIES:
        for eye in EYES:
            for apart in LAMPS:
                found.append((density, eye, f"{apart:g}", *_lit(density, eye, eye - apart if eye else apart)))
        found.append((density, 45.0, "60, aside", *_lit(density, 45.0, 45.0, True)))
    return found


def _lit(density: float, eye: float, lamp: float, aside: bool = False) -> list[float]:
    """Light by a lamp in the eye's plane, or at a right angle to it about the normal."""
    to_eye, to_lamp = float(np.radians(eye)), float(np.radians(lamp))
    turn = 0.5 * np.pi if aside else 0.0 if lamp >= 0 else np.pi
    area = float(shadow(RADIUS, 1.0, abs(to_lamp)))
    own = area - shared_shadow(RADIUS, 1.0, to_eye, abs(to_lamp), turn)
    sums = []
    for seed in range(PATCHES):
        patch = random_patch(density, RADIUS, 1.0, SIDE, seed)
        start = spread(patch, seed)
        z, which = struck(patch, to_eye, start)
        place = start - np.array([np.tan(to_eye), 0.0]) * (1.0 - z)[:, None]
        away = place - patch.feet[which]
        away -= patch.side * np.round(away / patch.side)
        if aside:  # x and y change places, so that the lamp is toward +x
            patch, place, away = Patch(patch.feet[:, ::-1], patch.side, RADIUS, 1.0), place[:, ::-1], away[:, ::-1]
        back = np.mod(place + np.array([np.tan(to_lamp), 0.0]) * (1.0 - z)[:, None], patch.side)
        lit = cast(patch, to_lamp, back) <= z + 1e-9
        out = away[:, 0] / np.maximum(np.hypot(*away.T), 1e-12)
        faces = out * np.sin(to_lamp) + RADIUS * np.cos(to_lamp) > 0.0
        law = np.asarray(visibility(density, RADIUS, 1.0, abs(to_lamp), z))
        exact = np.exp(-density * (1.0 - z) ** 2 * own)
        for chosen in (which < 0, (which >= 0) & faces):
            sums.append([np.sum(each[chosen]) for each in (lit, law, exact)])
    table = np.array(sums, float).reshape(PATCHES, 2, 3)
    row: list[float] = []
    for kind in range(2):
        true, law, exact = table[:, kind].T
        noise = float(np.std(true - true.sum() / exact.sum() * exact, ddof=1) * PATCHES**0.5 / exact.sum())
        row += [float(true.sum() / law.sum()), float(true.sum() / exact.sum()), noise]
    return row
