"""Cells of laws and maps: what is right, what narrower formats do, known failures; and what was mended in ours."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting, exact
from profilefit.convert import alpha_of, reflectance_of
from profilefit.fitting.quality import profile_quality
from profilefit.laws.quantile import depth, radius
from profilefit.laws.stack import StackTerms
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find, profile_laws
from profilefit.scenes.layers.law import single_scattering
from profilefit.shader.check.bounds import ALBEDOS
from profilefit.studies.stability import cells, law_cells, map_cells, stacks
from profilefit.studies.stability.cells import QUANTITIES, ArgumentGrid, RoundedText, Verdict, regions_of
from profilefit.studies.stability.law_cells import MEASURED, Reference, computed, limits_of
from tests.fixtures import refused

FITS = catalogue.fits_folder()
PROFILE, CDF, SAMPLE, PDF = QUANTITIES


def small(dtype, x=(0.01, 1.0, 10.0), alpha=(0.3, 0.9), xi=(0.1, 0.5, 0.9)):
    grid = ArgumentGrid.of(dtype)

    def cut(axis, values):
        return replace(axis, values=np.asarray(values, dtype).astype(float))

    return ArgumentGrid(dtype, cut(grid.alpha, alpha), cut(grid.x, x), cut(grid.xi, xi), cut(grid.mfp, (1.0, 2.0)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hazard", "quantile"])
def test_right_is_the_law(name):
    """Of radii the two steps of hazard's text are right to 2e-8 in xi."""
    law, at = catalogue.load(name), small(np.float64)
    right, (r, xi, alpha, mfp) = Reference(law, at), at.arguments
    np.testing.assert_allclose(right.of(PROFILE), law.profile(r, alpha, mfp), rtol=1e-9)
    np.testing.assert_allclose(right.of(CDF), law.cdf(r, alpha, mfp), rtol=1e-10)
    sampler = law.samplers.get("two steps", law.sampler)
    np.testing.assert_allclose(right.of(SAMPLE), sampler.sample(xi, alpha, mfp), rtol=1e-6)
    np.testing.assert_allclose(right.of(PDF), sampler.pdf(r, alpha, mfp), rtol=1e-4)
    assert np.max(right.misplaced(np.asarray(sampler.sample(xi, alpha, mfp)))) < 1e-7
    assert np.min(right.misplaced(1.1 * np.asarray(sampler.sample(xi, alpha, mfp)))) > 1e-3


@pytest.mark.slow
def test_errors_that_no_record_tells_are_as_measured():
    for name, stated in MEASURED.items():
        one = next(one for one in profile_laws(FITS) if one.name == name)
        quality = profile_quality(one.law, ALBEDOS)
        assert {name: np.max(getattr(quality, name)) for name in stated} == pytest.approx(stated, rel=0.01)


def test_the_source_is_infinite_and_a_sum_of_gaussians_is_not():
    at = small(np.float64, x=(0.0, 1.0))
    assert np.all(np.isinf(Reference(catalogue.load("hazard"), at).of(PROFILE)[:, 0]))
    assert np.all(np.isfinite(Reference(catalogue.load("gaussians:2"), at).of(PROFILE)))


def test_single_precision_is_right_and_half_is_not():
    """A text in half far out, and next to the source, is no number."""
    one, x = find("hazard", FITS), (0.0, 1.0, 60000.0)
    limits = limits_of(one, FITS)
    for each in computed(one, limits, cells.TEXT32, small(np.float32, x)):
        assert np.all(each.codes <= Verdict.BEYOND), each.quantity
    half = list(computed(one, limits, cells.TEXT16, small(np.float16, x)))
    assert any(Verdict.NOT_FINITE in each.verdicts for each in half)
    # Half is measured, nothing is held to it.
    assert not any(region.is_failure for each in half for region in regions_of(each))


def test_a_text_keeps_its_type():
    for dtype in (np.float16, np.float32, cells.EXTENDED):
        text = RoundedText(catalogue.load("quantile"), dtype)
        assert text.call("profile", np.array([1.0]), np.array([0.5]), np.array([1.0])).dtype == dtype


