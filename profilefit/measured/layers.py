"""Some thicknesses and coefficients of a stack of layers, fitted to a profile by exact light; the others are held.

Free quantities go by name and layer, counted from the surface: d1 [unit], mu_a2, mu_s2 [1/unit]. What a profile says of
a layer below is often one product of powers only: so the answer names the best and the least certain ones.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import stats

from mcml_sim import exact
from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.medium import Medium
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.fitting import solver
from profilefit.fitting.misfit import DETECTED, gaussianised, scatter_chance
from profilefit.measured.data import Measured, require_workable, widening
from profilefit.measured.identifiability import LOOSE
from profilefit.measured.instrument import Instrument
from profilefit.measured.noise import Noise, noise
from profilefit.measured.premises import Premises
from profilefit.measured.problem import Known

NAME = re.compile(r"(d|mu_a|mu_s)([1-9][0-9]?)")
FIELDS = {"d": "thickness", "mu_a": "mu_a", "mu_s": "mu_s"}
# Enough for 2e-5 of the light of a stack, in a quarter of the time of the standard ones.
NODES = exact.Nodes(depth=10, slope=12, azimuth=12, wave=10)
STEP = 0.02  # of ln of a quantity, for derivatives
REACH = math.log(300.0)  # how far ln of a quantity may go from where it starts
TOLERANCE, MOST_STEPS = 1e-4, 20
GAIN = 1e-3  # of chi-square, that another step must gain
ROUNDS = 2  # of weights: those of counts come from the fit
NAMED = 0.1  # exponents below it are left out of a product's name


@dataclass(frozen=True)
class LayersFit:
    """Fit of layers; lengths in the unit of the data.

    names     of the free quantities; scale last where it is free
    values    (p,); errors (p,) their relative standard errors, with the misfit; correlation (p, p) of their logarithms
    products  (exponents, relative error) of the products of powers that are independent of each other, best first
    chi2, freedom, chance   by the errors of the data; light (n,) of the rows
    """

    data: Measured
    premises: Premises
    start: Medium
    medium: Medium
    names: tuple[str, ...]
    values: Floats
    errors: Floats
    correlation: Floats
    products: tuple[tuple[Floats, float], ...]
    chi2: float
    freedom: int
    chance: float
    light: Floats
    result: str

    @property
    def intervals(self) -> Floats:
        """(p, 2) of 95 %, as of normal errors of the logarithms, or Student's where the data's are estimates."""
        quantile = stats.t.ppf(0.975, self.data.pooled)
        return self.values[:, None] * np.exp(quantile * np.outer(self.errors, [-1.0, 1.0]))

    @property
    def loose(self) -> tuple[str, ...]:
        """Quantities that these data do not identify."""
        return tuple(name for name, error in zip(self.names, self.errors, strict=True) if not error < LOOSE)

    def product(self, at: int) -> str:
        """One of the products, in words."""
        pairs = zip(self.names, self.products[at][0], strict=True)
        return " ".join(f"{name}^{power:.2g}" for name, power in pairs if abs(power) > NAMED)


def fit_layers(
    data: Measured, medium: Medium, free: Sequence[str], premises: Premises, scale: float | Known | None = 1.0
) -> LayersFit:
    """Fit the free quantities of a stack, from where `medium` has them; lengths in the unit of the data. Minutes.

    InputError of a medium that `exact.solve` has not, of names that it has not, of data that state another n, or a g.

    Args:
        data: the profile.
        medium: the stack, whose n and g count.
        free: names of the free quantities.
        premises: light, beam and fibre.
        scale: as of `result.fit`.
    """
    require_workable(data)
    data = replace(data, notes=(*data.notes, *premises.notes))
    known = scale if isinstance(scale, Known) else None
    held = float(scale) if isinstance(scale, float | int) else 1.0
    names = tuple(free) + (() if isinstance(scale, float | int) else ("scale",))
    places = _places(medium, free)
    if data.value.size <= len(names):
        raise InputError(f"{data.source}: expected more than {len(names)} rows, one more than is free")
    wider = widening(data.freedom, len(names))
    problem = _LayersProblem(data, medium, places, premises, noise(data, widening=wider), held, known)
    start = np.zeros(len(names))
    light = problem.rows(start[: len(free)])  # what cannot be solved fails here
    problem = replace(problem, premises=replace(premises, setting=_setting(data, medium, premises)))
    if known is not None:
        start[-1] = math.log(known.value)
    elif scale is None:
        white = problem.weights.whitened(light)
        start[-1] = math.log(max(float(white @ problem.weights.whitened(data.value) / (white @ white)), 1e-30))
    for _ in range(ROUNDS if data.counted else 1):
        bounds, at = (start - REACH, start + REACH), solver.differences(problem.residuals, STEP)
        done = solver.solve(at, start, bounds, tolerance=TOLERANCE, gain=GAIN, most=MOST_STEPS)
        start, expected = done.parameters, problem.rows(done.parameters)
        problem = replace(problem, weights=noise(data, np.maximum(expected, 0.01 * data.value), wider))
    return _judged(problem, names, done, expected)


def _setting(data: Measured, medium: Medium, premises: Premises) -> Setting:
    """Return the layers' setting; InputError where a table states another, or more is open than layers."""
    for name in premises.ranges:
        of = f"{data.source}:{data.stated[name].line}: " if name in data.stated else ""
        what = "width" if name == "beam" else "number"
        raise InputError(f"{of}{name} must be one {what} where layers are fitted, got a range")
    own = Setting(premises.setting.illumination, medium.layers[0].n / medium.n_above)
    for name, value in (("n", own.n), ("g", own.g)):
        got, accepted = getattr(premises.setting, name), f"{value:g} or left out, as of the layers that are fitted"
        if name in data.stated:
            require(math.isclose(got, value), f"{data.source}:{data.stated[name].line}: {name}", accepted, got)
    return own


