"""Run a recipe: make its truth, fit, sample the posterior, measure the result, write the record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Grid, Orders, exact, simulate_orders
from profilefit import catalogue, record, staged
from profilefit.errors import RecipeError
from profilefit.estimate import Fit, fit
from profilefit.laws import published
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.posterior import LEVELS, Posterior, posterior
from profilefit.profiles import Profiles
from profilefit.quality import albedo_quality, profile_quality
from profilefit.recipe import Albedos, Recipe, Rings
from profilefit.reproduction import readings
from profilefit.table1 import printed_halves, table1
from profilefit.targets import RUN_EDGES, albedo_values, ring_edges, truth_of
from profilefit.truth import ExactTruth, TallyTruth, Truth

Floats = NDArray[np.float64]
Say = Callable[[str], None]
PHOTONS = {"quick": 20 * 2**20, "full": 400 * 2**20}
MAX_CHAIN = {"quick": 16_000, "full": 64_000}
EVIDENCE_RINGS = Rings(last=30.0, dr=0.01)
QUALITY_ALBEDOS = Albedos(0.05, 0.995, 24)


@dataclass(frozen=True)
class Run:
    """What all recipes of one command share: the photons, the preset, where things go and whom to tell."""

    preset: str
    seed: int
    out: Path
    store: Path | None
    photons: int
    say: Say
    progress: bool | None = None

    def light(self) -> Orders:
        """The order-resolved run; resumes from the store."""
        return simulate_orders(
            Grid.from_edges(r=RUN_EDGES), self.photons, self.seed, store=self.store, progress=self.progress
        )


def regenerate(recipes: tuple[Recipe, ...], run: Run) -> list[Path]:
    """Run recipes and write their records: first the map that others are normalised with, last what compares them."""
    for recipe in recipes:
        _require_known(recipe)
    ordered = sorted(recipes, key=lambda r: (r.name != catalogue.ALBEDO_RECORD, r.pipeline == "evidence"))
    light = run.light() if any(recipe.truth == "orders" for recipe in ordered) else None
    written = []
    for recipe in ordered:
        run.say(f"{recipe.name}: {recipe.title}")
        content, arrays = PIPELINES[recipe.pipeline](recipe, run, light)
        written.append(record.write(run.out, recipe.name, {**_header(recipe, run, light), **content}, arrays))
    return written


def _albedo(recipe: Recipe, run: Run, light: Orders | None):
    profiles = truth_of(recipe, light)
    result = _fit(recipe, run, profiles)
    printed = published.constants(f"{recipe.law}_albedo")
    laws = {"regenerated": result.law}
    if printed:
        laws["published"] = catalogue.ALBEDO_LAWS[recipe.law](setting=profiles.setting, **printed)
    content, arrays = _described(recipe, run, profiles, result, printed)
    content["quality"] = {name: albedo_quality(law) for name, law in laws.items() if isinstance(law, AlbedoLaw)}
    arrays |= {"reflectance": profiles.reflectance, "reflectance_error": profiles.standard_error.sum(axis=1)}
    return content, arrays


def _profile(recipe: Recipe, run: Run, light: Orders | None):
    profiles = truth_of(recipe, light)
    result = _fit(recipe, run, profiles)
    content, arrays = _described(recipe, run, profiles, result, published.constants(recipe.law))
    content["quality"] = _compare(recipe, run, result.law)
    content["normalisation"] = catalogue.normalisation(profiles.setting, run.out).constants()
    return content, arrays | _curves(profiles)


def _inverse(recipe: Recipe, run: Run, light: Orders | None):
    profiles = truth_of(recipe, light)
    result = _fit(recipe, run, profiles)
    content, arrays = _described(recipe, run, profiles, result, published.constants(recipe.law))
    alpha = albedo_values(QUALITY_ALBEDOS)
    content["quality"] = {"alpha": alpha}
    for name in ("published", "regenerated"):
        law = result.law if name == "regenerated" else catalogue.load(recipe.law, "published", folder=run.out)
        content["quality"][name] = {"inversion_error": inversion_error(law, alpha)}
    return content, arrays | _curves(profiles) | {"shares": np.asarray(result.rings.xi)}


def _as_published(recipe: Recipe, run: Run, light: Orders | None):
    rings = recipe.rings
    if rings is None:
        raise RecipeError(f"{recipe.path}: a recipe of pipeline {recipe.pipeline!r} needs a table [rings]")
    start = _start(recipe, run)
    truths = {mfp: truth_of(recipe, light, mfp) for mfp in recipe.mfp}
    points = {m: staged.fit_per_albedo(truth, start, m, rings.trim, rings.epsilon) for m, truth in truths.items()}
    profiles, unit = truths[1.0], points[1.0]
    laws = staged.fit_coefficient_laws(unit, start, recipe.held)
    by_stage = {
        name: float(value)
        for law in laws.values()
        for name, value in zip(law.names, law.solution.parameters, strict=True)
    }
    used, _ = staged.trimmed(profiles, rings.trim, rings.epsilon)
    result = _fit(recipe, run, profiles, start.with_vector(tuple(by_stage), list(by_stage.values())), used)
    content, arrays = _described(recipe, run, profiles, result, published.constants(recipe.law))
    content["stages"] = {
        "coefficient_laws": {
            letter: {
                "constants": dict(zip(law.names, law.solution.parameters, strict=True)),
                "standard_error": _errors(law.names, law.covariance),
                "result": law.solution.result,
                "condition_number": law.solution.condition_number,
            }
            for letter, law in laws.items()
        },
        "length_exponents": staged.length_exponents(tuple(points.values())) if len(points) > 1 else {},
        "per_albedo_failures": {f"{m:g}": sum(r != "converged" for r in p.results) for m, p in points.items()},
    }
    content["quality"] = _compare(recipe, run, result.law)
    content["normalisation"] = catalogue.normalisation(profiles.setting, run.out).constants()
    arrays |= {"coefficients": unit.values, "coefficient_errors": unit.standard_error, "r_trim": unit.r_trim}
    return content, arrays | _curves(profiles)


def _evidence(recipe: Recipe, run: Run, light: Orders | None):
    if recipe.truth == "orders" and light is not None:
        truth: Truth = TallyTruth(light.merged(ring_edges(EVIDENCE_RINGS)))
    else:
        truth = ExactTruth()
    laws = _regenerated_laws(run.out)
    found = {"readings": readings(truth), "table1": table1(truth, laws), "halves": printed_halves()}
    return {**found, "compared": {label: law.constants() for label, law in laws.items()}}, {}


def _regenerated_laws(folder: Path) -> dict[str, ProfileLaw]:
    """The laws that a table of published ones is compared with, as far as their records are there."""
    laws = {}
    for label, law, name in (
        ("normalized diffusion, regenerated", "burley", "burley-whole"),
        ("paper, regenerated as published", "liang", "liang-as-published"),
        ("paper, regenerated whole", "liang", "liang-whole"),
    ):
        places = (folder / f"{name}.json", catalogue.fits_folder() / f"{name}.json")
        if path := next((place for place in places if place.exists()), None):
            laws[label] = catalogue.load(law, str(path), folder=folder)
    return laws


PIPELINES = {
    "albedo": _albedo,
    "profile": _profile,
    "inverse": _inverse,
    "as-published": _as_published,
    "evidence": _evidence,
}


def inversion_error(law: Any, alpha: Floats) -> Floats:
    """max over xi in [0, 0.999] of |cdf_exact(sample(xi)) - xi| at each albedo (m,) [-]."""
    xi = np.linspace(0.0, 0.999, 500)
    errors = [np.max(np.abs(exact.cdf(law.sampler.sample(xi, a), float(a), setting=law.setting) - xi)) for a in alpha]
    return np.array(errors)


def _law_class(recipe: Recipe) -> type[Constants] | None:
    """The class that a recipe's law names, None if there is none."""
    known: Mapping[str, type[Constants]] = (
        catalogue.ALBEDO_LAWS if recipe.pipeline == "albedo" else catalogue.PROFILE_LAWS
    )
    return known.get(recipe.law)


