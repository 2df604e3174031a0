"""docs/theory/refracting.md: its formulas as they stand there, by brute force, against each other and the code."""

import itertools
import re
from functools import lru_cache
from pathlib import Path

import jax
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import hankel1, j0

from mcml_sim import Layer, Medium, Setting, exact, half_space
from mcml_sim.exact import cone, single_scattering
from mcml_sim.exact.stack import fluence
from mcml_sim.media.medium import fresnel
from tests.fixtures import slow
from tests.site.test_theory import transform_of_formula as by_h_functions

PAGE = Path(__file__).resolve().parents[2] / "docs" / "theory" / "refracting.md"
LIGHTS = ("searchlight", "diffuse")
TINY = {"epsabs": 1e-13, "epsrel": 1e-11, "limit": 400}
RAY = np.exp(0.25j * np.pi)
NORMAL = 4 * 1.4 / 2.4**2  # of light along the normal, the share that enters at n = 1.4

NUMBERED = """
image transmittance refracted-out paths-in-plane mirrored cone-kernels leaving cosines mirror
path-cosine fractions loewner azimuth q-and-whole mirror-and-cone out-by-cosines refracted-sources resolvent
orders books once once-searchlight once-diffuse shortest strength root
path layers direct reflected upwards layers-sources layers-books
"""  # (1)-(9), (10)-(18), (19)-(26), (27)-(33)

each_light = pytest.mark.parametrize("light", [LIGHTS[0], *slow(LIGHTS[1])])


def number(f, *ends):
    return quad(f, *ends, **TINY)[0]


def critical(n):
    """mu_c."""
    return np.sqrt(1 - 1 / n**2) if n > 1 else 0.0


def transmittance(mu, n):
    """(2), 0 beyond the critical angle."""
    inside = np.maximum(mu, critical(n))
    out = np.sqrt(np.maximum(1 - n**2 * (1 - inside**2), 0.0))
    return 2 * n * inside * out * ((n * inside + out) ** -2 + (inside + n * out) ** -2)


def slope(mu):
    """t."""
    return np.sqrt(1 - mu**2) / mu


def over_cone(f, n):
    """The integral over mu, through the square root at the edge."""
    edge = critical(n)
    return number(lambda y: f(edge + (1 - edge) * y * y) * 2 * y * (1 - edge), 0.0, 1.0)


def double_exponential(low, high, step=0.08, last=3.4):
    """Nodes and weights from low to high (Takahasi and Mori)."""
    y = np.arange(-last, last + step / 2, step)
    share, rest = (1 / (1 + np.exp(sign * np.pi * np.sinh(y))) for sign in (-1, 1))
    return low + (high - low) * share, (high - low) * step * np.pi * np.cosh(y) * share * rest


# The cosine transform, as the page has it: (13)-(18)


def mean(x, k, mu):
    """f of (13), continued from where k and x are real to where both lie on the ray at pi/4."""
    depth, across = 1 / mu + 1j * x, 1j * k * slope(mu)
    return 1 / (np.exp(0.25j * np.pi) * np.sqrt(-1j * (depth + across)) * np.sqrt(depth - across))


def q_and_whole(x, k, n):
    """q and Q of (14), at x of shape (x,)."""
    mu, dmu = double_exponential(critical(n), 1.0)
    ahead, back = (mean(sign * x[:, None], k, mu) for sign in (1, -1))
    passes = transmittance(mu, n) * dmu
    return (ahead + back) / 2 @ passes, -x * ((ahead - back) / 2j @ (passes / mu))


