"""Coverage of the intervals of `profilefit fit`, and what a measurement can know at all.

    python -m benchmarks.own_data                          # 200 media, n and g given and open: ten minutes
    python -m benchmarks.own_data --beams                  # under beams of .25 to 1 mm, given or not: the same
    python -m benchmarks.own_data --distorted --count 400  # light that no medium gives exactly: an hour on two cores
    python -m benchmarks.own_data --chart own-data.png     # a minute: error by r_min, r_max, noise, beam, n and g

Media are drawn from what a fit takes for possible: n from 1.33 to 1.45, g from 0 to .95, alpha' flat in sqrt(1 -
alpha'), l* from a fifth to five times the middle radius; 24 rings of a factor 150 in r, errors of 1 to 3 %. Light is
that of the table at the medium's own n and g, the noise normal. Half-widths are over the Fisher bound: of the same
rows, by the derivatives at the truth, n and g known or normal with the variance of their range.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.render_figure import save
from mcml_sim import Setting
from mcml_sim.media.setting import FORWARD_G, FORWARD_N
from profilefit.measured import model
from profilefit.measured.data import Measured
from profilefit.measured.fitting import fitted
from profilefit.measured.identifiability import beam_width
from profilefit.measured.instrument import PENCIL, Gaussian, Instrument
from profilefit.measured.model import Model, exact_light, u_of
from profilefit.measured.premises import Premises
from profilefit.measured.problem import FitSpec
from profilefit.measured.result import MediumPosterior, judged
from profilefit.report.figures.canvas import BLUE, GREEN, ORANGE, VERMILION, WIDTH, canvas, plain_log, styled

Floats = NDArray[np.float64]

EDGES = np.geomspace(0.1, 15.0, 25)  # mm
MIDDLE = float(np.sqrt(EDGES[0] * EDGES[-1]))
OPEN = {"n": FORWARD_N, "g": (0.0, FORWARD_G)}
NAMES = ("mu_s'", "mu_a")
SCALE = {"scale": 1.0}


class Medium(NamedTuple):
    """Medium that is drawn; lengths in mm."""

    setting: Setting
    alpha: float
    length: float
    error: float


class Coverage(NamedTuple):
    """Coverage of one quantity."""

    held: float
    """Share of the intervals that hold the truth."""
    answered: float
    """Share of the media that have one, its half-width below the value."""
    wider: float
    """Median half-width over the Fisher bound's."""


def drawn(rng: np.random.Generator) -> Medium:
    """Draw a medium of the prior."""
    n, g, s = rng.uniform(*FORWARD_N), rng.uniform(0.0, FORWARD_G), rng.uniform(0.03, 0.95)
    length = MIDDLE * np.exp(rng.uniform(-np.log(5.0), np.log(5.0)))
    return Medium(Setting(n=float(n), g=float(g)), 1.0 - s * s, float(length), rng.uniform(0.01, 0.03))


def rows(one: Medium, rng: np.random.Generator, seen: Instrument = PENCIL, edges: Floats = EDGES) -> Measured:
    """Return what is measured of a medium."""
    inner, outer = edges[:-1], edges[1:]
    light = Model(exact_light(one.setting), seen).predicted(_point(one)[None], inner, outer)[0, :-1]
    keep = light > 1e-9 * light[0]
    value = light * (1.0 + one.error * rng.standard_normal(light.size))
    known = np.full(light.size, np.inf)
    whole = Measured("drawn", "", inner, outer, value, one.error * light, known, "as given", "mm")
    return whole.chosen(keep)


