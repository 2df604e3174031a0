"""profilefit photo: photographs of a laser spot, and the medium behind it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from profilefit.cli.options import AsJson, Quiet, percent, refused, require_left_out
from profilefit.errors import InputError

if TYPE_CHECKING:
    from profilefit.measured import Known

FAILED = 1  # exit status
SEVERAL = ("--card", "--grey", "--dark")


class SeveralFiles(TyperCommand):
    """Command with options that take several files, as a shell expands card-*.dng."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments with the option repeated before each of its files."""
        written: list[str] = []
        option: str | None = None
        for at, one in enumerate(args):
            if one in SEVERAL:
                option = one
                if at + 1 == len(args) or args[at + 1].startswith("-"):
                    written.append(one)
            elif one.startswith("-"):
                option = one.partition("=")[0] if one.startswith(tuple(f"{name}=" for name in SEVERAL)) else None
                written.append(one)
            else:
                written.extend([one] if option is None else [option, one])
        return super().parse_args(ctx, written)


def photo(
    context: typer.Context,
    shots: Annotated[
        list[Path] | None,
        typer.Argument(metavar="SHOT", help="Exposures of a bracket: raw files, linear 16-bit TIFF or EXR."),
    ] = None,
    card: Annotated[list[Path] | None, typer.Option(help="Exposures of the beam on a white opaque card.")] = None,
    grey: Annotated[
        list[Path] | None, typer.Option(help="Exposures of the beam on a grey card, with the spot's exposure times.")
    ] = None,
    dark: Annotated[list[Path] | None, typer.Option(help="Frames with the lens covered.")] = None,
    scale: Annotated[
        str | None,
        typer.Option(help="Image scale: 0.05mm/px, two points of a ruler X,Y:X,Y=10mm, or a marker's side aruco:20mm."),
    ] = None,
    beam: Annotated[
        str | None, typer.Option(help="1/e² radius of the beam with its error (0.5mm+-0.05mm), or fwhm:0.6mm+-0.06mm.")
    ] = None,
    surface: Annotated[
        str, typer.Option(help="Share of the light that the surface scatters, with its error.")
    ] = "0.01+-0.01",
    glare: Annotated[
        str, typer.Option(help="Share of the light that the lens scatters, with its error.")
    ] = "0.02+-0.02",
    reflectance: Annotated[str, typer.Option(help="Reflectance of the grey card, with its error.")] = "0.18+-0.005",
    n: Annotated[float, typer.Option(help="Refractive index of the medium.")] = 1.4,
    g: Annotated[float, typer.Option(help="Anisotropy of the medium.")] = 0.8,
    simulate: Annotated[
        Path | None,
        typer.Option(help="File SETUP.toml of photographs to simulate into --out, with Cramér-Rao bounds."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the page, photo.json, medium.glsl and figures.")] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Measure a medium from photographs of a laser spot.

    Merges a bracket of exposures, and fits radial bins about the spot by the exact solution, each colour separately. A
    white card gives beam and glare, a grey card the scale. The result includes the Cramér-Rao bound of each error. Exit
    status 1 if a fit fails. In a clone, pip install ".\\[photo]" installs the libraries.

    \b
    Example, on a file of profilefit examples:
      profilefit photo --simulate examples/photo.toml --out shots
    """
    from mcml_sim.cli.screen import answer
    from mcml_sim.files.whole_file import require_folder, write_whole
    from mcml_sim.media.setting import Setting
    from mcml_sim.runs.progress import working
    from profilefit.measured.photo.medium import Beliefs
    from profilefit.measured.photo.workflow import photo as measured
    from profilefit.report.figures.fit_figures import rings_figure, spot_figure
    from profilefit.report.page.photo import diffuse_law, medium_text, photo_page
    from profilefit.report.tables.fit_tables import photo_content, photo_lines, photo_tables

    if simulate is not None:
        used = {"simulate", "out", "as_json", "quiet", "shots"}
        require_left_out(context, (name for name in context.params if name not in used), "photographs are simulated")
        _simulate(simulate, shots or [], out, as_json, quiet)
        return
    if not shots:
        raise InputError("SHOT must be a photograph, or several of a bracket, got none")
    if scale is None:
        raise InputError("--scale must be given: 0.05mm/px, a ruler's two points X,Y:X,Y=10mm, or aruco:20mm, got none")
    if grey is None:
        require_left_out(context, ("reflectance",), "there is no --grey card")
    beliefs = Beliefs(
        beam=None if beam is None else _known("--beam", beam, lengths=True),
        surface=_known("--surface", surface), glare=_known("--glare", glare),
    )  # fmt: skip
    setting = Setting(n=n, g=g)
    if out is not None:
        require_folder(out, "medium.glsl", "photo.html", "photo.json", make=False)
    law = None if out is None else diffuse_law(setting)
    with working("measuring", quiet):
        measurement = measured(
            shots, scale, card or [], grey or [], dark or [], setting, beliefs,
            _known("--reflectance", reflectance),
        )  # fmt: skip
    note = ""
    if out is not None and law is not None:  # after photographs that cannot be measured, which leave no folder
        require_folder(out)
        text = medium_text(measurement, law)
        figures = [*spot_figure(measurement, out), *rings_figure(measurement, out)]
        write_whole(out / "medium.glsl", text)
        write_whole(out / "photo.html", photo_page(measurement, out, text))
        note = f"wrote photo.html, photo.json, medium.glsl and {len(figures)} figures into {out}"
    tables, lines = photo_tables(measurement), photo_lines(measurement)
    answer(photo_content(measurement), tables, lines, as_json, out, "photo.json", note, quiet)
    if not all(one.converged for one in measurement.fits.values()):
        raise typer.Exit(FAILED)


def _simulate(file: Path, shots: list[Path], out: Path | None, as_json: bool, quiet: bool) -> None:
    from mcml_sim.cli.screen import answer, notes
    from mcml_sim.files.whole_file import require_folder
    from mcml_sim.runs.progress import working
    from profilefit.measured.photo.setup import fisher_bounds, read_setup, room, written
    from profilefit.report.tables.fit_tables import setup_tables

    if shots:
        raise InputError("SHOT must be left out where photographs are simulated")
    if out is None:
        raise InputError("--out must be a folder for the simulated photographs, got none")
    setup = read_setup(file)
    require_folder(out, room=room(setup))
    with working("simulating", quiet):
        bounds = fisher_bounds(setup)
        files = written(setup, out)
    notes(quiet).print(f"wrote {len(files)} photographs into {out}", markup=False)
    answer(bounds, setup_tables(bounds), as_json=as_json)


def _known(option: str, text: str, lengths: bool = False) -> Known:
    """Return a value and its error from 0.18+-0.005, or from a length [mm] with optional fwhm: before it."""
    from profilefit.cli.fit import WITH_ERROR
    from profilefit.measured import Known
    from profilefit.measured.data import BY_FWHM, FWHM, length

    is_fwhm = lengths and text.strip().lower().startswith(FWHM)
    match = WITH_ERROR.fullmatch(text.strip()[len(FWHM) if is_fwhm else 0 :])
    example = "0.5mm+-0.05mm or fwhm:0.6mm+-0.06mm" if lengths else "0.02+-0.02"
    hint = "" if lengths else percent(text)
    parts = match.group("value", "error") if match else ("", "")
    try:
        value, error = (length(option, part, "mm") if lengths else float(part) for part in parts)
    except ValueError:
        raise refused(option, f"a value with its error, such as {example}", text, hint) from None
    most, accepted = (1e6, "> 0") if lengths else (1.0, "between 0 and 1")
    if not (0 < value < most and 0 < error < most):
        raise refused(option, f"a value {accepted} with an error {accepted}", text, hint)
    factor = BY_FWHM if is_fwhm else 1.0
    return Known(factor * value, factor * error)
