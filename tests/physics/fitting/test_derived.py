"""Derived quantities and their errors: against refits, the exact half space, and what a record says."""

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.fitting import discrepancy as derived
from profilefit.fitting.discrepancy import AtAlbedo, LawWithErrors, Quantity, discrepancy
from profilefit.fitting.estimate import fit
from profilefit.fitting.profiles import Profiles
from profilefit.recipes import catalogue
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records, plain
from tests.fixtures import refused

pytestmark = pytest.mark.slow

ALPHA = 1.0 - np.linspace(0.95, 0.07, 10) ** 2
EDGES = np.concatenate([[0.0], np.geomspace(0.01, 100.0, 30)])
FREE = ("s0", "s1", "s2", "s3")


@pytest.fixture(scope="module")
def truth():
    return Profiles.from_exact(ALPHA, EDGES)


@pytest.fixture(scope="module")
def known(truth, burley):
    """Normalized diffusion fitted to the exact half space, with a made-up photon noise of its constants."""
    one = fit(truth, burley, "energy", FREE, jackknife=False)
    noise = np.diag((0.01 * one.solution.parameters) ** 2)
    return LawWithErrors(one.law, one.free, "energy", noise, discrepancy(one, truth))


def test_radius_is_the_law_s_own_and_statistical_errors_are_of_moved_constants(known):
    for alpha in (0.3, 0.9):
        for share in (0.3, 0.995):
            found = derived.radius(known, alpha, share)
            # Straight lines between edges 2.3 % apart, of a share that levels off.
            assert found.value[0] == pytest.approx(float(known.law.sampler.sample(share, alpha)), rel=1e-3)
    refused(r"share must be in \(0, 1\), of a profile law, got 1.5 of Burley", derived.radius, known, 0.5, 1.5)
    refused("known must be of a map between alpha and A, got Burley", derived.reflectance, known, 0.5)
    assert AtAlbedo.of(known, 0.5).energy.sum() == pytest.approx(float(known.law.albedo.reflectance(0.5)), rel=1e-6)
    # Central differences, a constant at a time.
    theta, alpha, r = known.law.vector(FREE), 0.8, np.array([0.1, 1.0, 4.0])
    slopes = {"radius": [], "profile": []}
    for i in range(4):
        step = np.zeros(4)
        step[i] = 1e-4 * theta[i]
        up, down = (known.law.with_vector(FREE, theta + sign * step) for sign in (1, -1))
        slopes["radius"].append((up.sampler.sample(0.9, alpha) - down.sampler.sample(0.9, alpha)) / (2 * step[i]))
        slopes["profile"].append((up.profile(r, alpha) - down.profile(r, alpha)) / (2 * step[i]))
    sigma = np.sqrt(np.diag(known.statistical))
    radius = np.linalg.norm(np.array(slopes["radius"]) * sigma)
    assert derived.radius(known, alpha, 0.9).statistical[0] == pytest.approx(radius, rel=3e-2)
    profile = np.linalg.norm(np.array(slopes["profile"]) * sigma[:, None], axis=0)
    # Ring averages for values at a point: the square of the rings' width; next to a zero of the slope more.
    np.testing.assert_allclose(derived.profile(known, r, alpha).statistical, profile, rtol=0.05)


def test_the_band_holds_the_exact_profile_and_the_photons_alone_do_not(known):
    """At held-out albedos and radii: 68 % and 95 % bands, points far enough apart to count as five."""
    inside, alone, number = {0.68: [], 0.95: []}, [], 0
    for alpha in (0.25, 0.55, 0.75, 0.88, 0.95, 0.985):
        r = np.geomspace(0.02, float(exact.quantile(0.99, alpha)), 9)
        expected = exact.profile(r, alpha)
        found = derived.profile(known, r, alpha)
        for level, hits in inside.items():
            low, high = found.interval(level)
            hits.append(np.mean((low <= expected) & (expected <= high)))
        photons = Quantity(found.value, 0.1 * found.statistical, 0 * found.model).interval(0.95)
        alone.append(np.mean((photons[0] <= expected) & (expected <= photons[1])))
        number += r.size
    # The 54 points reach over each other: some 2 albedos times 4 radii stand alone, sqrt(.68 * .32 / 8) = .16.
    assert 0.68 - 2 * 0.16 < np.mean(inside[0.68]) <= 1.0
    assert np.mean(inside[0.95]) >= 0.95 - 2 * 0.08
    assert np.mean(alone) < 0.3


