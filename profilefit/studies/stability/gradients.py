"""Derivatives by jax, backwards, in every argument and in the constants: finite, and what differences say.

In double precision. An end where there is no derivative is outside: R_d at r = 0, all of alpha at 1, where A goes with
the root of 1 - alpha, and xi = 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from profilefit.recipes.catalogue import Named
from profilefit.shader.check.validity import Range
from profilefit.studies.stability.cells import Cells, judged
from profilefit.studies.stability.layout import (
    ALPHA_OF,
    CDF,
    FLOAT64,
    PDF,
    PROFILE,
    REFLECTANCE_OF,
    SAMPLE,
    ArgumentAxis,
)

Floats = NDArray[np.float64]
ALPHA = (0.0, 1e-12, 1e-6, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0 - 2.0**-24, 1.0 - 2.0**-53, 1.0)
RADIUS = (0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1e6, np.inf)
SHARE = (0.0, 1e-12, 1e-6, 1e-3, 0.008, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0 - 2.0**-24)
REFLECTANCE = (0.0, 1e-12, 1e-6, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 1.0 - 2.0**-24, 1.0)
# Of the argument, or of its distance to 1: four points of a step cancel its error up to the fourth power.
STEP = 1e-4
Weights = tuple[tuple[float, float], ...]
WEIGHTS: Weights = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
BOUND = 1e-4  # relative; derivatives that are less than a millionth of value over argument count as that
LEAST = 1e-6
# Where differences are taken: elsewhere the step, or what is left of the value, is rounding.
SURE = {"r": (1e-3, 30.0), "ξ": (0.005, 0.99), "α": (1e-3, 0.9985), "A": (1e-3, 0.97)}
UNSURE = "differences are rounding there: only whether the derivative is a number is looked at"
Function = Callable[[Any, Array, Array, Array], Array]
FUNCTIONS: dict[str, Function] = {
    PROFILE: lambda law, r, alpha, mfp: law.profile(r, alpha, mfp),
    CDF: lambda law, r, alpha, mfp: law.cdf(r, alpha, mfp),
    SAMPLE: lambda law, xi, alpha, mfp: law.sampler.sample(xi, alpha, mfp),
    PDF: lambda law, r, alpha, mfp: law.sampler.pdf(r, alpha, mfp),
}
MAPS: dict[str, Function] = {
    ALPHA_OF: lambda law, a, _, __: law.alpha(a),
    REFLECTANCE_OF: lambda law, alpha, _, __: law.reflectance(alpha),
}


def of_law(one: Named, names: tuple[str, ...], holds: Range) -> Iterator[Cells]:
    """The derivatives of these quantities of a profile law, which holds for the albedos of `holds`."""
    alpha = ArgumentAxis("α", "-", np.array(ALPHA))
    for name in names:
        first = (
            ArgumentAxis("ξ", "-", np.array(SHARE)) if name == SAMPLE else ArgumentAxis("r/l", "-", np.array(RADIUS))
        )
        symbol = "ξ" if name == SAMPLE else "r"
        u, a = (each.ravel() for each in np.meshgrid(first.values, alpha.values))
        valid = (a < 1.0) & holds.holds(a) & ((u > 0) & np.isfinite(u) if symbol == "r" else u > 0)
        found = _derivatives(FUNCTIONS[name], one.law, u, a, symbol, one.law.constant_names() != ())
        for by, (value, difference, scale) in found.items():
            sure = valid & _within(symbol, u) & _within("α", a)
            yield _cells(
                one.label,
                one.law.entry.own,
                one.law,
                name,
                by,
                (alpha, first),
                value,
                difference,
                scale,
                valid,
                sure,
            )


def of_map(one: Named, spans: tuple[Range, Range]) -> Iterator[Cells]:
    """The derivatives of both directions of a map."""
    ways = ((ALPHA_OF, "A", REFLECTANCE), (REFLECTANCE_OF, "α", ALPHA))
    for (name, symbol, values), span in zip(ways, spans, strict=True):
        axis = ArgumentAxis(symbol, "-", np.array(values))
        u = axis.values
        found = _derivatives(MAPS[name], one.law, u, np.full_like(u, 0.5), symbol, True)
        valid = (u < 1.0) & span.holds(u)
        for by in (symbol, "constants"):
            value, difference, scale = found[by]
            sure = valid & _within(symbol, u)
            label = one.label if one.records else f"map {one.label}"
            own = one.law.entry.own
            yield _cells(label, own, one.law, name, by, (axis,), value, difference, scale, valid, sure)


def _within(symbol: str, values: Floats) -> NDArray[np.bool_]:
    low, high = SURE[symbol]
    return (values >= low) & (values <= high)


def _cells(label: str, own: bool, law: Any, name: str, by: str, places, value, difference, scale, valid, sure) -> Cells:
    shape = tuple(axis.values.size for axis in places)
    value, difference, scale, valid, sure = (each.reshape(shape) for each in (value, difference, scale, valid, sure))
    with np.errstate(all="ignore"):
        error = np.abs(value - difference) / np.maximum(np.abs(difference), LEAST * scale)
    error = np.where(sure & (scale > 0), error, np.nan)
    reference = np.where(sure, difference, np.nan)
    codes = judged(np.where(np.isnan(value), np.nan, np.abs(value)), reference, error, BOUND, valid, np.float64)
    return Cells(
        label, own, f"∂{name}/∂{by}", FLOAT64, places, value, reference, error, BOUND, valid, codes, law,
        unjudged=UNSURE,
    )  # fmt: skip


def _derivatives(
    function: Function, law: Any, u: Floats, a: Floats, symbol: str, constants: bool
) -> dict[str, tuple[Floats, Floats, Floats]]:
    """By argument: derivative, difference, and value over argument, at each (u, a) and l = 1."""
    steps = {symbol: STEP * (u if symbol == "r" else np.minimum(u, 1.0 - u)), "α": STEP * np.minimum(a, 1.0 - a)}
    with jax.enable_x64(True):
        own = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), law)
        made = _computed(function, WEIGHTS, own, *map(jnp.asarray, (u, a, steps[symbol], steps["α"])))
        value, gradients, differences = jax.tree.map(np.asarray, made)
    with np.errstate(all="ignore"):
        over = {symbol: np.abs(value / u), "α": np.abs(value / np.minimum(a, 1.0 - a)), "l": np.abs(value)}
    names = [symbol] if symbol == "α" else [symbol, "α", "l"]
    found = {by: (gradients[i], differences[i], over[by]) for i, by in enumerate(names)}
    if constants:
        found["constants"] = gradients[3], differences[3], np.abs(value)
    return found


@eqx.filter_jit
def _computed(function: Function, weights: Weights, law: Any, u: Array, a: Array, du: Array, da: Array):
    """Values, derivatives by u, alpha, l and along the constants themselves, and the same by differences.

    `weights` are given and not the module's own: a program that is kept must not outlive them.
    """
    leaves, form = jax.tree.flatten(law)
    one = jnp.ones_like(u)

    def scaled(u, a, mfp, factor):
        return function(jax.tree.unflatten(form, [factor * leaf for leaf in leaves]), u, a, mfp)

    whole = jax.vmap(scaled)
    gradients = jax.vmap(jax.grad(scaled, argnums=(0, 1, 2, 3)))(u, a, one, one)
    usual, nothing = (u, a, one, one), jnp.zeros_like(u)
    widths = [du, da, STEP * one, STEP * one]
    points = []
    for place, width in enumerate(widths):
        for k, _ in weights:
            points.append([each + (k * width if i == place else nothing) for i, each in enumerate(usual)])
    stacked = [jnp.concatenate(column) for column in zip(usual, *points, strict=True)]  # at once: compiled once
    made = whole(*stacked).reshape(1 + len(points), u.size)
    values = made[1:].reshape(len(widths), len(weights), u.size)
    sums = jnp.einsum("skn,k->sn", values, jnp.array([weight for _, weight in weights]))
    return made[0], gradients, sums / jnp.where(jnp.stack(widths) > 0, jnp.stack(widths), 1.0)
