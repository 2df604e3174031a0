"""profilefit fit: measured data, and the medium that fits them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcml_sim.cli.program import one_line
from profilefit.cli import options
from profilefit.cli.options import AsJson, Fits, Quiet, percent, records_folder, refused
from profilefit.errors import InputError, SettingError
from profilefit.laws import PROFILES

if TYPE_CHECKING:
    from mcml_sim import Medium
    from profilefit.measured import Known, Measured
    from profilefit.measured.model import Oblique
    from profilefit.measured.premises import Premises

FAILED = 1  # exit status
FIXED = re.compile(r"(l|alpha|A)\s*=\s*(.+)")
WITH_ERROR = re.compile(r"(?P<value>[^±]+?)\s*(?:±|\+-)\s*(?P<error>.+)")
FREE = "free"
PROFILE, PHASE = KINDS = ("profile", "phase")
OF_HALF_SPACE = ("law", "constants", "fix", "total", "oblique", "n", "g", "seed")
FIGURES = tuple(f"fit-{name}.{kind}" for name in ("residuals", "corner") for kind in ("png", "svg"))
PAIR = re.compile(r"([0-9.]+)\s*:\s*([0-9.]+)")


def fit(
    context: typer.Context,
    data: Annotated[
        Path, typer.Argument(help="Table (.csv, .tsv, .txt), .mco or .npz file; with --kind phase, petzold is shipped.")
    ],
    kind: Annotated[str, typer.Option(help="Kind of data: profile, or phase for a phase function.")] = PROFILE,
    law: Annotated[
        str, typer.Option(help=f"Profile model: exact, or one of {', '.join(PROFILES)}.", autocompletion=options.fitted)
    ] = options.EXACT,
    constants: Annotated[
        str,
        typer.Option(
            help="Set of constants: regenerated, published, corrected, or a record's path (.json).",
            autocompletion=options.constants,
        ),
    ] = "regenerated",
    fix: Annotated[
        list[str] | None, typer.Option(help="Fixed value, for example l=1.2mm, alpha=.9 or A=.8; may be repeated.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of r, if the header has none, one of nm, um, mm, cm, m, inch.")
    ] = None,
    colour: Annotated[str | None, typer.Option(help="Colour of a TLS850's file: red, green or blue.")] = None,
    scale: Annotated[
        str, typer.Option(help="Values divided by R_d: a number, a number with its error (1.0+-0.02), or free.")
    ] = "1",
    total: Annotated[
        str | None,
        typer.Option(
            help="Measured total diffuse reflectance A with its error, for example 0.52+-0.01.", metavar="A+-ERROR"
        ),
    ] = None,
    oblique: Annotated[
        str | None,
        typer.Option(
            help="Oblique beam's angle in air in degrees, a circle's radius, and the distance of the circle's centre "
            "from the entry, for example 45:4mm:0.52mm+-0.01mm.",
            metavar="ANGLE:R:D",
        ),
    ] = None,
    light: Annotated[
        str | None,
        typer.Option(
            help=f"Illumination: {options.LIGHTS_HELP}.", show_default=f"the file's, else {options.LIGHTS[0]}"
        ),
    ] = None,
    beam: Annotated[
        str | None,
        typer.Option(
            help="1/e² radius of a Gaussian beam (0.5mm), its range (0.3mm:0.7mm), fwhm:0.6mm, tophat:0.5mm or a .csv.",
            show_default="a pencil beam",
        ),
    ] = None,
    fibre: Annotated[str | None, typer.Option(help="Core radius of the detecting fibre, for example 0.2mm.")] = None,
    n: Annotated[
        str | None,
        typer.Option(help="Refractive index, or its range 1.33:1.45.", show_default="the file's, else 1"),
    ] = None,
    g: Annotated[
        str | None,
        typer.Option(help="Anisotropy, or its range 0.7:0.95.", show_default="the file's, else 0"),
    ] = None,
    layers: Annotated[
        Path | None,
        typer.Option(help="File STACK.toml of layers to fit, in place of a semi-infinite medium (minutes)."),
    ] = None,
    free: Annotated[
        str | None, typer.Option(help="Free values of the layers: d1, mu_a2, mu_s2, ...", metavar="NAME,NAME")
    ] = None,
    r_min: Annotated[str | None, typer.Option(help="Smallest radius that is fitted, for example 0.5mm.")] = None,
    r_max: Annotated[str | None, typer.Option(help="Largest radius that is fitted, for example 20mm.")] = None,
    angles: Annotated[
        str | None,
        typer.Option(help="Range of fitted angles in degrees, with --kind phase, for example 1:180.", metavar="A:B"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for fit.json and figures.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the Markov chains, >= 0.")] = 0,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit A, alpha and l to measured data, with errors.

    Also reports mu_s', mu_a, and values that the data do not identify. A table has columns r, value and sigma. Columns
    value1, value2, ... are replicates, and r_in, r_out in place of r are annuli. Values are light per area and per
    incident light. Comments such as "# n = 1.4" state light, n, g, beam, fibre or unit. With --kind phase the columns
    are angle (degrees), value and sigma, and phase functions are fitted (a minute). Exit status 1 if the fit fails.

    \b
    Example, on a file of profilefit examples:
      profilefit fit examples/phantom.csv --out phantom
    """
    from mcml_sim.cli.screen import answer
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import working
    from profilefit.measured import fit as medium_of
    from profilefit.measured import read
    from profilefit.measured.data import length
    from profilefit.measured.premises import premises
    from profilefit.measured.result import content
    from profilefit.report.tables.fit_tables import fit_lines, fit_tables

    if kind not in KINDS:
        raise refused("--kind", f"{PROFILE} or {PHASE}", kind)
    if kind == PHASE:
        _fit_phase(context, data, angles, out, as_json, quiet)
        return
    if angles is not None:
        raise InputError("--angles must be left out where --kind is not phase")
    if seed < 0:
        raise refused("--seed", "a whole number >= 0", seed)
    folder = records_folder(fits, quiet)
    measured = read(data, unit, scale == FREE, colour)
    ends = (("--r-min", r_min), ("--r-max", r_max))
    measured = measured.within(*(None if text is None else length(name, text, measured.unit) for name, text in ends))
    given = {"light": light, "n": n, "g": g, "beam": beam, "fibre": fibre}
    where = premises(measured, law, given, {name: f"--{name}" for name in given})
    held = _held(fix or [], measured.unit)
    known = None if total is None else _total(total)
    factor = _scale(scale)
    oblique_centre = None if oblique is None else _oblique(oblique, measured.unit)
    if layers is not None:
        options.require_left_out(context, OF_HALF_SPACE, "--layers say what is fitted")
        _fit_layers(measured, layers, free or "", where, factor, out, as_json, quiet)
        return
    if free is not None:
        raise InputError("--free must be left out where there are no --layers")
    if out is not None:
        require_folder(out, "fit.json", *FIGURES)
    try:
        with working("fitting", quiet):
            result = medium_of(
                measured, law, constants, where, held, known, factor, seed, folder=folder, oblique=oblique_centre
            )
    except SettingError as error:
        raise SettingError(f"{error}; --n, --g and --light choose one of these") from None
    model = "exact light" if law == options.EXACT else f"law {law}"
    title = f"{one_line(data.name)}: {_rows(measured)}, {model}, {result.fit.spec.law.setting}"
    note = ""
    if out is not None:
        from profilefit.report.figures.fit_figures import posterior_figure, residual_figure

        figures = [*residual_figure(result, out), *posterior_figure(result, out)]
        note = f"wrote fit.json and {len(figures)} figures into {out}"
    lines = [options.in_options(line.plain) for line in fit_lines(result)]
    answer(options.in_options(content(result)), fit_tables(result, title), lines, as_json, out, "fit.json", note, quiet)
    if result.identifiability is None:
        raise typer.Exit(FAILED)