@pytest.fixture(scope="module")
def printed():
    """The printed laws of Liang et al.: g as it is, and the energy of (17)."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "liang, published")
    limits = law_cells.limits_of(one, FITS)
    return [law_cells.unclipped(one, limits), law_cells.own_energy(one, limits)]


def keys(regions):
    return {(one.quantity, one.verdict) for one in regions}


@pytest.mark.slow
def test_g_is_negative_below_eps_and_the_energy_is_a_misprint(printed):
    inverse, energy = map(regions_of, printed)
    assert (law_cells.INVERSE, Verdict.NEGATIVE) in keys(inverse)
    assert keys(energy) == {(law_cells.ENERGY, Verdict.NOT_FINITE), (law_cells.ENERGY, Verdict.INACCURATE)}
    assert all("b0 = 0.0641" in one.advice for one in (*inverse, *energy))


@pytest.mark.slow
def test_the_map_folds_and_the_rational_one_does_not():
    """The printed map (8), and ours."""
    maps = {one.label: map_cells.cells_of(one, FITS) for one in catalogue.albedo_laws(FITS)}
    labels = "liang, published", "albedo-rational"
    theirs, ours = ([region for each in maps[label] for region in regions_of(each)] for label in labels)
    assert (cells.ALPHA_OF, Verdict.NOT_MONOTONE) in keys(theirs)
    assert (cells.REFLECTANCE_OF, Verdict.NOT_FINITE) in keys(theirs)
    folds = [one for one in theirs if one.verdict == Verdict.NOT_MONOTONE and one.arithmetic == cells.FLOAT64]
    assert folds[0].where.startswith("A 0.92") or folds[0].where.startswith("A 0.95")
    assert {"rational" in one.advice for one in theirs if one.arithmetic == cells.FLOAT64} == {True}
    assert not any(one.is_failure for one in ours)
    assert {(one.arithmetic, one.advice) for one in ours} == {(cells.STORED16, cells.ADVICE[cells.STORED16])}


@pytest.mark.slow
def test_a_wrong_constant_of_another_law_is_seen():
    """Negative control: a fault in a constant of Burley's law turns more cells of cdf and radii red."""
    one = next(one for one in catalogue.profile_laws(FITS) if one.label == "burley, published")
    limits = law_cells.limits_of(one, FITS)

    def red(factor):
        law = eqx.tree_at(lambda law: law.s0, one.law, factor * one.law.s0)
        model = law_cells.model_cells(replace(one, law=law), limits)
        return {each.quantity: int(np.sum(each.codes >= Verdict.INACCURATE)) for each in model}

    right, faulty = red(1.0), red(1.3)
    assert all(faulty[name] > right[name] for name in (CDF, SAMPLE))


def test_a_wrong_constant_of_our_own_map_or_a_red_cell_where_it_is_right_is_a_failure():
    """Negative control."""
    one = find("albedo-rational", FITS)
    law = eqx.tree_at(lambda law: law.b, one.law, 1.3 * one.law.b)
    model = [each for each in map_cells.cells_of(replace(one, law=law), FITS) if each.arithmetic == cells.MODEL]
    regions = [region for each in model for region in regions_of(each)]
    assert regions
    assert all(each.is_failure for each in regions)
    double = next(each for each in map_cells.cells_of(one, FITS) if each.arithmetic == cells.FLOAT64)
    codes = double.codes.copy()
    codes[double.axes[0].nearest(0.5)] = Verdict.INACCURATE
    (region,) = regions_of(replace(double, codes=codes))
    assert (region.is_failure, region.where) == (True, "A 0.5")


def test_regions_are_the_red_cells_and_no_others(printed):
    for each in printed:
        red = [one for one in regions_of(each) if one.verdict.is_red]
        assert sum(one.count for one in red) == np.sum(each.codes >= Verdict.INACCURATE)


def test_a_dark_medium_keeps_the_digits_of_its_reflectance():
    """1 - sqrt(1 - alpha) has none left below 1e-16; A is proportional to alpha there."""
    law = catalogue.albedo_law("rational")
    alpha = np.array([1e-300, 1e-20, 1e-12])
    np.testing.assert_allclose(law.reflectance(alpha) / alpha, law.reflectance(1e-6) / 1e-6, rtol=1e-5)
    single = jax.tree.map(jnp.float32, law).reflectance(jnp.float32(1e-10))
    assert float(single) == pytest.approx(law.reflectance(1e-10), rel=1e-6)


