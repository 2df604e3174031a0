"""How a pixel gathers: how many samples, how their radii and angles are drawn, for which channel."""

from __future__ import annotations

from dataclasses import dataclass

from mcml_sim.media.checks import checked_whole
from profilefit.errors import InputError

KINDS = ("uniform", "importance", "importance blue")
CHANNELS = ("longest", "mixture")
MOST_SAMPLES = 256
MOST_SEED = 2**31 - 1


@dataclass(frozen=True)
class Sampling:
    """How the points of a lattice (`lattice.best`), shifted as a whole in each pixel, become radii and angles.

    Noise on a step edge, alpha 0.8, within 4 mfp, with 16 and 64 points: 0.037 and 0.011; a Fibonacci lattice's 0.035
    and 0.012, Hammersley's set 0.036 and 0.012, the R2 sequence 0.038 and 0.014, Sobol's 0.050 and 0.014, random points
    0.066 and 0.032. This one takes any n, one multiplication a point, and only it turns blue shifts into blue errors.

    samples   of a pixel, 1 ... 256; of the separable filter, taps of each of its two passes
    kind      "uniform", radius uniform up to 99.5 % of the energy of the longest channel; "importance", the law's own
              map; both shifted by white noise; "importance blue", the same map shifted by blue noise
    channels  "longest", all radii from the channel of the longest mfp; "mixture", sample i from channel i mod 3 (the
              longest first), weighted by the mean of the three densities
    area      a sample stands for the surface that it shows: it lies where its ray meets the plane of the pixel hit, and
              weighs 1 / |n.v|, at most 20. Off: it lies at the depth of that pixel, as in Liang et al., (22)
    seed      of the shifts
    """

    samples: int = 16
    kind: str = "importance blue"
    channels: str = "longest"
    area: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        checked_whole("samples", self.samples, 1, MOST_SAMPLES)
        checked_whole("seed", self.seed, 0, MOST_SEED)
        for name, accepted in (("kind", KINDS), ("channels", CHANNELS)):
            if getattr(self, name) not in accepted:
                raise InputError(f"{name} must be one of {', '.join(accepted)}, got {getattr(self, name)!r}")
        if not isinstance(self.area, bool):
            raise InputError(f"area must be True or False, got {self.area!r}")
