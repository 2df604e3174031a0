"""The posterior of a fit: values, intervals, identifiability, the best additional measurement; and its JSON content.

Priors are flat in s = sqrt(1 - alpha), in ln l and in ln k. Errors estimated from replicates share a scale that is
itself an estimate: with that unknown the likelihood is Student's t.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.fitting.chains import Node, Ridge, Walk, sample
from profilefit.fitting.misfit import likelihood
from profilefit.fitting.solver import Solution
from profilefit.laws import profile_classes
from profilefit.measured import model
from profilefit.measured.data import Measured
from profilefit.measured.fitting import LEVEL, MediumFit, fitted
from profilefit.measured.identifiability import (
    BeamWidth,
    DesignRanking,
    Identifiability,
    Interval,
    Tissue,
    as_tissue,
    beam_width,
    identifiability,
    rank_designs,
)
from profilefit.measured.model import EXACT, FLOCK, NAMES, Light, Oblique, U, exact_light, u_of
from profilefit.measured.noise import origin
from profilefit.measured.premises import Premises, premises
from profilefit.measured.problem import FARTHEST_LN, FARTHEST_U, FitSpec, Known, descended, held_albedo, log_prior
from profilefit.measured.reading import read
from profilefit.recipes import catalogue, record

Ends = tuple[float | None, float | None]
BEYOND = "its errors are beyond double precision: check the unit, sigma and what is held"
HOLDABLE = ("alpha", "A", "l")
GREY = 0.9  # albedo assumed for the advice where the data do not bound it at all
KEPT = 4000  # draws
WALKERS = 2 * FLOCK  # which move by halves
MAX_STEPS = 20_000
ROOM = 1.0  # in u beyond where a search may end: a fit at the edge has a density


@dataclass(frozen=True)
class MediumPosterior:
    """Posterior of a medium, from a fit: identifiability, the most informative additional measurements, the chain.

    The first two are None where the fit failed, the chain (`walk`) also where the posterior is unbounded. `width` is
    None of a simulation, whose beam is known, and where a beam is given; `tissue` where n and g are known.

    Where the data do not exclude the end of a coordinate's range (alpha = 1, say: chi-square there is within the
    square of the 95 % quantile, 3.84 of known errors, of the minimum), the optimum is no estimate and the derivatives
    there give no errors. A quantity that ends there (A, alpha and mu_a at alpha = 1) has a one-sided limit of 95 % and
    no value; the others keep their interval, and a value if it lies inside. The limit is a quantile of the posterior,
    without a chain the end of the two-sided interval of the profile likelihood (97.5 %); neither includes the law's own
    error.
    """

    fit: MediumFit
    identifiability: Identifiability | None
    advice: DesignRanking | None
    walk: Walk | None
    width: BeamWidth | None = None
    tissue: Tissue | None = None

    @cached_property
    def draws(self) -> dict[str, Floats]:
        """Posterior draws (k,) of every quantity by the errors of data and law; empty without a chain.

        They are draws by all errors, nearer to the fit by as much as the lack of fit widens their covariance.
        """
        if self.walk is None:
            return {}
        if self.fit.plain is None or not self.identified:
            return quantities_at(self.fit, self._sampled)
        fit, free = self.fit, list(self.fit.spec.free)
        whole, data = (one[np.ix_(free, free)] for one in (fit.total_covariance, fit.total_covariance - fit.of_misfit))
        nearer = np.linalg.cholesky(data) @ np.linalg.inv(np.linalg.cholesky(whole))
        moved = self._sampled.copy()
        moved[:, free] = fit.point[free] + (moved[:, free] - fit.point[free]) @ nearer.T
        return quantities_at(fit, moved)

    @cached_property
    def whole_draws(self) -> dict[str, Floats]:
        """Posterior draws (k,) of every quantity by all errors; empty at an end, or if only the data's are known."""
        if self.walk is None or not self.identified or (self.fit.plain is None and self.fit.rel is None):
            return {}
        return self.draws if self.fit.plain is None else quantities_at(self.fit, self._sampled)

    @cached_property
    def _sampled(self) -> Floats:
        """Posterior draws (k, 3) of the coordinates: those of the chain, each moved by what is open of ranges."""
        if self.walk is None:
            return np.zeros((0, len(NAMES)))
        sampled = points(self.fit, self.walk.samples)
        return sampled if self.fit.range_marginal is None else sampled + self.fit.range_marginal.offsets[: len(sampled)]

    @property
    def _intervals(self) -> tuple[Interval, ...]:
        """Intervals of the free coordinates."""
        return self.identifiability.intervals if self.identifiability else ()

    @property
    def moving(self) -> tuple[str, ...]:
        """Quantities that depend on the free coordinates."""
        return tuple(name for name, one in self.fit.gradients.items() if np.any(one[list(self.fit.spec.free)]))

    @property
    def identified(self) -> tuple[str, ...]:
        """Quantities with symmetric errors: none where an end of a range is not excluded, or where the fit failed."""
        is_open = self.identifiability is None or any(one.is_open for one in self._intervals)
        return () if is_open or not self.fit.minimum.converged else self.moving

    def ends(self, name: str) -> tuple[bool, bool]:
        """Return whether the data fail to exclude the lowest and the highest value that a quantity can have."""
        each = {one.name: (one.open_low, one.open_high) for one in self._intervals}
        (dark, white), (short, long) = each.get("alpha", (False, False)), each.get("l", (False, False))
        return {
            "A": (dark, white),
            "alpha": (dark, white),
            "mu_s'": (dark or long, short),
            "mu_a": (white or long, short),
        }.get(name, each.get(name, (False, False)))

    def value(self, name: str) -> float | None:
        """Return the best value of what was held, or has an error or an interval and lies inside; else None."""
        value = self.fit.values[name]
        if name not in self.moving:
            return value
        intervals = [one for one in (self.interval(name), self.whole_interval(name)) if one is not None]
        if any(self.ends(name)) or not (intervals or name in self.identified):
            return None
        inside = all(low is not None and high is not None and low <= value <= high for low, high in intervals)
        return value if inside else None

    def interval(self, name: str) -> Ends | None:
        """Return 95 % by the errors of data and law, of posterior draws; without a chain, of the profile likelihood.

        Both ends, or one and None: a one-sided limit. That limit, and the profile likelihood, are by all errors.
        """
        if name in self.draws and name in self.moving:
            return self._middle(name, self.draws[name])
        own = [one for one in self._intervals if one.name == name]
        return _closed(own[0].low, own[0].high, self.ends(name)) if own and name in self.moving else None

    def whole_interval(self, name: str) -> Ends | None:
        """Return 95 % by all errors: statistical, model, and lack of fit if allowed for; None of unknown errors."""
        held = name not in self.whole_draws or name not in self.moving
        return None if held else self._middle(name, self.whole_draws[name])

    def _middle(self, name: str, draws: Floats) -> Ends | None:
        ends = self.ends(name)
        outside = 1.0 - LEVEL if any(ends) else 0.5 * (1.0 - LEVEL)
        low, high = np.quantile(draws, [outside, 1.0 - outside])
        return _closed(float(low), float(high), ends)


