"""Accuracy of `profilefit photo` on photographs whose truth is known, and what a mistake costs.

    python -m benchmarks.photo --jobs 2     # 200 photographs of four setups: an hour
    python -m benchmarks.photo --setups     # 200 photographs of as many setups
    python -m benchmarks.photo --mistakes   # a minute

Each is a bracket of five 12-bit exposures of a spot on a medium of n 1.4 and g 0.8, with every nuisance drawn anew from
what the fit believes: beam, surface, glare and its width, darkened corners, speckle, uneven pixels, wrong times, a
correlated error of 1 %; with cards, a white one and a grey one of reflectance .18 +- .004 likewise; once more
with glare that falls as r^-2.4 to r^-5 in place of r^-3. Errors are over the Fisher bound
of the same rings at the truth.

With --setups each photograph has a camera and a beam of its own, and three media: pixels of .05 to .3 mm, a beam of 2
to 12 pixels, 200 to 1600 pixels across, albedos of wax to ketchup (1 - alpha from .003 to .98, mu_s' + mu_a from .3 to
4 per mm), no card, either, or both in turn. It prints the share of intervals of 95 % that hold the truth, and how many
values are wrong by more than 5 intervals unsaid: without a misfit, a rival, "not identified", or a refusal.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from mcml_sim.files.whole_file import write_whole
from profilefit.errors import InputError
from profilefit.fitting.misfit import DETECTED, waves
from profilefit.materials import CHANNELS
from profilefit.measured.identifiability import LOOSE
from profilefit.measured.model import exact_light, u_of
from profilefit.measured.noise import WAVE
from profilefit.measured.photo import medium, simulated, workflow
from profilefit.measured.photo.exposure import BayerPlane, Exposure, of_sensor
from profilefit.measured.photo.medium import Beliefs, Card, Shot
from profilefit.measured.photo.rings import PixelScale
from profilefit.measured.photo.simulated import SpotCamera, SpotOptics
from profilefit.measured.problem import Known

Floats = NDArray[np.float64]
SETTING = Setting(n=1.4, g=0.8)
NAMES = ("mu_s'", "mu_a")
SETUPS = {
    "no cards": (False, False),
    "a white and a grey card": (True, False),
    "no cards, glare of another shape": (False, True),
    "both cards, glare of another shape": (True, True),
}
GREY = Known(0.18, 0.004)
BEAM = Known(0.5, 0.05)
CAMERA = SpotCamera(sides=(800, 600), pitch=0.06)
STEPS = 5  # exposures, by a factor of four each
FULL = 0.5  # of the sensor's range, that the shortest one reaches
LATE = 0.03  # relative error of a stated time
FARTHEST = 40.0  # mm
UNSAID = 5.0  # intervals, that a value may be wrong by without a warning


class Truth(NamedTuple):
    """Truth of a photograph; lengths in mm."""

    alpha: float
    length: float
    optics: SpotOptics
    camera: SpotCamera
    grey: float


class Setup(NamedTuple):
    """Setup that is photographed by a camera of its own: albedo and length [mm] of each channel's medium.

    beam  1/e^2 radius as the fit is told it; white, grey whether there is such a card
    """

    media: dict[str, tuple[float, float]]
    optics: SpotOptics
    camera: SpotCamera
    beam: Known
    white: bool
    grey: float | None


class Verdict(NamedTuple):
    """Answer of a photograph for one colour; an answer that was refused holds no value.

    refusal  why there is no answer; empty where there is one
    warned   names of the values that a misfit, a rival or "not identified" warns of
    off      ln of value over truth by name, in half widths of the 95 % interval
    """

    colour: str
    refusal: str
    warned: tuple[str, ...]
    off: dict[str, float]


class Outcome(NamedTuple):
    """Errors of one photograph, by quantity: relative error, stated, and Fisher's."""

    off: Floats
    stated: Floats
    bound: Floats


def drawn(rng: np.random.Generator) -> Truth:
    """Draw from the prior of a fit, of media such as skin, wax and milk."""
    mu_s, mu_a = np.exp(rng.uniform(np.log(0.6), np.log(2.0))), np.exp(rng.uniform(np.log(0.01), np.log(0.15)))
    optics, camera = nuisances(rng, BEAM, CAMERA)
    length = 1.0 / (mu_s + mu_a)
    return Truth(float(mu_s * length), float(length), optics, camera, GREY.value + GREY.error * rng.standard_normal())