def _require_known(recipe: Recipe) -> None:
    """RecipeError if a recipe names a law, a starting set or a constant that there is not."""
    kind = _law_class(recipe)
    if kind is None:
        known = catalogue.ALBEDO_LAWS if recipe.pipeline == "albedo" else catalogue.PROFILE_LAWS
        raise RecipeError(f"{recipe.path}: law must be one of {', '.join(known)}, got {recipe.law!r}")
    key = f"{recipe.law}_albedo" if recipe.pipeline == "albedo" else recipe.law
    if recipe.law not in STARTS and not published.constants(key, recipe.start):
        sets = [s.name for s in published.SETS if s.law == key]
        raise RecipeError(f"{recipe.path}: start must be one of {', '.join(sets)}, got {recipe.start!r}")
    if kind.seen_by(recipe.weighting.objective) and not _free(recipe, kind):
        raise RecipeError(f"{recipe.path}: held leaves no constant of {recipe.law} free")
    unknown = [name for name in recipe.held if name not in kind.constant_names()]
    if unknown:
        raise RecipeError(f"{recipe.path}: held must name constants of {recipe.law}, got {', '.join(unknown)}")


def _free(recipe: Recipe, kind: type[Constants] | Constants) -> tuple[str, ...]:
    """The constants that a recipe moves."""
    return tuple(name for name in kind.seen_by(recipe.weighting.objective) if name not in recipe.held)


