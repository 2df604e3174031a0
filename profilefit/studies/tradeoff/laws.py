"""Profile laws: nanoseconds of an evaluation, on one core in float32, against the error of R_d.

All that depends on the albedo only is computed beforehand, as for a shader's constants. Every law is in its fastest
form and takes its turn; its time is that over normalized diffusion's in the same turn, in units of that one's median,
so that what disturbs a turn disturbs no comparison. Errors are `rel` against the exact half space, at albedos to which
nothing was fitted: the mean over them, and the worst.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from profilefit.fitting.quality import profile_quality
from profilefit.studies.tradeoff import stopwatch
from profilefit.studies.tradeoff.contenders import SPECS, YARDSTICK, Contender, contenders, table_contender
from profilefit.studies.tradeoff.counting import FunctionCounts, count
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Rates, Ratio, Track

# Of one call. A law that computes more functions a point than these takes fewer points, or is not timed at all.
MANY, TOO_MANY = 30, 5000
MATERIAL = 0.8  # the albedo of the timed material
RADII = 0.01, 10.0  # of the timed profiles [mfp]
NANO = 1e9
PARTS = ("profile", "sample", "both")
TITLES = {"profile": "R$_d$ at a given radius", "both": "a radius drawn, and R$_d$ there"}
COST = "time of one {}, one core, float32 [ns]"
AXES = {"profile": COST.format("evaluation"), "both": COST.format("sample")}
ERROR = "relative error of R$_d$ [-]"
QUICKLY = (YARDSTICK, "Liang, corrected", "hazard", "hazard, n = 1.4")


@dataclass(frozen=True)
class LawSizes:
    """Points of one call, and of one call of a costly law; albedos of a setup; turns; albedos of the errors."""

    points: int = 1_000_000
    costly: int = 20_000
    albedos: int = 100_000
    turns: int = 21
    judged: int = 60


FULL, QUICK = LawSizes(), LawSizes(100_000, 1000, 10_000, 5, 4)


@dataclass(frozen=True)
class ContenderResult:
    """All that is known of one contender.

    counts  by part: profile, sample and both, one after the other;  times [ns] of a point, by part and turn
    ratios  by part, times over those of normalized diffusion
    setup   [ns] for each material;  rel, ks  (albedos,)
    """

    contender: Contender
    counts: dict[str, FunctionCounts]
    times: dict[str, WithSpread]
    ratios: dict[str, Ratio]
    setup: float | None
    rel: np.ndarray
    ks: np.ndarray


def measure(sizes: LawSizes = FULL, folder: Path | None = None, track: Track = stopwatch.silent) -> TradeoffPart:
    """Time and judge every law; quickly, only some of them."""
    quick = sizes.judged <= QUICK.judged
    contestants, left_out = contenders(folder, [one for one in SPECS if not quick or one.label in QUICKLY])
    if not quick:
        contestants.append(table_contender(MATERIAL))
    rows = measured(contestants, sizes, track)
    panels = tuple(Panel(part, title, AXES[part], ERROR, points_of(rows, part)) for part, title in TITLES.items())
    notes = [f"left out: {line}" for line in left_out]
    return TradeoffPart("laws", "Profile laws: time of an evaluation against error", panels, tuple(notes))


def judged_albedos(number: int) -> np.ndarray:
    """Return albedos even in sqrt(1 - alpha) over [0.05, 0.995]."""
    return 1.0 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), number) ** 2


def counts(contender: Contender) -> dict[str, FunctionCounts]:
    """Count the functions of each part of a contender."""
    functions = {**contender.parts, **({"profile": contender.profile} if contender.another else {})}
    return {part: count(functions[part]) for part in PARTS if part in functions}


def works(contender: Contender, counted: dict[str, FunctionCounts], sizes: LawSizes) -> dict[str, stopwatch.Work]:
    """Return the timed calls of a contender, by part."""
    calls = {}
    for part, function in contender.parts.items():
        each = counted[part].transcendental
        if each <= TOO_MANY:
            calls[part] = timed(function, part == "profile", sizes.points if each <= MANY else sizes.costly)
    return calls


def timed(function: Callable[[Array, Array], object], radii: bool, points: int) -> stopwatch.Work:
    """Return a call on radii, or on numbers in [0, 1); the albedo is a constant of the compiled call."""
    shares = np.random.default_rng(1).random(points)
    near, far = RADII
    given = jnp.asarray(near * (far / near) ** shares if radii else shares, jnp.float32)
    compiled = jax.jit(lambda values: function(values, jnp.float32(MATERIAL)))

    def work(_: int) -> int:
        jax.block_until_ready(compiled(given))
        return points

    return work


def measured(
    contestants: Sequence[Contender], sizes: LawSizes, track: Track = stopwatch.silent
) -> list[ContenderResult]:
    """Count, time and judge every contender; the yardstick must be one of them."""
    counted = {contender.name: counts(contender) for contender in contestants}
    jobs: dict[tuple[str, str], stopwatch.Work] = {}
    for contender in contestants:
        jobs |= {
            (part, contender.name): work for part, work in works(contender, counted[contender.name], sizes).items()
        }
        if (work := _setup_work(contender, sizes.albedos)) is not None:
            jobs["setup", contender.name] = work
    rates = stopwatch.take_turns({" of ".join(key): work for key, work in jobs.items()}, sizes.turns, track, "laws")
    rows: Iterable[int] = track(range(len(contestants)), "errors of laws")
    return [_row(contestants[i], counted[contestants[i].name], rates, sizes) for i in rows]


def nanoseconds(rates: Rates, name: str, yardstick: str) -> WithSpread:
    """Time of a point: that over the yardstick's in each turn, in units of its median [ns]."""
    return WithSpread.of(NANO * float(np.median(rates.seconds(yardstick))) * rates.times(name, yardstick))


def _setup_work(contender: Contender, albedos: int) -> stopwatch.Work | None:
    if contender.setup is None:
        return None
    alphas = jnp.linspace(0.05, 0.995, albedos, dtype=jnp.float32)
    compiled = jax.jit(contender.setup)

    def work(_: int) -> int:
        jax.block_until_ready(compiled(alphas))
        return albedos

    return work


def _row(contender: Contender, counted: dict[str, FunctionCounts], rates: Rates, sizes: LawSizes) -> ContenderResult:
    names = {part: f"{part} of {contender.name}" for part in PARTS}
    there = {part: name for part, name in names.items() if name in rates.by_name}
    times = {part: nanoseconds(rates, name, f"{part} of {YARDSTICK}") for part, name in there.items()}
    ratios = {part: rates.ratio(f"{part} of {YARDSTICK}", name) for part, name in there.items()}
    setup = f"setup of {contender.name}"
    of_material = NANO / rates.best(setup) if setup in rates.by_name else None
    quality = profile_quality(contender.law, judged_albedos(sizes.judged))
    return ContenderResult(contender, counted, times, ratios, of_material, quality.rel, quality.ks)


def points_of(rows: Sequence[ContenderResult], part: str) -> tuple[Point, ...]:
    """Return one point per law: error against the time of one part."""
    return tuple(
        Point(
            part,
            row.contender.name,
            "",
            row.times[part],
            WithSpread.exactly(row.rel.mean()),
            WithSpread.exactly(row.rel.max()),
            {
                "times_yardstick": row.ratios[part].median,
                "constants": sum(row.contender.constants),
                "functions": row.counts[part].transcendental,
                "setup_nanoseconds": "" if row.setup is None else row.setup,
                "ks": float(row.ks.mean()),
                "worst_ks": float(row.ks.max()),
            },
        )
        for row in rows
        if part in row.times
    )
