"""The profile laws that are timed against each other, each in its fastest form."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jax.numpy as jnp
from jax import Array

import profilefit
from profilefit.errors import InputError, RecordError
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.burley import XIE, Burley, BurleyApproximateSampler
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.quantile import Quantile, radius

Setup = Callable[[Array], Any]
YARDSTICK = "normalized diffusion"


class FastBurley(Burley):
    """Normalized diffusion as a shader has it: one exponential, its cube, and no guard at x = 0."""

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        rate = self.falloff_rate(alpha)
        e = jnp.exp(x * (rate * (-1.0 / 3.0)))
        return self.albedo.reflectance(alpha) * rate / (8.0 * jnp.pi) * (e + e * e * e) / x

    @property
    def sampler(self) -> FastBurleySampler:
        return FastBurleySampler(self)


class FastBurleySampler(Sampler):
    """Golubev's inverse with its cube root as e^{ln(G) / 3}: on XLA's CPU jnp.cbrt takes ten times as long."""

    law: FastBurley

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        u = 1.0 - xi
        root = jnp.exp(jnp.log(1.0 + 4.0 * u * (2.0 * u + jnp.sqrt(1.0 + 4.0 * u * u))) * (1.0 / 3.0))
        return 3.0 / self.law.falloff_rate(alpha) * jnp.log((1.0 + 1.0 / root + root) / (4.0 * u))

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        return self.law.scaled_profile(x, alpha) * (2.0 * jnp.pi) * x / self.law.albedo.reflectance(alpha)


class FastApproximateSampler(BurleyApproximateSampler):
    """Xie's inverse with ln(1 - xi): on XLA's CPU jnp.log1p takes five times as long."""

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return ((2.0 - self.c) * xi - 2.0) * jnp.log(1.0 - xi) / self.law.falloff_rate(alpha)


@dataclass(frozen=True)
class Contender:
    """A law with one of its samplers.

    constants   fitted, of the profile and besides of the sampler alone; those of A(alpha) not counted
    setup       what depends on alpha only, where the law tells it
    another     whether it is another sampler of the law of the contender before
    """

    name: str
    law: ProfileLaw
    sampler: Sampler
    constants: tuple[int, int]
    setup: Setup | None
    another: bool = False

    def profile(self, x: Array, alpha: Array) -> Array:
        return self.law.scaled_profile(x, alpha)

    def sample(self, xi: Array, alpha: Array) -> Array:
        return self.sampler.scaled_sample(xi, alpha)

    def both(self, xi: Array, alpha: Array) -> tuple[Array, Array]:
        """A radius, and the profile there."""
        x = self.sample(xi, alpha)
        return x, self.profile(x, alpha)


class QuantileContender(Contender):
    """A fitted inverse knows its density where it has drawn; from a radius alone a loop must find it."""

    law: Quantile

    def both(self, xi: Array, alpha: Array) -> tuple[Array, Array]:
        left = jnp.maximum(1.0 - xi, jnp.finfo(xi.dtype).tiny)
        x, slope = radius(-jnp.log(left), self.law.curve(alpha))
        return x, self.law.albedo.reflectance(alpha) * left / (2.0 * jnp.pi * x * slope)


# Label, law, constants; what is loaded but cannot be had is left out.
WANTED = (
    (YARDSTICK, "burley", "published"),
    ("normalized diffusion, refitted", "burley", "regenerated"),
    ("Liang, printed", "liang", "published"),
    ("Liang, corrected", "liang", "corrected"),
    ("Liang, refitted", "liang", "regenerated"),
    ("dipole", "dipole", "published"),
    ("better dipole", "better_dipole", "published"),
    ("beam diffusion", "beam_diffusion", "published"),
    ("Gaussians", "gaussians", "regenerated"),
    ("quantile", "quantile", "regenerated"),
    ("hazard", "hazard", "regenerated"),
)


def contenders(folder: Path | None = None) -> tuple[list[Contender], list[str]]:
    """All that load, with the regenerated constants in `folder`; and a line for each that does not."""
    found: list[Contender] = []
    left_out = []
    for label, name, constants in WANTED:
        try:
            law = profilefit.load(name, constants, folder=folder)
        except (InputError, RecordError) as error:
            left_out.append(f"{label}: {error}")
        else:
            found += made(label, law)
    return found, left_out


def made(label: str, law: ProfileLaw) -> Iterator[Contender]:
    """A law with each sampler that costs another time."""
    if isinstance(law, Burley):
        fast = FastBurley(law.setting, law.albedo, **law.constants())
        yield _contender(label, fast, fast.sampler, partial(_burley_setup, fast))
        if label == YARDSTICK:
            sampler = FastApproximateSampler(fast, XIE)
            yield _contender(f"{label}, Xie's sampler", fast, sampler, partial(_burley_setup, fast), another=True)
    elif isinstance(law, Hazard):
        yield _contender(label, law, law.sampler, law.shape)
        yield _contender(f"{label}, two steps", law, law.samplers["two steps"], law.shape, another=True)
    elif isinstance(law, Liang):
        yield _contender(label, law, law.sampler, partial(_liang_setup, law))
    elif isinstance(law, Quantile):
        yield QuantileContender(label, law, law.sampler, _constants(law), law.curve)
    else:
        yield _contender(label, law, law.sampler, None)


def _contender(label: str, law: ProfileLaw, sampler: Sampler, setup: Setup | None, another: bool = False) -> Contender:
    return Contender(label, law, sampler, _constants(law), setup, another)


def _constants(law: ProfileLaw) -> tuple[int, int]:
    of_profile = len(law.seen_by("energy"))
    return of_profile, len(law.constant_names()) - of_profile


def _burley_setup(law: FastBurley, alpha: Array) -> tuple[Array, Array]:
    return law.albedo.reflectance(alpha), law.falloff_rate(alpha)


def _liang_setup(law: Liang, alpha: Array) -> tuple[Array, ...]:
    """Coefficients of the profile and its scale, and those of the sampler   (11)-(15), (18), (20)."""
    k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
    k2 = law.h1 * alpha ** (law.h2 * alpha + law.h3)
    return *law.coefficients(alpha), law.albedo.reflectance(alpha) / law.unscaled_energy(jnp.inf, alpha), k1, k2
