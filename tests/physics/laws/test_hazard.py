"""Laws by their escape hazard: limits that they have by themselves, and how near to exact light they are.

Where nothing refracts, under surfaces that refract, and with g as an argument.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from mcml_sim.exact import single_scattering
from profilefit import SettingError, albedo_law, albedo_quality, load, profile_quality
from profilefit.laws import hazard
from profilefit.laws.hazard import SERIES, Hazard, HazardSampler, Shape, cumulative, density, early_share, growth
from profilefit.laws.rational import Rational, RefractingRational
from profilefit.laws.surface import NEAR_WHITE, decay_rate, surfaces_of
from profilefit.laws.two_parts import RefractingHazard, drawn
from tests.fixtures import refused, slow

LIGHTS, INDICES = ("searchlight", "diffuse"), (1.02, 1.1, 1.2, 1.3, 1.37, 1.4, 1.45, 1.5, 1.6)
MATCHED = [Setting(light) for light in LIGHTS]
QUICK, OTHERS = ([Setting(light, n) for light in LIGHTS for n in indices] for indices in ((1.4,), (1.02, 1.37, 1.6)))
ALPHA = 1 - np.linspace(1, 0, 41) ** 2
INNER = ALPHA[1:-1]
R = np.geomspace(1e-4, 300, 200)
# Any constants near those that are fitted: what holds by construction must not rest on a fit.
ANY = Hazard(
    Setting(),
    Rational(Setting(), 0.5, 2.3, 1.3),
    **{"h0": 1.2, "h1": -0.3, "h2": 0.1, "a0": 0.5, "a1": -0.2, "a2": 0.03, "b0": 0.2, "b1": -0.2, "b2": 0.06},
    **{"b3": 0.02, "c0": 0.5, "c1": 0.3, "c2": 0.1, "c3": 0.05},
)
MAP_N = RefractingRational(Setting(n=1.33), **RefractingRational.entry.start)
ANY_N = RefractingHazard(Setting(n=1.33), MAP_N, **RefractingHazard.entry.start)


@pytest.fixture(scope="module", params=[QUICK[0], *slow(QUICK[1], *MATCHED, *OTHERS)], ids=str)
def law(request):
    return load("hazard", setting=request.param)


@pytest.fixture(scope="module", params=MATCHED, ids=str)
def matched(request):
    return load("hazard", setting=request.param)


@pytest.mark.parametrize(("law", "alphas"), [(ANY, (0.5, 0.9, 0.99)), (ANY_N, (0.9, 0.99))], ids=["n = 1", "n > 1"])
def test_source_and_far_limits_hold_for_any_constants(law, alphas):
    """2 pi r R_d -> s_0 alpha at the source, with an x ln x beside it; far away -d ln R_d / dr -> kappa + 2/r."""
    strength = single_scattering.source_strength(law.setting)
    for alpha in (0.1, 0.7, 1.0):
        np.testing.assert_allclose(2e-9 * np.pi * law.profile(1e-9, alpha), strength * alpha, rtol=1e-6)
    for alpha in alphas:
        kappa = exact.decay_rate(alpha)
        r = np.array([60.0, 60.1]) / kappa
        rate = -np.diff(np.log(law.profile(r, alpha)))[0] / np.diff(r)[0]
        assert rate == pytest.approx(kappa + 2 / r.mean(), rel=2e-3)


def test_the_profile_is_the_slope_of_the_cdf_and_ends_are_finite(law):
    r = np.geomspace(1e-3, 5, 40)  # farther out the cdf has no digits left to take differences of
    step = 1e-5 * r
    for alpha in (0.2, 0.9, 1.0):
        slope = (law.cdf(r + step, alpha) - law.cdf(r - step, alpha)) / (2 * step)
        expected = 2 * np.pi * r * law.profile(r, alpha) / law.albedo.reflectance(alpha)
        np.testing.assert_allclose(slope, expected, rtol=2e-6)
    assert law.total(0.7) == pytest.approx(law.albedo.reflectance(0.7), rel=1e-14)
    for alpha in (0.0, 1e-12, 0.5, 1.0):
        assert (law.cdf(0.0, alpha), law.cdf(np.inf, alpha), law.profile(np.inf, alpha)) == (0.0, 1.0, 0.0)
        assert law.sampler.sample(0.0, alpha) == pytest.approx(0.0, abs=1e-12)
        assert law.sampler.sample(1.0, alpha) == np.inf
        assert np.isfinite(law.sampler.pdf(0.0, alpha))
        assert np.all(np.isfinite(law.profile(R, alpha)))
    assert (law.profile(0.0, 0.5), law.profile(0.0, 0.0)) == (np.inf, 0.0)


@pytest.mark.parametrize(
    "setting", [*QUICK, *slow(*MATCHED, *(Setting(light, n) for light in LIGHTS for n in (1.001, *INDICES)))], ids=str
)
def test_monotone_in_radius_and_albedo(setting):
    """As exact light is; in alpha up to 1 - 1e-5: nearer to white it may fall by 1e-5 in all, 1e-6 at n = 1."""
    law = load("hazard", setting=setting)
    alpha = np.unique(np.concatenate([ALPHA, 1 - np.geomspace(1e-5, 0.1, 30)]))
    alpha = alpha[alpha <= 1 - 1e-5]
    profile, cdf = law.profile(R, alpha[:, None]), law.cdf(R, alpha[:, None])
    assert np.all(np.diff(profile[1:], axis=1) < 0)
    assert np.all(np.diff(profile, axis=0) > 0)
    whiter = law.profile(R, 1 - np.geomspace(1e-5, 1e-10, 30)[:, None])
    assert np.min(np.log(law.profile(R, 1.0) / whiter)) > (-1e-6 if setting.n == 1 else -1e-5)
    assert np.all(np.diff(cdf, axis=1) >= 0)
    assert setting.n > 1 or np.all(np.diff(cdf, axis=0) <= 0)


@pytest.mark.parametrize(
    ("setting", "count"),
    [
        *((setting, 12) for setting in MATCHED),  # held-out albedos
        *slow(*((Setting(light, 1.37), 8) for light in LIGHTS)),  # an index that was not fitted
        *slow(*((setting, 200) for setting in MATCHED)),
        *slow(*((Setting(light, n), 200) for light in LIGHTS for n in INDICES)),
    ],
    ids=str,
)
def test_near_exact_light(setting, count):
    quality = profile_quality(load("hazard", setting=setting), 1 - np.linspace(0.95**0.5, 0.005**0.5, count) ** 2)
    rel, ks = (0.005, 0.0011) if setting.n == 1 else (0.006, 0.0016)
    assert np.max(quality.rel) < rel
    assert np.max(quality.ks) < ks
    assert setting.n > 1 or np.max(quality.l1) < 0.003


def test_another_light_is_seen(matched):
    """The same constants under the other light are off by twenty times as much: settings do not mix."""
    other = MATCHED[matched.setting == MATCHED[0]]
    mixed = Hazard(other, load("hazard", setting=other).albedo, **matched.constants())
    assert profile_quality(mixed, [0.5]).rel[0] > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("light", LIGHTS)
def test_another_index_is_seen(light):
    setting, other = Setting(light, 1.37), load("hazard", setting=Setting(light, 1.4))
    mixed = RefractingHazard(setting, other.albedo.at(replace(other.setting, n=1.37)), **other.constants())
    assert profile_quality(replace(mixed, surface=other.here()), [0.5]).rel[0] > 0.02


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
    two = law.samplers["two steps"]
    x = two.sample(xi[::500], 0.9)
    own = 2 * np.pi * x * law.profile(x, 0.9) / law.total(0.9)
    np.testing.assert_allclose(two.pdf(x, 0.9), own, rtol=1e-6)
    assert np.max(np.abs(law.sampler.pdf(x, 0.9) / own - 1)) > 1e-5


# Where nothing refracts


@pytest.mark.slow
def test_it_has_derivatives_and_holds_in_single_precision(matched):
    assert matched.sampler.pdf(0.0, 0.5) == pytest.approx(0.25 / matched.albedo.reflectance(0.5), rel=1e-3)
    with jax.enable_x64(True):
        by_alpha = jax.vmap(jax.grad(lambda a: matched.profile(0.5, a)))(jnp.linspace(0.01, 0.99, 9))
        by_radius = jax.vmap(jax.grad(lambda r: matched.profile(r, 0.9)))(jnp.asarray(R))
    step = 1e-6
    centre = (matched.profile(0.5, 0.5 + step) - matched.profile(0.5, 0.5 - step)) / (2 * step)
    assert float(by_alpha[4]) == pytest.approx(centre, rel=1e-6)
    assert np.all(np.asarray(by_alpha) > 0)
    assert np.all(np.asarray(by_radius) < 0)
    # As a shader runs it: everything that depends on r or xi in float32, the material's shape rounded to float32.
    with jax.enable_x64(True):
        shape = matched.shape(jnp.asarray(INNER)[:, None])
        truth = np.asarray(density(jnp.asarray(R), shape))
        xi = np.arange(1, 2000) / 2000
        x = np.asarray(hazard.radius(jnp.asarray(xi), shape, 2))
    single = Shape(*(jnp.asarray(np.asarray(leaf), jnp.float32) for leaf in shape))
    at_32 = np.asarray(density(jnp.asarray(R, jnp.float32), single), float)
    seen = truth > 1e-12  # far beyond the last percent of the energy
    assert np.max(np.abs(at_32 / truth - 1)[seen & (20 / np.asarray(shape.kappa) > R)]) < 3e-4
    drawn = np.asarray(hazard.radius(jnp.asarray(xi, jnp.float32), single, 2), float)
    assert np.max(np.abs(matched.cdf(drawn, INNER[:, None]) - matched.cdf(x, INNER[:, None]))) < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "error"), [(1, 1e-4), (2, 1e-7)])
def test_inverse_in_a_fixed_number_of_steps(matched, steps, error):
    xi = np.concatenate([np.linspace(0, 0.999, 400), 1 - np.geomspace(1e-3, 1e-6, 20)[1:]])
    sampler = HazardSampler(matched, steps)
    missed = np.abs(matched.cdf(sampler.sample(xi, ALPHA[:, None]), ALPHA[:, None]) - xi)
    assert np.max(missed) < error
    assert np.max(missed) > error / 1e4  # fewer steps than these are not exact, and the bound says something


def test_series_takes_over_where_the_logarithm_cancels(x64):
    """V and V' on both sides of the switch, against the plain formula in float64 and the limit 1/2 far away."""
    q = np.concatenate([np.geomspace(1e-3, 10, 50), SERIES * np.array([1 - 1e-12, 1 + 1e-12])])
    z = 1 / q
    value, slope = early_share(jnp.asarray(z), jnp.asarray(q), 1.0, jnp.asarray(1 / (1 + q)))
    np.testing.assert_allclose(value, z - z**2 * np.log1p(q), rtol=0, atol=3e-7)
    np.testing.assert_allclose(slope, 1 - 2 * z * np.log1p(q) + 1 / (1 + q), rtol=0, atol=1e-6)
    assert float(early_share(jnp.array(1e6), jnp.array(1e-6), 1.0, jnp.array(1.0))[0]) == pytest.approx(0.5, abs=1e-6)


