"""The way from a file to an answer in one call gives what its parts give, and names what cannot be asked."""

from dataclasses import replace
from pathlib import Path

import pytest

import profilefit
from mcml_sim import Setting, half_space
from profilefit.errors import InputError, SettingError
from profilefit.measured import Known, fit, read
from profilefit.measured.fitting import fitted
from profilefit.measured.noise import origin
from profilefit.measured.problem import FitSpec
from profilefit.recipes.catalogue import fits_folder

DATA = Path(__file__).parents[3] / "examples"
PHANTOM = DATA / "phantom.csv"  # alpha .95, l 1.1 mm


@pytest.fixture(scope="module")
def near():
    return read(PHANTOM).within(None, 2.0)


def test_it_reads_files():
    with pytest.raises(InputError, match=r"none\.csv"):
        fit(str(DATA / "none.csv"))


def test_it_is_the_fit_of_its_parts(near):
    law = profilefit.load("hazard")
    parts = fitted(near, FitSpec(law, {"scale": 1.0}, source=origin("hazard", "regenerated", Setting(), fits_folder())))
    result = fit(near, "hazard", walk=False)
    assert result.fit.values == parts.values
    assert result.walk is None
    assert result.identifiability.all_identified
    assert result.fit.rel is not None, "the law's record was found"


def test_what_is_known_goes_in(near):
    assert fit(near, held={"l": 1.1}, walk=False).fit.values["l"] == pytest.approx(1.1, rel=1e-12)
    free = fit(near, held={"A": 0.53}, scale=None, walk=False).fit
    assert free.values["A"] == pytest.approx(0.53, rel=1e-6)
    assert free.spec.held.keys() == {"A"}
    measured = fit(near, total=Known(0.53, 0.005), scale=Known(1.0, 0.02), walk=False).fit
    assert measured.spec.held == {}
    assert measured.values["alpha"] == pytest.approx(0.95, abs=4 * measured.errors(measured.statistical)["alpha"])


def test_a_simulation_brings_its_own_surface():
    simulated = read(DATA / "half_space.mco")
    oily = replace(simulated, medium=half_space(0.9, n=1.67))
    with pytest.raises(SettingError, match=r"belongs to .* n in \(1, 1.6\].*, got a request for searchlight, n = 1.67"):
        fit(oily, "hazard")
    with pytest.raises(SettingError, match=r"exact light needs n >= 1 where g = 0, .*, got searchlight, n = 0.9"):
        fit(oily, setting=Setting(n=0.9))
    found = fit(oily, setting=Setting(n=1.4), walk=False).fit
    assert found.spec.law.setting.n == 1.4
    assert found.rel == 0, "light solved exactly"
    assert "the file's n is 1.67, fitted as n = 1.4" in found.data.notes


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"held": {"mu_a": 1.0}}, "held must name some of alpha, A, l, got 'mu_a'"),
        ({"held": {"alpha": 0.9, "A": 0.5}}, "held must have one of alpha and A, which say the same, got both"),
        ({"held": {"l": -1.0}}, "held l must be a number > 0, got -1.0"),
        ({"scale": 0.0}, "scale must be a number > 0, got 0.0"),
        ({"law": "hazzard"}, "law must be one of .*, got 'hazzard'"),
    ],
)
def test_what_cannot_be_asked_is_named(near, given, message):
    with pytest.raises(InputError, match=message):
        fit(near, **given)
