"""Reference of a view under the sea: all light that comes to a pixel, of all orders, by paths followed backward.

Whatever a path is scattered or reflected by is lit by the sun as its rays came through the waves, `Sunlight`, and by
the sky where a path leaves the water. Of the picture that this judges it has the world and the first refraction, none
of its closed forms. Lengths in metres, z up.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats, checked_whole
from mcml_sim.media.medium import fresnel
from mcml_sim.media.phase import HenyeyGreenstein, Mixture, Phase
from profilefit.scenes.sea.truth import Photons, boxes
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves, first_hit, newton_hit, refracted

LEVELS, PIXELS, RAYS = 48, 256, 512  # of sunlight in the water: depths, and pixels and rays along a side of the tile
TOGETHER = 1 << 15  # paths in memory at once
SUNWARD = 0.25  # share of all turns that are drawn around the way to the sun, from where most light comes
LEAST_SPREAD = 1e-3  # of rays [-], below which the phase function alone is wide enough
PLACES = 2  # where each part of a path may end, which all bring sunlight
# Steps of a sequence that fills a pixel evenly (M. Roberts, The unreasonable effectiveness of quasirandom sequences,
# 2018): powers of 1 / x, x^3 = x + 1.
EVEN = np.array([0.7548776662466927, 0.5698402909980532])[:, None, None]
SURE = 0.25  # below this weight a path goes on with a chance in its proportion
MOST_EVENTS = 1000
NEWTON, STEPS = 4, 16  # to a surface that a ray meets once; of one that it may meet more often
ONCE = 0.5  # steepness up to which a surface is met once, with a margin
WATER, FLOOR, SURFACE = range(3)
ABOVE = 1e-7  # a path leaves the floor from so far above it [m]


class Sunlight:
    """Rays of a point sun behind the waves, unscattered and unabsorbed, in all of the water.

    A lattice of rays on the surface; at each of some depths the flux and the mean direction of those in a pixel, each
    spread as its cell is. The pixels move with the calm sea's ray, so that little changes from depth to depth, between
    which they are linear.
    """

    def __init__(self, world: World, levels: int = LEVELS, pixels: int = PIXELS, rays: int = RAYS) -> None:
        self.tile, self.calm = world.sea.tile, world.calm[0]
        self.pixels = checked_whole("pixels", pixels, 1, 4096)
        count = checked_whole("rays", rays, 1, 8192)
        side = (np.arange(-1, count + 1) + 0.5) * self.tile / count
        height, *slope = world.sea.lattice(side, side)
        along, across, flux = refracted(world.tilt, (slope[0], slope[1]), world.n)
        self.top = min(world.sea.lowest, -1e-3 * world.depth)
        self.step = (self.top - world.floor.lowest) / (checked_whole("levels", levels, 2, 1024) - 1)
        self.light = np.zeros((levels, pixels * pixels, 3), np.float32)
        weights = [one[1:-1, 1:-1].ravel() for one in (flux, flux * along, flux * across)]
        for level in range(levels):
            z = self.top - level * self.step
            x, y = side + (height - z) * along + self.calm * z, side[:, None] + (height - z) * across
            for at, share in boxes(Photons(x, y, flux), pixels, pixels / self.tile):
                for column, weight in enumerate(weights):
                    self.light[level, :, column] += np.bincount(at, share * weight, pixels * pixels)
        self.light *= (pixels / count) ** 2
        spread = float(np.sqrt(np.mean((along - self.calm) ** 2 + across**2)))
        self.around: Phase = world.phase
        if spread > LEAST_SPREAD:
            self.around = Mixture((0.5, 0.5), (world.phase, HenyeyGreenstein(max(1.0 - spread, 0.0))))

    def at(self, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats]:
        """Return flux (n,) per horizontal area, over the sun's across its rays in air, and its unit way (n, 3)."""
        level = np.clip((self.top - z) / self.step, 0.0, len(self.light) - 1.000001)
        whole = level.astype(int)
        rest = (level - whole)[:, None]
        row, column = (np.floor(np.mod(one / self.tile, 1.0) * self.pixels) for one in (y, x + self.calm * z))
        row, column = (np.minimum(one.astype(int), self.pixels - 1) for one in (row, column))
        at = row * self.pixels + column
        found = (1.0 - rest) * self.light[whole, at] + rest * self.light[whole + 1, at]
        flux = np.maximum(found[:, 0], 1e-30)
        way = np.column_stack([found[:, 1] / flux, found[:, 2] / flux, -np.ones(len(flux))])
        way[found[:, 0] <= 0] = self.calm, 0.0, -1.0
        return found[:, 0], way / np.linalg.norm(way, axis=1)[:, None]


