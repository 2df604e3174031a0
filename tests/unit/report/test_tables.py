"""Tables, on any screen and in Markdown, say what the records say, to the digits that the errors leave."""

import copy
import io
import math
from collections import Counter

import numpy as np
import pytest
from rich.console import Console

from profilefit.recipes import catalogue, record
from profilefit.report.records import converged, known_errors, largest_error, total_error, z_score
from profilefit.report.tables import cells, quality_tables, record_tables
from profilefit.report.tables.markdown import EQUATION, markdown_constants, sections

RECORDS = {name: record.read(path) for name, path in record.available(catalogue.fits_folder()).items()}
FITS = {name: content for name, content in RECORDS.items() if "constants" in content}
REASON = "no convergence in 2000 steps: constants trade against each other"
GAPS = (None, math.nan, math.inf, 0.0, -1.0)  # no positive numbers


def rendered(parts, width: int) -> str:
    console = Console(width=width, file=io.StringIO(), highlight=False, color_system=None)
    for part in parts:
        console.print(part)
    return console.file.getvalue()


def words(part, width: int = 100) -> str:
    """What stands there, its lines joined."""
    return " ".join(rendered([part], width).split())


def narrow(parts, width: int) -> str:
    """The text, of which no word is cut, abbreviated or broken inside a number: lines only end elsewhere."""
    text = rendered(parts, width)
    assert max(map(len, text.splitlines())) <= width
    assert Counter(text.split()) == Counter(rendered(parts, 400).split())
    return text


def rounding(constant: dict) -> float:
    """Half of the second digit of the error is at most a twentieth of it; half of the third of the value 1/200."""
    return max(0.05 * (largest_error(constant) or 0.0), 0.005 * abs(constant["regenerated"]))


@pytest.mark.parametrize("width", [100, 80])
@pytest.mark.parametrize("name", RECORDS)
def test_a_narrow_screen_loses_and_breaks_nothing(name, width):
    narrow(record_tables.record_tables(RECORDS[name]), width)


@pytest.mark.parametrize("width", [100, 80])
def test_the_summary_fits_and_names_every_record(width):
    text = narrow([record_tables.summary(RECORDS)], width)
    assert [name for name in RECORDS if name not in text] == []
    assert "…" not in text


@pytest.mark.parametrize("name", FITS)
def test_constants_are_the_record_s_to_two_digits_of_their_error(name):
    content = FITS[name]
    lines = rendered([record_tables.constants_table(content)], 100).splitlines()
    headers = lines[2].split()
    known = known_errors(content["constants"].values())
    assert lines[1].split() == ["±"] * len(known)
    assert [header for header in headers if header not in ("published", "regenerated", "z")] == list(known.values())
    for constant, values in content["constants"].items():
        cells = next(line.split() for line in lines if line.split()[:1] == [constant])
        shown = dict(zip(headers, cells[1:], strict=True))
        published, regenerated, z = shown.pop("published", "–"), shown.pop("regenerated"), shown.pop("z", "–")
        score = z_score(values)
        assert z == "–" if score is None else float(z) == pytest.approx(score, rel=0.05, abs=0.05)
        assert abs(float(regenerated) - values["regenerated"]) <= rounding(values)
        assert published == "–" if values["published"] is None else float(published) == values["published"]
        if not values["free"]:
            assert list(shown.values()) == ["held", *["–"] * (len(known) - 1)]
            continue
        for text, number in zip(shown.values(), (values.get(key) for key in known), strict=True):
            assert text == "–" if number is None else float(text) == pytest.approx(number, rel=0.05)


@pytest.mark.parametrize("name", FITS)
def test_quality_shows_the_mean_and_the_worst_of_every_set(name):
    content = FITS[name]
    text = rendered(record_tables.quality_tables(content), 100)
    for values in (content["quality"][s] for s in ("published", "corrected", "regenerated") if s in content["quality"]):
        for key in ("rel", "ks", "l1", "inversion_error"):
            if key in values:
                worst = max(values[key])
                assert (f"{worst:.3f}" if worst >= 0.01 else cells.significant(worst)) in text
        if "delta_A" in values:
            assert cells.significant(values["delta_A"]) in text


def test_a_failed_fit_says_why_wherever_it_is_shown():
    name, content = next(item for item in FITS.items() if "rel" in item[1]["quality"]["regenerated"])
    broken = copy.deepcopy(content)
    broken["fit"]["result"], broken["posterior"] = REASON, {}
    for constant in broken["constants"].values():
        constant.pop("intervals", None)
    detail = " ".join(rendered(record_tables.record_tables(broken), 100).split())
    stages = record_tables.stage_tables(content["stages"]) if "stages" in content else []
    assert detail.count("FAILED") == 1 + rendered(stages, 100).count("FAILED")
    assert [one for one in (REASON, "No credible intervals", "no model") if one not in detail] == []
    shown = words(record_tables.summary({name: broken}), 200)
    assert [one for one in (REASON, "→ FAILED") if one not in shown] == []
    assert "FAILED" not in rendered([record_tables.constants_table(content)], 100)


