"""profilefit convert: one medium in the conventions of papers and engines."""

from __future__ import annotations

from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli.options import AsJson

LENGTH = "Length"  # the panel of --help


@carried_out("profilefit.commands.convert")
def convert(
    alpha: Annotated[str | None, typer.Option(help="Single-scattering albedo mu_s' / (mu_s' + mu_a).")] = None,
    reflectance: Annotated[str | None, typer.Option(help="Total reflectance A, the colour.")] = None,
    illumination: Annotated[
        str | None, typer.Option(help="Light of --reflectance, and of --falloff: searchlight or diffuse.")
    ] = None,
    mu_a: Annotated[
        str | None, typer.Option(help="Absorption coefficient, with --mu-s; colour and length in one.")
    ] = None,
    mu_s: Annotated[str | None, typer.Option(help="Reduced scattering coefficient mu_s'.")] = None,
    mfp: Annotated[str | None, typer.Option(help="Mean free path.", rich_help_panel=LENGTH)] = None,
    dmfp: Annotated[
        str | None, typer.Option(help="Diffuse mean free path (Grosjean's).", rich_help_panel=LENGTH)
    ] = None,
    dmfp_classical: Annotated[
        str | None, typer.Option(help="The same, 1 / sqrt(3 mu_a mu_t').", rich_help_panel=LENGTH)
    ] = None,
    decay_length: Annotated[str | None, typer.Option(help="The same, exact.", rich_help_panel=LENGTH)] = None,
    falloff: Annotated[
        str | None, typer.Option(help="Normalized diffusion's d = l / s(A).", rich_help_panel=LENGTH)
    ] = None,
    falloff_dmfp: Annotated[str | None, typer.Option(help="Its d = l_d / s(A).", rich_help_panel=LENGTH)] = None,
    cycles_radius: Annotated[
        str | None, typer.Option(help="Cycles' radius times scale.", rich_help_panel=LENGTH)
    ] = None,
    cycles_skin_radius: Annotated[
        str | None, typer.Option(help="The same for random walk (skin).", rich_help_panel=LENGTH)
    ] = None,
    hdrp_distance: Annotated[
        str | None, typer.Option(help="Unity HDRP's scattering distance.", rich_help_panel=LENGTH)
    ] = None,
    hdrp_radius: Annotated[str | None, typer.Option(help="Unity HDRP's filter radius.", rich_help_panel=LENGTH)] = None,
    unreal_mfp: Annotated[
        str | None, typer.Option(help="Unreal's mean free path color times distance.", rich_help_panel=LENGTH)
    ] = None,
    unreal_dmfp: Annotated[
        str | None, typer.Option(help="The same before 5.1, a diffuse one.", rich_help_panel=LENGTH)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Convert a colour and a length into every convention.

    Channels are separated by commas; a length may have a unit. --json prints a list of channels for each name.

    \b
    Examples:
      profilefit convert --reflectance .9,.7,.5 --illumination diffuse --mfp 1.2mm
      profilefit convert --alpha 0.95 --dmfp 3mm --json
    """
