"""Media behind a spot from photographs, colour by colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.measured.model import exact_light
from profilefit.measured.photo import exposure, medium, rings
from profilefit.measured.photo.exposure import FULL, GREY, Exposure, Picture, Sensor, Times, read
from profilefit.measured.photo.medium import Beliefs, Card, PhotoFit, Shot
from profilefit.measured.photo.rings import MARKER, PixelScale, Spot, SpotRings, pixel_scale, spot
from profilefit.measured.problem import Known

MOST_SHOTS = 20
UNIT = "mm"
LATE, WORTH = 0.03, 2  # relative error of a stated time, and of how many exposures that is worth


@dataclass(frozen=True, eq=False)
class Bracket:
    """A merged bracket: its exposures' names, times relative to the longest, sensor, and where the spot is.

    most  (m,) steps that each exposure records unclipped
    """

    sources: tuple[str, ...]
    times: Times
    stated: tuple[float | None, ...]
    most: Floats
    sensor: Sensor
    planes: tuple[tuple[str, Picture], ...]
    spot: Spot
    sides: tuple[int, int]

    def pictures(self, colour: str) -> list[Picture]:
        return [one for name, one in self.planes if name == colour]

    @property
    def seconds(self) -> Known | None:
        """Time of the longest exposure: the mean of what all state, and the error that their scatter says."""
        pairs = zip(self.stated, self.times.value, strict=True)
        offsets = np.array([np.log(said / time) for said, time in pairs if said])
        if offsets.size == 0:
            return None
        scatter = (WORTH * LATE**2 + np.sum((offsets - offsets.mean()) ** 2)) / (WORTH + offsets.size - 1)
        value = float(np.exp(offsets.mean()))
        return Known(value, value * float(np.sqrt(scatter / offsets.size)))

    @property
    def colours(self) -> tuple[str, ...]:
        """Red before green before blue, however the sensor has them."""
        return tuple(sorted({name for name, _ in self.planes}, key=(*CHANNELS, GREY).index))


@dataclass(frozen=True, eq=False)
class Photo:
    """Merged brackets, and the fit of each colour."""

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
    if not scale.startswith(MARKER):  # what is wrong with it is reported before photographs are read
        pixel_scale("scale", scale, (), UNIT)
    exposures = _read(shots)
    level = _level(dark, exposures[0])
    exposures = [_darkened(one, level) for one in exposures]
    size = pixel_scale("scale", scale, exposures, UNIT)
    seen, coded = bracketed(exposures, size), [one.source for one in exposures if not one.linear]
    shown = []
    for paths, known in ((cards, None), (greys, reflectance or Known(0.18, 0.005))):
        if paths:
            own = [_darkened(one, level) for one in _read(paths, exposures[0])]
            coded += [one.source for one in own if not one.linear]
            shown.append((bracketed(own, size), known))
    answer = measured(seen, shown, size, where, beliefs or Beliefs())
    notes = tuple(f"{one}: eight bits, taken for sRGB: not a measurement" for one in coded[:1])
    return replace(answer, notes=(*notes, *answer.notes))


def measured(
    seen: Bracket, shown: Sequence[tuple[Bracket, Known | None]], size: PixelScale, where: Setting, beliefs: Beliefs
) -> Photo:
    """Fit the medium of each colour of a merged bracket; `shown` are those of cards, with their reflectance."""
    pixel = size.pixel(seen.spot.centre)
    believed = beliefs.over(seen.sides, pixel, pixel * seen.spot.reach)
    fits, bounds, notes = {}, {}, []
    for colour in seen.colours:
        of_spot = ringed(seen, colour, size)
        if not of_spot.shows_spot:
            notes.append(f"{colour}: no spot is seen, so it is left out")
            continue
        of_cards = [(one.sources[0], carded(one, colour, size, known, seen)) for one, known in shown]
        notes += [
            f"{colour}: no spot is seen in {source}, so that card tells nothing of it"
            for source, card in of_cards
            if not card.rings.shows_spot
        ]
        lit = tuple(card for _, card in of_cards if card.rings.shows_spot)
        shot = Shot(of_spot, lit, exact_light(where), believed)
        fits[colour] = medium.fitted(shot)
        bounds[colour] = dict(medium.fisher(shot, fits[colour].x))
    if not fits:
        expected = "a spot brighter than the scatter of its pixels"
        raise InputError(f"{seen.sources[0]}: expected {expected}, got none in any colour")
    if any(known and not (seen.seconds and one.seconds) for one, known in shown):
        notes.append("no exposure time is stated, so the grey card tells beam and glare, and no scale")
    return Photo(seen, tuple(one for one, _ in shown), size, where, fits, bounds, tuple(notes))


def _read(paths: Sequence[Path], like: Exposure | None = None) -> list[Exposure]:
    """Read exposures of one camera, `like` another of it."""
    _require_count(paths)
    exposures: list[Exposure] = []
    for path in paths:
        exposures.append(read(path))
        own, other = exposures[-1], like or exposures[0]
        for expected, got in zip(_kind(other), _kind(own), strict=True):
            if None not in (expected, got) and expected != got:
                raise InputError(f"{own.source}: expected {expected} as {other.source} has, got {got}")
    return exposures


def _require_count(paths: Sequence[Path]) -> None:
    require(1 <= len(paths) <= MOST_SHOTS, "photographs", f"1 to {MOST_SHOTS} exposures of one bracket", len(paths))


def _kind(one: Exposure) -> tuple[str | None, ...]:
    """Return pixels, filters, ISO and aperture in words, None where a file does not state them."""
    return (
        f"{one.sides[0]} x {one.sides[1]} pixels",
        f"planes {', '.join(plane.colour for plane in one.planes)}",
        None if one.iso is None else f"ISO {one.iso:g}",
        None if one.aperture is None else f"f/{one.aperture:.3g}",
    )


def _level(paths: Sequence[Path], like: Exposure) -> Floats:
    """Mean of dark frames above black, of each plane (p,)."""
    if not paths:
        return np.zeros(len(like.planes))
    _require_count(paths)
    frames = (_read([path], like)[0] for path in paths)  # one at a time: they are as large as photographs
    means = [[float(plane.counts.mean(dtype=float)) for plane in frame.planes] for frame in frames]
    return np.asarray(np.mean(means, axis=0), float)


def _darkened(one: Exposure, level: Floats) -> Exposure:
    if not np.any(level):
        return one
    pairs = zip(one.planes, level.tolist(), strict=True)
    planes = [replace(each, counts=each.counts - np.float32(dark), range=each.range - dark) for each, dark in pairs]
    return replace(one, planes=tuple(planes))


def bracketed(shots: Sequence[Exposure], size: PixelScale) -> Bracket:
    """Merge exposures, and find the spot of their brightest colour."""
    times = exposure.times(shots)
    own = exposure.sensor(shots, times.value)
    planes = tuple(zip([one.colour for one in shots[0].planes], exposure.merged(shots, times.value, own), strict=True))
    each = {colour: [one for name, one in planes if name == colour] for colour, _ in planes}
    lit = max(each.values(), key=lambda pictures: sum(float(np.nansum(one.light)) for one in pictures))
    return Bracket(
        tuple(one.source for one in shots), times, tuple(one.seconds for one in shots),
        FULL * np.array([max(plane.range for plane in one.planes) for one in shots]), own, planes,
        spot(lit, shots[0].sides, size, shots[0].source), shots[0].sides,
    )  # fmt: skip


def ringed(scene: Bracket, colour: str, size: PixelScale) -> SpotRings:
    """Return rings of a colour, in counts a second of the longest exposure, where it states its time."""
    pictures, pixel = scene.pictures(colour), size.pixel(scene.spot.centre)
    edges = rings.edges_of(scene.spot.reach * pixel, pictures[0].step * pixel)
    seen = rings.rings(pictures, scene.spot.centre, edges, size)
    share = seen.value[:, None] * exposure.shares(seen.value, scene.times.value, scene.sensor, scene.most)
    covariance = seen.covariance + share @ scene.times.covariance @ share.T  # rings of an exposure share its time's
    seconds = 1.0 if scene.seconds is None else scene.seconds.value
    return replace(seen, value=seen.value / seconds, covariance=covariance / seconds**2)


def carded(card: Bracket, colour: str, size: PixelScale, reflectance: Known | None, seen: Bracket) -> Card:
    """Return a card beside the spot that was `seen`; its reflectance's error has what their times leave open."""
    own, other = card.seconds, seen.seconds
    if reflectance is not None and own is not None and other is not None:
        relative = np.hypot.reduce([one.error / one.value for one in (reflectance, own, other)])
        return Card(ringed(card, colour, size), Known(reflectance.value, reflectance.value * float(relative)))
    return Card(ringed(card, colour, size))
