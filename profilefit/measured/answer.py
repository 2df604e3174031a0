"""All that a fit has to say: what it found, what it can tell, what would tell more; and the same as plain content."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from profilefit import record
from profilefit.measured import chain, derived
from profilefit.measured.candidates import Advice, advised
from profilefit.measured.data import Measured
from profilefit.measured.fitting import LEVEL, Found
from profilefit.measured.model import NAMES, U, u_of
from profilefit.measured.solving import descended
from profilefit.measured.telling import Telling, told
from profilefit.walking import Walk

Floats = NDArray[np.float64]
GREY = 0.9  # albedo that advice is given for where the data leave it open altogether


@dataclass(frozen=True)
class Answer:
    """A fit judged. telling, advice and walk are None where the fit failed, walk also where an interval is open."""

    found: Found
    telling: Telling | None
    advice: Advice | None
    walk: Walk | None

    @cached_property
    def draws(self) -> dict[str, Floats]:
        """Posterior draws (k,) of every quantity; empty without a chain."""
        if self.walk is None:
            return {}
        return self._quantities(chain.points(self.found, self.walk.samples))

    @cached_property
    def whole_draws(self) -> dict[str, Floats]:
        """The same, each moved by an error of the law and, where one is seen, of the misfit; empty if none is known."""
        found = self.found
        if self.walk is None or not found.minimum.converged or not (found.misfit.detected or found.rel is not None):
            return {}
        free = list(found.question.free)
        others = found.of_law + (found.of_misfit if found.misfit.detected else 0.0)
        points = chain.points(found, self.walk.samples)
        generator = np.random.default_rng(len(points))
        zero, joint = np.zeros(len(free)), others[np.ix_(free, free)]
        points[:, free] += generator.multivariate_normal(zero, joint, len(points), method="eigh")
        return self._quantities(points)

    def _quantities(self, points: Floats) -> dict[str, Floats]:
        data = self.found.data
        reflectance = self.found.problem.model.predicted(points, data.inner[:1], data.outer[:1])[:, -1]
        return derived.quantities(points, reflectance)

    @property
    def moving(self) -> tuple[str, ...]:
        """The quantities that the fit decided."""
        return tuple(name for name, one in self.found.gradients.items() if np.any(one[list(self.found.question.free)]))

    @property
    def told(self) -> tuple[str, ...]:
        """Those whose errors mean something: at an edge of alpha, what hangs on it has none."""
        if self.found.minimum.converged:
            return self.moving
        hanging = ("A", "alpha", "mu_a")
        return tuple(name for name in self.moving if name not in hanging) if self.found.minimum.at_edge else ()

    def interval(self, name: str) -> tuple[float, float] | None:
        """95 % by the data's errors alone: of the posterior draws; without a chain, of the profile likelihood."""
        if name not in self.draws or name not in self.moving:
            found = [one for one in (self.telling.intervals if self.telling else ()) if one.name == name]
            return (found[0].low, found[0].high) if found and name in self.moving else None
        return _middle(self.draws[name])

    def whole_interval(self, name: str) -> tuple[float, float] | None:
        """95 % by all errors together: data, law, and misfit where one is seen; None where these are not known."""
        return _middle(self.whole_draws[name]) if name in self.whole_draws and name in self.moving else None


def _middle(draws: Floats) -> tuple[float, float]:
    low, high = np.quantile(draws, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2])
    return float(low), float(high)


def answered(found: Found, seed: int = 0, walk: bool = True) -> Answer:
    """Judge a fit; with `walk` a chain, which takes longest, is walked where the data hold every coordinate."""
    if not (found.minimum.converged or found.minimum.at_edge):
        return Answer(found, None, None, None)
    telling = told(found)
    # The prior ends at alpha = 1; any other open end leaves the walkers nowhere to stop.
    endless = any(one.open_low or (one.open_high and one.name != "alpha") for one in telling.intervals)
    walked = chain.posterior(found, seed) if walk and found.question.free and not endless else None
    return Answer(found, telling, advised(_inside(found, telling)), walked)