@pytest.mark.slow
def test_the_density_of_hazards_radii_in_single_precision():
    law = catalogue.load("hazard")
    x = np.array([0.0, 1e-9, 1e-5, 3e-3, 0.1, 10.0, 30.0, 1e6, 1e30, np.inf])
    single = jax.tree.map(jnp.float32, law).sampler
    alpha = np.array([[0.0], [0.5], [1.0]])
    exactly = law.sampler.pdf(x, alpha)
    made = np.asarray(single.pdf(jnp.asarray(np.minimum(x, 1e38), jnp.float32), jnp.asarray(alpha, jnp.float32)))
    assert np.all(np.isfinite(exactly) & np.isfinite(made) & (made >= 0))
    seen = exactly > 1e-30
    np.testing.assert_allclose(made[seen], exactly[seen], rtol=3e-4)


@pytest.mark.slow
def test_the_radius_of_quantile_is_inverted_up_to_white():
    law, x = catalogue.load("quantile"), np.geomspace(1e-25, 1e8, 60)
    alpha = np.array([0.0, 0.5, 1 - 1e-9, 1 - 1e-12, 1 - 2.0**-53, 1.0])[:, None]
    with jax.enable_x64(True):
        curve = law.curve(jnp.asarray(alpha))
        back = np.asarray(radius(depth(jnp.asarray(x), curve), curve)[0])
    np.testing.assert_allclose(back, np.broadcast_to(x, back.shape), rtol=1e-13)


@pytest.mark.slow
def test_no_share_is_negative_next_to_the_source():
    law = catalogue.load("hazard", setting=Setting("diffuse", n=1.4))
    share = law.cdf(np.geomspace(1e-18, 1e-14, 50)[None], np.linspace(0, 1, 41)[:, None])
    assert np.min(share) == 0.0  # rounding gave -1e-17


def test_gaussians_at_infinity_and_the_exact_half_space_at_huge_radii():
    """Products of 1e300 with wave numbers were not finite."""
    assert catalogue.load("gaussians:2").sampler.pdf(np.inf, 0.5) == 0.0
    for x in (1e120, 1e300, np.finfo(float).max):
        assert (exact.profile(x, 0.9), exact.cdf(x, 0.9)) == (0.0, 1.0)


@pytest.mark.slow
def test_a_colour_next_to_white_has_an_albedo():
    reflectance = 1.0 - 2.0 ** -np.array([10.0, 24.0, 40.0, 53.0])
    for light in ("searchlight", "diffuse"):
        found = alpha_of(reflectance, light)
        np.testing.assert_allclose(reflectance_of(found, light), reflectance, rtol=0, atol=1.5e-8)


@pytest.mark.parametrize("mfp", [1e-101, 1e101, 0.0])
def test_lengths_without_a_square_are_refused(mfp):
    refused(r"mfp must be > 0, from 1e-100 to 1e\+100", catalogue.load("hazard").profile, 1.0, 0.5, mfp)
    refused(r"mfp must be a transport mean free path > 0, from 1e-100 to 1e\+100", exact.profile, 1.0, 0.5, mfp)


def test_light_that_grazes_a_matched_surface_keeps_its_digits():
    """Its cosine inside was that of 1 - sine^2, which had lost 6e-5 of 1e-6."""
    medium = Medium((Layer(1.0, 0.1, 0.9, 0.0, 1.0), Layer(1.0, 0.1, 0.9, 0.0)))
    into, out = np.array([1e-9, 1e-6, 1e-3]), np.array([1e-9, 1e-6, 0.5])[:, None]
    right = 0.9 / (4.0 * np.pi) * into / (into + out)
    np.testing.assert_allclose(single_scattering(medium, into, out, 0.0), right, rtol=1e-12)


def test_no_radius_of_a_stack_has_a_negative_density():
    """1 - c (1 / c), compiled, was -1e-16: the share of a first layer of no thickness, all that is left far out."""
    law, zero = stacks.end(*stacks.ENDS[0]).law, np.zeros(1000)
    came = np.random.default_rng(1).random(1000)
    with jax.enable_x64(True):
        share = jax.jit(lambda of: law.shares(of)[0])(StackTerms(*[jnp.asarray(zero)] * 8, jnp.asarray(came)))
        assert np.all(np.asarray(share) == 0.0)