@dataclass(frozen=True)
class _LayersProblem:
    """Rows of a medium whose free quantities are exp(x) times what they start at; ln of the scale is last if free.

    free  layer, from 0, and field of each quantity
    """

    data: Measured
    medium: Medium
    free: tuple[tuple[int, str], ...]
    premises: Premises
    weights: Noise
    held: float
    known: Known | None

    def at(self, x: Floats) -> Medium:
        layers = list(self.medium.layers)
        for (at, field), log in zip(self.free, x, strict=False):
            layers[at] = replace(layers[at], **{field: getattr(layers[at], field) * math.exp(log)})
        return replace(self.medium, layers=tuple(layers))

    def rows(self, x: Floats) -> Floats:
        seen, light = self.premises.instrument, self.premises.setting.illumination
        rows = solved_rows(self.at(x), light, seen, self.data.inner.tobytes(), self.data.outer.tobytes())
        return rows * (math.exp(x[-1]) if x.size > len(self.free) else self.held)

    def residuals(self, x: Floats) -> Floats:
        rows = self.weights.whitened(self.rows(x) - self.data.value)
        return rows if self.known is None else np.append(rows, (math.exp(x[-1]) - self.known.value) / self.known.error)


@lru_cache(maxsize=64)
def solved_rows(medium: Medium, illumination: str, seen: Instrument, inner: bytes, outer: bytes) -> Floats:
    """Return exact light of rows from `inner` to `outer`, (n,) float64 as bytes, of a scale of 1."""
    rho, weight = seen.nodes(np.frombuffer(inner), np.frombuffer(outer))
    light = exact.solve(medium, illumination, NODES)
    return np.asarray(weight @ (2.0 * np.pi * rho * np.asarray(light.profile(rho))), float)


def _judged(problem: _LayersProblem, names: tuple[str, ...], done: solver.Solution, expected: Floats) -> LayersFit:
    rows, data, count = problem.residuals(done.parameters), problem.data, problem.data.value.size
    rows[:count] *= math.sqrt(widening(data.freedom, len(names)))  # judged by the errors of the data as they are
    rows = gaussianised(rows, data.freedom, data.pooled)
    chi2, freedom = float(rows @ rows), rows.size - len(names)
    chance = scatter_chance(chi2, freedom, data.pooled)
    wider = math.sqrt(chi2 / freedom) if chance < DETECTED else 1.0
    _, singular, ways = np.linalg.svd(done.jacobian, full_matrices=False)
    sizes, covariance = wider / np.maximum(singular, np.finfo(float).tiny), wider**2 * done.covariance
    errors = np.sqrt(np.diag(covariance))
    result = solver.CONVERGED
    if not done.converged:
        result = f"no convergence in {MOST_STEPS} steps: start nearer, or free fewer quantities"
    elif done.at_bound is not None and np.any(done.at_bound):
        result = f"{names[int(np.argmax(done.at_bound))]} runs away: these data do not constrain it"
    products = tuple((way / way[np.argmax(np.abs(way))], float(size)) for way, size in zip(ways, sizes, strict=True))
    medium = problem.at(done.parameters)
    values = [getattr(medium.layers[at], field) for at, field in problem.free]
    values += [math.exp(done.parameters[-1])] if len(names) > len(problem.free) else []
    return LayersFit(
        data, problem.premises, problem.medium, medium, names, np.array(values), errors,
        covariance / np.outer(errors, errors), products, chi2, freedom, chance, expected, result,
    )  # fmt: skip


def _places(medium: Medium, free: Sequence[str]) -> tuple[tuple[int, str], ...]:
    """Return layer, from 0, and field of each free quantity; InputError of one that the medium has not."""
    if not free:
        raise InputError("free must name quantities such as d1, mu_a2 or mu_s2, got none")
    places = []
    for name in free:
        match = NAME.fullmatch(name)
        if match is None:
            raise InputError(f"free must name quantities such as d1, mu_a2 or mu_s2, got {name!r}")
        at, field = int(match[2]) - 1, FIELDS[match[1]]
        if at >= len(medium.layers):
            raise InputError(f"free must name one of {len(medium.layers)} layers, got {name!r}")
        places.append((at, field))
        value = getattr(medium.layers[at], field)
        if not 0 < value < math.inf or free.count(name) > 1:
            got = "it twice" if free.count(name) > 1 else f"{name} = {value:g}"
            raise InputError(f"free must name quantities > 0 that are finite, each once, got {got}")
    return tuple(places)
