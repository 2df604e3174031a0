"""Figures that README and guides promise, beside what is measured: `make claims` writes fits/evidence/claims.json.

    python -m benchmarks.claims [--only NAME ...] [--quick] [--out FOLDER]

Two hours on two idle cores; with --quick less, and noisier. A promise is a row below, read from the numbers of
a command that prints it. Prose that states its bound links to the table by its name, [1.5](claims.md#hazard-time),
and a test compares them. Exit status 1 if what was measured breaks a bound.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from mcml_sim.cli.screen import show
from mcml_sim.files.whole_file import as_json, write_whole
from profilefit.recipes.evidence import measurement_origin, require_apart, stale
from profilefit.report.tables.claims_table import EXACT, FILE, Claim, claim_tables, read_claims

ROOT = Path(__file__).resolve().parents[1]
FITS = ROOT / "fits"
ANSWERS = (0, 1)  # exit statuses of a command that has numbers
WIDTH = 160  # of the tables


class Run(NamedTuple):
    """Command whose numbers hold figures; what they are held against; what their spread is; what --quick adds to it.

    subject   title and caption of the table that its claims belong to
    promises  name, bound, place of the figure in the numbers or a function of them, what it is of, and its noise where
              that is not the run's: a figure is a value, or value, low and high
    fitted    whether it reads fits/: what does not stays as it was measured when a record is made again
    """

    subject: str
    command: str
    quick: str
    truth: str
    noise: str
    promises: tuple[tuple[Any, ...], ...]
    fitted: bool = True


def at(numbers: Any, place: str) -> Any:
    """Return what lies at a dotted place."""
    return reduce(lambda inside, key: inside[key], place.split("."), numbers)


def of_phase(form: str) -> Callable[[Any], float]:
    """Return the error of a form with its moments held, against the data."""
    return lambda numbers: numbers["phases"]["petzold"]["phases"][form]["held"]["rms"]


def splat_of(f: float, fragments: int, key: str) -> Callable[[Any], float]:
    """Return a figure's size, of the map with the least rms of all that draw no more fragments."""

    def found(numbers: Any) -> float:
        fits = [one for one in numbers["splats"] if one["F"] == f and one["fragments"] <= fragments]
        return abs(min(fits, key=lambda one: one["rms"])[key])

    return found


def factor_of(numbers: Any, truth: str) -> Any:
    """Return the row of all numbers of layers."""
    return next(one for one in numbers["third"] if one["error, truth"] == truth and one["N"] == "all")


def least_of(way: str) -> Callable[[Any], float]:
    """Return the least layers at 45 degrees."""
    return lambda numbers: next(one["45"] for one in numbers["least"] if one["way"] == way)


def worst(place: str, scale: float = 1.0):
    """Return the largest of the list there, over a unit."""
    return lambda numbers: max(at(numbers, place)) / scale


def by_index(what: str, scale: float = 1.0):
    """Return the largest of all records, indices and albedos that have such a figure, over a unit."""

    def read(numbers: Any) -> float:
        found = [one["quality"]["by_index"] for one in numbers["records"].values()]
        return max(max(one[what]) for one in found if what in one) / scale

    return read


def times(place: str, over: str):
    """Return one figure over another."""
    return lambda numbers: at(numbers, place) / at(numbers, over)


def ratio(place: str):
    """Return a ratio of tracer.py with its spread."""
    return lambda numbers: [numbers[place][end] for end in ("median", "least", "most")]


def less_work(method: str):
    """Return how many times less time x error² the longest order-resolved run takes, of all of a time."""

    def read(numbers: Any) -> list[float]:
        points = {point["method"]: point for point in at(numbers, "truth.panels.rings.points")}
        ends = [("value", "value"), ("low", "high"), ("high", "low")]
        return [_work(points[method], end) / _work(points["simulate_orders"], other) for end, other in ends]

    return read


def _work(point: dict[str, Any], end: str) -> float:
    return point["cost"][end] * point["error"][end] ** 2


