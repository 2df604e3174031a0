"""Every figure that the records of a folder allow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from profilefit.recipes import record
from profilefit.recipes.folder import SUMS
from profilefit.recipes.workers import Workers
from profilefit.report.figures.albedo_figure import albedo_figure
from profilefit.report.figures.coefficient_figures import a_figure, b_figure, c_figure, constants_figure, has_printed
from profilefit.report.figures.corner_figure import corner_figure
from profilefit.report.figures.inverse_figure import inverse_figure, inversion_figure
from profilefit.report.figures.profile_figures import error_figure, profile_figure
from profilefit.report.figures.quality_figure import quality_figure, record_quality_figure
from profilefit.report.figures.residual_figure import residual_figure
from profilefit.report.figures.sum_figure import NAME as OF_SUMS
from profilefit.report.figures.sum_figure import sum_figure
from profilefit.report.records import Source, converged, measures

Draw = Callable[..., list[Path]]


@dataclass(frozen=True)
class Plan:
    """One figure: its file's name, the records it cannot do without, those it shows if they are there, who draws it.

    missing  why it cannot be drawn although its records are there; empty if it can
    """

    name: str
    needs: tuple[str, ...]
    uses: tuple[str, ...]
    draw: Draw
    missing: str = ""

    def concerns(self, names: Sequence[str] | None) -> bool:
        return names is None or not set(names).isdisjoint(self.needs + self.uses)


Track = Callable[[list[Plan]], Iterable[Plan]]

PAPER = (
    Plan("liang-7-profile", ("liang-as-published",), ("liang-whole",), profile_figure),
    Plan("liang-7-error", ("liang-whole",), ("liang-as-published",), error_figure),
    Plan("liang-8-albedo", ("albedo-liang",), ("albedo-rational",), albedo_figure),
    Plan("liang-11-a", ("liang-as-published",), ("liang-whole",), a_figure),
    Plan("liang-13-b", ("liang-as-published",), ("liang-whole",), b_figure),
    Plan("liang-15-c", ("liang-as-published",), ("liang-whole",), c_figure),
    Plan("liang-19-inverse", ("liang-inverse-whole",), ("liang-inverse-as-published", "liang-whole"), inverse_figure),
    Plan(
        "inversion-error",
        ("liang-inverse-whole",),
        ("quantile", "quantile-diffuse", "hazard", "hazard-diffuse"),
        inversion_figure,
    ),
)


def draw_all(
    folder: Path, out: Path, names: Sequence[str] | None = None, track: Track = iter, processes: int = 1
) -> tuple[list[Path], list[str]]:
    """Draw every figure that the records in `folder` allow into folder `out`, as PNG and SVG.

    names  records: only figures that show one of them; all if None or empty
    track  is shown the progress: plans, as a list -> the same, as they are drawn
    processes  how many draw, each a process of its own if not one
    Returns the files written, and a line for each figure left out, with the reason. Raises RecordError on a record
    that is damaged, OutputError where `out` cannot be written.
    """
    source = Source(folder)
    possible: list[Plan] = []
    left_out: list[str] = []
    for plan in (plan for plan in plans(source) if plan.concerns(names or None)):
        absent = [name for name in plan.needs if name not in source.paths]
        reason = f"{folder} has no record {', '.join(absent)}" if absent else plan.missing
        if reason:
            left_out.append(f"{plan.name}: {reason}")
        else:
            possible.append(plan)
    drawn: dict[int, list[Path]] = {}
    with Workers(min(processes, len(possible))) as workers:
        task = partial(_drawn, source if processes == 1 else Source(folder), out)  # what is read travels with it
        figures = workers.each(task, possible)
        for _ in track(possible):
            number, drawn[number] = next(figures)
    return [path for number in range(len(possible)) for path in drawn[number]], left_out


def _drawn(source: Source, out: Path, plan: Plan) -> list[Path]:
    return plan.draw(source, out, name=plan.name)


def plans(source: Source) -> tuple[Plan, ...]:
    """Return the paper's figures, those of all laws and stacks, and of each record."""
    profiles = tuple(name for name in source.paths if measures(source.content(name), "rel"))
    lacking = "" if profiles else f"{source.folder} has no record of a profile law"
    printed = has_printed(source)
    unprinted = "" if printed else f"{source.folder} has no record of constants that were printed"
    return (
        *PAPER,
        Plan("constants", (), printed, constants_figure, unprinted),
        Plan("quality", (), profiles, quality_figure, lacking),
        *([Plan(OF_SUMS, (), (), sum_figure)] if record.available(source.folder / SUMS) else []),
        *(plan for name in source.paths for plan in record_plans(source, name)),
    )


def record_plans(source: Source, name: str) -> tuple[Plan, ...]:
    """Return the figures of one record."""
    content = source.content(name)
    if "constants" not in content:
        return ()
    failed = "" if converged(content) else f"the fit failed: {content['fit']['result']}"
    chained = "misfit" in content["posterior"] and "covariance" in content
    chainless = "" if chained else f"no posterior: {content['fit']['result']}"
    residuals = Plan(f"residuals-{name}", (name,), (), partial(residual_figure, name), failed)
    quality = Plan(f"quality-{name}", (name,), (), partial(record_quality_figure, name), failed)
    corner = Plan(f"corner-{name}", (name,), (), partial(corner_figure, name), chainless)
    return (residuals, *([quality] if measures(content, "rel") else []), corner)