# Under surfaces that refract


def test_dark_media_scatter_once():
    """As alpha -> 0 the profile is that of light scattered once, whose total is exact whatever the constants."""
    edges = np.array([0.0, 0.1, 0.5, 1.0, 3.0])
    once = single_scattering.entered(ANY_N.setting) * single_scattering.ring_shares(edges, ANY_N.setting)
    alpha = 1e-6
    assert ANY_N.total(alpha) / alpha == pytest.approx(once.sum(), rel=1e-6)
    law = load("hazard", setting=Setting(n=1.33))
    rings = np.diff(law.total(alpha) * law.cdf(edges, alpha)) / alpha
    np.testing.assert_allclose(rings, once[:-1], rtol=0.01)  # three constants an index, against exact light


@pytest.mark.parametrize(("steps", "error"), [(1, 6e-5), (2, 1e-8)])
def test_inverse_of_each_part_in_a_fixed_number_of_steps(steps, error):
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


@pytest.mark.parametrize("setting", [QUICK[0], *slow(QUICK[1], *OTHERS)], ids=str)
def test_many_indices_at_once_are_each_alone(setting):
    """What a fit to several indices evaluates, row by row."""
    law, settings = load("hazard", setting=setting), tuple(replace(setting, n=n) for n in (1.1, 1.4))
    alpha = np.array([[0.5], [0.9]])

    def energies(one, of, alpha):
        with jax.enable_x64(True):
            return np.asarray(one.under(surfaces_of(of)).unscaled_energy(jnp.asarray(R[::20]), jnp.asarray(alpha)))

    together = energies(law, settings, alpha)
    for row, one, a in zip(together, settings, alpha[:, 0], strict=True):
        # Two rows here, too: another program rounds 1 - S otherwise, which next to the source is 1e-12 of it.
        alone = energies(law.at(one), (one, one), np.array([[a], [a]]))
        np.testing.assert_allclose(row, alone[0], rtol=1e-12)
        other = energies(law, (replace(one, n=one.n + 0.1),) * 2, np.array([[a], [a]]))
        assert np.max(np.abs(row / other[0] - 1)) > 0.01


