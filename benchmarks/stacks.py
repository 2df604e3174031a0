"""Errors of the law of a stack: twelve stacks at thicknesses that were not fitted, and random ones at their own.

    python -m benchmarks.stacks               # twenty minutes on two cores
    python -m benchmarks.stacks --random 20   # ten minutes: 2 to 4 layers, seeded
    python -m benchmarks.stacks --forward 0.9 --light searchlight   # an hour: g in every layer, against photons
    python -m benchmarks.stacks --gaussians   # two minutes: sums of 1 to 8, each fitted at the stack's own thickness

Held against `exact.solve`. rel is the mean relative error of R_d over radii even in ln r, from a hundredth of a mean
free path to 99.5 % of the light; ks the largest error of the cdf. Beside it stands the half space of the first layer.

Where layers scatter forward (mu_s = mu_s' / (1 - g)) the truth is 3e7 photons at the stack's own thickness; rel is of
rings from a tenth of a mean free path (reduced) of the first layer, its noise printed beside it and taken off in
quadrature. "similar" is the exact light of the similar isotropic stack.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.table import show
from mcml_sim import Layer, Medium, Setting, exact
from profilefit.laws.gaussians import MOST
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes.kinds.stack import NEAR_TRACED, of_rings
from profilefit.recipes.stack import gaussians
from profilefit.recipes.stack.fit import ring_edges, stack_law, traced

LIGHTS = ("searchlight", "diffuse")
THICKNESSES = (0.03, 0.1, 0.3, 0.7, 1.5, 3.0, 8.0)  # of the first layer [mm]
RADII, LAST = 120, 0.995
TRACED, TRACED_SEED = 30_000_000, 77
Triple = tuple[float, float, float]
# n, and of each layer mu_s', mu_a of red, green and blue [1/mm] and the thickness [mm]. Skin: C. Donner and
# H. W. Jensen, SIGGRAPH 2005; heart muscle: within the ranges of Am. J. Physiol. 277, H698, 1999; its epicardium, and
# the thicknesses, assumed. The others as in `profilefit.materials`.
STACKS: dict[str, tuple[float, tuple[tuple[Triple, Triple, float], ...]]] = {
    "skin": (
        1.4,
        (
            ((4.8, 6.0, 6.5), (0.21, 0.21, 0.50), 0.25),
            ((3.2, 4.0, 4.6), (0.016, 0.019, 0.030), 0.20),
            ((0.45, 0.47, 0.48), (0.0085, 0.10, 2.5), np.inf),
        ),
    ),
    "heart": (
        1.38,
        (((1.8, 2.2, 2.6), (0.05, 0.20, 0.35), 0.3), ((1.13, 1.2, 1.3), (0.20, 0.80, 1.2), np.inf)),
    ),
}
OVER = {"milk on marble": (1.3, "skimmilk", 1.0, "marble"), "marble on potato": (1.5, "marble", 0.5, "potato")}


class Error(NamedTuple):
    """Errors rel, and of the half space of the first layer alone; ks; relative error of A; [-]."""

    rel: float
    alone: float
    ks: float
    of_a: float


def stacks(channel: int) -> dict[str, Medium]:
    """Return the four stacks in one colour."""
    made = {
        name: Medium(tuple(Layer(n, mu_a[channel], mu_s[channel], 0.0, d) for mu_s, mu_a, d in layers))
        for name, (n, layers) in STACKS.items()
    }
    for name, (n, top, d, bottom) in OVER.items():
        pair = [(BY_NAME[one].absorption[channel], BY_NAME[one].scattering[channel]) for one in (top, bottom)]
        made[name] = Medium((Layer(n, *pair[0], 0.0, d), Layer(n, *pair[1], 0.0)))
    return made


def random_stack(number: int) -> Medium:
    """Draw 2 to 4 layers, n 1 to 1.5, alpha .3 to .999 even in ln(1 - alpha), .1 to 3 mean free paths thick."""
    random = np.random.default_rng(100 + number)
    count, n, layers = int(random.integers(2, 5)), float(random.uniform(1.0, 1.5)), []
    for place in range(count):
        dark = 10 ** random.uniform(-3.0, np.log10(0.7))
        mu, depth = 10 ** random.uniform(-0.3, 0.7), 10 ** random.uniform(-1.0, np.log10(3.0))
        layers.append(Layer(n, mu * dark, mu * (1 - dark), 0.0, depth / mu if place < count - 1 else np.inf))
    return Medium(tuple(layers))


def error(law, medium: Medium, light: str) -> Error:
    """Return the errors of a law, under the first layer of this medium."""
    true, first = exact.solve(medium, light), medium.layers[0]
    setting = Setting(light, n=first.n / medium.n_above)
    r = np.geomspace(0.01 * first.mfp, 300.0 * max(layer.mfp for layer in medium.layers), RADII)
    share = np.asarray(true.cdf(r))
    near = r[share <= LAST]
    profile = np.asarray(true.profile(near))
    alone = exact.profile(near, first.alpha, first.mfp, setting)
    return Error(
        float(np.mean(np.abs(law.profile(near, first.thickness) / profile - 1))),
        float(np.mean(np.abs(alone / profile - 1))),
        float(np.max(np.abs(law.cdf(r, first.thickness) - share))),
        float(law.total(first.thickness) / true.reflectance - 1),
    )


def forward(medium: Medium, g: float) -> Medium:
    """Return the medium of equal reduced scattering that scatters forward."""
    return replace(medium, layers=tuple(replace(layer, mu_s=layer.mu_s / (1.0 - g), g=g) for layer in medium.layers))


def traced_row(name: str, light: str, medium: Medium, g: float, count: int) -> tuple[tuple[str, ...], Error]:
    """Judge a law with g, at its own thickness, against so many photons; `alone` is the similar stack's rel."""
    begin = time.perf_counter()
    law, own = stack_law(forward(medium, g), light), forward(medium, g)
    seconds = time.perf_counter() - begin
    rings = traced(own, light, ring_edges(own.layers[0], own.layers), count, TRACED_SEED)
    rel, noise, ks, off = of_rings(law, medium.layers[0].thickness, rings)
    counts, exactly = (rings.weight > 0) & (rings.edges[:-1] > NEAR_TRACED * law.top.mfp), exact.solve(medium, light)
    apart = np.diff(np.asarray(exactly.cdf(rings.edges)) * exactly.reflectance)[counts] / rings.energy[counts] - 1
    similar = float(np.mean(np.abs(apart)))
    figures = (rel, noise, similar, ks, abs(off))
    cells = (f"{name}, {light}", f"{seconds:.0f}", *_short(*figures))
    print(*cells, flush=True)
    return cells, Error(rel, similar, ks, off)


