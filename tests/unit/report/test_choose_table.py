"""The table of a choice: one line that answers, and three rows."""

import json
import math
from dataclasses import replace

import pytest

from mcml_sim import Setting
from profilefit.report.tables import choose_table as tables
from profilefit.studies.choose.case import NOTHING, Case, Option, Within
from profilefit.studies.choose.choice import Predicted, chosen
from profilefit.studies.choose.cost import Milliseconds, shipped
from profilefit.studies.choose.error import Error
from profilefit.studies.choose.layers import OneLayer
from profilefit.studies.choose.requirements import Budget, Requirements
from profilefit.studies.choose.scenes import FurNeed, SeaNeed
from tests.unit.report.test_tables import rendered

ONE = ((0.5, 0.5),) * 3
SCENE = Requirements("mm", Setting("diffuse", n=1.4), ONE, ONE, (0.1, 0.1), 5.0, 0.02, Within(), Budget(ms=4.0))
CURVED = Case((0.5, 0.5, 0.5), (0.5, 0.5, 0.5), 0.1, 5.0)
SAMPLED = Option("sampled", 64, name="hazard-diffuse")
LAYER = OneLayer(0.4, 0.9, 1.2, 1.4, 0.005, 0.0001, 10**6, 0.003)


def words(choice, *layers):
    """The table, its lines joined."""
    return " ".join(rendered([tables.choose_table(choice, shipped(), layers)], 100).split())


def data(choice, *layers):
    """The content as a reader of the JSON has it."""
    return json.loads(json.dumps(tables.content(choice, shipped(), layers)))


@pytest.fixture(scope="module")
def choice():
    errors = [(0.1, 0.1, 0.0, 0.001, 0.0, 0), (0.012, 0.01, 0.006, 0.001, 0.0, 1), (0.008, 0.0, 0.0, 0.001, 0.008, 2)]
    costs = [Milliseconds(2.0, 1.0, 2.5), Milliseconds(3.0, 3.0, 3.5), Milliseconds(5.0, 4.0, 8.0)]
    options = (NOTHING, Option("separable", 17), SAMPLED)
    every = zip(options, costs, errors, strict=True)
    return chosen(SCENE, [Predicted(option, cost, Error(*error, CURVED)) for option, cost, error in every])


def test_says_it_in_one_line_and_why(choice):
    text = rendered([tables.choose_table(choice, shipped(), (LAYER,))], 100)
    chosen = "The cheapest option within tolerance and budget: separable, 17 taps (requested: 2.0 % within 4 ms)"
    assert text.splitlines()[0] == chosen
    rows = {line[:12].strip(): line for line in text.splitlines()}
    cells = {
        "best cheaper": ("nothing (Lambert)", "no: error"),
        "chosen": ("1.2", "yes"),
        "next dearer": ("no: ms", "4.0 to 8.0"),
    }
    assert [cell for name, some in cells.items() for cell in some if cell not in rows[name]] == []
    told = [
        *("worst: green, pixel 0.10 mm, radius 5.0 mm; mostly its shape.", "one layer is enough", "n = 1.4."),
        "the best cheaper: red, pixel 0.10 mm, radius 5.0 mm; mostly its shape.",
        "an estimate of a frame on a gtx-1050",
    ]
    assert [one for one in told if one not in text] == []


@pytest.mark.parametrize(("error", "verdict"), [(0.014, "enough"), (0.017, "enough alone"), (0.03, "not enough")])
def test_layers_have_what_the_choice_leaves_of_the_tolerance(choice, error, verdict):
    """0.012 of 0.02 leaves 0.016, in squares."""
    assert data(choice, replace(LAYER, error=error, standard_error=0.0005))["one_layer"]["verdict"] == verdict