# With g as an argument: near exact light at g that were not fitted

TISSUE = Setting(n=1.4, g=0.8)  # of no g that was fitted
REDUCED = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.85, 0.95, 0.98, 0.995, 0.999])
WIDE = np.geomspace(1e-3, 1e3, 13)
FEW = np.array([0.1, 0.6, 0.99, 0.9999])[:, None]


@pytest.mark.parametrize(
    ("g", "rel"), [(0.05, 0.015), (0.8, 0.0175), *slow((0.2, 0.0125), (0.5, 0.0125), (0.9, 0.02), (0.95, 0.025))]
)
@pytest.mark.parametrize("light", LIGHTS)
def test_near_exact_light_with_g(light, g, rel):
    """From .01 l* to 99.5 % of the light, any albedo."""
    law = load("hazard", setting=Setting(light, 1.4, g))
    found = profile_quality(law, REDUCED)
    assert np.max(found.rel) < rel
    assert np.max(found.ks) < 0.006
    truth = exact.reflectance(REDUCED, law.setting)
    off = law.albedo.reflectance(REDUCED) - truth
    assert np.max(np.abs(off)) < 0.003
    assert np.max(np.abs(off) / truth) < 0.007


@pytest.mark.parametrize("n", [1.36, *slow(1.33, 1.45)])
@pytest.mark.parametrize("light", [LIGHTS[0], *slow(*LIGHTS[1:])])
def test_near_exact_light_with_g_at_other_indices(light, n):
    for g in (0.4, 0.85):
        found = profile_quality(load("hazard", setting=Setting(light, n, g)), REDUCED[::2])
        assert np.max(found.rel) < 0.025
        assert np.max(found.ks) < 0.006


