"""What a record says of a fit: its constants with their errors, its state, its chains and the data behind it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from profilefit import derived, record
from profilefit.chains import LEVELS, Posterior, posterior
from profilefit.discrepancy import discrepancy
from profilefit.discretisation import discretisation_error
from profilefit.estimate import Fit
from profilefit.profiles import Profiles

Floats = NDArray[np.float64]
Arrays = dict[str, np.ndarray]


def described(
    result: Fit, profiles: Profiles, printed: dict[str, float], seed: int, max_chain: int
) -> tuple[dict[str, Any], Arrays]:
    """The part of a record that every fit has, and the samples beside it; `printed` are published constants."""
    chains = _chains(result, seed, max_chain)
    off, width = discrepancy(result, profiles), discretisation_error(result)
    errors = {"model_error": np.sqrt(np.diag(off.covariance)), "discretisation_error": width}
    covariances = {"statistical": result.statistical, "discrepancy": result.discrepancy, "model": off.covariance}
    content = {
        "constants": _constants(result, printed, chains, errors),
        "covariance": {"names": result.free, **covariances},
        "discrepancy": off.content(),
        "fit": {
            "result": result.result,
            "steps": result.solution.steps,
            "condition_number": result.solution.condition_number,
            "residuals": result.structure,
        },
        "posterior": {c.kind: _chain_facts(c) for c in chains},
        "data_digest": record.digest(profiles.alpha, profiles.r_edges, profiles.energy),
    }
    if result.solution.converged:
        content["derived"] = derived.summary(derived.Known.of_fit(result, off), profiles)
    if profiles.covariance is not None:
        content["covariance_rank"] = {"rank": profiles.covariance.rank, "dropped": profiles.covariance.dropped}
        content["left_out"] = _left_out(profiles, result)
    samples = {f"samples_{c.kind}": c.samples.astype(np.float32) for c in chains}
    samples |= {f"log_density_{c.kind}": c.log_density.astype(np.float32) for c in chains}
    return content, samples | off.arrays()


def curves(profiles: Profiles) -> Arrays:
    """What the figures draw: the data with its errors."""
    return {
        "alpha": profiles.alpha,
        "r_edges": profiles.r_edges,
        "energy": profiles.energy,
        "energy_error": profiles.standard_error,
        "beyond": profiles.beyond,
    }


def errors_by_name(names: tuple[str, ...], covariance: Floats | None) -> dict[str, float]:
    """Standard errors from a covariance; none where there is none."""
    return {} if covariance is None else dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))


def _constants(
    result: Fit, printed: dict[str, float], chains: list[Posterior], errors: dict[str, Floats]
) -> dict[str, dict[str, Any]]:
    fitted = result.law.constants()
    constants: dict[str, dict[str, Any]] = {
        name: {"published": printed.get(name), "regenerated": fitted[name], "free": name in result.free}
        for name in result.law.seen_by(result.objective)
    }
    for i, name in enumerate(result.free):
        constants[name] |= {
            "statistical_error": None if result.statistical is None else float(np.sqrt(result.statistical[i, i])),
            "discrepancy_error": float(np.sqrt(result.discrepancy[i, i])),
            "jackknife_error": float(result.jackknife[i]),
            **{name: float(error[i]) for name, error in errors.items()},
            "intervals": {c.kind: {f"{level:.0%}": c.interval(level)[i] for level in LEVELS} for c in chains},
        }
    return constants


def _left_out(profiles: Profiles, result: Fit) -> dict[str, int]:
    """What rests on too few effective photons to count: rings, where the objective sees rings, and whole albedos."""
    sees_rings = result.objective in ("energy", "radial")
    return {
        "rings": int(np.sum(~profiles.trusted)) if sees_rings else 0,
        "albedos": int(np.sum(np.asarray(result.rings.weight) == 0)),
    }


def _chains(result: Fit, seed: int, max_chain: int) -> list[Posterior]:
    if not result.solution.converged:
        return []  # the curvature there describes no optimum, and the record says why
    kinds = ["discrepancy"] if result.statistical is None else ["statistical", "discrepancy"]
    return [posterior(result, kind, seed, max_chain) for kind in kinds]


def _chain_facts(chain: Posterior) -> dict[str, Any]:
    facts = {name: getattr(chain, name) for name in ("tau", "acceptance", "walkers", "steps", "result")}
    return {**facts, "standard_deviation": dict(zip(chain.names, chain.standard_deviation, strict=True))}
