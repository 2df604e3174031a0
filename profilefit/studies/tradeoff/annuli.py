"""Annuli whose energies every truth is asked for, of three media, and what is right of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import jax
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Layer, Medium, Setting, exact, half_space
from mcml_sim.exact import hankel
from mcml_sim.exact.by_albedo import by_alpha, forget
from mcml_sim.exact.stack import solution
from mcml_sim.exact.stack.depths import Nodes
from mcml_sim.exact.transform import STANDARD, Rule, Transform
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST

Floats = NDArray[np.float64]
ALPHAS = np.array([0.2, 0.5, 0.8, 0.95, 0.99])
# The scalar tracer's rings are even, so all rings are unions of those: thirty, near even in ln r to 10 mfp.
WIDTH, EVEN = 0.01, 1024
BREAKS = np.append(0, np.unique(np.round(np.geomspace(1, EVEN, 31)).astype(int)))
EDGES = BREAKS * WIDTH
MIDDLES = 0.5 * (EDGES[1:] + EDGES[:-1])
FINEST = 3.0, 1.5  # times the standard nodes: what all errors are against, where n is 1 and else
LAYERS = Medium((Layer(1.4, 0.2, 1.8, 0.0, 0.3), Layer(1.4, 0.02, 0.98, 0.0, 1.0), Layer(1.4, 0.3, 1.2, 0.0)))


@dataclass(frozen=True)
class Annuli:
    """Annuli of a medium at each albedo, or of one stack.

    panel, title  of their chart;  media  a row each;  setting  light and n
    within        reference: energy within EDGES, (rows, rings + 1) [-];  whole  (rows, 1) [-]
    """

    panel: str
    title: str
    media: tuple[Medium, ...]
    setting: Setting
    within: Callable[[], Floats]
    whole: Callable[[], Floats]

    @cached_property
    def reference(self) -> Floats:
        """Energy of each ring (rows, rings) [-]."""
        return np.diff(self.within(), axis=1)

    @cached_property
    def judged(self) -> NDArray[np.bool_]:
        """The rings that count, (rows, rings)."""
        within = np.cumsum(self.reference, axis=1) / self.whole()
        return (EDGES[:-1] >= NEAREST) & (within <= ENERGY_WITHIN)

    def errors(self, energy: Floats) -> tuple[float, float]:
        """Root mean square and worst relative error of ring energies (rows, rings), over the rings that count."""
        relative = np.abs(energy / self.reference - 1.0)[self.judged]
        return float(np.sqrt(np.mean(relative**2))), float(relative.max())


def half_spaces(setting: Setting, rule: Rule) -> Floats:
    """Energy within EDGES at ALPHAS from nothing but the table of n: no transform is kept from one call to the next."""
    forget()
    return by_alpha(_energy_within, EDGES, ALPHAS[:, None], setting, rule)


def _energy_within(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    return alpha * transform.reflectance * hankel.cdf(transform, x)


def stack(nodes: Nodes) -> Floats:
    """Energy within EDGES of LAYERS, (1, rings + 1), from nothing."""
    light = exact.solve(LAYERS, nodes=nodes)
    return np.asarray(light.cdf(EDGES))[None] * light.reflectance


def _of_half_space(panel: str, setting: Setting, finest: float) -> Annuli:
    title = f"{EDGES.size - 1} annuli of a half space with n = {setting.n:g}, g = 0"
    reference = partial(half_spaces, setting, STANDARD.scaled(finest))
    media = tuple(half_space(float(alpha), n=float(setting.n)) for alpha in ALPHAS)
    return Annuli(
        panel, title, media, setting, reference, lambda: np.asarray(exact.reflectance(ALPHAS, setting))[:, None]
    )


MATCHED = _of_half_space("rings", exact.SEARCHLIGHT, FINEST[0])
REFRACTING = _of_half_space("refracting", Setting(n=1.4), FINEST[1])
STACK = Annuli(
    "stack",
    f"{EDGES.size - 1} annuli of three layers with n = 1.4, g = 0",
    (LAYERS,),
    Setting(n=1.4),
    partial(stack, solution.FINE),
    lambda: np.array([[exact.solve(LAYERS).reflectance]]),
)
