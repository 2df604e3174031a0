"""Nonsense is refused by name; a function that lets it pass is found."""

import numpy as np

from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.studies.stability import misuse
from profilefit.studies.stability.cells import FLOAT64, Verdict

FITS = catalogue.fits_folder()


def test_laws_and_functions_refuse_nonsense_by_name():
    cells = [*misuse.of_law(find("hazard", FITS)), *misuse.of_map(find("albedo-rational", FITS))]
    cells += [*misuse.of_exact(), *misuse.of_convert()]
    assert {one.arithmetic for one in cells} == {FLOAT64, "float32 text"}
    for one in cells:
        if one.arithmetic == FLOAT64:
            assert one.verdicts == {Verdict.OUTSIDE}, one.quantity


def test_what_passes_or_raises_otherwise_is_red():
    def careless(key, value):
        if key == "mfp":
            raise ZeroDivisionError
        return value

    cells = misuse.refusals("f", True, "cdf", misuse.cases_of("cdf"), careless)
    assert cells.verdicts == {Verdict.INACCURATE, Verdict.RAISES}
    assert np.all(cells.failures)
