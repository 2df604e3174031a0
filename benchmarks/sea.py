"""Sea: each closed form against its truth, and what a picture of it costs and its error.

    python -m benchmarks.sea                               # all tables: twelve minutes on two cores
    python -m benchmarks.sea --only beam haze              # some of them, by their names
    python -m benchmarks.sea --pictures fits/evidence      # the scene beside its truth, and its chart, only

Photons are those of `benchmarks.sea_photons`, Petzold's phase function the three terms of its record; errors of
closed forms are relative, those of pictures root mean squares over the mean of the light. Times are of this machine's
OpenGL, of three turns and more the least or the 16th percentile.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.sea_boxes import caustic_boxes
from benchmarks.sea_figure import cost_figure
from benchmarks.sea_filter import adaptive_filter
from benchmarks.sea_photons import trace_beam
from benchmarks.table import Listed, Rows, parser_of, show_all
from mcml_sim.media.phase import HenyeyGreenstein, Mixture
from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import KINDS, sunlit_haze
from profilefit.scenes.sea.law import beam_share, failing_depth, segment_integral, water_gaussians
from profilefit.scenes.sea.passes import SeaPasses
from profilefit.scenes.sea.paths import Sunlight, followed
from profilefit.scenes.sea.scene import SeaRender, lobes_of, reference_render
from profilefit.scenes.sea.truth import caustic_photons
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import Waves, wrong_shares
from profilefit.scenes.stage.renderer import Renderer
from profilefit.shader import opened, renderer
from profilefit.studies.tradeoff import scenes as tradeoff

FILE = "sea.toml"
OMEGAS, DEPTHS = (0.2, 0.5, 0.8), (0.5, 1.0, 2.0, 4.0)
RADII = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
PHOTONS, SEED = 300_000, 7
PATHS_OF_VIEW, DEEP = 300_000, 60.0
VIEWS = {"horizontal": 0.0, "30 degrees up": -0.5, "30 degrees down": 0.5}  # cosine to the downward vertical
STEEP = (0.5, 0.9, 1.5, 3.0, 5.0, 10.0)
WAYS = ("newton_1m", "newton", "shah", 4, 8, 16)
TILE, DEPTH, PIXELS = tradeoff.TILE, tradeoff.DEPTH, tradeoff.PIXELS
SLICES, FINER, FACTORS, TURNS = (3, 12, 24), (1, 2, 4), (0.25, 1.0, 4.0), 3
PATHS, OF_WATER = 4_000_000, 1_000_000  # of a truth


@cache
def lobes() -> tuple[tuple[float, float], ...]:
    """Fit three terms to Petzold's mean particle function."""
    return lobes_of("petzold")


def phase(terms: tuple[tuple[float, float], ...]) -> Mixture:
    weights, each = zip(*terms, strict=True)
    return Mixture(tuple(weights), tuple(map(HenyeyGreenstein, each)))


def beam() -> Rows:
    """Return the largest relative error of `beam_share` to 1 / c and in all the plane; of e^-ct within 0.1 / c."""
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
    """Return where e^-ct is wrong by a tenth, as b t."""
    radii = np.array([0.03, 0.1, 0.3])
    return [(omega, *failing_depth(omega, radii, lobes()).tolist()) for omega in OMEGAS]


def blur() -> Rows:
    """Return the largest error of sums of Gaussians for the water's blur, over albedos and depths, by its light."""
    return [
        (count, max(water_gaussians(w, ct, lobes(), count).error for w in OMEGAS for ct in DEPTHS))
        for count in range(1, 9)
    ]


def segment() -> Rows:
    """Return errors of float32 for ways to 4 / c: `segment_integral`, and (1 - e^-x) / x as it is printed."""
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
    """Return radiance toward an eye by each kind, over that of paths, overhead sun, deep calm sea, no mirror."""
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
    """Return root mean square errors over twenty view rays of lines, prisms and slices, against quadrature."""
    found = {(one.method, int(one.label)): one.error.value for one in tradeoff.shafts().points}
    return [(n, *(found[way, n] for way in tradeoff.SHAFTS)) for n in tradeoff.SEA.of_shafts]