def system(k, n, light, count=300):
    """sqrt(w) q, sqrt(w) s and M of (17), (18), x on the ray of k."""
    turn = 1.0 if np.imag(k) == 0 else RAY
    last = np.arcsinh(3e3 * (1 + abs(k)))
    y = last * (np.arange(count) + 0.5) / count
    x, root = turn * np.sinh(y), np.sqrt(turn * np.cosh(y) * last / count + 0j)
    q, whole = q_and_whole(x, k, n)
    nudge = 1e-4 * x
    beside = np.subtract(*(q_and_whole(x + sign * nudge, k, n)[1] for sign in (1, -1)))
    squares, same = x * x, np.eye(count, dtype=bool)
    apart = np.where(same, 1.0, squares[:, None] - squares)
    b = 0.5 * np.where(same, beside / (4 * x * nudge), (whole[:, None] - whole) / apart)
    big = np.sqrt(k * k + squares)
    matrix = np.where(same, np.arctan(big) / big, 0.0) - 2 / np.pi * root[:, None] * b * root
    s = 4 * n / (n + 1) ** 2 / (1 + squares) if light == "searchlight" else 2 * n**2 * q
    return root * q, root * s, matrix


def transform_of_formula(alpha, k, n, light, count=300):
    """R^ of (18)."""
    q, s, matrix = system(k, n, light, count)
    value = alpha / np.pi * (q @ np.linalg.solve(np.eye(q.size) - alpha * matrix, s))
    return value.real if np.imag(k) == 0 else value


# The same in depth: phi constant in cells, light followed along straight paths


def reflectance(mu, n):
    return np.where(mu > critical(n), 1 - transmittance(mu, n), 1.0) if n != 1 else 0 * mu


def paths(k, indices, azimuths):
    """mu, cos(psi) and weights dmu of directions, psi in a quarter of the circle: the real part is the same in all."""
    cuts = sorted({0.0, 1.0, *map(critical, indices)})
    rules = [double_exponential(low, high, 0.12, 3.3) for low, high in itertools.pairwise(cuts)]
    mu, dmu = (np.concatenate(part) for part in zip(*rules, strict=True))
    azimuths = azimuths if k else 1
    psi = (np.arange(azimuths) + 0.5) * np.pi / 2 / azimuths
    return np.repeat(mu, azimuths), np.tile(np.cos(psi), mu.size), np.repeat(dmu, azimuths) / azimuths


def in_cells(edges, mu_a, mu_s, k, above, below, light, azimuths=10):
    """int X mu_s phi dz, int mu_a phi dz, int X' mu_s phi dz, int mu_t phi_0 dz by (27)-(32), and what (33) rests on.

    phi is constant in cells between `edges`; `below` is None where there is no lower surface.
    """
    width, mu_t = np.diff(edges), mu_a + mu_s
    closed = below is not None
    mu, cosine, dmu = paths(k, (above, below or 1.0), azimuths)
    a, b = reflectance(mu, above), reflectance(mu, below) if closed else 0 * mu
    operator, up, through = np.zeros((width.size, width.size)), np.zeros(width.size), np.zeros(width.size)
    for one in range(mu.size):
        rate = mu_t / mu[one] - 1j * k * slope(mu[one]) * cosine[one]
        depth = np.append(0.0, np.cumsum(rate * width))  # E(z) is e^{-depth}
        crossing = -np.expm1(-rate * width) / rate
        down = np.tril(np.exp(-np.tril(depth[:-1, None] - depth[None, 1:], -1)), -1) * crossing[:, None] * crossing
        both_ways = down + down.T + np.diag(2 * (width - crossing) / rate)
        top = np.exp(-depth[:-1]) * crossing
        bottom, whole = (np.exp(depth[1:] - depth[-1]) * crossing, np.exp(-depth[-1])) if closed else (0 * top, 0.0)
        again = 1 - a[one] * b[one] * whole**2
        reflected = a[one] * np.outer(top, top) + b[one] * np.outer(bottom, bottom)
        reflected += a[one] * b[one] * whole * (np.outer(top, bottom) + np.outer(bottom, top))
        operator += dmu[one] / (2 * mu[one]) * (both_ways + reflected / again).real
        up += 0.5 * dmu[one] * ((1 - a[one]) * (top + b[one] * whole * bottom) / again).real
        through += 0.5 * dmu[one] * ((1 - b[one]) * (bottom + a[one] * whole * top) / again).real
    source = 4 * above**2 * up if light == "diffuse" else beam_in_cells(edges, mu_t, above, below)
    phi = np.linalg.solve(np.diag(width) - operator * mu_s, source)
    lost = through @ (mu_s * phi) if closed else 0.0
    unbalanced = np.abs(mu_t @ operator + up + through - width).max()  # of light scattered once more, at k = 0
    return np.array([up @ (mu_s * phi), (mu_a * width) @ phi, lost, mu_t @ source, unbalanced])