def test_reflectance_of_a_map(normalisation):
    alpha = 1.0 - np.linspace(0.95, 0.05, 16) ** 2
    truth = Profiles.from_exact(alpha, [0.0, 1000.0])
    one = fit(truth, normalisation, "reflectance", jackknife=False)
    off = discrepancy(one, truth)
    known = LawWithErrors(one.law, one.free, one.objective, one.statistical, off)
    found = derived.reflectance(known, [0.3, 0.85, 0.97])
    np.testing.assert_allclose(found.value, one.law.reflectance([0.3, 0.85, 0.97]), rtol=1e-12)
    z = (found.value - exact.reflectance(np.array([0.3, 0.85, 0.97]))) / found.model
    assert np.abs(z).max() < 4
    assert np.all(found.model < 1e-4)
    assert np.all(np.isnan(found.statistical))
    refused("share must be in", derived.radius, known, 0.5)


def test_a_record_says_it_again_and_a_summary_how_far_radii_are_off(known, truth):
    content = {
        "protocol": {"weighting": {"objective": "energy"}},
        "covariance": {"names": FREE, "statistical": known.statistical, "model": known.discrepancy.covariance},
        "discrepancy": known.discrepancy.content(),
    }
    again = LawWithErrors.of_record(known.law, plain(content), known.discrepancy.arrays())
    np.testing.assert_allclose(derived.radius(again, 0.8).error, derived.radius(known, 0.8).error, rtol=1e-9)
    old = {key: value for key, value in content.items() if key != "discrepancy"}
    silent = LawWithErrors.of_record(known.law, plain(old), {})
    assert silent.discrepancy is None
    assert np.isnan(derived.radius(silent, 0.8).model[0])
    # The far radius rests on light that the discrepancy does not look at: its error is that of the fitted albedos.
    found = derived.summary(known, truth)
    assert found["quantity"] == "radius"
    expected = np.array([float(exact.quantile(0.995, alpha)) for alpha in found["alpha"]])
    z = (found["value"] - expected) / found["model"]
    assert np.abs(z).max() < 3
    off = [float(known.law.sampler.sample(0.995, a)) / float(exact.quantile(0.995, a)) - 1 for a in ALPHA]
    # The data's own radius is read off straight lines between edges a third apart.
    assert derived.tail_error(known, truth) == pytest.approx(np.sqrt(np.mean(np.square(off))), rel=0.3)


@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
@pytest.mark.parametrize(("n", "g"), [(1.0, 0.0), (1.4, 0.0), (1.4, 0.5), (1.4, 0.9)])
def test_shipped_records_state_the_error_that_their_law_has(light, n, g):
    """Against exact light at albedos between those of the fit, within 99 % of the energy."""
    setting = Setting(light, n, g)
    law, records = catalogue.load("hazard", setting=setting), Records.of(fits_folder())
    path = records.path("hazard", setting)
    known, z = LawWithErrors.of_record(law, records.read(path), dict(np.load(path.with_suffix(".npz")))), []
    for alpha in (0.15, 0.45, 0.75, 0.93, 0.99):
        r = np.geomspace(0.05, float(derived.radius(known, alpha, 0.99).value[0]), 15)
        found = derived.profile(known, r, alpha)
        z.append((found.value - exact.profile(r, alpha, setting=setting)) / found.model)
    assert 0.5 < np.sqrt(np.mean(np.square(z))) < 2.0
    assert np.mean(np.abs(z) < 2.0) > 0.85
