"""One medium in the conventions of papers and engines."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcml_sim.cli.screen import print_json, screen
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit import convert as conventions
from profilefit.convert import LENGTHS, Optical
from profilefit.errors import InputError
from profilefit.report.tables.cells import column_table, on_the_point, significant

Floats = NDArray[np.float64]
UNITS = ("um", "µm", "μm", "mm", "cm", "m", "in")
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\D*)")
COLOURS = "--alpha, --reflectance with --illumination, or --mu-a with --mu-s"
DIGITS = 5
NONE = "none"


def convert(
    alpha: str | None,
    reflectance: str | None,
    illumination: str | None,
    mu_a: str | None,
    mu_s: str | None,
    as_json: bool,
    **lengths: str | None,
) -> None:
    """Print the medium of a colour and one of `lengths`, by the names of their options."""
    if illumination is not None and illumination not in ILLUMINATIONS:
        raise InputError(f"--illumination must be one of {', '.join(ILLUMINATIONS)}, got {illumination!r}")
    given = {_length_name(name, illumination): text for name, text in lengths.items() if text is not None}
    colours = {"--alpha": alpha, "--reflectance": reflectance, "--mu-a": mu_a, "--mu-s": mu_s}
    chosen = [name for name, text in colours.items() if text is not None]
    if chosen not in (["--alpha"], ["--reflectance"], ["--mu-a", "--mu-s"]):
        raise InputError(f"colour must be one of {COLOURS}, got {' and '.join(chosen) or 'none'}")
    if mu_a is not None and mu_s is not None:
        medium, unit = _of_coefficients(mu_a, mu_s, given)
    else:
        medium, unit = _of_length(_albedo(alpha, reflectance, illumination), given)
    if as_json:
        print_json(_as_table(medium, unit))
    else:
        _print(medium, unit)


def _albedo(alpha: str | None, reflectance: str | None, illumination: str | None) -> Floats:
    if alpha is not None:
        return _numbers("--alpha", alpha)[0]
    if illumination is None:
        raise InputError(f"--illumination must be one of {', '.join(ILLUMINATIONS)} with --reflectance, got none")
    return conventions.alpha_of(_numbers("--reflectance", reflectance or "")[0], illumination)


def _of_length(alpha: Floats, given: dict[str, str]) -> tuple[Optical, str]:
    if len(given) != 1:
        raise InputError(f"length must be one, such as --mfp 1.2mm, got {_options(given)}")
    ((name, text),) = given.items()
    value, unit = _numbers(_option(name), text, UNITS)
    return Optical.from_length(name, value, alpha), unit


def _of_coefficients(mu_a: str, mu_s: str, given: dict[str, str]) -> tuple[Optical, str]:
    if given:
        raise InputError(f"length must be left out, as --mu-a and --mu-s have one, got {_options(given)}")
    per_length = tuple(f"/{unit}" for unit in UNITS)
    absorption, unit = _numbers("--mu-a", mu_a, per_length)
    scattering, other = _numbers("--mu-s", mu_s, per_length)
    if unit != other:
        raise InputError(f"--mu-a and --mu-s must have one unit, got {unit or 'none'} and {other or 'none'}")
    return Optical.from_coefficients(absorption, scattering), unit.removeprefix("/")


def _length_name(option: str, illumination: str | None) -> str:
    """What `profilefit.convert` calls a length: the falloff depends on the light whose A it is paired with."""
    return f"falloff_{illumination or 'searchlight'}" if option == "falloff" else option


def _option(name: str) -> str:
    """The option that gives this length."""
    parametrised = name in ("falloff_searchlight", "falloff_diffuse")
    return "--falloff" if parametrised else f"--{name.replace('_', '-')}"


def _options(given: dict[str, str]) -> str:
    return " and ".join(_option(name) for name in given) or "none"


def _numbers(option: str, text: str, units: tuple[str, ...] = ()) -> tuple[Floats, str]:
    """Numbers between commas, and the one unit of them all; units are `units`, or none."""
    numbers, found = [], set()
    for word in text.split(","):
        match = NUMBER.fullmatch(word.strip())
        if match is None or match[2] not in ("", *units):
            accepted = f"numbers, with a unit of {', '.join(units)} or none" if units else "numbers"
            raise InputError(f"{option} must be {accepted}, between commas, got {text!r}")
        numbers.append(float(match[1]))
        found.add(match[2])
    if len(found - {""}) > 1:
        raise InputError(f"{option} must have one unit, got {', '.join(sorted(found))}")
    return np.array(numbers), max(found)


@dataclass(frozen=True)
class Row:
    """One convention: its name, what the table says of it, and a value a channel."""

    name: str
    title: str
    light: str  # whose A it is, or is paired with
    power: int  # of the unit of length
    formula: str
    values: Floats


def _rows(medium: Optical) -> list[Row]:
    colour = [
        Row(f"reflectance_{light}", "reflectance A", light, 0, "exact, index-matched", medium.reflectance(light))
        for light in ILLUMINATIONS
    ]
    return [
        Row("alpha", "albedo alpha", "", 0, "mu_s' / (mu_s' + mu_a)", medium.alpha),
        *colour,
        Row("mu_a", "absorption mu_a", "", -1, "(1 - alpha) / l", medium.mu_a),
        Row("mu_s", "reduced scattering mu_s'", "", -1, "alpha / l", medium.mu_s),
        *(Row(one.name, one.title, one.colour, 1, one.formula, medium.length(one.name)) for one in LENGTHS),
    ]


def _as_table(medium: Optical, unit: str) -> dict[str, str | Floats | None]:
    """The rows by name; what a channel has not is not finite."""
    return {"unit": unit or None} | {row.name: row.values for row in _rows(medium)}


def _print(medium: Optical, unit: str) -> None:
    rows = _rows(medium)
    cells = np.array([[_cell(value) for value in row.values] for row in rows])
    columns = {"": [row.title for row in rows]}
    for i in range(cells.shape[1]):
        header = "value" if cells.shape[1] == 1 else f"channel {i + 1}"
        columns[header] = on_the_point(list(cells[:, i]))
    units = {0: "", 1: unit or "length", -1: f"1/{unit or 'length'}"}
    columns |= {
        "unit": [units[row.power] for row in rows],
        "A of": [row.light for row in rows],
        "is": [row.formula for row in rows],
    }
    caption = ["Sources: " + "; ".join(dict.fromkeys(one.source for one in LENGTHS if one.source)) + "."]
    if NONE in cells:
        caption += [f"{NONE}: light that nothing absorbs (alpha = 1) has no diffuse mean free path."]
    table = column_table("One medium in every convention", columns, "\n".join(caption), ("", "unit", "A of"), ("is",))
    screen().print(table)


def _cell(value: float) -> str:
    return significant(value, DIGITS) if math.isfinite(value) else NONE