def test_z_is_the_distance_in_the_errors_that_add():
    """The printed b0 is 70 standard errors from the one that was fitted; without a printed value there is no z."""
    lines = rendered([record_tables.constants_table(FITS["liang-whole"])], 80).splitlines()
    b0 = FITS["liang-whole"]["constants"]["b0"]
    errors = (b0[f"{of}_error"] for of in ("statistical", "discretisation", "model"))
    apart = (b0["published"] - b0["regenerated"]) / math.hypot(*errors)
    assert next(line.split()[-1] for line in lines if line.startswith("b0 ")) == f"{apart:+.0f}"
    assert "z: published minus regenerated" in " ".join(" ".join(lines).split())
    assert "z" not in rendered([record_tables.constants_table(FITS["hazard"])], 80).splitlines()[2].split()


def test_the_summary_has_the_worst_of_each_set_and_a_block_for_every_stretch_of_alpha():
    text = rendered([record_tables.summary(RECORDS)], 80)
    rows = {line.split()[0]: line for line in text.splitlines() if line.split()[:1] and line.split()[0] in RECORDS}
    assert set(rows) == set(RECORDS)
    assert "0.79 → 0.13 → 0.14" in rows["liang-whole"]
    assert set(rows["gaussians-2"].split()[-1]) == {"█"}, "the worst of all, everywhere"
    assert set(rows["hazard-diffuse"].split()[-1]) <= {"▁", "▂"}
    assert "5 of 8 reproduced" in rows["reproduction"]


def test_a_record_shows_its_errors_over_alpha():
    (table,) = quality_tables.spark_table(FITS["liang-whole"])
    rows = [line.split() for line in rendered([table], 80).splitlines()[2:-1]]
    assert [row[:2] for row in rows[:3]] == [["rel", "published"], ["rel", "corrected"], ["rel", "regenerated"]]
    quality = FITS["liang-whole"]["quality"]
    for measure, which, blocks, least, most in rows:
        assert len(blocks) == len(quality["alpha"])
        assert float(least) == pytest.approx(min(quality[which][measure]), rel=0.06)
        assert float(most) == pytest.approx(max(quality[which][measure]), rel=0.06)
    assert quality_tables.spark_table(FITS["albedo-rational"]) == []


def test_three_errors_are_reported_separately_and_old_records_have_none_of_it():
    content = copy.deepcopy(FITS["hazard"])
    content.pop("discrepancy", None)
    for number, constant in enumerate(content["constants"].values()):
        constant["discretisation_error"] = constant["model_error"] = None
        if number == 0:
            constant |= {"statistical_error": 0.0011, "discretisation_error": 0.0022, "model_error": 0.033}
    line = next(x for x in rendered([record_tables.constants_table(content)], 80).splitlines() if x.startswith("a0 "))
    assert line.split()[2:5] == ["0.0011", "0.0022", "0.033"]
    process = {"amplitude": 0.0123, "amplitude_error": 0.0011, "length_r": 2.0, "length_s": 0.5, "rms": 0.009}
    told = {**content, "discrepancy": {**process, "gain": None, "result": "found"}}
    text = words(record_tables.fit_facts(told))
    assert "discrepancy amplitude 0.0123 ± 0.0011; residuals 0.0090 rms" in text
    assert "correlation length 0.50 in √(1 − α), 2.0 in ln r; found" in text
    for constant in content["constants"].values():
        del constant["discretisation_error"], constant["model_error"]
    old = rendered([record_tables.constants_table(content), record_tables.fit_facts(content)], 80)
    assert "± dr" not in old
    assert "amplitude" not in old


def test_a_chain_that_is_too_short_says_so_and_brackets_of_units_are_no_markup():
    content = copy.deepcopy(next(content for content in FITS.values() if converged(content)))
    kind = next(iter(content["posterior"]))
    content["posterior"][kind]["result"] = "chain of 1000 steps is under 50 autocorrelation times (90)"
    assert "FAILED: chain of 1000 steps is under 50" in rendered([record_tables.fit_facts(content)], 100)
    content["title"] = content["note"] = "lengths in [mfp], [bold]not bold[/bold]"
    assert rendered(record_tables.record_tables(content), 200).count("[bold]not bold[/bold]") == 2


