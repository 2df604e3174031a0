"""The covariance of the rows: the weight of each, and the correlation of the rings of one simulation.

A photon that leaves through one ring leaves through no other: ring energies E of one run of N photons have the
covariance -E_i E_j / (N - 1), as multinomial counts have, lost or absorbed photons being the complement. Values per
area v keep it: C = diag(sigma^2 + v^2 / (N - 1)) - v v^T / (N - 1). With the first term's root S and
b = S^-1 v / sqrt(N - 1) this is S (1 - b b^T) S, whose inverse root is (Sherman and Morrison)

    C^-1/2 = (1 + c b b^T) S^-1,   c = (1 / sqrt(1 - b^T b) - 1) / b^T b.

Without photons to share b is zero, and this divides by sigma. Where a law stands for the light its own error is a
covariance of the rows, too, and so is a lack of fit; all together are whitened by the root of their sum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from profilefit.measured.data import Measured

Floats = NDArray[np.float64]
# b^T b is the share of the photons that the rings hold: 1 only if none is lost, and more only by rounding.
LARGEST_SHARE = 1.0 - 1e-6


@dataclass(frozen=True, eq=False)
class Noise:
    """The covariance of n rows: root (n,) is the diagonal S [of the values], common (n,) the vector b [-].

    model (n, n) is that of the error of what the rows are held against, None where it has none; lack (n, n) that of a
    lack of fit, None where none is allowed for.
    """

    root: Floats
    common: Floats
    model: Floats | None = None
    lack: Floats | None = None

    @property
    def share(self) -> float:
        return float(self.common @ self.common)

    @property
    def alone(self) -> Noise:
        """The errors of the data only."""
        return replace(self, model=None, lack=None)

    @property
    def data(self) -> Floats:
        """(n, n) covariance of the data's own errors."""
        inner = np.eye(self.root.size) - np.outer(self.common, self.common)
        return inner * np.outer(self.root, self.root)

    @cached_property
    def _whole(self) -> Floats:
        """Root of the covariances of data, model and lack of fit, lower triangle, over the data's errors."""
        whole = sum((one for one in (self.model, self.lack) if one is not None), self.data)
        return np.asarray(np.linalg.cholesky(whole / np.outer(self.root, self.root)), float)

    @property
    def sigma(self) -> Floats:
        """(n,) standard error of each row alone."""
        return self.root * np.sqrt(1.0 - self.common**2)

    def whitened(self, rows: Floats) -> Floats:
        """Rows (n,) or (n, k) in standard errors, independent of each other."""
        alone = (rows.T / self.root).T
        if self.model is not None or self.lack is not None:
            whitened: Floats = solve_triangular(self._whole, alone, lower=True, check_finite=False)
            return whitened
        if self.share == 0.0:
            return alone
        growth = (1.0 / np.sqrt(1.0 - self.share) - 1.0) / self.share
        return alone + growth * np.multiply.outer(self.common, self.common @ alone)


def noise(
    data: Measured,
    light: Floats | None = None,
    widening: float = 1.0,
    model: Floats | None = None,
    lack: Floats | None = None,
) -> Noise:
    """The errors of the data; of counts those of `light` (n,), where a fit predicts it better than the counts.

    widening    factor on every variance; model and lack (n, n) as in `Noise`
    """
    expected = data.value if light is None or not data.counted else light
    others = data.photons - 1.0
    variance = (data.sigma**2 + data.value**2 / others) * expected / data.value if data.counted else data.sigma**2
    root = np.sqrt(widening * variance)
    common = expected / (np.sqrt(others) * root)
    share = float(common @ common)
    return Noise(root, common * np.sqrt(min(1.0, LARGEST_SHARE / share)) if share > 0 else common, model, lack)
