"""All forms of a phase function fitted to one table: their record, FITS/phases/NAME.json, and back to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim import Setting
from mcml_sim.media.checks import shown
from mcml_sim.media.phase import Phase
from profilefit.errors import InputError, RecordError
from profilefit.laws.phases import FORMS, regression
from profilefit.recipes import record
from profilefit.recipes.folder import LOCAL, PHASES, fits_folder
from profilefit.recipes.kinds import COUNT, LIST, MEASURE, MEASURES, NUMBER, TABLE, TEXT, TEXTS
from profilefit.recipes.phases.data import PhaseData, read_phase
from profilefit.recipes.phases.fit import ALL_ANGLES, MOMENTS, SEED, PhaseFit, built, fit_phase
from profilefit.recipes.schema import Kinds
from profilefit.recipes.work import Work

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
OF_FIT: Kinds = {
    "": TABLE,
    ".held": TEXTS,
    ".result": TEXT,
    ".steps": COUNT,
    ".condition_number": MEASURE,
    **dict.fromkeys((".rms", ".mean_cosine", ".backscattered", ".second"), NUMBER),
    ".bands": MEASURES,
}
SHOWN: Kinds = {
    **dict.fromkeys(("title", "equations", "note", "data_digest"), TEXT),
    **{"data": TABLE, "data.source": TEXT, "data.rows": COUNT, "phases": TABLE},
    **dict.fromkeys(("data.integral", "data.mean_cosine", "data.backscattered", "data.second"), NUMBER),
    "data.angles": MEASURES,
    # Of no older records.
    **{"data.unit?": TEXT, "data.spans?": LIST, "data.spans?.*": TABLE},
    **dict.fromkeys((f"data.spans?.*.{name}" for name in ("low", "high", "share", "other")), NUMBER),
    **dict.fromkeys(("data.spans?.*.rule", "data.spans?.*.other_rule"), TEXT),
    **{f"phases.{form}": TABLE for form in FORMS},
    **{f"phases.{form}.{how}{key}": kind for form in FORMS for how in (FREE, HELD) for key, kind in OF_FIT.items()},
}


@dataclass(frozen=True)
class PhaseRecord:
    """A record, read. content  all that it says;  path  of its file"""

    content: Mapping[str, Any]
    path: Path

    def constants(self, form: str, how: str = HELD) -> dict[str, Mapping[str, Any]]:
        """Of a form with its moments held or free, each with its errors."""
        return {name: self.content["constants"][f"{form}.{how}.{name}"] for name in FORMS[form].names}

    def phase(self, form: str = DEFAULT[0], how: str = DEFAULT[1]) -> Phase:
        """A fitted phase function; InputError on another form."""
        if form not in FORMS:
            raise InputError(f"form must be one of {', '.join(FORMS)}, got {form!r}")
        if how not in (HELD, FREE):
            raise InputError(f"moments must be {HELD} or {FREE}, got {how!r}")
        own = self.constants(form, how)
        try:
            return built(FORMS[form], np.array([own[name]["regenerated"] for name in FORMS[form].names]))
        except InputError as error:
            raise RecordError(f"{self.path}: is damaged: {error}; regenerate it") from None


def fits_of(
    data: PhaseData, angles: tuple[float, float] = ALL_ANGLES, say: Callable[[str], None] = lambda _: None
) -> list[PhaseFit]:
    """Every form, its moments free and then held, as many as it has numbers for."""
    found = []
    for name, form in FORMS.items():
        for hold in ((), MOMENTS[: form.free]):
            found.append(fit_phase(data, name, hold, angles))
        say(f"{name} fitted")
    return found


def work(path: Path) -> Work:
    """Fits of every form to a table, one part: a minute. InputError on a damaged table."""
    data = read_phase(path)
    arrays = {"angles": data.angles, "values": data.values}
    return Work(
        f"{PHASES}/{path.stem}",
        (partial(fits_of, data),),
        lambda found: (content(data, found[0]), arrays),
        tuple(table_lines(described(data))),
    )


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
        "integral": data.integral,
        "unit": data.unit,
        "spans": [asdict(span) for span in data.spans],
        "mean_cosine": data.mean_cosine,
        "backscattered": data.backscattered,
        "second": float(data.table.moment(2)),
        "regression": regression(data.backscattered),
    }


def content(data: PhaseData, found: Sequence[PhaseFit]) -> dict[str, Any]:
    """What a record says."""
    constants: dict[str, Any] = {}
    phases: dict[str, Any] = {name: {} for name in FORMS}
    for one in found:
        how = HELD if one.held else FREE
        for place, name in enumerate(one.form.names):
            constants[f"{one.form.name}.{how}.{name}"] = {
                "published": None,
                "regenerated": one.constants[place],
                **{key: None if own is None else own[place] for key, own in one.errors.items()},
            }
        phases[one.form.name][how] = {
            "held": list(one.held),
            "result": one.result,
            "steps": one.best.steps,
            "condition_number": one.best.condition_number,
            "rms": one.rms,
            "bands": list(one.bands),
            "mean_cosine": one.mean_cosine,
            "backscattered": one.backscattered,
            "second": float(one.phase.moment(2)),
        }
    results = [one.best.result for one in found]
    return {
        "title": TITLE,
        "law": PIPELINE,
        "pipeline": PIPELINE,
        "equations": EQUATIONS,
        "note": NOTE,
        "setting": Setting(),
        "constants": constants,
        "phases": phases,
        "data": described(data),
        "fit": {"result": next((one for one in results if one != "converged"), "converged")},
        "quality": {"regenerated": {"rms": [one.rms for one in found]}},
        "truth": {"kind": "table"},
        "preset": "quick",
        "seed": SEED,
        "versions": record.versions(),
        "data_digest": data.digest,
    }


def table_of(name: str) -> Path | None:
    """The table that a name of a command means: a .csv, or one that is shipped; None where it means something else."""
    if name.endswith(".csv"):
        return Path(name)
    shipped = fits_folder() / PHASES / f"{name}.csv"
    return shipped if shipped.exists() else None


def load(path: Path) -> PhaseRecord:
    """A record; RecordError in one line on one that is damaged."""
    found = record.read_of(path, PIPELINE, "phase functions", SHOWN)
    if text := _missing(found):
        raise RecordError(f"{path}: is damaged: {text}; regenerate it")
    return PhaseRecord(found, path)


def find(name: str) -> PhaseRecord:
    """The record of a name, in ./fits or that is shipped, or of a path; InputError if there is none."""
    if name.endswith(".json"):
        return load(Path(name))
    known = {path.stem: path for one in (fits_folder(), LOCAL) for path in record.available(one / PHASES).values()}
    if name not in known:
        raise InputError(
            f"the record of a phase function must be one of {', '.join(known)}, or a .json, got {shown(name)}"
        )
    return load(known[name])


def _missing(found: Mapping[str, Any]) -> str | None:
    names = (f"{form}.{how}.{one}" for form in FORMS for how in (FREE, HELD) for one in FORMS[form].names)
    missing = next((name for name in names if name not in found["constants"]), None)
    return f"constants.{missing} must be a table, got nothing" if missing else None
