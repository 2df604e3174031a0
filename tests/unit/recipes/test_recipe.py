"""Recipes and declared files: the shipped ones read; a mistake is one line with file, key and what is accepted."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import pytest
from pydantic import Field, model_validator

from mcml_sim import Setting
from profilefit.errors import InputError, RecipeError, SettingError
from profilefit.fitting.estimate import OBJECTIVES
from profilefit.laws import map_classes, profile_classes
from profilefit.recipes.declared import LISTED, Declared, NumberRange, Refused, Shares, Text, at
from profilefit.recipes.declared import words as in_words
from profilefit.recipes.folder import available, fits_folder
from profilefit.recipes.kinds import albedo_map, law
from profilefit.recipes.recipe import find, read
from profilefit.recipes.record import PIPELINES, record_name, spanning_name
from profilefit.recipes.targets import require_known
from tests.fixtures import refused

GOOD = """
title = "A fit"
law = "liang"
equations = "(7)"
pipeline = "profile"
truth = "exact"
start = "published"

[albedos]
low = 0.1
high = 0.9
count = 9
spacing = "alpha"

[rings]
first = 0.01
last = 30
count = 20

[weighting]
objective = "energy"
energy_limit = 3.0
"""
EVEN = (
    GOOD.replace('"profile"', '"as-published"').replace('"energy"', '"radial"').replace("first = 0.01", "dr = 0.05")
).replace("count = 20\n", "")
INVERSE = (
    GOOD.replace('"profile"', '"inverse"').replace('"energy"', '"share"').replace("energy_limit = 3.0", "shares = 64")
)
_, ALBEDOS, RINGS, LAST = re.split(r"(?=^\[)", GOOD, flags=re.MULTILINE)
TRUTH, DIFFUSE, SPANS = 'truth = "exact"', 'illumination = "diffuse"', "indices = [1.33, 1.4, 1.45]\n"
CHECKED = GOOD.replace(TRUTH, f'{TRUTH}\ncheck = "orders"\nrandom_starts = 50')


def with_setting(*lines, good=GOOD):
    return good.replace("[albedos]", "[setting]\n{}\n\n[albedos]".format("\n".join(lines)))


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


SHIPPED = available(fits_folder(), "toml")


@pytest.mark.parametrize("path", SHIPPED.values(), ids=SHIPPED)
def test_every_shipped_recipe_reads_and_is_named_after_its_setting(path):
    """So the catalogue finds its record, and no other."""
    recipe = read(path)
    assert recipe.name == path.stem
    assert recipe.title
    assert recipe.law in {**profile_classes(), **map_classes()}
    assert recipe.weighting.objective in {**OBJECTIVES, "": None}
    suffix = (spanning_name if recipe.indices else record_name)("", recipe.setting)
    assert path.stem.endswith(suffix)
    if not suffix:
        assert not re.search(r"-diffuse|-n\d", path.stem)


def test_every_objective_has_a_pipeline_and_the_other_way_round():
    assert {"liang-whole", "liang-as-published", "burley-whole", "albedo-rational"} <= set(SHIPPED)
    named = [objective for objectives, _ in PIPELINES.values() for objective in objectives]
    assert sorted(named) == sorted(OBJECTIVES)
    assert list(PIPELINES) == [*albedo_map.PIPELINES, *law.PIPELINES]


def test_a_good_recipe_holds_what_its_file_says(write):
    recipe = read(write(GOOD))
    assert (recipe.name, recipe.law, recipe.pipeline, recipe.truth) == ("mine", "liang", "profile", "exact")
    assert (recipe.albedos.low, recipe.albedos.high, recipe.albedos.count, recipe.rings.last) == (0.1, 0.9, 9, 30.0)
    assert isinstance(recipe.rings.last, float)
    assert (recipe.weighting.energy_limit, recipe.mfp, recipe.held, recipe.note) == (3.0, (1.0,), (), "")
    assert (recipe.check, recipe.random_starts, recipe.setting) == ("", 0, Setting())
    assert all(read(write(good)).law == "liang" for good in (EVEN, INVERSE))
    checked = read(write(CHECKED))
    assert (checked.check, checked.random_starts) == ("orders", 50)
    with_lists = read(write('mfp = [1, 2.5]\nheld = ["a3", "b0"]\n' + GOOD))
    assert (with_lists.mfp, with_lists.held) == ((1.0, 2.5), ("a3", "b0"))
    assert read(write(with_setting(DIFFUSE))).setting == Setting("diffuse")
    assert read(write(with_setting(DIFFUSE, good=INVERSE))).setting == Setting("diffuse")
    refracted = with_setting(DIFFUSE, "n = 1.4").replace('"exact"', '"orders"')
    assert read(write(refracted)).setting == Setting("diffuse", n=1.4)
    assert read(write(refracted.replace("n = 1.4", "n = 2"))).setting == Setting("diffuse", n=2.0)


SHARE, LIMIT, LENGTHS = "a number > 0 and <= 1", "a number in 0 ... 1000000", "a list of lengths from 0.001 to 1000"
KEYS = "title, law, equations, pipeline, truth, start, setting, indices,"
COUNT, STARTS = "a whole number in 3 ... 1000", "random_starts must be a whole number in 0 ... 1000, got"
TEXT = "a text of 1000 characters at most"
# A key, the line of a good recipe that says it or after which it may stand, what it must be; what is given, as shown.
VALUES = [
    ("title", 'title = "A fit"', TEXT, {"": "nothing", "7": "7"}),
    ("[weighting] objective", 'objective = "energy"', TEXT, {"": "nothing"}),
    ("[albedos] low", "low = 0.1", SHARE, {"": "nothing", '"a tenth"': "'a tenth'", "true": "True"}),
    ("[albedos] low", "low = 0.1", SHARE, {"0.0": "0.0", "nan": "nan"}),
    ("[albedos] high", "high = 0.9", SHARE, {"1.1": "1.1"}),
    ("[albedos] count", "count = 9", COUNT, {one: one for one in ("9.5", "2", "1001")}),
    ("[albedos] count", "count = 9", COUNT, {f"0x1{'0' * 5000}": "one of more than 4300 digits"}),
    ("[albedos] spacing", 'spacing = "alpha"', "one of alpha, reflectance, sqrt(1-alpha)", {'"even"': "'even'"}),
    ("held", TRUTH, "a list of texts of 1000 characters at most", {'"a3"': "'a3'"}),
    ("truth", TRUTH, "one of orders, exact", {'"hearsay"': "'hearsay'"}),
    ("objective", 'objective = "energy"', "one of energy, relative", {'"beauty"': "'beauty'", '"radius"': "'radius'"}),
    ("mfp", TRUTH, LENGTHS, {one: one for one in ("1.0", "[1.0, 0.0]", "[-1]", "[inf]", "[]")}),
    ("mfp", TRUTH, LENGTHS, {'["far"]': "['far']", "[true]": "[True]", "[1e300]": "[1e+300]", "[1e-9]": "[1e-09]"}),
    ("mfp", TRUTH, "a list of different lengths", {"[1, 2, 1.0]": "[1.0, 2.0, 1.0]"}),
    ("[rings] first", "first = 0.01", "a number >= 0", {"-0.01": "-0.01"}),
    ("[rings] first", "first = 0.01", "at least 0.0025 mfp", {"0.001": ""}),
    ("[rings] last", "last = 30", "beyond the first ring and within 1000 mfp", {"0.005": "0.005"}),
    ("[rings] last", "last = 30", "a number > 0 and <= 1000", {"1e4": "10000.0", "nan": "nan"}),
    ("[rings] count", "count = 20", "a whole number in 0 ... 1000", {"5000": "5000"}),
    ("[rings] count", "count = 20", "a whole number in 3 ... 1000", {"2": "2"}),
    ("[rings] trim", "last = 30", "one of r R_d, R_d, none", {'"R"': ""}),
    ("[rings] epsilon", "last = 30", "a number in (0, 1)", {"1.0": "1.0"}),
    ("[rings] dr", "last = 30", "a number >= 0", {"-0.1": "-0.1"}),
    ("[weighting] energy_limit", "energy_limit = 3.0", LIMIT, {"-3.0": "-3.0", "nan": "nan"}),
    ("[weighting] source_limit", "energy_limit = 3.0", LIMIT, {"inf": "inf", "1e7": "10000000.0"}),
    ("[weighting] shares", "energy_limit = 3.0", "a whole number in 0 ... 10000", {"-1": "-1"}),
    ("[weighting] last_share", "energy_limit = 3.0", SHARE, {"0.0": "0.0"}),
]  # fmt: skip


def of_value(key, line, accepted, given, got):
    """The line and what takes its place, and the words of the mistake."""
    said = f"{key.rpartition(' ')[2]} = {given}" * bool(given)
    new = said if line.startswith(key.rpartition(" ")[2]) else f"{line}\n{said}"
    return line, new, f"{key} must be {accepted}, got {got}" if got else f"{key} must be {accepted}"


# In a good recipe, a piece and what takes its place.
IN_GOOD = [
    *(of_value(*row, *case) for *row, cases in VALUES for case in cases.items()),
    ('law = "liang"', 'lore = "liang"', f"keys must be of {KEYS}"),
    ('spacing = "alpha"', 'spaces = "alpha"', "[albedos] keys must be of low, high, count, spacing, got 'spaces'"),
    (LAST, "[[weighting]]\n", "weighting must be a table [weighting], got"),
    ('pipeline = "profile"', 'pipeline = "magic"', "pipeline must be one of albedo, profile, as-published"),
    ("low = 0.1", "low = 0.9", "[albedos] high must be a number > low, which is 0.9, and <= 1, got 0.9"),
    ("first = 0.01", "first = 0.01\ndr = 0.1", "either dr > 0 or both first > 0 and count > 0"),
    ("energy_limit = 3.0", f"energy_limit = {10**400}", "401 digits, of 300 at most, of 'energy_limit' (at line"),
    ("count = 9", f"{'x' * 5000} = 9", "[albedos] keys must be of low, high, count, spacing, got 'xxx"),
    ("\ntitle", '\nsetting = "diffuse"\ntitle', "setting must be a table [setting], got 'diffuse'"),
    (RINGS, "", "mine.toml: a recipe of pipeline 'profile' needs a table [rings]"),
    (ALBEDOS, "", "mine.toml: missing [albedos]"),
    (LAST, "", "mine.toml: missing [weighting]"),
]  # fmt: skip
SHARES = "[weighting] shares must be a whole number in 1 ... 10000 of pipeline 'inverse'"
AT_N = {
    "[1.1, 1.2, 1.4]": "indices must be at least 4, got [1.1, 1.2, 1.4]",
    "[1.0, 1.1, 1.2, 1.4]": "indices must rise, each in (1, 3], got [1.0, 1.1, 1.2, 1.4]",
    "[1.1, 1.1, 1.2, 1.4]": "indices must rise, each in (1, 3], got [1.1, 1.1, 1.2, 1.4]",
    "[1.1, 1.2, 1.3, 1.5]": "[setting] n must be one of the indices [1.1, 1.2, 1.3, 1.5], got 1.4",
    '["a"]': "indices must be a list of finite numbers",
}
FORWARD = "indices must be in [1.33, 1.45] where there are cosines"
AT_G = {
    "indices = [1.2, 1.3, 1.4]\ncosines = [0.1, 0.5, 0.9]": FORWARD,
    "cosines = [0.1, 0.5, 0.9]": f"{FORWARD}, got []",
    f"{SPANS}cosines = [0.5, 0.9]": "cosines must rise, at least 3 in (0, 0.95], got [0.5, 0.9]",
    f"{SPANS}cosines = [0.9, 0.5, 0.1]": "cosines must rise",
    f"{SPANS}cosines = [0.1, 0.8, 0.97]": "cosines must rise",
    f"{SPANS}cosines = [0.1, 0.5, 0.8]": "[setting] g must be one of the cosines",
}
# Of the light, indices and mean cosines that a recipe is for: lines before it, those of [setting], and words.
IN_SETTING = [
    ("", 'illumination = "lamp"', "[setting] illumination must be one of searchlight, diffuse, got 'lamp'"),
    ("", "illumination = 1", f"[setting] illumination must be {TEXT}, got 1"),
    ("", "n = 0", "[setting] n must be a refractive index > 0, got 0.0"),
    ("", "n = nan", "[setting] n must be a finite number, got nan"),
    ("", 'n = "glass"', "[setting] n must be a finite number, got 'glass'"),
    ("", "g = 1.0", "[setting] g must be a mean cosine in (-1, 1), got 1.0"),
    ("", "g = 0.5", "[setting] g must be 0 where there are no cosines, got 0.5"),
    ("", "eta = 1.4", "[setting] keys must be of illumination, n, g, got 'eta'"),
    ("", "n = 0.9", "[setting] n must be at least 1 where truth is 'exact' (use truth = \"orders\"), got 0.9"),
    *((f"indices = {given}\n", "n = 1.4", words) for given, words in AT_N.items()),
    *((f"{given}\n", "n = 1.4\ng = 0.9", words) for given, words in AT_G.items()),
]
N, ORDERS = "[setting]\nn = 1.4\n\n[albedos]", GOOD.replace('"exact"', '"orders"')
MISTAKES = [
    *((GOOD, *row) for row in IN_GOOD),
    *((f"{head}{GOOD}", "[albedos]", f"[setting]\n{lines}\n\n[albedos]", words) for head, lines, words in IN_SETTING),
    (
        EVEN, "[albedos]", f"[setting]\n{DIFFUSE}\n[albedos]",
        "setting of pipeline 'as-published' must be searchlight, n = 1, g = 0, got diffuse, n = 1, g = 0",
    ),
    (INVERSE.replace('"exact"', '"orders"'), "[albedos]", N, "[setting] n must be 1 of pipeline 'inverse', got 1.4"),
    (
        ORDERS.replace('"alpha"', '"reflectance"'), "[albedos]", N,
        "[albedos] spacing must be alpha or sqrt(1-alpha) where n is not 1 but 1.4, got 'reflectance'",
    ),
    (CHECKED, 'check = "orders"', 'check = "exact"', "check must be 'orders' or absent, got 'exact'"),
    (CHECKED, TRUTH, 'truth = "orders"', 'check needs truth = "exact": it compares the photons with it, got'),
    *((CHECKED, "random_starts = 50", f"random_starts = {got}", f"{STARTS} {got}") for got in (-1, 1001, 5.5)),
    (EVEN, "\ntitle", "\nrandom_starts = 5\ntitle", "pipeline 'as-published' takes neither check nor random_starts"),
    (EVEN, "dr = 0.05", "dr = 1e-9", "last * mfp / dr between 3 and 4000 rings, got last = 30.0, mfp = 1.0, dr ="),
    (EVEN, "dr = 0.05", "dr = 20", "last * mfp / dr between 3 and 4000 rings"),
    (EVEN, TRUTH, f"{TRUTH}\nmfp = [1, 10]", "got last = 30.0, mfp = 10.0, dr = 0.05"),
    (EVEN, TRUTH, f"{TRUTH}\nmfp = [0.5, 2]", "must contain 1.0, got [0.5, 2.0]"),
    (INVERSE, "shares = 64", "shares = 0", SHARES),
    (INVERSE, "shares = 64", "", SHARES),
    ("", "", "\nthis is no recipe\n", r"mine.toml: is not TOML: "),
]  # fmt: skip


@pytest.mark.parametrize(
    ("good", "old", "new", "words"), MISTAKES, ids=[f"{old[:20]} -> {new[:40]}" for _, old, new, _ in MISTAKES]
)
def test_a_mistake_is_one_line(write, good, old, new, words):
    assert good.count(old) == 1, "the piece to spoil must be there, once"
    path = write(good.replace(old, new))
    said = refused(re.escape(words), read, path, error=RecipeError)
    assert said.startswith(str(path))
    assert "this is no" not in new or "line 2" in said


def test_indices_and_cosines_are_read_and_photons_have_one_index(write):
    text = f"indices = [1.02, 1.2, 1.4, 1.6]\n{with_setting('n = 1.4')}"
    found = read(write(text))
    assert (found.indices, found.span) == ((1.02, 1.2, 1.4, 1.6), (1.0, 1.6))
    assert read(write(text.replace("1.02", "1.1"))).span == (1.1, 1.6)
    with pytest.raises(RecipeError, match=r"indices need truth = \"exact\" and pipeline 'albedo' or 'profile'"):
        read(write(text.replace('"exact"', '"orders"')))
    found = read(write(f"{SPANS}cosines = [0.1, 0.5, 0.9]\n{with_setting('n = 1.4', 'g = 0.9')}"))
    assert (found.cosines, found.span) == ((0.1, 0.5, 0.9), (1.3, 1.5))
    assert found.settings == tuple(Setting(n=n, g=g) for n in (1.33, 1.4, 1.45) for g in (0.1, 0.5, 0.9))


def test_pipelines_take_what_they_can_fit(write):
    """The laws that their objectives see, the fewest and the most rings, and none where albedos are fitted."""
    for good, laws in ((EVEN, "'as-published' must be liang"), (INVERSE, "'inverse' must be liang or quantile")):
        require_known(read(write(good)))
        with pytest.raises(RecipeError, match=f"law of pipeline {laws}, got 'burley'"):
            require_known(read(write(good.replace('law = "liang"', 'law = "burley"'))))
    for dr, last in ((0.05, 0.15), (0.01, 40.0)):
        rings = read(write(EVEN.replace("dr = 0.05", f"dr = {dr}").replace("last = 30", f"last = {last}"))).rings
        assert (rings.dr, rings.last) == (dr, last)
    text = GOOD.replace(RINGS, "").replace('"profile"', '"albedo"').replace('"energy"', '"albedo"')
    assert read(write(text)).rings is None


def test_a_file_that_cannot_be_read(tmp_path):
    """A name that is no printable line would name the record, which nothing could read."""
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "a\nb.toml").write_text(GOOD)
    for name, words in (
        ("gone.toml", r"gone\.toml: there is no such recipe"),
        ("folder.toml", r"folder\.toml: expected a file that can be read, got: Is a dir"),
        ("a\nb.toml", r"the name of a recipe must be one printable line"),
    ):
        refused(words, read, tmp_path / name, error=RecipeError)


def test_find_by_name_or_path(write, tmp_path):
    path = write(GOOD)
    write(GOOD, "another.toml")
    assert list(available(tmp_path, "toml")) == ["another", "mine"]
    assert (find("mine", tmp_path), find(str(path), Path("/")).path) == (read(path), path)
    with pytest.raises(RecipeError, match=r"recipe must be one of another, mine or a \.toml file, got 'yours'"):
        find("yours", tmp_path)
    refused(r"one of \(none\) or a \.toml file", find, "yours", tmp_path / "empty", error=RecipeError)
    assert issubclass(RecipeError, InputError)


# Declared files of any kind


class Lamp(Declared):
    colour: Shares = (1.0, 1.0, 1.0)
    reach: Annotated[float, Field(gt=0.0, allow_inf_nan=True)] = math.inf
    size: Annotated[tuple[float, float], NumberRange(0.5, 4.0)] = (1.0, 1.0)


class Shelf(Declared):
    height: float
    marks: Annotated[tuple[int, ...], LISTED, in_words("whole numbers")] = ()


class House(Declared):
    name: Text = ""
    lamp: Lamp = Lamp()
    shelves: Annotated[tuple[Shelf, ...], LISTED] = ()
    floors: Annotated[int, Field(ge=1, le=9)]

    @model_validator(mode="after")
    def _stands(self):
        for number, shelf in enumerate(self.shelves):
            if shelf.height > self.floors:
                raise Refused("at most the floors", shelf.height, "shelves", number, "height")
        if self.name == "dark":
            with at("lamp"):
                raise SettingError("a dark house has no lamp")
        return self


WORDS = "a number in 0.5 ... 4, or two of them, the smaller first"
IN_A_HOUSE = [
    ({"floors": ...}, "floors must be a whole number in 1 ... 9, got nothing"),
    ({"floors": True}, "floors must be a whole number in 1 ... 9, got True"),
    ({"floors": 2.0}, "floors must be a whole number in 1 ... 9, got 2.0"),
    ({"floors": 0, "cellar": 1}, "keys must be of name, lamp, shelves, floors, got 'cellar'"),
    ({"lamp": {"colour": [1, 2, 0]}}, "[lamp] colour must be three numbers in 0 ... 1, got [1, 2, 0]"),
    ({"lamp": {"size": [2, 1]}}, f"[lamp] size must be {WORDS}, got [2, 1]"),
    ({"shelves": [{"height": 1.0, "marks": [1, "a"]}]}, "[shelves 1] marks must be whole numbers, got [1, 'a']"),
    ({"shelves": [{"height": 1}, {"height": 2}]}, "[shelves 2] height must be at most the floors, got 2.0"),
    ({"name": "dark"}, "[lamp] a dark house has no lamp"),
]


@pytest.mark.parametrize(("content", "said"), IN_A_HOUSE, ids=[said[:40] for _, said in IN_A_HOUSE])
def test_a_mistake_is_one_line_that_names_its_place(content, said):
    """Of a house with one floor, but where floors are given, or left out."""
    content = {key: value for key, value in {"floors": 1, **content}.items() if value is not ...}
    with pytest.raises(InputError, match=f"^{re.escape(f'house.toml: {said}')}$") as caught:
        House.of("house.toml", content)
    assert type(caught.value) is (SettingError if "dark" in said else InputError)
    refused("^house", House.of, "house.toml", content, RecipeError, error=RecipeError)


def test_what_is_right_is_read():
    content = {"floors": 2, "lamp": {"reach": math.inf, "size": 2, "colour": [0, 1, 0.5]}}
    house = House.of("house.toml", {**content, "shelves": [{"height": 1}]})
    assert (house.file, house.floors, house.lamp.size, house.lamp.colour) == ("house.toml", 2, (2.0, 2.0), (0, 1, 0.5))
    other = house.changed("other.toml", lamp={"reach": 1.0}, floors=3)
    assert (other.file, other.floors, other.lamp.reach, other.lamp.size) == ("other.toml", 3, 1.0, (2.0, 2.0))
    assert house.lamp.reach == math.inf
