"""What the constants of the hazard law are worth: its recipes fitted with fewer and fewer of them.

    python -m benchmarks.constants [--quick]       # two minutes on two cores; --quick: at three indices

The constants that are left out are 0. Where surfaces refract: without terms quadratic in rho, the share of light that
the surface reflects back inside; without any, one set of shapes for all indices. Where n = 1: without those for the
last of the light. Each law is judged at held-out albedos and, in n, at indices that were fitted and at some that were
not. Below them, the law in n where hardly anything refracts: what a second part is worth at n = 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

import profilefit
from benchmarks.table import show
from mcml_sim import Setting
from profilefit.fitting.estimate import fit
from profilefit.fitting.quality import profile_quality
from profilefit.recipes import recipe, starts
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.pipelines import JUDGED, QUALITY_ALBEDOS
from profilefit.recipes.targets import albedo_values, truth_of

# Constants that are left out: those that stand with a power of rho, and those of the last of the light at n = 1.
IN_N = {"all": (), "without rho^2": ("2",), "without rho": ("1", "2")}
MATCHED = {"all": (), "without c3": ("c3",), "without b3 and c3": ("b3", "c3")}
RECIPES = {"hazard-refracting": IN_N, "hazard-diffuse-refracting": IN_N, "hazard": MATCHED, "hazard-diffuse": MATCHED}
BARELY = 1.0005
Row = tuple[str, ...]


def refitted(name: str, indices: tuple[float, ...]) -> Iterator[Row]:
    """Rows of one recipe: constants that are free, worst errors over indices and albedos."""
    chosen = recipe.find(name, fits_folder())
    profiles, start = truth_of(chosen, None), starts.starting_law(chosen, fits_folder())
    names = start.constant_names()
    n = f"{chosen.indices[0]:g} to {chosen.indices[-1]:g}" if chosen.indices else "1"
    for label, out in RECIPES[name].items():
        held = tuple(one for one in names if one.endswith(out) and not one.startswith("once"))
        free = tuple(one for one in names if one not in held)
        begun = start.with_vector(held, [0.0] * len(held))
        limits = (0.0, 0.0, chosen.weighting.rising)
        law = fit(profiles, begun, chosen.weighting.objective, free, limits=limits, jackknife=False).law
        laws = [law.at(replace(law.setting, n=one)) for one in indices] if chosen.indices else [law]
        yield chosen.setting.illumination, n, label, str(len(free)), *_worst(laws)


def barely_refracting() -> Iterator[Row]:
    """Rows of the law in n next to n = 1."""
    for light in ("searchlight", "diffuse"):
        law = profilefit.load("hazard", setting=Setting(light, BARELY))
        yield light, f"{BARELY:g}", "all", str(len(law.text_constants())), *_worst([law])


def _worst(laws: list) -> Row:
    each = [profile_quality(law, albedo_values(QUALITY_ALBEDOS)) for law in laws]
    return tuple(f"{max(float(np.max(getattr(one, key))) for one in each):.2g}" for key in ("rel", "ks", "largest"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three indices")
    quick = parser.parse_args().quick
    with threadpool_limits(1, "blas"):
        rows = [row for name in RECIPES for row in refitted(name, JUDGED[::4] if quick else JUDGED)]
        rows += barely_refracting()
    columns = ("light", "n", "law", "constants", "rel", "ks", "at one radius")
    show("Worst errors over indices and held-out albedos", columns, rows)


if __name__ == "__main__":
    main()
