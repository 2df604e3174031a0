"""Under the sea: each closed form against its truth, and what a picture of them costs and is wrong by.

    python -m benchmarks.sea                               # all tables: twelve minutes on two cores
    python -m benchmarks.sea --only beam haze              # some of them, by their names
    python -m benchmarks.sea --pictures fits/evidence      # the scene beside its truth, and its chart, only

Photons are those of `profilefit.scenes.sea.photons`, Petzold's phase function the three terms of its record; errors of
closed forms are relative, those of pictures root mean squares over the mean of the light. Times are of this machine's
OpenGL, the least of three turns.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import sea_chart as chart
from benchmarks.sea_figure import cost_figure, picture
from benchmarks.table import show
from mcml_sim.files.text_file import as_json, read_toml
from mcml_sim.files.whole_file import write_whole
from mcml_sim.media.phase import HenyeyGreenstein, Mixture
from profilefit.recipes.folder import shipped
from profilefit.scenes.sea import hits
from profilefit.scenes.sea.bench import bench
from profilefit.scenes.sea.caustics import Splat, caustic_map, focus
from profilefit.scenes.sea.haze import KINDS, sunlit_haze
from profilefit.scenes.sea.law import beam_share, failing_depth, segment_integral, water_gaussians
from profilefit.scenes.sea.paths import Sunlight, followed
from profilefit.scenes.sea.photons import trace_beam
from profilefit.scenes.sea.reference import adaptive_filter, caustic_photons, misfit
from profilefit.scenes.sea.request import SeaRequest, lobes_of, read
from profilefit.scenes.sea.shafts import Bundle, ViewRay, by_lines, by_prisms, by_quadrature, by_slices
from profilefit.scenes.sea.truth import caustic_boxes
from profilefit.scenes.sea.waves import Waves, random_sea
from profilefit.scenes.sea.world import World
from profilefit.shader import opened, renderer

FILE = "sea.toml"
OMEGAS, DEPTHS = (0.2, 0.5, 0.8), (0.5, 1.0, 2.0, 4.0)
RADII = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
PHOTONS, SEED = 300_000, 7
PATHS_OF_VIEW, DEEP = 300_000, 60.0
VIEWS = {"horizontal": 0.0, "30 degrees up": -0.5, "30 degrees down": 0.5}  # cosine to the downward vertical
STEEP = (0.5, 0.9, 1.5, 3.0, 5.0, 10.0)
WAYS = ("newton_1m", "newton", "shah", 4, 8, 16)
TILE, DEPTH, PIXELS, VERTICES = 10.0, 5.0, 256, (128, 192, 256)
BEFORE, BEYOND = 0.32, 1.18  # F
SAMPLES, SLICES, FINER, FACTORS = (3, 6, 12, 24, 48), (3, 12, 24), (1, 2, 4), (0.25, 1.0, 4.0)
PATHS, OF_WATER = 4_000_000, 1_000_000  # of a truth
Rows = list[tuple[str | float, ...]]


@cache
def lobes() -> tuple[tuple[float, float], ...]:
    """Three terms fitted to Petzold's mean particle function."""
    return lobes_of("petzold")


def phase(terms: tuple[tuple[float, float], ...]) -> Mixture:
    weights, each = zip(*terms, strict=True)
    return Mixture(tuple(weights), tuple(map(HenyeyGreenstein, each)))


def beam() -> Rows:
    """Largest relative error of `beam_share` within radii to 1 / c and in all the plane; of e^-ct within 0.1 / c."""
    found = []
    for name, terms in (("one term, g 0.924", ((1.0, 0.924),)), ("petzold", lobes())):
        light = trace_beam(phase(terms), DEPTHS, RADII, PHOTONS, SEED)
        for omega in OMEGAS:
            within, plane = (np.asarray(one.at(omega).value) for one in (light.within, light.plane))
            law = beam_share(omega, np.array(DEPTHS)[:, None], np.array(RADII), terms)
            wide = beam_share(omega, np.array(DEPTHS), np.inf, terms)
            straight = np.exp(-np.array(DEPTHS)) / within[:, RADII.index(0.1)] - 1.0
            worst = (float(np.max(np.abs(one))) for one in (law / within - 1.0, wide / plane - 1.0, straight))
            found.append((name, omega, *worst))
    return found