def nuisances(rng: np.random.Generator, told: Known, camera: SpotCamera) -> tuple[SpotOptics, SpotCamera]:
    """Draw beam, lens and surface from the prior of a fit; the lens darkens the corners, the spot is off centre."""
    beam, core = told.value * (1.0 + told.error / told.value * rng.standard_normal()), 0.06 * told.value
    glare = float(np.abs(0.02 + 0.02 * rng.standard_normal()))
    optics = SpotOptics(
        beam=float(2.0 * np.sqrt(max(0.25 * beam**2 - core**2, 1e-3 * beam**2))), core=core,
        surface=float(np.abs(0.01 + 0.01 * rng.standard_normal())), glare=glare,
        width=float(np.exp(rng.uniform(np.log(1.0), np.log(16.0)))),
    )  # fmt: skip
    shown = replace(
        camera, corner=float(np.clip(0.05 + 0.05 * rng.standard_normal(), 0.0, 0.3)),
        centre=tuple(rng.uniform(-20.0, 20.0, 2).tolist()),
    )  # fmt: skip
    return optics, shown


def exposures(
    radii: Floats, light: Floats | Mapping[str, Floats], camera: SpotCamera, rng: np.random.Generator
) -> list[Exposure]:
    """Return a bracket, its times off by LATE; its light, of all channels or by channel, off by a correlated 1 %."""
    by_channel = light if isinstance(light, Mapping) else {"": light}
    smooth = waves(np.maximum(radii, 0.1), WAVE) + 1e-9 * np.eye(radii.size)
    root = medium.UNEVEN * np.linalg.cholesky(smooth)
    wavy = {name: (radii, one * (1.0 + root @ rng.standard_normal(radii.size))) for name, one in by_channel.items()}
    brightest = max(float(one[0]) for one in by_channel.values())
    first = FULL * camera.gain * (camera.white - camera.black) / brightest
    stated = [first * 4.0**step for step in range(STEPS)]
    times = {one: one * (1.0 + LATE * rng.standard_normal()) for one in stated}
    radial = {name: wavy[name if name in wavy else ""] for name in CHANNELS}
    taken = simulated.exposures_of(radial, camera, 1.0, times, int(rng.integers(2**31)))
    return [as_read(one, f"exposure {at + 1}") for at, one in enumerate(taken)]


def as_read(one: simulated.SimulatedExposure, source: str) -> Exposure:
    """Return a bracket as a raw file of it would be read."""
    return of_sensor(source, one.counts, simulated.PATTERN, [[one.black] * 2] * 2, one.white, one.seconds)


def outcome(cards: bool, shaped: bool, at: int) -> Outcome:
    """Fit one photograph of the series, and where there are `cards`, theirs; `shaped`: glare of another shape."""
    rng = np.random.default_rng([11, at])
    one = drawn(rng)
    if shaped:
        one = one._replace(optics=replace(one.optics, falling=float(rng.uniform(1.2, 2.5))))
    radii, pitch = simulated.radii(FARTHEST, one.optics), one.camera.pitch
    size = PixelScale(np.diag([pitch, pitch, 1.0]), "known")

    def seen(light: Floats) -> workflow.Bracket:
        return workflow.bracketed(exposures(radii, light, one.camera, rng), size)

    spot = seen(simulated.light(one.alpha, one.length, SETTING, one.optics, radii))
    shown: tuple[Card, ...] = ()
    if cards:
        white = simulated.card(one.optics, radii)
        pairs = ((0.9 * white, None), (one.grey * white, GREY))
        shown = tuple(workflow.carded(seen(light), "green", size, known, spot) for light, known in pairs)
    beliefs = Beliefs(beam=BEAM).over(spot.sides, pitch, pitch * spot.spot.reach)
    shot = Shot(workflow.ringed(spot, "green", size), shown, exact_light(SETTING), beliefs)
    fit = medium.fitted(shot)
    truth = {"mu_s'": one.alpha / one.length, "mu_a": (1.0 - one.alpha) / one.length}
    bound = medium.fisher(shot, _coordinates(one, shot, fit.x))
    return Outcome(
        np.array([fit.values[name] / truth[name] - 1.0 for name in NAMES]),
        np.array([fit.errors[name] / fit.values[name] for name in NAMES]),
        np.array([bound[name] for name in NAMES]),
    )


def _coordinates(one: Truth, shot: Shot, found: Floats) -> Floats:
    """Return the truth in the fit's coordinates; scales as fitted, and glare shared out among its halos."""
    x = found.copy()
    x[:2], x[3], x[4] = (u_of(one.alpha), np.log(one.length)), np.log(one.optics.sigma), one.optics.surface
    near = np.abs(np.log(np.array(shot.beliefs.halos) / one.optics.width))
    x[5 : 5 + near.size] = one.optics.glare * np.exp(-near) / np.exp(-near).sum()
    return x