def beam_in_cells(edges, mu_t, above, below):
    """Integrals of the beam of (32) over cells."""
    tau = np.append(0.0, np.cumsum(mu_t * np.diff(edges)))
    a, b = ((one - 1) ** 2 / (one + 1) ** 2 if one else 0.0 for one in (above, below))
    back = b * np.diff(np.exp(tau - 2 * tau[-1])) / mu_t
    return (1 - a) * (back - np.diff(np.exp(-tau)) / mu_t) / (1 - a * b * np.exp(-2 * tau[-1]))


def without_cells(value, cells):
    """The limit of many cells: their error falls as h^2, then as h^3."""
    coarse, middle, fine = (value(cells * factor) for factor in (1, 2, 4))
    once = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
    return (8 * once[1] - once[0]) / 7


def half_space_in_cells(alpha, k, n, light, deep=24.0, cells=40):
    def value(count):
        edges, one = deep * np.linspace(0.0, 1.0, count + 1) ** 2, np.ones(count)
        return in_cells(edges, (1 - alpha) * one, alpha * one, k, n, None, light)

    return without_cells(value, cells)


# 1. The problem


@pytest.mark.parametrize("n", [1.0, 1.4])
@pytest.mark.parametrize(("k", "height"), [(0.0, 0.7), (0.8, 0.3), (3.0, 1.5)])
def test_a_plane_of_sources_is_a_bundle_of_paths(n, k, height):
    """(4), of weights 1, T and T mu: over the plane, and over angles and azimuth. (6) is of the two last."""
    psi = np.pi * (np.arange(400) + 0.5) / 400

    def by_azimuth(mu):
        return np.mean(np.exp(-(1 / mu - 1j * k * slope(mu) * np.cos(psi)) * height)).real

    def over_plane(weight, farthest):
        def density(r):
            distance = np.hypot(r, height)
            return j0(k * r) * np.exp(-distance) / (2 * distance**2) * r * weight(height / distance)

        edge = min(height * slope(max(critical(n), 1e-2)), farthest)
        # y^2 from the edge of the cone
        return number(lambda y: density(edge - y * y) * 2 * y, 0.0, np.sqrt(edge))

    if n == 1.0:
        kernel = number(lambda m: np.exp(-np.hypot(1 / m, k) * height) / (2 * np.hypot(1 / m, k) * m * m), 0.0, 1.0)
        assert number(lambda mu: by_azimuth(mu) / (2 * mu), 0.0, 1.0) == pytest.approx(kernel, rel=1e-8)
    for power in (0, 1):  # T is 1 at n = 1
        whole = over_plane(lambda mu, power=power: transmittance(mu, n) * mu**power, 60.0)
        found = over_cone(lambda mu, power=power: transmittance(mu, n) * by_azimuth(mu) * mu ** (power - 1) / 2, n)
        assert found == pytest.approx(whole, rel=1e-8)


@pytest.mark.parametrize("n", [1.001, 1.4, 3.0])
def test_transmittance_and_the_law_of_n_squared(n):
    """(2) is Fresnel's from either side, and what enters is (17) at x = 0."""
    outside = np.linspace(0.01, 1.0, 50)
    inside = np.sqrt(1 - (1 - outside**2) / n**2)
    np.testing.assert_allclose(transmittance(inside, n), 1 - fresnel(n, 1.0, inside)[0], rtol=1e-9)
    np.testing.assert_allclose(transmittance(inside, n), 1 - fresnel(1.0, n, outside)[0], rtol=1e-9)
    entering = number(lambda mu: 2 * mu * (1 - fresnel(1.0, n, mu)[0]), 0.0, 1.0)
    assert 2 * n**2 * over_cone(lambda mu: mu * transmittance(mu, n), n) == pytest.approx(entering, rel=1e-9)
    assert single_scattering.entered(Setting("diffuse", n=n)) == pytest.approx(entering, rel=1e-9)
    assert single_scattering.entered(Setting(n=n)) == pytest.approx(4 * n / (n + 1) ** 2, rel=1e-12)


