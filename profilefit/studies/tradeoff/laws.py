"""Profile laws: nanoseconds of an evaluation, on one core in float32, against the error of R_d.

All that depends on the albedo only is computed beforehand, as for a shader's constants. Every law is in its fastest
form and takes its turn; its time is that over normalized diffusion's in the same turn, in units of that one's median,
so that what disturbs a turn disturbs no comparison. Errors are `rel` against the exact half space, at albedos to which
nothing was fitted: the mean over them, and the worst. Transcendental functions are counted in what jax traces.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.extend import core
from jax.interpreters import partial_eval
from numpy.typing import ArrayLike

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError
from profilefit.fitting.quality import profile_quality
from profilefit.laws.base import ProfileLaw
from profilefit.laws.burley import XIE, Burley, BurleyDiffuseMfp
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.quantile import Quantile, radius
from profilefit.laws.two_parts import TwoPartHazard
from profilefit.recipes import catalogue
from profilefit.scenes.stage.exact_law import FARTHEST, NEAREST, STEP, Curves, exact_table
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Rates, Ratio, Track, Work, silent, take_turns

Function = Callable[[Array, Array], Any]
YARDSTICK, TABLE = "normalized diffusion", "exact, tabulated"


class LawSpec(NamedTuple):
    """A law with its constants, and the refractive index and mean cosine that it is timed and judged at."""

    label: str
    law: str
    constants: str
    n: float = 1.0
    g: float = 0.0


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
    *(LawSpec(f"{count} Gaussians", f"gaussians:{count}", "regenerated") for count in (2, 4, 6)),
    LawSpec("quantile", "quantile", "regenerated"),
    LawSpec("hazard", "hazard", "regenerated"),
    LawSpec("hazard, n = 1.4", "hazard", "regenerated", 1.4),
    LawSpec("hazard, n = 1.4, g = 0.8", "hazard", "regenerated", 1.4, 0.8),
)


@dataclass(frozen=True, eq=False)
class Contender:
    """Law with one of its samplers.

    sampler  None for a table, which has radii only
    setup    what depends on alpha only, where the law separates it
    another  whether it is another sampler of the law of the contender before
    fast     by part, forms without guards that are faster than the law's: they are timed, and the law's are judged
    """

    name: str
    law: ProfileLaw
    sampler: Any
    setup: Callable[[Array], Any] | None = None
    another: bool = False
    fast: Mapping[str, Function] = field(default_factory=dict)

    @property
    def constants(self) -> tuple[int, int]:
        """Numbers of fitted constants of the profile, and of the sampler alone; those of A(alpha) do not count."""
        if self.sampler is None:
            return 0, 0
        of_profile = len(self.law.seen_by("energy"))
        return of_profile, len(self.law.constant_names()) - of_profile

    def profile(self, x: Array, alpha: Array) -> Array:
        function = self.fast.get("profile") or self.law.scaled_profile
        return function(x, alpha)

    def sample(self, xi: Array, alpha: Array) -> Array:
        function = self.fast.get("sample") or self.sampler.scaled_sample
        return function(xi, alpha)

    def both(self, xi: Array, alpha: Array) -> tuple[Array, Array]:
        """Return a radius, and the profile there."""
        if "both" in self.fast:
            return self.fast["both"](xi, alpha)
        x = self.sample(xi, alpha)
        return x, self.profile(x, alpha)

    @property
    def parts(self) -> dict[str, Function]:
        """Functions to be timed, by name: the profile of a law once, whatever its samplers."""
        drawn: dict[str, Function] = {} if self.sampler is None else {"sample": self.sample, "both": self.both}
        return drawn if self.another else {"profile": self.profile, **drawn}


def contenders(folder: Path | None = None, specs: Sequence[LawSpec] | None = None) -> tuple[list[Contender], list[str]]:
    """Return all laws that load, by default of `SPECS`, and a line for each other; InputError without the yardstick."""
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
    if isinstance(law, Burley | BurleyDiffuseMfp):
        (profile, exactly, xie), setup = _fast_burley(law), partial(_burley_setup, law)
        yield Contender(label, law, law.sampler, setup, fast={"profile": profile, "sample": exactly})
        if label == YARDSTICK:
            given = law, law.samplers["xie"], setup
            yield Contender(f"{label}, Xie's sampler", *given, another=True, fast={"profile": profile, "sample": xie})
    elif isinstance(law, Hazard | TwoPartHazard):
        of_alpha = law.shape if isinstance(law, Hazard) else law.parts
        yield Contender(label, law, law.sampler, of_alpha)
        for steps, other in law.samplers.items():
            if other != law.sampler:
                yield Contender(f"{label}, {steps}", law, other, of_alpha, another=True)
    elif isinstance(law, Quantile):
        yield Contender(label, law, law.sampler, law.curve, fast={"both": partial(_quantile_both, law)})
    else:
        yield Contender(label, law, law.sampler, partial(_liang_setup, law) if isinstance(law, Liang) else None)


def _fast_burley(law: Burley | BurleyDiffuseMfp) -> tuple[Function, Function, Function]:
    """Return R_d with one exponential and its cube, without a guard at x = 0; Golubev's inverse, and Xie's.

    The inverses have e^{ln(G) / 3} for a cube root and ln(1 - xi): on XLA's CPU jnp.cbrt takes ten times as long, and
    jnp.log1p five times.
    """

    def profile(x: Array, alpha: Array) -> Array:
        rate = law.falloff_rate(alpha)
        e = jnp.exp(x * (rate * (-1.0 / 3.0)))
        return law.albedo.reflectance(alpha) * rate / (8.0 * jnp.pi) * (e + e * e * e) / x

    def exactly(xi: Array, alpha: Array) -> Array:
        u = 1.0 - xi
        root = jnp.exp(jnp.log(1.0 + 4.0 * u * (2.0 * u + jnp.sqrt(1.0 + 4.0 * u * u))) * (1.0 / 3.0))
        return 3.0 / law.falloff_rate(alpha) * jnp.log((1.0 + 1.0 / root + root) / (4.0 * u))

    def xie(xi: Array, alpha: Array) -> Array:
        return ((2.0 - XIE) * xi - 2.0) * jnp.log(1.0 - xi) / law.falloff_rate(alpha)

    return profile, exactly, xie


def _burley_setup(law: Burley | BurleyDiffuseMfp, alpha: Array) -> tuple[Array, Array]:
    return law.albedo.reflectance(alpha), law.falloff_rate(alpha)


def _quantile_both(law: Quantile, xi: Array, alpha: Array) -> tuple[Array, Array]:
    """Return a radius of a fitted inverse, and R_d by the density that it has there: from x alone a loop finds it."""
    left = jnp.maximum(1.0 - xi, jnp.finfo(xi.dtype).tiny)
    x, slope = radius(-jnp.log(left), law.curve(alpha))
    return x, law.albedo.reflectance(alpha) * left / (2.0 * jnp.pi * x * slope)


def _liang_setup(law: Liang, alpha: Array) -> tuple[Array, ...]:
    """Return the coefficients of the profile and its scale, and those of the sampler   (11)-(15), (18), (20)."""
    k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
    k2 = law.h1 * alpha ** (law.h2 * alpha + law.h3)
    return *law.coefficients(alpha), law.albedo.reflectance(alpha) / law.unscaled_energy(jnp.inf, alpha), k1, k2


@dataclass(frozen=True)
class TabulatedRadii:
    """Exact half space under a searchlight, by cubics between knots of ln r, with the methods of a law.

    Methods take one albedo, or several (m, 1) at radii (m, n) with mean free paths (m, 1).
    """

    setting: Setting = exact.SEARCHLIGHT

    def curves(self, alpha: ArrayLike) -> Curves:
        """Return the cubics of albedos."""
        return exact_table(self.setting).curves(np.ravel(exact.reflectance(alpha, self.setting)))

    def profile(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Return R_d [1/length^2], looked up in float32: its rounding is nearly all of the error."""
        length = np.asarray(mfp, float)
        x = np.asarray(r, float) / length
        each = zip(map(self.curves, np.ravel(alpha)), jnp.asarray(np.atleast_2d(x), jnp.float32), strict=True)
        return np.stack([looked_up(*one) for one in each]).astype(float).reshape(x.shape) / length**2

    def cdf(self, r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0) -> Floats:
        """Return the share of the energy within radii [-]."""
        x = np.asarray(r, float) / np.asarray(mfp, float)
        return self.curves(alpha).share(np.atleast_2d(x)).reshape(x.shape)


