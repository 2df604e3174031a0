"""What checks found, as tables: who passes, what is broken and where."""

from profilefit.recipes import catalogue
from profilefit.report.tables import check_tables
from profilefit.shader.check.bounds import Bound, ModelError
from profilefit.shader.check.chosen import Checked
from profilefit.shader.check.dense_grid import Count, Spread
from profilefit.shader.check.law_check import CDF, OWN, PROFILE, SAMPLE, LawCheck, MapCheck
from profilefit.shader.check.law_cost import WORKS, Cost
from tests.unit.report.test_tables import rendered

FITS = catalogue.fits_folder()
NONE = Count(0, 0, 0, 0)
GOOD, BAD = Bound("float32 rel", 1e-6, 1e-4), Bound("float32 ks", 0.02, 0.001, "r/l 2, α 0.5")
COSTS = {"hazard": Cost(dict.fromkeys(WORKS, 3.0), dict.fromkeys(WORKS, 2.5))}


def law(*bounds, name="hazard-refracting"):
    spread = Spread(1e-7, 2e-7, 3e-7, "r/l 2, α 0.5")
    rounding = {"rel": 1e-6, "ks": 2e-7, "inversion_error": 4e-7}
    spreads = {PROFILE: spread, CDF: spread, SAMPLE: spread, OWN: spread}
    model = ModelError({"rel": 0.049, "ks": 0.0096}, name)
    return LawCheck(catalogue.find(name, FITS), model, rounding, {"rel": 0.05}, NONE, NONE, bounds, spreads)


def mapped(*bounds):
    one = catalogue.find("albedo-rational-refracting", FITS)
    errors = {"delta_A": 1e-7, "delta_alpha": 2e-7}
    return MapCheck(one, ModelError({"delta_A": 4e-4}, one.label), errors, {}, NONE, Count(0, 0, 0, 7), bounds, {})


def found(*laws, costs=COSTS):
    return Checked(list(laws), [mapped(GOOD)], costs, [], "a device", "")


def test_a_line_a_law_says_whether_it_passes():
    """A record that says nothing of the sampler shows nothing of it."""
    silent = law(GOOD)
    del silent.spreads[SAMPLE], silent.spreads[OWN]
    laws = [law(GOOD), law(GOOD, BAD), silent]
    text = rendered(check_tables.check_tables(found(*laws)), 100)
    rows = [line.split() for line in text.splitlines() if "-refracting" in line]
    assert " ".join(rows[0]) == "hazard-refracting 1.4 0.049 1.0e-06 0.0096 2.0e-07 4.0e-07 2.0e-07 0 0 pass"
    assert (rows[1][-1], rows[2][6:8]) == ("FAIL", ["–", "–"])
    assert " ".join(rows[3]) == "albedo-rational-refracting 1.4 0.00040 1.0e-07 – 2.0e-07 0 7 pass"
    assert "a device" in text


def test_broken_bounds_are_lines_that_say_where_and_by_how_much():
    lines = [line.plain for line in check_tables.verdict_lines([law(GOOD, BAD), law(GOOD), mapped(GOOD)])]
    assert lines == [
        "FAIL hazard-refracting, n = 1.4: float32 ks: 0.02 at r/l 2, α 0.5; bound 0.001, 20 times that",
        "3 laws or maps: 1 fail",
    ]
    assert [line.plain for line in check_tables.verdict_lines([law(GOOD)])] == ["1 law or map: all pass"]


def test_the_page_has_laws_maps_and_costs():
    laws, maps, costs, device = check_tables.markdown_checks(found(law(GOOD), law(GOOD, BAD))).split("\n\n")
    assert laws.splitlines()[2:] == ["| hazard-refracting | 1.0 | 0.20 | 0.40 | 0.20 | 0/0 | FAIL |"], "a line a record"
    assert maps.splitlines()[2:] == ["| albedo-rational-refracting | 0.10 | 0.20 | 0/7 | pass |"]
    assert costs.splitlines()[2] == "| hazard | 3.0 (2.50) | 3.0 (2.50) | 3.0 (2.50) |"
    assert costs.splitlines()[0] == "| law | profile [ns] | sample [ns] | both [ns] |"
    assert device == "Measured on a device."


def test_costs_fit_into_100_columns():
    """Of the longest name, and a ratio as on a software rasteriser."""
    costs = {"burley_diffuse_mfp": Cost(dict.fromkeys(WORKS, 123.0), dict.fromkeys(WORKS, 12.25))}
    text = rendered(check_tables.check_tables(found(costs=costs)), 100)
    (row,) = (line.split() for line in text.splitlines() if line.startswith("burley_diffuse_mfp"))
    assert row == ["burley_diffuse_mfp", *["123", "(12.25)"] * len(WORKS)]


def test_json_takes_numbers_and_text_only():
    told = check_tables.content(found(law(BAD)))
    assert told["passed"] is False
    assert told["laws"][0]["setting"] == {"illumination": "searchlight", "n": 1.4, "g": 0.0}
    assert (told["laws"][0]["broken"], told["costs"]["hazard"]["ratio"]["both"]) == ([str(BAD)], 2.5)
