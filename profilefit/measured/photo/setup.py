"""A setup for photographs that are simulated: its file, its photographs as raw files, and what they could tell.

`Setup` is its file, and `examples/photo.toml` is one.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from mcml_sim.exact.half_space import require_solved
from mcml_sim.files.whole_file import ROOM, read_toml, read_whole, write_whole
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.measured.model import exact_light, u_of
from profilefit.measured.photo import medium, simulated
from profilefit.measured.photo.exposure import library
from profilefit.measured.photo.medium import Beliefs, Card, Shot
from profilefit.measured.photo.rings import SpotRings, edges_of
from profilefit.measured.photo.simulated import PATTERN, SimulatedExposure, SpotCamera, SpotOptics
from profilefit.measured.problem import Known
from profilefit.recipes.declared import LISTED, Declared, Refused, Share, Tolerance, at, words

MAX_BYTES, LEAST_SIDE, MOST_SIDE = 1 << 16, 50, 12_000
OURS, HEAD = b"profilefit", 4096  # in the first bytes of each file
MOST = 1e6  # 1/mm
LENS, SENSOR = SpotOptics(), SpotCamera()
SHORTEST = 1e-3  # seconds, of the spot: its light is as bright as that
STEP = 4.0  # from one exposure to the next
FULL = 0.5  # of the sensor's range, that the shortest one reaches
CFA = {"red": 0, "green": 1, "blue": 2}
WHITE = 0.9  # reflectance of the white card
GREY_ERROR, BEAM_ERROR = 0.03, 0.1  # relative, of what is told
SCATTER = 0.003  # of a ring, by speckle and noise


Side = Annotated[int, Field(ge=1, le=MOST_SIDE)]
Sides = Annotated[tuple[Side, Side], LISTED, words(f"two whole numbers of pixels in 1 ... {MOST_SIDE}")]
Scattering = Annotated[float, Field(ge=1e-3, le=MOST)]
Absorption = Annotated[float, Field(ge=1e-4, le=MOST)]


class MediumTable(Declared):
    """Table [medium]: mu_s and mu_a of red, green and blue [1/mm], refractive index and mean cosine.

    photons  that are traced for each colour; 0: light is exact
    """

    mu_s: Annotated[tuple[Scattering, Scattering, Scattering], LISTED] = (1.0, 1.0, 1.0)
    mu_a: Annotated[tuple[Absorption, Absorption, Absorption], LISTED] = (0.05, 0.05, 0.05)
    n: Annotated[float, Field(gt=0.0)] = 1.4
    g: Share = 0.8
    photons: Annotated[int, Field(ge=0, le=10**9)] = 0

    @property
    def setting(self) -> Setting:
        return Setting(n=self.n, g=self.g)

    @model_validator(mode="after")
    def _solved(self) -> Self:
        require_solved(self.setting)
        return self


class OpticsTable(Declared):
    """Table [optics]: of beam and lens; lengths in mm."""

    beam: Annotated[float, Field(gt=0.0, le=100.0)] = LENS.beam
    core: Annotated[float, Field(gt=0.0, le=100.0)] = LENS.core
    surface: Tolerance = LENS.surface
    glare: Annotated[float, Field(gt=0.0, le=0.9)] = LENS.glare
    width: Annotated[float, Field(gt=0.0, le=1e3)] = LENS.width
    falling: Annotated[float, Field(gt=0.0, le=10.0)] = LENS.falling

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if not self.falling > 1.0:
            raise Refused("a number > 1, or its light is endless", self.falling, "falling")
        return self


class SensorTable(Declared):
    """Table [camera]: of the sensor, its lens and its exposures; pitch in mm, tilt in degrees.

    late  relative error of stated times
    """

    sides: Sides = (1200, 900)
    pitch: Annotated[float, Field(gt=0.0, le=10.0)] = SENSOR.pitch
    gain: Annotated[float, Field(gt=0.0, le=1e4)] = SENSOR.gain
    read: Annotated[float, Field(gt=0.0, le=1e4)] = SENSOR.read
    bits: Annotated[int, Field(ge=8, le=14)] = SENSOR.bits
    black: Annotated[int, Field(ge=0, le=4000)] = SENSOR.black
    well: Annotated[float, Field(gt=0.0, le=1e9)] = SENSOR.well
    uneven: Annotated[float, Field(gt=0.0, le=0.1)] = SENSOR.uneven
    corner: Annotated[float, Field(gt=0.0, le=0.9)] = SENSOR.corner
    tilt: Annotated[float, Field(ge=-60.0, le=60.0)] = 0.0
    speckle: Annotated[float, Field(gt=0.0, le=1.0)] = SENSOR.speckle
    grain: Annotated[float, Field(gt=0.0, le=50.0)] = SENSOR.grain
    exposures: Annotated[int, Field(ge=1, le=12)] = 5
    late: Annotated[float, Field(gt=0.0, le=0.2)] = 0.02
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0

    @property
    def camera(self) -> SpotCamera:
        return SpotCamera(**self.model_dump(exclude={"exposures", "late", "seed"}))

    @model_validator(mode="after")
    def _sees(self) -> Self:
        if min(self.sides) < LEAST_SIDE:
            raise Refused(f"at least {LEAST_SIDE} pixels each", list(self.sides), "sides")
        if not self.black < (white := self.camera.white):
            raise Refused(f"less than {white}, white of {self.bits} bits", self.black, "black")
        return self


class CardsTable(Declared):
    """Table [cards]: whether there is a white card, and the reflectance of a grey one."""

    white: bool = False
    grey: Tolerance | None = None

    @property
    def shown(self) -> dict[str, float]:
        """Reflectance of each card that there is, by the name of its photographs."""
        return ({"card": WHITE} if self.white else {}) | ({} if self.grey is None else {"grey": self.grey})


class Setup(Declared):
    """Medium, beam, lens and camera of a simulation."""

    medium: MediumTable
    optics_table: OpticsTable = Field(OpticsTable(), alias="optics")
    camera_table: SensorTable = Field(SensorTable(), alias="camera")
    cards: CardsTable = CardsTable()

    @property
    def optics(self) -> SpotOptics:
        return SpotOptics(**self.optics_table.model_dump())

    @property
    def camera(self) -> SpotCamera:
        return self.camera_table.camera

    @model_validator(mode="after")
    def _resolved(self) -> Self:
        longest = 1.0 / min(map(sum, zip(self.medium.mu_s, self.medium.mu_a, strict=True)))
        with at("medium"):
            simulated.require_resolved(longest, self.optics, _far(self.camera))
        return self


def read_setup(path: Path) -> Setup:
    """Return a setup; InputError, in one line, of what is no setup."""
    return Setup.of(str(path), read_toml(path, MAX_BYTES))


def _far(camera: SpotCamera) -> float:
    """[mm], beyond the corners."""
    return 1.2 * camera.pitch * float(np.hypot(*camera.sides))


def brackets(setup: Setup) -> dict[str, list[SimulatedExposure]]:
    """Exposures of the spot, and of the cards that there are, by what they show."""
    radii = simulated.radii(_far(setup.camera), setup.optics)
    spot = {}
    for number, (colour, mu_s, mu_a) in enumerate(zip(CHANNELS, setup.medium.mu_s, setup.medium.mu_a, strict=True)):
        medium = mu_s / (mu_s + mu_a), 1.0 / (mu_s + mu_a), setup.medium.setting, setup.optics, radii
        seed = len(CHANNELS) * setup.camera_table.seed + number
        spot[colour] = radii, simulated.light(*medium, setup.medium.photons, seed)
    card = simulated.card(setup.optics, radii)
    shown = {name: dict.fromkeys(CHANNELS, (radii, share * card)) for name, share in setup.cards.shown.items()}
    scenes = {"spot": spot} | shown
    rng = np.random.default_rng(setup.camera_table.seed)
    exposures = {}
    enough = FULL * setup.camera.gain * (setup.camera.white - setup.camera.black)
    brightest = {name: max(float(light[0]) for _, light in radial.values()) for name, radial in scenes.items()}
    electrons = enough / (SHORTEST * brightest["spot"])
    for name, radial in scenes.items():
        first = enough / (electrons * brightest[name])
        stated = [first * STEP**at for at in range(setup.camera_table.exposures)]
        times = {one: one * (1.0 + setup.camera_table.late * rng.standard_normal()) for one in stated}
        exposures[name] = simulated.exposures_of(radial, setup.camera, electrons, times, int(rng.integers(2**31)))
    return exposures


def written(setup: Setup, out: Path) -> list[Path]:
    """Write the photographs as raw files (DNG): spot-1.dng, ..., and those of the cards that there are.

    InputError where another camera's lie under these names, or where any lie that are not of this setup, which SPOT-*
    would name too.
    """
    numbers = range(1, setup.camera_table.exposures + 1)
    own = {out / f"{name}-{at}.dng" for name in ("spot", *setup.cards.shown) for at in numbers}
    for file in sorted(one for name in ("spot", "card", "grey") for one in out.glob(f"{name}-*.dng")):
        if file not in own:
            raise InputError(f"{file}: expected none but photographs of this setup in its folder, got another")
        if OURS not in read_whole(file, HEAD):
            raise InputError(f"{file}: expected no photograph of that name, or one that was simulated, got another")
    files = []
    for name, bracket in brackets(setup).items():
        for number, one in enumerate(bracket, start=1):
            files.append(out / f"{name}-{number}.dng")
            write_whole(files[-1], as_dng(one))
    return files


def room(setup: Setup) -> float:
    """Return bytes that the photographs take on a disk, and as many as a command's other files may take."""
    return ROOM + (1 + len(setup.cards.shown)) * setup.camera_table.exposures * 2 * math.prod(setup.camera.sides)