def test_readings_are_shown_best_first():
    far = {"equation": "(8)", "choices": "far", "constants": {}, "published": {}, "verdict": "no"}
    far |= {"curve_distance": 0.5, "constant_distance": None}
    near = {**far, "choices": "near", "constants": {"p": 5.63}, "published": {"p": 5.67}, "curve_distance": 0.004}
    models = (("red", "normalized diffusion", [1.0, 0.9, 1.02]), ("red", "paper", [0.7]))
    models += (("blue", "normalized diffusion", [9.0]),)
    names = ("channel", "model", "mse_over_printed")
    rows = [{"material": "apple", **dict(zip(names, one, strict=True))} for one in models]
    text = rendered(record_tables.evidence_tables({"readings": [far, near], "table1": rows}), 100)
    assert text.index("near") < text.index("far")
    assert [one for one in ("p 5.63 (printed 5.67)", "0.4 %", "0.700") if one not in text] == []
    # The channel is chosen by the other law's error, never by this one's.
    assert "blue" not in text
    assert "no readings" in rendered(record_tables.evidence_tables({"readings": [], "table1": []}), 100)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (5.22099, 0.345, "5.22"),
        (0.0522566, 0.0037542, "0.0523"),
        (-0.00629419, 0.000162281, "-0.00629"),
        (1.33888, 0.0782, "1.339"),
        (11.267, 18.3, "11.3"),  # an error above the value still leaves three digits of where the fit ended
        (15.3278, 0.0996, "15.33"),  # two digits of 0.0996 are 0.10
        (193779.0, 24.0, "193779"),
        (-6.39e-05, 0.00037, "-6.39e-05"),
        (0.0, None, "0.00"),
        (None, 1.0, "–"),
    ],
)
def test_digits_end_with_those_of_the_error(value, error, text):
    assert cells.to_error(value, error) == text


def test_decimal_points_stand_in_one_column_and_an_interval_has_two_digits_of_its_half_width():
    assert cells.interval((0.0621350586906, 0.0625785745179)) == "0.06214 … 0.06258"
    assert cells.interval(None) == "–"
    padded = cells.on_the_point(["-0.0064", "14.0", "30", "1.2e-05", "–"])
    from_right = {len(text) - (text.index(".") if "." in text else len(text.rstrip())) for text in padded}
    assert from_right == {len(".2e-05")}
    assert [text.strip() for text in padded] == ["-0.0064", "14.0", "30", "1.2e-05", "–"]


def test_second_opinions_are_told():
    """How many random starts reach the best optimum, and whether photons agree with the exact profile."""
    content = RECORDS["hazard"]
    text = words(record_tables.fit_facts(content))
    tried, check = content["starts"], content["crosscheck"]
    best = round(tried["share_best"] * tried["count"])
    assert f"{best} of {tried['count']} reach the best optimum" in text
    others = [o["count"] for o in tried["outcomes"] if o["cost_ratio"] is None or o["cost_ratio"] > 1 + 1e-6]
    assert sum(others) == tried["count"] - best
    assert all(f"{count}: " in text for count in others)
    assert f"photons {check['result']}" in text
    assert f"in {check['rank']} directions" in text
    assert "random starts" not in rendered([record_tables.fit_facts(RECORDS["gaussians-6"])], 100)


@pytest.mark.parametrize("name", ["hazard-refracting", "albedo-rational-diffuse-refracting", "hazard-forward"])
def test_a_record_that_spans_indices_shows_its_worst_at_each(name):
    content = RECORDS[name]
    found = content["quality"]["by_index"]
    lines = rendered(record_tables.record_tables(content), 100).splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("By refractive index"))
    rows = [line.split() for line in lines[start + 2 : start + 2 + len(found["n"])]]
    keys = [key for key in ("rel", "largest", "ks", "delta_A") if key in found]
    places = [name for name in ("n", "g") if name in found]
    for i, row in enumerate(rows):
        assert [float(cell) for cell in row] == pytest.approx([found[key][i] for key in (*places, *keys)], rel=0.06)
    has_g = "cosines" in content
    text = " ".join(" ".join(lines).split())
    assert ("every n in (1.3, 1.5]" if has_g else "every n in (1, 1.6]") in text
    assert ("every g in (0, 0.95]" in text) == has_g
    ends = ", n = 1.4, g = 0.9" if has_g else ", n = 1.4"
    assert any(line.startswith("Errors") and line.rstrip().endswith(ends) for line in lines)
    worst = quality_tables.worst_measures(content)[keys[0]]["regenerated"]
    assert worst == max(*found[keys[0]], *np.atleast_1d(content["quality"]["regenerated"][keys[0]]))


