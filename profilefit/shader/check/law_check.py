"""Check of a law's source where it runs: its float32 against the float64 law and against the exact half space.

Every law is held to its own model error: rounding below a tenth of it, the errors of the record met by the GPU's own
numbers, and nothing that is no number, infinite, negative or goes the wrong way where the law says that it holds.

Each text is also translated line by line into numpy and run in float64, where rounding is out of sight.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.measures import MEASURES
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST, profile_quality
from profilefit.laws.base import ProfileLaw
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.recipes.pipelines import inversion_error
from profilefit.recipes.record import Folder
from profilefit.shader.check import bounds, dense_grid, validity
from profilefit.shader.check.bounds import ALBEDOS, MODEL_FACTOR, ROUNDING_SHARE, Bound, ModelError
from profilefit.shader.check.dense_grid import XI, Arguments, ShaderCheck, Spread, bad_numbers
from profilefit.shader.check.shader_law import ShaderLaw, Values
from profilefit.shader.languages import translated

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
# Half the width of the difference quotient, of xi or 1 - xi: its error is a hundred-millionth, rounding's less.
STEP = 1e-4
NEAREST_XI, FARTHEST_XI = 1e-4, 1.0 - 1e-5
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
        inner = (max(NEAREST_XI, lowest) < XI) & (XI < FARTHEST_XI)
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
                held = _inside((xi - low) / (high - low)) & (~both | _inside((other - first) / (last - first)))
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


def _inside(share: Floats) -> Mask:
    """Return a mask of shares where difference quotients of a part have its slope."""
    return np.asarray((share > NEAREST_XI) & (share < FARTHEST_XI))


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
        references = pool.map(
            lambda loaded: dense_grid.reference(loaded.law.in_reduced(), dense_grid.arguments()), laws
        )
        for loaded, exact in zip(laws, references, strict=True):
            yield check_law(context, loaded, folder, exact=exact)


def check_law(
    context: moderngl.Context, loaded: LoadedLaw, folder: Folder, text: str = "", exact: Values | None = None
) -> LawCheck:
    """Check a profile law with its constants. ShaderError if it does not compile.

    text   in place of its own; exact  the law in float64 on the grid, where that is known already
    """
    model, valid = bounds.of_profile(loaded, folder), validity.of_profile(loaded, folder)
    shader, at = ShaderLaw(context, loaded.law, text), dense_grid.arguments()
    found = shader.values(at.r, at.xi, at.alpha, at.mfp)
    with np.errstate(all="ignore"):  # what is no number is counted, not warned of
        exact = exact or dense_grid.reference(loaded.law.in_reduced(), at)
        profiled, drawn = (
            np.broadcast_to(mask, at.shape) for mask in validity.masks(valid, dense_grid.ALPHA, dense_grid.XI)
        )
        spreads, rounding = _rounding(loaded.law.in_reduced(), found, exact, at, profiled, drawn)
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
    limits += [bad_numbers(inside), *validity.promised_by_profile(loaded, folder)]
    return LawCheck(loaded, model, rounding, measured, inside, outside, tuple(limits), spreads)


def _rounding(
    law: ProfileLaw, found: Values, exact: Values, at: Arguments, profiled: Mask, drawn: Mask
) -> tuple[dict[str, Spread], dict[str, float]]:
    """Errors that float32 alone makes: of all that is judged, and as `rel`, `ks` and `inversion_error`, at worst."""
    seen = (at.x >= NEAREST) & (exact.cdf <= ENERGY_WITHIN)  # where `rel` looks
    tells = profiled & (exact.profile * at.mfp**2 > dense_grid.DIMMEST) & np.isfinite(exact.profile)
    dense = drawn.any(axis=1, keepdims=True) & (exact.pdf * at.mfp > dense_grid.DIMMEST) & np.isfinite(exact.pdf)
    profile = np.abs(found.profile / exact.profile - 1.0)
    cdf = np.abs(found.cdf - exact.cdf)
    sample = _misplaced(law, found, exact, at)
    spreads = {
        PROFILE: dense_grid.spread(profile, tells & seen, at),
        EVERYWHERE: dense_grid.spread(profile, tells, at),
        CDF: dense_grid.spread(cdf, profiled, at),
        SAMPLE: dense_grid.spread(sample, drawn, at, of_share=True),
        PDF: dense_grid.spread(np.abs(found.pdf / exact.pdf - 1.0), dense & seen, at),
    }
    used = tells & seen
    means = np.sum(np.where(used, profile, 0.0), axis=1) / np.maximum(np.sum(used, axis=1), 1)
    worst = (means, np.where(profiled, cdf, 0.0), np.where(drawn, sample, 0.0))
    rounding = {name: float(np.max(values)) for name, values in zip(bounds.PROFILE_MEASURES, worst, strict=True)}
    return {name: spread for name, spread in spreads.items() if spread is not None}, rounding


def _misplaced(law: ProfileLaw, found: Values, exact: Values, at: Arguments) -> Floats:
    """Return the share of the energy between the radii of float32 and float64 [-], of the part that both are of."""
    sampler = dense_grid.drawn_by(law)
    there, drawn = exact.sample, np.where(found.sample >= 0, found.sample, np.inf)
    mine, right = (np.asarray(sampler.undone(x, at.xi, at.alpha, at.mfp)) for x in (drawn, there))
    return np.abs(mine - right)


def _measured(shader: ShaderLaw, loaded: LoadedLaw, model: ModelError) -> dict[str, float]:
    """Return the errors of the GPU's numbers against the exact half space, for the measures with a model error."""
    found: dict[str, float] = {}
    if not loaded.setting.is_solved:
        return found
    if model.get("rel") is not None:
        quality = profile_quality(shader, ALBEDOS)  # type: ignore[arg-type]  # it asks for no more than there is
        found |= {measure: MEASURES[measure].worst(getattr(quality, measure)) for measure in ("rel", "ks")}
    if model.get("inversion_error") is not None:
        found["inversion_error"] = float(np.max(inversion_error(shader, ALBEDOS)))
    return found


def _limits(
    model: ModelError, rounding: dict[str, float], measured: dict[str, float], spreads: dict[str, Spread]
) -> list[Bound]:
    found = []
    for name, value in model.values.items():
        place = spreads[JUDGED[name]].where if JUDGED[name] in spreads else ""
        found.append(Bound(f"float32 {name}", rounding[name], ROUNDING_SHARE * value, place))
        if name in measured:
            found.append(Bound(f"{name} against the exact half space", measured[name], MODEL_FACTOR * value))
    rel, ks = model.get("rel"), model.get("ks")
    if SAMPLE in spreads and ks is not None and model.get("inversion_error") is None:  # as good as the cdf it inverts
        name = "float32 inversion_error"
        found.append(Bound(name, rounding["inversion_error"], ROUNDING_SHARE * ks, spreads[SAMPLE].where))
    if OWN in spreads and rel is not None:
        found.append(Bound(f"{OWN}, 99 % of it", spreads[OWN].most, ROUNDING_SHARE * rel, spreads[OWN].where))
    return found