def test_a_law_is_judged_at_any_setting_that_it_spans():
    for here, there in (
        (Setting("diffuse", 1.4, 0.8), Setting("diffuse", 1.33, 0.5)),
        (Setting(n=1.4), Setting(n=1.2)),
    ):
        law = load("hazard", setting=here)
        found, alone = profile_quality(law, [0.9], there), profile_quality(law.at(there), [0.9])
        np.testing.assert_allclose((found.rel, found.ks, found.l1), (alone.rel, alone.ks, alone.l1), rtol=1e-9)
        whole, other = albedo_quality(law.albedo, there), albedo_quality(law.albedo.at(there))
        assert whole.delta_A == pytest.approx(other.delta_A, rel=1e-9) != albedo_quality(law.albedo).delta_A


@pytest.mark.parametrize("g", [0.8, *slow(0.5, 0.95)])
def test_albedos_have_derivatives_by_reflectance(g):
    albedo, step = load("hazard", setting=Setting("diffuse", 1.4, g)).albedo, 1e-6
    with jax.enable_x64(True):
        for whole in (0.01, 0.1, 0.15, 0.3, 0.9):
            slope = float(jax.grad(albedo.alpha)(jnp.float64(whole)))
            difference = (albedo.alpha(whole + step) - albedo.alpha(whole - step)) / (2 * step)
            assert slope == pytest.approx(difference, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.301, 1.5])