def looked_up(curves: Curves, x: Array) -> Array:
    """Return R_d [1/mfp^2] at x [mfp]: a logarithm for the place, four numbers of the table, an exponential."""
    rows = jnp.asarray(curves.profile[0], x.dtype)
    near = jnp.clip(x, NEAREST, FARTHEST)
    place = (jnp.log(near) - float(np.log(NEAREST))) * (1.0 / STEP)
    k = jnp.minimum(place.astype(int), len(rows) - 1)
    t, c = place - k, rows[k]
    cubic = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
    return float(curves.reflectance[0]) * jnp.exp(cubic - float(curves.kappa[0]) * near)


def table_contender() -> Contender:
    """Return the table as a contender; its error is that at every albedo, its time that of one material."""
    law: Any = TabulatedRadii()
    curves = law.curves(MATERIAL)
    return Contender(TABLE, law, None, fast={"profile": lambda x, _: looked_up(curves, x)})


# All that a processor has no instruction for, or a slow one; products, quotients and whole powers are not counted.
COUNTED = (
    *("exp", "exp2", "expm1", "log", "log1p", "pow", "cbrt", "sqrt", "rsqrt"),
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("erf", "erfc", "erf_inv", "lgamma", "logistic"),
)
# An axis of this length is the points'; a prime that no law has for a number of nodes.
POINTS = 1009