def coverage(count: int, opened: bool, jobs: int) -> dict[str, Coverage]:
    """Count over so many media, n and g given or `opened`."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        each = np.array(list(pool.map(partial(covered, opened), range(count))), float)
    return {name: _summary(each[:, at]) for at, name in enumerate(NAMES)}


def covered(opened: bool, at: int) -> list[tuple[bool, bool, float]]:
    """Fit one medium of the series, by quantity: the truth is held; there is an answer; half-width over Fisher's."""
    rng = np.random.default_rng([1, at])
    one = drawn(rng)
    data, premises = rows(one, rng), _premises(one, opened)
    answer = judged(fitted(data, _spec(premises)))
    bound = _fisher(one, data, premises.instrument, premises.ranges)
    found, truth = [], _truth(one)
    for name in NAMES:
        low, high = _ends(answer, name) or (np.nan, np.nan)
        ratio = (high - low) / 3.92 / answer.fit.values[name]
        found.append((bool(low < truth[name] < high), bool(ratio < 0.5), float(ratio / bound[name])))
    return found


def _ends(answer: MediumPosterior, name: str) -> tuple[float, float] | None:
    """Return the ends of the interval that has two."""
    low, high = answer.whole_interval(name) or answer.interval(name) or (None, None)
    return None if low is None or high is None else (low, high)


def _summary(each: Floats) -> Coverage:
    answered = each[:, 1] > 0
    return Coverage(float(each[answered, 0].mean()), float(answered.mean()), float(np.median(each[answered, 2])))


def _truth(one: Medium) -> dict[str, float]:
    return {"mu_s'": one.alpha / one.length, "mu_a": (1.0 - one.alpha) / one.length}


def _point(one: Medium) -> Floats:
    return np.array([u_of(one.alpha), np.log(one.length), 0.0])


def _premises(one: Medium, opened: bool) -> Premises:
    if not opened:
        return Premises(one.setting)
    return Premises(Setting(n=float(np.mean(OPEN["n"])), g=float(np.mean(OPEN["g"]))), ranges=OPEN)


def _spec(premises: Premises) -> FitSpec:
    return FitSpec(exact_light(premises.setting), SCALE, instrument=premises.instrument, ranges=premises.ranges)