def setup(at: int) -> Setup:
    """Return the setup of this number of the series."""
    rng = np.random.default_rng([13, at])
    while True:
        pitch, pixels = float(rng.uniform(0.05, 0.3)), float(np.exp(rng.uniform(np.log(2.0), np.log(12.0))))
        columns = 2 * int(np.exp(rng.uniform(np.log(100.0), np.log(800.0))))
        camera = replace(CAMERA, sides=(columns, 2 * int(0.375 * columns)), pitch=pitch)
        told = Known(pitch * pixels, 0.1 * pitch * pixels)
        optics, camera = nuisances(rng, told, camera)
        media = {}
        for name in CHANNELS:
            absorbed, rate = (np.exp(rng.uniform(*np.log(ends))) for ends in ((0.003, 0.98), (0.3, 4.0)))
            media[name] = float(1.0 - absorbed), float(1.0 / rate)
        try:
            simulated.require_resolved(max(length for _, length in media.values()), optics, _farthest(camera))
        except InputError:  # too fine a beam in too wide a picture to be simulated: another
            continue
        grey = float(GREY.value + GREY.error * rng.standard_normal())
        return Setup(media, optics, camera, told, at % 2 == 1, grey if at % 4 >= 2 else None)


def _farthest(camera: SpotCamera) -> float:
    """Return the farthest radius [mm], beyond the corners."""
    return 1.2 * camera.pitch * float(np.hypot(*camera.sides))


def verdicts(at: int) -> list[Verdict]:
    """Return the answer to one photograph of the series, colour by colour."""
    one, rng = setup(at), np.random.default_rng([17, at])
    radii = simulated.radii(_farthest(one.camera), one.optics)
    size = PixelScale(np.diag([one.camera.pitch, one.camera.pitch, 1.0]), "known")

    def seen(light: Floats | Mapping[str, Floats]) -> workflow.Bracket:
        return workflow.bracketed(exposures(radii, light, one.camera, rng), size)

    card = simulated.card(one.optics, radii)
    try:
        spot = seen({name: simulated.light(*of, SETTING, one.optics, radii) for name, of in one.media.items()})
        shown: list[tuple[workflow.Bracket, Known | None]] = [(seen(0.9 * card), None)] if one.white else []
        shown += [] if one.grey is None else [(seen(one.grey * card), GREY)]
        found = workflow.measured(spot, shown, size, SETTING, Beliefs(beam=one.beam))
    except InputError as error:
        return [Verdict(colour, str(error), (), {}) for colour in CHANNELS]
    return [
        _verdict(colour, found.fits[colour], *one.media[colour]) if colour in found.fits
        else Verdict(colour, "no spot is seen", (), {})
        for colour in CHANNELS
    ]  # fmt: skip


def _verdict(colour: str, fit: medium.PhotoFit, alpha: float, length: float) -> Verdict:
    total = float(np.asarray(fit.shot.light.total(alpha)))
    truth = {"mu_s'": alpha / length, "mu_a": (1.0 - alpha) / length, "A": total}
    half = {name: medium.WITHIN * fit.errors[name] / fit.values[name] for name in truth}
    off = {name: float(np.log(fit.values[name] / truth[name])) / half[name] for name in truth}
    loose = tuple(name for name in NAMES if not fit.errors[name] < LOOSE * fit.values[name])
    warned = tuple(truth) if fit.chance < DETECTED or fit.rivals else (*loose, *(("A",) if loose else ()))
    return Verdict(colour, "" if fit.converged else fit.result, warned, off)


def setups(count: int, jobs: int) -> dict[str, Any]:
    """Print, of each photograph and of all, what holds and what is wrong unsaid."""
    each: list[Verdict] = []
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        for at, found in enumerate(pool.map(verdicts, range(count))):
            each += found
            for one in found:
                off = ", ".join(f"{name} {value:+.1f}" for name, value in one.off.items())
                print(f"{at} {one.colour}: {off}; {one.refusal or ', '.join(one.warned) or 'no warning'}", flush=True)
    answered = [one for one in each if not one.refusal]
    shares: dict[str, Any] = {"answers": len(answered), "refused": len(each) - len(answered)}
    for colour in CHANNELS:
        of = [one.off for one in answered if one.colour == colour]
        for name in (*NAMES, "A"):
            shares[f"{colour} {name}"] = float(np.mean([abs(off[name]) < 1.0 for off in of]))
            print(f"{colour} {name}: 95 % hold {shares[f'{colour} {name}']:.1%} of {len(of)}")
    wrong = [name in one.warned for one in answered for name, off in one.off.items() if abs(off) > UNSAID]
    shares |= {"wrong": len(wrong), "unsaid": wrong.count(False)}
    print(f"{count} photographs, {len(each)} colours, {shares['refused']} refused; wrong by more than {UNSAID:g} "
          f"intervals: {len(wrong)} values, {shares['unsaid']} of them unsaid")  # fmt: skip
    return shares


@dataclass(frozen=True)
class Mistake:
    """Mistake in what is done or believed; the photographs are taken so, or the fit is told so.

    bent  power of the sensor's response;  pixel  its size over the true one
    """

    words: str
    camera: dict[str, float] = field(default_factory=dict)
    bent: float = 1.0
    pixel: float = 1.0
    beliefs: dict[str, Known] = field(default_factory=dict)
    setting: Setting = SETTING


