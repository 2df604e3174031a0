"""Speed of the tracer, over scalar yardsticks, in one run.

    python benchmarks/tracer.py [--quick] [--only NAME ...] [--json FILE]

Works take turns on one pinned core; each ratio is the median of the ratios turn by turn, and (least ... most) of them
follows it. README.md beside this file says what each line means. Needs the extra `benchmark` (numba).
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")  # read when jax is imported

import accuracy
import gpu
import numpy as np
import problems
from table import show
from worker import ITEMS, Worker, peak_memory

from mcml_sim import Estimate
from profilefit.studies.tradeoff import stopwatch
from profilefit.studies.tradeoff.stopwatch import Rates, Ratio

ALL_CORES = stopwatch.cores()
# Before the first array: jax counts then how many cores it may use. The last core has the fewest interrupts.
PINNED = stopwatch.pin(ALL_CORES[-1])
PARTS = ("speed", "efficiency", "cores", "accuracy", "memory", "gpu")
MILLION, GIBIBYTE = 1e6, 2.0**30
# The longest run that `accuracy` makes for proof; what takes longer is extrapolated [s].
LONGEST_PROOF = 120.0
HALF_SPACES = ("half space", "half space, r-z")


@dataclass
class Report:
    """Lines to print, and their content for --json."""

    sizes: problems.Sizes
    turns: int
    numbers: dict[str, object] = field(default_factory=dict)
    verdicts: list[tuple[str, str, str, str]] = field(default_factory=list)

    def judge(self, what: str, at_least: float, aim: float | None, ratio: Ratio) -> None:
        """Return a line of the last table."""
        self.numbers[what] = {"median": ratio.median, "least": ratio.least, "most": ratio.most}
        self.verdicts.append((what, f"{at_least:g} x", f"{aim:g} x" if aim else "", str(ratio)))


def speed(report: Report) -> None:
    """Measure rates on one core, and their ratios."""
    rates = stopwatch.take_turns(problems.works(report.sizes), report.turns)
    scalar_events = problems.yardstick_events()
    order_events = problems.order_events(problems.orders(report.sizes.orders, 1))
    ours = problems.half_space_events()
    events = {"yardstick": scalar_events, "yardstick, r-z": scalar_events, "orders": order_events}
    events |= {"half space": ours, "half space, r-z": ours}
    show(
        f"One core{'' if PINNED else ' (not pinned: this system cannot)'}, best of {report.turns} turns",
        ("work", "M photons/s", "M events/s", "events/photon"),
        [_speed_row(name, rates, events.get(name)) for name in rates.by_name],
    )
    report.numbers["photons_per_second"] = {name: rates.best(name) for name in rates.by_name}
    report.numbers["events_per_photon"] = events
    report.judge(
        "simulate_orders, live events/s, over the yardstick",
        15,
        24,
        rates.ratio("orders", "yardstick, r-z", order_events / scalar_events),
    )
    for name, at_least, aim in (("half space", 12, 17), ("half space, r-z", 8, 12)):
        for unit, factor in (("events/s", ours / scalar_events), ("photons/s", 1.0)):
            report.judge(f"{name}, {unit}", at_least, aim, rates.ratio(name, "yardstick, r-z", factor))
    report.judge(
        "three layers, r and angle, photons/s, over the layered twin",
        5,
        8,
        rates.ratio("three layers", "layered yardstick"),
    )
    report.judge(
        "three layers, r-z tally too, over the layered twin",
        5,
        8,
        rates.ratio("three layers, r-z", "layered yardstick, r-z"),
    )
    others = (
        ("orders", "yardstick", order_events / scalar_events),
        ("half space", "yardstick", 1.0),
    )
    show(
        "The same over the yardstick without an r-z tally",
        ("work", "ratio"),
        [(name, str(rates.ratio(name, over, factor))) for name, over, factor in others],
    )
    show(
        "What the kernel of the matched half space buys, photons/s over the kernel for any layers",
        ("work", "ratio"),
        [(name, str(rates.ratio(name, name.replace("space", "space by layers")))) for name in HALF_SPACES],
    )
    report.numbers["rates"] = rates.by_name


def _speed_row(name: str, rates: Rates, events: float | None) -> tuple[str, ...]:
    best = rates.best(name) / MILLION
    return name, f"{best:.3f}", f"{best * events:.1f}" if events else "", f"{events:.1f}" if events else ""


def efficiency(report: Report) -> None:
    """Compare answers, and variance times time: equal speed at a larger variance would be no gain."""
    rates = stopwatch.take_turns(
        {name: work for name, work in problems.works(report.sizes).items() if name in _EFFICIENCY}, report.turns
    )
    rows = []
    tally = problems.half_space_tally(report.sizes.half_space, False, 99)
    scalar = problems.yardstick_variance()
    speedup = rates.ratio("half space", "yardstick").median
    rows.append(_efficiency_row("half space, Rd", tally.diffuse_reflectance, tally.photons, scalar, 800_000, speedup))
    layered = problems.layered_tally(report.sizes.layered, False, 99)
    means, variances = problems.layered_yardstick_variances()
    speedup = rates.ratio("three layers", "layered yardstick").median
    for name, mean, variance in zip(problems.QUANTITIES, means, variances, strict=True):
        estimate = layered.quantity(name)
        rows.append(
            _efficiency_row(f"three layers, {name}", estimate, layered.photons, (mean, variance), 200_000, speedup)
        )
    show(
        "Answers and efficiency (variance x time of the scalar tracer over ours)",
        ("quantity", "scalar", "ours", "z", "variance ratio", "efficiency"),
        [row[1] for row in rows],
    )
    report.numbers["efficiency"] = {row[0]: row[2] for row in rows}


_EFFICIENCY = ("yardstick", "half space", "layered yardstick", "three layers")


def _efficiency_row(
    name: str, estimate: Estimate, photons: int, scalar: tuple[float, float], scalar_photons: int, speed: float
) -> tuple[str, tuple[str, ...], float]:
    mean, variance = scalar
    value, error = float(estimate.value), float(estimate.standard_error)
    scalar_error = (variance / scalar_photons) ** 0.5
    z = (mean - value) / (error**2 + scalar_error**2) ** 0.5
    ratio = variance / (error**2 * photons)
    texts = (name, f"{mean:.5f} ± {scalar_error:.5f}", f"{value:.6f} ± {error:.6f}", f"{z:.2f}", f"{ratio:.2f}")
    return name, (*texts, f"{ratio * speed:.1f}"), ratio * speed


def cores(report: Report) -> None:
    """Time two threads, and two processes with half the work each, over one pinned worker."""
    if len(ALL_CORES) < 2 or not PINNED:
        print("two workers: needs two cores, and a system that pins processes\n")
        return
    one, two = ALL_CORES[-1], ALL_CORES[-2]
    rows = []
    for item, photons in (("orders", 8 * report.sizes.orders), ("three layers", 8 * report.sizes.layered)):
        ratios: dict[str, list[float]] = {"two threads": [], "two processes": []}
        with Worker(item, [one]) as first, Worker(item, [two]) as second, Worker(item, [one, two]) as both:
            for turn in range(-1, report.turns):
                alone = _time([(first, photons, 1)])
                threads = _time([(both, photons, 2)])
                processes = _time([(first, photons // 2, 1), (second, photons // 2, 1)])
                if turn >= 0:  # the first turn compiles
                    ratios["two threads"].append(alone / threads)
                    ratios["two processes"].append(alone / processes)
        for name, at_least in (("two threads", 1.8), ("two processes", 1.95)):
            middle = sorted(ratios[name])
            ratio = Ratio(middle[len(middle) // 2], middle[0], middle[-1])
            rows.append((f"{item}, {name}", str(ratio)))
            report.judge(f"{name} over one pinned worker, {item}", at_least, None, ratio)
    show("Two cores over one, by the clock", ("work", "ratio"), rows)


def _time(runs: list[tuple[Worker, int, int]]) -> float:
    for worker, photons, threads in runs:
        worker.start(photons, 1, threads)
    return max(worker.seconds() for worker, _, _ in runs)


def time_to_accuracy(report: Report) -> None:
    """Return the time to 1 % in each of 100 rings, at 32 albedos."""
    photons = 8 * report.sizes.orders
    rates = stopwatch.take_turns({"orders": lambda seed: problems.orders(report.sizes.orders, seed).photons}, 3)
    run = problems.orders(photons, seed=77)
    need = accuracy.measure(run, rates.best("orders"), report.sizes.yardstick // 10, report.turns)
    checks = {alpha: accuracy.check(run, alpha, 4 * report.sizes.yardstick) for alpha in (0.3, 0.9, 0.99)}
    rows = [
        ("32 scalar runs, together", f"{need.scalar_photons.sum():.3g}", f"{need.scalar_seconds.sum():.4g}"),
        ("  the cheapest of them", f"{need.scalar_photons.min():.3g}", f"{need.scalar_seconds.min():.4g}"),
        ("  the dearest of them", f"{need.scalar_photons.max():.3g}", f"{need.scalar_seconds.max():.4g}"),
        ("one order-resolved run", f"{need.orders_photons:.3g}", f"{need.orders_seconds:.4g}"),
    ]
    show(
        "Time to 1 % in each of 100 rings in [0.01, 5] mfp, 32 albedos, one core\n"
        f"(extrapolated: variances from {photons:.2g} order-resolved photons, rates from {report.turns} turns)",
        ("", "photons", "seconds"),
        rows,
    )
    print(
        f"The order-resolved run waits for alpha = {need.worst_alpha:.3f}, r = {need.worst_ring:.3g} mfp.\n"
        "Second moments of scalar weights, predicted and met, largest |z|: "
        + ", ".join(f"{abs(z).max():.1f} of {z.size} rings at alpha {alpha}" for alpha, z in checks.items())
    )
    report.judge("time to accuracy, 32 albedos", 150, 1000, Ratio(need.ratio, need.ratio, need.ratio))
    report.numbers["time_to_accuracy"] = {
        "alphas": accuracy.ALPHAS.tolist(),
        "scalar_photons": need.scalar_photons.tolist(),
        "scalar_seconds": need.scalar_seconds.tolist(),
        "orders_photons": need.orders_photons,
        "orders_seconds": need.orders_seconds,
    }
    if need.orders_seconds < LONGEST_PROOF and report.sizes is problems.FULL:
        _prove(report, need)


def _prove(report: Report, need: accuracy.Need) -> None:
    """Make the order-resolved run that was extrapolated."""
    rates = stopwatch.take_turns({"proof": lambda seed: problems.orders(_whole(need) if seed else 1, 78).photons}, 1)
    run = problems.orders(_whole(need), 78)
    energy = accuracy.ring_energy(accuracy.ALPHAS)[:, accuracy.FIRST_RING :]
    errors = np.asarray(run.energy(accuracy.ALPHAS).standard_error)[:, accuracy.FIRST_RING :]
    worst = float((errors / energy).max())
    seconds = run.photons / rates.best("proof")
    print(f"That run, made: {seconds:.3g} s, worst ring {100 * worst:.2f} %.\n")
    report.numbers["order_resolved_run_made"] = {"seconds": seconds, "worst_relative_error": worst}


def _whole(need: accuracy.Need) -> int:
    return int(need.orders_photons) + 1


def memory(report: Report) -> None:
    """Return the peak resident memory of a process for each item: Python, jax, compiler and all."""
    sizes = report.sizes
    photons = {"orders": sizes.orders, "yardstick": sizes.yardstick}
    peaks = {}
    for item in ITEMS:
        default = sizes.layered if item.startswith("three") else sizes.half_space
        peaks[item] = peak_memory(item, photons.get(item, default), ALL_CORES[-1]) / GIBIBYTE
    show("Peak memory of a process", ("work", "GiB"), [(item, f"{peak:.2f}") for item, peak in peaks.items()])
    report.numbers["peak_memory_gib"] = peaks
    report.verdicts.append(("peak memory of any of these", "< 1 GiB", "", f"{max(peaks.values()):.2f} GiB"))


def on_gpu(report: Report) -> None:
    """Time the order-resolved run where jax sees a GPU."""
    found = gpu.measure(32 * report.sizes.orders)
    if found is None:
        print("GPU: jax sees none here\n")
        return
    row = (
        f"simulate_orders on {found['device']}",
        f"{found['photons_per_second'] / MILLION:.1f}",
        f"{found['events_per_second'] / MILLION:.0f}",
    )
    show("GPU", ("work", "M photons/s", "M events/s"), [row])
    report.numbers["gpu"] = dict(found)
    report.verdicts.append(("GPU, events/s", "5e9", "2e10", f"{found['events_per_second']:.2g}"))


PART: dict[str, Callable[[Report], None]] = dict(
    zip(PARTS, (speed, efficiency, cores, time_to_accuracy, memory, on_gpu), strict=True)
)


def main() -> None:
    """Parse the command line, run the parts, print."""
    parser = argparse.ArgumentParser(description="How fast the tracer is, over scalar yardsticks, in one run.")
    parser.add_argument("--quick", action="store_true", help="small runs and few turns: three minutes, and noisy")
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="NAME", help=f"some of {', '.join(PARTS)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    arguments = parser.parse_args()
    report = Report(*((problems.QUICK, 3) if arguments.quick else (problems.FULL, 7)))
    for name in arguments.only or PARTS:
        PART[name](report)
    if report.verdicts:
        show("Targets, and what was measured", ("what", "at least", "aim", "measured"), report.verdicts)
    if arguments.json:
        arguments.json.write_text(json.dumps(report.numbers, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
