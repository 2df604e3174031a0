"""Stacks of layers: laws over thickness and radius, recorded and at the ends of albedos; light scattered once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim import Layer, Medium, Setting
from mcml_sim.media.arrays import Floats
from profilefit.errors import RecordError
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import catalogue
from profilefit.recipes.folder import STACKS, available
from profilefit.recipes.kinds.stack import load
from profilefit.scenes.layers.law import single_scattering
from profilefit.shader.check.bounds import ROUNDING_SHARE
from profilefit.shader.stack_text import single_text, stack_text
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import Cells, Mask, RoundedText, absolute, axis, relative, steps_down
from profilefit.studies.stability.law_cells import MODEL_BOUNDS

PROFILE, CDF, SAMPLE, PDF = cells.QUANTITIES
FLOAT64, TEXT32, MODEL = cells.FLOAT64, cells.TEXT32, cells.MODEL
TOTAL, ENERGY, ONCE = "A(d)", "energy", "L, once"
ROUNDINGS = 16.0  # units in the last place that the largest term of a sum may be off by
BACKWARD = -0.5  # g short of which the text of light scattered once loses digits in float32
OF_LAWS = (
    "none for pictures beyond 99.5 % of the light or below A = 0.001; over black layers and under absorbing ones use "
    "exact.solve, or single_scattering where the first layer is thin"
)
OF_BORROWER = "fit the constants to these layers: stack_law, or profilefit regenerate STACK.toml"
OF_ONCE = "keep g at -0.5 or above; nothing known scatters farther back"
BOTH = (FLOAT64, TEXT32)
UNDRAWN = (PROFILE, CDF, TOTAL)  # of recorded laws in float64: samplers of each of their settings compile for seconds
THICKNESS = (0.0, 1e-6, 1e-4, 1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, 1e3, 1e6)  # [mfp of the first layer]
RADIUS = (1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0, 300.0, 1e3)
SHARE = (0.0, 1e-6, 1e-3, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0 - 2.0**-24)
CHANGES = tuple(np.geomspace(1e-7, 1.0, 15).tolist())  # of xi that another radius may be worth
# What is promised: R_d of all but this share of the light, which is as far as records judge it; densities of radii but
# for this share next to the source as well; all but of what is darker than a thousandth of white.
SEEN, NEXT_TO_SOURCE, DARKEST = 0.995, 1e-4, 1e-3
MOST_XI = 1.0 - 2.0**-24  # of which the text draws the farthest radius
ORDINARY = (0.01, 3e-3, 2e-3)  # errors of recorded laws: none is allowed more rounding than a tenth of these
# Of densities, what the inverses of half spaces make of them, which go by steps; that is more farther out than `SEEN`,
# and in their own cells.
OF_STEPS = 3e-3
NO_DIGITS = "extended precision has no digits of it"
NEAREST, FARTHEST, POINTS = 1e-9, 1e3, 2000  # of the integral of R_d [mfp]: its ends, and nodes, even in ln r
ENERGY_BOUND = 1e-4  # of that integral
BOUNDS = (MODEL_BOUNDS[PROFILE], MODEL_BOUNDS[CDF], 0.03)  # of R_d, cdf, A: what a picture shows at once
# What `stack_law` gives at the ends of albedos, diffuse light, n = 1.4, l alike: of the first layer and of what lies
# below, the largest rel, ks and error of A at thicknesses between the fitted ones, and the nine constants.
ENDS: tuple[tuple[float, float, tuple[float, ...], tuple[float, ...]], ...] = (
    (0.3, 0.9, (0.023, 0.0072, 0.011), (0.3727, -0.1035, 0.6363, 1.287, 1.645, 3.023, 0.01889, 1.312, 0.001297)),
    (0.05, 0.99, (0.066, 0.032, 0.077), (0.5339, 0.2473, 0.2421, 0.7563, 1.576, 1.751, 3.399, 0.5817, 2.399e-05)),
    (0.9, 1 - 1e-6, (0.0065, 0.0019, 0.007), (0.04453, -0.0511, 1.585, 1.414, 0.9201, 1.033, 4.258, 1.292, 0.2189)),
    (0.99, 0.1, (0.065, 0.045, 0.026), (0.526, -0.2106, 0.8038, 55.55, 0.01873, 0.1349, 0.6059, 3.87, 2.226)),
    (0.9, 0.0, (0.32, 0.082, 0.19), (0.557, -0.8766, 2.964, 1.221, 0.07459, 0.1353, 2.462e-06, 1.378, 1.216e-05)),
    (1 - 1e-6, 0.999, (0.005, 0.0025, 0.0002),
     (0.9337, -0.0002761, 1.418, 1.284, 0.004419, 0.0009545, 0.007687, 1.338, 0.4432)),
    (1 - 1e-6, 0.5, (0.025, 0.013, 0.015),
     (0.9905, -0.001405, 1.056, 1.438, 4.655e-05, 0.01147, 0.8126, 1.658, 0.8786)),
    (1 - 1e-6, 0.0, (0.28, 0.084, 0.14),
     (0.9929, -0.002392, 0.9386, 1.221, 0.01733, 0.1353, 8.647e-05, 1.249, 3.278)),
    (1.0, 0.5, (0.025, 0.014, 0.016), (0.9994, -8.088e-05, 1.056, 1.436, 4.647e-05, 0.01146, 0.8121, 1.659, 0.8803)),
)  # fmt: skip
# Light scattered once: index, cosines, optical depth of the first layer, g, albedo below, cosine of the azimuth.
INDICES = (1.0, 1.4, 2.0)
COSINES = (1e-6, 1e-4, 1e-3, 0.01, 0.1, 0.3, 0.6, 0.9, 1.0)
DEPTHS = (1e-6, 1e-4, 1e-3, 0.01, 0.1, 1.0, 10.0, 100.0, 1e6)
FORWARD, BELOW, TURNED = (-0.95, -0.5, 0.0, 0.5, 0.8, 0.95), (0.0, 0.1, 0.8), (-1.0, 0.0, 1.0)
# Of a formula that is exact: in float64 what 1 less Fresnel's reflectance keeps of light that grazes, in float32 what
# a dozen roundings and 1 - g do.
ONCE_BOUNDS = {FLOAT64: 1e-9, TEXT32: 1e-5}


@dataclass(frozen=True)
class StackCase:
    """Law of a stack: errors rel, ks and of A, as it states of itself [-]; own, whether it was fitted to its layers."""

    label: str
    law: StackLaw
    errors: tuple[float, ...]
    own: bool = True

    @property
    def holds(self) -> bool:
        """Whether something is promised of it: not where its errors show at once."""
        return self.own and all(error <= bound for error, bound in zip(self.errors, BOUNDS, strict=True))

    def bound(self, quantity: str) -> float:
        """Return a tenth of the law's own error, or of a recorded law's, where that is less."""
        rel, ks, of_a = (ROUNDING_SHARE * min(pair) for pair in zip(self.errors, ORDINARY, strict=True))
        return {PROFILE: rel, PDF: OF_STEPS, TOTAL: of_a}.get(quantity, ks)

    @cached_property
    def reference(self) -> RoundedText:
        """Shader source of the law in extended precision."""
        return self.text(cells.EXTENDED)

    def text(self, dtype: type) -> RoundedText:
        return RoundedText(stack_text([self.law] * len(CHANNELS), "python", cells.NAME), dtype)

    def judged(self, name: str, arithmetic: str, *given: Any, **more: Any) -> Cells:
        """Return cells over the arguments of a quantity, given value, reference, error, bound and inside."""
        advice = OF_LAWS if self.own else OF_BORROWER
        across = axis("ξ", SHARE) if name == SAMPLE else axis("r/l", RADIUS)
        axes = (axis("d/l", THICKNESS), *(() if name in (TOTAL, ENERGY) else (across,)))
        return Cells(self.label, self.own, name, arithmetic, axes, *given, **{"advice": advice, **more})


def cells_of(folder: Path) -> Iterator[Cells]:
    """Yield laws of recorded stacks, at the ends of albedos, and of borrowed constants; light scattered once."""
    recorded, ends = list(recorded_stacks(folder)), [end(*row) for row in ENDS]
    for one in recorded:
        yield energies(one)
        yield from of_law(one, FLOAT64, UNDRAWN)
        yield from of_law(one, TEXT32)
    for one in (*ends, borrower()):
        yield energies(one)
        for arithmetic in BOTH:
            yield from of_law(one, arithmetic)
    for group in (recorded, ends):
        if group:
            yield from stated(group, promised=group is recorded)
    yield from (once(n, arithmetic) for n in INDICES for arithmetic in BOTH)


def recorded_stacks(folder: Path) -> Iterator[StackCase]:
    """Yield the laws of a folder's stacks, one a colour."""
    for name, path in available(folder / STACKS).items():
        loaded = load(path)
        for channel, law in zip(CHANNELS, loaded.laws, strict=True):
            try:
                parts = loaded.content["interfaces"][channel]["quality"]
                errors = [max(abs(v) for each in parts for v in each[key]) for key in ("rel", "ks", "delta_A")]
            except (KeyError, TypeError, ValueError):
                raise RecordError(f"{path}: is damaged: its quality has no numbers; regenerate it") from None
            yield StackCase(f"{name}, {channel}", law, tuple(errors))