def fails() -> Rows:
    """Where e^-ct is off by a tenth, as b t."""
    radii = np.array([0.03, 0.1, 0.3])
    return [(omega, *failing_depth(omega, radii, lobes()).tolist()) for omega in OMEGAS]


def blur() -> Rows:
    """Largest error of sums of Gaussians for the water's blur, over albedos and depths, by its light."""
    return [
        (count, max(water_gaussians(w, ct, lobes(), count).error for w in OMEGAS for ct in DEPTHS))
        for count in range(1, 9)
    ]


def segment() -> Rows:
    """In float32 against float64 for ways to 4 / c: `segment_integral`, and (1 - e^-x) / x as it is printed."""
    found, one = [], np.float32(1.0)
    for m in (1.0, 0.0, -0.9, -0.999, -0.99999, -1.0):
        s0, t0, t1 = (np.linspace(0.05, most, 40) for most in (1.5, 1.5, 1.0))
        exact = segment_integral(1.0, s0, t0, m, t1)
        s, t, length, cosine = (np.float32(one) for one in (s0, t0, t1, m))
        with np.errstate(invalid="ignore", divide="ignore"):
            x = (one + cosine) * length
            plain = np.exp(-(s + t)) * length * (one - np.exp(-x)) / x
            off = (
                float(np.max(np.abs(way / exact - 1.0))) for way in (segment_integral(one, s, t, cosine, length), plain)
            )
        found.append((m, *off))
    return found


def haze() -> Rows:
    """Radiance toward an eye by each kind, over that of paths, overhead sun, deep calm sea that mirrors nothing."""
    absorbed, scattered = (1.0 - OMEGAS[0], 1.0 - OMEGAS[1], 1.0 - OMEGAS[2]), OMEGAS
    black, dark = (0.0, 0.0, 0.0), Waves(1.0, mean=-DEEP)
    world = World(absorbed, scattered, lobes(), 1.0 + 1e-9, Waves(1.0), dark, black, 0.0, (1.0, 1.0, 1.0), black)
    light, rng = Sunlight(world, 256, 1, 8), np.random.default_rng(SEED)
    found = []
    for name, cosine in VIEWS.items():
        way = np.tile([float(np.sqrt(1.0 - cosine**2)), 0.0, -cosine], (PATHS_OF_VIEW, 1))
        each = [followed(world, light, np.tile([0.5, 0.5, -ct], (PATHS_OF_VIEW, 1)), way, rng) for ct in DEPTHS]
        for channel, omega in enumerate(OMEGAS):
            true = np.array([one[:, channel].mean() for one in each])
            noise = max(one[:, channel].std() / len(one) ** 0.5 / one[:, channel].mean() for one in each)
            for kind in KINDS:
                own = [sunlit_haze(omega, ct, cosine, lobes(), kind) for ct in DEPTHS]
                found.append((f"{name}, {kind}", omega, *(own / true).tolist(), float(noise)))
    return found


def shafts() -> Rows:
    """Root mean square error over twenty view rays of lines, prisms and slices of a bundle, against quadrature."""
    bundle, one = Bundle(0.0, ((0.05, 1, 0.0), (0.03, 2, 1.0), (0.02, 3, 2.0))), HenyeyGreenstein(0.924)
    views = [
        ViewRay(x, z, (float(np.cos(up) * np.cos(side)), float(np.cos(up) * np.sin(side)), float(np.sin(up))), length)
        for x in (0.0, 0.37)
        for z, up, length in ((1.0, 0.35, 2.0), (2.0, -0.35, 3.0), (0.5, 0.79, 2.0), (2.5, -1.05, 2.5), (1.5, 0.0, 3.0))
        for side in (0.0, 0.7)
    ]
    true = np.array([by_quadrature(bundle, at, one) for at in views])
    found = []
    for count in (4, 16, 64, 256):
        each = (np.array([way(bundle, at, one, count) for at in views]) for way in (by_lines, by_prisms, by_slices))
        found.append((count, *(float(np.sqrt(np.mean((got / true - 1.0) ** 2))) for got in each)))
    return found