NOTHING = Known(1e-6, 1e-6)
MISTAKES = (
    Mistake("none"),
    Mistake("glare of 2 % not thought of", beliefs={"glare": NOTHING}),
    Mistake("1 % scattered by the surface not thought of", beliefs={"surface": NOTHING}),
    Mistake("pixels taken for 5 % larger", pixel=1.05),
    Mistake("beam of 0.5 mm taken for 1 mm", beliefs={"beam": Known(1.0, 0.01)}),
    Mistake("beam of 0.5 mm taken for 0.25 mm", beliefs={"beam": Known(0.25, 0.0025)}),
    Mistake("seen 20 degrees aslant", camera={"tilt": 20.0}),
    Mistake("seen 40 degrees aslant", camera={"tilt": 40.0}),
    Mistake("speckle of contrast 0.3 instead of 0.1", camera={"speckle": 0.3}),
    Mistake("response bent, counts as light^0.95", bent=0.95),
    Mistake("n of 1.4 taken for 1.33", setting=replace(SETTING, n=1.33)),
    Mistake("g of 0.8 taken for 0", setting=replace(SETTING, g=0.0)),
)


def mistaken(one: Mistake) -> medium.PhotoFit:
    """Fit a medium of mu_s' 1 and mu_a .05 per mm, without cards."""
    optics, camera = SpotOptics(), replace(CAMERA, **one.camera)
    radii = simulated.radii(FARTHEST, optics)
    light = simulated.light(1.0 / 1.05, 1.0 / 1.05, SETTING, optics, radii)
    shots = exposures(radii, light, camera, np.random.default_rng(0))
    shots = [replace(shot, planes=tuple(_bent(plane, one.bent) for plane in shot.planes)) for shot in shots]
    pitch = one.pixel * camera.pitch
    size = PixelScale(np.diag([pitch, pitch, 1.0]), "told")
    spot = workflow.bracketed(shots, size)
    beliefs = Beliefs(beam=BEAM).over(spot.sides, pitch, pitch * spot.spot.reach)
    rings = workflow.ringed(spot, "green", size)
    return medium.fitted(Shot(rings, (), exact_light(one.setting), replace(beliefs, **one.beliefs)))


def _bent(plane: BayerPlane, power: float) -> BayerPlane:
    share = np.maximum(plane.counts, 0.0) / plane.range
    return plane if power == 1.0 else replace(plane, counts=(plane.range * share**power).astype(np.float32))


def mistakes() -> None:
    """Print the effect of each on the answer, over that of the same photographs, or ones like them, without it."""
    right = None
    for one in MISTAKES:
        fit = mistaken(one)
        right = right or fit
        off = [fit.values[name] / right.values[name] - 1.0 for name in NAMES]
        said = [fit.errors[name] / fit.values[name] for name in NAMES]
        print(f"{one.words:45} mu_s' {off[0]:+6.0%} +- {said[0]:.0%}, mu_a {off[1]:+6.0%} +- {said[1]:.0%}, "
              f"p-value {fit.chance:.2g}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="photographs")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, help="also write the numbers into this file")
    parser.add_argument("--setups", action="store_true", help="of cameras, beams and media of their own")
    parser.add_argument("--mistakes", action="store_true", help="print what each costs instead")
    given = parser.parse_args()
    if given.mistakes:
        mistakes()
        return
    if given.setups:
        shares = setups(given.count, given.jobs)
        if given.json is not None:
            write_whole(given.json, json.dumps(shares, indent=1) + "\n")
        return
    found: dict[str, dict[str, dict[str, float]]] = {}
    for setup, (cards, shaped) in SETUPS.items():
        with ProcessPoolExecutor(given.jobs, get_context("spawn")) as pool:
            each = list(pool.map(partial(outcome, cards, shaped), range(given.count)))
        off, stated, bound = (np.array([getattr(one, name) for one in each]) for name in Outcome._fields)
        found[setup] = {}
        for at, name in enumerate(NAMES):
            row = {
                "rms": float(np.sqrt(np.mean(off[:, at] ** 2))),
                "bound": float(np.sqrt(np.mean(bound[:, at] ** 2))),
                "over": float(np.sqrt(np.mean((off[:, at] / bound[:, at]) ** 2))),
                "held": float(np.mean(np.abs(np.log1p(off[:, at])) < 1.96 * stated[:, at])),
            }
            found[setup][name] = row
            print(f"{setup}, {name}: rms {row['rms']:.1%}, bound {row['bound']:.1%}, {row['over']:.2f} x the bound; "
                  f"95 % hold {row['held']:.1%}")  # fmt: skip
    if given.json is not None:
        write_whole(given.json, json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