def _start(recipe: Recipe, run: Run) -> Any:
    """The law that a fit starts from; constants named in `held` keep the values they have here."""
    if recipe.pipeline == "albedo":
        printed = published.constants(f"{recipe.law}_albedo", recipe.start) or STARTS[recipe.law]
        return catalogue.ALBEDO_LAWS[recipe.law](setting=exact.SEARCHLIGHT, **printed)
    return catalogue.load(recipe.law, recipe.start, folder=run.out)


# Where a law without published constants begins: the limits hold for any, and these give A within 0.1.
STARTS = {"rational": {"b": 0.5, "c": 2.0, "d": 1.0}}


def _fit(recipe: Recipe, run: Run, profiles: Profiles, start: Constants | None = None, used=None) -> Fit:
    law = start or _start(recipe, run)
    weighting = recipe.weighting
    shares = (np.arange(weighting.shares) + 0.5) / max(weighting.shares, 1) * weighting.last_share
    limits = (weighting.energy_limit, weighting.source_limit)
    return fit(profiles, law, weighting.objective, _free(recipe, law), used, limits, tuple(shares))


def _described(recipe: Recipe, run: Run, profiles: Profiles, result: Fit, printed: dict[str, float]):
    """The part of a record that every fit has, and the samples beside it."""
    chains = _chains(result, run)
    seen = result.law.seen_by(recipe.weighting.objective)
    fitted = result.law.constants()
    constants: dict[str, dict[str, Any]] = {
        name: {"published": printed.get(name), "regenerated": fitted[name], "free": name in result.free}
        for name in seen
    }
    for i, name in enumerate(result.free):
        constants[name] |= {
            "statistical_error": None if result.statistical is None else float(np.sqrt(result.statistical[i, i])),
            "discrepancy_error": float(np.sqrt(result.discrepancy[i, i])),
            "jackknife_error": float(result.jackknife[i]),
            "intervals": {c.kind: {f"{level:.0%}": c.interval(level)[i] for level in LEVELS} for c in chains},
        }
    content = {
        "constants": constants,
        "covariance": {"names": result.free, "statistical": result.statistical, "discrepancy": result.discrepancy},
        "fit": {
            "result": result.result,
            "steps": result.solution.steps,
            "condition_number": result.solution.condition_number,
            "residuals": result.structure,
        },
        "posterior": {c.kind: _chain_facts(c) for c in chains},
        "data_digest": record.digest(profiles.alpha, profiles.r_edges, profiles.energy),
    }
    if profiles.covariance is not None:
        content["covariance_rank"] = {"rank": profiles.covariance.rank, "dropped": profiles.covariance.dropped}
        content["left_out"] = _left_out(profiles, result)
    return content, {f"samples_{c.kind}": c.samples.astype(np.float32) for c in chains}