# 2. and 3. Mirror and cone


def test_the_transform_of_a_path_and_its_partial_fractions():
    """(10), (11)."""
    rate, x, other = 1.3 - 0.8j, 0.6, 2.1
    found = number(lambda z: (np.cos(x * z) * np.exp(-rate * z)).real, 0.0, 40.0)
    assert found == pytest.approx((rate / (rate**2 + x**2)).real, rel=1e-9)
    apart = x**2 / (rate**2 + x**2) - other**2 / (rate**2 + other**2)
    both = rate**2 / ((rate**2 + x**2) * (rate**2 + other**2))
    assert abs(both - apart / (x**2 - other**2)) < 1e-15


@pytest.mark.parametrize(("x", "k", "mu"), [(0.7, 0.4, 0.8), (2.0, 5.0, 0.9), (-1.5, 2.0, 0.3)])
def test_the_mean_over_azimuth(x, k, mu):
    """(13), and of the ray at pi/4, where its root goes on."""
    psi = 2 * np.pi * (np.arange(2000) + 0.5) / 2000
    for turn in (1.0, RAY):
        direct = np.mean(1 / (1 / mu + 1j * turn * (x - k * slope(mu) * np.cos(psi))))
        assert abs(mean(turn * x, turn * k, mu) / direct - 1) < 1e-12
    assert abs(mean(x, k, mu) / ((1 / mu + 1j * x) ** 2 + (k * slope(mu)) ** 2) ** -0.5 - 1) < 1e-14


def test_the_cone_in_cosines_is_a_loewner_matrix():
    """(12) and (14): both transforms by quadrature in depth."""
    k, n, x, other = 0.9, 1.4, 0.5, 1.7
    t, w = np.polynomial.legendre.leggauss(120)
    z, dz = 16.0 * (t + 1), 16.0 * w
    mu, dmu = double_exponential(critical(n), 1.0, 0.12)
    passes = transmittance(mu, n) * dmu

    def over_directions(depth, weight):
        total = np.zeros_like(depth)
        for one in range(mu.size):
            total += weight[one] * np.exp(-depth / mu[one]) * j0(k * depth * slope(mu[one]))
        return total

    kernel = over_directions(z[:, None] + z, passes / (2 * mu))
    found = (np.cos(x * z) * dz) @ kernel @ (np.cos(other * z) * dz)
    q, whole = q_and_whole(np.array([x, other]), k, n)
    assert found == pytest.approx(0.5 * (whole[0] - whole[1]).real / (x**2 - other**2), rel=1e-9)
    out = (np.cos(x * z) * dz) @ over_directions(z, passes / 2)
    assert out == pytest.approx(0.5 * q[0].real, rel=1e-9)


def test_the_perfect_mirror_is_an_infinite_medium():
    """(9): the cosine transform of what e^{-z} and its image scatter, by quadrature in both depths."""
    k, x = 0.7, 1.3
    big = np.hypot(k, x)
    m, dm = double_exponential(0.0, 1.0)
    rate = np.hypot(1 / m, k)

    def kernel(distance):
        return np.exp(-distance[..., None] * rate) @ (dm / (2 * rate * m * m))

    t, w = np.polynomial.legendre.leggauss(40)
    found = 0.0
    for low, high in zip((0.0, 0.5, 2.0, 6.0, 14.0), (0.5, 2.0, 6.0, 14.0, 30.0), strict=True):
        for z, dz in zip(low + (high - low) * (t + 1) / 2, (high - low) * w / 2, strict=True):
            for other, weight in (double_exponential(0.0, z), double_exponential(z, z + 30.0)):
                scattered = (kernel(np.abs(z - other)) + kernel(z + other)) * np.exp(-other)
                found += np.cos(x * z) * dz * (scattered @ weight)
    assert found == pytest.approx(np.arctan(big) / big / (1 + x * x), rel=1e-6)


# 4. What leaves