def _rows(measured: Measured) -> str:
    return f"{measured.value.size} {'annuli' if measured.rings else 'points'}"


def _fit_phase(
    context: typer.Context, data: Path, angles: str | None, out: Path | None, as_json: bool, quiet: bool
) -> None:
    """Fit every form of a phase function to a table, print and write; exit status 1 if the fit fails."""
    from mcml_sim.cli.screen import answer
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import working
    from profilefit.recipes.kinds.phase import content, fits_of, request
    from profilefit.recipes.phases import ALL_ANGLES, read_phase
    from profilefit.report.kinds import phase_tables, premise_lines

    accepted = {"data", "kind", "angles", "out", "as_json", "quiet"}
    options.require_left_out(context, (name for name in context.params if name not in accepted), f"--kind is {PHASE}")
    table = read_phase(request(str(data)) or data)
    if out is not None:
        require_folder(out, "fit.json")
    low, high = ALL_ANGLES
    if angles is not None:
        match = PAIR.fullmatch(angles.strip())
        low, high = (_number("--angles", match[at]) for at in (1, 2)) if match else (1.0, 0.0)
        if not 0 <= low < high <= 180:
            raise refused("--angles", "two rising angles in 0 ... 180 degrees, such as 1:180", angles)
    with working("fitting", quiet):
        body = content(table, fits_of(table, (low, high)))
    answer(body, phase_tables(body), premise_lines(body), as_json, out, "fit.json", quiet=quiet)
    if body["fit"]["result"] != "converged":
        raise typer.Exit(FAILED)


