"""Recipes: the shipped ones read, and each mistake gets one line that names file, key and what is accepted."""

import re
from pathlib import Path

import pytest

from mcml_sim import Setting
from profilefit.errors import InputError, RecipeError
from profilefit.fitting.estimate import OBJECTIVES
from profilefit.laws import map_classes, profile_classes
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import albedo_map, law
from profilefit.recipes.recipe import available, find, read
from profilefit.recipes.record import record_name, spanning_name
from profilefit.recipes.schema import PIPELINES
from profilefit.recipes.targets import require_known

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


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.fixture
def refuse(write):
    """Reads GOOD with one piece replaced, and expects one line with the file's name and the given words."""

    def check(old, new, words):
        assert GOOD.count(old) == 1, "the piece to spoil must be there, once"
        path = write(GOOD.replace(old, new))
        with pytest.raises(RecipeError, match=re.escape(words)) as caught:
            read(path)
        message = str(caught.value)
        assert message.startswith(str(path))
        assert "\n" not in message

    return check


@pytest.mark.parametrize("path", available(fits_folder()).values(), ids=lambda path: path.stem)
def test_every_shipped_recipe_reads(path):
    recipe = read(path)
    assert recipe.name == path.stem
    assert recipe.title
    assert recipe.law in {**profile_classes(), **map_classes()}
    assert recipe.weighting.objective in {**OBJECTIVES, "": None}


def test_there_are_shipped_recipes():
    assert {"liang-whole", "liang-as-published", "burley-whole", "albedo-rational"} <= set(available(fits_folder()))


def test_every_objective_has_a_pipeline_and_the_other_way_round():
    named = [objective for objectives, _ in PIPELINES.values() for objective in objectives]
    assert sorted(named) == sorted(OBJECTIVES)
    assert list(PIPELINES) == [*albedo_map.PIPELINES, *law.PIPELINES]


def test_a_good_recipe_holds_what_its_file_says(write):
    recipe = read(write(GOOD))
    assert (recipe.name, recipe.law, recipe.pipeline, recipe.truth) == ("mine", "liang", "profile", "exact")
    assert (recipe.albedos.low, recipe.albedos.high, recipe.albedos.count) == (0.1, 0.9, 9)
    assert recipe.rings.last == 30.0
    assert isinstance(recipe.rings.last, float)
    assert recipe.weighting.energy_limit == 3.0
    assert (recipe.mfp, recipe.held, recipe.note) == ((1.0,), (), "")