@dataclass(frozen=True)
class FunctionCounts:
    """Functions by name: `point` for each point, `material` for each albedo, whatever the number of points."""

    point: Counter[str]
    material: Counter[str]

    @property
    def transcendental(self) -> int:
        """Number of functions of each point, without square roots."""
        return sum(self.point.values()) - self.point["sqrt"] - self.point["rsqrt"]


def count(function: Function, alpha: float = 0.8) -> FunctionCounts:
    """Count in `function(x, alpha)`, of an array and a scalar, all that its answer needs.

    What has no axis of points depends on alpha only, and counts for the material; steps of a loop count as often as
    they are made. Raises ValueError at a loop whose number of steps is not known beforehand.
    """
    closed = jax.make_jaxpr(function)(jnp.zeros(POINTS, jnp.float32), jnp.float32(alpha))
    needed, _ = partial_eval.dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars))
    counts = FunctionCounts(Counter(), Counter())
    _add(needed, 1, counts)
    return counts


def _add(jaxpr: core.Jaxpr, times: int, counts: FunctionCounts) -> None:
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        if name in COUNTED:
            result: Any = equation.outvars[0].aval
            size = int(np.prod(result.shape, dtype=int))
            if POINTS in result.shape:
                counts.point[name] += times * (size // POINTS)
            else:
                counts.material[name] += times * size
        if name == "while":
            raise ValueError(f"function must have no loop of unknown length, got {equation}")
        inner = times * (equation.params["length"] if name == "scan" else 1)
        for nested in core.jaxprs_in_params(equation.params):
            _add(nested, inner, counts)


# Of one call. A law that computes more functions a point than these takes fewer points, or is not timed at all.
MANY, TOO_MANY = 30, 5000
MATERIAL = 0.8  # the albedo of the timed material
RADII = 0.01, 10.0  # of the timed profiles [mfp]
NANO = 1e9
PARTS = ("profile", "sample", "both")
# Title of a part's panel, and its axis of cost.
TITLES = {
    "profile": ("R$_d$ at a given radius", "time of one evaluation, one core, float32 [ns]"),
    "both": ("a radius drawn, and R$_d$ there", "time of one sample, one core, float32 [ns]"),
}
QUICKLY = (YARDSTICK, "Liang, corrected", "hazard", "hazard, n = 1.4")


@dataclass(frozen=True)
class LawSizes:
    """Points of one call, and of one call of a costly law; albedos of a setup; turns; albedos of the errors."""

    points: int = 1_000_000
    costly: int = 20_000
    albedos: int = 100_000
    turns: int = 21
    judged: int = 60


FULL, QUICK = LawSizes(), LawSizes(100_000, 1000, 10_000, 5, 4)


@dataclass(frozen=True)
class ContenderResult:
    """All that is known of one contender.

    counts  by part: profile, sample and both, one after the other;  times [ns] of a point, by part and turn
    ratios  by part, times over those of normalized diffusion
    setup   [ns] for each material;  rel, ks  (albedos,)
    """

    contender: Contender
    counts: dict[str, FunctionCounts]
    times: dict[str, WithSpread]
    ratios: dict[str, Ratio]
    setup: float | None
    rel: Floats
    ks: Floats


def measure(sizes: LawSizes = FULL, folder: Path | None = None, track: Track = silent) -> TradeoffPart:
    """Time and judge every law; quickly, only some of them."""
    quick = sizes.judged <= QUICK.judged
    contestants, left_out = contenders(folder, [one for one in SPECS if not quick or one.label in QUICKLY])
    if not quick:
        contestants.append(table_contender())
    rows = measured(contestants, sizes, track)
    error = "relative error of R$_d$ [-]"
    panels = tuple(Panel(part, title, axis, error, points_of(rows, part)) for part, (title, axis) in TITLES.items())
    notes = tuple(f"left out: {line}" for line in left_out)
    return TradeoffPart("laws", "Profile laws: time of an evaluation against error", panels, notes)


def judged_albedos(number: int) -> Floats:
    """Return albedos even in sqrt(1 - alpha) over [0.05, 0.995]."""
    return 1.0 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), number) ** 2