def exact() -> Rows:
    """The reference of the splats where there is an exact solution: worst pixel, before and beyond the first fold."""
    found: Rows = []
    for amplitude, tilt in ((0.05, 0.0), (0.15, 0.0), (0.1, 0.6)):
        steps = 2.0 * np.pi / TILE * np.array([[2.0, 0.0], [5.0, 0.0]])
        ridges = Waves(TILE, np.array([amplitude, 0.3 * amplitude]), steps, np.array([0.4, 1.9]))
        edges = np.linspace(0.0, TILE, 65)
        true = caustic_boxes(lambda x, ridges=ridges: ridges.height(x, 0.0), edges, DEPTH, tilt, 1.34)
        light = caustic_photons(ridges, DEPTH, tilt, 1.34, 64, 8192)
        found.append((amplitude, tilt, float(np.max(np.abs(light / true - 1.0)))))
    return found


def first_hits() -> Rows:
    """Shares of rays whose hit is off by more than 1 % of the depth, over S = steepest slope times tangent."""
    shares = hits.wrong_shares(WAYS, STEEP)
    names = ("3 Newton steps from 1 m, as published", "from the mean plane", "Shah's iteration", *WAYS[3:])
    return [
        (f"{name} steps + 3" if isinstance(name, int) else name, *row.tolist())
        for name, row in zip(names, shares, strict=True)
    ]


def seas() -> list[tuple[float, Waves]]:
    """F, and a random sea whose most curved crest has it."""
    one = random_sea(0.15, TILE, 1)
    return [(f, one.scaled(f / focus(one, DEPTH))) for f in (BEFORE, BEYOND)]


def filters() -> Rows:
    """Light that the published filter makes of nothing, as it gathers, and as it spreads."""
    lights = [(f, caustic_photons(waves, DEPTH, 0.0, 1.34, PIXELS, 2048)) for f, waves in seas()]
    return [
        (f, *(float(adaptive_filter(light, spreads).mean() / light.mean() - 1.0) for spreads in (False, True)))
        for f, light in lights
    ]


def splats() -> Rows:
    """Caustic maps of 256 x 256 pixels against 2048 x 2048 photons: error, where it is bright and dark, and cost."""
    found = []
    with opened() as context:
        for f, waves in seas():
            true = caustic_photons(waves, DEPTH, 0.0, 1.34, PIXELS, 2048)
            for splat in Splat:
                for vertices in VERTICES:
                    drawn = min(
                        (caustic_map(context, waves, splat, vertices, PIXELS, DEPTH) for _ in range(3)),
                        key=lambda got: got.milliseconds,
                    )
                    off = misfit(drawn.light, true)
                    found.append(
                        (
                            f,
                            splat.value,
                            vertices,
                            drawn.fragments,
                            drawn.milliseconds,
                            *off,
                        )
                    )
    return found


def request() -> SeaRequest:
    """The shipped example."""
    path = shipped("examples") / FILE
    return read(str(path), read_toml(path))


def costs() -> tuple[dict[str, list[chart.ChartPoint]], list[chart.MapPoint], str]:
    """Of the example: each kind over samples, maps of light, and the device."""
    with opened() as context, bench(context, request(), PATHS) as found:
        maps = chart.over_pixels(found, FINER) + chart.over_maps(found, SLICES)
        return chart.over_samples(found, SAMPLES), maps, renderer(context)


def kinds() -> Rows:
    """The example by each kind and number of samples."""
    of_kind, maps, device = costs()
    rows = [(kind, one.samples, one.rmse, min(one.milliseconds)) for kind, points in of_kind.items() for one in points]
    return [*rows, *((one.name, "", one.rmse, one.milliseconds) for one in maps), (device, "", "", "")]


