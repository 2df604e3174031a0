"""Lines that mcml-sim prints of a run: its totals with errors, its speed, and what its precision needs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from mcml_sim.results.estimate import Estimate
from mcml_sim.results.tally import Precision, Results
from mcml_sim.runs.input_runs import Done, Job, RunOptions

# What is printed of a run, in MCML's order; ballistic light apart, since MCML's transmittance has it included.
TOTALS = {
    "specular_reflectance": "specular reflectance",
    "diffuse_reflectance": "diffuse reflectance",
    "absorbed": "absorbed fraction",
    "transmittance": "transmittance",
    "ballistic_transmittance": "  of it ballistic",
}
MOST_DIGITS = 12  # of a printed value after the point
SMALLEST = 1e-4  # value that is printed without an exponent
SLOW = 1e4  # photons/s; faster is printed in millions
SHORT = 0.05  # compiling that is not worth a word [s]


def totals(kept: Results) -> Iterator[str]:
    """Yield a line for each share of the light, and one for their sum."""
    for name, title in TOTALS.items():
        yield _line(title, with_error(kept.estimates[name]))
    if kept.cut > 0:
        yield _line("at scattering limit", f"{kept.cut:.2g}")
    yield _line("all of these", with_error(kept.estimates["energy"]))


def _line(title: str, text: str) -> str:
    return f"{title:<22} {text}"


def with_error(estimate: Estimate) -> str:
    """Return a value and its standard error with two digits, such as 0.23783 ± 0.00042."""
    value, error = float(estimate.value), float(estimate.standard_error)
    if not math.isfinite(error):
        return f"{value:.6g} ± unknown"
    if error <= 0:
        return "0 (no photon seen)" if not estimate.effective_samples else f"{value:.6g}"
    place = math.floor(math.log10(error))
    if 0 < value < SMALLEST:
        digits = max(math.floor(math.log10(value)) - place + 1, 0)
        return f"{value:.{digits}e} ± {error:.1e}"
    digits = min(max(1 - place, 0), MOST_DIGITS)
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def speed(photons: int, seconds: float, compiling: float) -> str:
    """Return the seconds of a run, and photons per second of the time that was not spent in compiling [s]."""
    tracing = max(seconds - compiling, 1e-3)
    rate = photons / tracing
    return f"{times(seconds, compiling)}, " + (
        f"{rate / 1e6:.3g} M photons/s" if rate >= SLOW else f"{rate:.0f} photons/s"
    )


def times(seconds: float, compiling: float) -> str:
    """Return the seconds of a run, those of compiling apart."""
    if compiling < SHORT:
        return f"{seconds:.1f} s"
    return f"{max(seconds - compiling, 0):.1f} s and {compiling:.1f} s to compile"


def precision_reached(estimate: Estimate, goal: Precision, photons: int) -> str:
    """Return whether the precision was reached, and if not, what would reach it."""
    if goal.is_reached(estimate):
        return f"{goal.quantity}: relative standard error {goal.relative_error:g} reached"
    value, error = np.asarray(estimate.value), np.asarray(estimate.standard_error)
    if not (np.all(value > 0) and np.all(np.isfinite(error))):
        return (
            f"{goal.quantity}: {goal.relative_error:g} not reached; some bins hold too few photons to predict how many "
            "would reach it"
        )
    reached = float(np.max(error / value))
    needed = photons * (reached / goal.relative_error) ** 2
    return (
        f"{goal.quantity}: relative standard error {reached:.2g}, not {goal.relative_error:g}; about {needed:.2g} "
        "photons in all would reach it, and these are kept: request more --photons"
    )


def lines(job: Job, done: Done, options: RunOptions) -> Iterator[str]:
    """Yield the report of a run that is done."""
    kept = done.results
    yield f"{kept.photons} photons, seed {job.seed}, {pace(done, options.scheduler is not None)}"
    yield from totals(kept)
    if options.goal is not None:
        yield precision_reached(kept.estimates[options.goal.quantity], options.goal, kept.photons)
    if job.is_part_of_more:
        yield f"{job.store} is kept, since it holds more photons than these: more --photons use them"


def pace(done: Done, on_workers: bool) -> str:
    """Return how fast a run went."""
    if done.seconds is None:
        return "finished before"
    if done.resumed:  # the batches that were there cost nothing: a rate would be too good
        return f"{times(done.seconds, done.compiling)}, resumed"
    there = ", compiling on the workers included" if on_workers else ""
    return speed(done.results.photons, done.seconds, done.compiling) + there


def summary(job: Job, kept: Results, goal: Precision | None) -> dict[str, Any]:
    """Return a run that is done for JSON: files, and each share of the light with its standard error."""
    shares = {name: kept.estimates[name] for name in (*TOTALS, "energy")}
    summary = {
        "mco": job.mco,
        "npz": job.npz,
        "photons": kept.photons,
        "seed": kept.seed,
        "version": kept.version,
        "cut": kept.cut,
        "estimates": {
            name: {"value": share.value, "standard_error": share.standard_error} for name, share in shares.items()
        },
    }
    if goal is not None:
        reached = goal.is_reached(kept.estimates[goal.quantity])
        summary["precision"] = {"quantity": goal.quantity, "goal": goal.relative_error, "reached": reached}
    return summary