def as_dng(exposure: SimulatedExposure) -> bytes:
    """Return a raw file of Adobe's format."""
    tifffile = library("tifffile")
    codes = tuple(CFA[colour] for row in PATTERN for colour in row)
    below = 10 ** int(np.clip(9 - np.ceil(np.log10(max(exposure.seconds, 1e-9))), 0, 9))  # of the ratio of seconds
    identity = (1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1)
    tags: list[tuple[int, str, int, Any, bool]] = [
        (50706, "B", 4, (1, 4, 0, 0), True), (50707, "B", 4, (1, 1, 0, 0), True),  # versions
        (50708, "s", 0, "profilefit", True), (271, "s", 0, "profilefit", True), (272, "s", 0, "simulated", True),
        (33421, "H", 2, (2, 2), True), (33422, "B", 4, codes, True),  # the pattern
        (50713, "H", 2, (2, 2), True), (50714, "H", 4, (exposure.black,) * 4, True),
        (50717, "I", 1, exposure.white, True),
        (50721, "2i", 9, identity, True), (50778, "H", 1, 21, True), (50728, "2I", 3, (1, 1, 1, 1, 1, 1), True),
        (33434, "2I", 1, (round(exposure.seconds * below), below), True),
    ]  # fmt: skip
    file = io.BytesIO()
    tifffile.imwrite(
        file, exposure.counts, photometric=32803, compression=None, metadata=None, extratags=tags, subfiletype=0,
        rowsperstrip=exposure.counts.shape[0],
    )  # fmt: skip
    return file.getvalue()


