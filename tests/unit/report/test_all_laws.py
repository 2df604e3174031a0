"""Every law that loads, once, under its own light; and the tables that say how good each is."""

import json
from dataclasses import fields

import numpy as np
import pytest

from mcml_sim import exact
from profilefit.fitting.quality import profile_quality
from profilefit.fitting.sampling import SamplerQuality
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import albedo_laws, profile_laws, sampled_laws
from profilefit.report.tables import law_tables as tables
from profilefit.report.tables.law_tables import every_law, measured, measured_samplers
from tests.unit.report.test_figures import folder_with
from tests.unit.report.test_tables import parsed, rendered

FITS = catalogue.fits_folder()
ALPHA = np.array([0.3, 0.9])


@pytest.fixture
def folder(tmp_path):
    """A folder with two records."""
    return folder_with(tmp_path, "burley-whole", "albedo-rational")


def printed(parts, width=100) -> list[str]:
    return rendered(parts, width).splitlines()


def test_every_law_is_there_once_made_of_all_its_records():
    laws = {one.label: one for one in profile_laws(FITS)}
    assert len(laws) == len(profile_laws(FITS))
    assert set(laws) >= {"liang, corrected", "burley, diffuse", "burley_diffuse_mfp, published", "beam_diffusion"}
    assert set(laws) >= {"liang-whole", "liang-as-published", "gaussians-2", "gaussians-6", "burley-whole-diffuse"}
    assert "liang-inverse-whole" not in laws, "an inverse has no profile of its own"
    assert "liang-inverse-as-published" in {one.label for one in sampled_laws(FITS)}
    maps = {one.label for one in albedo_laws(FITS)}
    assert maps >= {"liang, published", "van_de_hulst, published", "chiang, published", "albedo-rational-diffuse"}
    assert not any("-n1" in label for label in (*laws, *maps)), "no exact profile to measure them against"
    assert laws["liang-whole"].records == ("liang-whole", "liang-inverse-whole")
    assert laws["liang-whole"].law == catalogue.load("liang")


def test_records_restrict_and_a_failed_one_has_no_law(folder):
    assert [one.label for one in profile_laws(folder, ["burley-whole"])] == ["burley-whole"]
    assert [one.label for one in albedo_laws(folder, ["burley-whole"])] == []
    assert "gaussians-2" not in {one.label for one in profile_laws(folder)}, "not in this folder"
    path = folder / "burley-whole.json"
    broken = json.loads(path.read_text())
    path.write_text(json.dumps(broken | {"fit": broken["fit"] | {"result": "no convergence"}}))
    assert profile_laws(folder, ["burley-whole"]) == []
    assert printed(every_law(measured(folder, ["burley-whole"]))) == [tables.NOTHING]


@pytest.mark.slow
def test_tables_of_one_record(folder):
    """What is printed is what was measured."""
    found = measured(folder, ["burley-whole"], ALPHA, [0.9])
    lines = printed(every_law(found, in_detail=True))
    law = catalogue.load("burley")
    quality = profile_quality(law, ALPHA)
    rows = [line.split()[2:] for line in lines if line.startswith("burley-whole ")]  # after name and blocks
    expected = [100 * quality.rel, 100 * quality.ks, 100 * quality.l1, 1e9 * quality.mse, quality.r2]
    assert len(rows) == len(expected)
    for row, values in zip(rows, expected, strict=True):
        last = values.min() if values is quality.r2 else values.max()
        np.testing.assert_allclose(np.array(row, float), [*values, values.mean(), last], rtol=0.06)
    assert max(map(len, lines)) <= 100
    assert sum(line.startswith("burley-whole: ") for line in lines) == 3  # its samplers
    assert "Sampler: burley-whole: xie" in lines
    told = tables.content(found)
    (one,) = told["profiles"]
    assert (one["law"], one["records"]) == ("burley", ["burley-whole"])
    np.testing.assert_array_equal(one["quality"].rel, quality.rel)
    assert [each["sampler"] for each in told["samplers"]] == ["exact", "xie", "unreal"]
    assert told["maps"] == []


