"""Check of a source where it runs: float32 of a law or map against its float64 and against the exact half space.

Every law is held to its own model error: rounding below a tenth of it, the errors of the record met by the GPU's own
numbers, and nothing that is no number, infinite, negative or goes the wrong way where the law says that it holds.

Each text of a law is also translated line by line into numpy and run in float64, where rounding is out of sight. What
half precision costs, of what is stored in it and of computing in it where the driver can, informs and breaks nothing:
engines store albedo textures and results in float16 and compute in float32.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import moderngl
import numpy as np

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from profilefit.fitting.quality import ENERGY_WITHIN, MEASURES, NEAREST, profile_quality
from profilefit.laws.base import ProfileLaw, Range
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.pipelines import inversion_error
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds, dense_grid
from profilefit.shader.check.bounds import ALBEDOS, MODEL_FACTOR, ROUNDING_SHARE, ULP, Bound, Mask, ModelError
from profilefit.shader.check.dense_grid import XI, Arguments, Count, ShaderCheck, Spread, bad_numbers
from profilefit.shader.check.shader_law import ShaderLaw, ShaderMap, Values, half_extension
from profilefit.shader.emit import Numbers, translated

# Half the width of the difference quotient, of xi or 1 - xi: its error is a hundred-millionth, rounding's less.
STEP = 1e-4
INNER = Range(1e-4, 1.0 - 1e-5, open_low=True, open_high=True)  # shares whose difference quotients have a part's slope
HALVINGS = 50
LEAST_SHARE = 1e-9  # of a part of the light, which is rounding in a black medium


class Twin:
    """The numpy twin of a text with names of that prefix."""

    def __init__(self, name: str, text: str) -> None:
        self._names: dict[str, Any] = {}
        exec(compile(translated(text, "python"), f"{name}.py", "exec"), self._names)
        self._name = name

    def radius(self, xi: Floats, alpha: Floats) -> Floats:
        """Return x = r/l at xi, as the shader source draws it."""
        shape = self._names[f"{self._name}_shape"](alpha)
        return np.asarray(self._names[f"{self._name}_radius"](xi, shape))

    def mismatch(self, shader: ShaderLaw, alpha: Floats, lowest: float = 0.0) -> Spread | None:
        """|P_pdf dx/dxi - 1| of the GPU's P_pdf at the radii of the text's own map, where one xi draws a radius.

        alpha  (m,) [-]; lowest the least xi that is judged [-]
        Where light is drawn in two parts the density is that of both: the other part's xi is searched for.
        """
        if alpha.size == 0:
            return None
        inner = INNER.holds(XI) & (lowest < XI)
        xi, albedo = np.broadcast_arrays(XI[None, :], alpha[:, None])
        x = self.radius(xi, albedo)
        share = np.broadcast_to(_jump(shader.law, alpha)[:, None], x.shape)
        low, high = np.where(xi < share, 0.0, share), np.where(xi < share, share, 1.0)
        density, held = 1.0 / self._slope(xi, albedo, low, high), _single(x)
        if np.any(share < 1.0):
            first, last = np.where(xi < share, share, 0.0), np.where(xi < share, 1.0, share)
            other = self._searched(x, albedo, first, last)
            both = last - first > LEAST_SHARE
            with np.errstate(divide="ignore", invalid="ignore"):  # of a part that is none
                density = density + np.where(both, 1.0 / self._slope(other, albedo, first, last), 0.0)
                held = INNER.holds((xi - low) / (high - low)) & (~both | INNER.holds((other - first) / (last - first)))
        error = np.abs(shader.values(x, xi, albedo).pdf / density - 1.0)
        at = Arguments(albedo, x, xi, np.array(1.0))
        return dense_grid.spread(error, held & inner, at, of_share=True)

    def _slope(self, xi: Floats, alpha: Floats, low: Floats, high: Floats) -> Floats:
        """Return dx/dxi, between the ends of what a part is drawn at."""
        rest = np.minimum(xi - low, high - xi)
        return (self.radius(xi + STEP * rest, alpha) - self.radius(xi - STEP * rest, alpha)) / (2.0 * STEP * rest)

    def _searched(self, x: Floats, alpha: Floats, low: Floats, high: Floats) -> Floats:
        """Return xi between low and high at which x is drawn, found by bisection."""
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = self.radius(middle, alpha) < x
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return 0.5 * (low + high)


def _single(x: Floats) -> Mask:
    """Return a mask of xi whose radius no other xi of the grid draws."""
    found = np.zeros(x.shape, bool)
    earlier, later = np.maximum.accumulate(x, axis=1), np.minimum.accumulate(x[:, ::-1], axis=1)[:, ::-1]
    found[:, 1:-1] = (x[:, 1:-1] > earlier[:, :-2]) & (x[:, 1:-1] < later[:, 2:])
    return found


def _jump(law: ProfileLaw, alpha: Floats) -> Floats:
    """Return xi at which the law's source begins at x = 0 anew, 1 where it does not."""
    with jax.enable_x64(True):
        return np.asarray(dense_grid.drawn_by(law).jump(jnp.asarray(alpha)), float)


