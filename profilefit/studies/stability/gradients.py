"""Derivatives by jax, backwards, in every argument and in the constants: finite, and equal to differences.

In double precision. An end where there is no derivative is outside: R_d at r = 0, all of alpha at 1, where A goes with
the root of 1 - alpha, and xi = 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mcml_sim.media.arrays import Floats
from profilefit.laws.base import AlbedoLaw, Range
from profilefit.recipes.catalogue import LoadedLaw
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import Axes, Cells, Mask, axis, functions_of
from profilefit.studies.stability.map_cells import map_label

Triple = tuple[Floats, Floats, Floats]
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
SURE = {"r": Range(1e-3, 30.0), "ξ": Range(0.005, 0.99), "α": Range(1e-3, 0.9985), "A": Range(1e-3, 0.97)}
INSIDE = "differentiate inside, alpha < 1, r > 0 and xi > 0, or by sqrt(1 - alpha), in which A is smooth"
UNSURE = "differences are rounding there: only whether the derivative is a number is looked at"


def of_law(named: LoadedLaw, names: tuple[str, ...], holds: Range) -> Iterator[Cells]:
    """Yield the derivatives of these quantities of a profile law, which holds for the albedos of `holds`."""
    alpha = axis("α", ALPHA)
    for name in names:
        symbol = "ξ" if name == cells.SAMPLE else "r"
        first = axis(symbol, SHARE) if symbol == "ξ" else axis("r/l", RADIUS)
        u, a = (each.ravel() for each in np.meshgrid(first.values, alpha.values))
        valid = (a < 1.0) & holds.holds(a) & ((u > 0) & np.isfinite(u) if symbol == "r" else u > 0)
        sure = valid & SURE[symbol].holds(u) & SURE["α"].holds(a)
        derivatives = _derivatives(name, named.law, u, a, symbol, named.law.constant_names() != ())
        for by, triple in derivatives.items():
            yield _cells(named, named.label, f"∂{name}/∂{by}", (alpha, first), triple, valid, sure)


def of_map(named: LoadedLaw, spans: tuple[Range, Range]) -> Iterator[Cells]:
    """Yield the derivatives of both directions of a map."""
    ways = ((cells.ALPHA_OF, "A", REFLECTANCE), (cells.REFLECTANCE_OF, "α", ALPHA))
    for (name, symbol, values), span in zip(ways, spans, strict=True):
        at = axis(symbol, values)
        u = at.values
        derivatives = _derivatives(name, named.law, u, np.full_like(u, 0.5), symbol, True)
        valid = (u < 1.0) & span.holds(u)
        sure = valid & SURE[symbol].holds(u)
        for by in (symbol, "constants"):
            yield _cells(named, map_label(named), f"∂{name}/∂{by}", (at,), derivatives[by], valid, sure)


def _cells(named: LoadedLaw, label: str, quantity: str, axes: Axes, triple: Triple, valid: Mask, sure: Mask) -> Cells:
    """Return the cells of a derivative, its difference, and value over argument."""
    shape = tuple(one.values.size for one in axes)
    value, difference, scale = (each.reshape(shape) for each in triple)
    valid, sure = valid.reshape(shape), sure.reshape(shape)
    with np.errstate(all="ignore"):
        error = np.abs(value - difference) / np.maximum(np.abs(difference), LEAST * scale)
    error = np.where(sure & (scale > 0), error, np.nan)
    reference = np.where(sure, difference, np.nan)
    sizes = np.where(np.isnan(value), np.nan, np.abs(value))
    given = label, named.law.entry.own, quantity, cells.FLOAT64, axes, sizes, reference, error, BOUND, valid
    return replace(Cells(*given, judge=valid, unjudged=UNSURE, advice=INSIDE), value=value)


def _derivatives(quantity: str, law: Any, u: Floats, a: Floats, symbol: str, constants: bool) -> dict[str, Triple]:
    """Return derivative, difference, and value over argument by argument, at each (u, a) and l = 1."""
    steps = {symbol: STEP * (u if symbol == "r" else np.minimum(u, 1.0 - u)), "α": STEP * np.minimum(a, 1.0 - a)}
    with jax.enable_x64(True):
        own = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64), law)
        arguments = map(jnp.asarray, (u, a, steps[symbol], steps["α"]))
        value, gradients, differences = jax.tree.map(np.asarray, _computed(quantity, WEIGHTS, own, *arguments))
    with np.errstate(all="ignore"):
        over = {symbol: np.abs(value / u), "α": np.abs(value / np.minimum(a, 1.0 - a)), "l": np.abs(value)}
    names = [symbol] if symbol == "α" else [symbol, "α", "l"]
    derivatives = {by: (gradients[i], differences[i], over[by]) for i, by in enumerate(names)}
    if constants:
        derivatives["constants"] = gradients[3], differences[3], np.abs(value)
    return derivatives


@eqx.filter_jit
def _computed(quantity: str, weights: Weights, law: Any, u: Array, a: Array, du: Array, da: Array):
    """Return values, derivatives by u, alpha, l and along the constants themselves, and these by differences.

    `weights` are given and not the module's own: a program that is kept must not outlive them.
    """
    leaves, form = jax.tree.flatten(law)
    one = jnp.ones_like(u)

    def scaled(u, a, mfp, factor):
        of = jax.tree.unflatten(form, [factor * leaf for leaf in leaves])
        return functions_of(of)[quantity](*((u,) if isinstance(of, AlbedoLaw) else (u, a, mfp)))

    whole = jax.vmap(scaled)
    gradients = jax.vmap(jax.grad(scaled, argnums=(0, 1, 2, 3)))(u, a, one, one)
    usual, nothing = (u, a, one, one), jnp.zeros_like(u)
    widths = [du, da, STEP * one, STEP * one]
    points = []
    for place, width in enumerate(widths):
        for k, _ in weights:
            points.append([each + (k * width if i == place else nothing) for i, each in enumerate(usual)])
    stacked = [jnp.concatenate(column) for column in zip(usual, *points, strict=True)]  # at once: compiled once
    computed = whole(*stacked).reshape(1 + len(points), u.size)
    values = computed[1:].reshape(len(widths), len(weights), u.size)
    sums = jnp.einsum("skn,k->sn", values, jnp.array([weight for _, weight in weights]))
    return computed[0], gradients, sums / jnp.where(jnp.stack(widths) > 0, jnp.stack(widths), 1.0)