def _fisher(
    one: Medium, data: Measured, seen: Instrument, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Return relative errors that no unbiased estimate undercuts; a range is normal with the range's variance."""
    truth, point = FitSpec(exact_light(one.setting), SCALE, instrument=seen), _point(one)
    light, slopes = Model(truth.law, seen).linearised(point, data.inner, data.outer)
    rows = np.diag(data.sigma**2)
    for name, (low, high) in ranges.items():
        value = seen.beam.w if isinstance(seen.beam, Gaussian) and name == "beam" else getattr(one.setting, name)
        ends = [float(np.clip(value + side * 0.02 * (high - low), low, high)) for side in (-1.0, 1.0)]
        there = [truth.under({name: end}) for end in ends]
        below, above = (Model(at.law, at.instrument).predicted(point[None], data.inner, data.outer)[0] for at in there)
        slope = (above - below)[:-1] / (ends[1] - ends[0])
        rows += np.outer(slope, slope) * (high - low) ** 2 / 12.0
    free = slopes[:-1, :2]
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = np.linalg.inv(free.T @ np.linalg.solve(rows, free))
    errors = model.errors(model.slopes(point, slopes[-1]), covariance)
    values = model.quantities(point[None], light[-1:])
    return {name: errors[name] / float(values[name][0]) for name in NAMES}


BEAM_EDGES = np.arange(0.0, 10.01, 0.25)  # mm


class Beams(NamedTuple):
    """Shares of media under beams of .25 to 1 mm, seen from 0 to 4 w on, scale known or free."""

    held: dict[str, float]
    """Share of intervals, the beam given, that hold the truth, by quantity."""
    answered: float
    """Share, the beam given, where both quantities have an interval, and no other medium fits as well."""
    wrong: float
    """Share, the beam not given, where an interval misses the truth."""
    warned: float
    """Share of these where the answer says so: width or misfit are noticed, or a beam as wide is said to matter."""
    noticed: float
    """Share of these where the width or a misfit is noticed."""
    accused: float
    """Share of media under a pencil beam where a width is noticed."""


class Beamed(NamedTuple):
    """Medium under a beam; as `Beams`, None where the share is not of it."""

    held: tuple[bool, ...] | None
    answered: bool
    wrong: bool
    warned: bool | None
    noticed: bool | None
    accused: bool | None


def beams(count: int, jobs: int) -> Beams:
    """Count over so many media; isotropic, n = 1, errors of .2 to 2 %."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        return shares(list(pool.map(beamed, range(count))))


def shares(each: list[Beamed]) -> Beams:
    """Return the shares of many media."""
    held = np.mean([one.held for one in each if one.held is not None], axis=0)
    columns = ([getattr(one, name) for one in each] for name in Beamed._fields[1:])
    rest = (float(np.mean([one for one in column if one is not None])) for column in columns)
    return Beams(dict(zip(NAMES, held.tolist(), strict=True)), *rest)


def beamed(at: int) -> Beamed:
    """Fit one medium of the series; the scale is known of every other."""
    rng, light = np.random.default_rng([2, at]), exact_light(Setting())
    s, length = rng.uniform(0.05, 0.8), np.exp(rng.uniform(np.log(0.2), np.log(2.0)))
    one = Medium(Setting(), 1.0 - s * s, float(length), float(np.exp(rng.uniform(np.log(0.002), np.log(0.02)))))
    w = float(np.exp(rng.uniform(np.log(0.25), np.log(1.0))))
    edges, known = BEAM_EDGES[rng.uniform(0.0, 4.0) * w <= BEAM_EDGES], SCALE if at % 2 else {}
    seen = Instrument(Gaussian(w))
    data = rows(one, rng, seen, edges)
    given = judged(fitted(data, FitSpec(light, known, instrument=seen)))
    held = _holds(given, one)
    answered = held is not None and not given.fit.rivals
    blind = judged(fitted(data, FitSpec(light, known)))
    inside, width = _holds(blind, one), blind.width
    wrong = inside is not None and not all(inside)
    noticed = blind.fit.misfit.detected or (width is not None and width.noticed)
    told = width is not None and width.telling is not None and width.telling < w
    of_pencil = beam_width(fitted(rows(one, rng, PENCIL, edges), FitSpec(light, known)))
    return Beamed(
        held if answered else None, answered, wrong, noticed or told if wrong else None, noticed if wrong else None,
        None if of_pencil is None else of_pencil.noticed,
    )  # fmt: skip


def _holds(answer: MediumPosterior, one: Medium) -> tuple[bool, ...] | None:
    """Return whether the intervals hold the truth; None where a quantity has none with two ends."""
    inside = []
    for name in NAMES:
        if (ends := _ends(answer, name)) is None:
            return None
        inside.append(ends[0] < _truth(one)[name] < ends[1])
    return tuple(inside)


ALLOWED: dict[str, dict[str, tuple[float, float]]] = {
    "n and g given": {},
    "n and g open": {"n": FORWARD_N, "g": (0.7, FORWARD_G)},
    "n, g and beam open": {"n": FORWARD_N, "g": (0.7, FORWARD_G), "beam": (0.1, 1.0)},
}


class Distortions(NamedTuple):
    """Shares of media whose light has a smooth relative error."""

    held: dict[str, float]
    """Share of intervals by all errors that hold the truth, by quantity."""
    answered: float
    """Share of media that have such intervals."""
    accused: float | None
    """Share of media under a pencil beam where a width is noticed; None where the beam is open."""


def distortions(known: str, count: int, jobs: int) -> Distortions:
    """Count over so many media; n, g and beam as in `ALLOWED`."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        each = list(pool.map(partial(distorted, known), range(count)))
    held = np.mean([one for one, _ in each if one is not None], axis=0)
    accused = [one for _, one in each if one is not None]
    return Distortions(
        dict(zip((*NAMES, "A"), held.tolist(), strict=True)),
        float(np.mean([one is not None for one, _ in each])),
        float(np.mean(accused)) if accused else None,
    )


def distorted(known: str, at: int, noise: tuple[float, float] = (0.003, 0.01), **waves) -> tuple:
    """Return whether the intervals of one medium hold mu_s', mu_a and A, and whether a width is noticed."""
    data, one, seen = waved(np.random.default_rng([3, at]), "beam" in ALLOWED[known], noise, **waves)
    ranges = ALLOWED[known]
    middles = {name: float(np.mean(ends)) for name, ends in ranges.items()}
    setting = Setting(n=middles.get("n", one.setting.n), g=middles.get("g", one.setting.g))
    instrument = Instrument(Gaussian(middles["beam"])) if "beam" in ranges else seen
    answer = judged(fitted(data, FitSpec(exact_light(setting), SCALE, instrument=instrument, ranges=ranges)))
    width = answer.width
    light = Model(exact_light(one.setting)).predicted(_point(one)[None], EDGES[:1], EDGES[1:2])
    truth = {**_truth(one), "A": float(light[0, -1])}
    noticed, held = None if width is None else width.noticed, []
    for name, true in truth.items():
        low, high = answer.whole_interval(name) or (None, None)
        if low is None or high is None:
            return None, noticed
        held.append(low < true < high)
    return tuple(held), noticed


def waved(
    rng: np.random.Generator,
    beamed: bool,
    noise: tuple[float, float],
    sizes: tuple[float, float] = (0.001, 0.01),
    wavelengths: tuple[float, float] = (0.5, 3.0),
) -> tuple[Measured, Medium, Instrument]:
    """Draw a medium and its light at 20 to 40 radii over 1.5 to 2 decades, with noise and a wave along ln r."""
    n, g = rng.uniform(*FORWARD_N), rng.uniform(0.7, FORWARD_G)
    r = 0.1 * np.geomspace(1.0, 10.0 ** rng.uniform(1.5, 2.0), int(rng.integers(20, 41)))
    albedo = 1.0 - np.exp(rng.uniform(np.log(0.001), np.log(0.5)))
    length, error = (np.exp(rng.uniform(*np.log(ends))) for ends in ((r[0], r[-1]), noise))
    one = Medium(Setting(n=float(n), g=float(g)), float(albedo), float(length), float(error))
    seen = Instrument(Gaussian(float(rng.uniform(0.1, 1.0)))) if beamed else PENCIL
    light = Model(exact_light(one.setting), seen).predicted(_point(one)[None], r, r)[0, :-1]
    wave = np.sin(2.0 * np.pi * np.log(r) / rng.uniform(*wavelengths) + rng.uniform(0.0, 2.0 * np.pi))
    value = light * (1.0 + rng.uniform(*sizes) * wave + error * rng.standard_normal(r.size))
    whole = Measured("drawn", "", r, r, value, error * light, np.full(r.size, np.inf), "as given", "mm")
    return whole.chosen(light > 1e-9 * light[0]), one, seen


SMOOTH = Medium(Setting(n=1.4, g=0.8), 0.98, 1.0, 0.001)  # mu_a .02, mu_s' .98 per mm


def wavy(size: float = 0.004, wavelength: float = 2.5, phase: float = 0.5) -> Measured:
    """Draw light of `SMOOTH` at 30 radii with a relative error of one wave along ln r and noise of .1 %."""
    r = np.geomspace(0.1, 10.0, 30)
    light = Model(exact_light(SMOOTH.setting)).predicted(_point(SMOOTH)[None], r, r)[0, :-1]
    wave = size * np.sin(2.0 * np.pi * np.log(r) / wavelength + phase)
    value = light * (1.0 + wave + SMOOTH.error * np.random.default_rng(1).standard_normal(r.size))
    return Measured("wavy", "", r, r, value, SMOOTH.error * light, np.full(r.size, np.inf), "as given", "mm")


TISSUE = Medium(Setting(n=1.4, g=0.9), 10.0 / 10.2, 1.0 / 1.02, 0.02)  # mu_a .02, mu_s' 1 per mm
NOISE = (0.5, 1.0, 2.0, 5.0)  # %
NEAREST, FARTHEST = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0), (2.0, 4.0, 7.0, 10.0, 15.0)
KNOWN = {
    "n and g given": {},
    "g open": {"g": OPEN["g"]},
    "n and g open": OPEN,
    "beam 0.5 mm known to 20 %": {"beam": (0.4, 0.6)},
}


