"""A setup for photographs that are simulated: its file, its photographs as raw files, and what they could tell.

`KEYS` are those of its file, and `examples/photo.toml` is one.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim.exact.half_space import require_solved
from mcml_sim.files.text_file import read_toml
from mcml_sim.files.whole_file import ROOM, read_whole, write_whole
from mcml_sim.media.checks import is_number
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.measured.model import exact_light, u_of
from profilefit.measured.photo import medium, simulated
from profilefit.measured.photo.exposure import library
from profilefit.measured.photo.medium import Beliefs, Card, Shot
from profilefit.measured.photo.rings import SpotRings, edges_of
from profilefit.measured.photo.simulated import CHANNELS, SimulatedExposure, SpotCamera, SpotOptics
from profilefit.measured.problem import Known
from profilefit.recipes.toml_tables import Table, Tables

Floats = NDArray[np.float64]
KEYS = {
    "": ("medium", "optics", "camera", "cards"),
    "medium": ("mu_s", "mu_a", "n", "g", "photons"),
    "optics": ("beam", "core", "surface", "glare", "width", "falling"),
    "camera": ("sides", "pitch", "gain", "read", "bits", "black", "well", "uneven", "corner", "tilt", "speckle",
               "grain", "exposures", "late", "seed"),
    "cards": ("white", "grey"),
}  # fmt: skip
MAX_BYTES, LEAST_SIDE, MOST_SIDE = 1 << 16, 50, 12_000
# The largest numbers of a camera and of its optics that make a photograph; lengths in mm.
LARGEST = {"pitch": 10.0, "gain": 1e4, "read": 1e4, "well": 1e9, "uneven": 0.1, "corner": 0.9, "speckle": 1.0,
           "grain": 50.0, "beam": 100.0, "core": 100.0, "surface": 1.0, "glare": 0.9, "width": 1e3,
           "falling": 10.0}  # fmt: skip
OURS, HEAD = b"profilefit", 4096  # in the first bytes of each file
MOST_PHOTONS = 10**9
MOST = 1e6  # 1/mm
SHORTEST = 1e-3  # seconds, of the spot: its light is as bright as that
STEP = 4.0  # from one exposure to the next
FULL = 0.5  # of the sensor's range, that the shortest one reaches
CFA = {"red": 0, "green": 1, "blue": 2}
GREY_ERROR, BEAM_ERROR = 0.03, 0.1  # relative, of what is told
SCATTER = 0.003  # of a ring, by speckle and noise


@dataclass(frozen=True)
class Setup:
    """Medium, beam, lens and camera of a simulation.

    photons  that are traced for each colour; 0: light is exact
    late     relative error of stated times
    white    whether there is such a card; grey the reflectance of the other, if there is one
    """

    mu_s: tuple[float, float, float]
    mu_a: tuple[float, float, float]
    setting: Setting
    photons: int
    optics: SpotOptics
    camera: SpotCamera
    exposures: int
    late: float
    seed: int
    white: bool
    grey: float | None


def read_setup(path: Path) -> Setup:
    """InputError, in one line, of what is no setup."""
    tables = read_toml(path, MAX_BYTES)
    read = Tables(str(path), KEYS)
    read.known("", tables, KEYS[""])
    of, lens, camera, cards = (read.table(tables, name, {} if name != "medium" else None) for name in KEYS[""])
    own = SpotCamera()
    numbers: dict[str, Any] = {
        name: read.number("camera", name, camera, getattr(own, name), LARGEST[name])
        for name in ("pitch", "gain", "read", "well", "uneven", "corner", "speckle", "grain")
    }
    shown = replace(
        own, **numbers,
        sides=read.sides("camera", "sides", camera, (1200, 900), MOST_SIDE),
        bits=read.whole("camera", "bits", camera, own.bits, 8, 14),
        black=read.whole("camera", "black", camera, own.black, 0, 4000),
        tilt=_within(read, "camera", "tilt", camera, 0.0, -60.0, 60.0),
    )  # fmt: skip
    if min(shown.sides) < LEAST_SIDE:
        raise read.bad("camera", "sides", f"at least {LEAST_SIDE} pixels each", list(shown.sides))
    if not shown.black < shown.white:
        raise read.bad("camera", "black", f"less than {shown.white}, white of {shown.bits} bits", shown.black)
    optics = SpotOptics(
        **{
            name: read.number("optics", name, lens, getattr(SpotOptics(), name), LARGEST[name])
            for name in KEYS["optics"]
        }
    )
    if not optics.falling > 1.0:
        raise read.bad("optics", "falling", "a number > 1, or its light is endless", optics.falling)
    setting = Setting(n=read.number("medium", "n", of, 1.4), g=_within(read, "medium", "g", of, 0.8, 0.0, 1.0))
    read.build("medium", lambda: require_solved(setting))
    mu_s = read.three("medium", "mu_s", of, (1.0, 1.0, 1.0), 1e-3, MOST)
    mu_a = read.three("medium", "mu_a", of, (0.05, 0.05, 0.05), 1e-4, MOST)
    longest = 1.0 / min(map(sum, zip(mu_s, mu_a, strict=True)))
    read.build("medium", lambda: simulated.require_resolved(longest, optics, _far(shown)))
    return Setup(
        mu_s, mu_a,
        setting, read.whole("medium", "photons", of, 0, 0, MOST_PHOTONS), optics, shown,
        read.whole("camera", "exposures", camera, 5, 1, 12),
        read.number("camera", "late", camera, 0.02, 0.2),
        read.whole("camera", "seed", camera, 0, 0, 2**31 - 1),
        _flag(read, "cards", "white", cards),
        read.number("cards", "grey", cards, most=1.0) if "grey" in cards else None,
    )  # fmt: skip


def _flag(read: Tables, where: str, key: str, table: Table) -> bool:
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise read.bad(where, key, "true or false", value)
    return value


def _within(read: Tables, where: str, key: str, table: Table, default: float, least: float, most: float) -> float:
    value = table.get(key, default)
    if not is_number(value) or not least <= value <= most:
        raise read.bad(where, key, f"a number in {least:g} ... {most:g}", value)
    return float(value)


def _far(camera: SpotCamera) -> float:
    """[mm], beyond the corners."""
    return 1.2 * camera.pitch * float(np.hypot(*camera.sides))


def brackets(setup: Setup) -> dict[str, list[SimulatedExposure]]:
    """Exposures of the spot, and of the cards that there are, by what they show."""
    radii = simulated.radii(_far(setup.camera), setup.optics)
    spot = {}
    for at, (colour, mu_s, mu_a) in enumerate(zip(CHANNELS, setup.mu_s, setup.mu_a, strict=True)):
        medium = mu_s / (mu_s + mu_a), 1.0 / (mu_s + mu_a), setup.setting, setup.optics, radii
        spot[colour] = radii, simulated.light(*medium, setup.photons, len(CHANNELS) * setup.seed + at)
    card = simulated.card(setup.optics, radii)
    scenes = {"spot": spot}
    if setup.white:
        scenes["card"] = dict.fromkeys(CHANNELS, (radii, 0.9 * card))
    if setup.grey is not None:
        scenes["grey"] = dict.fromkeys(CHANNELS, (radii, setup.grey * card))
    rng = np.random.default_rng(setup.seed)
    exposures = {}
    enough = FULL * setup.camera.gain * (setup.camera.white - setup.camera.black)
    brightest = {name: max(float(light[0]) for _, light in radial.values()) for name, radial in scenes.items()}
    electrons = enough / (SHORTEST * brightest["spot"])
    for name, radial in scenes.items():
        first = enough / (electrons * brightest[name])
        stated = [first * STEP**at for at in range(setup.exposures)]
        times = {one: one * (1.0 + setup.late * rng.standard_normal()) for one in stated}
        exposures[name] = simulated.exposures_of(radial, setup.camera, electrons, times, int(rng.integers(2**31)))
    return exposures


def written(setup: Setup, out: Path) -> list[Path]:
    """Write the photographs as raw files (DNG): spot-1.dng, ..., and those of the cards that there are.

    InputError where another camera's lie under these names, or where any lie that are not of this setup, which SPOT-*
    would name too.
    """
    taken = {"spot": True, "card": setup.white, "grey": setup.grey is not None}
    own = {out / f"{name}-{at}.dng" for name in taken if taken[name] for at in range(1, setup.exposures + 1)}
    for file in sorted(one for name in taken for one in out.glob(f"{name}-*.dng")):
        if file not in own:
            raise InputError(f"{file}: expected none but photographs of this setup in its folder, got another")
        if OURS not in read_whole(file, HEAD):
            raise InputError(f"{file}: expected no photograph of that name, or one that was simulated, got another")
    files = []
    for name, bracket in brackets(setup).items():
        for at, one in enumerate(bracket, start=1):
            files.append(out / f"{name}-{at}.dng")
            write_whole(files[-1], as_dng(one))
    return files


def room(setup: Setup) -> float:
    """Return bytes that the photographs take on a disk, and as many as a command's other files may take."""
    scenes = 1 + setup.white + (setup.grey is not None)
    return ROOM + scenes * setup.exposures * 2 * math.prod(setup.camera.sides)