def end(first: float, below: float, errors: Sequence[float], constants: Sequence[float]) -> StackCase:
    """Return the law of a row of `ENDS`."""
    setting = Setting("diffuse", n=1.4)
    hazard = catalogue.load("hazard", setting=setting)
    top, under = (LayerLaw(setting, hazard, alpha, 1.0) for alpha in (first, below))
    law = StackLaw(setting, top, under, 1.0, **dict(zip(StackLaw.constant_names(), constants, strict=True)))
    return StackCase(f"α {first:.7g} on {below:.7g}", law, tuple(errors))


def borrower() -> StackCase:
    """Return a law whose albedos were changed after its constants, those of the first of `ENDS`, were fitted."""
    one = end(0.99, 0.5, *ENDS[0][2:])
    return replace(one, label=f"{one.label}, constants of {ENDS[0][0]:g} on {ENDS[0][1]:g}", own=False)


def cancelled(law: StackLaw, thickness: Floats, radius: Floats, value: Floats, bound: float) -> Mask:
    """Return where R_d is so much less than its terms that their rounding exceeds the bound in extended precision.

    thickness (n, 1), radius (m,)  [length of the law]
    """
    largest = _largest(law, thickness, radius)
    with np.errstate(divide="ignore"):
        depth = np.abs(np.log(largest * law.top.mfp**2))  # e^-t has as many roundings as t
    rounded = (ROUNDINGS + np.where(np.isfinite(depth), depth, 0.0)) * float(np.finfo(cells.EXTENDED).eps) * largest
    lost: Mask = np.abs(value) * bound < rounded
    return lost