@pytest.mark.parametrize("light", LIGHTS)
def test_beyond_the_indices_of_exact_light_photons_judge(light, n):
    setting = Setting(light, n, 0.8)
    edges = np.concatenate([[0.0], np.geomspace(0.1, 60.0, 33)])
    photons = simulate_orders(Grid.from_edges(r=edges), 2**19, 3, setting)
    law = load("hazard", setting=setting)
    for one in (0.5, 0.9, 0.99):
        found = photons.energy(one)
        own = law.albedo.reflectance(one) * np.diff(law.cdf(edges, one, photons.mfp(one)))
        seen = found.standard_error < 0.03 * found.value
        off = np.abs(own / np.where(seen, found.value, 1.0) - 1.0)[seen]
        assert np.mean(off) < 0.035 + np.mean(found.standard_error[seen] / found.value[seen])
        assert abs(law.albedo.reflectance(one) / photons.reflectance(one).value - 1.0) < 0.01


def test_similarity_is_told_from_it():
    """A negative control: the law of isotropic light at the same reduced albedo and l*."""
    r = np.geomspace(0.2, 5.0, 20)
    wanted = exact.profile(r, 0.3, setting=TISSUE)
    own = load("hazard", setting=TISSUE).profile(r, 0.3) / wanted - 1.0
    other = load("hazard", setting=replace(TISSUE, g=0.0)).profile(r, 0.3) / wanted - 1.0
    assert np.mean(np.abs(own)) < 0.02
    assert np.mean(np.abs(other)) > 0.33
    for light in LIGHTS:
        isotropic = exact.reflectance(0.3, Setting(light, 1.4))
        assert isotropic / exact.reflectance(0.3, Setting(light, 1.4, 0.8)) > 5 / 3
    law = load("hazard", setting=TISSUE)
    np.testing.assert_allclose(law.albedo.alpha(law.albedo.reflectance(FEW)), FEW, rtol=1e-9)
    energy = np.trapezoid(2 * np.pi * WIDE**2 * law.profile(WIDE, 0.9), np.log(WIDE))
    assert energy == pytest.approx(law.albedo.reflectance(0.9), rel=0.05)  # coarse, but 1 - alpha g would be seen
    # A fit takes such a step back: one that stayed ended at 17 times the least cost, and was called converged.
    law = replace(load("hazard", setting=Setting(n=1.4, g=0.05)), once_h0=9.6, once_hg=-10.4)
    assert float(law.coefficients().once_h) < 0
    assert not np.any(np.isfinite(law.profile(np.array([1e-3, 1e-2]), 0.5)))


@pytest.mark.parametrize("setting", [TISSUE, Setting("diffuse", 1.31, 0.95), Setting(n=1.5, g=0.1)], ids=str)
def test_ends_are_exact_with_g(setting):
    law, nearest = load("hazard", setting=setting), 1e-9
    alpha = FEW[:, 0]
    source = 2 * np.pi * nearest * law.profile(nearest, alpha)
    once = 1.0 / (1.0 - setting.g)  # mu_s over mu_s'
    np.testing.assert_allclose(source, once * alpha * single_scattering.source_strength(setting), rtol=1e-6)
    assert law.albedo.reflectance(1.0) == pytest.approx(single_scattering.entered(setting), rel=1e-12)
    assert law.albedo.reflectance(1e-9) / 1e-9 == pytest.approx(once * single_scattering.reflected(setting), rel=1e-6)
    np.testing.assert_allclose(law.cdf([0.0, 1e9], 0.9), [0, 1], atol=1e-12)
    assert np.all(np.diff(law.cdf(WIDE, FEW), axis=1) >= 0)
    assert np.all(law.profile(WIDE, FEW) >= 0)


