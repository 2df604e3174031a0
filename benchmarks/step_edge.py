"""Bias and noise of every law on the flat step edge, by the estimator of a screen-space gather, in float64.

    python -m benchmarks.step_edge                  # two minutes on a core; --quick for a first look

Places are within 4 mfp of the edge. Bias: the largest difference of the law's own integral from the exact one, as a
share of A; no number of samples takes it away. Noise: root mean square, over places and trials, of one estimate of (22)
against the exact answer, over that of the exact profile with radii by its exact quantile, from the same points:
independent ones, or the stage's lattice with a random shift. Uniform radii end at 99.5 % of the energy, and miss the
rest.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import profilefit
from benchmarks.table import show
from mcml_sim import Setting
from profilefit.errors import InputError, RecordError
from profilefit.fitting.sampling import ExactTarget
from profilefit.laws.base import ProfileLaw
from profilefit.scenes.stage.reference.step_edge import (
    UNIFORM_SHARE,
    EdgeGather,
    by_law,
    by_quantile,
    edge_estimate,
    random_points,
    shifted_points,
    step_response,
)

Floats = NDArray[np.float64]

ALPHAS = (0.5, 0.8, 0.95, 0.99)
REACH = 4.0  # [mfp]
PLACES = np.linspace(-REACH, REACH, 161)  # of the bias
NOISY_PLACES = (np.arange(32) - 15.5) * (REACH / 16)  # of the noise: no point on the edge, where E is undefined
POINTS = {"random": random_points, "lattice": shifted_points}
# Label, law, constants, by light.
WANTED = {
    "searchlight": (
        ("hazard", "hazard", "regenerated"),
        ("quantile", "quantile", "regenerated"),
        ("normalized diffusion", "burley", "published"),
        ("normalized diffusion, refitted", "burley", "regenerated"),
        ("Liang, printed", "liang", "published"),
        ("Liang, corrected", "liang", "corrected"),
        ("Liang, refitted", "liang", "regenerated"),
        ("four Gaussians", "gaussians:4", "regenerated"),
    ),
    "diffuse": (
        ("hazard", "hazard", "regenerated"),
        ("quantile", "quantile", "regenerated"),
        ("normalized diffusion", "burley", "published:diffuse"),
        ("normalized diffusion, refitted", "burley", "regenerated"),
    ),
}


@dataclass(frozen=True)
class Row:
    """Way to gather, at each albedo of ALPHAS.

    bias  largest |L_law - L_exact| / A [-], none where the profile is exact
    noise  by kind of points, over that of the exact quantile [-]
    """

    label: str
    bias: Floats | None
    noise: dict[str, Floats]


def bias(law: ProfileLaw, alpha: float) -> float:
    """Return the largest |L_law - L_exact| / A within REACH of the edge."""
    return float(
        np.max(np.abs(step_response(PLACES, alpha, law=law) - step_response(PLACES, alpha, setting=law.setting)))
    )


def by_uniform(alpha: float, setting: Setting) -> EdgeGather:
    """Return the gather with radii uniform up to that of 99.5 % of the light, for the exact profile."""
    target, low, high = ExactTarget(setting), 0.0, 1e6
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if target.cdf(np.array([middle]), alpha)[0] < UNIFORM_SHARE else (low, middle)
    return EdgeGather(lambda xi: xi * high, lambda x: target.density(x, alpha))


def noise(gather: EdgeGather, points: Floats, alpha: float, setting: Setting) -> float:
    """Return the root mean square of one estimate against the exact answer, over places and trials, as a share of A."""
    return float(np.sqrt(np.mean(edge_estimate(gather, points, NOISY_PLACES, alpha, setting).rmse ** 2)))


def measured(illumination: str, samples: int, trials: int, seed: int) -> tuple[dict[str, Floats], list[Row], list[str]]:
    """Return the exact quantile's own noise by kind of points, all rows, and a line for each law that is missing."""
    setting = Setting(illumination)
    points = {kind: draw(samples, trials, seed) for kind, draw in POINTS.items()}

    def over_albedos(gathers: Sequence[EdgeGather]) -> dict[str, Floats]:
        pairs = list(zip(gathers, ALPHAS, strict=True))
        return {kind: np.array([noise(g, drawn, a, setting) for g, a in pairs]) for kind, drawn in points.items()}

    floor = over_albedos([by_quantile(a, setting) for a in ALPHAS])

    def row(label: str, biases: Floats | None, gathers: Sequence[EdgeGather]) -> Row:
        found = over_albedos(gathers)
        return Row(label, biases, {kind: found[kind] / floor[kind] for kind in found})

    rows = [row("exact, uniform radii", None, [by_uniform(a, setting) for a in ALPHAS])]
    left_out = []
    for label, name, constants in WANTED[illumination]:
        try:
            law = profilefit.load(name, constants, setting=setting)
        except (InputError, RecordError) as error:
            left_out.append(f"{label}: {error}")
        else:
            rows.append(row(label, np.array([bias(law, a) for a in ALPHAS]), [by_law(law, a) for a in ALPHAS]))
    return floor, rows, left_out


def report(illumination: str, samples: int, floor: dict[str, Floats], rows: Sequence[Row]) -> None:
    """Print the tables of one light."""
    columns = ("law", *(f"alpha = {alpha:g}" for alpha in ALPHAS))
    show(
        f"Bias on the step edge under {illumination} light, % of A",
        columns,
        [(row.label, *(f"{100 * value:.3f}" for value in row.bias)) for row in rows if row.bias is not None],
    )
    for kind, own in floor.items():
        show(
            f"Noise of {samples} {kind} samples under {illumination} light, over that of the exact quantile",
            columns,
            [
                ("exact quantile: noise / A itself", *(f"{value:.4f}" for value in own)),
                *((row.label, *(f"{value:.3f}" for value in row.noise[kind])) for row in rows),
            ],
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--trials", type=int, default=4096, help="estimates at each place")
    parser.add_argument("--quick", action="store_true", help="256 trials: noisy")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    options = parser.parse_args(arguments)
    numbers = {}
    for illumination in WANTED:
        trials = 256 if options.quick else options.trials
        floor, rows, left_out = measured(illumination, options.samples, trials, options.seed)
        report(illumination, options.samples, floor, rows)
        for line in left_out:
            print(f"left out: {line}")
        numbers[illumination] = {
            row.label: {
                "bias": None if row.bias is None else row.bias.tolist(),
                **{kind: v.tolist() for kind, v in row.noise.items()},
            }
            for row in rows
        }
    if options.json:
        content = {"alphas": ALPHAS, "samples": options.samples, "trials": trials, "laws": numbers}
        options.json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