def exact_error(numbers: Any) -> float:
    """Return the worst of the standard quadratures."""
    points = at(numbers, "truth.panels.rings.points")
    return next(point["worst"]["value"] for point in points if point["label"] == "standard nodes")


def rounding(numbers: Any) -> float:
    """Return the largest error that float32 adds over the law's own; the limit is a tenth of that [%]."""
    bounds = [bound for kind in ("laws", "maps") for one in numbers[kind] for bound in one["bounds"]]
    return max(10 * bound["value"] / bound["limit"] for bound in bounds if bound["name"].startswith("float32 "))


def edge(*measures: str, scale: float = 1.0):
    """Return the largest of the law hazard's, over lights and albedos."""
    return lambda numbers: max(
        value / scale for light in numbers["laws"].values() for one in measures for value in light["hazard"][one]
    )


def edge_nearer(numbers: Any) -> float:
    """Return the least bias of normalized diffusion over that of hazard, over lights and albedos."""
    pairs = [zip(light["normalized diffusion"]["bias"], light["hazard"]["bias"], strict=True)
             for light in numbers["laws"].values()]  # fmt: skip
    return min(diffusion / hazard for both in pairs for diffusion, hazard in both)


def flip(numbers: Any, law: str = "hazard") -> tuple[float, float, float]:
    """Return FLIP with the most samples: mean, least and most of the seeds."""
    seeds = numbers["laws"][law]["flip"][-1]
    return sum(seeds) / len(seeds), min(seeds), max(seeds)


def flip_nearer(numbers: Any) -> tuple[float, float, float]:
    """Return FLIP of normalized diffusion, refitted, over that of hazard."""
    (own, least, most), (other, low, high) = flip(numbers), flip(numbers, "burley refitted")
    return other / own, low / most, high / least


def recovered(numbers: Any) -> float:
    """Return the farthest constant of a file of a simulation, in errors that the fit states."""
    known = [one for one in numbers["quantities"].values() if one["of_file"] is not None]
    return max(
        abs(one["value"] - one["of_file"]) / math.hypot(one["statistical_error"], one["law_error"]) for one in known
    )


def apart(only_chosen: bool):
    """Return predicted and rendered error, larger over smaller, at worst."""

    def read(numbers: Any) -> float:
        pairs = [pair for one in numbers for option, pair in one["options"].items()
                 if option == one["chosen"] or not only_chosen]  # fmt: skip
        return max(max(p["predicted"] / p["measured"], p["measured"] / p["predicted"]) for p in pairs)

    return read


def uncovered(numbers: Any) -> int:
    """Return the shares of stated intervals outside their binomial band."""
    rows = [row for row in numbers if row["errors"] == "sandwich"]
    pairs = [pair for row in rows for pair in zip(row["shares"].values(), row["band"], strict=True)]
    return sum(not low <= share <= high for shares, (low, high) in pairs for share in shares)


def pictured(read):
    """Return what `read` makes of the errors by way, of the head of layers by 64 samples, in each pose."""

    def figure(rows: Any) -> float:
        poses: dict[str, dict[str, float]] = {}
        for one in rows:
            if one["samples"] == "64":
                poses.setdefault(one["pose"], {})[one["way"]] = float(one["error"])
        return read(poses)

    return figure


