"""Slow twins of the exact half space: on the real axis without complex analysis, and along another contour."""

import itertools

import numpy as np
from scipy.special import hankel1, j0, j1, jn_zeros


class RealAxis:
    """R^(k) at real k: H_k from its nonlinear integral equation, iterated,

    1 / H(v) = sqrt(1 - alpha arctan(k)/k) + int_0^1 (alpha/2) / (1 + k^2 m^2)  v_m H(v_m) / (v + v_m) dm,
    v_m = 1 / sqrt(1/m^2 + k^2),

    and the Hankel integral summed between the zeros of J with Wynn's epsilon, after R^ has lost the part
    (alpha/2) / sqrt(k^2 + 1), whose inverse is alpha e^-r / (4 pi r). What is left of the profile far away is the
    difference of numbers of order 1, so it is good to 2e-18 or 1e-11 of itself.
    """

    def __init__(self, alpha, illumination="searchlight", nodes=40):
        self.alpha, self.illumination = alpha, illumination
        self.x, self.w = np.polynomial.legendre.leggauss(nodes)

    def transform(self, k):
        k = np.asarray(k, float)[:, None]
        t, dt = 0.5 * (self.x + 1), 0.5 * self.w
        top = np.log1p(k)  # m = (e^u - 1) / k spreads nodes over the layer m ~ 1/k, u = top t^2 over m ln m at m = 0
        m = np.expm1(top * t**2) / k
        dm = np.exp(top * t**2) / k * top * 2 * t * dt
        v = m / np.sqrt(1 + (k * m) ** 2)
        psi = 0.5 * self.alpha / (1 + (k * m) ** 2) * dm
        root = np.sqrt(1 - self.alpha * np.arctan(k) / k)
        kernel = 1 / (v[:, :, None] + v[:, None, :])
        h = np.ones_like(v)
        for _ in range(400):
            new = 1 / (root + np.einsum("kij,kj->ki", kernel, psi * v * h))
            if np.max(np.abs(new - h)) < 1e-13:
                break
            h = 0.5 * (new + h)
        else:
            raise AssertionError("the twin's iteration did not settle")
        if self.illumination == "diffuse":
            return self.alpha * np.einsum("ki,kj,kij->k", dm * h * v, dm * h * v, kernel)
        h_normal = 1 / (root[:, 0] + np.sum(psi * v * h / (1 + v), axis=1))
        return 0.5 * self.alpha * h_normal * np.sum(dm * h * v / (1 + v), axis=1)

    def _summed(self, zeros, r, bessel, power):
        """Integral of (R^ - (alpha/2)/sqrt(k^2 + 1)) k^power J(k r) dk."""
        x, w = np.polynomial.legendre.leggauss(20)
        # Up to the first zero R^ varies on the scale of k = 1 whatever r is: dyadic pieces down from there.
        first = np.concatenate([[0.0], zeros[0] * 2.0 ** np.arange(-16, 1)])
        edges = np.concatenate([first, zeros[1:]]) / r
        low, width = edges[:-1, None], np.diff(edges)[:, None]
        k = low + 0.5 * width * (x + 1)
        rest = self.transform(k.ravel()).reshape(k.shape) - 0.5 * self.alpha / np.sqrt(k**2 + 1)
        pieces = np.sum(0.5 * width * w * rest * k**power * bessel(k * r), axis=1)
        head = pieces[: first.size - 1].sum()
        return wynn(head + np.concatenate([[0.0], np.cumsum(pieces[first.size - 1 :])]))

    def profile(self, r):
        singular = self.alpha * np.exp(-r) / (4 * np.pi * r)
        return singular + self._summed(jn_zeros(0, 24), r, j0, 1) / (2 * np.pi)

    def energy(self, r):
        """Integral of 2 pi r' R_d from 0 to r."""
        return 0.5 * self.alpha * -np.expm1(-r) + r * self._summed(jn_zeros(1, 24), r, j1, 0)


def wynn(sums):
    """The limit of partial sums by Wynn's epsilon algorithm."""
    before, now = np.zeros(sums.size + 1), np.array(sums)
    best = now[-1]
    for column in itertools.count(1):
        if now.size < 2:
            return best
        gaps = np.diff(now)
        if np.any(gaps == 0):
            return best
        before, now = now, before[1:-1] + 1 / gaps
        if column % 2 == 0:
            best = now[-1]


def profile_along_contour(r, alpha, illumination="searchlight"):
    """R_d at radii r (n,), 0 < alpha < 1, by the formulas as they stand, on k = 0.9 i sqrt(1 - alpha) + rho e^{0.6 i}.

    H_k(v) is the exponential of an integral over real x, with every scale of the integrand resolved by brute force.
    """
    rho = np.exp(np.arange(np.log(1e-17), np.log(40.0 / np.min(r)), step := 0.11))
    k = 0.9j * np.sqrt(1 - alpha) + rho * np.exp(0.6j)
    values = np.concatenate([_plain_transform(part, alpha, illumination) for part in np.array_split(k, 20)])
    waves = hankel1(0, np.multiply.outer(r, k))
    return (waves @ (step * rho * np.exp(0.6j) * k * values)).real / (2 * np.pi)


def _plain_transform(k, alpha, illumination):
    x = np.exp(np.arange(-30.0, 28.0, step := 0.12))
    root = np.sqrt(k[:, None] ** 2 + x**2)
    dx_ln_dispersion = step * x * np.log(1 - alpha * np.arctan(root) / root)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    scale = np.abs(k)[:, None]
    t = 0.5 * (nodes + 1)
    y = np.arcsinh(scale) * t**2
    m, dm = np.sinh(y) / scale, np.cosh(y) / scale * np.arcsinh(scale) * t * weights
    s = np.sqrt(1 / m**2 + k[:, None] ** 2)

    def h(inverse):
        kernel = inverse[:, :, None] / (inverse[:, :, None] ** 2 + x**2)
        return np.exp(-np.einsum("kmx,kx->km", kernel, dx_ln_dispersion) / np.pi)

    if illumination == "searchlight":
        return 0.5 * alpha * h(np.ones((k.size, 1)))[:, 0] * np.sum(dm * h(s) / (1 + s), axis=1)
    outgoing = dm * h(s)
    return alpha * np.einsum("km,kn,kmn->k", outgoing, outgoing, 1 / (s[:, :, None] + s[:, None, :]))