PROFILE, EVERYWHERE, CDF, SAMPLE, PDF, OWN = "R_d", "R_d everywhere", "cdf", "sample", "pdf", "pdf of the map"
JUDGED = {"rel": PROFILE, "ks": CDF, "inversion_error": SAMPLE}


@dataclass(frozen=True)
class LawCheck(ShaderCheck):
    """Findings on one law: `rel`, `ks` and `inversion_error`, and the errors of float32.

    Attributes:
        spreads: float32 errors by name. R_d and pdf are relative, over the range of `rel` or wherever a float32 holds
            them; cdf is absolute. Sample is the share between the radii of float32 and float64; pdf of the map is
            compared with the pdf of the shader source.
    """

    spreads: dict[str, Spread]


def check_laws(context: moderngl.Context, laws: Sequence[LoadedLaw], folder: Folder) -> Iterator[LawCheck]:
    """Check one law after the other, while other threads evaluate the next ones in float64."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        at = dense_grid.arguments()
        references = pool.map(lambda loaded: dense_grid.reference(loaded.law, at), laws)
        for loaded, known in zip(laws, references, strict=True):
            yield check_law(context, loaded, folder, exact=known)


def check_law(
    context: moderngl.Context, loaded: LoadedLaw, folder: Folder, text: str = "", exact: Values | None = None
) -> LawCheck:
    """Check a profile law with its constants. ShaderError if it does not compile.

    text   in place of its own; exact  the law in float64 on the grid, where that is known already
    """
    model, valid = bounds.model_of_profile(loaded, folder), bounds.valid_profile(loaded, folder)
    shader, at = ShaderLaw(context, loaded.law, text), dense_grid.arguments()
    found = shader.values(at.r, at.xi, at.alpha, at.mfp)
    with np.errstate(all="ignore"):  # what is no number is counted, not warned of
        right = exact or dense_grid.reference(loaded.law, at)
        both = bounds.masks(valid, dense_grid.ALPHA, dense_grid.XI)
        profiled, drawn = (np.broadcast_to(mask, at.shape) for mask in both)
        spreads, rounding = _rounding(loaded.law, found, right, at, profiled, drawn)
        judged = dense_grid.ALPHA[drawn.any(axis=(1, 2))]
        own = Twin(shader.name, shader.text).mismatch(shader, judged, valid.xi.low)
    if own is not None:
        spreads[OWN] = own
    jump = _jump(loaded.law, at.alpha)
    inside = dense_grid.counted(found, at, profiled, drawn, jump)
    everywhere = np.ones(at.shape, bool)
    outside = dense_grid.counted(found, at, everywhere, everywhere, jump).less(inside)
    measured = _measured(shader, loaded, model)
    limits = _limits(model, rounding, measured, spreads)
    limits += [bad_numbers(inside), *bounds.promised_by_profile(loaded, folder)]
    return LawCheck(loaded, model, rounding, measured, inside, outside, tuple(limits), spreads)


def _rounding(
    law: ProfileLaw, found: Values, right: Values, at: Arguments, profiled: Mask, drawn: Mask
) -> tuple[dict[str, Spread], Numbers]:
    """Errors that float32 alone makes: of all that is judged, and as `rel`, `ks` and `inversion_error`, at worst."""
    seen = (at.x >= NEAREST) & (right.cdf <= ENERGY_WITHIN)  # where `rel` looks
    tells = profiled & (right.profile * at.mfp**2 > dense_grid.DIMMEST) & np.isfinite(right.profile)
    dense = drawn.any(axis=1, keepdims=True) & (right.pdf * at.mfp > dense_grid.DIMMEST) & np.isfinite(right.pdf)
    profile = np.abs(found.profile / right.profile - 1.0)
    cdf = np.abs(found.cdf - right.cdf)
    # The share of the energy between the radii of float32 and float64, of the part that both are of.
    radii = np.where(found.sample >= 0, found.sample, np.inf), right.sample
    mine, there = (np.asarray(dense_grid.drawn_by(law).undone(r, at.xi, at.alpha, at.mfp)) for r in radii)
    sample = np.abs(mine - there)
    spreads = {
        PROFILE: dense_grid.spread(profile, tells & seen, at),
        EVERYWHERE: dense_grid.spread(profile, tells, at),
        CDF: dense_grid.spread(cdf, profiled, at),
        SAMPLE: dense_grid.spread(sample, drawn, at, of_share=True),
        PDF: dense_grid.spread(np.abs(found.pdf / right.pdf - 1.0), dense & seen, at),
    }
    used = tells & seen
    means = np.sum(np.where(used, profile, 0.0), axis=1) / np.maximum(np.sum(used, axis=1), 1)
    worst = (means, np.where(profiled, cdf, 0.0), np.where(drawn, sample, 0.0))
    rounding = {name: float(np.max(values)) for name, values in zip(bounds.PROFILE_MEASURES, worst, strict=True)}
    return {name: spread for name, spread in spreads.items() if spread is not None}, rounding


def _measured(shader: ShaderLaw, loaded: LoadedLaw, model: ModelError) -> Numbers:
    """Return the errors of the GPU's numbers against the exact half space, for the measures with a model error."""
    found = Numbers()
    if not loaded.setting.is_solved:
        return found
    if model.get("rel") is not None:
        quality = profile_quality(shader, ALBEDOS)  # type: ignore[arg-type]  # it asks for no more than there is
        found |= {measure: MEASURES[measure].worst(getattr(quality, measure)) for measure in ("rel", "ks")}
    if model.get("inversion_error") is not None:
        found["inversion_error"] = float(np.max(inversion_error(shader, ALBEDOS)))
    return found