def _fit_layers(
    measured: Measured,
    file: Path,
    free: str,
    premises: Premises,
    scale: float | Known | None,
    out: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fit layers in place of one semi-infinite medium, print and write; exit status 1 if the fit fails."""
    from mcml_sim.cli.screen import answer
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import working
    from profilefit.measured.layers import fit_layers
    from profilefit.report.tables.fit_tables import layers_content, layers_lines, layers_tables

    medium = _medium(file, measured.unit)
    if out is not None:
        require_folder(out, "fit.json")
    with working("fitting layers", quiet):
        fit = fit_layers(measured, medium, [name.strip() for name in free.split(",")], premises, scale)
    title = f"{one_line(measured.source)}: {_rows(measured)}, {len(medium.layers)} layers, exact light"
    tables, lines = layers_tables(fit, title), layers_lines(fit)
    answer(layers_content(fit), tables, lines, as_json, out, "fit.json", quiet=quiet)
    if fit.result != "converged":
        raise typer.Exit(FAILED)


def _medium(file: Path, unit: str) -> Medium:
    """Return the stack of a file, converted to the data's unit of length."""
    from dataclasses import replace

    from mcml_sim.files.whole_file import read_toml
    from profilefit.measured.data import factor
    from profilefit.recipes.stack.file import read_layers

    stack = read_layers(file, read_toml(file))
    if not stack.is_grey or stack.map is not None:
        raise InputError(f"{file}: expected one number each for mu_a, mu_s and thickness, got colours or an image")
    if not unit:
        raise InputError("--unit must be given where the data have none, since the layers have one")
    times = factor(stack.unit, unit)
    layers = (
        replace(one, mu_a=one.mu_a / times, mu_s=one.mu_s / times, thickness=one.thickness * times)
        for one in stack.media[0].layers
    )
    return replace(stack.media[0], layers=tuple(layers))


def _held(fix: list[str], unit: str) -> dict[str, float]:
    """Return the values that `--fix` sets: alpha or A, and l."""
    from profilefit.measured.data import length

    held: dict[str, float] = {}
    for text in fix:
        match = FIXED.fullmatch(text.strip())
        if match is None:
            raise refused("--fix", "l=LENGTH, alpha=NUMBER or A=NUMBER", text)
        name, value, option = match[1], match[2], f"--fix {match[1]}"
        if name in held or {"alpha", "A"} <= {name, *held}:
            raise InputError(f"--fix must hold each of l and alpha (or A) once, got {' and '.join(fix)}")
        if name != "l" and (hint := percent(value)):
            raise refused(option, "a number in (0, 1)", value, hint)
        held[name] = length(option, value, unit) if name == "l" else _number(option, value)
    return held


def _scale(text: str) -> float | Known | None:
    """Return the value of `--scale`: None if free, a number, or one with its error."""
    if text == FREE:
        return None
    known = _known("--scale", text)
    return known if known.error else known.value


def _total(text: str) -> Known:
    accepted = "a reflectance in (0, 1) with its error, such as 0.52+-0.01"
    if hint := percent(text):
        raise refused("--total", accepted, text, hint)
    known = _known("--total", text)
    if known.error == 0 or known.value >= 1:
        raise refused("--total", accepted, text)
    return known


def _oblique(text: str, unit: str) -> Oblique:
    from profilefit.measured.data import length
    from profilefit.measured.model import Oblique

    angle, r, shift = text.split(":") if text.count(":") == 2 else ("", "", "")
    match = WITH_ERROR.fullmatch(shift.strip())
    if match is None:
        accepted = "an angle in degrees, a radius and a shift with its error, such as 45:4mm:0.52mm+-0.01mm"
        raise refused("--oblique", accepted, text)
    degrees = _number("--oblique's angle", angle)
    if not 0 < degrees < 90:
        raise InputError(f"--oblique's angle must lie between 0 and 90 degrees, got {angle!r}")
    values = (("radius", r), ("shift", match["value"]), ("error", match["error"]))
    return Oblique(degrees, *(length(f"--oblique's {name}", one, unit) for name, one in values))


def _known(option: str, text: str) -> Known:
    """Return a number > 0, with or without an error."""
    from profilefit.measured import Known
    from profilefit.measured.data import LARGEST, SMALLEST

    match = WITH_ERROR.fullmatch(text.strip())
    value = _number(option, match["value"] if match else text)
    error = _number(option, match["error"]) if match else 0.0
    if not value > 0 or error < 0 or (match is not None and error == 0):
        free = "free, " if option == "--scale" else ""
        raise refused(option, f"a number > 0, {free}or a number with its error such as 1.0+-0.02", text)
    if not SMALLEST <= value <= LARGEST or error > LARGEST:
        raise refused(option, f"between {SMALLEST:g} and {LARGEST:g}", text)
    return Known(value, error)


def _number(option: str, text: str) -> float:
    from mcml_sim.media.arrays import as_number

    number = as_number(text)
    if not math.isfinite(number):
        raise refused(option, "a number", text)
    return number
