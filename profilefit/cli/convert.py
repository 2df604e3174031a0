"""profilefit convert: one medium in the conventions of papers and engines."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli.options import LIGHTS, LIGHTS_HELP, AsJson, percent
from profilefit.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from profilefit.convert import Optical

    Floats = NDArray[np.float64]

UNITS = ("um", "µm", "μm", "mm", "cm", "m", "in")
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*)")
COLOURS = "--alpha, --reflectance with --illumination, or --mu-a with --mu-s"
LENGTH = "Length"  # the panel of --help
WIDTH = 120  # of the tables


def convert(
    alpha: Annotated[str | None, typer.Option(help="Single-scattering albedo mu_s' / (mu_s' + mu_a).")] = None,
    reflectance: Annotated[str | None, typer.Option(help="Total reflectance A, the colour.")] = None,
    illumination: Annotated[str | None, typer.Option(help=f"Of --reflectance and --falloff: {LIGHTS_HELP}.")] = None,
    n: Annotated[float, typer.Option("--n", help="Refractive index of the surface that A is of.")] = 1.0,
    g: Annotated[float, typer.Option("--g", help="Mean cosine of scattering; alpha and mu_s' stay reduced.")] = 0.0,
    mu_a: Annotated[
        str | None, typer.Option(help="Absorption coefficient, with --mu-s; colour and length in one.")
    ] = None,
    mu_s: Annotated[str | None, typer.Option(help="Reduced scattering coefficient mu_s'.")] = None,
    mfp: Annotated[
        str | None, typer.Option(help="Transport mean free path 1 / (mu_s' + mu_a).", rich_help_panel=LENGTH)
    ] = None,
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
    mfp_unreduced: Annotated[
        str | None, typer.Option(help="Mean free path 1 / (mu_s + mu_a).", rich_help_panel=LENGTH)
    ] = None,
    cycles_radius: Annotated[
        str | None, typer.Option(help="Blender 5.2+: radius x scale of Random Walk.", rich_help_panel=LENGTH)
    ] = None,
    cycles_legacy_radius: Annotated[
        str | None,
        typer.Option(help="Random Walk of 4.0 to 5.1, (Fixed Radius) of 3.x, (Legacy).", rich_help_panel=LENGTH),
    ] = None,
    cycles_burley_radius: Annotated[
        str | None, typer.Option(help="Blender 3.0+: Christensen-Burley.", rich_help_panel=LENGTH)
    ] = None,
    cycles_skin_radius: Annotated[
        str | None,
        typer.Option(help="Blender 4.0+: Random Walk (Skin); 3.x: Random Walk.", rich_help_panel=LENGTH),
    ] = None,
    hdrp_distance: Annotated[
        str | None, typer.Option(help="Unity HDRP: Scattering Color x Multiplier.", rich_help_panel=LENGTH)
    ] = None,
    hdrp_radius: Annotated[str | None, typer.Option(help="Unity HDRP: Max Radius.", rich_help_panel=LENGTH)] = None,
    unreal_mfp: Annotated[
        str | None,
        typer.Option(help="Unreal 5.1+, rasteriser: mean free path color x distance.", rich_help_panel=LENGTH),
    ] = None,
    unreal_dmfp: Annotated[
        str | None, typer.Option(help="The same before 5.1, a diffuse one.", rich_help_panel=LENGTH)
    ] = None,
    sources: Annotated[
        bool, typer.Option("--sources", help="List fields, formulas, sources and checks of renderers, too.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Convert a colour and a length into every convention.

    Prints the medium's own quantities, then the colour and the length to type into each renderer, by version. Channels
    are separated by commas; a length may have a unit. --json prints a list of channels for each name.

    \b
    Examples:
      profilefit convert --reflectance .9,.7,.5 --illumination diffuse --mfp 1.2mm
      profilefit convert --alpha 0.95 --dmfp 3mm --json
      profilefit convert --alpha 0.95 --n 1.4 --g 0.8 --mfp 1mm --sources
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, put, screen
        from profilefit.report.tables.convert_table import content, convert_table

    lengths = {
        "mfp": mfp,
        "dmfp": dmfp,
        "dmfp_classical": dmfp_classical,
        "decay_length": decay_length,
        # The falloff depends on the illumination whose A it is paired with.
        f"falloff_{illumination or LIGHTS[0]}": falloff,
        "falloff_dmfp": falloff_dmfp,
        "mfp_unreduced": mfp_unreduced,
        "cycles_radius": cycles_radius,
        "cycles_legacy_radius": cycles_legacy_radius,
        "cycles_burley_radius": cycles_burley_radius,
        "cycles_skin_radius": cycles_skin_radius,
        "hdrp_distance": hdrp_distance,
        "hdrp_radius": hdrp_radius,
        "unreal_mfp": unreal_mfp,
        "unreal_dmfp": unreal_dmfp,
    }
    if illumination is not None and illumination not in LIGHTS:
        raise InputError(f"--illumination must be one of {', '.join(LIGHTS)}, got {illumination!r}")
    given = {name: text for name, text in lengths.items() if text is not None}
    colours = {"--alpha": alpha, "--reflectance": reflectance, "--mu-a": mu_a, "--mu-s": mu_s}
    chosen = [name for name, text in colours.items() if text is not None]
    if chosen not in (["--alpha"], ["--reflectance"], ["--mu-a", "--mu-s"]):
        raise InputError(f"colour must be one of {COLOURS}, got {' and '.join(chosen) or 'none'}")
    if mu_a is not None and mu_s is not None:
        medium, unit = _of_coefficients(mu_a, mu_s, given, g)
    else:
        medium, unit = _of_length(_albedo(alpha, reflectance, illumination, n, g), given, g)
    if as_json:
        print_json(content(medium, unit, n))
    else:
        put(convert_table(medium, unit, n, sources), screen(WIDTH))


def _albedo(alpha: str | None, reflectance: str | None, illumination: str | None, n: float, g: float) -> Floats:
    if alpha is not None:
        return _shares("--alpha", alpha)
    if illumination is None:
        raise InputError(f"--illumination must be one of {', '.join(LIGHTS)} with --reflectance, got none")
    with interruptible(__name__):
        from profilefit.convert import alpha_of

    return alpha_of(_shares("--reflectance", reflectance or ""), illumination, n, g)


def _shares(option: str, text: str) -> Floats:
    """Return numbers between commas, none of them a percent."""
    for word in text.split(","):
        if hint := percent(word):
            raise InputError(f"{option} must be numbers in [0, 1], between commas, got {word.strip()!r}{hint}")
    return _numbers(option, text)[0]


def _of_length(alpha: Floats, given: dict[str, str], g: float) -> tuple[Optical, str]:
    with interruptible(__name__):
        from profilefit.convert import Optical

    if len(given) != 1:
        raise InputError(f"length must be one, such as --mfp 1.2mm, got {_options(given)}")
    ((name, text),) = given.items()
    value, unit = _numbers(_option(name), text, UNITS)
    return Optical.from_length(name, value, alpha, g), unit


def _of_coefficients(mu_a: str, mu_s: str, given: dict[str, str], g: float) -> tuple[Optical, str]:
    with interruptible(__name__):
        from profilefit.convert import Optical

    if given:
        raise InputError(f"length must be left out, as --mu-a and --mu-s have one, got {_options(given)}")
    per_length = tuple(f"/{unit}" for unit in UNITS)
    absorption, unit = _numbers("--mu-a", mu_a, per_length)
    scattering, other = _numbers("--mu-s", mu_s, per_length)
    if unit != other:
        raise InputError(f"--mu-a and --mu-s must have one unit, got {unit or 'none'} and {other or 'none'}")
    return Optical.from_coefficients(absorption, scattering, g), unit.removeprefix("/")


def _option(name: str) -> str:
    """Return the command-line option that sets a length."""
    parametrised = name in ("falloff_searchlight", "falloff_diffuse")
    return "--falloff" if parametrised else f"--{name.replace('_', '-')}"


def _options(given: dict[str, str]) -> str:
    return " and ".join(_option(name) for name in given) or "none"


def _numbers(option: str, text: str, units: tuple[str, ...] = ()) -> tuple[Floats, str]:
    """Numbers between commas, and the one unit of them all; units are `units`, or none."""
    with interruptible(__name__):
        import numpy as np

        from mcml_sim.media.checks import shown

    numbers, found = [], set()
    for word in text.split(","):
        match = NUMBER.fullmatch(word.strip())
        if match is None or match[2] not in ("", *units):
            accepted = f"numbers, with a unit of {', '.join(units)} or none" if units else "numbers"
            raise InputError(f"{option} must be {accepted}, between commas, got {shown(text)}")
        if not math.isfinite(number := float(match[1])):
            raise InputError(f"{option} must be numbers that floating point holds, got {shown(word)}")
        numbers.append(number)
        found.add(match[2])
    if len(found - {""}) > 1:
        raise InputError(f"{option} must have one unit, got {', '.join(sorted(found))}")
    return np.array(numbers), max(found)
