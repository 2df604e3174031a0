"""The exact half space against printed values, its own limits, and slow twins that share no formula with it."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expn, j0, j1, jn_zeros

from mcml_sim import InputError, Setting, SettingError, exact

SEARCHLIGHT, DIFFUSE = Setting(), Setting("diffuse")
BOTH = pytest.mark.parametrize("setting", [SEARCHLIGHT, DIFFUSE], ids=["searchlight", "diffuse"])
ALPHAS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999]
# A of the half space to six digits, from an independent solution of Chandrasekhar's equation that was confirmed with
# 1e8 photons.
PRINTED = {
    "searchlight": "016390 035231 057214 083357 115226 155415 208680 285255 414947 535541 752721 912845 971418",
    "diffuse": "021698 046265 074451 107335 146544 194716 256557 341867 478024 596669 794564 929713 977187",
}
# Chandrasekhar, Radiative Transfer (1950), table XI: H(1) at alpha = 1 is 2.9078; the digits beyond are Stibbs and
# Weir's (Mon. Not. R. Astron. Soc. 119, 1959).
H_NORMAL_WHITE = 2.907810529


def h_by_quadrature(mu, alpha):
    """H(mu) of the infinite medium's half by adaptive quadrature of ln H, x = tan(t)."""

    def integrand(t):
        x = np.tan(t)
        return np.log1p(-alpha * np.arctan(x) / x) / (np.cos(t) ** 2 + (mu * np.sin(t)) ** 2)

    return np.exp(-mu / np.pi * quad(integrand, 0, np.pi / 2, epsabs=1e-12, epsrel=1e-12, limit=200)[0])


