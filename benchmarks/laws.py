"""What each profile law costs and how wrong it is: constants, functions, time over normalized diffusion's, rel and ks.

    python -m benchmarks.laws [--quick] [--figure FILE] [--json FILE] [--fits FOLDER]

All that depends on the albedo only is computed beforehand, as for a shader's constants, and is timed apart. Every law
takes its turn on one pinned core in float32; ratios of times are medians over the turns, with (least ... most). The
errors are those against the exact half space at albedos to which nothing was fitted. README.md beside this file says
what the columns mean.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from benchmarks import law_figure, stopwatch
from benchmarks.contenders import YARDSTICK, Contender, contenders
from benchmarks.counting import Counts, count, described
from benchmarks.stopwatch import Rates, Ratio
from benchmarks.table import show
from profilefit.quality import profile_quality

# Of one call. A law that computes more functions a point than these takes fewer points, or is not timed at all.
MANY, TOO_MANY = 30, 5000
MATERIAL = 0.8  # the albedo of the timed material
RADII = 0.01, 10.0  # of the timed profiles [mfp]
NANO = 1e9
PARTS = ("profile", "sample", "both")


@dataclass(frozen=True)
class Sizes:
    """Points of one call, and of one call of a costly law; albedos of a setup; turns; albedos of the errors."""

    points: int = 1_000_000
    costly: int = 20_000
    albedos: int = 100_000
    turns: int = 21
    judged: int = 60


FULL, QUICK = Sizes(), Sizes(100_000, 1000, 10_000, 3, 6)


@dataclass(frozen=True)
class Row:
    """All that is known of one contender.

    counts, ratios  by part: profile, sample and both, one after the other; times over those of normalized diffusion
    setup  [ns] for each material;  rel, ks  (albedos,)
    """

    contender: Contender
    counts: dict[str, Counts]
    ratios: dict[str, Ratio]
    setup: float | None
    rel: np.ndarray
    ks: np.ndarray


def judged_albedos(number: int) -> np.ndarray:
    """Even in sqrt(1 - alpha) over [0.05, 0.995]."""
    return 1.0 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), number) ** 2


def counts(contender: Contender) -> dict[str, Counts]:
    """Functions of a profile, of a sample, and of a sample and the profile there."""
    return {"profile": count(contender.profile), "sample": count(contender.sample), "both": count(contender.both)}


def works(contender: Contender, counted: dict[str, Counts], sizes: Sizes) -> dict[str, stopwatch.Work]:
    """What to time of a contender, by part: the profile of a law once, whatever its samplers."""
    functions: dict[str, Callable[[Array, Array], object]] = {"sample": contender.sample, "both": contender.both}
    if not contender.another:
        functions = {"profile": contender.profile, **functions}
    found = {}
    for part, function in functions.items():
        each = counted[part].transcendental
        if each <= TOO_MANY:
            found[part] = _work(function, part == "profile", sizes.points if each <= MANY else sizes.costly)
    return found


def _work(function: Callable[[Array, Array], object], radii: bool, points: int) -> stopwatch.Work:
    """Calls on radii, or on numbers in [0, 1); the albedo is a constant of the compiled call."""
    shares = np.random.default_rng(1).random(points)
    near, far = RADII
    given = jnp.asarray(near * (far / near) ** shares if radii else shares, jnp.float32)
    compiled = jax.jit(lambda values: function(values, jnp.float32(MATERIAL)))

    def work(_: int) -> int:
        jax.block_until_ready(compiled(given))
        return points

    return work


def _setup_work(contender: Contender, albedos: int) -> stopwatch.Work | None:
    if contender.setup is None:
        return None
    alphas = jnp.linspace(0.05, 0.995, albedos, dtype=jnp.float32)
    compiled = jax.jit(contender.setup)

    def work(_: int) -> int:
        jax.block_until_ready(compiled(alphas))
        return albedos

    return work


def measured(found: Sequence[Contender], sizes: Sizes) -> list[Row]:
    """Count, time and judge every contender; the yardstick must be one of them."""
    counted = {contender.name: counts(contender) for contender in found}
    timed: dict[tuple[str, str], stopwatch.Work] = {}
    for contender in found:
        timed |= {
            (part, contender.name): work for part, work in works(contender, counted[contender.name], sizes).items()
        }
        if (work := _setup_work(contender, sizes.albedos)) is not None:
            timed["setup", contender.name] = work
    rates = stopwatch.take_turns({" of ".join(key): work for key, work in timed.items()}, sizes.turns)
    return [_row(contender, counted[contender.name], rates, sizes) for contender in found]


def _row(contender: Contender, counted: dict[str, Counts], rates: Rates, sizes: Sizes) -> Row:
    ratios = {
        part: rates.ratio(f"{part} of {YARDSTICK}", f"{part} of {contender.name}")
        for part in PARTS
        if f"{part} of {contender.name}" in rates.by_name
    }
    setup = f"setup of {contender.name}"
    nanoseconds = NANO / rates.best(setup) if setup in rates.by_name else None
    quality = profile_quality(contender.law, judged_albedos(sizes.judged))
    return Row(contender, counted, ratios, nanoseconds, quality.rel, quality.ks)


def as_cells(row: Row) -> tuple[str, ...]:
    """The row of the table of costs."""
    profile, sampler = row.contender.constants
    return (
        row.contender.name,
        "" if row.contender.another else f"{profile} + {sampler}" if sampler else str(profile),
        "" if row.contender.another else described(row.counts["profile"].point),
        _few(row.counts["sample"]),
        *(str(row.ratios[part]) if part in row.ratios else "" for part in PARTS),
        "" if row.setup is None else f"{row.setup:.0f}",
    )


def _few(counted: Counts) -> str:
    return described(counted.point) if counted.transcendental <= MANY else f"{counted.transcendental} in all"


def as_errors(row: Row) -> tuple[str, ...]:
    """The row of the table of errors."""
    return row.contender.name, *(f"{value:.2g}" for e in (row.rel, row.ks) for value in (e.mean(), e.max()))


def as_numbers(row: Row) -> dict[str, object]:
    """The same for --json."""
    return {
        "constants": sum(row.contender.constants),
        "functions": {part: dict(counted.point) for part, counted in row.counts.items()},
        "functions_per_material": dict(row.counts["both"].material),
        "time_ratio": {part: [ratio.median, ratio.least, ratio.most] for part, ratio in row.ratios.items()},
        "setup_nanoseconds": row.setup,
        "rel": {"mean": float(row.rel.mean()), "worst": float(row.rel.max())},
        "ks": {"mean": float(row.ks.mean()), "worst": float(row.ks.max())},
    }


def as_points(rows: Sequence[Row], part: str) -> list[law_figure.Point]:
    """The points of the figure's panel for that part."""
    return [
        law_figure.Point(
            _short_name(row.contender.name), row.ratios[part].median, float(row.rel.mean()), float(row.rel.max())
        )
        for row in rows
        if part in row.ratios
    ]