def _largest(law: StackLaw, d: Floats | float, r: Floats) -> Floats:
    """Return the largest term of R_d at thicknesses and radii [length]: R_1, the image, or one of a stack below."""
    unit = law.top.mfp
    height, rate = law.h0 * unit + law.h1 * np.asarray(d), float(law.decay()) + law.k0 / unit
    s = np.hypot(r, height)
    image = float(law.top.whole()) * height * (1.0 + rate * s) * np.exp(-rate * (s - height)) / (2.0 * np.pi * s**3)
    largest = np.maximum(np.asarray(law.top.profile(r)), image)
    if isinstance(law.below, StackLaw):
        inner = _largest(law.below, law.below.thickness, np.hypot(r, law.g2 * np.asarray(d)))
        largest = np.maximum(largest, np.exp(-law.b2 * np.asarray(d) / unit) * inner)
    return largest


def of_law(case: StackCase, arithmetic: str, names: Sequence[str] = (*UNDRAWN, SAMPLE, PDF)) -> Iterator[Cells]:
    """Yield quantities over thickness and radius or uniform number."""
    dtype, law, unit, channel = cells.DTYPES[arithmetic], case.law, case.law.top.mfp, np.zeros(1)

    def rounded(values: Sequence[float], scale: float = 1.0) -> Floats:
        return (np.array(values) * scale).astype(dtype).astype(float)

    d, r, xi = rounded(THICKNESS, unit)[:, None], rounded(RADIUS, unit), rounded(SHARE)
    text = case.text(np.float32) if arithmetic == TEXT32 else None
    python = {**cells.functions_of(law), TOTAL: law.total}
    whole, within = (np.asarray(case.reference.call(*of, channel, d), float) for of in (("total",), ("cdf", r)))
    for name in names:
        called, given = ("total", ()) if name == TOTAL else (name, (xi if name == SAMPLE else r,))
        reference = np.asarray(case.reference.call(called, *given, channel, d), float)
        value = python[name](*given, d) if text is None else text.call(called, *given, channel, d)
        value = np.asarray(value, float)
        if name == TOTAL:  # whose ends are known
            ends = np.select([d == 0, d == d[-1]], [law.below.whole(), law.top.whole()], reference)
            value, reference = value[:, 0], ends[:, 0]
        if name == SAMPLE:
            error = _misplaced(case.reference, value, xi, d)
        else:
            error = absolute(value, reference) if name == CDF else relative(value, reference)
        if name == PROFILE:  # NaN where extended precision has no digits of it
            places = unit * np.array(THICKNESS)[:, None], unit * np.array(RADIUS)
            error[cancelled(law, *places, reference, case.bound(name))] = np.nan
        yield _cells(case, name, arithmetic, (value, reference, error), whole, within)