def test_lists_become_tuples(write):
    recipe = read(write('mfp = [1, 2.5]\nheld = ["a3", "b0"]\n' + GOOD))
    assert recipe.mfp == (1.0, 2.5)
    assert recipe.held == ("a3", "b0")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'law = "liang"',
            'lore = "liang"',
            "keys must be of title, law, equations, pipeline, truth, start, setting, indices,",
        ),
        ('spacing = "alpha"', 'spaces = "alpha"', "[albedos] keys must be of low, high, count, spacing, got 'spaces'"),
        ('title = "A fit"', "", "title must be a text of 1000 characters at most, got nothing"),
        ("low = 0.1", "", "[albedos] low must be a number > 0 and <= 1, got nothing"),
        ('objective = "energy"', "", "[weighting] objective must be a text of 1000 characters at most, got nothing"),
    ],
)
def test_keys_must_be_known_and_there(refuse, old, new, words):
    refuse(old, new, words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('title = "A fit"', "title = 7", "title must be a text of 1000 characters at most, got 7"),
        ("low = 0.1", 'low = "a tenth"', "[albedos] low must be a number > 0 and <= 1, got 'a tenth'"),
        ("low = 0.1", "low = true", "[albedos] low must be a number > 0 and <= 1, got True"),
        ("count = 9", "count = 9.5", "count must be a whole number in 3 ... 1000, got 9.5"),
        ('truth = "exact"', 'truth = "exact"\nmfp = 1.0', "mfp must be a list of lengths from 0.001 to 1000, got 1.0"),
        (
            'truth = "exact"',
            'truth = "exact"\nmfp = ["far"]',
            "mfp must be a list of lengths from 0.001 to 1000, got ['far']",
        ),
        (
            'truth = "exact"',
            'truth = "exact"\nmfp = [true]',
            "mfp must be a list of lengths from 0.001 to 1000, got [True]",
        ),
        (
            'truth = "exact"',
            'truth = "exact"\nheld = "a3"',
            "held must be a list of texts of 1000 characters at most, got 'a3'",
        ),
        (
            '[weighting]\nobjective = "energy"\nenergy_limit = 3.0',
            "[[weighting]]",
            "weighting must be a table [weighting], got",
        ),
    ],
)
def test_types_must_be_right(refuse, old, new, words):
    refuse(old, new, words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('pipeline = "profile"', 'pipeline = "magic"', "pipeline must be one of albedo, profile, as-published"),
        ('truth = "exact"', 'truth = "hearsay"', "truth must be one of orders, exact, got 'hearsay'"),
        ('objective = "energy"', 'objective = "beauty"', "must be one of energy, relative, got 'beauty'"),
        ('objective = "energy"', 'objective = "radius"', "must be one of energy, relative, got 'radius'"),
        ("high = 0.9", "high = 1.1", "[albedos] high must be a number > 0 and <= 1, got 1.1"),
        ("low = 0.1", "low = 0.0", "[albedos] low must be a number > 0 and <= 1, got 0.0"),
        ("low = 0.1", "low = 0.9", "[albedos] high must be a number > low, which is 0.9, and <= 1, got 0.9"),
        ("low = 0.1", "low = nan", "[albedos] low must be a number > 0 and <= 1, got nan"),
        ("count = 9", "count = 2", "[albedos] count must be a whole number in 3 ... 1000, got 2"),
        ("count = 9", "count = 1001", "[albedos] count must be a whole number in 3 ... 1000, got 1001"),
        (
            'spacing = "alpha"',
            'spacing = "even"',
            "[albedos] spacing must be one of alpha, reflectance, sqrt(1-alpha), got",
        ),
        (
            'truth = "exact"',
            'truth = "exact"\nmfp = [1.0, 0.0]',
            "mfp must be a list of lengths from 0.001 to 1000, got [1.0, 0.0]",
        ),
        (
            'truth = "exact"',
            'truth = "exact"\nmfp = [-1]',
            "mfp must be a list of lengths from 0.001 to 1000, got [-1]",
        ),
        (
            'truth = "exact"',
            'truth = "exact"\nmfp = [inf]',
            "mfp must be a list of lengths from 0.001 to 1000, got [inf]",
        ),
        ('truth = "exact"', 'truth = "exact"\nmfp = []', "mfp must be a list of lengths from 0.001 to 1000, got []"),
        ("first = 0.01", "first = 0.01\ndr = 0.1", "either dr > 0 or both first > 0 and count > 0"),
        ("first = 0.01", "first = -0.01", "[rings] first must be a number >= 0, got -0.01"),
        ("last = 30", "last = 0.005", "[rings] last must be beyond the first ring and within 1000 mfp, got 0.005"),
        ("last = 30", "last = 1e4", "[rings] last must be a number > 0 and <= 1000, got 10000.0"),
        ("last = 30", "last = nan", "[rings] last must be a number > 0 and <= 1000, got nan"),
        ("count = 20", "count = 5000", "[rings] count must be a whole number in 0 ... 1000, got 5000"),
        ("last = 30", 'last = 30\ntrim = "R"', "[rings] trim must be one of r R_d, R_d, none"),
        ("last = 30", "last = 30\nepsilon = 1.0", "[rings] epsilon must be a number in (0, 1), got 1.0"),
        (
            "energy_limit = 3.0",
            "energy_limit = -3.0",
            "[weighting] energy_limit must be a number in 0 ... 1000000, got -3.0",
        ),
        ("energy_limit = 3.0", "energy_limit = nan", "energy_limit must be a number in 0 ... 1000000, got nan"),
        ("energy_limit = 3.0", "source_limit = inf", "source_limit must be a number in 0 ... 1000000, got inf"),
        ("energy_limit = 3.0", "source_limit = 1e7", "source_limit must be a number in 0 ... 1000000, got 10000000.0"),
        ("energy_limit = 3.0", f"energy_limit = {10**400}", "401 digits, of 300 at most, of 'energy_limit' (at line"),
        ("count = 9", f"count = {10**400}", "401 digits, of 300 at most, of 'count' (at line"),
        (
            "count = 9",
            f"count = 0x1{'0' * 5000}",
            "count must be a whole number in 3 ... 1000, got one of more than 4300 digits",
        ),
        ("count = 9", f"count = {'9' * 5000}", "5000 digits, of 300 at most, of 'count' (at line"),
        ("count = 9", f"{'x' * 5000} = 9", "[albedos] keys must be of low, high, count, spacing, got 'xxx"),
        ("count = 9", f"count = {'[' * 100_000}", "is not TOML: tables or lists nested more than 32 deep"),
        ("count = 9", f"{'a.' * 100_000}a = 9", "is not TOML: tables or lists nested more than 32 deep"),
        ("count = 9", "count = 1e400", "is not TOML: the number 1e400, beyond floating point"),
        ('truth = "exact"', 'truth = "exact"\nmfp = [1e300]', "lengths from 0.001 to 1000, got [1e+300]"),
        ('truth = "exact"', 'truth = "exact"\nmfp = [1e-9]', "lengths from 0.001 to 1000, got [1e-09]"),
        ('truth = "exact"', 'truth = "exact"\nmfp = [1, 2, 1.0]', "a list of different lengths, got [1.0, 2.0, 1.0]"),
        ("first = 0.01", "first = 0.001", "[rings] first must be at least 0.0025 mfp"),
        ("count = 20", "count = 2", "[rings] count must be a whole number in 3 ... 1000, got 2"),
        ("first = 0.01", "dr = -0.1\nfirst = 0.01", "[rings] dr must be a number >= 0, got -0.1"),
        ("energy_limit = 3.0", "shares = -1", "[weighting] shares must be a whole number in 0 ... 10000, got -1"),
        ("energy_limit = 3.0", "last_share = 0.0", "[weighting] last_share must be a number > 0 and <= 1, got 0.0"),
    ],
)
def test_values_must_be_possible(refuse, old, new, words):
    refuse(old, new, words)


