"""What pipelines judge their laws with: how an inverse cdf is measured, and which printed sets belong to a recipe."""

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.pipelines import inversion_error, needs_photons, printed_sets

FITS = catalogue.fits_folder()


def test_inversion_error_is_zero_for_an_exact_sampler_and_not_for_the_papers():
    class Exactly:
        setting = Setting()

        class sampler:
            sample = staticmethod(lambda xi, alpha: exact.quantile(xi, alpha))

    alpha = np.array([0.3, 0.9])
    assert inversion_error(Exactly(), alpha) == pytest.approx([0, 0], abs=1e-8)
    assert np.all(inversion_error(catalogue.load("liang", "published"), alpha) > 0.03)


def test_printed_sets_are_those_of_the_recipes_setting():
    burley = recipe.find("burley-whole", FITS)
    searchlight, diffuse = printed_sets(burley), printed_sets(burley.changed(setting_table={"illumination": "diffuse"}))
    assert searchlight["published"]["s0"] == 1.85
    assert diffuse["published"]["s0"] == 1.9
    assert printed_sets(burley.changed(setting_table={"n": 1.4})) == {}
    assert set(printed_sets(recipe.find("liang-whole", FITS))) == {"published", "corrected"}


def test_who_needs_photons():
    orders, exactly = recipe.find("albedo-liang", FITS), recipe.find("albedo-rational", FITS).changed(check="")
    assert needs_photons(orders)
    assert not needs_photons(exactly)
    assert needs_photons(exactly.changed(check="orders"))