@each_light
@pytest.mark.parametrize("k", [0.7, *slow(2.0)])
def test_mirror_and_cone_solve_the_half_space(light, k):
    """(15)-(18) against (5)-(7) in cells, whose error is 1e-6."""
    found = transform_of_formula(0.6, k, 1.4, light)
    assert half_space_in_cells(0.6, k, 1.4, light)[0] == pytest.approx(found, rel=1e-6)
    assert transform_of_formula(0.6, k, 1.4001, light) != pytest.approx(found, rel=1e-5)  # it would be seen


@each_light
@pytest.mark.parametrize(("alpha", "k"), [(0.5, 0.3), (0.9, 1.5)])
def test_without_a_surface_it_is_the_half_space_by_its_h_functions(light, alpha, k):
    """(18) at n = 1 against the formulas of the other page, which share nothing with it."""
    assert transform_of_formula(alpha, k, 1.0, light, 400) == pytest.approx(by_h_functions(alpha, k, light), rel=3e-8)


@each_light
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_the_code_has_the_page_s_transform(light, n):
    """On the real axis."""
    found = exact.solve(half_space(0.8, n=n), light)
    for k in (0.05, 0.5, 3.0):
        assert found.transform(k) == pytest.approx(transform_of_formula(0.8, k, n, light, 400), rel=2e-8)
    whole = transform_of_formula(0.8, 1e-4, n, light, 400)
    assert exact.reflectance(0.8, Setting(light, n)) == pytest.approx(whole, rel=1e-7)


@pytest.mark.slow
def test_the_code_s_matrix_is_the_page_s_and_its_powers_are_orders():
    """(18), (19) on the ray, where no node is shared."""
    k = 0.5j + 3.0 * RAY
    with jax.enable_x64(True):
        matrix, leaving, source = (np.asarray(part) for part in jax.jit(lambda k: cone.system(1.4, k, 160, 112))(k))
        series = np.asarray(jax.jit(lambda k: cone.series(cone.system(1.4, k, 160, 112), 40))(k))
    for index, light in enumerate(LIGHTS):
        q, s, m = system(k, 1.4, light)
        whole = 0.8 / np.pi * source[index] @ np.linalg.solve(np.eye(160) - 0.8 * matrix, leaving)
        assert abs(transform_of_formula(0.8, k, 1.4, light) / whole - 1) < 1e-8
        np.testing.assert_allclose(series[index, :3], [q @ s / np.pi, q @ m @ s / np.pi, q @ m @ m @ s / np.pi], 1e-8)
        assert abs(series[index] @ 0.8 ** np.arange(1, 41) / whole - 1) < 1e-8
    assert np.abs(matrix - matrix.T).max() < 1e-12


@each_light
def test_nothing_is_lost(light):
    """(20): in cells, and where nothing is absorbed."""
    edges, one = 40.0 * np.linspace(0.0, 1.0, 121) ** 2, np.ones(120)
    out, absorbed, _, entered, _ = in_cells(edges, 0.4 * one, 0.6 * one, 0.0, 1.4, None, light)
    given = NORMAL if light == "searchlight" else 2 * 1.4**2 * q_and_whole(np.zeros(1), 0.0, 1.4)[0][0].real
    assert entered == pytest.approx(given, rel=1e-7)
    assert out == pytest.approx(given - absorbed, rel=1e-7)
    assert exact.reflectance(1.0, Setting(light, n=1.4)) == pytest.approx(given, rel=1e-9)


# 5. Back to r


@each_light
def test_the_profile_along_the_contour(light):
    """The page's transform on its ray against `exact.profile`, which has polynomials on another path."""
    alpha, r = 0.8, np.array([2.0, 4.0])
    kappa, v = exact.decay_rate(alpha), np.arange(-3.3, 6.0, 0.12)
    rho = 0.1 * kappa * np.exp(v - np.exp(-v))
    dk = (0.12 * rho * (1 + np.exp(-v)) * RAY)[rho < 16]
    k = 0.9j * kappa + RAY * rho[rho < 16]
    for n, is_right in ((1.4, True), (1.401, False)):
        values = np.array([transform_of_formula(alpha, one, n, light, 160) for one in k])
        found = (hankel1(0, np.outer(r, k)) @ (k * values * dk)).real / (2 * np.pi)
        error = found / exact.profile(r, alpha, setting=Setting(light, n=1.4)) - 1
        assert (np.abs(error).max() < 2e-8) == is_right


