"""From photographs to the media behind a spot, colour by colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.measured.exact_light import exact_light
from profilefit.measured.photo import bracket, medium, rings
from profilefit.measured.photo.bracket import FULL, Picture, Sensor, Times
from profilefit.measured.photo.exposure import BayerPlane, Exposure, read
from profilefit.measured.photo.medium import Beliefs, Card, PhotoFit, Shot
from profilefit.measured.photo.pixel_scale import PixelScale, pixel_scale
from profilefit.measured.photo.rings import SpotRings
from profilefit.measured.photo.spot import Spot, spot
from profilefit.measured.problem import Known

MOST_SHOTS = 20
UNIT = "mm"
LATE, WORTH = 0.03, 2  # relative error of a stated time, and of how many exposures that is worth


@dataclass(frozen=True, eq=False)
class Bracket:
    """A merged bracket: its exposures' names, times relative to the longest, sensor, and where the spot is.

    most  steps that an exposure records unclipped
    """

    sources: tuple[str, ...]
    times: Times
    stated: tuple[float | None, ...]
    most: float
    sensor: Sensor
    planes: tuple[tuple[str, Picture], ...]
    spot: Spot
    sides: tuple[int, int]

    def pictures(self, colour: str) -> list[Picture]:
        return [one for name, one in self.planes if name == colour]

    @property
    def seconds(self) -> Known | None:
        """Of the longest exposure: the mean of what all state, and the error that their scatter says."""
        off = np.array([np.log(said / time) for said, time in zip(self.stated, self.times.value, strict=True) if said])
        if off.size == 0:
            return None
        scatter = (WORTH * LATE**2 + np.sum((off - off.mean()) ** 2)) / (WORTH + off.size - 1)
        value = float(np.exp(off.mean()))
        return Known(value, value * float(np.sqrt(scatter / off.size)))

    @property
    def colours(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for name, _ in self.planes))


@dataclass(frozen=True, eq=False)
class Photo:
    """What was seen, and the fit of each colour."""

    shot: Bracket
    cards: tuple[Bracket, ...]
    plate: PixelScale
    setting: Setting
    fits: dict[str, PhotoFit]
    bounds: dict[str, dict[str, float]]
    notes: tuple[str, ...]


def photo(
    shots: Sequence[Path],
    scale: str,
    cards: Sequence[Path] = (),
    greys: Sequence[Path] = (),
    dark: Sequence[Path] = (),
    setting: Setting | None = None,
    beliefs: Beliefs | None = None,
    reflectance: Known | None = None,
) -> Photo:
    """Fit the medium under a laser spot, of each colour of its photographs.

    shots   a bracket of exposures; cards and greys brackets of the same beam on a white card and a grey one
    scale   pixels as lengths (`pixel_scale`); reflectance of the grey card; dark frames, whose mean is taken off
    """
    where = setting or Setting(n=1.4, g=0.8)
    level = _level([read(path) for path in dark])
    exposures = _read(shots, level)
    size = pixel_scale("scale", scale, exposures, UNIT)
    seen = bracketed(exposures, size)
    shown = [(bracketed(_read(each, level), size), known)
             for each, known in ((cards, None), (greys, reflectance or Known(0.18, 0.005))) if each]  # fmt: skip
    for one, _ in shown:
        if one.sides != seen.sides:
            raise InputError(
                f"{one.sources[0]}: expected {_sides(seen.sides)} pixels as the spot has, got {_sides(one.sides)}"
            )
    pixel = size.pixel(seen.spot.centre)
    believed = replace(beliefs or Beliefs(), border=0.5 * pixel * float(np.hypot(*seen.sides)))
    fits, bounds = {}, {}
    for colour in seen.colours:
        of_cards = tuple(
            carded(one, colour, size, known, seen) for one, known in shown if colour in one.colours
        )  # fmt: skip
        shot = Shot(ringed(seen, colour, size), of_cards, exact_light(where), believed)
        fits[colour] = medium.fitted(shot)
        bounds[colour] = dict(medium.fisher(shot, fits[colour].x))
    notes = []
    if not all(one.linear for one in exposures):
        notes.append(f"{shots[0]}: eight bits, taken for sRGB: not a measurement")
    if any(known and not (seen.seconds and one.seconds) for one, known in shown):
        notes.append("no exposure time is stated, so the grey card tells beam and glare, and no scale")
    return Photo(seen, tuple(one for one, _ in shown), size, where, fits, bounds, tuple(notes))


def _read(paths: Sequence[Path], level: dict[tuple[int, int], float]) -> list[Exposure]:
    if not 1 <= len(paths) <= MOST_SHOTS:
        raise InputError(f"photographs must be 1 to {MOST_SHOTS} exposures of one bracket, got {len(paths)}")
    found = [read(path) for path in paths]
    for one in found[1:]:
        if one.sides != found[0].sides:
            expected = f"expected {_sides(found[0].sides)} pixels as {found[0].source} has"
            raise InputError(f"{one.source}: {expected}, got {_sides(one.sides)}")
    return [replace(one, planes=tuple(_darkened(plane, level) for plane in one.planes)) for one in found]


def _level(frames: Sequence[Exposure]) -> dict[tuple[int, int], float]:
    """Mean of dark frames above black, by the place of a plane."""
    found: dict[tuple[int, int], list[float]] = {}
    for one in frames:
        for plane in one.planes:
            found.setdefault((*plane.offset,), []).append(float(plane.counts.mean(dtype=float)))
    return {place: float(np.mean(each)) for place, each in found.items()}


def _darkened(plane: BayerPlane, level: dict[tuple[int, int], float]) -> BayerPlane:
    dark = level.get(plane.offset, 0.0)
    return plane if dark == 0.0 else replace(plane, counts=plane.counts - np.float32(dark), range=plane.range - dark)


def _sides(sides: tuple[int, int]) -> str:
    return f"{sides[0]} x {sides[1]}"


def bracketed(shots: Sequence[Exposure], size: PixelScale) -> Bracket:
    """Exposures merged, with the spot of their brightest colour."""
    times = bracket.times(shots)
    own = bracket.sensor(shots, times.value)
    pictures = bracket.merged(shots, times.value, own)
    names = [one.colour for one in shots[0].planes]
    brightest = max(dict.fromkeys(names), key=lambda name: sum(
        float(np.nansum(one.light)) for one, each in zip(pictures, names, strict=True) if each == name))  # fmt: skip
    lit = [one for one, name in zip(pictures, names, strict=True) if name == brightest]
    return Bracket(
        tuple(one.source for one in shots), times, tuple(one.seconds for one in shots),
        FULL * min(plane.range for one in shots for plane in one.planes), own,
        tuple(zip(names, pictures, strict=True)), spot(lit, shots[0].sides, size, shots[0].source), shots[0].sides,
    )  # fmt: skip


def ringed(one: Bracket, colour: str, size: PixelScale) -> SpotRings:
    """Rings of a colour, in counts a second of the longest exposure, where it states its time.

    What the times of the bracket leave open is an error that rings of one exposure share.
    """
    pictures, pixel = one.pictures(colour), size.pixel(one.spot.centre)
    edges = rings.edges_of(one.spot.reach * pixel, pictures[0].step * pixel)
    found = rings.rings(pictures, one.spot.centre, edges, size)
    share = found.value[:, None] * bracket.shares(found.value, one.times.value, one.sensor, one.most)
    covariance = found.covariance + share @ one.times.covariance @ share.T
    seconds = 1.0 if one.seconds is None else one.seconds.value
    return replace(found, value=found.value / seconds, covariance=covariance / seconds**2)


def carded(card: Bracket, colour: str, size: PixelScale, reflectance: Known | None, seen: Bracket) -> Card:
    """A card beside the spot that was `seen`; what their times leave open is in the error of its reflectance."""
    own, other = card.seconds, seen.seconds
    if reflectance is not None and own is not None and other is not None:
        relative = np.hypot.reduce([one.error / one.value for one in (reflectance, own, other)])
        return Card(ringed(card, colour, size), Known(reflectance.value, reflectance.value * float(relative)))
    return Card(ringed(card, colour, size))
