"""What one law for every refractive index costs: its constants and its time against its error.

    python -m benchmarks.indices [--quick]       # five minutes on two cores; --quick: two

The recipes `hazard-refracting` and `hazard-diffuse-refracting` are fitted with fewer and fewer of their constants free
and the others 0: without terms quadratic in rho, the share of light that the surface reflects back inside; without any,
one set of shapes for all indices. Each is judged at indices that were fitted and at some that were not, and at held-out
albedos. Below them, both forms where hardly anything refracts: what a second part is worth at n = 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

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

RECIPES = ("hazard-refracting", "hazard-diffuse-refracting")
# Constants by the last power of rho that they stand with.
FREE = {"all": "012", "without rho^2": "01", "without rho": "0"}
BARELY = 1.0005
Row = tuple[str, ...]


def spanned(name: str, indices: tuple[float, ...]) -> Iterator[Row]:
    """Rows of one recipe: constants that are free, worst errors over indices and albedos."""
    chosen = recipe.find(name, fits_folder())
    profiles, start = truth_of(chosen, None), starts.starting_law(chosen, fits_folder())
    names = start.constant_names()
    for label, powers in FREE.items():
        free = tuple(one for one in names if one.startswith("once") or one[-1] in powers)
        held = tuple(one for one in names if one not in free)
        begun = start.with_vector(held, [0.0] * len(held))
        limits = (0.0, 0.0, chosen.weighting.rising)
        found = fit(profiles, begun, chosen.weighting.objective, free, limits=limits, jackknife=False)
        yield chosen.setting.illumination, label, str(len(free)), *_worst([found.law.at_index(n) for n in indices])


def barely_refracting() -> Iterator[Row]:
    """Rows of both forms next to n = 1, each against exact light of its own index."""
    for light in ("searchlight", "diffuse"):
        for n, label in ((1.0, "one part, n = 1"), (BARELY, f"two parts, n = {BARELY:g}")):
            law = profilefit.load("hazard", setting=Setting(light, n))
            yield light, label, str(len(law.at_one_index())), *_worst([law])


def _worst(laws: list) -> Row:
    each = [profile_quality(law, albedo_values(QUALITY_ALBEDOS)) for law in laws]
    return tuple(f"{max(float(np.max(getattr(one, key))) for one in each):.2g}" for key in ("rel", "ks", "largest"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three indices")
    quick = parser.parse_args().quick
    with threadpool_limits(1, "blas"):
        rows = [row for name in RECIPES for row in spanned(name, JUDGED[::4] if quick else JUDGED)]
        rows += barely_refracting()
    columns = ("light", "law", "constants", "rel", "ks", "at one radius")
    show("Worst errors over indices and held-out albedos", columns, rows)


if __name__ == "__main__":
    main()