def _cells(
    case: StackCase, name: str, arithmetic: str, triple: tuple[Floats, Floats, Floats], whole: Floats, within: Floats
) -> Cells:
    """Return cells of value, reference and error; whole is A (thicknesses, 1), within the cdf (thicknesses, radii)."""
    dtype, (value, reference, _) = cells.DTYPES[arithmetic], triple
    first, below = (float(each.whole()) for each in (case.law.top, case.law.below))
    seen = within <= SEEN if name in (PROFILE, PDF) else np.ones(value.shape, bool)
    bright = (whole[:, 0] if name == TOTAL else whole) >= DARKEST
    inside = seen & bright & case.holds & (within >= NEXT_TO_SOURCE if name == PDF else True)
    more: dict[str, Any] = {"judge": seen if name == PDF else True, "unjudged": NO_DIGITS}
    if name in (PROFILE, PDF):
        scaled = np.abs(reference) * case.law.top.mfp ** (2 if name == PROFILE else 1)
        more["dim"] = (scaled < cells.DIMMEST[dtype]) & (reference != 0)
    elif name == CDF:  # light over A: A may be far less than what it is the difference of
        scale = max(first, below) / np.maximum(whole, np.finfo(dtype).tiny)
        more["wrong_way"] = steps_down(value, 1, dtype, scale)
    elif name == TOTAL:
        more["wrong_way"] = steps_down(value * np.sign(first - below), 0, dtype, max(first, below))
    return case.judged(name, arithmetic, *triple, case.bound(name), inside, **more)