# Subjects of claims, and the caption of their table.
MODELS = "Profile models: Largest errors of R_d (mean over radii) and A, and times over normalized diffusion"
DATA = "Fits and uncertainties: Deviation from simulated constants, and intervals that cover too seldom or too often"
TRACING = "Photon tracing: Ratios to a scalar tracer, of two workers to one, and memory"
EXACT_SOLUTIONS = "Exact solutions: Largest relative differences, p-values and times"
RENDERING = "Rendering: Errors of images, and of irradiance beside an edge"
LAYERS = "Layers: Errors of the stack model relative to exact or traced R_d (mean over radii) and A, and shader times"
SEA = "Sea: Errors of phase functions, closed forms and caustic maps"
FUR = "Fur: Errors of shells and swept slabs, and numbers of layers"
# fmt: off
TURNS = "least and most of the turns"
RECORDS = Run(
    MODELS, "profilefit report hazard albedo-rational albedo-liang", "",
    "exact solution, n = 1, pencil beam, 24 albedos from 0.05 to 0.995, none of them fitted", EXACT, (
        ("hazard-error", "≤ 0.25 %", worst("records.hazard.quality.regenerated.rel", 0.01),
         "error of R_d, hazard, n = 1"),
        ("map-error", "≤ 5e-06", "records.albedo-rational.quality.regenerated.delta_A",
         "error of A, rational inversion, n = 1"),
        ("map-nearer", "≥ 10000", times("records.albedo-liang.quality.published.delta_A",
                                        "records.albedo-rational.quality.regenerated.delta_A"),
         "error of A, equation (8) over rational inversion"),
    ))
