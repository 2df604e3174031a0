"""Reflectance of a half space whose surface refracts, without photons: an obvious twin to hold tracer and maps against.

Isotropic scattering, from Chandrasekhar, Radiative Transfer (1950): a half space without a surface reflects a bundle of
light at cosine mu' into cosines mu by alpha/2 H(mu) H(mu') mu / (mu + mu') dmu (ch. III, sec. 33), H by iterating its
own equation (ch. V). The surface lets light through by Fresnel, and sends the rest back in at the same cosine.
"""

import numpy as np

from mcml_sim.media import fresnel

NODES = 60


def reflectance(alpha, setting):
    """A of `setting` (n >= 1, g = 0) at one albedo < 1, relative to the light that arrives, specular light apart."""
    mu, weights = _bundles(setting.n)
    back = fresnel.fresnel(setting.n, 1.0, mu)[0]
    every = np.append(mu, 1.0)  # and the beam
    h = _h(every, alpha)
    scattered = alpha / 2 * np.outer(mu * weights * h[:-1], h) / (mu[:, None] + every)
    if setting.illumination == "searchlight":
        enters = np.append(0 * mu, 1 - fresnel.fresnel(setting.n, 1.0, 1.0)[0])
    else:
        enters = np.append(setting.n**2 * (1 - back) * 2 * mu * weights, 0.0)
    # Light that goes up under the surface: scattered from what entered, and from what the surface sent back.
    up = np.linalg.solve(np.eye(mu.size) - scattered[:, :-1] * back, scattered @ enters)
    return float((1 - back) @ up)


def _unit_nodes():
    """Gauss points in (0, 1), dense at 0, where H has a logarithm."""
    x, weights = np.polynomial.legendre.leggauss(NODES)
    x, weights = (x + 1) / 2, weights / 2
    return x**2, 2 * x * weights


def _bundles(n):
    """Cosines inside and their weights: those totally reflected, and those of even bundles outside."""
    x, weights = _unit_nodes()
    critical = np.sqrt(1 - 1 / n**2)
    through = np.sqrt(1 - (1 - x**2) / n**2)  # Snell, x the cosine outside
    mu, dmu = np.append(critical * x, through), np.append(critical * weights, weights * x / (n**2 * through))
    return (mu, dmu) if n > 1 else (mu[NODES:], dmu[NODES:])


def _h(mu, alpha):
    """1/H(mu) = sqrt(1 - alpha) + alpha/2 int_0^1 mu' H(mu') / (mu + mu') dmu'."""
    x, weights = _unit_nodes()
    h, rest = np.ones_like(x), np.sqrt(1 - alpha)
    for _ in range(1000):
        h = 1 / (rest + alpha / 2 * (x / (x[:, None] + x)) @ (h * weights))
    return 1 / (rest + alpha / 2 * (x / (mu[:, None] + x)) @ (h * weights))