@pytest.mark.parametrize("g", [0.6, *slow(0.1, 0.95)])
def test_its_sampler_draws_its_light(g):
    law, xi = load("hazard", setting=Setting(n=1.4, g=g)), np.linspace(0.001, 0.999, 301)
    for steps, most in (("one step", 3e-3), ("two steps", 1e-4)):
        sampler = law.samplers[steps]
        assert np.max(np.abs(sampler.undone(sampler.sample(xi, FEW), xi, FEW) - xi)) < most


@pytest.mark.parametrize("setting", [TISSUE, QUICK[0], *slow(QUICK[1], *OTHERS)], ids=str)
@pytest.mark.parametrize("name", ["hazard", "rational"])
def test_its_text_has_the_derivatives_of_its_constants(name, setting):
    """By the law's own constants, by differences."""
    law = (load if name == "hazard" else albedo_law)(name, setting=setting)
    missing = {"a3"} if name == "hazard" and setting.g else set()  # 0 whatever the constants
    assert set(law.folds()) | missing == set(law.text_constants())
    for text, slopes in law.folds().items():
        for constant, slope in slopes.items():
            up, down = (replace(law, **{constant: getattr(law, constant) + step}) for step in (1e-5, -1e-5))
            difference = (up.text_constants()[text] - down.text_constants()[text]) / 2e-5
            assert difference == pytest.approx(slope, rel=1e-6, abs=1e-9)


def test_where_it_does_not_hold_it_says_so():
    for setting in (Setting(n=1.6, g=0.8), Setting(n=1.4, g=0.97), Setting(n=1.4, g=-0.2), Setting(g=0.8)):
        refused(r"n in \(1.3, 1.5\], g in \(0, 0.95\]", load, "hazard", setting=setting, error=SettingError)
    with pytest.raises(SettingError, match=r"n in \(1, 1.6\], .* got a request for searchlight, n = 1.7"):
        load("hazard", setting=Setting(n=1.7))


# The closed decay rate against the root that it stands for

Q = np.unique(np.concatenate([np.linspace(0, 1, 201) ** 2, np.geomspace(1e-10, 1, 60)]))  # 1 - alpha, rising


def test_decay_rate_is_the_root_and_near_white_the_diffusion_length(x64):
    inner = 1 - Q[Q > 0]
    error = np.asarray(decay_rate(jnp.asarray(inner))) / exact.decay_rate(inner) - 1
    assert 1e-6 < np.max(np.abs(error)) < 2.5e-5  # a looser statement than this would say nothing
    assert (decay_rate(jnp.float32(1.0)), decay_rate(jnp.float32(0.0))) == (0.0, 1.0)
    # kappa^2 = 3 q (1 - 4 q / 5), q = 1 - alpha: the first two terms of the root's own series. Its two pieces meet.
    q = np.geomspace(1e-8, 1e-3, 6)
    kappa = np.asarray(decay_rate(jnp.asarray(1 - q)))
    np.testing.assert_allclose(kappa**2 / (3 * q), 1 - 0.8 * q, rtol=0, atol=1e-7)  # 1 - q has 1e-16 / q digits
    edge = 1 - NEAR_WHITE
    below, above = np.asarray(decay_rate(jnp.array([np.nextafter(edge, 0), np.nextafter(edge, 1)])))
    assert below == pytest.approx(above, rel=4e-5)
    kappa = np.asarray(decay_rate(jnp.asarray(1 - Q)))
    assert np.all(np.diff(kappa[kappa < 1 - 1e-12]) > 0)


@pytest.mark.slow
def test_decay_rate_in_single_precision_and_its_derivative():
    single = jnp.asarray(1 - Q, jnp.float32)
    given = np.asarray(single, float)
    inside = given < 1
    found = np.asarray(decay_rate(single), float)[inside]
    np.testing.assert_allclose(found, exact.decay_rate(given[inside]), rtol=4e-5)
    assert np.all(np.isfinite(jax.vmap(jax.grad(decay_rate))(jnp.linspace(0.0, 0.999, 50))))
