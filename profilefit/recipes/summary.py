"""Content of a record of a fit: its constants with their errors, its state, its chains and the data behind it.

Discretisation is how far constants are from those of infinitely narrow rings. A fit is repeated with rings two to six
times as wide, made of the same photons. What falls with the square of the width (a ring's middle in place of its
average, a straight line in place of the cdf) is extrapolated to a width of zero (Richardson, Phil. Trans. R. Soc. A
210, 1911). An objective that compares integrals over rings has nearly none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from numpy.typing import NDArray

from profilefit.fitting.chains import LEVELS, Posterior, posterior
from profilefit.fitting.discrepancy import LawWithErrors, discrepancy
from profilefit.fitting.discrepancy import summary as quantities
from profilefit.fitting.estimate import JACKKNIFE_GROUPS, Fit, ResidualFunction, Rings, judged
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import solve_batch
from profilefit.recipes import record

Floats = NDArray[np.float64]
# As many at once as the jackknife has groups: that solver is compiled already.
FACTORS = tuple(range(1, JACKKNIFE_GROUPS + 1))
TRUSTED = (2, 3)  # of which the error is made; wider rings show the order
ORDER = 2
# Width of a ring that holds nothing [of the next edge]: narrower than any other, wide enough to divide by.
NONE = 1e-9


def discretisation_error(fit: Fit) -> Floats:
    """Return the distance (p,) of the constants from those at no width; 0 for a fit that sees one ring.

    The larger of what rings twice and three times as wide extrapolate to. NaN where a fit fails.
    """
    if not fit.solution.converged:
        return np.full(len(fit.free), np.nan)
    if np.asarray(fit.rings.r_edges).size <= 2:
        return np.zeros(len(fit.free))
    moved = by_width(fit)
    off = [np.abs(moved[factor] - moved[1]) / (factor**ORDER - 1) for factor in TRUSTED]
    return np.asarray(np.max(off, axis=0))


def by_width(fit: Fit, factors: Sequence[int] = FACTORS) -> dict[int, Floats]:
    """Return constants (p,) by how many rings are taken together; NaN where a fit fails."""
    problem = ResidualFunction(fit.objective, fit.free)
    wider = [widened(fit.rings, factor) for factor in factors]
    rings = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *wider)
    law = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(factors), *np.shape(leaf))), fit.law)
    starts = np.tile(fit.solution.parameters, (len(factors), 1))
    found = [judged(one, fit.free) for one in solve_batch(problem, starts, (law, rings))]
    lost = np.full(len(fit.free), np.nan)
    return {k: one.parameters if one.converged else lost for k, one in zip(factors, found, strict=True)}


def widened(rings: Rings, factor: int) -> Rings:
    """Take `factor` rings together, in arrays of the same shape: the rings between hold nothing and do not count.

    A wide ring counts where all its parts do. The last one is as wide as the rings left over.
    """
    edges, energy, used = (np.asarray(part, float) for part in (rings.r_edges, rings.energy, rings.used))
    first = np.arange(0, energy.shape[1], factor)
    last = np.minimum(first + factor, energy.shape[1]) - 1
    whole, kept = np.zeros_like(energy), np.zeros_like(used)
    whole[:, last] = np.add.reduceat(energy, first, axis=1)
    kept[:, last] = np.minimum.reduceat(used, first, axis=1)
    moved = edges.copy()
    for start, end in zip(first, last, strict=True):
        step = NONE * max(edges[start], edges[1])
        moved[start : end + 1] = edges[start] + step * np.arange(end + 1 - start)
    return eqx.tree_at(lambda tree: (tree.r_edges, tree.energy, tree.used), rings, (moved, whole, kept))


Arrays = dict[str, np.ndarray]


def described(
    result: Fit, profiles: Profiles, printed: dict[str, float], seed: int, max_chain: int
) -> tuple[dict[str, Any], Arrays]:
    """Return the part of a record that every fit has, and the samples beside it; `printed` are published constants."""
    chains = []
    if result.solution.converged:  # elsewhere the curvature describes no optimum, and the record says why
        chains = [
            posterior(result, kind, seed, max_chain)
            for kind in ("statistical", "misfit")
            if getattr(result, kind) is not None
        ]
    off, width = discrepancy(result, profiles), discretisation_error(result)
    errors = {"model_error": np.sqrt(np.diag(off.covariance)), "discretisation_error": width}
    covariances = {"statistical": result.statistical, "misfit": result.misfit, "model": off.covariance}
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
        "posterior": {
            c.kind: {
                **{key: getattr(c, key) for key in ("tau", "acceptance", "walkers", "steps", "result")},
                "standard_deviation": dict(zip(c.names, c.standard_deviation, strict=True)),
            }
            for c in chains
        },
        "data_digest": record.digest(profiles.alpha, profiles.r_edges, profiles.energy),
    }
    if result.solution.converged:
        known = LawWithErrors(result.law, result.free, result.objective, result.statistical, off)
        content["derived"] = quantities(known, profiles)
    if profiles.covariance is not None:
        content["covariance_rank"] = {"rank": profiles.covariance.rank, "dropped": profiles.covariance.dropped}
        # Of what rests on too few effective photons: rings, where the objective sees rings, and whole albedos.
        sees_rings = result.objective in ("energy", "radial")
        content["left_out"] = {
            "rings": int(np.sum(~profiles.trusted)) if sees_rings else 0,
            "albedos": int(np.sum(np.asarray(result.rings.weight) == 0)),
        }
    samples = {f"samples_{c.kind}": c.samples.astype(np.float32) for c in chains}
    samples |= {f"log_density_{c.kind}": c.log_density.astype(np.float32) for c in chains}
    return content, samples | off.arrays()


def curves(profiles: Profiles) -> Arrays:
    """Return what the figures draw: the data with its errors; of a fit to several settings, those of its own."""
    own = [one == profiles.setting for one in profiles.settings] if profiles.settings else slice(None)
    return {
        "alpha": profiles.alpha[own],
        "r_edges": profiles.r_edges,
        "energy": profiles.energy[own],
        "energy_error": profiles.standard_error[own],
        "beyond": profiles.beyond[own],
    }


def errors_by_name(names: tuple[str, ...], covariance: Floats | None) -> dict[str, float]:
    """Return standard errors from a covariance; none where there is none."""
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
            "misfit_error": float(np.sqrt(result.misfit[i, i])),
            "jackknife_error": float(result.jackknife[i]),
            **{name: float(error[i]) for name, error in errors.items()},
            "intervals": {c.kind: {f"{level:.0%}": c.interval(level)[i] for level in LEVELS} for c in chains},
        }
    return constants