SETTING = "[setting]\n{}\n\n[albedos]"


def with_setting(*lines):
    return GOOD.replace("[albedos]", SETTING.format("\n".join(lines)))


def test_a_setting_is_read_and_is_the_searchlight_by_default(write):
    assert read(write(GOOD)).setting == Setting()
    assert read(write(with_setting('illumination = "diffuse"'))).setting == Setting("diffuse")
    refracted = with_setting('illumination = "diffuse"', "n = 1.4").replace('"exact"', '"orders"')
    assert read(write(refracted)).setting == Setting("diffuse", n=1.4)
    assert read(write(refracted.replace("n = 1.4", "n = 2"))).setting == Setting("diffuse", n=2.0)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (['illumination = "lamp"'], "[setting] illumination must be one of searchlight, diffuse, got 'lamp'"),
        (["illumination = 1"], "[setting] illumination must be a text of 1000 characters at most, got 1"),
        (["n = 0"], "[setting] n must be a refractive index > 0, got 0.0"),
        (["n = nan"], "[setting] n must be a finite number, got nan"),
        (['n = "glass"'], "[setting] n must be a finite number, got 'glass'"),
        (["g = 1.0"], "[setting] g must be a mean cosine in (-1, 1), got 1.0"),
        (["g = 0.5"], "[setting] g must be 0 where there are no cosines, got 0.5"),
        (["eta = 1.4"], "[setting] keys must be of illumination, n, g, got 'eta'"),
        (["n = 0.9"], "[setting] n must be at least 1 where truth is 'exact' (use truth = \"orders\"), got 0.9"),
    ],
    ids=str,
)
def test_impossible_settings_are_one_line(write, lines, words):
    path = write(with_setting(*lines))
    with pytest.raises(RecipeError, match=re.escape(words)) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_setting_must_be_a_table(write):
    with pytest.raises(RecipeError, match=r"setting must be a table \[setting\], got 'diffuse'"):
        read(write('setting = "diffuse"\n' + GOOD))


