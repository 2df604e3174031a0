"""Cost and error of each profile law: constants, functions, time over normalized diffusion's, rel and ks.

    python -m benchmarks.laws [--quick] [--json FILE] [--fits FOLDER]

The tables behind the charts of `profilefit tradeoff laws`, measured by the same code, `studies/tradeoff/laws.py`, with
what it leaves out: the functions by name, the sampler alone, ks. Ratios of times are medians over the turns, with
(least ... most). README.md beside this file says what the columns mean.
"""

from __future__ import annotations

import argparse
import json
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

os.environ.setdefault("JAX_PLATFORMS", "cpu")

from benchmarks.table import show
from profilefit.studies.tradeoff import stopwatch
from profilefit.studies.tradeoff.laws import (
    FULL,
    MANY,
    PARTS,
    QUICK,
    YARDSTICK,
    ContenderResult,
    FunctionCounts,
    contenders,
    measured,
)


def described(functions: Counter[str]) -> str:
    """Return functions as text, for example "2 exp, log"; a dash where there is none."""
    return ", ".join(f"{number} {name}" if number > 1 else name for name, number in sorted(functions.items())) or "–"


def as_cells(row: ContenderResult) -> tuple[str, ...]:
    """Return the row of the table of costs."""
    profile, sampler = row.contender.constants
    return (
        row.contender.name,
        "" if row.contender.another else f"{profile} + {sampler}" if sampler else str(profile),
        "" if row.contender.another else described(row.counts["profile"].point),
        _few(row.counts["sample"]),
        *(str(row.ratios[part]) if part in row.ratios else "" for part in PARTS),
        "" if row.setup is None else f"{row.setup:.0f}",
    )


def _few(counted: FunctionCounts) -> str:
    return described(counted.point) if counted.transcendental <= MANY else f"{counted.transcendental} in all"


def as_errors(row: ContenderResult) -> tuple[str, ...]:
    """Return the row of the table of errors."""
    return row.contender.name, *(f"{value:.2g}" for e in (row.rel, row.ks) for value in (e.mean(), e.max()))


def as_numbers(row: ContenderResult) -> dict[str, object]:
    """Return the row for --json."""
    return {
        "constants": sum(row.contender.constants),
        "functions": {part: dict(counted.point) for part, counted in row.counts.items()},
        "functions_per_material": dict(row.counts["both"].material),
        "time_ratio": {part: [ratio.median, ratio.least, ratio.most] for part, ratio in row.ratios.items()},
        "setup_nanoseconds": row.setup,
        "rel": {"mean": float(row.rel.mean()), "worst": float(row.rel.max())},
        "ks": {"mean": float(row.ks.mean()), "worst": float(row.ks.max())},
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few points, turns and albedos: noisy")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    parser.add_argument("--fits", type=Path, metavar="FOLDER", help="the records of the regenerated constants")
    options = parser.parse_args(arguments)
    found, left_out = contenders(options.fits)
    rows = measured(found, QUICK if options.quick else FULL)
    report(rows, left_out)
    if options.json:
        numbers = {row.contender.name: as_numbers(row) for row in rows}
        options.json.write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")


def report(rows: Sequence[ContenderResult], left_out: Sequence[str]) -> None:
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