def known_to(nearest: float, farthest: float, error: float, ranges: dict) -> dict[str, float]:
    """Return relative errors of tissue from rings a fifth apart in r."""
    edges = np.geomspace(nearest, farthest, max(int(np.log(farthest / nearest) / 0.2), 4) + 1)
    seen = Instrument(Gaussian(0.5) if "beam" in ranges else None)
    light = Model(exact_light(TISSUE.setting), seen).predicted(_point(TISSUE)[None], edges[:-1], edges[1:])[0, :-1]
    known = np.full(light.size, np.inf)
    data = Measured("tissue", "", edges[:-1], edges[1:], light, error * light, known, "as given", "mm")
    return _fisher(TISSUE, data, seen, ranges)


@styled
def chart(path: Path) -> None:
    """Draw the error of mu_a and mu_s' over the nearest ring, the farthest, and the noise."""
    panels = (
        ("nearest ring [mm], up to 15 mm", NEAREST, lambda x, ranges: known_to(x, 15.0, 0.02, ranges)),
        ("farthest ring [mm], from 0.2 mm", FARTHEST, lambda x, ranges: known_to(0.2, x, 0.02, ranges)),
        ("error of a ring [%], 0.2 to 15 mm", NOISE, lambda x, ranges: known_to(0.2, 15.0, x / 100.0, ranges)),
    )
    figure = canvas(4.6, WIDTH)
    axes = figure.subplots(2, len(panels), sharey="row", sharex="col")
    for column, (label, values, errors) in enumerate(panels):
        for (name, ranges), colour in zip(KNOWN.items(), (BLUE, ORANGE, VERMILION, GREEN), strict=True):
            found = [errors(value, ranges) for value in values]
            for row, quantity in zip(axes[:, column], NAMES, strict=True):
                row.plot(values, [100.0 * one[quantity] for one in found], "o-", color=colour, label=name, ms=3)
        for row, quantity in zip(axes[:, column], NAMES, strict=True):
            row.set_xscale("log")
            row.set_yscale("log")
            plain_log(row.xaxis)
            plain_log(row.yaxis)
            if column == 0:
                row.set_ylabel(f"error of {quantity} [%]")
        axes[1, column].set_xlabel(label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(KNOWN))
    save(figure, path, colours=64)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="media")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--beams", action="store_true", help="of media under beams of a width instead")
    parser.add_argument("--distorted", action="store_true", help="of light with smooth relative errors instead")
    parser.add_argument("--chart", type=Path, help="draw the chart there instead")
    given = parser.parse_args()
    if given.chart is not None:
        chart(given.chart)
        return
    if given.beams:
        one = beams(given.count, given.jobs)
        print(f"beams of .25 to 1 mm, given: held {one.held}, answered {one.answered:.1%}")
        print(f"not given: wrong {one.wrong:.1%}, of these warned {one.warned:.1%}, width or misfit {one.noticed:.1%}")
        print(f"pencil beams accused: {one.accused:.1%}")
        return
    if given.distorted:
        for known in ALLOWED:
            shared = distortions(known, given.count, given.jobs)
            held = ", ".join(f"{name} {share:.1%}" for name, share in shared.held.items())
            print(f"{known}, {given.count} media: held {held}, answered {shared.answered:.1%}", end="")
            print(f", pencil beams accused {shared.accused:.1%}" if shared.accused is not None else "", flush=True)
        return
    for opened in (False, True):
        print(f"n and g {'open' if opened else 'given'}, {given.count} media")
        for name, one in coverage(given.count, opened, given.jobs).items():
            print(f"  {name:6} held {one.held:.1%}, answered {one.answered:.1%}, {one.wider:.2f} x the Fisher bound")


if __name__ == "__main__":
    main()