def test_each_pipeline_takes_the_settings_that_it_can_judge(write):
    diffuse, refracted = 'illumination = "diffuse"', "n = 1.4"
    for good, line, words in (
        (
            EVEN,
            diffuse,
            "setting of pipeline 'as-published' must be searchlight, n = 1, g = 0, got diffuse, n = 1, g = 0",
        ),
        (INVERSE.replace('"exact"', '"orders"'), refracted, "[setting] n must be 1 of pipeline 'inverse', got 1.4"),
        (
            GOOD.replace('"exact"', '"orders"').replace('"alpha"', '"reflectance"'),
            refracted,
            "[albedos] spacing must be alpha or sqrt(1-alpha) where n is not 1 but 1.4, got 'reflectance'",
        ),
    ):
        with pytest.raises(RecipeError, match=re.escape(words)):
            read(write(good.replace("[albedos]", SETTING.format(line))))
    assert read(write(INVERSE.replace("[albedos]", SETTING.format(diffuse)))).setting == Setting("diffuse")


@pytest.mark.parametrize("path", available(fits_folder()).values(), ids=lambda path: path.stem)
def test_shipped_recipes_are_named_after_their_setting(path):
    """So the catalogue finds their records, and no other."""
    recipe = read(path)
    suffix = (spanning_name if recipe.indices else record_name)("", recipe.setting)
    assert path.stem.endswith(suffix)
    if not suffix:
        assert not re.search(r"-diffuse|-n\d", path.stem)


@pytest.mark.parametrize(
    ("indices", "words"),
    [
        ("[1.1, 1.2, 1.4]", "indices must be at least 4, got [1.1, 1.2, 1.4]"),
        ("[1.0, 1.1, 1.2, 1.4]", "indices must rise, each in (1, 3], got [1.0, 1.1, 1.2, 1.4]"),
        ("[1.1, 1.1, 1.2, 1.4]", "indices must rise, each in (1, 3], got [1.1, 1.1, 1.2, 1.4]"),
        ("[1.1, 1.2, 1.3, 1.5]", "[setting] n must be one of the indices [1.1, 1.2, 1.3, 1.5], got 1.4"),
        ('["a"]', "indices must be a list of finite numbers"),
    ],
)
def test_indices_that_a_law_cannot_span(write, indices, words):
    text = with_setting("n = 1.4")
    assert "[setting]" in text
    with pytest.raises(RecipeError, match=re.escape(words)):
        read(write(f"indices = {indices}\n{text}"))


