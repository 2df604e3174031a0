"""A measured phase function as text: angle and value, a row each; errors name file and line.

    angle [deg], value [1/(m sr)], sigma [1/(m sr)]      sigma, a standard error, may be left out

Cells are separated by commas; a # starts a comment. Values may have any scale: a density per steradian, 4 pi times
that, or a volume scattering function in 1/(m sr). They are divided by their integral over all directions, which is
then the scattering coefficient b. `Span` says how much of that integral lies at angles without rows.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.phase import Tabulated
from profilefit.errors import InputError

Floats = NDArray[np.float64]
MAX_BYTES = 2**20
MOST_ROWS, FEWEST_ROWS = 5000, 8
DEGREES = ("", "deg", "degrees")
# Of values, and of the factor that brings them to an integral of 1.
UNITS = {"": "", "1/sr": "", "sr^-1": ""}
UNITS |= {text: f"1/{unit}" for unit in ("m", "cm", "mm") for text in (f"1/({unit} sr)", f"{unit}^-1 sr^-1")}
COLUMNS = {"angle": DEGREES, "value": (*UNITS,), "sigma": (*UNITS,)}
HEADING = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?")
ACCEPTED = "angle [deg], value [1/sr] or [1/(m sr)] and, if known, sigma"
LONGEST_SHOWN = 40
LEAST_DEGREES = 7.0  # more than 2 pi: a table that ends before is one in radians
WIDEST = 20.0  # [degrees] between rows; wider gaps are named
MOST_SHARE = 1e3  # beyond which a rule estimates nothing


@dataclass(frozen=True)
class Span:
    """Angles without rows, and how much of a table's integral depends on how they are filled.

    low, high  [degrees];  share  of the integral by the rule of `Tabulated` [-];  rule  in words
    other      the same share by another rule that is as likely [-];  other_rule  in words
    """

    low: float
    high: float
    share: float
    rule: str
    other: float
    other_rule: str


@dataclass(frozen=True)
class PhaseData:
    """Phase function read from a table.

    Attributes:
        source: source of the numbers, in words.
        digest: SHA-256 of their file.
        angles: (n,) [rad], rising, >= 0.
        values: (n,) [1/sr], > 0, brought to an integral of 1.
        sigma: (n,) relative standard errors [-], or None.
        integral: integral of the values as read, in `unit`.
        unit: unit of the integral, 1/m where the values had 1/(m sr), none where they had 1/sr or no unit.
        spans: angles without rows: below the first angle > 0, between rows more than `WIDEST` apart, and beyond the
            last angle.
    """

    source: str
    digest: str
    angles: Floats
    values: Floats
    sigma: Floats | None
    integral: float
    unit: str
    spans: tuple[Span, ...]

    @cached_property
    def table(self) -> Tabulated:
        """The phase function of the rows themselves."""
        return Tabulated(self.angles, self.values)

    @property
    def mean_cosine(self) -> float:
        """Mean cosine of the table [-]."""
        return float(self.table.mean_cosine)

    @property
    def backscattered(self) -> float:
        """Share that is turned by more than 90 degrees [-]."""
        return float(self.table.invert(0.0))

    @property
    def off_axis(self) -> PhaseData:
        """Rows at angles > 0: at 0 degrees forms may be infinite, and ln angle is."""
        seen = self.angles > 0
        sigma = None if self.sigma is None else self.sigma[seen]
        return replace(self, angles=self.angles[seen], values=self.values[seen], sigma=sigma)

    def within(self, low: float, high: float) -> NDArray[np.bool_]:
        """Return a mask (n,) of the rows at angles low ... high [degrees]."""
        degrees = np.degrees(self.angles)
        return (degrees >= low - 1e-9) & (degrees <= high + 1e-9)


def read_phase(path: Path) -> PhaseData:
    """Read the table of a phase function.

    InputError in one line, FILE:LINE: expected ..., got ...
    """
    content = read_whole(path, MAX_BYTES)
    if len(content) > MAX_BYTES:
        raise InputError(f"{path}: expected a phase function of at most {MAX_BYTES} bytes, got a longer file")
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise InputError(f"{path}:{line}: expected text in UTF-8, got the byte {content[error.start]:#04x}") from None
    kept = [(at, line.partition("#")[0].strip()) for at, line in enumerate(lines, start=1)]
    kept = [(at, line) for at, line in kept if line]
    if not kept:
        raise InputError(f"{path}: expected a header of {ACCEPTED}, got an empty file")
    units = _header(path, *kept[0])
    if not FEWEST_ROWS <= len(kept) - 1 <= MOST_ROWS:
        raise InputError(f"{path}: expected {FEWEST_ROWS} to {MOST_ROWS} rows under the header, got {len(kept) - 1}")
    rows = []
    for at, text in kept[1:]:
        cells = [cell.strip() for cell in text.split(",")]
        if len(cells) != len(units):
            raise InputError(f"{path}:{at}: expected {len(units)} cells, as the header has, got {len(cells)}")
        rows.append([_number(path, at, name, cell) for name, cell in zip(units, cells, strict=True)])
    column = dict(zip(units, np.array(rows).T, strict=True))
    degrees, values = column["angle"], column["value"]
    for (at, _), before, angle, value in zip(kept[1:], [-1.0, *degrees[:-1]], degrees, values, strict=True):
        if not 0 <= angle <= 180 or angle <= before:
            raise InputError(f"{path}:{at}: expected an angle in [0, 180] degrees that rises, got {angle:g}")
        if not value > 0:
            raise InputError(f"{path}:{at}: expected a value > 0, got {value:g}")
    if degrees[-1] < LEAST_DEGREES:
        raise InputError(
            f"{path}: expected angles in degrees up to 180, got {degrees[-1]:g} at most: radians times 180 / pi"
        )
    sigma = column.get("sigma")
    if sigma is not None and not np.all(sigma > 0):
        raise InputError(f"{path}:{kept[1 + int(np.argmin(sigma > 0))][0]}: expected a sigma > 0, got {sigma.min():g}")
    angles = np.radians(degrees)
    with np.errstate(over="ignore", invalid="ignore"):
        pieces = Tabulated.through(angles, values)
        integral = pieces.total
    if angles[0] > 0 and pieces.slope[0] <= -1:
        raise InputError(
            f"{path}: expected first rows that rise towards 0 degrees slower than angle^-2, which has an integral, got "
            f"angle^{2 * pieces.slope[0]:.3g}: a row at 0 degrees ends the rise"
        )
    if not 0 < integral < np.inf:
        raise InputError(f"{path}: expected values whose integral is finite and > 0, got {integral:g}")
    return PhaseData(
        str(path),
        hashlib.sha256(content).hexdigest(),
        angles,
        values / integral,
        None if sigma is None else sigma / values,
        integral,
        UNITS[units["value"]],
        _spans(angles, values / integral),
    )


def _spans(angles: Floats, values: Floats) -> tuple[Span, ...]:
    """Spans without rows, of rows (n,) in [rad] and [1/sr] whose integral is 1."""
    u, f, t = 2 * np.sin(angles / 2) ** 2, 2 * np.pi * values, np.linspace(0.0, 1.0, 1001)
    below = Tabulated.through(angles, values).below(u)
    if angles[0] > 0:
        found = [(0.0, angles[0], below[0], "the first rows' power law", u[0] * f[0], "the first value")]
    else:  # a peak is rounded at 0, or it is not and holds less
        sharp = np.trapezoid(f[0] * (f[1] / f[0]) ** t * np.sin(angles[1] * t), angles[1] * t)
        found = [(0.0, angles[1], below[1], "p linear in 1 - cosine", sharp, "ln p linear in the angle")]
    for at in np.flatnonzero((np.diff(angles) > np.radians(WIDEST) + 1e-9) & (angles[:-1] > 0)):
        line = (u[at + 1] - u[at]) * (f[at] + f[at + 1]) / 2
        rules = "ln p linear in ln(1 - cosine)", "p linear in 1 - cosine"
        found.append((angles[at], angles[at + 1], below[at + 1] - below[at], rules[0], line, rules[1]))
    if u[-1] < 2:
        # Noise of two rows side by side would decide the law.
        first = int(np.clip(np.searchsorted(angles, angles[-1] - np.radians(WIDEST) - 1e-9), 1, u.size - 2))
        on, slope = u[-1] * (2 / u[-1]) ** t, np.log(f[-1] / f[first]) / np.log(u[-1] / u[first])
        with np.errstate(over="ignore"):
            power = min(np.trapezoid(f[-1] * (on / u[-1]) ** slope, on), MOST_SHARE)
        found.append(
            (angles[-1], np.pi, 1 - below[-1], "the last value", power, f"the power law of the last {WIDEST:g} degrees")
        )
    return tuple(
        Span(float(np.degrees(low)), float(np.degrees(high)), float(share), rule, float(other), other_rule)
        for low, high, share, rule, other, other_rule in found
    )


def _header(path: Path, at: int, line: str) -> dict[str, str]:
    """Units by the names of columns."""
    units: dict[str, str] = {}
    for cell in line.split(","):
        match = HEADING.fullmatch(cell.strip())
        name = match["name"].strip().lower() if match else ""
        if match is None or name not in COLUMNS or name in units:
            raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {_shown(cell)}")
        units[name] = " ".join((match["unit"] or "").split())
        if units[name] not in COLUMNS[name]:
            accepted = ", ".join(filter(None, COLUMNS[name]))
            raise InputError(f"{path}:{at}: expected {name} in {accepted} or without a unit, got {_shown(units[name])}")
    if "angle" not in units or "value" not in units:
        raise InputError(f"{path}:{at}: expected a header of {ACCEPTED}, got {_shown(line)}")
    if units.get("sigma") and units["sigma"] != units["value"]:
        unit = f"[{units['value']}]" if units["value"] else "none"
        raise InputError(f"{path}:{at}: expected sigma in the unit of value, {unit}, got [{units['sigma']}]")
    return units


def _number(path: Path, at: int, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{path}:{at}: column {name}: expected a finite number, got {_shown(cell)}")
    return number


def _shown(cell: str) -> str:
    text = cell.strip()
    return repr(text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}...")