def test_samplers_are_held_against_the_exact_cdf(folder):
    [one] = profile_laws(folder, ["burley-whole"])
    exactly, xie, _ = measured_samplers(one, [0.9])
    assert (exactly.name, xie.name) == ("exact", "xie")
    r = np.geomspace(1e-3, 40, 4000)
    error = np.max(np.abs(exact.cdf(r, 0.9) - one.law.cdf(r, 0.9)))
    assert exactly.exact_error[0] == pytest.approx(error, rel=1e-3)
    assert xie.quality.inversion_error[0] > 100 * exactly.quality.inversion_error[0]


@pytest.mark.slow
def test_of_two_xi_that_draw_one_radius_the_one_meant_counts():
    """Radii of a law of two parts begin at 0 anew: its samplers are as far from exact light as its cdf, not as the jump
    is high."""
    [one] = [one for one in profile_laws(FITS, matched=False) if one.label == "hazard-forward"]
    quality = profile_quality(one.law, [0.9])
    for sampler in measured_samplers(one, [0.9]):
        assert 0.3 * quality.ks[0] < sampler.exact_error[0] < 1.1 * quality.ks[0]
        assert abs(sampler.quality.edge_bias[0]) < 1e-6
    xi = np.linspace(0.0, 0.999, 100)
    drawn = one.law.sampler.sample(xi, 0.9)
    assert np.max(np.abs(exact.cdf(drawn, 0.9, setting=one.setting) - xi)) > 0.1, "without it"


def test_markdown_has_a_line_a_law(folder):
    laws = profile_laws(folder, ["burley-whole"])
    [(law, quality)] = tables.for_each(lambda one: profile_quality(one.law, ALPHA), laws)
    [[cells]] = parsed(tables.markdown_laws([(law, quality)]))
    home = tuple(cells[key] for key in ("model", "constants", "illumination", "n"))
    assert home == ("burley", "burley-whole", "searchlight", "1")
    assert float(cells["mean error of R_d [%]"]) == pytest.approx(100 * quality.rel.mean(), rel=0.06)
    ks = float(cells["largest error of cumulative energy [%]"])
    assert ks == pytest.approx(100 * quality.ks.max(), rel=0.06)


def test_maps_under_their_own_light(folder):
    lines = printed(every_law(measured(folder, ["albedo-rational"])))
    [row] = [line.split() for line in lines if line.startswith("albedo-rational ")]
    assert row[1:3] == ["searchlight", "1"]
    assert float(row[3]) < 5e-6
    assert row[6:] == ["yes", "1", "nowhere", "0"]


def sampler_lines(width: int, **given) -> list[str]:
    measures = {field.name: np.zeros(2) for field in fields(SamplerQuality)} | {"alpha": np.array([0.5, 0.9])}
    quality = SamplerQuality(**(measures | {name: np.array(values) for name, values in given.items()}))
    return printed(tables.sampler_tables({"a sampler": quality}), width)


def test_numbers_of_samplers_the_worst_last_and_infinity():
    lines = sampler_lines(
        100, edge_bias=[-0.125, 0.01], bias_by_law_pdf=[0.0, np.inf], atom=[0.0154, 0.0], variance=[3e-7, 8.33]
    )
    assert lines[0] == "Sampler: a sampler"
    rows = {line.split()[0]: line.split()[1:] for line in lines[3:6]}
    assert rows["0.500"] == ["0", "0.015", "0", "0", "-0.12", "0", "0"]
    assert rows["0.900"] == ["0", "0", "0", "∞", "0.010", "0", "8.3"]
    assert rows["worst"] == ["0", "0.015", "0", "∞", "-0.12", "0", "8.3"]
    narrow = sampler_lines(80, edge_bias=[-0.1234, 1e-5], variance=[0.1, 123.0])
    assert max(map(len, narrow)) <= 80
    assert "…" not in "".join(narrow)