def _misplaced(reference: RoundedText, value: Floats, xi: Floats, d: Floats) -> Floats:
    """Return the least change of xi, of `CHANGES`, between whose radii, less and more, the drawn one lies [-].

    Where one part of the light ends in between, and with it its radii, every radius lies there.
    """
    least, channel = np.full(value.shape, np.inf), np.zeros(1)
    own = reference.call("sample", xi, channel, d)
    for change in reversed(CHANGES):
        less, more = (reference.call("sample", np.clip(xi + step, 0.0, 1.0), channel, d) for step in (-change, change))
        ends = (less > own) | (own > more) | (xi + change >= MOST_XI)
        least[ends | ((xi <= change) | (less <= value)) & (value <= more)] = change
    return least


def energies(case: StackCase) -> Cells:
    """Return the integral of 2 pi r R_d to the last radius over A by the text, which the closed cdf gives as well."""
    unit, text, channel = case.law.top.mfp, case.text(np.float64), np.zeros(1)
    u, step = np.linspace(np.log(NEAREST), np.log(FARTHEST), POINTS, retstep=True)
    r, d = unit * np.exp(u), unit * np.array(THICKNESS)[:, None]
    ring = 2.0 * np.pi * r**2 * text.call("profile", r, channel, d)
    whole = np.asarray(text.call("total", channel, d))[:, 0]
    reference = np.asarray(text.call("cdf", r[-1:], channel, d))[:, 0]
    light = (np.sum(ring, axis=1) - 0.5 * (ring[:, 0] + ring[:, -1])) * step
    value = np.where(whole > 0, light / np.where(whole > 0, whole, 1.0), reference)
    error, inside = absolute(value, reference), (whole >= DARKEST) & case.holds
    return case.judged(ENERGY, FLOAT64, value, reference, error, ENERGY_BOUND, inside)


def stated(group: Sequence[StackCase], promised: bool) -> Iterator[Cells]:
    """Yield what laws state of themselves against exact light, at thicknesses that were not fitted."""
    axes = (cells.labelled("of", (one.label for one in group)),)
    errors = np.array([one.errors for one in group]).T
    for name, bound, error in zip((PROFILE, CDF, TOTAL), BOUNDS, errors, strict=True):
        yield Cells("stacks", True, name, MODEL, axes, error, np.zeros(()), error, bound, promised, advice=OF_LAWS)


def once(n: float, arithmetic: str) -> Cells:
    """Return light scattered once: over g, what lies below, thickness, both directions and the angle between them."""
    dtype = cells.DTYPES[arithmetic]
    values = [np.array(each).astype(dtype).astype(float) for each in (DEPTHS, COSINES, COSINES, TURNED)]
    axes = axis("g", FORWARD), axis("μs/μt below", BELOW), *map(axis, ("d/l", "cos in", "cos out", "turned"), values)
    depth, into, out, turned = np.meshgrid(*values, indexing="ij", sparse=True)
    value, reference = np.empty((2, *(one.values.size for one in axes)))
    for i, g in enumerate(FORWARD):
        source = single_text([_two(n, g, alpha, 1.0) for alpha in BELOW], "python", cells.NAME)
        extended, text = RoundedText(source, cells.EXTENDED), RoundedText(source, np.float32)
        for j, alpha in enumerate(BELOW):
            given = (np.array(float(j)), depth, into, out, turned)  # a channel an albedo
            reference[i, j] = extended.call("radiance", *given)
            if arithmetic == TEXT32:
                value[i, j] = text.call("radiance", *given)
                continue
            for k, d in enumerate(DEPTHS):
                value[i, j, k] = single_scattering(_two(n, g, alpha, d), into[0], out[0], np.arccos(turned[0]))
    forward = np.array(FORWARD).reshape(-1, *[1] * (len(axes) - 1)) >= BACKWARD
    given = (value, reference, relative(value, reference), ONCE_BOUNDS[arithmetic], forward | (arithmetic != TEXT32))
    return Cells(f"light scattered once, n = {n:g}", True, ONCE, arithmetic, axes, *given, advice=OF_ONCE)


def _two(n: float, g: float, below: float, depth: float) -> Medium:
    return Medium((Layer(n, 0.1, 0.9, g, depth), Layer(n, 1.0 - below, below, g)))
