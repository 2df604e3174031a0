"""profilefit fit --layers: a stack of layers in place of one half space."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from mcml_sim.cli.lazy import interruptible
from mcml_sim.cli.program import one_line
from profilefit.errors import InputError

if TYPE_CHECKING:
    from mcml_sim import Medium
    from profilefit.measured import Known, Measured
    from profilefit.measured.premises import Premises

FAILED = 1  # exit status


def fit_of_layers(
    measured: Measured,
    file: Path,
    free: str,
    premises: Premises,
    scale: float | Known | None,
    out: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fit, print and write; exit status 1 if the fit fails."""
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes, print_json, screen, show
        from mcml_sim.files.text_file import as_json as json_text
        from mcml_sim.files.whole_file import require_folder, write_whole
        from mcml_sim.runs.progress import working
        from profilefit.measured.layers import fit_layers
        from profilefit.report.tables.layers_fit_tables import layers_content, layers_lines, layers_tables

    medium = _medium(file, measured.unit)
    if out is not None:
        require_folder(out, "fit.json")
    with working("fitting layers", quiet):
        found = fit_layers(measured, medium, [name.strip() for name in free.split(",")], premises, scale)
    body = layers_content(found)
    if out is not None:
        write_whole(out / "fit.json", json_text(body))
        notes(quiet).print(f"wrote fit.json into {out}", markup=False)
    if as_json:
        print_json(body)
    else:
        rows = f"{measured.value.size} {'annuli' if measured.rings else 'points'}"
        title = f"{one_line(measured.source)}: {rows}, {len(medium.layers)} layers, exact light"
        console = screen()
        show(layers_tables(found, title), console)
        for line in layers_lines(found):
            console.print(line, markup=False, emoji=False)
    if found.result != "converged":
        raise typer.Exit(FAILED)


def _medium(file: Path, unit: str) -> Medium:
    """Return the stack of a file, in the data's unit of length."""
    with interruptible(__name__):
        from dataclasses import replace

        from mcml_sim.files.text_file import read_toml
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