def test_light_ends_as_it_does_without_a_surface():
    """e^{-kappa r} r^-2: the slope of r^2 R_d is kappa, up to 1/r^2, and that of other powers is not."""
    kappa, r = exact.decay_rate(0.9), 50.0 * np.array([0.99, 1.01])
    profile = exact.profile(r, 0.9, setting=Setting(n=1.4))
    for power, is_right in ((2.0, True), (1.5, False), (3.0, False)):
        slope_there = -np.diff(np.log(profile * r**power))[0] / np.diff(r)[0]
        assert (abs(slope_there / kappa - 1) < 0.01) == is_right


def once_by_path(p, n, light):
    """p f(p): (22), (23), per photon that entered, of paths p >= p_c."""
    if light == "searchlight":
        mu = (p * p - 1) / (p * p + 1)
        return 4 * p / (p * p + 1) ** 2 * transmittance(mu, n) * (p * p - 1) / (4 * p)
    edge = critical(n)

    def span(eta):
        return np.sqrt((p * p - 1) * (1 - eta * eta))

    most = brentq(lambda eta: span(eta) - edge * (p + eta), 0.0, 1.0)
    total = 0.0
    for eta, d_eta in zip(*double_exponential(0.0, most), strict=True):
        psi, d_psi = double_exponential(np.arcsin(min(edge * (p + eta) / span(eta), 1.0)), np.pi / 2)
        h = span(eta) * np.sin(psi)
        both = transmittance(h / (p + eta), n) * transmittance(np.minimum(h / (p - eta), 1.0), n)
        total += 4 * d_eta * d_psi @ (h**2 / (p * p - eta * eta) ** 2 * both)  # four quarters
    return total / (np.pi * over_cone(lambda mu: 2 * mu * transmittance(mu, n), n))


def test_light_scattered_once_under_a_searchlight():
    """(21), (22) against the integral along the beam."""
    for r in (0.3, 2.0):
        beam = number(
            lambda y, r=r: (  # z = r y / t_c
                np.exp(-y - np.hypot(r, y)) * transmittance(y / np.hypot(r, y), 1.4) * y / np.hypot(r, y) ** 3
            ),
            r / slope(critical(1.4)),
            40.0,
        )

        def by_path(y, r=r):
            p = shortest(1.4, "searchlight") + y * y
            return once_by_path(p, 1.4, "searchlight") * np.exp(-p * r) * 2 * y

        assert number(by_path, 0.0, 8.0) / (2 * np.pi * r) == pytest.approx(beam / (4 * np.pi), rel=1e-7)


@each_light
def test_the_code_has_the_page_s_light_scattered_once(light):
    """(19), (21)-(24)."""
    setting = Setting(light, n=1.4)
    p, weighted = single_scattering.transform_density(setting)
    assert p[0] == pytest.approx(shortest(1.4, light), rel=1e-12)
    step = single_scattering.K_STEP * single_scattering.BEYOND_CRITICAL
    for one in (120, 144, 150):  # p_c + 4e-3 to 7
        assert once_by_path(p[one], 1.4, light) == pytest.approx(p[one] * weighted[one] / step[one], rel=1e-7)
    for k in (0.8, 4.0):
        q, s, _ = system(k, 1.4, light)
        once = single_scattering.entered(setting) * np.sum(p * weighted / np.sqrt(p**2 + k**2))
        assert (q @ s / np.pi).real == pytest.approx(once, rel=1e-8)


def shortest(n, light):
    """p_c of (24)."""
    return np.sqrt((1 + critical(n)) / (1 - critical(n))) if light == "searchlight" else n


