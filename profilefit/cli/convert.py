"""profilefit convert: one medium in the conventions of papers and engines."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, Any

import typer

from profilefit.cli.options import LIGHTS, LIGHTS_HELP, AsJson, percent, refused
from profilefit.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

UNITS = ("um", "µm", "μm", "mm", "cm", "m", "in")
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*)")
COLOURS = "--alpha, --reflectance with --illumination, or --mu-a with --mu-s"
LENGTH = "Length"  # the panel of --help
WIDTH = 120  # of the tables


def _length(words: str) -> Any:
    return typer.Option(help=words, rich_help_panel=LENGTH)


def convert(
    context: typer.Context,
    alpha: Annotated[str | None, typer.Option(help="Reduced albedo mu_s' / (mu_s' + mu_a), 0 to 1.")] = None,
    reflectance: Annotated[str | None, typer.Option(help="Total diffuse reflectance A (the colour), 0 to 1.")] = None,
    illumination: Annotated[
        str | None, typer.Option(help=f"Illumination of --reflectance and --falloff: {LIGHTS_HELP}.")
    ] = None,
    n: Annotated[float, typer.Option("--n", help="Refractive index of the medium, for A given or printed.")] = 1,
    g: Annotated[float, typer.Option("--g", help="Anisotropy; alpha and mu_s' stay reduced.")] = 0.0,
    mu_a: Annotated[str | None, typer.Option(help="Absorption coefficient, for example 0.1/mm; needs --mu-s.")] = None,
    mu_s: Annotated[str | None, typer.Option(help="Reduced scattering coefficient mu_s', for example 2/mm.")] = None,
    mfp: Annotated[str | None, _length("Transport mean free path 1 / (mu_s' + mu_a).")] = None,
    dmfp: Annotated[str | None, _length("Diffuse mean free path by Grosjean's formula.")] = None,
    dmfp_classical: Annotated[str | None, _length("Diffuse mean free path 1 / sqrt(3 mu_a mu_t').")] = None,
    decay_length: Annotated[str | None, _length("Diffuse mean free path, exact.")] = None,
    falloff: Annotated[str | None, _length("Length d = l / s(A) of normalized diffusion.")] = None,
    falloff_dmfp: Annotated[str | None, _length("Length d = l_d / s(A) of normalized diffusion.")] = None,
    mfp_unreduced: Annotated[str | None, _length("Unreduced mean free path 1 / (mu_s + mu_a).")] = None,
    cycles_radius: Annotated[str | None, _length("Radius x scale of Random Walk in Blender 5.2+.")] = None,
    cycles_legacy_radius: Annotated[
        str | None, _length("Radius x scale of Random Walk in Blender 4.0 to 5.1, (Fixed Radius) in 3.x, (Legacy).")
    ] = None,
    cycles_burley_radius: Annotated[
        str | None, _length("Radius x scale of Christensen-Burley in Blender 3.0+.")
    ] = None,
    cycles_skin_radius: Annotated[
        str | None, _length("Radius x scale of Random Walk (Skin) in Blender 4.0+, Random Walk in 3.x.")
    ] = None,
    hdrp_distance: Annotated[str | None, _length("Scattering Color x Multiplier in Unity HDRP.")] = None,
    hdrp_radius: Annotated[str | None, _length("Max Radius in Unity HDRP.")] = None,
    unreal_mfp: Annotated[str | None, _length("Mean free path color x distance in Unreal 5.1+, rasteriser.")] = None,
    unreal_dmfp: Annotated[str | None, _length("Diffuse mean free path color x distance in Unreal before 5.1.")] = None,
    sources: Annotated[
        bool, typer.Option("--sources", help="List fields, formulas, sources and checks of renderers.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a colour and a length between conventions.

    Prints the medium's optical properties, then the colour and length to type into each renderer, by version. Commas
    separate channels, and a length may have a unit, for example 1.2mm. --json prints a list of channels for each name.

    \b
    Example:
      profilefit convert --reflectance .9,.7,.5 --illumination diffuse --mfp 1.2mm
    """
    from mcml_sim.cli.screen import print_json, put, screen
    from profilefit.convert import Optical, alpha_of
    from profilefit.report.tables.convert_table import content, convert_table

    if illumination is not None and illumination not in LIGHTS:
        raise refused("--illumination", f"one of {', '.join(LIGHTS)}", illumination)
    lengths = [one for one in context.command.params if getattr(one, "rich_help_panel", None) == LENGTH]
    given = {one.opts[0]: text for one in lengths if (text := context.params.get(one.name or "")) is not None}
    got = " and ".join(given) or "none"
    colours = {"--alpha": alpha, "--reflectance": reflectance, "--mu-a": mu_a, "--mu-s": mu_s}
    chosen = [name for name, text in colours.items() if text is not None]
    if chosen not in (["--alpha"], ["--reflectance"], ["--mu-a", "--mu-s"]):
        raise InputError(f"colour must be one of {COLOURS}, got {' and '.join(chosen) or 'none'}")
    if mu_a is not None and mu_s is not None:
        if given:
            raise InputError(f"length must be left out, as --mu-a and --mu-s have one, got {got}")
        per_length = tuple(f"/{unit}" for unit in UNITS)
        absorption, unit = _numbers("--mu-a", mu_a, per_length)
        scattering, other = _numbers("--mu-s", mu_s, per_length)
        if unit != other:
            raise InputError(f"--mu-a and --mu-s must have one unit, got {unit or 'none'} and {other or 'none'}")
        medium, unit = Optical.from_coefficients(absorption, scattering, g), unit.removeprefix("/")
    else:
        if alpha is not None:
            albedo = _shares("--alpha", alpha)
        elif illumination is None:
            raise InputError(f"--illumination must be one of {', '.join(LIGHTS)} with --reflectance, got none")
        else:
            albedo = alpha_of(_shares("--reflectance", reflectance or ""), illumination, n, g)
        if len(given) != 1:
            raise InputError(f"length must be one, such as --mfp 1.2mm, got {got}")
        ((option, text),) = given.items()
        value, unit = _numbers(option, text, UNITS)
        # The falloff depends on the illumination whose A it is paired with.
        paired = f"falloff_{illumination or LIGHTS[0]}"
        name = paired if option == "--falloff" else option.removeprefix("--").replace("-", "_")
        medium = Optical.from_length(name, value, albedo, g)
    if as_json:
        print_json(content(medium, unit, n))
    else:
        put(convert_table(medium, unit, n, sources), screen(WIDTH))


def _shares(option: str, text: str) -> Floats:
    """Return numbers between commas; InputError on a percentage."""
    for word in text.split(","):
        if hint := percent(word):
            raise refused(option, "numbers in [0, 1], between commas", word.strip(), hint)
    return _numbers(option, text)[0]


def _numbers(option: str, text: str, units: tuple[str, ...] = ()) -> tuple[Floats, str]:
    """Return numbers between commas, and their common unit, one of `units` or none."""
    import numpy as np

    numbers, found = [], set()
    for word in text.split(","):
        match = NUMBER.fullmatch(word.strip())
        if match is None or match[2] not in ("", *units):
            accepted = f"numbers, with a unit of {', '.join(units)} or none" if units else "numbers"
            raise refused(option, f"{accepted}, between commas", text)
        if not math.isfinite(number := float(match[1])):
            raise refused(option, "numbers that floating point holds", word)
        numbers.append(number)
        found.add(match[2])
    if len(found - {""}) > 1:
        raise InputError(f"{option} must have one unit, got {', '.join(sorted(found))}")
    return np.array(numbers), max(found)