SCALAR = "compiled scalar tracers in the manner of MCML on one core with AVX-512, or one pinned worker"
RUNS = (
    RECORDS,
    Run(MODELS, "profilefit report hazard-refracting hazard-diffuse-refracting albedo-rational-refracting "
        "albedo-rational-diffuse-refracting", "",
        "exact solution, 10 indices from 1.001 to 1.6, 24 albedos, both illuminations", EXACT, (
        ("refracting-error", "≤ 0.6 %", by_index("rel", 0.01),
         "error of R_d, hazard, n > 1"),
        ("refracting-map-error", "≤ 4e-05", by_index("delta_A"),
         "error of A, rational inversion, n > 1"),
    )),
    Run(MODELS, "profilefit report hazard-forward hazard-diffuse-forward albedo-rational-forward "
        "albedo-rational-diffuse-forward", "",
        "exact solution, 3 indices from 1.37 to 1.45, 6 g from 0.05 to 0.95, 24 albedos, both illuminations", EXACT, (
        ("forward-error", "≤ 2.5 %", by_index("rel", 0.01),
         "error of R_d, hazard, g > 0"),
        ("forward-map-error", "≤ 0.003", by_index("delta_A"),
         "error of A, rational inversion, g > 0"),
    )),
    Run(MODELS, "python -m benchmarks.laws", "",
        "exact solution, n = 1, pencil beam, and times over normalized diffusion with its exact inverse on one core",
        TURNS, (
        ("hazard-nearer", "≥ 50", times("normalized diffusion.rel.worst", "hazard.rel.worst"),
         "error of R_d, normalized diffusion over hazard"),
        ("quantile-nearer", "≥ 20", times("normalized diffusion.rel.worst", "quantile.rel.worst"),
         "error of R_d, normalized diffusion over quantile"),
        ("hazard-time", "≤ 1.5", "hazard.time_ratio.both",
         "CPU time of a radius and R_d, hazard, n = 1"),
        ("quantile-time", "≤ 0.6", "quantile.time_ratio.both",
         "CPU time of a radius and R_d, quantile"),
        ("hazard-profile-time", "≤ 3", "hazard.time_ratio.profile",
         "CPU time of R_d alone, hazard, n = 1"),
    )),
    Run(MODELS, "profilefit check", "", "float64, the exact solution, and times over normalized diffusion", EXACT, (
        ("shader-time", "≤ 3", "costs.hazard.ratio.both",
         "shader time of a radius and R_d, hazard, n = 1",
         "median of 7 turns"),
        ("shader-rounding", "≤ 10 %", rounding, "float32 error, relative to the model error"),
        ("shader-faults", "≤ 0", lambda n: sum(len(one["broken"]) for kind in ("laws", "maps") for one in n[kind]),
         "bounds that refitted shader sources break"),
    )),
    Run(DATA, "profilefit fit examples/half_space.mco", "", "alpha, l, mu_a and mu_s' of the simulated medium", EXACT, (
        ("own-data", "≤ 2", recovered, "deviation of a fitted constant [stated errors]",
         "statistical and model error as stated"),
    )),
    Run(DATA, "python -m benchmarks.interval_coverage albedo-rational burley-whole quantile", "--replicates 400",
        "constants of the model or the exact solution in simulated repeats", EXACT, (
        ("coverage", "≤ 0", uncovered, "68 % and 95 % intervals of wrong coverage",
         "binomial 99 % band, Šidák over constants and levels"),
    )),
    Run(TRACING, "python benchmarks/tracer.py", "--quick", SCALAR, TURNS, (
        ("orders-speed", "≥ 20", ratio("simulate_orders, live events/s, over the yardstick"),
         "live events per second, simulate_orders with bins"),
        ("half-space-speed", "≥ 30", ratio("half space, photons/s"),
         "photons per second, alpha = 0.9, R only"),
        ("half-space-tally-speed", "≥ 15", ratio("half space, r-z, photons/s"),
         "photons per second, alpha = 0.9, r-z tally at every event"),
        ("layers-speed", "≥ 6", ratio("three layers, r and angle, photons/s, over the layered twin"),
         "photons per second, MCML's three layers, by radius and angle"),
        ("layers-tally-speed", "≥ 5", ratio("three layers, r-z tally too, over the layered twin"),
         "photons per second, MCML's three layers, r-z tally"),
        ("half-space-efficiency", "≥ 20", "efficiency.half space, Rd",
         "1 / (variance × time), semi-infinite medium, R", "variances of 400 blocks, 7 %"),
        ("layers-efficiency", "≥ 6", lambda n: min(v for key, v in n["efficiency"].items() if key.startswith("three")),
         "1 / (variance × time), three layers, least of R, T, A", "variances of 400 blocks, 7 %"),
        ("accuracy-time", "≥ 800", "time to accuracy, 32 albedos.median",
         "one simulate_orders run over 32 scalar runs, speed to 1 % in 100 bins", "extrapolated"),
        ("threads", "≥ 1.6", ratio("two threads over one pinned worker, orders"), "speed, two threads over one"),
        ("processes", "≥ 1.9", ratio("two processes over one pinned worker, orders"),
         "speed, two processes over one"),
        ("memory", "≤ 1", lambda n: max(n["peak_memory_gib"].values()), "memory per process [GiB]", "one run each"),
    ), fitted=False),
    Run(EXACT_SOLUTIONS, "profilefit tradeoff truth", "--quick", "exact solution with twice the nodes",
        "ends of the spreads of time and error", (
        ("exact-error", "≤ 1e-09", exact_error, "error of exact, 28 radial bins, 5 albedos"),
        ("orders-over-simulate", "≥ 10", less_work("simulate"), "time at equal error, simulate over simulate_orders"),
        ("orders-over-scalar", "≥ 300", less_work("scalar tracer"),
         "time at equal error, scalar tracer over simulate_orders"),
    ), fitted=False),
    Run(EXACT_SOLUTIONS, "python -m benchmarks.refracting", "--quick",
        "1e8 photons in 40 radial bins, more nodes and closed forms, n = 1.3 to 1.5, both illuminations", TURNS, (
        ("exact-totals", "≤ 1e-07", "totals",
         "A, difference from a stack's integral equation", EXACT),
        ("exact-nodes", "≤ 1e-10", "doubled nodes",
         "A and transform up to 7 / mfp, change with 2 × the nodes", EXACT),
        ("exact-profile", "≤ 1e-05", "profile",
         "R_d, change with 1.5 × the nodes", EXACT),
        ("exact-matched", "≤ 1e-06", "matched",
         "R_d, difference between n = 1 + 1e-12 and n = 1", EXACT),
        ("exact-derivatives", "≤ 1e-06", "derivatives",
         "derivatives by alpha, r, mfp, n, error by differences", EXACT),
        ("exact-cut", "≤ 1e-06", "cut",
         "R_d, difference of one medium cut into three layers", EXACT),
        ("exact-photons", "≥ 0.001", "half space, photons",
         "p-value of photons, semi-infinite medium, n = 1.4, three albedos", EXACT),
        ("stack-photons", "≥ 0.001", "stack, photons",
         "p-value of photons, three layers, n = 1.4", EXACT),
        ("exact-time", "≤ 5", "new index, seconds", "time of 256 radii, 32 albedos, new index, compiled [s]"),
        ("stack-time", "≤ 5", "stack, seconds", "time of three layers, n = 1.4, 256 radii [s]"),
    ), fitted=False),
    Run(RENDERING, "python -m benchmarks.step_edge", "--quick",
        "exact step response within 4 transport mean free paths, and radii by the exact quantile", EXACT, (
        ("edge-bias", "≤ 0.02 %", edge("bias", scale=0.01),
         "bias at an edge of illumination, hazard, share of A"),
        ("edge-nearer", "≥ 10", edge_nearer, "bias at the edge, normalized diffusion over hazard"),
        ("edge-noise", "≤ 1.01", edge("random", "lattice"), "noise of 64 samples, hazard over exact quantile",
         "trials at equal points, 4096 or 256 with --quick"),
    )),
    Run(RENDERING, "python -m benchmarks.render errors", "", "exact profile over the visible surface",
        "extremes of four seeds", (
        ("flip", "≤ 0.006", flip, "FLIP error of a head, 256 samples of hazard"),
        ("flip-nearer", "≥ 1.4", flip_nearer, "FLIP error, refitted normalized diffusion over hazard"),
    )),
    Run(RENDERING, "python -m benchmarks.choose", "--quick", "pictures rendered by OpenGL, and the exact profile",
        EXACT, (
        ("choose-error", "≤ 1.1", apart(True), "predicted and rendered error, ratio, chosen option",
         "worst scene, each rendered to 3 %"),
        ("choose-errors", "≤ 1.2", apart(False), "predicted and rendered error, ratio, every option",
         "worst of all, each rendered to 3 %"),
    )),
    Run(LAYERS, "python -m benchmarks.stacks", "",
        "exact stacks, first layers of 0.03 to 8 mm at thicknesses not fitted and each stack's own, both illuminations",
        EXACT, (
        ("stack-error", "≤ 3 %", lambda n: 100 * n["rel"],
         "error of R_d, mean of 12 stacks and colours"),
        ("stack-worst", "≤ 10 %", lambda n: 100 * n["worst"], "error of R_d, worst stack, illumination, thickness"),
        ("stack-own-worst", "≤ 8 %", lambda n: 100 * n["own"]["worst"],
         "error of R_d, worst stack, own thickness"),
        ("stack-ks", "≤ 0.02", "own.ks", "error of the cdf, own thickness"),
        ("stack-energy", "≤ 1 %", lambda n: 100 * n["A"], "error of A"),
    )),
    Run(LAYERS, "python -m benchmarks.stacks --random 20", "", "exact solution of 20 random stacks of 2 to 4 layers",
        EXACT, (
        ("random-stacks", "≤ 10 %", lambda n: 100 * n["own"]["worst"],
         "error of R_d, worst random stack, own thickness"),
    )),
    Run(LAYERS, "python -m benchmarks.stacks --forward 0.9 --light searchlight --stack heart", "",
        "3e7 photons per colour of the stack heart, pencil beam, bins from 0.1 mean free paths, noise subtracted",
        "photons, subtracted in quadrature", (
        ("forward-stack", "≤ 5 %", lambda n: 100 * n["rel"],
         "error of R_d, heart with g = 0.9, pencil beam, mean of three colours"),
        ("forward-worst", "≤ 12 %", lambda n: 100 * n["worst"],
         "error of R_d, heart with g = 0.9, pencil beam, worst colour"),
    )),
    Run(LAYERS, "python -m benchmarks.stack_source", "",
        "the source in float64 within 99.5 % of the energy, and the source of hazard", EXACT, (
        ("stack-rounding", "≤ 3e-05", lambda n: max(one["rounding"]["profile"] for one in n.values()),
         "float32 error of R_d, shader source"),
        ("stack-text-time", "≤ 2.5", "skimmilk-on-marble.cost.both",
         "shader time of a radius and R_d, two layers over hazard",
         "median of 7 turns"),
        ("deep-stack-text-time", "≤ 3.5", "skin.cost.both", "shader time of a radius and R_d, three layers over hazard",
         "median of 7 turns"),
    )),
    Run(LAYERS, "python -m benchmarks.layers", "",
        "surface integral with the exact stack at each point, least of three poses", EXACT, (
        ("head-nearer", "≥ 5", pictured(lambda n: min(one["dipole"] / one["stack"] for one in n.values())),
         "error of a head, dipole of layer 1 over stack model"),
    )),
    Run(SEA, "profilefit report petzold", "",
        "mean particle phase function of Petzold, 55 angles, with its mean cosine and backscattered share", EXACT, (
        ("phase-three", "≤ 0.17", of_phase("3-terms"),
         "rms of ln(form / data), three terms, moments held"),
        ("phase-four", "≤ 0.07", of_phase("4-terms"), "rms of ln(form / data), four terms, moments held"),
    )),
    Run(SEA, "python -m benchmarks.sea --only beam segment shafts exact hits splats", "",
        "photons (omega to 0.8, c t to 4), float64, quadrature, exact irradiance of ridges and dense steps", EXACT, (
        ("beam-share", "≤ 2 %", lambda n: 100 * max(one["within"] for one in n["beam"]),
         "error of a beam's share within 1 / c", "photons, 300000"),
        ("beam-plane", "≤ 1 %", lambda n: 100 * max(one["all the plane"] for one in n["beam"]),
         "error of a beam's share in the whole plane", "photons, 300000"),
        ("sea-segment", "≤ 5e-07", lambda n: max(one["as here"] for one in n["segment"]),
         "error of a segment's integral, float32"),
        ("sea-slices", "≤ 1 %", lambda n: 100 * next(one["slices"] for one in n["shafts"] if one["samples"] == 64),
         "rms error of shafts, 64 slices, 20 views"),
        ("caustic-photons", "≤ 1 %", lambda n: 100 * max(one["worst"] for one in n["exact"]),
         "error of a pixel, 6.7e7 photons"),
        ("sea-hits", "≤ 0.2 %", lambda n: 100 * max(n["hits"][-1][s] for s in ("0.5", "0.9", "1.5", "3", "5")),
         "hits with errors over 1 % of depth, 16 steps, 3 iterations, S to 5", "rays, 3000 each"),
        ("caustics-before", "≤ 0.008", splat_of(0.32, 70_000, "rms"),
         "rms error of a caustic map, F = 0.32, 70,000 fragments"),
        ("caustics-beyond", "≤ 0.1", splat_of(1.18, 300_000, "rms"),
         "rms error beyond folds, F = 1.18, 300,000 fragments"),
        ("caustics-bias", "≤ 0.5 %", lambda n: 100 * max(splat_of(1.18, 300_000, key)(n) for key in ("bright", "dark")),
         "bias of this map, bright and dark parts"),
        ("caustics-energy", "≤ 1e-06", splat_of(1.18, 300_000, "energy"), "energy error of this map"),
    )),
    Run(FUR, "python -m benchmarks.fur --only closed third exponent least union", "",
        "rays against cones from 0 to 85 degrees, the best of each L / r0 from 10 to 50, discs in closed form", EXACT, (
        ("fur-seen", "≤ 0.01", lambda n: max(abs(one["difference"]) for one in n["closed"]),
         "error of the visibility of random cones", "rays, 160000 each"),
        ("fur-discs", "≤ 0.2 %", lambda n: 100 * max(abs(one["off"]) for one in n["union"]),
         "error of the shadow of discs by OpenGL"),
        ("fur-third", "≤ 15 %", lambda n: 100 * factor_of(n, "heights, to the cone")["+-"],
         "linear shells per quadratic one, half 95 % interval", "furs and angles, 63"),
        ("fur-exponent", "≤ 10 %", lambda n: 100 * max(one["worst"] for one in n["exponent"]),
         "threshold exponent, difference from the best"),
        ("fur-swept", "≤ 16", least_of("swept"), "swept slabs for rms 0.02 at 45 degrees, one strand", "rays, 10000"),
        ("fur-swept-two", "≤ 12", least_of("swept, two strands"), "swept slabs for rms 0.02 at 45 degrees, two strands",
         "rays, 10000"),
    )),
    Run(FUR, "python -m benchmarks.fur_choose", "", "new rays through 50 random furs", EXACT, (
        ("fur-chosen", "≥ 90 %", lambda n: 100 * n["summary"]["within"],
         "furs whose chosen number of layers meets the tolerance", "furs, 50"),
        ("fur-over", "≤ 1.25", "summary.mean ratio", "chosen number of layers over the least, mean", "furs, 50"),
    )),
)
# fmt: on