def waters() -> Rows:
    """The example in water that scatters less and more."""
    with opened() as context:
        told = chart.over_water(context, request(), FACTORS, OF_WATER)
    return [
        (factor, omega, *(errors[kind] for kind in KINDS))
        for factor, (omega, errors) in zip(FACTORS, told, strict=True)
    ]


class Listed(NamedTuple):
    """A table: its title, its columns with the form of their numbers, and what makes its rows."""

    title: str
    columns: dict[str, str]
    rows: Callable[[], Rows]


TABLES = {
    "beam": Listed(
        f"Share of a beam, {PHOTONS} photons",
        {"phase": "", "omega": "g", "within": ".2%", "all the plane": ".2%", "e^-ct within 0.1 / c": ".1%"},
        beam,
    ),
    "fails": Listed(
        "b t from where on e^-ct is off by 10 %, within c w",
        {"omega": "g", **dict.fromkeys(("0.03", "0.1", "0.3"), ".3f")},
        fails,
    ),
    "blur": Listed(
        "The water's blur as Gaussians, worst of albedos 0.2 to 0.8, ct to 4", {"Gaussians": "d", "error": ".4f"}, blur
    ),
    "segment": Listed(
        "Segments in float32, m the cosine of view and beam", {"m": "g", "as here": ".1e", "as printed": ".1e"}, segment
    ),
    "haze": Listed(
        "Light toward an eye, law over all orders, at ct",
        {"view": "", "omega": "g", **{f"{one:g}": ".2f" for one in DEPTHS}, "noise": ".1%"},
        haze,
    ),
    "shafts": Listed(
        "Shafts, error over samples", {"samples": "d", "lines": ".3%", "prisms": ".3%", "slices": ".3%"}, shafts
    ),
    "exact": Listed(
        "Photons of a lattice against exact light of ridges, 64 pixels",
        {"amplitude, m": "g", "sun, radians": "g", "worst": ".4%"},
        exact,
    ),
    "hits": Listed("Wrong hits over S", {"way": "", **{f"{one:g}": ".2%" for one in STEEP}}, first_hits),
    "splats": Listed(
        f"Caustic maps of {PIXELS} x {PIXELS} pixels",
        {
            **{"F": "g", "splat": "", "vertices": "d", "fragments": "d", "ms": ".0f", "rms": ".4f"},
            **{"bright": "+.2%", "dark": "+.2%", "energy": "+.1e"},
        },
        splats,
    ),
    "filter": Listed("Energy by the published filter", {"F": "g", "gathers": "+.2%", "spreads": "+.1e"}, filters),
    "scene": Listed(f"examples/{FILE}", {"kind, or maps": "", "samples": "", "error": ".3f", "ms": ".0f"}, kinds),
    "water": Listed(
        f"examples/{FILE} where the water scatters so many times as much",
        {"b": "g", "omega": ".2f", **dict.fromkeys(KINDS, ".3f")},
        waters,
    ),
}


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=TABLES, metavar="TABLE", help=f"some of {', '.join(TABLES)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same in numbers, too")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="figures of the scene, only")
    given = parser.parse_args(arguments)
    if given.pictures is not None:
        with opened() as context, bench(context, request(), PATHS) as found:
            picture(found, given.pictures / "render-sea.png")
            cost_figure(chart.over_samples(found, SAMPLES), renderer(context), given.pictures / "render-sea-cost.png")
        return
    told = {}
    for name in given.only or TABLES:
        title, columns, make = TABLES[name]
        rows = make()
        told[name] = [dict(zip(columns, row, strict=True)) for row in rows]
        cells = [
            [
                f"{one:{form}}" if not isinstance(one, str) else one
                for one, form in zip(row, columns.values(), strict=True)
            ]
            for row in rows
        ]
        show(title, tuple(columns), cells)
    if given.json is not None:
        write_whole(given.json, as_json(told))


if __name__ == "__main__":
    main()
