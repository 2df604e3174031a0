"""What each misprint of Zhao et al.'s single scattering costs: their sum of N samples against the closed one.

    python -m benchmarks.paper_sum      # a minute

Root mean square of sum / closed - 1 over twelve stacks of `benchmarks.stacks`, light at cosines 1, .7, .3 and eye at 1,
.5, .2; samples down to six mean free paths of the first layer, which the paper does not give. First with every
misprint, then with one at a time, last with none. With g = .9 scattering is tenfold, so that mu_s' stays; what is left
of the error then is Schlick's phase function, straight back a ninth of Henyey and Greenstein's.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.stacks import stacks
from benchmarks.table import show
from benchmarks.zhao import CORRECTED, PRINTED, Corrections, single_sum
from mcml_sim import Medium
from profilefit.scenes.layers.law import single_scattering

SAMPLES = (4, 8, 16, 64)
IN, OUT, AZIMUTH = (1.0, 0.7, 0.3), (1.0, 0.5, 0.2), 1.0
DEEPEST = 6.0  # mean free paths of the first layer


def media(g: float) -> list[Medium]:
    """The stacks, with scattering that looks alike from afar."""
    found = [medium for channel in range(3) for medium in stacks(channel).values()]
    return [
        replace(medium, layers=tuple(replace(one, mu_s=one.mu_s / (1 - g), g=g) for one in medium.layers))
        for medium in found
    ]


def error(corrections: Corrections, samples: int, g: float) -> float:
    """Root mean square of sum / closed - 1 [-]."""
    found = []
    for medium, cos_in, cos_out in itertools.product(media(g), IN, OUT):
        deepest = DEEPEST * medium.layers[0].mfp
        summed = single_sum(medium, cos_in, cos_out, AZIMUTH, samples, deepest, corrections)
        found.append(summed / float(single_scattering(medium, cos_in, cos_out, AZIMUTH)) - 1)
    return float(np.sqrt(np.mean(np.square(found))))


def rows(g: float) -> Iterator[tuple[str, ...]]:
    """As printed, each misprint alone, and none."""
    alone = {f"{name} as printed": replace(CORRECTED, **{name: False}) for name in Corrections.of_sum()}
    for label, corrections in {"as printed": PRINTED, **alone, "corrected": CORRECTED}.items():
        yield label, *(f"{error(corrections, samples, g):.2g}" for samples in SAMPLES)


def main() -> None:
    for g in (0.0, 0.9):
        show(f"The paper's sum against the closed one, g = {g:g}", ("", *(f"N = {n}" for n in SAMPLES)), rows(g))


if __name__ == "__main__":
    main()
