"""What was tried for a profile law, and lost: forms with free shapes at each albedo, and coefficient laws for the best.

    python -m benchmarks.forms [--quick]       # two minutes on two cores

Every form of `survival.py` has both exact limits, at the source and far away. First its shapes are fitted at each
albedo on its own: what is left is the form's fault. Then the shapes of the hazard law's form are polynomials in one
variable or another, fitted over all albedos at once and judged between them. The same residuals for all: relative error
of R_d even in ln r up to 99.5 % of the energy, the error of the cdf, and a little of the tail.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from benchmarks.survival import FORMS, HAZARD, Form
from benchmarks.table import show
from mcml_sim import exact
from profilefit.fitting.solver import solve
from profilefit.studies.tradeoff.counting import count, described

Floats = NDArray[np.float64]
# Weights of the relative error, of that in the tail, and what more than thrice as bright counts for.
RELATIVE, TAIL, MOST = 0.1, 0.0, 3.0
EVALUATIONS, GAIN = 300, 1e-15  # of a start; of a sum of squares, that another step must gain
WIDEST = 9.0  # largest |ln| of a shape


class Truth(NamedTuple):
    """The exact half space, arrays of numpy or jax: a row for each albedo (m, 1), at radii x (m, k) [mfp].

    density  2 pi x R_d / A [1/mfp]; left  1 - cdf [-]; inner  whether x is in [0.01, r at 99.5 % of the energy]
    """

    alpha: Any
    reflectance: Any
    near: Any
    far: Any
    x: Any
    density: Any
    left: Any
    inner: Any


@dataclass(frozen=True)
class Errors:
    """Worst and mean of `rel`, and worst `ks`, over the albedos."""

    mean: float
    worst: float
    ks: float

    def cells(self) -> tuple[str, str, str]:
        return f"{self.mean:.4f}", f"{self.worst:.4f}", f"{self.ks:.5f}"


@dataclass(frozen=True)
class CoefficientLaw:
    """Shapes h, a, b, c of the hazard law's form, each a polynomial of that degree in a variable through a link.

    variable  one of `VARIABLES`; with_kappa  which shapes have a term in kappa besides
    """

    variable: str
    degrees: tuple[int, int, int, int]
    links: tuple[str, str, str, str] = ("exp", "plain", "plain", "square")
    with_kappa: str = ""

    @property
    def constants(self) -> int:
        return sum(self.degrees) + 4 + len(self.with_kappa)

    def bases(self, truth: Truth) -> list[Floats]:
        """Terms of each shape (m, terms)."""
        kappa = np.asarray(truth.far)
        found = []
        for name, degree in zip("habc", self.degrees, strict=True):
            powers = VARIABLES[self.variable].polynomials(truth, degree)
            found.append(np.hstack([powers, kappa]) if name in self.with_kappa else powers)
        return found

    def shapes(self, constants: Array, bases: Sequence[Array]) -> Array:
        """(4, m, 1)."""
        cuts = np.cumsum([basis.shape[1] for basis in bases])[:-1]
        parts = jnp.split(constants, cuts)
        values = [LINKS[link][0](basis @ part) for link, basis, part in zip(self.links, bases, parts, strict=True)]
        return jnp.stack(values)[..., None]

    def start(self, shapes: Floats, bases: Sequence[Floats]) -> Floats:
        """Constants that come nearest to shapes (4, m)."""
        linked = [LINKS[link][1](np.maximum(shape, LEAST)) for link, shape in zip(self.links, shapes, strict=True)]
        return np.concatenate([np.linalg.lstsq(b, y, rcond=None)[0] for b, y in zip(bases, linked, strict=True)])


@dataclass(frozen=True)
class Variable:
    """What shapes are polynomials in: (m, 1) of the truth, and its range."""

    of: Callable[[Truth], Any]
    span: tuple[float, float]

    def polynomials(self, truth: Truth, degree: int) -> Floats:
        """Legendre's, (m, degree + 1): they span what powers span, and a solver can tell them apart."""
        low, high = self.span
        return np.asarray(
            legvander(2.0 * (np.asarray(self.of(truth))[:, 0] - low) / (high - low) - 1.0, degree), np.float64
        )


