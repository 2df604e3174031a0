"""Phase functions fitted to a table in every form: their record, FITS/phases/NAME.json, and back to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import model_validator

from mcml_sim import Setting
from mcml_sim.media.arrays import shown
from mcml_sim.media.phase import Phase
from profilefit.errors import InputError
from profilefit.laws.phases import FORMS, regression
from profilefit.recipes import record
from profilefit.recipes.declared import Keys, Table
from profilefit.recipes.folder import LOCAL, PHASES, fits_folder, is_file
from profilefit.recipes.phases import ALL_ANGLES, MOMENTS, SEED, PhaseData, PhaseFit, built, fit_phase, read_phase
from profilefit.recipes.record import SOLVED, Count, Digest, LawRecord, Measures, Texts
from profilefit.recipes.run import LAWS, RecipeRun, Work

PIPELINE = "phase"
TITLE = "Phase functions fitted to a table"
EQUATIONS = "p(c) = sum_i w_i (1 - g_i^2) / (4 pi (1 + g_i^2 - 2 g_i c)^(3/2)); haltrin; fournier-forand"
NOTE = (
    "Least squares of ln p over all rows alike, or by their sigma. Moments that are held are those of the table, which "
    "is straight in the logarithms of p and 1 - c between its rows and goes on below the first by their power law."
)
HELD, FREE = "held", "free"
DEFAULT = ("4-terms", HELD)
FULL_SPHERE = 4 * np.pi  # [sr], the integral of values that are said relative to isotropic ones
NEAR_ONE = 0.1
SMALLEST = 1e-4  # share that is printed
USUAL = RecipeRun("quick", SEED, Path(), None, None)  # of a table that is fitted without a record
MOMENT = dict.fromkeys(("mean_cosine", "backscattered", "second"), float)
FITTED = Keys(**SOLVED, **MOMENT, steps=Count, held=Texts, rms=float, bands=Measures)
Span = Annotated[Table, Keys(low=float, high=float, share=float, other=float, rule=str, other_rule=str)]
NEWER = {"unit": str, "spans": list[Span]}  # of no older records


class ShownPhases(LawRecord):
    """Record with what `profilefit report` shows of phase functions."""

    title: str
    equations: str
    note: str
    data_digest: Digest
    data: Annotated[Table, Keys(NEWER, **MOMENT, source=str, rows=Count, integral=float, angles=Measures)]
    phases: Annotated[Table, Keys(**dict.fromkeys(FORMS, Keys(free=FITTED, held=FITTED)))]

    @model_validator(mode="after")
    def _complete(self) -> Self:
        """Refuse a record that lacks a constant of a form."""
        each = ((form, how, name) for form in FORMS for how in (FREE, HELD) for name in FORMS[form].names)
        self.require_constants(map(".".join, each))
        return self


@dataclass(frozen=True)
class PhaseRecord:
    """Record of the fits to a table: all that it says, and its file."""

    content: Mapping[str, Any]
    path: Path

    def constants(self, form: str, how: str = HELD) -> dict[str, Mapping[str, Any]]:
        """Return the constants of a form with its moments held or free, each with its errors."""
        return {name: self.content["constants"][f"{form}.{how}.{name}"] for name in FORMS[form].names}

    def phase(self, form: str = DEFAULT[0], how: str = DEFAULT[1]) -> Phase:
        """Return a fitted phase function; InputError on another form."""
        if form not in FORMS:
            raise InputError(f"form must be one of {', '.join(FORMS)}, got {form!r}")
        if how not in (HELD, FREE):
            raise InputError(f"moments must be {HELD} or {FREE}, got {how!r}")
        own = self.constants(form, how)
        with record.damage(self.path):
            return built(FORMS[form], np.array([own[name]["regenerated"] for name in FORMS[form].names]))


def find(name: str, folder: Path) -> PhaseRecord | None:
    """Return the fits of a record by its path or by its name in a folder; None where there is none."""
    path = record.named(name, folder / PHASES, PIPELINE)
    return None if path is None else load(path)


def named(name: str) -> PhaseRecord:
    """Return the record of a name, in ./fits or that is shipped, or of a path; InputError if there is none."""
    if name.endswith(".json"):
        return load(Path(name))
    folders = LOCAL, fits_folder()
    for folder in folders:
        if (fits := find(name, folder)) is not None:
            return fits
    known = dict.fromkeys(own for folder in reversed(folders) for own in record.available(folder / PHASES))
    raise InputError(f"the record of a phase function must be one of {', '.join(known)}, or a .json, got {shown(name)}")


def request(name: str) -> Path | None:
    """Return the table that a name means: a .csv, or one that is shipped; None where it means something else."""
    path = Path(name) if name.endswith(".csv") else fits_folder() / PHASES / f"{name}.csv"
    return path if name.endswith(".csv") or is_file(path) else None


def fit(table: Path, run: RecipeRun) -> Work:
    """Return the record to be made of a table, in one part: a minute. InputError on a damaged table."""
    data = read_phase(table)
    arrays = {"angles": data.angles, "values": data.values}
    return Work(
        f"{PHASES}/{table.stem}",
        (partial(fits_of, data, seed=run.seed),),
        lambda results: (content(data, results[0], run), arrays),
        tuple(table_lines(described(data))),
        (LAWS, 1, 2),
    )


def quality(fits: Sequence[PhaseFit]) -> dict[str, Any]:
    """Return the root mean squares of ln(form / table) [-]."""
    return {"regenerated": {"rms": [each.rms for each in fits]}}


def read(path: Path) -> dict[str, Any]:
    """Return all that a record says; RecordError in one line on one that is damaged."""
    return record.read_of(path, PIPELINE, "a record of phase functions", ShownPhases)


def load(path: Path) -> PhaseRecord:
    """Return a record; RecordError in one line on one that is damaged."""
    return PhaseRecord(read(path), path)


def fits_of(data: PhaseData, angles: tuple[float, float] = ALL_ANGLES, seed: int = SEED) -> list[PhaseFit]:
    """Fit every form to a table, its moments free and then held, as many as it has numbers for."""
    each = ((name, hold) for name, form in FORMS.items() for hold in ((), MOMENTS[: form.free]))
    return [fit_phase(data, name, hold, angles, seed) for name, hold in each]


def table_lines(data: Mapping[str, Any]) -> list[str]:
    """Return lines on the scale of a table and on the angles where it has no rows.

    data  the table `data` of a record; older records have neither `unit` nor `spans`
    """
    factor, unit, spans = data["integral"], data.get("unit"), data.get("spans", [])
    turns = factor / FULL_SPHERE
    of = f"b = {factor:#.4g} {unit}" if unit else f"{factor:#.4g}"
    of += f" (4 pi times {turns:#.4g})" if not unit and abs(turns - 1) < NEAR_ONE else ""
    lines = [f"{data['source']}: values were divided by their integral over all directions, {of}."]
    if data["angles"][0] == 0:
        lines.append("The row at 0 degrees counts in the integral and in the moments, and in no fit.")
    lines += [
        f"No rows between {one['low']:g} and {one['high']:g} degrees: {_percent(one['share'])} of the integral with "
        f"{one['rule']}, {_percent(one['other'])} with {one['other_rule']}."
        for one in spans
    ]
    unsure = sum(abs(one["share"] - one["other"]) for one in spans)
    return [*lines, f"The choice between these changes the integral by up to {_percent(unsure)}."] if spans else lines


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share > SMALLEST else f"less than {100 * SMALLEST:g} %"


def described(data: PhaseData) -> dict[str, Any]:
    """Return the table `data` of a record."""
    return {
        "source": Path(data.source).name,
        "rows": data.angles.size,
        "angles": [float(np.degrees(data.angles[at])) for at in (0, -1)],
        **{key: getattr(data, key) for key in ("integral", "unit", "spans", "mean_cosine", "backscattered")},
        "second": float(data.table.moment(2)),
        "regression": regression(data.backscattered),
    }


def content(data: PhaseData, fits: Sequence[PhaseFit], run: RecipeRun = USUAL) -> dict[str, Any]:
    """Return what a record says."""
    constants: dict[str, Any] = {}
    phases: dict[str, Any] = {name: {} for name in FORMS}
    for each in fits:
        how = HELD if each.held else FREE
        for place, name in enumerate(each.form.names):
            constants[f"{each.form.name}.{how}.{name}"] = {
                "published": None,
                "regenerated": each.constants[place],
                **{key: None if own is None else own[place] for key, own in each.errors.items()},
            }
        phases[each.form.name][how] = {
            "held": list(each.held),
            "result": each.result,
            "steps": each.best.steps,
            "condition_number": each.best.condition_number,
            "rms": each.rms,
            "bands": list(each.bands),
            "mean_cosine": each.mean_cosine,
            "backscattered": each.backscattered,
            "second": float(each.phase.moment(2)),
        }
    return {
        "title": TITLE,
        "law": PIPELINE,
        "pipeline": PIPELINE,
        "equations": EQUATIONS,
        "note": NOTE + run.unused(),
        "setting": Setting(),
        "constants": constants,
        "phases": phases,
        "data": described(data),
        "fit": {"result": record.first_failure([each.best.result for each in fits])},
        "quality": quality(fits),
        "truth": {"kind": "table"},
        "preset": run.preset,
        "seed": run.seed,
        "versions": record.versions(),
        "data_digest": data.digest,
    }