def as_dng(exposure: SimulatedExposure) -> bytes:
    """Return a raw file of Adobe's format."""
    tifffile = library("tifffile")
    codes = tuple(CFA[colour] for row in exposure.pattern for colour in row)
    identity = (1, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1)
    tags: list[tuple[int, str, int, Any, bool]] = [
        (50706, "B", 4, (1, 4, 0, 0), True), (50707, "B", 4, (1, 1, 0, 0), True),  # versions
        (50708, "s", 0, "profilefit", True), (271, "s", 0, "profilefit", True), (272, "s", 0, "simulated", True),
        (33421, "H", 2, (2, 2), True), (33422, "B", 4, codes, True),  # the pattern
        (50713, "H", 2, (2, 2), True), (50714, "H", 4, (exposure.black,) * 4, True),
        (50717, "I", 1, exposure.white, True),
        (50721, "2i", 9, identity, True), (50778, "H", 1, 21, True), (50728, "2I", 3, (1, 1, 1, 1, 1, 1), True),
        (33434, "2I", 1, _ratio(exposure.seconds), True),
    ]  # fmt: skip
    file = io.BytesIO()
    tifffile.imwrite(
        file, exposure.counts, photometric=32803, compression=None, metadata=None, extratags=tags, subfiletype=0,
        rowsperstrip=exposure.counts.shape[0],
    )  # fmt: skip
    return file.getvalue()


