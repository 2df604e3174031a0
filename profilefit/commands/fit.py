"""One's own data, and the medium that they tell of."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from mcml_sim.cli.program import one_line
from mcml_sim.cli.screen import notes, print_json, screen, show
from mcml_sim.files.plain import as_json as json_text
from mcml_sim.files.whole_file import require_folder, write_whole
from mcml_sim.media.setting import ILLUMINATIONS, Setting
from mcml_sim.runs.progress import working
from profilefit.errors import InputError, SettingError
from profilefit.laws.base import ProfileLaw
from profilefit.measured.data import LARGEST, SMALLEST, Measured
from profilefit.measured.fitting import fitted
from profilefit.measured.law_error import origin
from profilefit.measured.lengths import length
from profilefit.measured.problem import Known, Question, held_albedo
from profilefit.measured.reading import read
from profilefit.measured.result import Answer, answered, content
from profilefit.recipes import catalogue
from profilefit.recipes.folder import records_folder
from profilefit.report.figures.fit_figures import posterior_figure, residual_figure
from profilefit.report.tables.fit_tables import fit_lines, fit_tables

FAILED = 1
FIXED = re.compile(r"(l|alpha|A)\s*=\s*(.+)")
WITH_ERROR = re.compile(r"(?P<value>[^±]+?)\s*(?:±|\+-)\s*(?P<error>.+)")
FREE = "free"


def fit(
    data: Path,
    law: str,
    constants: str,
    fix: list[str] | None,
    unit: str | None,
    scale: str,
    total: str | None,
    light: str,
    n: float | None,
    r_min: str | None,
    r_max: str | None,
    out: Path | None,
    seed: int,
    fits: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fit, print or keep, and exit with status 1 if the fit does not converge."""
    if seed < 0:
        raise InputError(f"--seed must be a whole number >= 0, got {seed}")
    folder = records_folder(fits, quiet)
    measured = read(data, unit, scale == FREE)
    measured = measured.within(_radius("--r-min", r_min, measured), _radius("--r-max", r_max, measured))
    setting = _setting(measured, light, n)
    measured = _noted(measured, setting)
    chosen = _law(law, constants, setting, folder)
    question = _question(chosen, measured, fix or [], scale, total)
    if out is not None:
        require_folder(out)
    with working("fitting", quiet):
        answer = answered(fitted(measured, question, origin(law, constants, chosen.setting, folder)), seed)
        body = content(answer, law, constants)
    if out is not None:
        _write(answer, body, out, quiet)
    if as_json:
        print_json(body)
    else:
        points = f"{measured.value.size} {'rings' if measured.rings else 'points'}"
        _show(answer, f"{one_line(data.name)}: {points}, law {law}, {chosen.setting}")
    if answer.telling is None:
        raise typer.Exit(FAILED)


def _write(answer: Answer, body: dict[str, Any], out: Path, quiet: bool) -> None:
    write_whole(out / "fit.json", json_text(body))
    figures = [*residual_figure(answer, out), *posterior_figure(answer, out)]
    notes(quiet).print(f"wrote fit.json and {len(figures)} figures into {out}", markup=False)


def _show(answer: Answer, title: str) -> None:
    console = screen()
    show(list(fit_tables(answer, title)), console)
    for line in fit_lines(answer):
        console.print(line)


def _radius(option: str, text: str | None, measured: Measured) -> float | None:
    return None if text is None else length(option, text, measured.unit)


def _setting(measured: Measured, light: str, n: float | None) -> Setting:
    """The light and the surface: of a simulation its own, where no option says otherwise."""
    if light not in ILLUMINATIONS:
        raise InputError(f"--light must be one of {', '.join(ILLUMINATIONS)}, got {light!r}")
    medium = measured.medium
    if medium is not None and light != ILLUMINATIONS[0]:
        raise InputError(
            f"--light must be {ILLUMINATIONS[0]} for {measured.source}, which was simulated so, got {light!r}"
        )
    own = _own_index(measured)
    return Setting(light, n if n is not None else 1.0 if own is None else own)


def _noted(measured: Measured, setting: Setting) -> Measured:
    """The data, with a note where a simulation's surface is not the one that is fitted."""
    own = _own_index(measured)
    if own is None or math.isclose(own, setting.n):
        return measured
    return replace(measured, notes=(*measured.notes, f"the file's n is {own:g}, fitted as n = {setting.n:g}"))


def _own_index(measured: Measured) -> float | None:
    """Refractive index of a simulated medium over that above it; None of what was measured."""
    medium = measured.medium
    return None if medium is None else medium.layers[0].n / medium.n_above


def _law(name: str, constants: str, setting: Setting, folder: Path) -> ProfileLaw:
    try:
        return catalogue.load(name, constants, setting, folder)
    except SettingError as error:
        raise SettingError(f"{error}; --n and --light choose one of these") from None


def _question(law: ProfileLaw, measured: Measured, fix: list[str], scale: str, total: str | None) -> Question:
    held: dict[str, float] = {}
    for text in fix:
        match = FIXED.fullmatch(text.strip())
        if match is None:
            raise InputError(f"--fix must be l=LENGTH, alpha=NUMBER or A=NUMBER, got {text!r}")
        name = "l" if match[1] == "l" else "alpha"
        if name in held:
            raise InputError(f"--fix must hold each of l and alpha (or A) once, got {' and '.join(fix)}")
        held[name] = (
            length("--fix l", match[2], measured.unit)
            if name == "l"
            else held_albedo(law, match[1], _number(f"--fix {match[1]}", match[2]))
        )
    known = None
    if scale != FREE:
        known = _known("--scale", scale)
        if known.error == 0:
            held["scale"], known = known.value, None
    return Question(law, held, None if total is None else _total(total), known)


def _total(text: str) -> Known:
    known = _known("--total", text)
    if known.error == 0 or known.value >= 1:
        raise InputError(f"--total must be a reflectance in (0, 1) with its error, such as 0.52+-0.01, got {text!r}")
    return known


def _known(option: str, text: str) -> Known:
    """A number > 0, with or without an error."""
    match = WITH_ERROR.fullmatch(text.strip())
    value = _number(option, match["value"] if match else text)
    error = _number(option, match["error"]) if match else 0.0
    if not value > 0 or error < 0 or (match is not None and error == 0):
        accepted = (
            f"a number > 0, {'free, ' if option == '--scale' else ''}or a number with its error such as 1.0+-0.02"
        )
        raise InputError(f"{option} must be {accepted}, got {text!r}")
    if not SMALLEST <= value <= LARGEST:
        raise InputError(f"{option} must lie between {SMALLEST:g} and {LARGEST:g}, got {text!r}")
    return Known(value, error)


def _number(option: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{option} must be a number, got {text!r}")
    return number
