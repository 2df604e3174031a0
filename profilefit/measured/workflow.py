"""From a file to a judged fit in one call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.laws import profile_classes
from profilefit.measured.data import Measured
from profilefit.measured.exact_light import EXACT, exact_light
from profilefit.measured.fitting import fitted
from profilefit.measured.law_error import origin
from profilefit.measured.model import Light
from profilefit.measured.oblique import Oblique
from profilefit.measured.premises import Premises, premises
from profilefit.measured.problem import FitSpec, Known, held_albedo
from profilefit.measured.reading import read
from profilefit.measured.result import MediumPosterior, judged
from profilefit.recipes import catalogue

HOLDABLE = ("alpha", "A", "l")


def fit(
    data: Measured | Path | str,
    law: str = EXACT,
    constants: str = "regenerated",
    setting: Setting | Premises | None = None,
    held: Mapping[str, float] | None = None,
    total: Known | None = None,
    scale: float | Known | None = 1.0,
    seed: int = 0,
    walk: bool = True,
    folder: Path | None = None,
    oblique: Oblique | None = None,
) -> MediumPosterior:
    """Fit a medium to a measured or simulated profile, and judge the fit.

    data       a file (see `reading.read`), or what was read from one, for instance `within` some radii
    law        "exact": light solved exactly; or a law's name, and which constants, as for `catalogue.load`
    setting    illumination, surface and scattering, or all that is known of these and of the beam (`premises`); by
               default what the file states, else "searchlight" (a pencil beam, normal, collimated), n = 1 and g = 0
    held       fixed quantities: alpha or A [-], l [unit of the data]
    total      the total reflectance A [-], if that was measured too
    scale      the values are light times this: a number, one that is known to within an error, or None if unknown
    seed       of the posterior's walkers; walk whether to sample it: else intervals are of the statistical error alone
    folder     of the records, by default the ones shipped
    oblique    the centre of a circle of the same medium's light, where a beam fell in aslant

    InputError, SettingError or RecordError for input that cannot be fitted; a fit that fails is returned with its reason.
    """
    measured = data if isinstance(data, Measured) else read(Path(data), scaled=scale is None)
    records = folder or catalogue.fits_folder()
    told = Premises(setting) if isinstance(setting, Setting) else setting or premises(measured, law)
    where = told.setting
    if measured.illumination not in (None, where.illumination):
        got = f"{measured.illumination} light, got {where.illumination} light to fit"
        raise InputError(f"{measured.source}: a simulation of {got}")
    if oblique is not None and where.illumination != Setting().illumination:
        raise InputError(f"oblique light must be a {Setting().illumination}, got {where.illumination} light to fit")
    measured = _noted(measured, where, told.notes)
    chosen = _light(law, constants, where, records)
    known = scale if isinstance(scale, Known) else None
    spec = FitSpec(
        chosen, _held(chosen, held or {}, scale), total, known, oblique, told.instrument, told.ranges, told.assumed
    )
    return judged(fitted(measured, spec, origin(law, constants, chosen.setting, records)), seed, walk)


def _light(law: str, constants: str, setting: Setting, folder: Path) -> Light:
    if law == EXACT:
        if constants != "regenerated":
            raise InputError(f"constants must be left out where light is solved exactly, got {constants!r}")
        return exact_light(setting)
    if law not in profile_classes() and not law.startswith("gaussians:"):
        raise InputError(f"law must be one of {', '.join((EXACT, *catalogue.names()))}, got {law!r}")
    return catalogue.load(law, constants, setting, folder)


def _noted(measured: Measured, setting: Setting, notes: tuple[str, ...]) -> Measured:
    """Return the data with more notes, one where a simulation's surface is not the one that is fitted."""
    if measured.n is not None and not math.isclose(measured.n, setting.n):
        notes = (*notes, f"the file's n is {measured.n:g}, fitted as n = {setting.n:g}")
    return replace(measured, notes=(*measured.notes, *notes))


def _held(law: Light, held: Mapping[str, float], scale: float | Known | None) -> dict[str, float]:
    """The coordinates that stay, by name."""
    if unknown := [name for name in held if name not in HOLDABLE]:
        raise InputError(f"held must name some of {', '.join(HOLDABLE)}, got {unknown[0]!r}")
    if {"alpha", "A"} <= set(held):
        raise InputError("held must have one of alpha and A, which say the same, got both")
    for name, value in held.items():
        if name == "l":
            _positive("held l", value)
        else:
            held_albedo(law, name, value)
    if scale is None or isinstance(scale, Known):
        return {**held}
    return {**held, "scale": _positive("scale", scale)}


def _positive(name: str, value: float) -> float:
    if not value > 0:
        raise InputError(f"{name} must be a number > 0, got {value!r}")
    return value
