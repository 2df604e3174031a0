"""The hazard law under surfaces that refract: limits that it has by itself, and how near to exact light it is."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from mcml_sim.exact import single_scattering
from profilefit import SettingError, load, profile_quality
from profilefit.laws.hazard import cumulative, growth
from profilefit.laws.refracting_rational import RefractingRational
from profilefit.laws.two_parts import RefractingHazard, TwoPartSampler, drawn
from tests.fixtures import slow

ALPHA = 1 - np.linspace(1, 0, 41) ** 2
R = np.geomspace(1e-4, 300, 200)
# Any constants near those that are fitted: what holds by construction must not rest on a fit.
ANY = RefractingHazard(
    Setting(n=1.33),
    RefractingRational(Setting(n=1.33), **RefractingRational.entry.start),
    **RefractingHazard.entry.start,
)
LIGHTS = ("searchlight", "diffuse")
QUICK, OTHERS = ([Setting(light, n) for light in LIGHTS for n in indices] for indices in ((1.4,), (1.02, 1.37, 1.6)))


@pytest.fixture(scope="module", params=[QUICK[0], *slow(QUICK[1], *OTHERS)], ids=str)
def law(request):
    return load("hazard", setting=request.param)


def test_source_and_far_limits_hold_for_any_constants():
    """2 pi r R_d -> s_0 alpha at the source; far away -d ln R_d / dr -> kappa + 2/r."""
    strength = single_scattering.source_strength(ANY.setting)
    for alpha in (0.1, 0.7, 1.0):
        np.testing.assert_allclose(2e-9 * np.pi * ANY.profile(1e-9, alpha), strength * alpha, rtol=1e-6)
    for alpha in (0.9, 0.99):
        kappa = exact.decay_rate(alpha)
        r = np.array([60.0, 60.1]) / kappa
        rate = -np.diff(np.log(ANY.profile(r, alpha)))[0] / np.diff(r)[0]
        assert rate == pytest.approx(kappa + 2 / r.mean(), rel=2e-3)


def test_dark_media_scatter_once():
    """As alpha -> 0 the profile is that of light scattered once, whose total is exact whatever the constants."""
    edges = np.array([0.0, 0.1, 0.5, 1.0, 3.0])
    once = single_scattering.entered(ANY.setting) * single_scattering.ring_shares(edges, ANY.setting)
    alpha = 1e-6
    assert ANY.total(alpha) / alpha == pytest.approx(once.sum(), rel=1e-6)
    law = load("hazard", setting=Setting(n=1.33))
    rings = np.diff(law.total(alpha) * law.cdf(edges, alpha)) / alpha
    np.testing.assert_allclose(rings, once[:-1], rtol=0.01)  # three constants an index, against exact light


def test_the_profile_is_the_slope_of_the_cdf(law):
    r = np.geomspace(1e-3, 5, 40)
    step = 1e-5 * r
    for alpha in (0.2, 0.9, 1.0):
        slope = (law.cdf(r + step, alpha) - law.cdf(r - step, alpha)) / (2 * step)
        expected = 2 * np.pi * r * law.profile(r, alpha) / law.albedo.reflectance(alpha)
        np.testing.assert_allclose(slope, expected, rtol=2e-6)
    assert law.total(0.7) == pytest.approx(law.albedo.reflectance(0.7), rel=1e-14)


def test_ends_are_finite_and_right(law):
    for alpha in (0.0, 1e-12, 0.5, 1.0):
        assert law.cdf(0.0, alpha) == 0.0
        assert law.cdf(np.inf, alpha) == 1.0
        assert law.profile(np.inf, alpha) == 0.0
        assert law.sampler.sample(0.0, alpha) == pytest.approx(0.0, abs=1e-12)
        assert law.sampler.sample(1.0, alpha) == np.inf
        assert np.isfinite(law.sampler.pdf(0.0, alpha))
        assert np.all(np.isfinite(law.profile(R, alpha)))
    assert law.profile(0.0, 0.5) == np.inf
    assert law.profile(0.0, 0.0) == 0.0


@pytest.mark.parametrize("n", [1.4, *slow(1.001, 1.6, 1.02, 1.1, 1.2, 1.3, 1.37, 1.5)])
@pytest.mark.parametrize("light", LIGHTS)
def test_monotone_in_radius_and_albedo(light, n):
    """As exact light is; in alpha up to 1 - 1e-5: nearer to white it may fall by 1e-5 in all."""
    law = load("hazard", setting=Setting(light, n))
    alpha = np.unique(np.concatenate([ALPHA, 1 - np.geomspace(1e-5, 0.1, 30)]))
    alpha = alpha[alpha <= 1 - 1e-5]
    profile = law.profile(R, alpha[:, None])
    assert np.all(np.diff(profile[1:], axis=1) < 0)
    assert np.all(np.diff(profile, axis=0) > 0)
    whiter = law.profile(R, 1 - np.geomspace(1e-5, 1e-10, 30)[:, None])
    assert np.min(np.log(law.profile(R, 1.0) / whiter)) > -1e-5
    assert np.all(np.diff(law.cdf(R, alpha[:, None]), axis=1) >= 0)


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(n=1.37), Setting("diffuse", n=1.37)], ids=str)
def test_near_exact_light_at_an_index_that_was_not_fitted(setting):
    quality = profile_quality(load("hazard", setting=setting), 1 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), 8) ** 2)
    assert np.max(quality.rel) < 0.006
    assert np.max(quality.ks) < 0.0016
    other = load("hazard", setting=replace(setting, n=1.4))  # the negative control: another index is seen
    mixed = RefractingHazard(setting, other.albedo.at(replace(other.setting, n=1.37)), **other.constants())
    assert profile_quality(replace(mixed, surface=other.here()), [0.5]).rel[0] > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.02, 1.1, 1.2, 1.3, 1.37, 1.4, 1.45, 1.5, 1.6])
@pytest.mark.parametrize("light", LIGHTS)
def test_near_exact_light_at_two_hundred_albedos(light, n):
    alpha = 1 - np.linspace(np.sqrt(0.95), np.sqrt(0.005), 200) ** 2
    quality = profile_quality(load("hazard", setting=Setting(light, n)), alpha)
    assert np.max(quality.rel) < 0.006
    assert np.max(quality.ks) < 0.0016


def test_another_index_than_those_of_the_record_is_refused():
    with pytest.raises(SettingError, match=r"n in \(1, 1.6\], .* got a request for searchlight, n = 1.7"):
        load("hazard", setting=Setting(n=1.7))


@pytest.mark.parametrize(("steps", "error"), [(1, 6e-5), (2, 1e-8)])
def test_inverse_in_a_fixed_number_of_steps(steps, error):
    """The error in xi of each part, times its share of the light."""
    xi = np.concatenate([np.geomspace(1e-7, 0.5, 60), 1 - np.geomspace(0.5, 6e-8, 90)])
    worst = 0.0
    with jax.enable_x64(True):
        t, alpha = jnp.asarray(-np.log1p(-xi)), jnp.asarray(ALPHA)[:, None]
        for setting in (*QUICK, *OTHERS, Setting(n=1.001), Setting("diffuse", n=1.001)):
            of = load("hazard", setting=setting).parts(alpha)
            for part, share, is_once in ((of.once, of.share, True), (of.multiple, 1 - of.share, False)):
                x = drawn(t, growth(t), of, is_once, steps)
                worst = max(worst, float(np.max(np.abs(np.exp(-cumulative(x, part)) - np.exp(-t)) * share)))
    assert error / 1e3 < worst < error


@pytest.mark.slow
def test_the_sampler_draws_its_own_density(law):
    """Means over xi of functions of the radius are integrals of the density; that of the law instead is seen."""
    xi = (np.arange(200_000) + 0.5) / 200_000
    for alpha in (0.3, 0.95):
        x = law.sampler.sample(xi, alpha)
        weight = 2 * np.pi * x * law.profile(x, alpha) / law.total(alpha) / law.sampler.pdf(x, alpha)
        assert np.mean(weight) == pytest.approx(1.0, abs=2e-5)
        for edge in (0.1, 1.0):
            assert np.mean(weight * (x < edge)) == pytest.approx(law.cdf(edge, alpha), abs=2e-5)
    two = TwoPartSampler(law, 2)
    x = two.sample(xi[::500], 0.9)
    own = 2 * np.pi * x * law.profile(x, 0.9) / law.total(0.9)
    np.testing.assert_allclose(two.pdf(x, 0.9), own, rtol=1e-6)
    assert np.max(np.abs(law.sampler.pdf(x, 0.9) / own - 1)) > 1e-5


def test_constants_of_the_text_are_those_of_the_law(law):
    """Their derivatives by the law's own constants, by differences."""
    folds = law.folds()
    assert set(folds) == set(law.text_constants())
    step = 1e-6
    for name, slopes in folds.items():
        for own, slope in slopes.items():
            value = law.constants()[own]
            moved = [law.with_vector((own,), [value + way]).text_constants()[name] for way in (step, -step)]
            assert (moved[0] - moved[1]) / (2 * step) == pytest.approx(slope, rel=1e-5, abs=1e-8)


def test_many_indices_at_once_are_each_alone(law):
    """What a fit to several indices evaluates, row by row."""
    from profilefit.laws.surface import surfaces_of

    settings = tuple(replace(law.setting, n=n) for n in (1.1, 1.4))
    alpha = np.array([[0.5], [0.9]])

    def energies(law, of, alpha):
        with jax.enable_x64(True):
            return np.asarray(law.under(surfaces_of(of)).unscaled_energy(jnp.asarray(R[::20]), jnp.asarray(alpha)))

    together = energies(law, settings, alpha)
    for row, one, a in zip(together, settings, alpha[:, 0], strict=True):
        # Two rows here, too: another program rounds 1 - S otherwise, which next to the source is 1e-12 of it.
        alone = energies(law.at(one), (one, one), np.array([[a], [a]]))
        np.testing.assert_allclose(row, alone[0], rtol=1e-12)
        other = energies(law, (replace(one, n=one.n + 0.1),) * 2, np.array([[a], [a]]))
        assert np.max(np.abs(row / other[0] - 1)) > 0.01