def _of_model(model: ModelError, rounding: Numbers, measured: Numbers, places: dict[str, str]) -> list[Bound]:
    found = []
    for name, value in model.values.items():
        found.append(Bound(f"float32 {name}", rounding[name], ROUNDING_SHARE * value, places.get(name, "")))
        if name in measured:
            found.append(Bound(f"{name} against the exact half space", measured[name], MODEL_FACTOR * value))
    return found


def _limits(model: ModelError, rounding: Numbers, measured: Numbers, spreads: dict[str, Spread]) -> list[Bound]:
    places = {name: spreads[of].where for name, of in JUDGED.items() if of in spreads}
    found = _of_model(model, rounding, measured, places)
    rel, ks = model.get("rel"), model.get("ks")
    if SAMPLE in spreads and ks is not None and model.get("inversion_error") is None:  # as good as the cdf it inverts
        name = "float32 inversion_error"
        found.append(Bound(name, rounding["inversion_error"], ROUNDING_SHARE * ks, spreads[SAMPLE].where))
    if OWN in spreads and rel is not None:
        found.append(Bound(f"{OWN}, 99 % of it", spreads[OWN].most, ROUNDING_SHARE * rel, spreads[OWN].where))
    return found


# Even in A, and even in sqrt(1 - alpha) as `quality.albedo_quality`: both as the GPU sees them.
REFLECTANCE = np.linspace(0.0, 1.0, 2001).astype(np.float32).astype(np.float64)
ALPHA = (1.0 - np.linspace(1.0, 0.0, 1001) ** 2).astype(np.float32).astype(np.float64)
STEPS = 4  # of ULP that a falling alpha or A may be rounding


@dataclass(frozen=True)
class MapCheck(ShaderCheck):
    """Findings on one map: `delta_A` and `delta_alpha`, and where their rounding is largest, in words."""

    places: dict[str, str]