class Event(NamedTuple):
    """Event of n paths.

    seen    (n, 3) radiance that comes in at the event
    kept    (n or 1, 3 or 1) share of the path's light that goes on [-]
    turned  (n,) density of the turn that light would take, over that which the turn was drawn from [-]
    place, way  (n, 3) start and direction of the path's next part
    """

    seen: Floats
    kept: Floats
    turned: Floats
    place: Floats
    way: Floats


class Stretch(NamedTuple):
    """Straight parts of n paths.

    place, way     (n, 3) start and direction;  wall  (n,) distance to floor or waves, inf where they are far [m]
    worth, chance  (n, 3) light that the path before leaves, and the density of its draw, of each colour's water
    """

    place: Floats
    way: Floats
    wall: Floats
    worth: Floats
    chance: Floats


def traced(
    world: World, light: Sunlight, origin: Floats, corner: Floats, across: Floats, up: Floats, paths: int, seed: int = 0
) -> Floats:
    """Return radiance (2, n, 3) of pixels that an eye below the waves sees, each the mean over its area.

    It is of red, green and blue, by two independent halves of the paths.

    origin  (3,) the eye [m];  corner  (n, 3) of pixels as seen from it;  across, up  (3,) their sides
    paths   of a pixel, an even number

    Sight of the sun itself is left out. A ray that goes down meets no trough of the waves.
    """
    each = checked_whole("paths", paths, 2) // 2
    at_once = max(TOGETHER // each, 1)

    def means(half: int, first: int) -> Floats:
        part = np.repeat(corner[first : first + at_once], each, axis=0)
        rng = np.random.default_rng([seed, half, first])
        spot = np.mod(rng.random((2, len(part) // each, 1)) + EVEN * np.arange(each), 1.0).reshape(2, -1, 1)
        way = part + spot[0] * across + spot[1] * up
        way /= np.linalg.norm(way, axis=1)[:, None]
        start = np.broadcast_to(origin, way.shape).copy()
        return followed(world, light, start, way, rng).reshape(-1, each, 3).mean(1)

    starts = range(0, len(corner), at_once)
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        parts = list(threads.map(lambda part: means(*part), product(range(2), starts)))
    return np.concatenate(parts).reshape(2, len(corner), 3)


def followed(world: World, light: Sunlight, place: Floats, way: Floats, rng: np.random.Generator) -> Floats:
    """Return the radiance (n, 3) that each of these rays finds, by one path."""
    c, b = world.c, np.asarray(world.b, float)
    found = np.zeros((len(place), 3))
    own, way = np.arange(len(place)), way.copy()
    hero = rng.integers(0, 3, len(place))  # whose ways the path goes; the others weigh what they would have gone
    worth, chance = np.ones((len(place), 3)), np.ones((len(place), 3))
    aside = np.ones(len(place))  # density of the turns that light would take over that of those that were drawn
    for _ in range(MOST_EVENTS):
        if not len(own):
            break
        # Ways that the path might go, evenly from the shortest to the longest; it goes one of them.
        even = (np.arange(PLACES) + rng.random((len(own), PLACES))) / PLACES
        each = -np.log1p(-even) / c[hero][:, None]
        wall, kind = _ends(world, place, way, each[:, -1])
        wall[kind == WATER] = np.inf
        found[own] += aside[:, None] * _along(world, light, Stretch(place, way, wall, worth, chance), each)
        length = each[np.arange(len(own)), rng.integers(0, PLACES, len(own))]
        end, kind = np.minimum(length, wall), np.where(length < wall, WATER, kind)
        faded = np.exp(-c * end[:, None])
        worth, chance = worth * faded, chance * faded
        place = place + end[:, None] * way
        inside = kind == WATER
        worth[inside] *= b
        chance[inside] *= c
        for number, event in enumerate((_scattered, _reflected, _surfaced)):
            some = np.flatnonzero(kind == number)
            if len(some):
                seen, kept, turned, place[some], way[some] = event(world, light, place[some], way[some], rng)
                found[own[some]] += (aside[some] / chance[some].mean(axis=1))[:, None] * worth[some] * seen
                worth[some] *= kept
                aside[some] *= turned
        # Paths that would bring little more end, by chance, and the others stand for them. Turns do not count: few that
        # were drawn away from the sun's glare come back to it, and would then stand for too many.
        lives = np.minimum(np.max(worth / chance.mean(axis=1, keepdims=True), axis=1) / SURE, 1.0)
        goes = np.flatnonzero((rng.random(len(own)) < lives) & (aside > 0))
        own, hero, aside = own[goes], hero[goes], aside[goes]
        place, way, chance = place[goes], way[goes], chance[goes]
        worth = worth[goes] / lives[goes, None]
    return found


def _along(world: World, light: Sunlight, part: Stretch, each: Floats) -> Floats:
    """Return the sunlight (n, 3) that the water turns into paths, the mean over each place where they may turn.

    One place has next to none of it or thousands of times the mean: the sun's rays turn by more than the phase
    function's peak is wide within a hand's breadth.

    each  (n, PLACES) distances of the places [m]; none is seen beyond the wall
    """
    spot = part.place[:, None] + each[..., None] * part.way[:, None]
    flux, beam = light.at(*spot.reshape(-1, 3).T)
    turned = np.clip(-np.sum(beam.reshape(spot.shape) * part.way[:, None], axis=2), -1.0, 1.0).ravel()
    seen = (flux / -beam[:, 2] * world.phase.pdf(turned))[:, None] * _come(world, spot.reshape(-1, 3), beam)
    faded = np.exp(-world.c * each[..., None])
    share = faded * part.worth[:, None] / np.mean(faded * part.chance[:, None] * world.c, axis=2, keepdims=True)
    share[each >= part.wall[:, None]] = 0.0
    return np.asarray(world.b) * np.mean(share * seen.reshape(spot.shape), axis=1)


def _scattered(world: World, light: Sunlight, place: Floats, way: Floats, rng: np.random.Generator) -> Event:
    """Return where a path goes on backward that the water scatters; `_along` has the sunlight that it sees there."""
    _, beam = light.at(*place.T)
    new = _turned(world.phase, way, rng)
    factor = _sunward(light, beam, new, partial(_density, world.phase, way), rng)
    return Event(np.zeros((1, 3)), np.ones((1, 3)), factor, place, new)


def _sunward(
    light: Sunlight, beam: Floats, new: Floats, density: Callable[[Floats], Floats], rng: np.random.Generator
) -> Floats:
    """Turn a share of new ways around the way to the sun, in place; return `Event.turned`, by the others' density."""
    sunny = np.flatnonzero(rng.random(len(new)) < SUNWARD)
    new[sunny] = _turned(light.around, -beam[sunny], rng)
    straight = density(new)
    return straight / ((1.0 - SUNWARD) * straight + SUNWARD * _density(light.around, -beam, new))


def _come(world: World, place: Floats, beam: Floats) -> Floats:
    """Return the sun's irradiance (n, 3) times what the water leaves of its rays as they come to a place."""
    return np.asarray(world.sun) * np.exp(world.c * np.minimum(place[:, 2] / -beam[:, 2], 0.0)[:, None])


def _reflected(world: World, light: Sunlight, place: Floats, way: Floats, rng: np.random.Generator) -> Event:
    """Return what the floor reflects, as Lambert's."""
    normal = _normal(world.floor, place)
    flux, beam = light.at(*place.T)
    facing = np.maximum(-np.sum(beam * normal, axis=1), 0.0)
    seen = (flux / -beam[:, 2] * facing / np.pi)[:, None] * _come(world, place, beam) * np.asarray(world.reflectance)
    below = 1.0 - np.sqrt(rng.random(len(way)))
    new = np.column_stack(turn(normal.T, below, 2.0 - below, 2.0 * np.pi * rng.random(len(way))))
    factor = _sunward(light, beam, new, lambda ways: np.maximum(np.sum(ways * normal, axis=1), 0.0) / np.pi, rng)
    lifted = place.copy()
    lifted[:, 2] = world.floor.height(*place[:, :2].T) + ABOVE
    return Event(seen, np.array([world.reflectance]), factor, lifted, new)


def _surfaced(world: World, light: Sunlight, place: Floats, way: Floats, rng: np.random.Generator) -> Event:
    """Return what waves show from below: the sky behind them, and the path reflected."""
    normal = _normal(world.sea, place)
    cosine = np.clip(np.sum(way * normal, axis=1), 0.0, 1.0)
    share = fresnel(world.n, 1.0, cosine)[0][:, None]
    seen = (1.0 - share) * world.n**2 * np.asarray(world.sky) / np.pi
    new = way - 2.0 * np.sum(way * normal, axis=1)[:, None] * normal
    new[:, 2] = -np.abs(new[:, 2])  # where a steep wave turns it up it would meet the next one
    return Event(seen, share, np.ones(len(way)), place, new)


def _ends(world: World, place: Floats, way: Floats, length: Floats) -> tuple[Floats, NDArray[np.int8]]:
    """Return the length of each ray (n,) [m], and what is at its end: `WATER`, `FLOOR` or `SURFACE`."""
    end, kind = length.copy(), np.full(len(way), WATER, np.int8)
    last = place[:, 2] + length * way[:, 2]
    for is_near, surface, event in (
        ((way[:, 2] < 0) & (last < world.floor.highest), world.floor, FLOOR),
        ((way[:, 2] > 0) & (last > world.sea.lowest), world.sea, SURFACE),
    ):
        near = np.flatnonzero(is_near)
        far = met(surface, place[near], way[near])
        reached = far < length[near]
        end[near[reached]], kind[near[reached]] = far[reached], event
    return end, kind


def met(surface: Waves, place: Floats, way: Floats) -> Floats:
    """Return the distance (n,) to a floor from above, or to the waves from below [m]; inf where a ray meets none."""
    if not len(way):
        return np.zeros(0)
    rises = 1.0 if way[0, 2] > 0 else -1.0
    found = np.maximum((surface.mean - place[:, 2]) / way[:, 2], 0.0)
    if not surface.amplitudes.size:
        return found
    steep = surface.steepest * np.hypot(way[:, 0], way[:, 1]) > ONCE * np.abs(way[:, 2])
    once, often = np.flatnonzero(~steep), np.flatnonzero(steep)
    k = newton_hit(surface.height, surface.slope, place[once], way[once], found[once], NEWTON)
    found[once] = np.maximum(k, 0.0)
    if len(often):
        # Waves that are met from below are a floor upside down.
        bed = replace(surface, amplitudes=-rises * surface.amplitudes, mean=-rises * surface.mean)
        start, along = (one[often] * (1.0, 1.0, -rises) for one in (place, way))
        # What stands on a surface may be below it by a rounding.
        start[:, 2] = np.maximum(start[:, 2], bed.height(*start[:, :2].T))
        hit = first_hit(bed.height, start, along, bed.lowest, bed.highest, STEPS, bed.slope)
        found[often] = np.where(np.isnan(hit), np.inf, hit)
    return found


def _turned(phase: Phase, way: Floats, rng: np.random.Generator) -> Floats:
    """Return directions (n, 3) drawn around others."""
    below, above = phase.deflection(2.0 * rng.random(len(way)) - 1.0)
    return np.column_stack(turn(way.T, below, above, 2.0 * np.pi * rng.random(len(way))))


def turn(way: Iterable[Floats], below: Floats, above: Floats, azimuth: Floats) -> tuple[Floats, ...]:
    """Return unit directions turned by angles of which 1 - c and 1 + c are given; sharp ones keep their precision."""
    dx, dy, dz = way
    sine, cosine = np.sqrt(below * above), 1.0 - below
    across, along = sine * np.cos(azimuth), sine * np.sin(azimuth)
    # Two unit vectors across the direction (Duff et al., J. Comput. Graph. Tech. 6, 2017): no pole to divide by.
    sign = np.where(dz >= 0, 1.0, -1.0)
    a = -1.0 / (sign + dz)
    b = dx * dy * a
    x = cosine * dx + across * (1.0 + sign * dx * dx * a) + along * b
    y = cosine * dy + across * sign * b + along * (sign + dy * dy * a)
    z = cosine * dz - across * sign * dx - along * dy
    norm = 1.0 / np.sqrt(x * x + y * y + z * z)
    return x * norm, y * norm, z * norm


def _density(phase: Phase, way: Floats, new: Floats) -> Floats:
    """Return the density of such a draw [1/sr]."""
    return np.asarray(phase.pdf(np.clip(np.sum(way * new, axis=1), -1.0, 1.0)))


def _normal(surface: Waves, place: Floats) -> Floats:
    """Return the upward unit normals (n, 3)."""
    x, y = surface.slope(*place[:, :2].T)
    found = np.column_stack([-x, -y, np.ones(len(place))])
    return found / np.linalg.norm(found, axis=1)[:, None]
