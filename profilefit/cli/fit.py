"""profilefit fit: one's own data, and the medium that they tell of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.cli import words
from profilefit.cli.options import AsJson, Fits, Quiet
from profilefit.laws import PROFILES


@carried_out("profilefit.commands.fit")
def fit(
    data: Annotated[Path, typer.Argument(help="A table (.csv, .tsv, .txt), an .mco of MCML, or an .npz of mcml-sim.")],
    law: Annotated[str, typer.Option(help=f"One of {', '.join(PROFILES)}.", autocompletion=words.laws)] = "hazard",
    constants: Annotated[
        str,
        typer.Option(
            help="regenerated, a printed set (published, corrected) or a record's path (.json).",
            autocompletion=words.constants,
        ),
    ] = "regenerated",
    fix: Annotated[
        list[str] | None, typer.Option(help="Hold l=1.2mm, alpha=.9 or A=.8 (total reflectance); may be repeated.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of r, if the header has none: nm, um, mm, cm, m, inch.")
    ] = None,
    scale: Annotated[
        str, typer.Option(help="What the values are multiplied by: a number, 1.0+-0.02 if known so well, or free.")
    ] = "1",
    total: Annotated[
        str | None, typer.Option(help="Total reflectance, if measured too, such as 0.52+-0.01.", metavar="A+-ERROR")
    ] = None,
    light: Annotated[str, typer.Option(help=f"{' or '.join(ILLUMINATIONS)}.")] = ILLUMINATIONS[0],
    n: Annotated[
        float | None, typer.Option(help="Refractive index of the medium.", show_default="the file's, else 1")
    ] = None,
    r_min: Annotated[str | None, typer.Option(help="Leave out what is nearer to the beam, such as 0.5mm.")] = None,
    r_max: Annotated[str | None, typer.Option(help="Leave out what is farther.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for fit.json and the figures.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the posterior's walkers, >= 0.")] = 0,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Fit A, alpha and l to your own data, with errors.

    That is mu_s' and mu_a, from a measured or simulated profile; and what it cannot tell. A table has columns r, value,
    sigma; or r, value1, value2, value3, ... of replicates; or r_in, r_out instead of r for averages over rings. Values
    are light per area and per incident light, unless the scale is free. Exit status 1 if they give no medium.

    \b
    Examples, on the files of profilefit examples:
      profilefit fit examples/phantom.csv --out phantom
      profilefit fit examples/phantom.csv --law burley --scale free --json
    """
