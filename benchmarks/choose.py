"""Test of `profilefit choose`: its predicted errors against measured ones, on random scenes.

    python -m benchmarks.choose                        # ten minutes on two cores; --quick for three scenes
                                [--scenes N] [--seed N] [--json FILE]
    python -m benchmarks.choose --ratios FILE          # costs on this machine, as in profilefit/choose/ratios.json

Each scene is a material of Jensen et al. or a colour and a mean free path drawn at random, 0.1 to 50 pixels long, on a
plane and, in two of three, around a cylinder of 2 to 50 mean free paths, with a tolerance of its own. The screen is so
large that it shows what the light reaches. The option that is chosen, all that are cheaper and the next dearer one are
rendered through OpenGL and compared with the reference (`choose_render.py`), flat and curved. Then: is the predicted
error within a factor 1.5 of the measured one, and did no cheaper option meet the tolerance?
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.choose_render import Measured, fits, size
from benchmarks.table import show
from mcml_sim import Setting
from profilefit.errors import ShaderError
from profilefit.materials import MATERIALS
from profilefit.scenes.skin.material import translucent
from profilefit.shader.context import opened, renderer
from profilefit.studies.choose import cost
from profilefit.studies.choose.case import Within
from profilefit.studies.choose.choice import Choice, Predicted, cases, choose, laws
from profilefit.studies.choose.requirements import Budget, Requirements

SETTING, REFRACTING = Setting("diffuse"), Setting("diffuse", n=1.4)
SCENES, QUICK, SEED = 30, 3, 1
PIXELS = (0.1, 50.0)  # of the longest mean free path [pixels]
RADII = (2.0, 50.0)  # of the cylinder [longest mean free path]
TOLERANCES = (0.005, 0.1)
FACTOR = 1.5
# What a measured error may be off by: 3 % by the noise of so many estimates, 2 % by the pixels of the reference.
TOLD = 0.03


@dataclass(frozen=True)
class Compared:
    """Option of a scene: predicted, and measured [share of white]."""

    predicted: Predicted
    measured: float

    @property
    def ratio(self) -> float:
        return self.predicted.error.total / self.measured


@dataclass(frozen=True)
class Verified:
    """Scene, what was chosen, and every option that was rendered, cheapest first."""

    name: str
    choice: Choice
    compared: tuple[Compared, ...]

    @property
    def own(self) -> Compared:
        """Comparison of the choice."""
        return next(one for one in self.compared if one.predicted is self.choice.nearest)

    @property
    def worst_ratio(self) -> float:
        """Comparison of all options that is farthest from 1."""
        return max((one.ratio for one in self.compared), key=lambda ratio: abs(math.log(ratio)))

    @property
    def within_factor(self) -> bool:
        return 1.0 / FACTOR < self.own.ratio < FACTOR

    @property
    def disappoints(self) -> bool:
        """Whether the choice misses the tolerance after all, by more than the errors."""
        return self.own.measured > self.choice.scene.tolerance * (1.0 + TOLD)

    @property
    def wasteful(self) -> list[Compared]:
        """Cheaper options that met the tolerance after all, by more than the errors."""
        cheaper = self.compared[: self.compared.index(self.own)]
        return [one for one in cheaper if one.measured * (1.0 + TOLD) <= self.choice.scene.tolerance]


def scenes(count: int, seed: int) -> Iterator[tuple[str, Requirements]]:
    """Yield name and scene, in millimetres."""
    random = np.random.default_rng(seed)

    def log_uniform(ends: tuple[float, float]) -> float:
        return float(np.exp(random.uniform(*np.log(ends))))

    while count:
        name = "drawn" if random.random() < 0.3 else MATERIALS[random.integers(len(MATERIALS))].name
        if name == "drawn":
            reflectance, mfp = random.uniform(0.05, 0.9, 3), log_uniform((0.1, 5.0)) * random.uniform(0.4, 1.0, 3)
        else:
            reflectance, mfp = (np.array(value) for value in (translucent(name).reflectance, translucent(name).mfp))
        pixel = float(mfp.max()) / log_uniform(PIXELS)
        radius = float(mfp.max()) * log_uniform(RADII) if random.random() < 2 / 3 else math.inf
        tolerance = log_uniform(TOLERANCES)
        (a, b, c), (d, e, f) = (tuple((float(v), float(v)) for v in values) for values in (reflectance, mfp))
        scene = Requirements("mm", SETTING, (a, b, c), (d, e, f), (pixel, pixel), radius, tolerance, Within(), Budget())
        plane = next(cases(scene))
        if fits(plane, SETTING, scene.within):  # else another one
            count -= 1
            yield name, replace(scene, resolution=size(plane, SETTING, scene.within))


def verified(context: moderngl.Context, name: str, scene: Requirements) -> Verified:
    """Choose for a scene, and render what matters for the choice."""
    choice = choose(scene, cost.shipped())
    place = choice.predicted.index(choice.nearest)
    wanted = [*choice.predicted[: place + 1], *([choice.dearer] if choice.dearer else [])]
    with ExitStack() as held:
        views = (Measured(context, case, SETTING, scene.within, scene.resolution) for case in cases(scene))
        drawn = [held.enter_context(view) for view in views]
        compared = tuple(Compared(one, max(view.error(one.option) for view in drawn)) for one in wanted)
    return Verified(name, choice, compared)


def row(one: Verified) -> tuple[str, ...]:
    """Return the cells of the table."""
    scene, own = one.choice.scene, one.own
    longest = max(high for _, high in scene.mfp)
    kind = "" if one.choice.chosen else "nearest: "
    return (
        one.name,
        f"{longest / scene.pixel[0]:.2g}",
        "flat" if math.isinf(scene.radius) else f"{scene.radius / longest:.2g}",
        f"{100 * scene.tolerance:.2g}",
        kind + own.predicted.option.label,
        f"{100 * own.predicted.error.total:.2g}",
        f"{100 * own.measured:.2g}",
        f"{own.ratio:.2f}",
        f"{one.worst_ratio:.2f} of {len(one.compared)}",
        "none" if not one.wasteful else ", ".join(w.predicted.option.label for w in one.wasteful),
    )


COLUMNS = (
    "material",
    "l, pixels",
    "radius, l",
    "requested, %",
    "chosen",
    "predicted, %",
    "measured, %",
    "ratio",
    "worst ratio",
    "cheaper that serve",
)


def as_json(found: Sequence[Verified]) -> list[dict]:
    """Return all comparisons for JSON."""
    return [
        {
            "material": one.name,
            "mfp": [high for _, high in one.choice.scene.mfp],
            "pixel": one.choice.scene.pixel[0],
            "radius": None if math.isinf(one.choice.scene.radius) else one.choice.scene.radius,
            "tolerance": one.choice.scene.tolerance,
            "chosen": one.choice.nearest.option.label,
            "options": {
                c.predicted.option.label: {"predicted": c.predicted.error.total, "measured": c.measured}
                for c in one.compared
            },
        }
        for one in found
    ]


def ratios_json(ratios: cost.Ratios) -> str:
    """Return ratios as the JSON that `cost.shipped` reads."""
    content = {key: value for key, value in asdict(ratios).items() if key != "spread"}
    return json.dumps(content, indent=1) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command; status 1 if a prediction or a choice is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=SCENES)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there too")
    parser.add_argument("--ratios", type=Path, metavar="FILE", help="measure costs only, and write them there")
    options = parser.parse_args(arguments)
    found = []
    try:
        with opened() as context:
            print(f"on {renderer(context)}")
            if options.ratios:
                ratios = cost.measured(context, {**laws(SETTING), **laws(REFRACTING)})
                options.ratios.write_text(ratios_json(ratios), encoding="utf-8")
                return
            for name, scene in scenes(QUICK if options.quick else options.scenes, options.seed):
                found.append(verified(context, name, scene))
                print("  ".join(row(found[-1])), file=sys.stderr, flush=True)
    except ShaderError as error:
        sys.exit(str(error))
    report(found)
    if options.json:
        options.json.write_text(json.dumps(as_json(found), indent=2) + "\n", encoding="utf-8")
    wrong = (not v.within_factor or v.wasteful or (v.choice.meets_tolerance and v.disappoints) for v in found)
    if any(wrong):
        sys.exit(1)


def report(found: Sequence[Verified]) -> None:
    """Print the table, and its summary."""
    show("Predicted and measured error at an edge of light, % of white", COLUMNS, [row(one) for one in found])
    ratios = np.array([one.own.ratio for one in found])
    every = np.array([c.ratio for one in found for c in one.compared])
    near = f"{100 * np.mean((every > 1 / FACTOR) & (every < FACTOR)):.1f} % of {len(every)}"
    print(f"chosen: predicted / measured {ratios.min():.2f} to {ratios.max():.2f}, {len(ratios)} scenes")
    print(f"all that was rendered: {every.min():.2f} to {every.max():.2f}, {near} within a factor {FACTOR}")
    print(f"scenes where the prediction is beyond that: {sum(not one.within_factor for one in found)}")
    served = [one for one in found if one.choice.meets_tolerance]
    print(
        f"scenes where the choice, said to serve, does not: {sum(one.disappoints for one in served)} of {len(served)}"
    )
    print(f"scenes where a cheaper option serves: {sum(bool(one.wasteful) for one in found)}")


if __name__ == "__main__":
    main()