def _ratio(seconds: float) -> tuple[int, int]:
    below = 10 ** int(np.clip(9 - np.ceil(np.log10(max(seconds, 1e-9))), 0, 9))
    return round(seconds * below), below


def fisher_bounds(setup: Setup) -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    """Errors of mu_s' and mu_a by Fisher's information, by colour: without cards, with either, with both.

    Of rings of exact light under the setup's beam, as fine and as far out as its pixels, which scatter by SCATTER; of
    surface, glare and lens what `Beliefs` have. Exposures and noise are not in it.
    """
    grey = setup.grey or 0.18
    known = Known(grey, GREY_ERROR * grey)
    of: dict[str, tuple[Known | None, ...]]
    of = {"no cards": (), "a white card": (None,), "a grey card": (known,), "both": (None, known)}
    return {
        label: {
            colour: _bounds(setup, mu_s, mu_a, cards)
            for colour, mu_s, mu_a in zip(CHANNELS, setup.mu_s, setup.mu_a, strict=True)
        }
        for label, cards in of.items()
    }


def _bounds(setup: Setup, mu_s: float, mu_a: float, cards: Sequence[Known | None]) -> dict[str, float]:
    pixel, core = setup.camera.pitch, setup.optics.sigma
    edges = edges_of(0.5 * min(setup.camera.sides) * pixel, 2.0 * pixel)
    blank = SpotRings(edges[:-1], edges[1:], np.ones(edges.size - 1), np.eye(edges.size - 1))
    beliefs = Beliefs(beam=Known(2.0 * core, BEAM_ERROR * 2.0 * core)).over(setup.camera.sides, pixel, float(edges[-1]))
    shot = Shot(blank, tuple(Card(blank, known) for known in cards), exact_light(setup.setting), beliefs)
    x = shot.middle
    x[:4] = u_of(mu_s / (mu_s + mu_a)), -np.log(mu_s + mu_a), 0.0, np.log(core)
    x[x.size - len(cards) :] = [0.0 if one is None else np.log(one.value) for one in cards]
    seen = [
        replace(blank, value=one, covariance=np.diag((SCATTER * one) ** 2))
        for one in np.split(shot.rows(x)[0], 1 + len(cards))
    ]
    shown = tuple(Card(one, known) for one, known in zip(seen[1:], cards, strict=True))
    return dict(medium.fisher(replace(shot, medium=seen[0], cards=shown), x))