def _short_name(name: str) -> str:
    return name.replace(YARDSTICK, "norm. diffusion")


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few points, turns and albedos: noisy")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="where to draw error over time, .png or .svg")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    parser.add_argument("--fits", type=Path, metavar="FOLDER", help="the records of the regenerated constants")
    options = parser.parse_args(arguments)
    found, left_out = contenders(options.fits)
    rows = measured(found, QUICK if options.quick else FULL)
    report(rows, left_out)
    if options.figure:
        panels = {"profile": "$R_d$ alone", "both": "a sample, and $R_d$ there"}
        law_figure.draw({title: as_points(rows, part) for part, title in panels.items()}, options.figure)
    if options.json:
        numbers = {row.contender.name: as_numbers(row) for row in rows}
        options.json.write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")


def report(rows: Sequence[Row], left_out: Sequence[str]) -> None:
    """Print the tables, and what is not in them."""
    show(
        f"Functions a point and time over {YARDSTICK}'s, one core, float32",
        ("law", "constants", "functions of R_d", "of a sample", "R_d", "sample", "sample, then R_d", "setup [ns]"),
        [as_cells(row) for row in rows],
    )
    show(
        f"Errors at {len(rows[0].rel)} albedos in [0.05, 0.995]",
        ("law", "rel mean", "rel worst", "ks mean", "ks worst"),
        [as_errors(row) for row in rows if not row.contender.another],
    )
    for line in left_out:
        print(f"left out: {line}")


if __name__ == "__main__":
    stopwatch.pin(stopwatch.cores()[-1])  # before jax counts the cores that it may use, at the first array
    main()