def _closed(low: float, high: float, is_open: tuple[bool, bool]) -> Ends | None:
    """Return the ends of an interval that are not open; None if both are."""
    return None if all(is_open) else (None if is_open[0] else low, None if is_open[1] else high)


def fit(
    data: Measured | Path | str,
    law: str = EXACT,
    constants: str = "regenerated",
    setting: Setting | Premises | None = None,
    held: Mapping[str, float] | None = None,
    total: Known | None = None,
    scale: float | Known | None = 1.0,
    seed: int = 0,
    walk: bool = True,
    folder: Path | None = None,
    oblique: Oblique | None = None,
) -> MediumPosterior:
    """Fit a medium to a measured or simulated profile, and judge the fit; one that fails is returned and says so.

    Args:
        data: a file (see `reading.read`), or what was read from one, for example `within` some radii.
        law: "exact", light solved exactly, or a law's name.
        constants: which of the law's constants, as for `catalogue.load`.
        setting: illumination, surface and scattering, or all premises; by default what the file states, else a normal
            pencil beam ("searchlight"), n = 1 and g = 0.
        held: fixed quantities by name: alpha or A [-], l [unit of the data].
        total: total reflectance A [-], if it was measured too.
        scale: factor on the light that gives the data's values: a number, a value with an error, or None if unknown.
        seed: of the posterior's walkers.
        walk: whether to sample the posterior; else intervals are of the statistical error alone.
        folder: of the records, by default the ones shipped.
        oblique: centre of a circle of the same medium's light, where a beam fell in obliquely.

    Raises:
        InputError: the data or the fixed quantities cannot be fitted.
        SettingError: the law does not cover the setting.
        RecordError: a record is missing or damaged.
    """
    data = data if isinstance(data, Measured) else read(Path(data), scaled=scale is None)
    records, held = folder or catalogue.fits_folder(), {**(held or {})}
    where = Premises(setting) if isinstance(setting, Setting) else setting or premises(data, law)
    illumination, n = where.setting.illumination, where.setting.n
    if data.illumination not in (None, illumination):
        got = f"{data.illumination} light, got {illumination} light to fit"
        raise InputError(f"{data.source}: a simulation of {got}")
    if oblique is not None and illumination != Setting().illumination:
        raise InputError(f"oblique light must be a {Setting().illumination}, got {illumination} light to fit")
    light = _light(law, constants, where.setting, records)
    _require_held(light, held)
    known = scale if isinstance(scale, Known) else None
    if not (scale is None or isinstance(scale, Known)):
        require(scale > 0, "scale", "a number > 0", scale)
        held["scale"] = scale
    notes = where.notes
    if data.n is not None and not math.isclose(data.n, n):
        notes = (*notes, f"the file's n is {data.n:g}, fitted as n = {n:g}")
    spec = FitSpec(
        light, held, total, known, oblique, where.instrument, where.ranges, where.assumed,
        origin(law, constants, light.setting, records), law, constants, notes,
    )  # fmt: skip
    return judged(fitted(data, spec), seed, walk)