class Twin:
    """R^(k) at real k without complex analysis: H_k from its nonlinear integral equation, iterated,

    1 / H(v) = sqrt(1 - alpha arctan(k)/k) + int_0^1 (alpha/2) / (1 + k^2 m^2)  v_m H(v_m) / (v + v_m) dm,
    v_m = 1 / sqrt(1/m^2 + k^2),

    and the Hankel integral summed between the zeros of J with Wynn's epsilon, after R^ has lost the part
    (alpha/2) / sqrt(k^2 + 1), whose inverse is alpha e^-r / (4 pi r).
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


def single_scattering(r):
    """R_d / alpha where light scatters once: e^-z down, e^-d back out from depth z, cosine z/d."""

    def along(z):
        d = np.hypot(r, z)
        return np.exp(-z - d) * z / (4 * np.pi * d**3)

    return quad(along, 0, np.inf, epsabs=0, epsrel=1e-11, limit=400)[0]


# Printed values


@BOTH
def test_reflectance_is_the_printed_one(setting):
    printed = [float(f"0.{digits}") for digits in PRINTED[setting.illumination].split()]
    np.testing.assert_allclose(exact.reflectance(ALPHAS, setting), printed, rtol=0, atol=0.5001e-6)  # rounded digits


def test_the_two_illuminations_are_not_one():
    """Negative control: where the table would tell a swap."""
    assert np.min(exact.reflectance(ALPHAS, DIFFUSE) - exact.reflectance(ALPHAS)) > 5e-3


@pytest.mark.parametrize("alpha", [0.05, 0.5, 0.9, 0.99])
def test_reflectance_is_chandrasekhars(alpha):
    """1 - H(1) sqrt(1 - alpha), and 1 - 2 sqrt(1 - alpha) int H(mu) mu dmu, by adaptive quadrature."""
    s = np.sqrt(1 - alpha)
    # quad's own 1e-10, over the smallest A = .008 that the difference from 1 cancels to
    assert exact.reflectance(alpha) == pytest.approx(1 - h_by_quadrature(1.0, alpha) * s, rel=1e-7, abs=1e-9)
    moment = quad(lambda mu: h_by_quadrature(mu, alpha) * mu, 0, 1, epsabs=1e-9, epsrel=1e-9)[0]
    assert exact.reflectance(alpha, DIFFUSE) == pytest.approx(1 - 2 * s * moment, rel=1e-6, abs=1e-8)


def test_near_white_the_loss_is_2_91_times_the_root():
    for exponent in (6, 8, 10):
        s = 10.0 ** (-exponent / 2)
        # The next term of the expansion is O(s) relative, about 4 s.
        assert (1 - exact.reflectance(1 - s**2)) / s == pytest.approx(H_NORMAL_WHITE, rel=6 * s)


# Slow twins


@BOTH
@pytest.mark.parametrize("alpha", [0.2, 0.8, 0.97])
def test_profile_and_cdf_are_those_of_the_real_axis(alpha, setting):
    twin = Twin(alpha, setting.illumination)
    total = twin.transform([1e-9])[0]
    assert exact.reflectance(alpha, setting) == pytest.approx(total, rel=1e-8)  # k = 1e-9 stands for 0
    for r in (0.1, 0.6, 2.0, 6.0):
        # The twin's own error, seen by changing its node counts, is below 1e-7 of the profile for these radii.
        assert exact.profile(r, alpha, setting=setting) == pytest.approx(twin.profile(r), rel=1e-6)
        assert exact.cdf(r, alpha, setting=setting) == pytest.approx(twin.energy(r) / total, rel=1e-6)


def test_the_twin_is_that_sharp():
    """Negative control: an alpha wrong by 1e-5 is seen."""
    assert exact.profile(0.6, 0.80001) != pytest.approx(Twin(0.8).profile(0.6), rel=1e-6)


@pytest.mark.parametrize("r", [0.01, 0.3, 1.0, 5.0, 20.0])
def test_little_scattering_is_single_scattering(r):
    alpha = 1e-7  # twice scattered light adds of order alpha r
    assert exact.profile(r, alpha) / alpha == pytest.approx(single_scattering(r), rel=1e-5)


def test_the_cdf_without_scattering_is_that_of_single_scattering():
    """The light from depth z leaves within r with the cosines from z/d to 1, alike: half the integral of e^-z/c."""

    def energy(r):
        def along(z):
            lowest = z / np.hypot(r, z)
            return 0.5 * np.exp(-z) * (expn(2, z) - lowest * expn(2, z / lowest))

        return quad(along, 0, np.inf, epsabs=0, epsrel=1e-10, limit=200)[0]

    total = quad(lambda z: 0.5 * np.exp(-z) * expn(2, z), 0, np.inf, epsabs=0, epsrel=1e-11)[0]
    for r in (0.2, 1.0, 4.0):
        assert exact.cdf(r, 0.0) == pytest.approx(energy(r) / total, rel=1e-7)


# Conservation and identities


@BOTH
@pytest.mark.parametrize("alpha", [0.1, 0.7, 0.99, 1.0])
def test_cdf_is_the_integral_of_the_profile(alpha, setting):
    r = np.geomspace(0.01, 50.0, 9)
    x, w = np.polynomial.legendre.leggauss(24)
    low, width = np.log(r[:-1, None]), np.diff(np.log(r))[:, None]
    nodes = np.exp(low + 0.5 * width * (x + 1))
    density = 2 * np.pi * nodes**2 * exact.profile(nodes, alpha, setting=setting)
    rings = np.sum(0.5 * width * w * density, axis=1) / exact.reflectance(alpha, setting)
    # 24 Gauss nodes an e-fold: 1e-12 of the ring; the difference of two cdfs near 1 has only their 1e-12 left.
    np.testing.assert_allclose(np.diff(exact.cdf(r, alpha, setting=setting)), rings, rtol=1e-8, atol=2e-12)


@BOTH
@pytest.mark.parametrize("alpha", [0.0, 0.05, 0.6, 0.95, 0.9999, 1.0])
def test_quantile_inverts_the_cdf(alpha, setting):
    xi = np.concatenate([[1e-9, 1e-6, 1e-3], np.linspace(0.05, 0.95, 19), [0.99, 0.9999, 1 - 1e-8]])
    found = exact.cdf(exact.quantile(xi, alpha, setting=setting), alpha, setting=setting)
    # Shares are counted from the far end, so 1 - S has the rounding of 1 left in it.
    np.testing.assert_allclose(found, xi, rtol=1e-9, atol=2e-14)
    assert np.all(np.diff(exact.quantile(xi, alpha, setting=setting)) > 0)


@BOTH
def test_quantile_inverts_below_the_nearest_radius_too(setting):
    xi = 1e-3 * exact.cdf(exact.NEAREST_RADIUS, 0.5, setting=setting)
    assert exact.cdf(exact.quantile(xi, 0.5, setting=setting), 0.5, setting=setting) == pytest.approx(xi, rel=1e-9)


@BOTH
def test_cdf_rises_from_0_to_1(setting):
    r = np.geomspace(1e-8, 1e4, 500)
    for alpha in (0.0, 0.3, 0.9, 1.0):
        shares = exact.cdf(r, alpha, setting=setting)
        assert np.all(np.diff(shares) >= 0)
        assert shares[0] < 1e-7
        # White light creeps out as S = H(1) / (sqrt(3) r), or its diffuse like; else nothing is left.
        assert 1 - shares[-1] < (2e-4 if alpha == 1 else 1e-12)


@BOTH
def test_only_the_radius_in_mean_free_paths_counts(setting):
    r, alpha, xi = np.array([0.1, 1.0, 7.0]), 0.9, np.array([0.2, 0.5, 0.9])
    for mfp in (0.01, 3.0, 1e4):
        scaled = exact.profile(r * mfp, alpha, mfp, setting)
        np.testing.assert_allclose(scaled * mfp**2, exact.profile(r, alpha, setting=setting), rtol=1e-12)
        np.testing.assert_allclose(
            exact.cdf(r * mfp, alpha, mfp, setting), exact.cdf(r, alpha, setting=setting), rtol=1e-12
        )
        quantiles = exact.quantile(xi, alpha, mfp, setting)
        np.testing.assert_allclose(quantiles, mfp * exact.quantile(xi, alpha, setting=setting), rtol=1e-12)


def test_more_albedo_more_light_everywhere():
    alpha = np.linspace(0.05, 1.0, 20)
    assert np.all(np.diff(exact.reflectance(alpha)) > 0)
    assert np.all(np.diff(exact.profile(np.array([[0.1], [1.0], [8.0]]), alpha), axis=1) > 0)


# Limits


@BOTH
@pytest.mark.parametrize("alpha", [0.2, 0.9, 1.0])
def test_at_the_source_half_of_alpha_is_left(alpha, setting):
    r = np.array([1e-9, 1e-6, 1e-5])
    found = 2 * np.pi * r * exact.profile(r, alpha, setting=setting)
    np.testing.assert_allclose(found, alpha / 2, rtol=1e-3)  # the next term is of order r ln r
    np.testing.assert_allclose(
        exact.cdf(r, alpha, setting=setting) * exact.reflectance(alpha, setting), r * found, rtol=1e-3
    )


@pytest.mark.parametrize("alpha", [0.5, 0.7, 0.9, 0.97])
def test_decay_rate_is_the_root(alpha):
    kappa = exact.decay_rate(alpha)
    assert alpha * np.arctanh(kappa) / kappa == pytest.approx(1.0, rel=1e-12)


def test_decay_rate_at_its_ends():
    assert exact.decay_rate(1.0) == 0.0
    assert exact.decay_rate(0.0) == exact.decay_rate(0.01) == 1.0  # 1 - kappa = 2 e^-200
    assert exact.decay_rate(0.1) == pytest.approx(1 - 2 * np.exp(-20), abs=1e-12)
    assert exact.decay_rate(1 - 1e-8) == pytest.approx(np.sqrt(3e-8), rel=1e-7)
    assert exact.decay_rate([0.5, 0.9]).shape == (2,)


@BOTH
@pytest.mark.parametrize(("alpha", "r", "tolerance"), [(0.6, 100.0, 2e-3), (0.8, 90.0, 3e-3), (0.95, 100.0, 5e-3)])
def test_far_away_the_profile_decays_as_it_should(alpha, r, tolerance, setting):
    """d ln(r^2 R_d) / dr = -kappa but for terms of order 1/r^2."""
    step = 1e-3 * r
    logs = np.log(exact.profile([r - step, r + step], alpha, setting=setting)) + 2 * np.log([r - step, r + step])
    slope = float(np.diff(logs)[0]) / (2 * step)
    kappa = exact.decay_rate(alpha)
    assert slope == pytest.approx(-kappa, rel=tolerance)
    # Negative control: without r^2 the slope is off by 2/r.
    assert slope - 2 / r != pytest.approx(-kappa, rel=tolerance)


def test_white_light_ends_in_a_power():
    """Where nothing is absorbed R^(k) = 1 - H(1) k / sqrt(3) + ..., so 1 - cdf = H(1) / (sqrt(3) r)."""
    for r in (1e3, 1e4):
        assert (1 - exact.cdf(r, 1.0)) * r == pytest.approx(H_NORMAL_WHITE / np.sqrt(3), rel=5 / r)
        assert 2 * np.pi * r**3 * exact.profile(r, 1.0) == pytest.approx(H_NORMAL_WHITE / np.sqrt(3), rel=10 / r)


@BOTH
def test_ends_of_every_argument(setting):
    assert exact.reflectance(0.0, setting) == 0.0
    assert exact.reflectance(1.0, setting) == 1.0
    assert exact.profile(0.0, 0.5, setting=setting) == np.inf
    assert exact.profile(np.inf, 0.5, setting=setting) == 0.0
    assert exact.profile(1.0, 0.0, setting=setting) == 0.0
    assert exact.cdf(0.0, 0.5, setting=setting) == 0.0
    assert exact.cdf(np.inf, 0.5, setting=setting) == 1.0
    assert exact.quantile(0.0, 0.5, setting=setting) == 0.0
    assert exact.quantile(1.0, 0.5, setting=setting) == np.inf


# Numerics


@pytest.fixture
def nodes(monkeypatch):
    """Exchanges the quadrature nodes; whatever was solved with others is forgotten before and after."""

    def forget():
        for solved in (exact._reflectance, exact._transform, exact._decay_rate):
            solved.cache_clear()

    def refine(step, count):
        forget()
        monkeypatch.setattr(exact, "LOG_STEP", step)
        monkeypatch.setattr(exact, "X_NODES", np.exp(np.arange(-38.0, 45.0, step)))
        x, w = np.polynomial.legendre.leggauss(count)
        monkeypatch.setattr(exact, "M_NODES", x)
        monkeypatch.setattr(exact, "M_WEIGHTS", w)

    yield refine
    monkeypatch.undo()
    forget()


def sampled(setting):
    """Profiles over the documented range, at three albedos: (3, 12), and the last radius beyond it."""
    return exact.profile(np.append(np.geomspace(1e-3, 35, 11), 100), np.array([[0.05], [0.6], [1.0]]), setting=setting)


@BOTH
def test_twice_the_nodes_change_nothing(nodes, setting):
    coarse, reflectance = sampled(setting), exact.reflectance(0.6, setting)
    nodes(0.075, 96)
    fine = sampled(setting)
    np.testing.assert_allclose(fine[:, :-1], coarse[:, :-1], rtol=1e-9)
    np.testing.assert_allclose(fine, coarse, rtol=2e-7)
    assert exact.reflectance(0.6, setting) == pytest.approx(reflectance, rel=1e-12)


def test_half_the_nodes_change_something(nodes):
    """Negative control: the comparison above can see a quadrature that is too coarse."""
    fine = sampled(SEARCHLIGHT)
    nodes(0.6, 12)
    assert np.max(np.abs(sampled(SEARCHLIGHT) / fine - 1)) > 1e-6


# Shapes and misuse


def test_numbers_give_numbers_and_arrays_broadcast():
    for value in (exact.reflectance(0.5), exact.profile(1, 0.5), exact.cdf(1, 0.5), exact.quantile(0.5, 0.5)):
        assert type(value) is float
    assert type(exact.decay_rate(0.5)) is float
    assert exact.reflectance([[0.5, 0.6]]).shape == (1, 2)
    r, alpha, mfp = np.array([0.1, 1.0, 3.0]), np.array([[0.5], [0.9]]), np.array([[[1.0]], [[2.0]]])
    table = exact.profile(r, alpha, mfp)
    assert table.shape == (2, 2, 3)
    assert table[1, 0, 2] == pytest.approx(exact.profile(3.0, 0.5, 2.0), rel=1e-13)
    assert exact.cdf(r, alpha).shape == (2, 3)
    assert exact.quantile(np.array([0.1, 0.5, 0.9]), alpha, 2.0).shape == (2, 3)
    assert exact.profile([], 0.5).shape == (0,)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, np.nan, [0.5, 2.0], "half", None])
def test_albedo_must_be_in_0_to_1(alpha):
    for call in (
        lambda: exact.reflectance(alpha),
        lambda: exact.profile(1.0, alpha),
        lambda: exact.cdf(1.0, alpha),
        lambda: exact.quantile(0.5, alpha),
        lambda: exact.decay_rate(alpha),
    ):
        with pytest.raises(InputError, match=r"alpha must be a single-scattering albedo in \[0, 1\], got"):
            call()


@pytest.mark.parametrize("r", [-1.0, np.nan, [1.0, -2.0], "far"])
def test_radius_must_not_be_negative(r):
    with pytest.raises(InputError, match=r"r must be a radius >= 0, got"):
        exact.profile(r, 0.5)


@pytest.mark.parametrize("mfp", [0.0, -1.0, np.inf, np.nan, "long"])
def test_mfp_must_be_a_length(mfp):
    with pytest.raises(InputError, match=r"mfp must be a mean free path > 0, got"):
        exact.profile(1.0, 0.5, mfp)


@pytest.mark.parametrize("xi", [-0.1, 1.5, np.nan, "most"])
def test_share_must_be_in_0_to_1(xi):
    with pytest.raises(InputError, match=r"xi must be a share of the energy in \[0, 1\], got"):
        exact.quantile(xi, 0.5)


def test_the_message_names_the_first_offender():
    with pytest.raises(InputError, match=r"got -3\.0$"):
        exact.profile([1.0, -3.0, -4.0], 0.5)


@pytest.mark.parametrize("setting", [Setting(n=1.4), Setting(g=0.5), Setting("diffuse", n=1.5), "diffuse", None])
def test_other_surfaces_are_refused_by_name(setting):
    for call in (
        lambda: exact.reflectance(0.5, setting),
        lambda: exact.profile(1.0, 0.5, setting=setting),
        lambda: exact.cdf(1.0, 0.5, setting=setting),
        lambda: exact.quantile(0.5, 0.5, setting=setting),
    ):
        with pytest.raises(SettingError, match=r"n = 1 and g = 0, got .*simulate it instead"):
            call()