def numbers(command: str) -> Any:
    """Return the numbers of a command, from its JSON."""
    program, *words = shlex.split(command)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "numbers.json"
        file.touch()
        if program == "profilefit":  # prints the numbers, and writes into the folder that it is in
            (Path(folder) / "examples").symlink_to(ROOT / "examples")
            whole = [sys.executable, "-m", program, *words, "--fits", str(FITS), "--json", "--quiet"]
            with file.open("wb") as out:
                done = subprocess.run(whole, cwd=folder, stdout=out, check=False)
        else:
            done = subprocess.run([sys.executable, *words, "--json", str(file)], cwd=ROOT, check=False)
        if done.returncode not in ANSWERS or not (text := file.read_text(encoding="utf-8")):
            sys.exit(f"{command} ended with status {done.returncode} and without numbers")
        return json.loads(text)


def claimed(run: Run, command: str, values: Any, date: str = "", load: str = "unknown") -> Iterator[Claim]:
    """Return the rows of a run whose command printed these numbers."""
    for name, bound, read, says, *noise in run.promises:
        found = at(values, read) if isinstance(read, str) else read(values)
        value, low, high = found if isinstance(found, Sequence) else (found,) * 3
        sense, most, *unit = bound.split()
        spread = noise[0] if noise else EXACT if low == high else run.noise
        yield Claim(
            *(name, run.subject, says, value, low, high, spread, sense, float(most), "".join(unit)),
            *(run.truth, command, date, load),
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    names = [promise[0] for run in RUNS for promise in run.promises]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME", help="others stay")
    parser.add_argument("--quick", action="store_true", help="shorter runs where a command has them: noisier")
    parser.add_argument("--out", type=Path, default=FITS / "evidence", metavar="FOLDER", help="of claims.json")
    options = parser.parse_args(arguments)
    require_apart(options.out, FITS)
    file, found = options.out / FILE, {}
    if file.exists():
        before, rows = read_claims(options.out)
        tied = {promise[0] for run in RUNS if run.fitted for promise in run.promises} if stale(before, FITS) else set()
        found = {one.name: one for one in rows if one.name not in tied}
    for run in RUNS:
        if not {promise[0] for promise in run.promises} & {*options.only}:
            continue
        command = f"{run.command} {run.quick}" if options.quick and run.quick else run.command
        origin, load = measurement_origin("make claims", FITS), f"{os.getloadavg()[0]:.1f}"
        new = [one for one in claimed(run, command, numbers(command), origin["date"], load) if one.name in options.only]
        found |= {one.name: one for one in new}
        rows = [asdict(found[name]) for name in names if name in found]
        write_whole(file, as_json({"made": origin, "rows": rows}))  # after each command: the next may take ten minutes
        show(list(claim_tables(new, titled=True).values()), Console(width=WIDTH, highlight=False))
    if broken := [f"{one.says}: {one.cells[2]}, promised {one.cells[1]}" for one in found.values() if not one.holds]:
        sys.exit("\n".join(broken))


if __name__ == "__main__":
    main()