def _light(law: str, constants: str, setting: Setting, folder: Path) -> Light:
    if law == EXACT:
        require(constants == "regenerated", "constants", "left out where light is solved exactly", constants)
        return exact_light(setting)
    if law not in profile_classes() and not law.startswith("gaussians:"):
        raise InputError(f"law must be one of {', '.join((EXACT, *catalogue.names()))}, got {law!r}")
    return catalogue.load(law, constants, setting, folder)


def _require_held(law: Light, held: Mapping[str, float]) -> None:
    if unknown := [name for name in held if name not in HOLDABLE]:
        raise InputError(f"held must name some of {', '.join(HOLDABLE)}, got {unknown[0]!r}")
    if {"alpha", "A"} <= set(held):
        raise InputError("held must have one of alpha and A, which say the same, got both")
    for name, value in held.items():
        if name == "l":
            require(value > 0, "held l", "a number > 0", value)
        else:
            held_albedo(law, name, value)


def judged(fit: MediumFit, seed: int = 0, walk: bool = True) -> MediumPosterior:
    """Judge a fit; with `walk` the posterior is sampled, which takes longest, where the data bound every coordinate."""
    if not fit.has_ended:
        return MediumPosterior(fit, None, None, None)
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            return _judged_finite(fit, seed, walk)
    except (FloatingPointError, np.linalg.LinAlgError):
        return MediumPosterior(replace(fit, minimum=replace(fit.minimum, result=BEYOND)), None, None, None)


def _judged_finite(fit: MediumFit, seed: int, walk: bool) -> MediumPosterior:
    judgement = identifiability(fit)
    # The prior ends at alpha = 1; with any other open end the posterior is unbounded.
    endless = any(one.open_low or (one.open_high and one.name != "alpha") for one in judgement.intervals)
    walked = posterior(fit, seed) if walk and fit.spec.free and not endless else None
    width = None if fit.data.medium is not None else beam_width(fit)
    result = MediumPosterior(fit, judgement, rank_designs(_inside(fit, judgement)), walked, width, as_tissue(fit))
    _ = fit.misfit, result.draws, result.whole_draws  # computed on first use: they fail here or never
    return result