VARIABLES = {
    "sqrt(1 - alpha)": Variable(lambda truth: np.sqrt(1.0 - truth.alpha), (0.0, 1.0)),
    "A": Variable(lambda truth: truth.reflectance, (0.0, 1.0)),
    "lambda_0": Variable(lambda truth: truth.near, (0.5, 3.3)),
    "1 / lambda_0": Variable(lambda truth: 1.0 / truth.near, (0.3, 2.0)),
}
LINKS = {
    "exp": (jnp.exp, np.log),
    "plain": (lambda y: y, lambda y: y),
    "square": (jnp.square, np.sqrt),
}
COEFFICIENT_LAWS = (
    CoefficientLaw("lambda_0", (1, 1, 2, 1)),
    CoefficientLaw("lambda_0", (1, 2, 2, 1)),
    CoefficientLaw("lambda_0", (1, 2, 2, 2)),
    CoefficientLaw("lambda_0", (2, 2, 2, 2)),
    CoefficientLaw("lambda_0", (1, 2, 2, 1), with_kappa="hc"),
    CoefficientLaw("lambda_0", (1, 2, 2, 1), links=("exp", "exp", "exp", "exp")),
    CoefficientLaw("1 / lambda_0", (1, 2, 2, 1)),
    CoefficientLaw("sqrt(1 - alpha)", (1, 2, 2, 1)),
    CoefficientLaw("sqrt(1 - alpha)", (1, 2, 3, 2)),
    CoefficientLaw("A", (1, 2, 2, 1)),
    CoefficientLaw("A", (2, 3, 3, 2)),
)
JITTER = 0.2  # of the logarithms of shapes that a coefficient law starts from
LEAST = 1e-4  # shape that it starts from


@dataclass(frozen=True)
class Sizes:
    """Albedos, random starts, and which of the forms and coefficient laws."""

    albedos: int = 16
    starts: int = 10
    forms: tuple[Form, ...] = FORMS
    laws: tuple[CoefficientLaw, ...] = COEFFICIENT_LAWS


FULL, QUICK = Sizes(), Sizes(5, 2, (FORMS[0], HAZARD), COEFFICIENT_LAWS[1:2])


def albedos(number: int) -> tuple[Floats, Floats]:
    """Those that are fitted, even in sqrt(1 - alpha) over [0.05, 0.995], and those in the middle between them."""
    s = np.linspace(np.sqrt(0.95), np.sqrt(0.005), number)
    return 1.0 - s**2, 1.0 - (0.5 * (s[1:] + s[:-1])) ** 2


def truth_at(alpha: Floats) -> Truth:
    """Solve the half space at albedos (m,)."""
    outer = np.asarray(exact.quantile(0.995, alpha))
    x = np.stack([
        np.concatenate([
            np.geomspace(1e-3, 0.01, 8, endpoint=False),
            np.geomspace(0.01, last, 60),
            np.geomspace(last, max(6.0 * last, 1.0), 17)[1:],
        ])
        for last in outer
    ])  # fmt: skip
    column = alpha[:, None]
    reflectance = np.asarray(exact.reflectance(column))
    density = 2.0 * np.pi * x * np.asarray(exact.profile(x, column)) / reflectance
    inner = (x > 0.01 * (1 - 1e-9)) & (x < outer[:, None] * (1 + 1e-9))
    left = 1.0 - np.asarray(exact.cdf(x, column))
    far = np.asarray(exact.decay_rate(column))
    return Truth(column, reflectance, column / (2.0 * reflectance), far, x, density, left, inner)


def residuals(left: Array, density: Array, truth: Truth) -> Array:
    """What is made small, of any form, flat."""
    error = density / truth.density - 1.0
    profile = jnp.where(truth.inner, RELATIVE * error, TAIL * jnp.clip(error, -1.0, MOST))
    both = jnp.concatenate([profile, left - truth.left], axis=-1)
    return jnp.nan_to_num(both, nan=MOST, posinf=MOST, neginf=-MOST).ravel()


def errors(left: Array, density: Array, truth: Truth) -> Errors:
    """The measures of a fit, both (m, k)."""
    inner = np.asarray(truth.inner)
    rel = (np.abs(np.asarray(density) / truth.density - 1.0) * inner).sum(1) / inner.sum(1)
    return Errors(float(rel.mean()), float(rel.max()), float(np.abs(np.asarray(left) - truth.left).max()))


def fit_free(form: Form, truth: Truth, starts: int) -> tuple[Floats, Errors]:
    """Shapes (m, p) at each albedo, the best of some starts and of that albedo's neighbour, and their errors."""

    def residual(logs, one):
        return residuals(*form.curve(one.x, _bounded(logs), one.near, one.far), one)

    begin = _jittered(np.array(form.start), starts, 1.0)
    logs: list[Floats] = []
    solve = Solver(residual)
    for i in range(len(truth.x)):
        logs.append(solve([*logs[-1:], *begin], Truth(*(part[i] for part in truth))))
    with jax.enable_x64(True):
        shapes = _bounded(jnp.asarray(logs))
        left, density = form.curve(jnp.asarray(truth.x), shapes.T[..., None], truth.near, truth.far)
        return np.asarray(shapes), errors(left, density, truth)


