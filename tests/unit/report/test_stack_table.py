"""Tables of stacks say what their records say, to the digits that errors leave, on any screen."""

import copy
from collections import Counter

import pytest

from profilefit.recipes import record
from profilefit.recipes.folder import STACKS, fits_folder
from profilefit.recipes.kinds.stack import interfaces, read
from profilefit.recipes.schema import ERRORS
from profilefit.report.kinds import stack_tables
from profilefit.report.records import largest_error
from profilefit.report.tables.record_tables import record_tables
from tests.unit.report.test_tables import rendered

CONTENTS = {name: read(path) for name, path in record.available(fits_folder() / STACKS).items()}


def rows(content, table):
    """Of one of the tables: the cells of its headers, and of every line below up to the caption."""
    lines = rendered([stack_tables(content)[table]], 400).splitlines()[1:-1]
    return lines[0].split(), [line.split() for line in lines[1:]]


@pytest.mark.parametrize("name", CONTENTS)
def test_a_narrow_screen_loses_and_breaks_nothing(name):
    parts = record_tables(CONTENTS[name])
    narrow = rendered(parts, 80)
    assert max(map(len, narrow.splitlines())) <= 80
    assert Counter(narrow.split()) == Counter(rendered(parts, 400).split())


@pytest.mark.parametrize("name", CONTENTS)
def test_every_constant_has_a_row_with_its_errors(name):
    content = CONTENTS[name]
    header, found = rows(content, 2)
    known = [key for key in ERRORS if content["constants"]["red.1.w"][key] is not None]
    assert header == ["channel", "interface", "constant", "regenerated", *(w for k in known for w in ("±", ERRORS[k]))]
    assert sorted(".".join(row[:3]) for row in found) == sorted(content["constants"])
    assert [row[0] for row in found] == sorted((row[0] for row in found), key=["red", "green", "blue"].index)
    for channel, number, constant, value, *errors in found:
        one = content["constants"][f"{channel}.{number}.{constant}"]
        # Half of the second digit of the error is at most a twentieth of it; half of the third of the value 1/200.
        assert abs(float(value) - one["regenerated"]) <= max(0.05 * largest_error(one), 0.005 * abs(one["regenerated"]))
        assert list(map(float, errors)) == pytest.approx([one[key] for key in known], rel=0.05)


@pytest.mark.parametrize("name", CONTENTS)
def test_errors_at_each_thickness_and_the_worst(name):
    content = CONTENTS[name]
    _, (*found, worst) = rows(content, 1)
    shown = iter(found)
    for channel, number in interfaces(content):
        quality = content["interfaces"][channel]["quality"][number - 1]
        for d, *values in zip(*(quality[key] for key in ("thickness", "rel", "ks", "delta_A")), strict=True):
            at, of, thickness, unit, *cells = next(shown)
            assert (at, of, unit) == (channel, str(number), content["unit"])
            assert float(thickness) == pytest.approx(d, rel=0.005)
            assert list(map(float, cells)) == pytest.approx(values, rel=0.05)
    assert next(shown, None) is None
    assert worst[0] == "worst"
    rel, ks, of_a = (max(abs(float(row[column])) for row in found) for column in (4, 5, 6))
    assert list(map(float, worst[1:])) == [rel, ks, of_a]


def test_layers_and_fits_are_shown():
    content = CONTENTS["skin"]
    layers = rendered([stack_tables(content)[0]], 100).splitlines()
    assert len(layers) == 2 + 3
    assert layers[2].split() == ["epidermis", "0.25", "mm", "1.4", "0", "0.21", "0.21", "0.5", "4.8", "6", "6.5"]
    assert "infinite" in layers[4]
    _, fits = rows(content, 3)
    for (channel, number), row in zip(interfaces(content), fits, strict=True):
        one = content["interfaces"][channel]
        assert row[:2] == [channel, str(number)]
        assert one["fit"][number - 1]["result"] in " ".join(row)
        starts = one["starts"][number - 1]
        assert row[-3:] == [str(starts["as_good"]), "of", str(starts["count"])]


def test_errors_that_do_not_apply_have_no_column():
    """Exact light has no photons, traced light no nodes."""
    content = copy.deepcopy(CONTENTS["heart"])
    assert rows(content, 2)[0][4:] == ["±", "dr", "±", "misfit", "±", "jackknife"]
    for one in content["constants"].values():
        one["statistical_error"], one["discretisation_error"] = 1e-3, None
    assert rows(content, 2)[0][4:] == ["±", "photons", "±", "misfit", "±", "jackknife"]
    text = rendered(stack_tables(content), 400)
    assert "photons: noise of the simulation" in text
    assert "nodes" not in text