def _inside(fit: MediumFit, judgement: Identifiability) -> MediumFit:
    """Return a fit at an edge moved to the other end of alpha's interval: at the edge no measurement seems to help."""
    if not fit.at_edge:
        return fit
    (alpha,) = [one for one in judgement.intervals if one.name == "alpha"]
    start = fit.point.copy()
    start[U] = u_of(
        next((x for x, is_open in ((alpha.low, alpha.open_low), (alpha.high, alpha.open_high)) if not is_open), GREY)
    )
    others = tuple(at for at in fit.spec.free if at != U)
    return replace(fit, minimum=descended(fit.problem, start, others))


def posterior(fit: MediumFit, seed: int = 0, max_steps: int = MAX_STEPS) -> Walk:
    """Sample the posterior of a fit's free coordinates, by emcee along the fit's ridge: samples (k, p)."""
    best = fit.point

    def log_density(samples: Floats, volume: Floats) -> Floats:
        full = points(fit, samples)
        inside = np.abs(full[:, U]) < FARTHEST_U + ROOM
        inside &= np.all(np.abs(full - best)[:, U + 1 :] < FARTHEST_LN, axis=1)
        costs = fit.problem.costs(np.clip(full, best - 3 * FARTHEST_LN, best + 3 * FARTHEST_LN))
        value = _log_density(fit, costs, full[:, U], volume)
        return np.where(inside & np.isfinite(value), value, -np.inf)

    return sample(log_density, ridge(fit), WALKERS, seed, max_steps, KEPT)


def _log_density(fit: MediumFit, costs: Floats, u: Floats, volume: Floats) -> Floats:
    value = likelihood(costs - fit.minimum.cost, len(fit.spec.free), fit.data.pooled) + volume
    return value + log_prior(u) if U in fit.spec.free else value


def ridge(fit: MediumFit) -> Ridge:
    """Follow the ridge of a fit: its first free coordinate is moved to either side, and the others are fitted again."""
    first = fit.spec.free[0]
    middle, reach = (0.0, FARTHEST_U + ROOM) if first == U else (float(fit.point[first]), FARTHEST_LN)
    error = float(np.sqrt(fit.conditional[first, first]))
    return Ridge.along(_node(fit, fit.minimum), partial(moved, fit), (middle - reach, middle + reach), error)


def moved(fit: MediumFit, near: Node, first: float) -> Node:
    """Fit the others where the first free coordinate has another value than in a node nearby."""
    start, others = fit.point.copy(), fit.spec.free[1:]
    start[list(others)] = near.others + near.slope * (first - near.first)
    start[fit.spec.free[0]] = first
    return _node(fit, descended(fit.problem, start, others))


def _node(fit: MediumFit, there: Solution) -> Node:
    density = partial(_log_density, fit, np.array(there.cost), np.array(there.parameters[U]))
    return Node.of(there, fit.spec.free, density)


def points(fit: MediumFit, samples: Floats) -> Floats:
    """Return the coordinates (k, 3) of samples (k, p) of the free ones."""
    full = np.repeat(fit.point[None], len(samples), axis=0)
    full[:, list(fit.spec.free)] = samples
    return full


def known_medium(data: Measured) -> dict[str, float]:
    """Return the quantities of the layer that scatters most, of the medium that a simulation was of."""
    if data.layer is None:
        return {}
    layer = data.layer.similar
    return {"alpha": layer.alpha, "l": layer.mfp, "mu_s'": layer.mu_s, "mu_a": layer.mu_a}


def quantities_at(fit: MediumFit, points: Floats) -> dict[str, Floats]:
    """Return each quantity (k,) at points (k, 3) of the coordinates."""
    data = fit.data
    reflectance = fit.problem.model.predicted(points, data.inner[:1], data.outer[:1])[:, -1]
    return model.quantities(points, reflectance)