def _bounded(logs: Array) -> Array:
    return jnp.exp(jnp.clip(logs, -WIDEST, WIDEST))


def _jittered(start: Floats, number: int, by: float) -> Floats:
    """The start itself, and others about it (number, ...)."""
    jitter = by * np.random.default_rng(1).normal(size=(number, *start.shape))
    jitter[0] = 0.0
    return start + jitter


def fit_laws(laws: Sequence[CoefficientLaw], free: Floats, truth: Truth, starts: int) -> list[Floats]:
    """Constants of each law, fitted to all albedos.

    Starts come nearest to the shapes (m, 4) that albedos have on their own, to these with noise, and to those of each
    law fitted before: no law ends worse than a smaller one before it.
    """
    known = list(np.exp(_jittered(np.log(free), starts, JITTER)).transpose(0, 2, 1))
    found = []
    for law in laws:
        bases = law.bases(truth)
        solve = Solver(partial(_law_residual, law))
        found.append(solve([law.start(shapes, bases) for shapes in known], (truth, bases)))
        known.append(law_shapes(law, found[-1], truth)[..., 0])
    return found


def _law_residual(law: CoefficientLaw, constants: Array, data: tuple[Truth, list[Array]]) -> Array:
    truth, bases = data
    return residuals(*HAZARD.curve(truth.x, law.shapes(constants, bases), truth.near, truth.far), truth)


def law_shapes(law: CoefficientLaw, constants: Floats, truth: Truth) -> Floats:
    """(4, m, 1)."""
    with jax.enable_x64(True):
        return np.asarray(law.shapes(jnp.asarray(constants), [jnp.asarray(basis) for basis in law.bases(truth)]))


def judge_law(law: CoefficientLaw, constants: Floats, truth: Truth) -> Errors:
    """Errors of constants at any albedos."""
    shapes = law_shapes(law, constants, truth)
    with jax.enable_x64(True):
        left, density = HAZARD.curve(jnp.asarray(truth.x), jnp.asarray(shapes), truth.near, truth.far)
        return errors(left, density, truth)


class Solver:
    """Least squares of residual(parameters, data) from several starts: compiled once for any data.

    Single problems one after another: a batch of them would wait for its slowest at every form and start.
    """

    def __init__(self, residual: Callable[[Array, Any], Array]) -> None:
        self._residual = jax.jit(residual)
        self._jacobian = jax.jit(jax.jacfwd(residual))

    def __call__(self, starts: Iterable[Floats], data: object) -> Floats:
        """The parameters of the least sum of squares."""
        with jax.enable_x64(True):
            arrays = jax.tree.map(jnp.asarray, data)

            def at(p: Floats) -> tuple[Floats, Floats]:
                return np.asarray(self._residual(p, arrays)), np.nan_to_num(np.asarray(self._jacobian(p, arrays)))

            found = [solve(at, start, gain=GAIN, most=EVALUATIONS) for start in starts]
        return min(found, key=lambda result: result.cost).parameters


def functions(form: Form) -> str:
    """Functions of a profile, its shapes given."""
    shapes = jnp.exp(jnp.array(form.start))
    return described(count(lambda x, near: form.curve(x, shapes, near, 0.5 * near)[1]).point)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few albedos, forms and starts")
    sizes = QUICK if parser.parse_args(arguments).quick else FULL
    fitted, middle = albedos(sizes.albedos)
    truth, between = truth_at(fitted), truth_at(middle)
    measures = ("rel mean", "rel worst", "ks worst")
    fits = {form.name: fit_free(form, truth, sizes.starts) for form in sizes.forms}
    show(
        f"Shapes free at each of {sizes.albedos} albedos in [0.05, 0.995]",
        ("form", "shapes", "functions of R_d", *measures),
        [(f.name, str(len(f.start)), functions(f), *fits[f.name][1].cells()) for f in sizes.forms],
    )
    found = fit_laws(sizes.laws, fits[HAZARD.name][0], truth, sizes.starts)
    show(
        f"Coefficient laws of h, a, b, c in the last form, at {len(middle)} albedos between",
        ("variable", "degrees", "links", "constants", *measures),
        [
            (*_named(law), *judge_law(law, constants, between).cells())
            for law, constants in zip(sizes.laws, found, strict=True)
        ],
    )


def _named(law: CoefficientLaw) -> tuple[str, str, str, str]:
    degrees = ", ".join(map(str, law.degrees))
    variable = f"{law.variable}; kappa in {', '.join(law.with_kappa)}" if law.with_kappa else law.variable
    return variable, degrees, ", ".join(law.links), str(law.constants)


if __name__ == "__main__":
    main()
