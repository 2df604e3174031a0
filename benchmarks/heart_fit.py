"""The fit of a balance of texture and screen: its crossover and threshold, to the errors of many scenes.

Of each scene the light of every split is known as both spaces have it, so that the error of any crossover and any
threshold is a sum over pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.heart.law import crossover_of

Floats = NDArray[np.float64]
TEXTURE, SCREEN = "texture alone", "screen alone"


@dataclass(frozen=True)
class SplitLight:
    """Pixels (n,) of a random scene, in linear light where white is 1; of splits after m = 0 ... N narrow Gaussians.

    truth    (n, 3);  lambert  (n, 3) without any blur
    near     (N + 1, n, 3) of the m narrow ones on the screen;  far, atlas  (N + 1, n, 3) of the others, on the screen
             and in texture space;  share  (N + 1, n) of the light of the others that the screen sees
    facing   (n,) cosine of normal and ray;  texel, pixel  mean sides [mm];  sigma  (N,) [mm]
    occlusion  (n, 3) error of the screen by `chart.occlusion_error`;  hidden  to the nearest lit place that it does
             not see [mm]
    """

    truth: Floats
    lambert: Floats
    near: Floats
    far: Floats
    atlas: Floats
    share: Floats
    facing: Floats
    texel: float
    pixel: float
    sigma: Floats
    occlusion: Floats
    hidden: float

    def light(self, crossover: float, threshold: float) -> Floats:
        """(n, 3) by a split at a crossover [mm] and a threshold of the share [-]."""
        m = int(np.count_nonzero(self.sigma < crossover))
        return self.near[m] + np.where(self.share[m][:, None] > threshold, self.far[m], self.atlas[m])

    def rms(self, light: Floats) -> float:
        """Root mean square error [-]."""
        return float(np.sqrt(np.mean((light - self.truth) ** 2)))

    def blended(self, *weights: Floats) -> Floats:
        """(n, 3) by texture and screen, the screen's weight that sum of weights (n,) which is best in hindsight."""
        apart = self.screen - self.texture
        columns = np.stack([(one[:, None] * apart).ravel() for one in weights], axis=1)
        share = np.linalg.lstsq(columns, (self.truth - self.texture).ravel(), rcond=None)[0]
        return self.texture + (columns @ share).reshape(apart.shape)

    def ways(self) -> dict[str, float]:
        """Errors of what is no balance [-]."""
        even = np.ones(len(self.facing))
        found = {
            TEXTURE: self.texture,
            SCREEN: self.screen,
            "no blur": self.lambert,
            "constant blend, best in hindsight": self.blended(even),
            "blend by N.V, best in hindsight": self.blended(even, self.facing),
            "three narrow Gaussians on the screen": self.light(self.sigma[3], np.inf),
        }
        return {name: self.rms(light) for name, light in found.items()}

    @property
    def texture(self) -> Floats:
        """Texture space alone (n, 3)."""
        return self.atlas[0]

    @property
    def screen(self) -> Floats:
        """The screen alone (n, 3)."""
        return self.far[0]


class Balance(NamedTuple):
    """Constant of `crossover_of`, and threshold of the share, above 1 if all that is far comes from the atlas [-]."""

    constant: float
    threshold: float


class Errors(NamedTuple):
    """Root mean square errors of scenes: of each way (n,), and of each balance of `GRID` (n, c, t)."""

    ways: dict[str, Floats]
    balanced: Floats

    @property
    def better(self) -> Floats:
        """Lower error of texture and screen (n,)."""
        return np.minimum(self.ways[TEXTURE], self.ways[SCREEN])


GRID = (
    np.geomspace(0.1, 6.0, 40),
    np.array([-1.0, 0.5, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99, 0.995, 2.0]),
)


def errors(scenes: Sequence[SplitLight]) -> Errors:
    """Compute errors of every balance of `GRID`."""
    balanced = np.empty((len(scenes), *(one.size for one in GRID)))
    for number, one in enumerate(scenes):
        known: dict[int, list[float]] = {}
        for row, constant in enumerate(GRID[0].tolist()):
            at = crossover_of(one.texel, one.pixel, constant)
            m = int(np.count_nonzero(one.sigma < at))
            if m not in known:
                known[m] = [one.rms(one.light(at, threshold)) for threshold in GRID[1].tolist()]
            balanced[number, row] = known[m]
    ways = [one.ways() for one in scenes]
    return Errors({name: np.array([one[name] for one in ways]) for name in ways[0]}, balanced)


def fitted(found: Errors, draws: int = 200, seed: int = 1) -> tuple[Balance, NDArray[np.float64]]:
    """Return the balance of `GRID` with the least mean of ln(error / that of the better space), and (draws, 2) refits.

    Refits are to scenes drawn again with replacement: their spread is the error of both constants.
    """
    gain = np.log(found.balanced / found.better[:, None, None])
    random = np.random.default_rng(seed)

    def best(rows: NDArray[np.int64]) -> Balance:
        mean = gain[rows].mean(axis=0)
        # Of many that are as good, as all are where a share is never so large, the middle one.
        row, column = np.argwhere(mean <= mean.min() + 1e-9).mean(axis=0).astype(int)
        return Balance(float(GRID[0][row]), float(GRID[1][column]))

    own = np.arange(len(gain))
    return best(own), np.array([best(random.choice(own, own.size)) for _ in range(draws)])