def _inside(found: Found, telling: Telling) -> Found:
    """A fit at an edge moved to the other end of what alpha may be: from the edge no measurement seems to help."""
    if not found.minimum.at_edge:
        return found
    (alpha,) = [one for one in telling.intervals if one.name == "alpha"]
    start = found.point.copy()
    start[U] = u_of(
        next((x for x, is_open in ((alpha.low, alpha.open_low), (alpha.high, alpha.open_high)) if not is_open), GREY)
    )
    others = tuple(at for at in found.question.free if at != U)
    return replace(found, minimum=descended(found.problem, start, others))


def known_medium(data: Measured) -> dict[str, float]:
    """The first layer of the medium that a simulation was of, by the quantities that it has."""
    if data.medium is None:
        return {}
    layer = data.medium.layers[0].similar
    return {"alpha": layer.alpha, "l": layer.mfp, "mu_s'": layer.mu_s, "mu_a": layer.mu_a}


def content(answer: Answer, law: str, constants: str) -> dict[str, Any]:
    """Everything, as JSON takes it; errors of the law are null where they are not known."""
    found = answer.found
    data, question = found.data, found.question
    body = {
        "data": {
            "file": data.source,
            "sha256": data.digest,
            "unit": data.unit,
            "kind": "rings" if data.rings else "points",
            "errors": data.errors,
            "errors_are_bounds": data.bounded,
            "notes": data.notes,
            "medium": data.medium,
            "inner": data.inner,
            "outer": data.outer,
            "value": data.value,
            "sigma": found.sigma,
            "freedom": data.freedom if np.isfinite(data.pooled) else None,
            "pooled_freedom": data.pooled if np.isfinite(data.pooled) else None,
            "photons": data.photons if np.isfinite(data.photons) else None,
        },
        "law": {
            "name": law,
            "constants": constants,
            "setting": question.law.setting,
            "record": None if found.source is None else found.source.path.name,
            "record_sha256": None if found.source is None else found.source.digest,
            "rel": found.rel,
        },
        "free": [NAMES[at] for at in question.free],
        "held": question.held,
        "known": {"A": question.total, "scale": question.scale},
        "result": found.minimum.result,
        "steps": found.minimum.steps,
        "widening": found.widening,
        "quantile_95": found.quantile,
        "quantities": _quantities(answer),
        "correlation": _correlation(answer),
        "light": found.light,
        "residuals": found.minimum.residuals,
        "versions": record.versions(),
    }
    if answer.telling is not None and answer.advice is not None:
        body["misfit"] = {
            **vars(found.misfit),
            "detected": found.misfit.detected,
            "within_law": found.misfit.within_law,
        }
        body["telling"] = {**vars(answer.telling), "told": answer.telling.told}
        body["advice"] = answer.advice
        body["rows_beyond_99.5_percent"] = int(found.beyond.sum())
    if answer.walk is not None:
        body["posterior"] = {k: v for k, v in vars(answer.walk).items() if k not in ("samples", "log_density")}
    plain: dict[str, Any] = record.plain(body)
    return plain


def _quantities(answer: Answer) -> dict[str, Any]:
    found = answer.found
    kinds: dict[str, Floats | None] = {
        "statistical": found.statistical,
        "law": found.of_law if found.rel is not None else None,
    }
    if answer.telling is not None:
        kinds["misfit"] = found.of_misfit
    errors = {kind: found.errors(one) if one is not None else {} for kind, one in kinds.items()}
    truth = known_medium(found.data)
    return {
        name: {
            "value": value,
            "unit": derived.unit_of(name, found.data.unit),
            **{f"{kind}_error": one.get(name) if name in answer.told else None for kind, one in errors.items()},
            "interval_95_data": answer.interval(name),
            "interval_95_total": answer.whole_interval(name),
            "of_file": truth.get(name),
        }
        for name, value in found.values.items()
    }


def _correlation(answer: Answer) -> dict[str, Any]:
    names = answer.told
    if not names:
        return {}
    joint = derived.correlation(answer.found.gradients, answer.found.statistical, names)
    return {"names": names, "matrix": joint}