def test_indices_are_read_and_photons_have_one(write):
    text = f"indices = [1.02, 1.2, 1.4, 1.6]\n{with_setting('n = 1.4')}"
    found = read(write(text))
    assert (found.indices, found.span) == ((1.02, 1.2, 1.4, 1.6), (1.0, 1.6))
    assert read(write(text.replace("1.02", "1.1"))).span == (1.1, 1.6)
    with pytest.raises(RecipeError, match=r"indices need truth = \"exact\" and pipeline 'albedo' or 'profile'"):
        read(write(text.replace('"exact"', '"orders"')))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            "indices = [1.2, 1.3, 1.4]\ncosines = [0.1, 0.5, 0.9]",
            "indices must be in [1.33, 1.45] where there are cosines",
        ),
        ("cosines = [0.1, 0.5, 0.9]", "indices must be in [1.33, 1.45] where there are cosines, got []"),
        (
            "indices = [1.33, 1.4, 1.45]\ncosines = [0.5, 0.9]",
            "cosines must rise, at least 3 in (0, 0.95], got [0.5, 0.9]",
        ),
        ("indices = [1.33, 1.4, 1.45]\ncosines = [0.9, 0.5, 0.1]", "cosines must rise"),
        ("indices = [1.33, 1.4, 1.45]\ncosines = [0.1, 0.8, 0.97]", "cosines must rise"),
        ("indices = [1.33, 1.4, 1.45]\ncosines = [0.1, 0.5, 0.8]", "[setting] g must be one of the cosines"),
    ],
)
def test_cosines_that_a_law_cannot_span(write, given, words):
    with pytest.raises(RecipeError, match=re.escape(words)):
        read(write(f"{given}\n{with_setting('n = 1.4', 'g = 0.9')}"))


def test_cosines_are_read_with_every_index(write):
    lists = "indices = [1.33, 1.4, 1.45]\ncosines = [0.1, 0.5, 0.9]"
    found = read(write(f"{lists}\n{with_setting('n = 1.4', 'g = 0.9')}"))
    assert (found.cosines, found.span) == ((0.1, 0.5, 0.9), (1.3, 1.5))
    assert found.settings == tuple(Setting(n=n, g=g) for n in (1.33, 1.4, 1.45) for g in (0.1, 0.5, 0.9))
    with pytest.raises(RecipeError, match=r"\[setting\] g must be 0 where there are no cosines, got 0.9"):
        read(write(with_setting("n = 1.4", "g = 0.9")))


def test_checks_and_random_starts(write):
    asked = GOOD.replace('truth = "exact"', 'truth = "exact"\ncheck = "orders"\nrandom_starts = 50')
    assert (read(write(asked)).check, read(write(asked)).random_starts) == ("orders", 50)
    assert (read(write(GOOD)).check, read(write(GOOD)).random_starts) == ("", 0)
    for old, new, words in (
        ('check = "orders"', 'check = "exact"', "check must be 'orders' or absent, got 'exact'"),
        ('truth = "exact"', 'truth = "orders"', 'check needs truth = "exact": it compares the photons with it, got'),
        ("random_starts = 50", "random_starts = -1", "random_starts must be a whole number in 0 ... 1000, got -1"),
        ("random_starts = 50", "random_starts = 1001", "random_starts must be a whole number in 0 ... 1000, got 1001"),
        ("random_starts = 50", "random_starts = 5.5", "random_starts must be a whole number in 0 ... 1000, got 5.5"),
    ):
        assert asked.count(old) == 1
        with pytest.raises(RecipeError, match=re.escape(words)):
            read(write(asked.replace(old, new)))
    with pytest.raises(RecipeError, match="pipeline 'as-published' takes neither check nor random_starts"):
        read(write("random_starts = 5\n" + EVEN))


EVEN = (
    GOOD.replace('"profile"', '"as-published"').replace('"energy"', '"radial"').replace("first = 0.01", "dr = 0.05")
).replace("count = 20\n", "")
INVERSE = (
    GOOD.replace('"profile"', '"inverse"').replace('"energy"', '"share"').replace("energy_limit = 3.0", "shares = 64")
)


