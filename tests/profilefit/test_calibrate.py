"""What running a recipe checks before it starts, and how an inverse cdf is judged."""

from pathlib import Path

import numpy as np
import pytest

from mcml_sim import exact
from profilefit import calibrate, catalogue, recipe
from profilefit.calibrate import inversion_error
from profilefit.errors import RecipeError

FITS = catalogue.fits_folder()


def test_inversion_error_is_zero_for_an_exact_sampler_and_not_for_the_papers():
    class Exactly:
        setting = exact.SEARCHLIGHT

        class sampler:
            sample = staticmethod(lambda xi, alpha: exact.quantile(xi, alpha))

    alpha = np.array([0.3, 0.9])
    assert inversion_error(Exactly(), alpha) == pytest.approx([0, 0], abs=1e-8)
    assert np.all(inversion_error(catalogue.load("liang", "published"), alpha) > 0.03)


def test_recipes_are_checked_before_any_photon_is_traced(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text((FITS / "liang-whole.toml").read_text().replace('"corrected"', '"improved"'))
    said: list[str] = []
    run = calibrate.Run("quick", 0, tmp_path / "out", tmp_path / "store", 1000, said.append, False)
    with pytest.raises(RecipeError, match="start must be one of published, corrected, got 'improved'"):
        calibrate.regenerate((recipe.find("albedo-liang", FITS), recipe.read(bad)), run)
    assert not said
    assert not Path(tmp_path / "store").exists()