def check_map(context: moderngl.Context, loaded: LoadedLaw, folder: Folder, text: str = "") -> MapCheck:
    """Check a map with its constants; `text` in place of its own. ShaderError if it does not compile."""
    model = bounds.model_of_map(loaded, folder)
    of_reflectance, of_alpha = bounds.valid_map(loaded, folder)
    shader, law = ShaderMap(context, loaded.law, text), loaded.law
    alpha, reflectance = shader.alpha(REFLECTANCE), shader.reflectance(ALPHA)
    a, c = of_alpha.holds(ALPHA), of_reflectance.holds(REFLECTANCE)
    with np.errstate(all="ignore"):  # what is no number is counted, not warned of
        of_a, of_c = np.abs(reflectance - law.reflectance(ALPHA))[a], np.abs(alpha - law.alpha(REFLECTANCE))[c]
    rounding = {"delta_A": float(np.max(of_a)), "delta_alpha": float(np.max(of_c))}
    places = {
        "delta_A": f"α {ALPHA[a][np.argmax(of_a)]:.4g}",
        "delta_alpha": f"A {REFLECTANCE[c][np.argmax(of_c)]:.4g}",
    }
    measured = _map_measured(shader, of_alpha)
    inside = _map_counted(alpha, reflectance, of_reflectance, of_alpha)
    outside = _map_counted(alpha, reflectance, Range(), Range()).less(inside)
    limits = _of_model(model, rounding, measured, places)
    limits += [bad_numbers(inside), *bounds.promised_by_map(loaded)]
    return MapCheck(loaded, model, rounding, measured, inside, outside, tuple(limits), places)


def _map_measured(shader: ShaderMap, of_alpha: Range) -> Numbers:
    """Largest errors against the exact half space, for albedos below 1 where the map holds [-]."""
    if not shader.setting.is_solved:
        return {}
    alpha = ALPHA[of_alpha.holds(ALPHA)]
    truth = np.asarray(exact.reflectance(alpha, setting=shader.setting))
    return {
        "delta_A": float(np.max(np.abs(shader.reflectance(alpha) - truth))),
        "delta_alpha": float(np.max(np.abs(shader.alpha(truth) - alpha))),
    }


def _map_counted(alpha: Floats, reflectance: Floats, of_reflectance: Range, of_alpha: Range) -> Count:
    """Count what must not be: both directions rise."""

    def faults(given: Floats, value: Floats, span: Range, sign: str) -> tuple[list[Mask], Callable[[int], str]]:
        held = span.holds(given)
        with np.errstate(invalid="ignore"):
            falls = np.append(False, np.diff(value) < -STEPS * ULP) & np.append(False, held[:-1])
            bad = (np.isnan(value), np.isinf(value), value < 0, falls)
        return [mask & held for mask in bad], lambda index: f"{sign} {given[index]:.4g}"

    both = faults(REFLECTANCE, alpha, of_reflectance, "A"), faults(ALPHA, reflectance, of_alpha, "α")
    return dense_grid.summed(both)


# What is kept in half, or computed in it.
HALVES = ("α stored", "A stored", "r stored", "results stored", "arithmetic")
FARTHEST, RADII = 100.0, 200


@dataclass(frozen=True)
class HalfCheck:
    """`rel` and `ks` [-] of what float16 alone changes, worst over the records' albedos, for l = 1."""

    of: LoadedLaw
    rel: Numbers
    ks: Numbers


def check_half(context: moderngl.Context, loaded: LoadedLaw) -> HalfCheck:
    """Store one thing in float16 at a time, all else in float32; then compute in it, if that is offered."""
    law = loaded.law
    r, alpha = np.geomspace(NEAREST, FARTHEST, RADII)[None, :], ALBEDOS[:, None]
    profile, cdf = np.asarray(law.profile(r, alpha)), np.asarray(law.cdf(r, alpha))
    used = cdf <= ENERGY_WITHIN
    single = ShaderLaw(context, law)
    found = {HALVES[0]: single.values(r, 0.5, _half(alpha))}
    if getattr(law, "albedo", None) is not None:
        found[HALVES[1]] = single.values(r, 0.5, law.albedo.alpha(_half(law.albedo.reflectance(alpha))))
    found[HALVES[2]] = single.values(_half(r), 0.5, alpha)
    found[HALVES[3]] = ShaderLaw(context, law, results="f2").values(r, 0.5, alpha)
    if half_extension(context):
        found[HALVES[4]] = ShaderLaw(context, law, half=True).values(r, 0.5, alpha)
    rel, ks = Numbers(), Numbers()
    for name, values in found.items():
        with np.errstate(all="ignore"):
            error = np.where(used, np.abs(values.profile / profile - 1.0), 0.0)
            rel[name] = float(np.max(np.sum(error, axis=1) / np.sum(used, axis=1)))
            ks[name] = float(np.max(np.abs(values.cdf - cdf)))
    return HalfCheck(loaded, rel, ks)


def _half(values: Floats) -> Floats:
    return np.asarray(values, np.float16).astype(np.float64)
