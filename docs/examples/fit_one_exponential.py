"""Fit the law of one exponential to exact light, and print its errors."""

import numpy as np
from one_exponential import OneExponential

import profilefit
from mcml_sim import Setting
from profilefit.recipes.catalogue import normalisation

law = OneExponential(Setting(), normalisation(Setting()), q0=0.5, q1=1.0, q2=1.0)
edges = np.append(0.0, np.geomspace(0.01, 100.0, 40))
profiles = profilefit.Profiles.from_exact(np.linspace(0.1, 0.99, 8), edges)
fit = profilefit.fit(profiles, law, jackknife=False)  # the jackknife is slow
print(fit.result, {name: round(value, 3) for name, value in fit.constants.items()})
errors = dict(zip(fit.free, np.sqrt(np.diag(fit.misfit)), strict=True))
print("±", {name: round(float(value), 3) for name, value in errors.items()})
quality = profilefit.profile_quality(fit.law, np.array([0.5, 0.9]))
print("mean relative error", quality.rel.round(2), end=" ")
print("largest error of the cdf", quality.ks.round(3))
