"""The whole atlas and its parts: misuse, derivatives, exact light and fits."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import find
from profilefit.shader.check import bounds
from profilefit.studies.stability import atlas, exact_cells, fit_cases, gradients, law_cells, map_cells, misuse, stacks
from profilefit.studies.stability.cells import ADVICE, CDF, FLOAT64, Cells, Verdict, absolute, axis, regions_of
from tests.fixtures import refused

FITS = catalogue.fits_folder()


def test_laws_and_functions_refuse_nonsense_by_name():
    cells = [*misuse.of_law(find("hazard", FITS)), *misuse.of_law(find("albedo-rational", FITS))]
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
    assert all(region.is_failure for region in regions_of(cells))


DERIVATIVES = {"∂α(A)/∂A", "∂α(A)/∂constants", "∂A(α)/∂α", "∂A(α)/∂constants"}


def of_map(label):
    one = next(one for one in catalogue.albedo_laws(FITS) if one.label == label)
    return list(gradients.of_map(one, bounds.valid_map(one, FITS)))


def test_the_rational_map_is_differentiable_both_ways_and_the_printed_one_has_no_slope_above_its_fold():
    cells = of_map("albedo-rational")
    assert {one.quantity for one in cells} == DERIVATIVES
    assert not any(region.is_failure for one in cells for region in regions_of(one))
    regions = [region for cells in of_map("liang, published") for region in regions_of(cells)]
    red = [one for one in regions if one.verdict.is_red]
    assert {one.advice for one in red} == {gradients.INSIDE}
    assert any(one.verdict == Verdict.NOT_FINITE and "A(α)" in one.quantity for one in red)


@pytest.mark.slow
def test_a_wrong_derivative_is_found_and_leaves_nothing_behind(monkeypatch):
    """Negative control: differences of half the step are half as large. What was compiled with them is not used again:
    the atlas, looked at later in the same process, had four regions that nothing explained."""

    def found():
        return {one.quantity for one in of_map("van_de_hulst, published") if Verdict.INACCURATE in one.verdicts}

    with monkeypatch.context() as wrong:
        wrong.setattr(gradients, "WEIGHTS", tuple((0.5 * k, weight) for k, weight in gradients.WEIGHTS))
        assert found() == DERIVATIVES
    assert found() == set()


X, ALPHA = np.array([0.0, 1e-3, 0.1, 1.0, 10.0, 1e3, np.inf]), np.array([0.0, 1e-6, 0.5, 1.0])


def classes(cdf):
    finer, axes = exact_cells.finer_cdf(X, ALPHA, Setting())[..., 0], (axis("α", ALPHA), axis("r/l", X))
    return Cells("exact", True, CDF, FLOAT64, axes, cdf, finer, absolute(cdf, finer), exact_cells.BOUNDS[CDF]).verdicts


def test_the_cdf_is_right_and_a_wrong_one_is_not():
    cdf = exact.cdf(X, ALPHA[:, None])
    assert classes(cdf) == {Verdict.RIGHT}
    off = exact.cdf(X * (1.0 + 1e-7), ALPHA[:, None])  # negative control: a mean free path that is 1e-7 off
    assert Verdict.INACCURATE in classes(off)


@pytest.mark.slow
def test_plates_are_right_and_others_are_not(monkeypatch):
    monkeypatch.setattr(exact_cells, "PLATE_ALPHA", (0.0, 0.5, 0.9, 1.0 - 1e-6, 1.0))
    assert np.all(exact_cells.plates(1.0).codes == Verdict.RIGHT)
    solve = exact.solve  # negative control: a millionth of the light is absorbed where nothing should be
    monkeypatch.setattr(exact, "solve", lambda medium, **rest: solve(exact_cells.plate(1.0 - 1e-6, 1.0, 1.0), **rest))
    assert np.any(exact_cells.plates(1.0).codes == Verdict.INACCURATE)


@pytest.mark.slow
def test_no_cell_is_red_where_something_is_promised():
    cells = list(exact_cells.refracting_cells())
    assert {one.quantity for one in cells} == {"R_d", "cdf", "A(α)"}
    assert sum(int(np.sum(one.codes == Verdict.RIGHT)) for one in cells) > 1500
    for one in cells:
        assert not any(region.is_failure for region in regions_of(one)), one.subject


@pytest.mark.slow
def test_the_rational_map_is_found_from_anywhere():
    fits = fit_cases.fits_of(catalogue.albedo_law("rational"), "reflectance", "r", 6)
    cases = {(one.case, one.value): one for one in fits}
    random = cases[fit_cases.STARTS, "× e^(0.69 normal)"]
    assert random.converged > 0.5
    assert random.spread < 1e-6
    noise = [cases[fit_cases.NOISE, f"{photons:.0e} photons"].spread for photons in (1e4, 1e6, 1e8)]
    assert noise[0] > noise[1] > noise[2] > 0
    nonsense = [one for (case, _), one in cases.items() if case == fit_cases.NONSENSE]
    assert nonsense
    assert all(one.converged == 0 and one.results[0][0] for one in nonsense)
    assert not any(one.is_failure for one in cases.values())


def test_wider_rings_keep_the_last_radius_and_the_light():
    usual = fit_cases.even_rings(fit_cases.ORDINARY, fit_cases.LAST)
    wide = fit_cases.merged_rings(usual, 8)
    assert wide.r_edges[-1] == usual.r_edges[-1] == fit_cases.LAST
    np.testing.assert_allclose(np.unique(wide.r_edges), usual.r_edges[::8])
    np.testing.assert_allclose(wide.cdf[:, -1], usual.cdf[:, -1], rtol=1e-6)
    np.testing.assert_allclose(wide.energy[:, 8], np.sum(usual.energy[:, 8:16], axis=1), rtol=1e-6)
    assert wide.energy.shape == usual.energy.shape
    assert np.all(wide.energy[wide.used == 0] == 0)


def test_a_fit_that_accepts_nonsense_is_a_failure():
    case = fit_cases.FitCase("f", fit_cases.NONSENSE, "NaN in the data", 1.0, 1.0, 0.0, "a", (("converged", 1),))
    assert case.is_failure
    assert not replace(case, converged=0.0, results=(("the residual is not finite there", 1),)).is_failure
    assert replace(case, converged=0.0, results=(("", 1),)).is_failure


@pytest.mark.slow
def test_jobs_by_name():
    def named(*words, quick=False):
        return [name for name, _ in atlas.jobs(words, FITS, quick)]

    assert named("liang") == [
        *("liang, published", "liang, corrected", "liang-whole", "liang-as-published", "liang-inverse-as-published"),
        *("map liang, published", "albedo-liang"),
    ]
    assert named("exact", "hazard-refracting") == ["hazard-refracting", "exact"]
    everything, if_named = named(), set(atlas.IF_NAMED)
    assert {*atlas.QUICK, *atlas.DERIVED, "albedo-liang"} | set(atlas.FUNCTIONS) - if_named <= set(everything)
    assert len(everything) == len(set(everything))
    assert not if_named & set(everything)
    for one in ("sea", "fur"):
        assert named(one, quick=True) == [one]
    refused(r"name must be a law, map or record .*, got 'hazzard'", atlas.jobs, ["hazzard"], FITS, False)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_ours_hold_and_every_failure_has_its_advice():
    parts = list(atlas.run(atlas.jobs([], FITS, False)))
    regions = [one for part in parts for one in part.regions]
    assert [(one.subject, one.quantity, one.arithmetic, one.place) for one in regions if one.is_failure] == []
    assert [(one.subject, one.quantity) for one in regions if one.verdict.is_red and not one.advice] == []
    assert [one for part in parts for one in part.fits if one.is_failure] == []
    laws = [(one.subject.split("-")[0].split(",")[0], one.advice) for one in regions if one.own]
    assert [(law, advice) for law, advice in laws if law in advice] == []
    advice = {law_cells.OF_LIANG, map_cells.OF_MAPS, stacks.OF_LAWS, misuse.CHECK, *ADVICE.values()}
    assert advice <= {one.advice for one in regions}