LOW, HIGH, POWERS = cells.BLOCKS[0], cells.BLOCKS[-1], [10.0**power for power in range(8)]
ONE_HIGH = [1.0] * 13 + [1e7] + [1.0] * 10
SPARKS = {
    "powers of ten are even steps": (POWERS, POWERS, cells.BLOCKS),
    "and back": (POWERS[::-1], POWERS, cells.BLOCKS[::-1]),
    "beyond the ends it stays at them": ([1e-9, 9.0], [1e-4, 1.0], LOW + HIGH),
    "of many values the largest of each stretch is shown": (ONE_HIGH, POWERS, LOW * 6 + HIGH + LOW * 5),
    "few are a block each": ([1.0] * 5, POWERS, LOW * 5),
    "equal numbers have no scale": ([2.0, 2.0], [2.0, 2.0], LOW * 2),
    "none": ([], [], ""),
    **{f"{nothing} is a gap": ([1.0, nothing, 10.0], [1.0, 10.0], f"{LOW} {HIGH}") for nothing in GAPS},
    **{f"{nothing} has no scale": ([nothing] * 2, [nothing] * 2, "  ") for nothing in GAPS},
}


@pytest.mark.parametrize(("values", "scale", "blocks"), SPARKS.values(), ids=SPARKS)
def test_blocks_show_numbers_on_a_logarithmic_scale(values, scale, blocks):
    assert cells.spark(values, cells.span([scale]), 12) == blocks


def test_one_scale_for_several_rows():
    good, bad = [1e-4, 2e-4], [0.5, 1.0]
    ends = cells.span([good, bad])
    assert ends == (1e-4, 1.0)
    assert max(cells.spark(good, ends)) < min(cells.spark(bad, ends))


# Markdown


def parsed(text: str) -> list[list[dict[str, str]]]:
    """Every table of a markdown text, each row by its headers."""
    found = []
    for block in text.split("\n\n"):
        lines = [line for line in block.splitlines() if line.startswith("|")]
        if len(lines) < 3:
            continue
        rows = [[cell.strip() for cell in line.replace(r"\|", "¦").strip("|").split("|")] for line in lines]
        assert all(set(cell) <= set(":-") for cell in rows[1])
        found.append([dict(zip(rows[0], row, strict=True)) for row in rows[2:]])
    return found


SAMPLED = "largest error of the sampled energy [%]"


def quality_rows(records) -> list[dict[str, str]]:
    found = sections(records)
    return [row for name in ("inversion", "maps") for row in parsed(found[name])[0]]


def test_constants_read_back_those_of_the_paper_s_laws_with_their_equation():
    [rows] = parsed(markdown_constants(RECORDS))
    by_key = {(row["equation"], row["constant"]): row for row in rows}
    assert len(rows) == len(by_key)
    fits = {name: content for name, content in FITS.items() if converged(content)}
    shown = [row[column] for row in rows for column in ("paper's protocol", "whole profile") if row[column] != "–"]
    assert len(shown) == sum(len(content["constants"]) for content in fits.values())
    for name, content in fits.items():
        column = "paper's protocol" if name.endswith("-as-published") else "whole profile"
        for constant, values in content["constants"].items():
            is_liang = content["law"] == "liang"
            row = by_key[EQUATION[constant] if is_liang else name.removesuffix("-whole"), constant]
            value, sign, *error = row[column].split()
            assert abs(float(value) - values["regenerated"]) <= rounding(values)
            assert sign == ("±" if values["free"] else "(fixed)")
            if values["published"] is not None:
                assert float(row["published"]) == values["published"]
            if values["free"]:
                assert float(*error) == pytest.approx(total_error(values) or largest_error(values), rel=0.05)
    assert {EQUATION[name] for name in ("p", "a1", "b0", "c3", "h1")} == {"(8)", "(11)", "(13)", "(15)", "(20)"}


def test_a_failed_fit_has_a_reason_and_no_constants():
    name = "liang-as-published"
    records = {**RECORDS, name: FITS[name] | {"fit": FITS[name]["fit"] | {"result": "no convergence in 9 steps"}}}
    text = markdown_constants(records)
    assert f"{name} has no constants to show: no convergence in 9 steps" in text
    [rows] = parsed(text)
    assert {row["paper's protocol"] for row in rows if row["equation"] == "(13)"} == {"–"}
    assert name not in {row["record"] for row in quality_rows(records)}


def test_quality_reads_back_with_printed_sets_once():
    rows = quality_rows(RECORDS)
    of_profiles = [(row["record"], row["constants"]) for row in rows if SAMPLED in row]
    assert len(set(of_profiles)) == len(of_profiles) > 0
    for row in rows:
        if row["constants"] != "regenerated":
            continue
        quality = FITS[row["record"]]["quality"]["regenerated"]
        if "error of A" in row:
            assert float(row["error of A"]) == pytest.approx(quality["delta_A"], rel=0.05)
            assert row["monotone"] == ("yes" if quality["monotone"] else "no")
        else:
            largest = 100 * max(quality["inversion_error"])
            assert float(row[SAMPLED]) == pytest.approx(largest, rel=0.05)


def test_the_short_table_says_which_index():
    assert "| hazard-refracting, n = 1.4 |" in sections(RECORDS)["short"]