def fisher_bounds(setup: Setup) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Errors of mu_s' and mu_a by Fisher's information, by colour: without cards, with either, with both.

    Of rings of exact light under the setup's beam, as fine and as far out as its pixels, which scatter by SCATTER; of
    surface, glare and lens what `Beliefs` have. Exposures and noise are not in it.
    """
    sides, pixel = setup.camera.sides, setup.camera.pitch
    beam, grey = 2.0 * setup.optics.sigma, setup.cards.grey or 0.18
    edges = edges_of(0.5 * min(sides) * pixel, 2.0 * pixel)
    beliefs = Beliefs(beam=Known(beam, BEAM_ERROR * beam)).over(sides, pixel, float(edges[-1]))
    known = Known(grey, GREY_ERROR * grey)
    of: dict[str, tuple[Known | None, ...]]
    of = {"no cards": (), "a white card": (None,), "a grey card": (known,), "both": (None, known)}
    return {
        label: {
            colour: medium.fisher(*noiseless(setup.medium.setting, mu_s, mu_a, edges, cards, beliefs))
            for colour, mu_s, mu_a in zip(CHANNELS, setup.medium.mu_s, setup.medium.mu_a, strict=True)
        }
        for label, cards in of.items()
    }


def noiseless(
    setting: Setting, mu_s: float, mu_a: float, edges: Floats, cards: Sequence[Known | None], beliefs: Beliefs
) -> tuple[Shot, Floats]:
    """Return rings of exact light under the believed beam, with the errors that SCATTER gives them, and coordinates.

    cards  reflectance of each card, None where it is not known
    """
    blank = SpotRings(edges[:-1], edges[1:], np.ones(edges.size - 1), np.eye(edges.size - 1))
    shot = Shot(blank, tuple(Card(blank, known) for known in cards), exact_light(setting), beliefs)
    x = shot.middle
    x[:3] = u_of(mu_s / (mu_s + mu_a)), -np.log(mu_s + mu_a), 0.0
    x[x.size - len(cards) :] = [0.0 if one is None else np.log(one.value) for one in cards]
    seen = [
        replace(blank, value=one, covariance=np.diag((SCATTER * one) ** 2))
        for one in np.split(shot.rows(x)[0], 1 + len(cards))
    ]
    shown = tuple(Card(one, known) for one, known in zip(seen[1:], cards, strict=True))
    return replace(shot, medium=seen[0], cards=shown), x