def rival_values(fit: MediumFit, rival: Solution) -> dict[str, float]:
    """Return the quantities at another minimum."""
    return {name: float(value[0]) for name, value in quantities_at(fit, rival.parameters[None]).items()}


def content(result: MediumPosterior) -> dict[str, Any]:
    """Return everything as JSON content; null are errors that are not known, and values and ends at an edge."""
    fit = result.fit
    data, spec, names, ranges = fit.data, fit.spec, result.identified, fit.range_marginal
    joint = model.correlation(fit.gradients, fit.statistical, names) if names else None
    body: dict[str, Any] = {
        "data": {
            "file": data.source,
            "sha256": data.digest,
            "unit": data.unit,
            "kind": "rings" if data.rings else "points",
            "errors": data.errors,
            "errors_are_bounds": data.bounded,
            **{name: getattr(data, name) for name in ("notes", "medium", "inner", "outer", "value")},
            "sigma": fit.sigma,
            "freedom": data.freedom if np.isfinite(data.pooled) else None,
            "pooled_freedom": data.pooled,
            "photons": data.photons,
        },
        "law": {
            "name": spec.name,
            "constants": spec.constants,
            "setting": spec.law.setting,
            "record": None if spec.source is None else spec.source.path.name,
            "record_sha256": None if spec.source is None else spec.source.digest,
            "rel": fit.rel,
        },
        "beam": None if spec.instrument.beam is None else spec.instrument.beam.words,
        "fibre": spec.instrument.fibre,
        "ranges": spec.ranges,
        "of_ranges": ranges and {"mean": ranges.mean, "error": ranges.error},
        "free": [NAMES[at] for at in spec.free],
        "held": spec.held,
        "known": {"A": spec.total, "scale": spec.scale, "oblique": spec.oblique},
        "result": fit.minimum.result,
        "steps": fit.minimum.steps,
        "widening": fit.widening,
        "quantile_95": fit.quantile,
        "quantities": _quantities(result),
        "correlation": {"names": names, "matrix": joint} if names else {},
        "light": fit.light,
        "residuals": fit.minimum.residuals,
        "versions": record.versions(),
    }
    if result.identifiability is not None and result.advice is not None:
        body["misfit"] = {
            **vars(fit.misfit),
            "detected": fit.misfit.detected,
            "within_law": fit.misfit.within_law,
            "allowed_for": fit.plain is not None,
        }
        body["telling"] = {**vars(result.identifiability), "told": result.identifiability.all_identified}
        body["advice"] = result.advice
        body["beam_width"] = result.width
        body["tissue"] = result.tissue
        body["rivals"] = [rival_values(fit, one) | {"chi2": one.cost} for one in fit.rivals]
        body["rows_beyond_99.5_percent"] = int(fit.beyond.sum())
    if result.walk is not None:
        body["posterior"] = {k: v for k, v in vars(result.walk).items() if k not in ("samples", "log_density")}
    plain: dict[str, Any] = record.plain(body)
    return plain


def _quantities(result: MediumPosterior) -> dict[str, Any]:
    fit = result.fit
    kinds: dict[str, Floats | None] = {
        "statistical": fit.statistical if result.identified else None,
        "law": fit.of_law if result.identified and fit.rel is not None else None,
    }
    if result.identifiability is not None:
        kinds["misfit"] = fit.of_misfit if result.identified else None
    errors = {kind: fit.errors(one) if one is not None else {} for kind, one in kinds.items()}
    truth = known_medium(fit.data)
    return {
        name: {
            "value": result.value(name),
            "at_edge": any(result.ends(name)),
            "unit": model.unit_of(name, fit.data.unit),
            **{f"{kind}_error": one.get(name) if name in result.identified else None for kind, one in errors.items()},
            "interval_95_data": result.interval(name),
            "interval_95_total": result.whole_interval(name),
            "of_file": truth.get(name),
        }
        for name in fit.values
    }