def test_the_worst_of_three_colours_is_told(choice):
    """Its verdict counts first, then its error; all three as data."""
    errors = {"red": (0.014, 0.0005), "green": (0.021, 0.0001), "blue": (0.022, 0.002)}
    layers = [replace(LAYER, error=error, standard_error=spread) for error, spread in errors.values()]
    text = words(choice, *layers)
    assert "Layers, of three colours, green the worst: one layer is not enough: " in text
    assert "has an error of 2.1 ± 0.010 %" in text
    made = [(one["channel"], one["error"], one["verdict"]) for one in data(choice, *layers)["one_layer"]]
    assert made == [("red", 0.014, "enough"), ("green", 0.021, "not enough"), ("blue", 0.022, "undecided")]
    assert "Layers, of three colours, red the worst: one layer is enough." in words(choice, *layers[:1] * 3)


@pytest.mark.parametrize(
    ("changed", "answer"),
    [
        ({"budget": Budget(ms=1.0)}, "2.0 % within 1 ms: the cheapest within the tolerance is separable, 17 taps"),
        ({"tolerance": 0.001, "budget": Budget()}, "0.10 %: the most accurate is hazard-diffuse, 64 samples"),
    ],
    ids=["scarce", "strict"],
)
def test_says_when_nothing_serves(choice, changed, answer):
    assert tables.headline(chosen(replace(SCENE, **changed), choice.predicted)) == f"No option meets {answer}"


def test_a_budget_within_the_range_is_likely_kept(choice):
    """3.0 ms, but 3.5 at worst."""
    tight = chosen(replace(SCENE, budget=Budget(ms=3.2)), choice.predicted)
    text = rendered([tables.choose_table(tight, shipped())], 100)
    assert "likely" in next(line for line in text.splitlines() if line.startswith("chosen"))
    assert "likely: the estimate is within the budget" in words(tight)


def test_as_data(choice):
    made = data(choice, LAYER)
    assert (made["chosen"], [one["ms"] for one in made["options"]]) == ("separable, 17 taps", [2.0, 3.0, 5.0])
    assert (made["options"][2]["ms_range"], made["one_layer"]["verdict"]) == ([4.0, 8.0], "enough")
    (one,) = made["filters"]
    assert math.isclose(sum(tap[0] for tap in one["taps"]), 1.0, rel_tol=1e-6)


def test_what_a_sea_needs_and_why():
    need = SeaNeed({"single": 0.34, "scaled": 0.056}, focus=0.8, light=1.2, view=0.25)
    assert tables.sea_lines(need) == [
        "terms: scaled; off the broadened haze at worst: single 34 %, scaled 5.6 % (requested: 10 %)",
        "splat: faces; no light folds before the floor (F 0.80)",
        "steps to a hit: sunlight 8 (S 1.2), views none, Newton alone (S 0.25)",
    ]
    assert tables.sea_content(need) == {
        "terms": "scaled",
        "haze": {"single": 0.34, "scaled": 0.056},
        "tolerance": 0.1,
        "splat": "faces",
        "focus": 0.8,
        "steps": {"light": 8, "view": 0},
        "steepness": {"light": 1.2, "view": 0.25},
    }


def test_what_fur_needs_and_which_way():
    names = ("linear", "quadratic", "fitted", "swept", "swept, two strands")
    layers = {
        45: dict(zip(names, (168, None, None, 11, 9), strict=True)),
        75: dict(zip(names, (None, None, None, 34, 20), strict=True)),
    }
    need = FurNeed(layers, 0.05)
    assert tables.fur_lines(need) == [
        "45 degrees: linear 168, quadratic none, fitted none, swept 11, swept two strands 9; cheapest: swept",
        "75 degrees: linear none, quadratic none, fitted none, swept 34, swept two strands 20; "
        "cheapest: swept two strands",
        "swept two strands, 20 layers: the cheapest to 75 degrees (requested: 5.0 % of the length)",
    ]
    told = tables.fur_content(need)
    assert (told["way"], told["layers"], told["angle"], told["most"]) == ("swept, two strands", 20, 75, 256)
    assert told["by_angle"][0] == {"angle": 45, "layers": layers[45], "cheapest": "swept"}
    none = FurNeed({75: dict.fromkeys(names)}, 0.05)
    answer = "no way is within the tolerance at 75 degrees, by 256 layers (requested: 5.0 % of the length)"
    assert (tables.fur_lines(none)[-1], tables.fur_content(none)["way"]) == (answer, None)