@pytest.mark.parametrize(
    ("good", "old", "new", "words"),
    [
        (EVEN, "dr = 0.05", "dr = 1e-9", "last * mfp / dr between 3 and 4000 rings, got last = 30.0, mfp = 1.0, dr ="),
        (EVEN, "dr = 0.05", "dr = 20", "last * mfp / dr between 3 and 4000 rings"),
        (EVEN, 'truth = "exact"', 'truth = "exact"\nmfp = [1, 10]', "got last = 30.0, mfp = 10.0, dr = 0.05"),
        (EVEN, 'truth = "exact"', 'truth = "exact"\nmfp = [0.5, 2]', "must contain 1.0, got [0.5, 2.0]"),
        (
            INVERSE,
            "shares = 64",
            "shares = 0",
            "[weighting] shares must be a whole number in 1 ... 10000 of pipeline 'inverse'",
        ),
        (INVERSE, "shares = 64", "", "[weighting] shares must be a whole number in 1 ... 10000 of pipeline 'inverse'"),
    ],
)
def test_each_pipeline_has_its_own_needs(write, good, old, new, words):
    assert read(write(good)).law == "liang"
    assert good.count(old) == 1, "the piece to spoil must be there, once"
    with pytest.raises(RecipeError, match=re.escape(words)) as caught:
        read(write(good.replace(old, new)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("good", "laws"), [(EVEN, "'as-published' must be liang"), (INVERSE, "'inverse' must be liang or quantile")]
)
def test_a_pipeline_takes_the_laws_that_its_objective_sees(write, good, laws):
    require_known(read(write(good)))
    with pytest.raises(RecipeError, match=f"law of pipeline {laws}, got 'burley'"):
        require_known(read(write(good.replace('law = "liang"', 'law = "burley"'))))


@pytest.mark.parametrize(("dr", "last"), [(0.05, 0.15), (0.01, 40.0)])
def test_the_fewest_and_the_most_rings_are_accepted(write, dr, last):
    rings = read(write(EVEN.replace("dr = 0.05", f"dr = {dr}").replace("last = 30", f"last = {last}"))).rings
    assert (rings.dr, rings.last) == (dr, last)


def test_profiles_need_rings(write):
    text = GOOD[: GOOD.index("[rings]")] + GOOD[GOOD.index("[weighting]") :]
    with pytest.raises(RecipeError, match=r"mine\.toml: a recipe of pipeline 'profile' needs a table \[rings\]"):
        read(write(text))
    assert read(write(text.replace('"profile"', '"albedo"').replace('"energy"', '"albedo"'))).rings is None


@pytest.mark.parametrize("table", ["albedos", "weighting"])
def test_tables_must_be_there(write, table):
    text = re.sub(rf"\[{table}\][^\[]*", "", GOOD)
    with pytest.raises(RecipeError, match=rf"mine\.toml: missing \[{table}\]"):
        read(write(text))


def test_what_is_not_toml_is_told_with_its_place(write):
    with pytest.raises(RecipeError, match=r"mine\.toml: is not TOML: .*line 2"):
        read(write("\nthis is no recipe\n"))


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(RecipeError, match=r"gone\.toml: there is no such recipe"):
        read(tmp_path / "gone.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(RecipeError, match=r"folder\.toml: expected a file that can be read, got: Is a dir"):
        read(tmp_path / "folder.toml")
    (tmp_path / "latin.toml").write_bytes(b'title = "caf\xe9"')
    with pytest.raises(RecipeError, match=r"latin\.toml: is not TOML: .utf-8. codec"):
        read(tmp_path / "latin.toml")


def test_find_by_name_or_path(write, tmp_path):
    path = write(GOOD)
    write(GOOD, "another.toml")
    assert list(available(tmp_path)) == ["another", "mine"]
    assert find("mine", tmp_path) == read(path)
    assert find(str(path), Path("/")).path == path
    with pytest.raises(RecipeError, match=r"recipe must be one of another, mine or a \.toml file, got 'yours'"):
        find("yours", tmp_path)
    with pytest.raises(RecipeError, match=r"one of \(none\) or a \.toml file"):
        find("yours", tmp_path / "empty")


def test_a_recipe_error_is_an_input_error():
    assert issubclass(RecipeError, InputError)


def test_a_name_that_is_no_printable_line_is_refused(tmp_path):
    """It would name the record, which nothing could read."""
    path = tmp_path / "a\nb.toml"
    path.write_text(GOOD)
    with pytest.raises(RecipeError, match=r"the name of a recipe must be one printable line") as caught:
        read(path)
    assert str(caught.value).isprintable()