def exact() -> Rows:
    """Return errors of the splats' reference where there is an exact solution: worst pixel, before and after folds."""
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
    """Return shares of rays whose hit misses by over 1 % of the depth, over S = steepest slope times tangent."""
    shares = wrong_shares(WAYS, STEEP)
    names = ("3 Newton steps from 1 m, as published", "from the mean plane", "Shah's iteration", *WAYS[3:])
    return [
        (f"{name} steps + 3" if isinstance(name, int) else name, *row.tolist())
        for name, row in zip(names, shares, strict=True)
    ]


def filters() -> Rows:
    """Return light that the published filter makes of nothing, as it gathers, and as it spreads."""
    lights = [(f, caustic_photons(waves, DEPTH, 0.0, 1.34, PIXELS, 2048)) for f, waves in tradeoff.seas().values()]
    return [
        (f, *(float(adaptive_filter(light, spreads).mean() / light.mean() - 1.0) for spreads in (False, True)))
        for f, light in lights
    ]


def splats() -> Rows:
    """Compare caustic maps of 256 x 256 pixels with 2048 x 2048 photons: error, where bright and dark, and cost."""
    with opened() as context:
        panels = tradeoff.maps(context)
    facts = ("rms", "bright", "dark", "energy")
    return [
        (f, one.method, one.facts["vertices"], one.facts["fragments"], one.cost.low, *(one.facts[key] for key in facts))
        for panel, (f, _) in zip(panels, tradeoff.seas().values(), strict=True)
        for one in panel.points
    ]


def over_maps(drawn: SeaRender) -> Rows:
    """Return errors of the request's picture by each splat and by numbers of maps in depths, and milliseconds."""
    of, named, splats = drawn.request, drawn.request.technique, (Splat.POINTS, Splat.FACES, Splat.CELLS)
    cases = [(f"{one.value}, {named.slices} slices", one, named.slices) for one in splats]
    cases += [(f"{of.splat.value}, {one} slices", of.splat, one) for one in SLICES]
    rows: Rows = []
    for name, by, count in cases:
        with Renderer(drawn.passes.renderer.context, of.size) as maps:
            own = drawn._replace(passes=SeaPasses(maps, of.world, by, named.vertices, named.texels, count))
            own.maps()  # compiled
            least = min(sum(own.maps().values()) for _ in range(TURNS))
            rows.append((name, "", own.judge.rmse(own.picture(named.kind, of.sampling.samples)), least))
    return rows


def over_pixels(drawn: SeaRender) -> Rows:
    """Return errors of the request's kind by views of a pixel along a side, and milliseconds of the view."""
    rows: Rows = []
    for fine in FINER:
        own = drawn._replace(request=drawn.request.changed(technique={"supersampling": fine}))
        (one,) = own.points(own.request.technique.kind, [own.request.sampling.samples], TURNS)
        rows.append((f"{fine} x {fine} views of a pixel", "", one.rmse, min(one.milliseconds)))
    return rows


def kinds() -> Rows:
    """Judge the example by each kind and number of samples, then by other maps of light; and name the device."""
    with opened() as context, reference_render(context, tradeoff.example("sea"), PATHS) as found:
        points = tradeoff.view(found).points
        rows: Rows = [(one.method, one.label, one.error.value, one.cost.low) for one in points]
        return [*rows, *over_pixels(found), *over_maps(found), (renderer(context), "", "", "")]


def waters() -> Rows:
    """Judge the example in water that scatters less and more."""
    of, rows = tradeoff.example("sea"), []
    with opened() as context:
        for factor in FACTORS:
            red, green, blue = (factor * one for one in of.water.coefficients.b)
            water = {"a": of.water.coefficients.a, "b": (red, green, blue)}
            with reference_render(context, of.changed(water=water), OF_WATER) as drawn:
                errors = (drawn.judge.rmse(drawn.picture(kind, of.sampling.samples)) for kind in KINDS)
                rows.append((factor, float(max(drawn.request.world.omega)), *errors))
    return rows


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
    parser = parser_of(__doc__, TABLES)
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="figures of the scene, only")
    given = parser.parse_args(arguments)
    if given.pictures is not None:
        with opened() as context, reference_render(context, tradeoff.example("sea"), PATHS) as found:
            cost_figure(tradeoff.view(found), renderer(context), given.pictures / "render-sea-cost.png")
        return
    show_all({name: TABLES[name] for name in given.only or TABLES}, given.json)


if __name__ == "__main__":
    main()
