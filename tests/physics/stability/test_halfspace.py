"""The exact half space is judged by nodes that it does not share, and a wrong number is seen."""

import numpy as np

from mcml_sim import Setting, exact
from profilefit.studies.stability import halfspace
from profilefit.studies.stability.cells import Verdict, absolute, judged
from profilefit.studies.stability.layout import CDF

X, ALPHA = np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 1e3, np.inf]), np.array([0.0, 1e-6, 0.5, 1.0])


def classes(cdf):
    finer = halfspace.finer_cdf(X, ALPHA, Setting())[..., 0]
    bound = halfspace.BOUNDS[CDF]
    return judged(cdf, finer, absolute(cdf, finer), bound, np.ones(cdf.shape, bool), np.float64)


def test_the_cdf_is_right_and_a_wrong_one_is_not():
    cdf = exact.cdf(X, ALPHA[:, None])
    assert np.all(classes(cdf) == Verdict.RIGHT)
    off = exact.cdf(X * (1.0 + 1e-7), ALPHA[:, None])  # negative control: a mean free path that is 1e-7 off
    assert np.any(classes(off) == Verdict.INACCURATE)
