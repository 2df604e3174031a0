"""Phase functions of few constants, as fits and shaders have them: terms of Henyey and Greenstein, and Fournier-Forand.

`recipes.phases` fits them. A form maps unbounded parameters, which least squares moves, to its
constants, and these to the phase function.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mcml_sim.media.arrays import Floats, is_number, require
from mcml_sim.media.phase import FournierForand, HenyeyGreenstein, Mixture, Phase

LEAST_G = 0.30664  # at which the second term of Haltrin's form has h = 0
CUBIC = (-0.3061446, 1.000568, -0.01826332, 0.03643748)
MOST_TERMS = 4
RANGES = (1.0, 1.5), (3.0, 5.0)  # of Fournier and Forand's n and mu in a fit
OFF = 0.003, 0.4  # 1 - g of forward terms that fits start from
NODES = 64


class Haltrin(NamedTuple):
    """Weight of HG(g), and h: the rest of the light is scattered by HG(-h) [-]."""

    weight: float
    g: float
    h: float


def haltrin(g: float) -> Haltrin:
    """Return the two-term form of one parameter of Li et al. 2011, their (6) (Haltrin, Appl. Opt. 41, 1022, 2002).

    g  asymmetry of the forward term [-], in (0.30664, 1]; InputError elsewhere

    h is the cubic's that a regression of mean cosines on backscattered shares left, and the weight follows from the
    condition that the mean of P_2 is the mean cosine. Petzold's waters fulfil neither: a fit of both terms is
    four times as near to them.
    """
    require(is_number(g) and LEAST_G < g <= 1, "g", f"in ({LEAST_G}, 1]", g)
    return Haltrin(*(float(value) for value in _haltrin(g)))


def _haltrin(g: Any) -> tuple[Any, Any, Any]:
    h = CUBIC[0] + g * (CUBIC[1] + g * (CUBIC[2] + g * CUBIC[3]))
    return h * (1 + h) / ((g + h) * (1 + h - g)), g, h


def regression(share: float) -> float:
    """Return the mean cosine that goes with a backscattered share [-], by the regression behind Haltrin's cubic."""
    return 2 * (1 - 2 * share) / (2 + share)


def backscattered(phase: Phase) -> float:
    """Share of all scatterings that turn the light by more than 90 degrees [-]."""
    return float(phase.invert(0.0))


@dataclass(frozen=True)
class PhaseForm(ABC):
    """Form of a phase function: its name, its title for readers, and the names of its constants, in their order."""

    name: str
    title: str
    names: tuple[str, ...]

    @property
    def free(self) -> int:
        """Numbers that a fit moves."""
        return len(self.names)

    @abstractmethod
    def constants(self, parameters: Array) -> Array:
        """(names,) of unbounded parameters (free,)."""

    @abstractmethod
    def phase(self, constants: Sequence[Any] | Array) -> Phase:
        """Return the phase function of constants (names,), unchecked."""

    @abstractmethod
    def starts(self, random: np.random.Generator, count: int) -> Floats:
        """(count, free) parameters to start from."""

    def mean_cosine(self, constants: Array) -> Array:
        """Return moments of the phase function of constants (names,) [-]."""
        return self.phase(constants).mean_cosine


class HenyeyTerms(PhaseForm):
    """1 to 4 terms: g1 ... gN, and w1 ... wN, which sum to 1."""

    @property
    def count(self) -> int:
        """Number of terms."""
        return (len(self.names) + 1) // 2

    @property
    def free(self) -> int:
        """One weight is what the others leave."""
        return 2 * self.count - 1

    def constants(self, parameters: Array) -> Array:
        """Return the terms in their order from forward to backward."""
        g = jnp.tanh(parameters[: self.count])
        if self.count == 1:
            return g
        order = jnp.argsort(-g)
        weights = jax.nn.softmax(jnp.append(0.0, parameters[self.count :]))
        return jnp.concatenate([g[order], weights[order]])

    def phase(self, constants: Sequence[Any] | Array) -> Phase:
        terms = tuple(HenyeyGreenstein.of(g=constants[i]) for i in range(self.count))
        if self.count == 1:
            return terms[0]
        return Mixture.of(weights=tuple(constants[self.count + i] for i in range(self.count)), phases=terms)

    def starts(self, random: np.random.Generator, count: int) -> Floats:
        """All terms but the last one forward, as sharp as sea water's or as blunt as milk's."""
        off = np.exp(random.uniform(np.log(OFF[0]), np.log(OFF[1]), (count, max(self.count - 1, 1))))
        last = np.arctanh(random.uniform(-0.9, 0.9, (count, self.count - off.shape[1])))
        weights = random.normal(0.0, 1.0, (count, self.count - 1))
        if self.count > 1:
            weights[:, -1] -= random.uniform(0.0, 6.0, count)
        return np.concatenate([np.arctanh(1 - off), last, weights], axis=1)


class HaltrinForm(PhaseForm):
    """One parameter."""

    def constants(self, parameters: Array) -> Array:
        return LEAST_G + (1 - LEAST_G) * jax.nn.sigmoid(parameters)

    def phase(self, constants: Sequence[Any] | Array) -> Phase:
        weight, g, h = _haltrin(constants[0])
        return Mixture.of(weights=(weight, 1 - weight), phases=(HenyeyGreenstein.of(g=g), HenyeyGreenstein.of(g=-h)))

    def starts(self, random: np.random.Generator, count: int) -> Floats:
        return random.uniform(0.0, 5.0, (count, 1))


class Forand(PhaseForm):
    """n and mu."""

    def constants(self, parameters: Array) -> Array:
        shares = jax.nn.sigmoid(parameters)
        return jnp.stack([low + (high - low) * share for (low, high), share in zip(RANGES, shares, strict=True)])

    def phase(self, constants: Sequence[Any] | Array) -> Phase:
        return FournierForand.of(n=constants[0], mu=constants[1])

    def starts(self, random: np.random.Generator, count: int) -> Floats:
        return np.column_stack([random.uniform(-3.0, 0.0, count), random.uniform(-2.0, 2.0, count)])

    def mean_cosine(self, constants: Array) -> Array:
        """1 less the integral of the share that is turned farther: what the cumulative distribution leaves."""
        x, w = np.polynomial.legendre.leggauss(NODES)
        x = (x + 1) / 2
        u = 2 * x**4  # the share rises as a small power of u
        return 1 - jnp.sum(4 * x**3 * w * self.phase(constants).invert(1 - jnp.asarray(u)))


def _terms(count: int) -> HenyeyTerms:
    places = range(1, count + 1)
    weights = tuple(f"w{i}" for i in places) if count > 1 else ()
    words = ("one term", "two terms", "three terms", "four terms")[count - 1]
    names = (*(f"g{i}" for i in places), *weights)
    return HenyeyTerms(f"{count}-term{'s' * (count > 1)}", f"Henyey-Greenstein, {words}", names)


FORMS: Mapping[str, PhaseForm] = {
    form.name: form
    for form in (
        *(_terms(count) for count in range(1, MOST_TERMS + 1)),
        HaltrinForm("haltrin", "Haltrin's two terms of one parameter", ("g",)),
        Forand("fournier-forand", "Fournier and Forand", ("n", "mu")),
    )
}