def test_the_shortest_paths():
    """(24), over all pairs of angles that get out."""
    angle = np.linspace(1e-4, np.arccos(critical(1.4)), 400)
    one = (1 + 1 / np.cos(angle)) / np.tan(angle)
    assert one.min() == pytest.approx(shortest(1.4, "searchlight"), rel=1e-9)
    # An isosceles pair is no longer than any other: down under one angle, up under the other.
    down, up = angle[:, None], angle
    two = (1 / np.cos(down) + 1 / np.cos(up)) / (np.tan(down) + np.tan(up))
    assert two.min() == pytest.approx(shortest(1.4, "diffuse"), rel=1e-9)


def test_the_strength_of_the_source():
    """(25)."""
    top = np.arcsin(1 / 1.4)
    strength = 0.5 * NORMAL * number(lambda theta: transmittance(np.cos(theta), 1.4) * np.cos(theta), 0.0, top)
    assert single_scattering.source_strength(Setting(n=1.4)) == pytest.approx(strength, rel=1e-8)
    r = 1e-6
    assert 2 * np.pi * r * exact.profile(r, 0.8, setting=Setting(n=1.4)) == pytest.approx(0.8 * strength, rel=1e-4)


# 6. How it is computed


def test_the_transform_is_a_polynomial_in_w():
    """(26): eight albedos from 0.9 to 1 give all others; as a polynomial in alpha they would not."""
    k, count = 0.3, 8
    spread = np.arctan(k) / k
    ends, z = np.sqrt(1 - np.array([0.9, 1.0]) * spread), np.cos(np.pi * (np.arange(count) + 0.5) / count)

    def value(alpha):
        return np.array([transform_of_formula(one, k, 1.4, "searchlight", 200) / one for one in alpha])

    def at(z, low, high):
        return 0.5 * (low + high) + 0.5 * (high - low) * z

    seen, dense = np.linspace(0.9, 1.0, 20), value(np.linspace(0.9, 1.0, 20))
    by_w = np.polynomial.Chebyshev.fit(at(z, *ends), value((1 - at(z, *ends) ** 2) / spread), count - 1)
    by_alpha = np.polynomial.Chebyshev.fit(at(z, 0.9, 1.0), value(at(z, 0.9, 1.0)), count - 1)
    assert np.abs(by_w(np.sqrt(1 - seen * spread)) / dense - 1).max() < 2e-8
    assert np.abs(by_alpha(seen) / dense - 1).max() > 1e-5


# 7. Layers


@pytest.mark.parametrize(("optical", "height", "k"), [(0.2, 0.7, 1.5), (2.0, 1.0, 4.0), (1.0, 1.0, 0.0)])
def test_the_kernel_between_two_depths(optical, height, k):
    """(29), its form without oscillations, and light that gets out where nothing reflects."""
    across = k * height
    length = np.hypot(optical, across)

    def over_slopes(power):
        return number(lambda mu: np.exp(-optical / mu) * j0(across * slope(mu)) * mu**power / 2, 0.0, 1.0)

    found = number(lambda v: np.exp(-length * np.cosh(v) - optical * np.sinh(v)) / 2, 0.0, 12.0)
    assert found == pytest.approx(over_slopes(-1), rel=1e-8)
    assert fluence.direct(np.full(1, optical), np.full(1, height), k)[0] == pytest.approx(found, rel=1e-10)
    assert np.exp(-length) / 2 - optical * found == pytest.approx(over_slopes(0), rel=1e-8)


def test_reflections_are_a_geometric_series():
    """(30), (31): one path, reflected one surface after the other."""
    e = np.exp(-(1.3 - 0.9j) * np.array([0.2, 0.5, 0.4]))  # from 0 to z, to z', to d
    a, b, total, out = 0.7, 0.4, 0.0, 0.0
    low, middle, high = e
    whole = low * middle * high
    for up_first in (True, False):
        # From z' to the surface that comes first, and from then on to and fro, past z each time.
        amplitude, at_top = (low * middle, True) if up_first else (high, False)
        for _ in range(80):
            out += (1 - a) * amplitude if at_top else 0.0
            amplitude *= a if at_top else b
            total += amplitude * (low if at_top else middle * high)
            amplitude *= whole
            at_top = not at_top
    # E(z) is `low`, E(z') is low * middle, E(d) is whole.
    z, other = low, low * middle
    again = 1 - a * b * whole**2
    mirrored = a * z * other + b * whole**2 / (z * other) + a * b * whole**2 * (z / other + other / z)
    assert abs(total - mirrored / again) < 1e-14
    assert abs(out - (1 - a) * (other + b * whole**2 / other) / again) < 1e-14


