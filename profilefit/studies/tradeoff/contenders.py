"""Profile laws that are timed against each other, each in its fastest form."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim import exact
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.burley import (
    XIE,
    Burley,
    BurleyApproximateSampler,
    BurleyDiffuseMfp,
    BurleySampler,
    NormalizedDiffusion,
)
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.quantile import Quantile, radius
from profilefit.laws.rational import Normalisation
from profilefit.laws.two_parts import TwoPartHazard
from profilefit.recipes import catalogue
from profilefit.scenes.stage.exact_law import FARTHEST, NEAREST, STEP, Curves, exact_table

Setup = Callable[[Array], Any]
YARDSTICK = "normalized diffusion"


class LawSpec(NamedTuple):
    """A law with its constants, and the refractive index and mean cosine that it is timed and judged at."""

    label: str
    law: str
    constants: str
    n: float = 1.0
    g: float = 0.0


class Fast(NormalizedDiffusion):
    """Normalized diffusion as a shader has it: one exponential, its cube, and no guard at x = 0."""

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        rate = self.falloff_rate(alpha)
        e = jnp.exp(x * (rate * (-1.0 / 3.0)))
        return self.albedo.reflectance(alpha) * rate / (8.0 * jnp.pi) * (e + e * e * e) / x

    @property
    def sampler(self) -> BurleySampler:
        return FastBurleySampler(self)


class FastBurley(Fast, Burley):
    """Fast normalized diffusion in units of the mean free path."""

    setting: Setting = eqx.field(static=True)
    albedo: Normalisation = eqx.field(static=True)


class FastBurleyDiffuseMfp(Fast, BurleyDiffuseMfp):
    """Fast normalized diffusion in units of the diffuse mean free path."""

    setting: Setting = eqx.field(static=True)
    albedo: Normalisation = eqx.field(static=True)


class FastBurleySampler(BurleySampler):
    """Golubev's inverse with its cube root as e^{ln(G) / 3}: on XLA's CPU jnp.cbrt takes ten times as long."""

    law: Fast

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
    """Law with one of its samplers.

    setup       what depends on alpha only, where the law separates it
    judged      the sampler in the law's own form, guarded where the fast one is not: errors are of this
    another     whether it is another sampler of the law of the contender before
    """

    name: str
    law: ProfileLaw
    sampler: Sampler
    setup: Setup | None
    judged: Sampler
    another: bool = False

    @property
    def constants(self) -> tuple[int, int]:
        """Numbers of fitted constants of the profile, and of the sampler alone; those of A(alpha) do not count."""
        of_profile = len(self.law.seen_by("energy"))
        return of_profile, len(self.law.constant_names()) - of_profile

    def profile(self, x: Array, alpha: Array) -> Array:
        return self.law.scaled_profile(x, alpha)

    def sample(self, xi: Array, alpha: Array) -> Array:
        return self.sampler.scaled_sample(xi, alpha)

    def both(self, xi: Array, alpha: Array) -> tuple[Array, Array]:
        """Return a radius, and the profile there."""
        x = self.sample(xi, alpha)
        return x, self.profile(x, alpha)

    @property
    def parts(self) -> dict[str, Callable[[Array, Array], Any]]:
        """Functions to be timed, by name: the profile of a law once, whatever its samplers."""
        drawn: dict[str, Callable[[Array, Array], Any]] = {"sample": self.sample, "both": self.both}
        return drawn if self.another else {"profile": self.profile, **drawn}


class QuantileContender(Contender):
    """Fitted inverse, which knows its density where it has drawn; from a radius alone a loop must find it."""

    law: Quantile

    def both(self, xi: Array, alpha: Array) -> tuple[Array, Array]:
        left = jnp.maximum(1.0 - xi, jnp.finfo(xi.dtype).tiny)
        x, slope = radius(-jnp.log(left), self.law.curve(alpha))
        return x, self.law.albedo.reflectance(alpha) * left / (2.0 * jnp.pi * x * slope)


# Those that do not load are left out.
SPECS: tuple[LawSpec, ...] = (
    LawSpec(YARDSTICK, "burley", "published"),
    LawSpec("normalized diffusion, refitted", "burley", "regenerated"),
    LawSpec("normalized diffusion, by its own mfp", "burley_diffuse_mfp", "published"),
    LawSpec("Liang, printed", "liang", "published"),
    LawSpec("Liang, corrected", "liang", "corrected"),
    LawSpec("Liang, refitted", "liang", "regenerated"),
    LawSpec("dipole", "dipole", "published"),
    LawSpec("better dipole", "better_dipole", "published"),
    LawSpec("beam diffusion", "beam_diffusion", "published"),
    LawSpec("2 Gaussians", "gaussians:2", "regenerated"),
    LawSpec("4 Gaussians", "gaussians:4", "regenerated"),
    LawSpec("6 Gaussians", "gaussians:6", "regenerated"),
    LawSpec("quantile", "quantile", "regenerated"),
    LawSpec("hazard", "hazard", "regenerated"),
    LawSpec("hazard, n = 1.4", "hazard", "regenerated", 1.4),
    LawSpec("hazard, n = 1.4, g = 0.8", "hazard", "regenerated", 1.4, 0.8),
)


def contenders(folder: Path | None = None, specs: Sequence[LawSpec] | None = None) -> tuple[list[Contender], list[str]]:
    """Return all laws that load, by default of `SPECS`, with the constants in `folder`, and a line for each other.

    Raises InputError where the yardstick itself is missing.
    """
    loaded: list[Contender] = []
    left_out = []
    for one in specs or SPECS:
        setting = None if (one.n, one.g) == (1.0, 0.0) else Setting(n=one.n, g=one.g)
        try:
            law = catalogue.load(one.law, one.constants, setting, folder)
        except (InputError, RecordError) as error:
            left_out.append(f"{one.label}: {error}")
        else:
            loaded += with_samplers(one.label, law)
    if not any(one.name == YARDSTICK for one in loaded):
        raise InputError(f"laws must have {YARDSTICK} among them, which all times are over, got {left_out or specs}")
    return loaded, left_out


def with_samplers(label: str, law: ProfileLaw) -> Iterator[Contender]:
    """Yield a law with each sampler that costs another time."""
    if isinstance(law, Burley):
        fast = FastBurley(law.setting, law.albedo, **law.constants())
        yield _contender(label, fast, fast.sampler, partial(_burley_setup, fast), law.sampler)
        if label == YARDSTICK:
            sampler = FastApproximateSampler(fast, XIE)
            setup = partial(_burley_setup, fast)
            yield _contender(f"{label}, Xie's sampler", fast, sampler, setup, law.samplers["xie"], another=True)
    elif isinstance(law, BurleyDiffuseMfp):
        own = FastBurleyDiffuseMfp(law.setting, law.albedo, **law.constants())
        yield _contender(label, own, own.sampler, partial(_burley_setup, own), law.sampler)
    elif isinstance(law, Hazard | TwoPartHazard):
        of_alpha: Setup = law.shape if isinstance(law, Hazard) else law.parts
        yield _contender(label, law, law.sampler, of_alpha)
        for steps, other in law.samplers.items():
            if other != law.sampler:
                yield _contender(f"{label}, {steps}", law, other, of_alpha, another=True)
    elif isinstance(law, Liang):
        yield _contender(label, law, law.sampler, partial(_liang_setup, law))
    elif isinstance(law, Quantile):
        yield QuantileContender(label, law, law.sampler, law.curve, law.sampler)
    else:
        yield _contender(label, law, law.sampler, None)


def _contender(
    label: str,
    law: ProfileLaw,
    sampler: Sampler,
    setup: Setup | None,
    judged: Sampler | None = None,
    another: bool = False,
) -> Contender:
    return Contender(label, law, sampler, setup, judged or sampler, another)


def _burley_setup(law: Fast, alpha: Array) -> tuple[Array, Array]:
    return law.albedo.reflectance(alpha), law.falloff_rate(alpha)


def _liang_setup(law: Liang, alpha: Array) -> tuple[Array, ...]:
    """Return the coefficients of the profile and its scale, and those of the sampler   (11)-(15), (18), (20)."""
    k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
    k2 = law.h1 * alpha ** (law.h2 * alpha + law.h3)
    return *law.coefficients(alpha), law.albedo.reflectance(alpha) / law.unscaled_energy(jnp.inf, alpha), k1, k2


Floats = NDArray[np.float64]
NAME = "exact, tabulated"
SEARCHLIGHT = Setting()


@dataclass(frozen=True)
class TabulatedRadii:
    """Exact half space under a searchlight, by cubics between knots of ln r, with the methods of a law.

    Methods take one albedo, or several (m, 1) at radii (m, n) with mean free paths (m, 1).
    """

    setting: Setting = SEARCHLIGHT

    def curves(self, alpha: float) -> Curves:
        """Return the cubics of one albedo."""
        return exact_table(self.setting).curves([float(exact.reflectance(alpha, self.setting))])

    def profile(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Return R_d [1/length^2], looked up in float32: its rounding is nearly all of the error."""
        length = np.asarray(mfp, float)
        x = np.asarray(r, float) / length
        return self._each(lambda curves, x: looked_up(curves, jnp.asarray(x, jnp.float32)), x, alpha) / length**2

    def cdf(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Return the share of the energy within radii [-]."""
        x = np.asarray(r, float) / np.asarray(mfp, float)
        return self._each(lambda curves, x: curves.share(x[None])[0], x, alpha)

    def _each(self, answer: Callable[[Curves, Floats], Any], x: Floats, alpha: ArrayLike) -> Floats:
        if np.ndim(alpha) == 0:
            return np.asarray(answer(self.curves(float(np.asarray(alpha))), x), float)
        return np.stack([self._each(answer, row, one) for row, one in zip(x, np.ravel(alpha), strict=True)])


def looked_up(curves: Curves, x: Array) -> Array:
    """Return R_d [1/mfp^2] at x [mfp]: a logarithm for the place, four numbers of the table, an exponential."""
    rows = jnp.asarray(curves.profile[0], x.dtype)
    near = jnp.clip(x, NEAREST, FARTHEST)
    place = (jnp.log(near) - float(np.log(NEAREST))) * (1.0 / STEP)
    k = jnp.minimum(place.astype(int), len(rows) - 1)
    t, c = place - k, rows[k]
    cubic = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
    return float(curves.reflectance[0]) * jnp.exp(cubic - float(curves.kappa[0]) * near)


@dataclass(frozen=True)
class TableContender(Contender):
    """Table of one material, whatever the albedo, without a sampler."""

    curves: Curves | None = None

    @property
    def constants(self) -> tuple[int, int]:
        return 0, 0

    def profile(self, x: Array, alpha: Array) -> Array:
        if self.curves is None:
            raise ValueError("a table contender needs curves")
        del alpha
        return looked_up(self.curves, x)

    @property
    def parts(self) -> dict[str, Any]:
        return {"profile": self.profile}


def table_contender(material: float) -> TableContender:
    """Return the table as a contender; its error is that at every albedo, its time that of one material."""
    law: Any = TabulatedRadii()
    return TableContender(NAME, law, law, None, law, curves=law.curves(material))
