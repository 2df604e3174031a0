"""Bases of laws: frozen pytrees whose leaves are their constants, in units of the mfp, and facts about each.

An `Entry` stands beside a law's formula; every list of laws is derived from it. A formula is written once over
jax.numpy, and evaluated in float64 numpy outside of jit, traced inside.
"""

from __future__ import annotations

import abc
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, wraps
from itertools import repeat
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim.exact import single_scattering
from mcml_sim.exact.by_albedo import blocks
from mcml_sim.exact.compiled import jit
from mcml_sim.media.arrays import Floats, checked_numbers, require_all, require_one_shape, require_own_process
from mcml_sim.media.setting import Setting
from profilefit.laws.surface import RefractingSurface


@dataclass(frozen=True)
class Range:
    """Numbers from `low` to `high`, ends included unless open."""

    low: float = 0.0
    high: float = 1.0
    open_low: bool = False
    open_high: bool = False

    def holds(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the values inside."""
        given = np.asarray(values)
        above = given > self.low if self.open_low else given >= self.low
        return above & (given < self.high if self.open_high else given <= self.high)

    def __str__(self) -> str:
        return f"{'(' if self.open_low else '['}{self.low:g}, {self.high:g}{')' if self.open_high else ']'}"


EVERYWHERE = Range()
MATCHED, ANY_INDEX = Range(1.0, 1.0), Range(0.0, np.inf, open_low=True, open_high=True)
ISOTROPIC = Range(0.0, 0.0)
# Arguments that a shader source replaces by others, in words.
NEAR_CLAMPS = "R_d within 1e-6 mfp of the source to that at 1e-6 mfp; xi to 1 - 2^-24"
CLAMPS = f"{NEAR_CLAMPS}; r to 1e8 mfp"
RATIONAL, WRAPPERS = ("rational",), ("wrappers",)


@dataclass(frozen=True)
class Text:
    """The shader source of a law, in files of `profilefit/shader/glsl/`, by their names less .glsl.

    file    its own; `profilefit.shader.emit.prefix` is its name, too
    parts   files that it needs, before it in order; ends files that need it
    clamps  arguments besides A that the source replaces by others, in words
    count   how often its `//% for` blocks stand
    prefix  of its names, if not its file's name
    """

    file: str
    parts: tuple[str, ...] = RATIONAL
    ends: tuple[str, ...] = WRAPPERS
    clamps: str = ""
    count: int = 0
    prefix: str = ""


@dataclass(frozen=True)
class Entry:
    """A law or map as catalogue, recipes, shaders and reports know it.

    name     by which it is loaded, as in the tables of `profilefit.laws`; title what a reader calls it
    is_map   whether it maps between alpha and A, and is no profile
    records  names for Setting() of the records that make up its regenerated constants; a later one adds to earlier ones
    start    constants to fit from where none are printed
    alpha    albedos [-] that it holds for; profile those of its R_d, if not all of them
    xi       shares [-] that its sampler holds for; of fitted constants: print promises all
    n        refractive indices [-] that it is made for; g mean cosines
    as_fitted  whether a fitted inverse of it holds only for the albedos of its record
    own      whether it is this project's own, and must hold wherever it claims to
    text     its shader source, or why there is none
    """

    name: str = ""
    title: str = ""
    is_map: bool = False
    records: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    alpha: Range = EVERYWHERE
    profile: Range = EVERYWHERE
    xi: Range = EVERYWHERE
    n: Range = MATCHED
    g: Range = ISOTROPIC
    as_fitted: bool = False
    own: bool = False
    text: Text | str = ""

    @property
    def key(self) -> str:
        """A name that no other law or map has: "albedo liang" is the map beside the profile law."""
        return f"albedo {self.name}" if self.is_map else self.name

    @property
    def printed(self) -> str:
        """Name among the printed sets of `laws.published`."""
        return f"{self.name}_albedo" if self.is_map else self.name

    @property
    def has_text(self) -> bool:
        return isinstance(self.text, Text)


OF_MAPS = ("albedo", "reflectance", "relative_reflectance")
"""Objectives of maps between alpha and A."""
CLOSED = {"closed": True}
"""Marks a field that is no constant: numbers known in closed form, None for those of the law's own setting."""


# Numbers at a time: a length compiles nothing new, and at most three quarters of a block are filling.
BLOCKS = (64, 256, 1024, 4096, 16384)
# Compiled methods that are kept, those of other settings and laws go: a program takes a megabyte and thirty memory maps
# of the 65 thousand that Linux gives a process.
PROGRAMS = 256

# What an argument of this name may be, wherever it occurs. A mean free path beyond these, in whatever unit, has no
# square in float64; jax arrays of single precision need it within 1e-12 and 1e12, which cannot be checked for them.
SHARE, ANY_LENGTH, POSITIVE = (0.0, 1.0), (0.0, np.inf), (1e-100, 1e100)
RANGES = {"alpha": SHARE, "reflectance": SHARE, "xi": SHARE, "r": ANY_LENGTH, "thickness": ANY_LENGTH, "mfp": POSITIVE}
ACCEPTED = {SHARE: "in [0, 1]", ANY_LENGTH: ">= 0", POSITIVE: "> 0, from 1e-100 to 1e+100"}


def evaluated(method: Callable) -> Callable:
    """Let a method of a law take numbers, lists or numpy arrays and answer in float64: a float for scalars.

    Arguments that are jax arrays (concrete or traced) keep their type, so that a law can be jitted, vmapped and
    differentiated in whatever precision its caller chose. Numbers out of range, and shapes that do not broadcast, raise
    InputError; None for what may be left out leaves it out. The method is compiled for blocks of a few sizes, whatever
    the lengths and the law's constants. Constants may be arrays, too, which broadcast with the arguments.
    """
    signature = inspect.signature(method)
    spare = {name for name, parameter in signature.parameters.items() if parameter.default is None}

    @wraps(method)
    def call(law, *arguments, **named):
        leaves, form = jax.tree.flatten(law)
        if any(isinstance(value, Array) for value in (*leaves, *arguments, *named.values())):
            return method(law, *arguments, **named)
        given = list(signature.bind(law, *arguments, **named).arguments.items())[1:]
        checked = {name: _checked(name, value) for name, value in given if not (value is None and name in spare)}
        if any(np.ndim(leaf) for leaf in leaves):  # many laws at once, as a posterior's draws
            with jax.enable_x64(True):
                return np.asarray(method(law, **{name: jnp.asarray(value) for name, value in checked.items()}))
        out = _in_blocks(_program(method, form, tuple(checked)), [np.asarray(leaf, float) for leaf in leaves], checked)
        return float(out) if out.ndim == 0 else out

    return call


@lru_cache(maxsize=PROGRAMS)
def _program(method: Callable, form: Any, names: tuple[str, ...]) -> Callable:
    """Return the method of a law of this class and setting, compiled: its constants are arguments like any other."""

    def run(leaves: list[Array], *values: Array) -> Array:
        out = method(jax.tree.unflatten(form, leaves), **dict(zip(names, values, strict=True)))
        return jnp.broadcast_to(out, values[0].shape)

    return jit(run)


def _in_blocks(program: Callable, leaves: list[Floats], arguments: dict[str, Floats]) -> Floats:
    """Return the program on arguments broadcast to one shape: a block at a time, but single numbers as they are."""
    arrays = list(arguments.values())
    require_one_shape(**arguments)
    shape = np.broadcast_shapes(*(one.shape for one in arrays))
    count = math.prod(shape)
    size = next((one for one in BLOCKS if count <= one), BLOCKS[-1])
    pieces = [
        repeat(one.reshape(())) if one.size == 1 and at else blocks(np.broadcast_to(one, shape).ravel(), size)
        for at, one in enumerate(arrays)
    ]
    with jax.enable_x64(True):
        parts = [program(leaves, *piece) for piece in zip(*pieces, strict=False)]  # all, before the first is waited for
    return np.concatenate([np.empty(0), *parts])[:count].reshape(shape)


def _checked(name: str, value: Any) -> np.ndarray:
    require_own_process()
    numbers = checked_numbers(name, value, "a number or an array of numbers")
    low, high = span = RANGES.get(name, (-np.inf, np.inf))
    if name in RANGES:
        require_all(name, numbers, (numbers >= low) & (numbers <= high), ACCEPTED[span])
    return numbers


class Constants(eqx.Module):
    """A frozen set of named constants: fit, sampled, recorded and exported under these names.

    entry  what is known of it by name; one that is in no table of `profilefit.laws` needs none
    """

    setting: Setting = eqx.field(static=True)
    entry: ClassVar[Entry] = Entry()

    @classmethod
    def forms(cls) -> dict[str, type[Self]]:
        """Return the classes that go by one name, by what stands behind its colon; "" for the name alone."""
        return {"": cls}

    @classmethod
    def constant_names(cls) -> tuple[str, ...]:
        """Return the names of the constants, in the order of the flattened pytree."""
        return tuple(f.name for f in fields(cls) if not (f.metadata.get("static") or f.metadata.get("closed")))

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        """Return the constants that profiles of one index and g tell apart: all, but for a law that spans them."""
        return cls.constant_names()

    def at(self, setting: Setting) -> Self:
        """Return the law with the same constants, and those of its map, in another setting that they span."""
        given: dict[str, Any] = {"setting": setting}
        if getattr(self, "albedo", None) is not None:
            given["albedo"] = self.albedo.at(setting)  # type: ignore[attr-defined]
        return replace(self, **given)

    def under(self, surface: RefractingSurface | None) -> Self:
        """Return the law under other surfaces, one per profile, if it spans indices; None for its setting's own."""
        return self if surface is None else replace(self, surface=surface)  # type: ignore[call-arg]

    @classmethod
    def seen_by(cls, objective: str) -> tuple[str, ...]:
        """Return the constants that move when this objective is made small; none if it does not apply to the law."""
        del objective
        return cls.constant_names()

    def constants(self) -> dict[str, float]:
        return {name: float(getattr(self, name)) for name in self.constant_names()}

    def text_numbers(self) -> dict[str, float]:
        """Numbers that its shader source needs beside its constants."""
        return {}

    def text_constants(self) -> dict[str, float]:
        """Return the constants of its shader source: every constant, or what they come to at the law's index."""
        return self.constants()

    def folds(self) -> dict[str, dict[str, float]]:
        """Return derivatives of each constant of the shader source by the law's own constants."""
        return {name: {name: 1.0} for name in self.constant_names()}

    def vector(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        return np.array([getattr(self, name) for name in names], float)

    def with_vector(self, names: tuple[str, ...], values) -> Self:
        """Return the law with the named constants replaced: a fit moves these and leaves the others."""
        return replace(self, **{name: values[i] for i, name in enumerate(names)})


class AlbedoLaw(Constants):
    """A closed map between the reduced albedo alpha and the total reflectance A, both in [0, 1]."""

    @classmethod
    def seen_by(cls, objective: str) -> tuple[str, ...]:
        return cls.constant_names() if objective in OF_MAPS else ()

    @abc.abstractmethod
    def alpha(self, reflectance) -> Array:
        """Reduced albedo alpha [-] at total reflectance A [-]."""

    @abc.abstractmethod
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] at reduced albedo alpha [-]."""

    @property
    def reflectances(self) -> Range:
        """Reflectances A [-] that it maps."""
        return EVERYWHERE

    @property
    def albedos(self) -> Range:
        """Albedos alpha [-] that it maps."""
        return EVERYWHERE


class Normalisation(AlbedoLaw):
    """A map that profile laws are scaled to their reflectance with."""

    @property
    def entered(self) -> float:
        """The share of the light that enters [-], which a white half space gives back."""
        assert self.setting.n == 1.0, "a map under a refracting interface says it itself"
        return 1.0

    def text_numbers(self) -> dict[str, float]:
        return {"entered": self.entered}

    @property
    def reflectances(self) -> Range:
        """Range of reflectances: up to what the surface lets out of a white semi-infinite medium."""
        return Range(0.0, self.entered)

    @abc.abstractmethod
    def albedo_over_reflectance(self, alpha) -> Array:
        """Return alpha / A [-], finite at alpha = 0 too."""


class ProfileLaw(Constants):
    """A closed reflectance profile R_d(r; alpha, l) = R_d(r/l; alpha, 1) / l^2 and its cumulated share of energy.

    own_reflectance  whether it has a total reflectance of its own, and none by a map `albedo`
    sampler_class    of the map that draws radii, made of the law
    """

    own_reflectance: ClassVar[bool] = False
    sampler_class: ClassVar[type[Sampler]]

    @classmethod
    def seen_by(cls, objective: str) -> tuple[str, ...]:
        return cls.constant_names() if objective in ("energy", "relative") else ()

    @abc.abstractmethod
    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        """R_d at x = r/l for l = 1 [1/mfp^2]."""

    @abc.abstractmethod
    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        """Share of the reflected energy within x = r/l [-]."""

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        """Energy reflected within x = r/l [-], before any scaling to the exact reflectance: what a fit compares."""
        return self.reflected(alpha) * self.scaled_cdf(x, alpha)

    @abc.abstractmethod
    def source_strength(self, alpha: Array) -> Array:
        """Limit of 2 pi x R_d at x -> 0, before any scaling [1/mfp]; the exact one is alpha / 2."""

    def total(self, alpha) -> Array:
        """Return the total reflectance A [-] that the profile integrates to."""
        return self.albedo.reflectance(alpha)  # type: ignore[attr-defined]

    def reflected(self, alpha: Array) -> Array:
        """Return `total`, or, of a law that spans indices, A at those that it was put under [-]."""
        return self.total(alpha)

    def text_shape(self) -> dict[str, float] | None:
        """Return members of the shape in the shader source by dotted names, for a law of one albedo; else None."""
        return None

    @property
    def is_finite_at_source(self) -> bool:
        """True if R_d stays finite at r = 0, unlike that of a semi-infinite medium."""
        return float(self.source_strength(jnp.array(0.5))) == 0.0

    @property
    def sampler(self) -> Any:
        return self.sampler_class(self)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """Every way to draw radii for this law; "exact" inverts its cdf, to rounding."""
        return {"exact": self.sampler}

    @evaluated
    def profile(self, r, alpha, mfp=1.0) -> Array:
        """R_d(r) [1/length^2]: 2 pi r R_d integrates to the reflectance. `r`, `mfp` in one unit; all broadcast."""
        return self.scaled_profile(r / mfp, alpha) / mfp**2

    @evaluated
    def cdf(self, r, alpha, mfp=1.0) -> Array:
        """Share of the reflected energy within radius r [-]. `r` and `mfp` in one unit; all broadcast."""
        return self.scaled_cdf(r / mfp, alpha)


class EscapeLaw(ProfileLaw):
    """A law whose cdf tends to 1 by itself, scaled to A by `albedo`: R_d = A `scaled_density` / (2 pi x)."""

    albedo: Normalisation = eqx.field(static=True)

    @abc.abstractmethod
    def scaled_density(self, x: Array, alpha: Array) -> Array:
        """2 pi x R_d / A [1/mfp], finite at x = 0."""

    def text_numbers(self) -> dict[str, float]:
        """Return the strength at the source over alpha, lim 2 pi x R_d / alpha [1/mfp]."""
        return {"source": single_scattering.source_strength(self.setting)}

    def source_hazard(self, alpha) -> Array:
        """lambda_0 = lim 2 pi x R_d / A at x = 0 [1/mfp]: light scattered once, exact, over A."""
        return single_scattering.source_strength(self.setting) * self.albedo.albedo_over_reflectance(alpha)

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        near = jnp.maximum(x, jnp.finfo(jnp.result_type(x, float)).tiny)
        value = self.reflected(alpha) * self.scaled_density(near, alpha) / (2.0 * jnp.pi * near)
        return jnp.where((x > 0) | (alpha == 0), value, jnp.inf)

    def source_strength(self, alpha: Array) -> Array:
        return single_scattering.source_strength(self.setting) * alpha


class Sampler(eqx.Module):
    """A map from a uniform number to a radius, with the density that this very map has.

    An approximate inverse does not sample its law: an estimator must divide by `pdf`, not by the law's own density.
    """

    law: eqx.AbstractVar[ProfileLaw]

    @abc.abstractmethod
    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        """Return x = r/l at xi in [0, 1)."""

    @abc.abstractmethod
    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        """Density in x = r/l of `scaled_sample(xi)`, xi uniform in [0, 1), atoms left out [1/mfp]."""

    def scaled_undone(self, x: Array, xi: Array, alpha: Array) -> Array:
        """Return the uniform number that an exact inverse sends to x; of several the one nearest to xi."""
        del xi
        return self.law.scaled_cdf(x, alpha)

    def jump(self, alpha: Array) -> Array:
        """Return xi at which radii begin at 0 anew, as another part of the light is drawn; 1 where none does."""
        return jnp.ones_like(alpha)

    @evaluated
    def undone(self, r, xi, alpha, mfp=1.0) -> Array:
        """Return xi [-] of a drawn radius: |undone(sample(xi), xi) - xi| is the inversion's error. All broadcast."""
        return self.scaled_undone(r / mfp, xi, alpha)

    @evaluated
    def sample(self, xi, alpha, mfp=1.0) -> Array:
        """Radius [length] for a uniform number xi in [0, 1). All broadcast."""
        return self.scaled_sample(xi, alpha) * mfp

    @evaluated
    def pdf(self, r, alpha, mfp=1.0) -> Array:
        """Density in r of `sample` [1/length], so that it integrates to 1 less the sampler's atoms. All broadcast."""
        return self.scaled_pdf(r / mfp, alpha) / mfp