def counts(contender: Contender) -> dict[str, FunctionCounts]:
    """Count the functions of each part of a contender."""
    functions = {"profile": contender.profile, **contender.parts}
    return {part: count(functions[part]) for part in PARTS if part in functions}


def works(contender: Contender, counted: dict[str, FunctionCounts], sizes: LawSizes) -> dict[str, Work]:
    """Return the timed calls of a contender, by part."""
    calls = {}
    for part, function in contender.parts.items():
        each = counted[part].transcendental
        if each <= TOO_MANY:
            calls[part] = timed(function, part == "profile", sizes.points if each <= MANY else sizes.costly)
    return calls


def timed(function: Function, radii: bool, points: int) -> Work:
    """Return a call on radii, or on numbers in [0, 1); the albedo is a constant of the compiled call."""
    shares = np.random.default_rng(1).random(points)
    near, far = RADII
    given = jnp.asarray(near * (far / near) ** shares if radii else shares, jnp.float32)
    return _work(lambda values: function(values, jnp.float32(MATERIAL)), given)


def _work(function: Callable[[Array], Any], given: Array) -> Work:
    compiled = jax.jit(function)

    def work(_: int) -> int:
        jax.block_until_ready(compiled(given))
        return given.size

    return work


def measured(contestants: Sequence[Contender], sizes: LawSizes, track: Track = silent) -> list[ContenderResult]:
    """Count, time and judge every contender; the yardstick must be one of them."""
    counted = {contender.name: counts(contender) for contender in contestants}
    jobs: dict[str, Work] = {}
    for one in contestants:
        jobs |= {f"{part} of {one.name}": work for part, work in works(one, counted[one.name], sizes).items()}
        if one.setup is not None:
            alphas = jnp.linspace(0.05, 0.995, sizes.albedos, dtype=jnp.float32)
            jobs[f"setup of {one.name}"] = _work(one.setup, alphas)
    rates = take_turns(jobs, sizes.turns, track, "laws")
    rows: Iterable[int] = track(range(len(contestants)), "errors of laws")
    return [_row(contestants[i], counted[contestants[i].name], rates, sizes) for i in rows]


def nanoseconds(rates: Rates, name: str, yardstick: str) -> WithSpread:
    """Time of a point: that over the yardstick's in each turn, in units of its median [ns]."""
    return WithSpread.of(NANO * float(np.median(rates.seconds(yardstick))) * rates.times(name, yardstick))


def _row(contender: Contender, counted: dict[str, FunctionCounts], rates: Rates, sizes: LawSizes) -> ContenderResult:
    named = {part: (f"{part} of {contender.name}", f"{part} of {YARDSTICK}") for part in PARTS}
    there = {part: names for part, names in named.items() if names[0] in rates.by_name}
    times = {part: nanoseconds(rates, own, yardstick) for part, (own, yardstick) in there.items()}
    ratios = {part: rates.ratio(yardstick, own) for part, (own, yardstick) in there.items()}
    setup = f"setup of {contender.name}"
    of_material = NANO / rates.best(setup) if setup in rates.by_name else None
    quality = profile_quality(contender.law, judged_albedos(sizes.judged))
    return ContenderResult(contender, counted, times, ratios, of_material, quality.rel, quality.ks)


def points_of(rows: Sequence[ContenderResult], part: str) -> tuple[Point, ...]:
    """Return one point per law: error against the time of one part."""
    points = []
    for row in (row for row in rows if part in row.times):
        facts = {
            "times_yardstick": row.ratios[part].median,
            "constants": sum(row.contender.constants),
            "functions": row.counts[part].transcendental,
            "setup_nanoseconds": "" if row.setup is None else row.setup,
            "ks": float(row.ks.mean()),
            "worst_ks": float(row.ks.max()),
        }
        error, worst = WithSpread.exactly(row.rel.mean()), WithSpread.exactly(row.rel.max())
        points.append(Point(part, row.contender.name, "", row.times[part], error, worst, facts))
    return tuple(points)
