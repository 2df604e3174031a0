"""Exact single scattering against its limits, the exact half space, a plain quadrature, and photons."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import quad

from mcml_sim import Grid, InputError, Setting, exact, phase, simulate_orders
from mcml_sim.exact import single_scattering
from mcml_sim.media.medium import fresnel

LN2 = np.log(2)
EDGES = np.concatenate([[0.0], np.geomspace(1e-4, 50.0, 40)])
SETTINGS = [
    Setting("searchlight"),
    Setting("searchlight", n=1.4, g=0.6),
    Setting("searchlight", n=0.8, g=-0.4),
    Setting("diffuse"),
    Setting("diffuse", g=0.6),
    Setting("diffuse", n=1.4, g=-0.4),
    Setting("diffuse", n=0.8, g=0.6),
]


@lru_cache(maxsize=1)
def photons_that_scatter_once(setting, photons, seed):
    """Radii where light leaves after one scattering, and its weights: plain sampling in x, y, z."""
    source = np.random.default_rng(seed)
    cosine, passes = np.ones(photons), 1.0
    if setting.illumination == "diffuse":
        # Cosine-weighted light outside refracts on its way in; each photon weighs what the surface lets in.
        outside = np.sqrt(source.random(photons))
        reflected, cosine = fresnel(1.0, setting.n, outside)
        passes = (1 - reflected) / single_scattering.entered(setting)
    down = np.stack([np.sqrt(1 - cosine**2), np.zeros(photons), cosine])
    place = source.exponential(size=photons) * down
    turn = phase.HenyeyGreenstein(setting.g).sample(source.random(photons))
    azimuth = 2 * np.pi * source.random(photons)
    side = np.stack([down[2], np.zeros(photons), -down[0]])
    across = np.cross(down.T, side.T).T
    away = turn * down + np.sqrt(1 - turn**2) * (np.cos(azimuth) * side + np.sin(azimuth) * across)
    up = away[2] < 0
    place, away = place[:, up], away[:, up]
    path = place[2] / -away[2]
    reflected, _ = fresnel(setting.n, 1.0, -away[2])
    exit_ = place + path * away
    return np.hypot(exit_[0], exit_[1]), np.broadcast_to(passes, photons)[up] * np.exp(-path) * (1 - reflected)


def deviations(setting, truth, seed=1, photons=1_000_000):
    """z of sampled shares against `truth`, by ring."""
    edges = np.concatenate([[0.0], np.geomspace(0.01, 2.0, 15)])
    radii, weights = photons_that_scatter_once(setting, photons, seed)
    bins = np.append(edges, np.inf)
    sums, squares = (np.histogram(radii, bins, weights=weights**power)[0] for power in (1, 2))
    expected = single_scattering.ring_shares(edges, truth)
    return (sums / photons - expected) / np.sqrt(squares - sums**2 / photons) * photons


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_photons_leave_where_it_says(setting, sidak):
    """And a phase function or a surface that is slightly another is seen."""
    wrong = [replace(setting, g=setting.g + 0.03), *[replace(setting, n=setting.n + 0.05)] * (setting.n != 1)]
    for truth in (setting, *wrong):
        z = deviations(setting, truth)
        assert (np.abs(z).max() < sidak(z.size)) == (truth == setting)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "most"),
    [(Setting(), 1.03), *((one, 1.2) for one in (SETTINGS[1], Setting("diffuse"), Setting("diffuse", n=1.3, g=-0.3)))],
    ids=str,
)
def test_order_resolved_runs_leave_there_after_one_scattering(run, setting, most, sidak):
    """Rings that are wider by `most` are seen."""
    if setting == Setting():
        found = run
    else:
        grid = Grid.from_edges(r=np.concatenate([[0.0], np.geomspace(0.02, 5.0, 12)]))
        found = simulate_orders(grid, 2**19, seed=9, setting=setting)
    for wider in (1.0, most):
        expected = single_scattering.ring_shares(wider * found.grid.r_edges, setting) * found.photons
        z = ((found.counts.exits[:, 0] - expected) / np.sqrt(expected))[expected > 25]
        assert z.size > (30 if found is run else 0)
        assert (np.abs(z).max() < sidak(z.size)) == (wider == 1.0)


@pytest.mark.parametrize(("illumination", "total"), [("searchlight", (1 - LN2) / 2), ("diffuse", (1 - LN2) * 2 / 3)])
def test_it_is_the_exact_half_space_where_nothing_scatters_twice(illumination, total):
    """In total int mu / (1 + mu) / 2 dmu, and the same with 2 mu' / (mu + mu')."""
    setting, alpha = Setting(illumination), 1e-9
    expected = np.diff(exact.cdf(EDGES, alpha, setting=setting)) * exact.reflectance(alpha, setting) / alpha
    found = single_scattering.ring_shares(EDGES, setting)
    assert found.sum() == pytest.approx(total, rel=1e-13)
    # Second scattering adds alpha; differences of the cdf lose digits where little is left beyond.
    np.testing.assert_allclose(found[:-1], expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_strength_at_the_source_is_what_the_nearest_ring_holds(setting):
    """The share within r is r (1 + O(r ln r)) of it: two small rings leave no more than 1e-4."""
    inner, outer = single_scattering.ring_shares([0, 1e-6, 2e-6], setting)[:2] * single_scattering.entered(setting)
    strength = single_scattering.source_strength(setting)
    assert strength == pytest.approx((2 * inner - (inner + outer) / 2) / 1e-6, rel=1e-4)
    if setting.n == 1 and setting.g == 0:
        assert strength == pytest.approx(0.5, rel=1e-12)
    if setting == Setting():
        assert single_scattering.ring_shares([0, 1e-7])[0] == pytest.approx(0.5e-7, rel=1e-5)


@pytest.mark.parametrize("setting", [s for s in SETTINGS if s.illumination == "searchlight"], ids=str)
@pytest.mark.parametrize("ring", [(0.0, 0.3), (0.3, 0.31), (4.0, 6.0)])
def test_searchlight_is_the_plain_integral_over_exit_angles(setting, ring):
    def integrand(mu):
        rate = np.sqrt((1 + mu) / (1 - mu))
        within = np.exp(-ring[0] * rate) - np.exp(-ring[1] * rate)
        passes = 1 - fresnel(setting.n, 1.0, mu)[0]
        return 2 * np.pi * phase.HenyeyGreenstein(setting.g).pdf(-mu) * mu / (1 + mu) * within * passes

    critical = np.sqrt(max(1 - setting.n**-2, 0))
    expected, _ = quad(integrand, critical, 1, epsabs=1e-13, epsrel=1e-11, limit=400)
    found = single_scattering.ring_shares(np.unique([0.0, *ring]), setting)
    assert found[0 if ring[0] == 0 else 1] == pytest.approx(expected, rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_finer_quadrature_changes_nothing(setting, monkeypatch):
    _clear_caches()
    coarse, entered = single_scattering.ring_shares(EDGES, setting), single_scattering.entered(setting)
    step = single_scattering.K_STEP / 1.7
    finer = {"K_STEP": step, "BEYOND_CRITICAL": np.exp(np.arange(-38.0, 45.0, step)), "T_LAST": 4.1}
    for name, value in {**finer, "T_STEP": single_scattering.T_STEP / 1.7}.items():
        monkeypatch.setattr(single_scattering, name, value)
    _clear_caches()
    np.testing.assert_allclose(single_scattering.ring_shares(EDGES, setting), coarse, rtol=1e-9)
    assert single_scattering.entered(setting) == pytest.approx(entered, rel=1e-12)
    _clear_caches()


def _clear_caches():
    single_scattering.transform_density.cache_clear()
    single_scattering.mean_transmittance.cache_clear()


def test_narrow_and_far_rings_add_up_to_wide_ones():
    setting = Setting("diffuse", n=1.3, g=0.5)
    fine = np.concatenate([[0.0], np.geomspace(1e-4, 40.0, 400)])
    shares = single_scattering.ring_shares(fine, setting)
    beyond = np.cumsum(shares[::-1])[::-1]
    for ring in (100, 300, 399):
        assert beyond[ring] == pytest.approx(single_scattering.ring_shares([0, fine[ring]], setting)[-1], rel=1e-12)
    assert np.all(shares > 0)
    # The denser the medium the less comes out, through a cone of the solid angle ~ pi / n^2.
    shares = [single_scattering.ring_shares([0, 1], Setting("diffuse", n=n)).sum() for n in (1.0, 1.5, 3.0)]
    assert shares[0] > 2 * shares[1] > 8 * shares[2]


@pytest.mark.parametrize("n", [1.1, 1.33, 1.5, 2.4])
def test_light_that_enters(n):
    """Walsh's closed form of a dielectric's diffuse reflectance from outside (Duntley, J. Opt. Soc. Am. 32, 1942)."""
    square = n * n
    reflected = (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + square * (square - 1) ** 2 / (square + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (square + 2 * n - 1) / ((square + 1) * (n**4 - 1))
        + 8 * n**4 * (n**4 + 1) / ((square + 1) * (n**4 - 1) ** 2) * np.log(n)
    )
    assert single_scattering.entered(Setting("diffuse", n=n)) == pytest.approx(1 - reflected, rel=1e-11)
    assert single_scattering.entered(Setting("searchlight", n=n)) == pytest.approx(1 - ((n - 1) / (n + 1)) ** 2)


@pytest.mark.parametrize("edges", [[1, 2], [0, 2, 1], [0, np.nan], 3.0, "rings"])
def test_edges_must_be_those_of_rings(edges):
    with pytest.raises(InputError, match="r must"):
        single_scattering.ring_shares(edges)