# Two layers of index 1.4 under air or glass, on a medium of index 1.2: mu_a, mu_s, thickness.
LAYERS = ((0.1, 2.0, 0.5), (0.5, 1.0, 0.7))
PLATE = Medium(tuple(Layer(1.4, mu_a, mu_s, 0.0, height) for mu_a, mu_s, height in LAYERS), n_below=1.2)


def plate_in_cells(k, light, cells, n_above=1.0):
    s = np.linspace(0.0, 1.0, cells + 1)
    graded = s * s * (3 - 2 * s)
    parts = [graded * LAYERS[0][2], LAYERS[0][2] + graded[1:] * LAYERS[1][2]]
    mu_a, mu_s = (np.repeat([layer[index] for layer in LAYERS], cells) for index in (0, 1))
    return in_cells(np.concatenate(parts), mu_a, mu_s, k, 1.4 / n_above, 1.4 / 1.2, light)


@lru_cache
def straight(k, light, n_above=1.0):
    """R_0 of (31), and what goes through."""
    height, optical = sum(one[2] for one in LAYERS), sum((one[0] + one[1]) * one[2] for one in LAYERS)
    if light == "searchlight":
        a, b = ((1.4 - n_above) / (1.4 + n_above)) ** 2, (0.2 / 2.6) ** 2
        again = 1 - a * b * np.exp(-2 * optical)
        return np.array([(1 - a) ** 2 * b * np.exp(-2 * optical), (1 - a) * (1 - b) * np.exp(-optical)]) / again
    mu, cosine, dmu = paths(k, (1.4, 1.4 / 1.2), 12)  # under air
    a, b = reflectance(mu, 1.4), reflectance(mu, 1.4 / 1.2)
    whole = np.exp(-optical / mu + 1j * k * height * slope(mu) * cosine)
    ways = (1 - a) * np.stack([(1 - a) * b * whole**2, (1 - b) * whole]) / (1 - a * b * whole**2)
    return 2 * 1.4**2 * (ways.real @ (mu * dmu))


@each_light
@pytest.mark.parametrize("k", [1.0, *slow(0.0)])
def test_the_code_has_the_page_s_layers(light, k):
    """(27)-(32) in cells against `exact.solve`."""
    found = without_cells(lambda cells: plate_in_cells(k, light, cells), 15)
    solved = exact.solve(PLATE, light)
    assert solved.transform(k) == pytest.approx(found[0] + straight(k, light)[0], rel=5e-7)
    if k == 0.0:
        assert solved.transmittance == pytest.approx(found[2] + straight(k, light)[1], rel=5e-7)
    other = exact.solve(Medium(PLATE.layers[::-1], n_below=1.2), light).transform(k)
    assert other != pytest.approx(solved.transform(k), rel=1e-2)


@pytest.mark.slow
def test_the_code_has_the_page_s_layers_under_a_denser_medium():
    found = without_cells(lambda cells: plate_in_cells(1.0, "searchlight", cells, 1.5), 15)[0]
    solved = exact.solve(Medium(PLATE.layers, n_above=1.5, n_below=1.2))
    assert solved.transform(1.0) == pytest.approx(found + straight(1.0, "searchlight", 1.5)[0], rel=5e-7)


@each_light
def test_no_light_is_lost_in_layers(light):
    """(33), and the same of a single scattering."""
    out, absorbed, through, entered, unbalanced = plate_in_cells(0.0, light, 30)
    assert unbalanced < 1e-9
    assert out + absorbed + through == pytest.approx(entered, rel=1e-7)
    share = NORMAL if light == "searchlight" else single_scattering.entered(Setting(light, n=1.4))
    assert entered + straight(0.0, light).sum() == pytest.approx(share, rel=1e-7)


def test_equations_are_numbered_as_the_tests_name_them():
    labels = re.findall(r"^\$\$ \(([\w-]+)\)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert labels == NUMBERED.split()