def _left_out(profiles: Profiles, result: Fit) -> dict[str, int]:
    """What rests on too few effective photons to count: rings, where the objective sees rings, and whole albedos."""
    sees_rings = result.objective in ("energy", "radial")
    return {
        "rings": int(np.sum(~profiles.trusted)) if sees_rings else 0,
        "albedos": int(np.sum(np.asarray(result.rings.weight) == 0)),
    }


def _chains(result: Fit, run: Run) -> list[Posterior]:
    if not result.solution.converged:
        return []  # the curvature there describes no optimum, and the record says why
    kinds = ["discrepancy"] if result.statistical is None else ["statistical", "discrepancy"]
    return [posterior(result, kind, run.seed, MAX_CHAIN[run.preset]) for kind in kinds]


def _chain_facts(chain: Posterior) -> dict[str, Any]:
    facts = {name: getattr(chain, name) for name in ("tau", "acceptance", "walkers", "steps", "result")}
    return {**facts, "standard_deviation": dict(zip(chain.names, chain.standard_deviation, strict=True))}


def _compare(recipe: Recipe, run: Run, law: Any) -> dict[str, Any]:
    """The measures of every set of constants of this law, at albedos that were not fitted."""
    alpha = albedo_values(QUALITY_ALBEDOS)
    laws = {"published": catalogue.load(recipe.law, "published", folder=run.out), "regenerated": law}
    if published.constants(recipe.law, "corrected"):
        laws["corrected"] = catalogue.load(recipe.law, "corrected", folder=run.out)
    table: dict[str, Any] = {"alpha": alpha}
    for name, one in laws.items():
        quality = profile_quality(one, alpha)
        table[name] = {key: value for key, value in asdict(quality).items() if key != "alpha"}
    return table


def _curves(profiles: Profiles) -> dict[str, np.ndarray]:
    """What the figures draw: the data with its errors."""
    return {
        "alpha": profiles.alpha,
        "r_edges": profiles.r_edges,
        "energy": profiles.energy,
        "energy_error": profiles.standard_error,
        "beyond": profiles.beyond,
    }


def _errors(names: tuple[str, ...], covariance: Floats | None) -> dict[str, float]:
    return {} if covariance is None else dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))


def _header(recipe: Recipe, run: Run, light: Orders | None) -> dict[str, Any]:
    header: dict[str, Any] = {
        "title": recipe.title,
        "law": recipe.law,
        "equations": recipe.equations,
        "pipeline": recipe.pipeline,
        "note": recipe.note,
        "setting": exact.SEARCHLIGHT,
        "protocol": {
            "albedos": recipe.albedos,
            "rings": recipe.rings,
            "weighting": recipe.weighting,
            "mfp": recipe.mfp,
            "start": recipe.start,
            "held": recipe.held,
        },
        "truth": {"kind": recipe.truth},
        "preset": run.preset,
        "seed": run.seed,
        "versions": record.versions(),
    }
    if recipe.truth == "orders" and light is not None:
        header["truth"] |= {
            "photons": light.photons,
            "grid_digest": light.grid.digest,
            "cut": {f"{a:g}": light.cut(a) for a in (0.9, 0.99, 0.995, 0.999, 1.0)},
            "ledger": light.ledger,
        }
    return header