def sums_row(name: str, light: str, medium: Medium) -> tuple[tuple[str, ...], list[float]]:
    """Return rel of sums of 1 to 8 Gaussians, of rings even in ln r."""
    of = gaussians.sum_light(medium, light)
    found = [np.asarray(gaussians.fitted([of], count).residuals) / of.weight for count in range(1, MOST + 1)]
    rel = [float(np.mean(np.abs(one))) for one in found]
    return (f"{name}, {light}", *_short(*rel)), rel


def row(
    name: str, light: str, medium: Medium, thicknesses: tuple[float, ...]
) -> tuple[tuple[str, ...], list[Error], Error]:
    """Return cells, errors at some thicknesses, and the error at its own."""
    begin = time.perf_counter()
    law = stack_law(medium, light)
    seconds = time.perf_counter() - begin
    found = [error(law, medium.with_first(d), light) for d in thicknesses]
    own = error(law, medium, light)
    return (f"{name}, {light}", f"{seconds:.0f}", *_figures(found), *_short(own.rel, own.ks)), found, own


def _figures(found: list[Error]) -> tuple[str, ...]:
    return _short(*_summary(found).values())


def _summary(found: list[Error]) -> dict[str, float]:
    rel, alone, ks, of_a = (np.abs(column) for column in zip(*found, strict=True))
    figures = (rel.mean(), rel.max(), alone.mean(), ks.max(), of_a.max())
    return dict(zip(("rel", "worst", "alone", "ks", "A"), map(float, figures), strict=True))


def _short(*values: float) -> tuple[str, ...]:
    return tuple(f"{value:.2g}" for value in values)


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--random", type=int, default=0, metavar="N", help="so many random stacks in place of the four")
    parser.add_argument("--forward", type=float, default=0.0, metavar="G", help="g of every layer, in (0, 0.95]")
    parser.add_argument("--gaussians", action="store_true", help="sums of Gaussians in place of the law")
    parser.add_argument("--stack", choices=tuple(stacks(0)), help="one of the four; all by default")
    parser.add_argument("--light", choices=LIGHTS, help="one of the two lights; both by default")
    parser.add_argument(
        "--photons", type=int, default=TRACED, metavar="N", help="of a stack and colour, with --forward"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures of all there too")
    given = parser.parse_args(arguments)
    lights = (given.light,) if given.light else LIGHTS
    every = [
        (f"{name}, {CHANNELS[channel]}", light, medium)
        for light in lights
        for channel in range(3)
        for name, medium in stacks(channel).items()
        if given.stack in (None, name)
    ]
    if given.gaussians:
        cells, by_stack = zip(*(sums_row(*one) for one in every), strict=True)
        counts = [str(count) for count in range(1, MOST + 1)]
        figures_of = {"mean": np.mean(by_stack, axis=0), "worst": np.max(by_stack, axis=0)}
        ends = [(what, *_short(*values)) for what, values in figures_of.items()]
        show("rel of sums of so many Gaussians", ("stack", *counts), [*cells, *ends])
        _write(given.json, {what: dict(zip(counts, one.tolist(), strict=True)) for what, one in figures_of.items()})
        return
    if given.forward:
        made = [traced_row(*one, given.forward, given.photons) for one in every]
        rows, errors = zip(*made, strict=True)
        figures = _summary(list(errors))
        own = f"{figures['rel']:.2g}, at most {figures['worst']:.2g}"
        whole = ("all", "", own, "", *_short(figures["alone"], figures["ks"], figures["A"]))
        columns = ("stack", "s", "rel", "noise", "similar", "ks", "A")
        show(f"The law of a stack, g = {given.forward:g}, against {given.photons:.1g} photons", columns, [*rows, whole])
        _write(given.json, figures)
        return
    count = given.random
    if count:
        media = [(f"{number}", random_stack(number)) for number in range(count)]
        jobs = [(name, LIGHTS[int(name) % 2], medium, (medium.layers[0].thickness,)) for name, medium in media]
    else:
        jobs = [(*one, THICKNESSES) for one in every]
    rows, errors, own_errors = zip(*(row(*job) for job in jobs), strict=True)
    figures, at_own = _summary([one for some in errors for one in some]), _summary(list(own_errors))
    own = (f"{at_own['rel']:.2g}, at most {at_own['worst']:.2g}", f"{at_own['ks']:.2g}")
    whole = ("all", "", *_short(*figures.values()), *own)
    columns = ("stack", "s", "rel", "worst", "first layer alone", "ks", "A", "own rel", "own ks")
    show("The law of a stack, at thicknesses of its first layer", columns, [*rows, whole])
    _write(given.json, {**figures, "own": at_own})


def _write(file: Path | None, figures: dict) -> None:
    if file is not None:
        file.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
