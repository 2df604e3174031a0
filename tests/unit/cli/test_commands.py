"""The command line as a user meets it: what it writes, what it refuses, and in how many lines. What is printed where:
JSON alone on stdout, colour on a terminal only, whole tables; and what is written: whole files, pairs, and examples.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from mcml_sim import Setting
from mcml_sim.cli.screen import typed
from profilefit.errors import InputError, OutputError
from profilefit.recipes import catalogue, record
from profilefit.recipes.folder import fits_folder
from profilefit.report.figures.canvas import canvas, save
from tests.fixtures import EXAMPLES
from tests.unit.cli.conftest import interrupted

FITS = fits_folder()

RECIPE = """
title = "A small one"
law = "liang"
equations = "(8)"
pipeline = "albedo"
truth = "orders"

[albedos]
low = 0.1
high = 0.9
count = 9

[weighting]
objective = "albedo"
"""


@pytest.fixture
def recipe(tmp_path) -> Path:
    path = tmp_path / "small.toml"
    path.write_text(RECIPE)
    return path


def small(recipe: Path, out: str = "out", *more: str) -> tuple[str, ...]:
    return ("regenerate", str(recipe), "--out", out, "--photons", "20000", *more)


@pytest.mark.parametrize(
    "words",
    [
        *("fit phantom.csv --out out", "fit petzold --kind phase --out out", "photo --simulate photo.toml --out out"),
        *("report hazard --html page.html", "report hazard --figures out", "regenerate burley-whole --out out"),
        *("check hazard --out out", "stability liang --out out", "tradeoff laws --out out", "scene sea.toml --out out"),
    ],
)
def test_a_full_disk_is_met_before_the_work(refused, monkeypatch, tmp_path, words):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=10**12, free=10**6))
    refused(words, "No space left on device: 1.0 MB are free, ")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.slow
def test_regenerate_writes_a_record_that_loads(done, recipe):
    out = done(*small(recipe, "out", "--json", "--quiet"))
    content = json.loads(Path("out/small.json").read_text())
    assert content["truth"]["photons"] == 20000
    assert content["fit"]["result"] == "converged"
    law = catalogue.albedo_law("liang", constants="out/small.json")
    assert law.p == pytest.approx(content["constants"]["p"]["regenerated"])
    assert content["posterior"]["statistical"]["result"] == "converged"
    told = json.loads(out)["small"]
    assert (told["path"], told["result"]) == ("out/small.json", "converged")
    kept = content["constants"]["p"]
    assert told["constants"]["p"] == {key: kept[key] for key in told["constants"]["p"]}
    assert told["constants"]["p"]["statistical_error"] > 0
    assert told["worst"]["delta_A"]["regenerated"] == content["quality"]["regenerated"]["delta_A"]


@pytest.mark.slow
def test_a_surface_that_refracts_gets_its_own_record(command, tmp_path):
    """A recipe's table [setting] says which; the record is found by the name that goes with it."""
    path = tmp_path / "albedo-rational-n1.45.toml"
    text = RECIPE.replace('pipeline = "albedo"\n', 'pipeline = "albedo"\nrandom_starts = 3\n')
    for old, new in ('"liang"', '"rational"'), ("= 9", "= 5"), ('tive = "albedo"', 'tive = "reflectance"'):
        text = text.replace(old, new)
    path.write_text(f"{text}\n[setting]\nn = 1.45\n")
    status, _, err = command(*small(path))
    assert status == 0, err
    assert "2e+04 photons: searchlight, n = 1.45, g = 0" in err
    assert err.count("photons:") == 1
    content = json.loads(Path("out/albedo-rational-n1.45.json").read_text())
    assert content["setting"] == {"illumination": "searchlight", "n": 1.45, "g": 0.0}
    assert content["starts"]["count"] == 3
    assert 0 < content["quality"]["regenerated"]["delta_A"] < 0.01  # from exact light: 20 000 photons, five albedos
    assert list(Path("out/.photons/seed-1/n1.45").glob("batch-*"))
    law = catalogue.albedo_law("rational", setting=Setting(n=1.45), folder=Path("out"))
    assert law.reflectance(1.0) == pytest.approx(4 * 1.45 / 2.45**2)
    assert command("report", "--fits", "out")[0] == 0


@pytest.mark.slow
def test_one_seed_gives_identical_records_and_another_does_not(command, recipe):
    for out, seed in (("a", "3"), ("b", "3"), ("c", "4")):
        assert command(*small(recipe, out, "--seed", seed))[0] == 0
    for suffix in ("json", "npz"):
        same, again, other = (Path(f"{out}/small.{suffix}").read_bytes() for out in "abc")
        assert same == again
        assert same != other


@pytest.mark.slow
def test_more_photons_resume_the_ones_that_are_there(command, recipe):
    """Two batches and then a third make the record of three at once, and the two are not traced again."""

    def batches() -> dict[Path, tuple[int, bytes]]:
        found = Path("out/.photons").glob("*/batch-*")
        return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in found}

    assert command(*small(recipe, "out", "--photons", str(2 * 2**20)))[0] == 0
    before = batches()
    assert len(before) == 2
    assert command(*small(recipe, "out", "--photons", str(3 * 2**20)))[0] == 0
    after = batches()
    assert len(after) == 3
    assert {path: after[path] for path in before} == before
    assert command(*small(recipe, "at-once", "--photons", str(3 * 2**20)))[0] == 0
    for suffix in ("json", "npz"):
        assert Path(f"out/small.{suffix}").read_bytes() == Path(f"at-once/small.{suffix}").read_bytes()


@pytest.mark.slow
def test_control_c_is_one_line_and_keeps_the_batches(recipe, tmp_path):
    words = ("profilefit", "regenerate", recipe, "--out", "out", "--photons", 2**30)
    status, _, err = interrupted(*words, cwd=tmp_path, once="out/.photons/*/run.json")
    assert (status, err) == (130, "profilefit: stopped; the finished batches are kept, the same command resumes\n")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [(("regenerate", "--nonsense"), 2, "profilefit: No such option: --nonsense"), (("--help",), 0, "")],
)
def test_python_m_profilefit_ends_with_the_right_status(words, status, said, tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "profilefit", *words], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert run.returncode == status
    assert run.stderr.startswith(said)
    assert run.stderr.count("\n") == (1 if status else 0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('law = "liang"|law = "lang"', "law must be one of liang, rational, van_de_hulst, chiang, got 'lang'"),
        ('objective = "albedo"|objective = "energy"', "must be one of albedo, reflectance, relative_reflectance, got"),
    ],
)
def test_a_bad_recipe_is_one_line_and_writes_nothing(refused, recipe, change, said):
    recipe.write_text(RECIPE.replace(*change.split("|")))
    assert str(recipe) in refused(small(recipe), said)
    assert not list(Path("out").glob("**/*.*")) if Path("out").exists() else True


MISTAKES = {
    "regenerate": [
        ("--photons many", "profilefit: Invalid value for '--photons'"),
        ("no-such-recipe", "recipe must be one of albedo-liang,"),
        ("albedo-rational --photons 0", "photons must be a whole number >= 1, got 0"),
        ("albedo-rational --seed -1", "seed must be a whole number in [0, 4294967295], got -1"),
        ("missing.toml --seed 4294967296", "seed must be a whole number in [0, 4294967295], got"),
    ],
    "report": [("--fits empty", "must be a folder of records, got 'empty', which is none")],
    "check": [
        ("nothing", "name must be a law, map or record, got 'nothing'; laws: liang, "),
        ("hazard --precision float8", "float8"),
    ],
    "stability": [("hazzard", "name must be a law, map or record"), ("--out", "requires an argument")],
    "export": [
        ("sea-segment --n 1.3", "profilefit: --n must be left out where NAME is of light in water, got 'sea-segment'"),
        ("heart.toml", f"profilefit: {EXAMPLES['heart.toml']}: scene must be sea, whose water has a text, got 'heart'"),
        ("fur --n 1.3", "profilefit: --n must be left out where NAME is of fur, got 'fur'"),
        ("fur --constants old", "profilefit: --constants must be left out where NAME is of fur, got 'fur'"),
    ],
    "convert": [
        ("--n 1", "colour must be one of --alpha, --reflectance with --illumination, or --mu-a with --mu-s, got none"),
        ("--alpha .5 --reflectance .5 --mfp 1", "got --alpha and --reflectance"),
        ("--mu-a 1", "got --mu-a"),
        ("--alpha .5", "length must be one, such as --mfp 1.2mm, got none"),
        ("--alpha .5 --mfp 1 --falloff 2", "got --mfp and --falloff"),
        ("--mu-a 1 --mu-s 1 --mfp 1", "length must be left out, as --mu-a and --mu-s have one, got --mfp"),
        ("--reflectance .5 --mfp 1", "--illumination must be one of searchlight, diffuse with --reflectance, got none"),
        ("--alpha .5 --mfp 1 --illumination sun", "--illumination must be one of searchlight, diffuse, got 'sun'"),
        ("--alpha .5 --mfp one", "--mfp must be numbers, with a unit of um,"),
        ("--alpha .5 --mfp 1mm,2cm", "--mfp must have one unit, got cm, mm"),
        ("--alpha .5mm --mfp 1", "--alpha must be numbers, between commas, got '.5mm'"),
        ("--alpha .5,97.1 --mfp 1", "--alpha must be numbers in [0, 1], between commas, got '97.1' (a share: 0.971"),
        (f"--alpha .5 --mfp {'9' * 5000}mm", f"--mfp must be numbers that floating point holds, got '{'9' * 59}..."),
        ("--mu-a 1/mm --mu-s 1/cm", "--mu-a and --mu-s must have one unit, got /mm and /cm"),
        ("--mu-a 1mm --mu-s 1mm", "--mu-a must be numbers, with a unit of /um,"),
    ],
    "fit": [
        ("nothing.csv", "nothing.csv: expected a file that can be read, got: No such file"),
        ("phantom.csv --law hazard --n 1.7",
         "got a request for searchlight, n = 1.7, g = 0; --n, --g and --light choose one of these"),
        ("phantom.csv --g 0.9", "got searchlight, n = 1, g = 0.9: simulate it instead"),
        ("phantom.csv --n 1.4 --g 0.95:0.7", "--g must be a mean cosine in (-1, 1), or a range such as"),
        ("two_layers.mco --free d1", "--free must be left out where there are no --layers"),
        ("two_layers.mco --layers two_layers.toml", "--free must name quantities such as d1, mu_a2 or mu_s2, got ''"),
        ("two_layers.mco --layers two_layers.toml --free d1 --g 0.9", "--g must be left out where --layers say what"),
        ("two_layers.mco --layers two_layers.toml --free d1 --beam 1mm:2mm",
         "--beam must be one width where layers are"),
        ("two_layers.mco --layers none.toml --free d1", "none.toml: expected a file that can be read"),
        ("two_layers.mco --layers skin.toml --free d1", "g = 0"),
        ("phantom.csv --beam 0.7mm:0.3mm", "--beam must be a range that rises, such as 0.3mm:0.7mm"),
        (f"phantom.csv --fix A={'9' * 5000}", f"--fix A must be a number, got '{'9' * 59}..."),
        ("phantom.csv --total 53.4%+-1%", "such as 0.52+-0.01, got '53.4%+-1%' (a share: 0.534 for 53.4 %)"),
        ("phantom.csv --fix alpha=97", "--fix alpha must be a number in (0, 1), got '97' (a share: 0.97 for 97 %)"),
        ("half_space.mco --fibre 2mm", "--fibre must be left out where rows are averages"),
        ("two_layers.mco --light diffuse", "--light must be searchlight for"),
        ("phantom.csv --fix l", "--fix must be l=LENGTH, alpha=NUMBER or A=NUMBER, got 'l'"),
        ("phantom.csv --fix A=.5 --fix alpha=.9", "--fix must hold each of l and alpha (or A) once"),
        ("phantom.csv --scale -1", "--scale must be a number > 0, free, or a number with its error"),
        ("phantom.csv --scale 1e300", "--scale must be between 1e-40 and 1e+40, got '1e300'"),
        ("phantom.csv --scale 1+-0", "--scale must be a number > 0, free, or a number with its error"),
        ("phantom.csv --total 0.5", "--total must be a reflectance in (0, 1) with its error"),
        ("phantom.csv --oblique 45:4mm:0.5mm", "--oblique must be an angle in degrees, a radius and a shift with its"),
        ("phantom.csv --oblique 95:4mm:0.5mm+-.1mm", "--oblique's angle must lie between 0 and 90 degrees, got '95'"),
        ("phantom.csv --oblique 45:4ly:0.5mm+-.1mm", "--oblique's radius must be a length > 0 such as 1.2mm"),
        ("phantom.csv --seed -1", "--seed must be a whole number >= 0, got -1"),
        ("phantom.csv --out /proc/nowhere", "cannot write into /proc/nowhere"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("name", "words", "said"), [(one, *row) for one, rows in MISTAKES.items() for row in rows])
def test_bad_words_are_one_line(refused, name, words, said):
    refused(f"{name} {words}", said)
    assert not list(Path().iterdir()), "refused before anything is made"


def test_two_recipes_of_one_name_are_refused(refused, recipe):
    other = Path("other/small.toml")
    other.parent.mkdir()
    other.write_text(RECIPE)
    refused(
        f"regenerate {recipe} {other} --out out --photons 20000",
        f"recipes must have different names, as their records do, got {recipe} and {other}",
    )
    assert not Path("out").exists()


def test_a_damaged_record_is_one_line(refused):
    Path("fits").mkdir()
    content = json.loads((FITS / "liang-whole.json").read_text())
    del content["fit"]
    Path("fits/liang-whole.json").write_text(json.dumps(content))
    refused("report liang-whole", "fits/liang-whole.json: is damaged: table [fit] is missing; regenerate it")


@pytest.mark.slow
def test_report_shows_shipped_records_and_draws_figures(done):
    out = done("report", "albedo-liang", "--figures", "figures", "--quiet")
    assert "(8)" in out
    assert list(Path("figures").glob("*.png"))


def test_version_is_a_number(done):
    assert done("--version", said=None).startswith("profilefit 0.")


def test_shipped_records_are_written_over_only_where_they_are_named(refused, monkeypatch):
    """Where ./fits is what is shipped, as in a clone; the last error comes from behind that check."""
    monkeypatch.chdir(FITS.parent)
    refused("regenerate albedo-liang", "--out must be given where ./fits holds the shipped records")
    reached = Mock(side_effect=InputError("the folder is next"))
    monkeypatch.setattr("mcml_sim.files.whole_file.require_folder", reached)
    refused("regenerate albedo-liang --out fits", "the folder is next")


COLOUR = re.compile(r"\x1b\[(?:\d+;)*3[0-7]m")


def strict(text: str):
    """What JSON says; NaN and infinities, which Python writes and others do not read, are refused."""

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def test_json_of_records_is_what_they_hold(command, done):
    records = {name: record.read(path) for name, path in record.available(FITS).items()}
    assert strict(done("report", "--json")) == {"records": records}
    assert list(strict(command("report", "hazard", "--json")[1])["records"]) == ["hazard"]
    told = strict(done("convert", "--alpha", "1", "--mfp", "1mm", "--json", said=None))
    assert told["dmfp"] == [None], "null for what is not finite"


@pytest.mark.slow
def test_json_of_quality_is_measured(done):
    told = strict(done("report", "albedo-rational", "albedo-liang", "--quality", "--json"))
    (rational,) = [one for one in told["quality"]["maps"] if one["records"] == ["albedo-rational"]]
    stated = told["records"]["albedo-rational"]["quality"]["regenerated"]["delta_A"]
    assert rational["quality"]["delta_A"] == pytest.approx(stated, rel=1e-3)
    assert rational["setting"] == {"illumination": "searchlight", "n": 1.0, "g": 0.0}
    assert (told["quality"]["profiles"], told["quality"]["samplers"]) == ([], [])


def test_an_unknown_record_names_the_nearest_and_is_no_json(refused):
    said = f"profilefit: there is no record 'hazzard' in {FITS}; did you mean hazard? stacks are "
    rest = f"{', '.join(record.available(FITS / 'stacks'))}, and `profilefit report` lists records\n"
    assert refused("report hazzard --json", said) == said + rest
    liang = "liang-whole, liang-as-published, liang-inverse-whole? "
    for name, near in {"liang": liang, "skim": "skimmilk-on-marble, skimmilk-on-potato? ", "hearts": "heart? "}.items():
        refused(f"report {name}", f"did you mean {near}")
    assert "did you mean" not in refused("report zzz", "")


@pytest.mark.parametrize("width", [40, 80, *(pytest.param(one, marks=pytest.mark.slow) for one in (60, 100, 120))])
@pytest.mark.parametrize("words", [("report",), ("report", "liang-whole", "reproduction"), ("report", "skin")])
def test_tables_are_whole_at_any_width(command, done, monkeypatch, width, words):
    monkeypatch.setenv("COLUMNS", str(width))
    out = done(*words, said=None)
    assert width < 80 or max(map(len, out.splitlines())) <= width
    monkeypatch.setenv("COLUMNS", "400")
    assert Counter(out.split()) == Counter(command(*words)[1].split()), "nothing cut, nothing broken"


def test_colour_is_for_terminals_that_want_it(command, monkeypatch):
    assert "\x1b" not in command("report", "hazard")[1], "a pipe"
    monkeypatch.setenv("FORCE_COLOR", "1")  # what a terminal would get
    monkeypatch.setenv("TERM", "xterm-256color")
    assert COLOUR.search(command("report", "hazard")[1])
    monkeypatch.setenv("NO_COLOR", "1")
    assert not COLOUR.search(command("report", "hazard")[1])


def test_the_command_is_told_as_it_was_typed(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/usr/bin/profilefit", "check", "burley", "--out", "a b"])
    assert typed() == "profilefit check burley --out 'a b'"
    monkeypatch.setattr(sys, "argv", [str(Path("somewhere/mcml_sim/__main__.py")), "run"])
    assert typed() == "mcml_sim run"


def test_claims_are_shown_as_they_were_measured_last(command, done, tmp_path):
    told = strict(command("report", "--claims", "--json")[1])["claims"]
    out = done("report", "--claims", said=None)
    whole = " ".join(out.split())  # a long command runs over two lines
    assert all(one["command"] in whole for one in told)
    assert out.count("≤ ") + out.count("≥ ") == len(told) > 10
    status, _, err = command("report", "--claims", "--evidence", str(tmp_path))
    assert (status, err.count("\n")) == (2, 1)
    assert "claims.json" in err


def test_what_cannot_be_written_is_one_line(refused):
    """To read a pipe, whose tables were to be filled in, would wait for ever."""
    os.mkfifo("pipe")
    said = "profilefit: cannot write pipe: it is a pipe that nobody reads from\n"
    assert refused("export burley --out pipe", said) == said
    said = "--markdown must be a file whose tables are filled in, got pipe, which is none"
    assert refused("report burley-whole --markdown pipe", said) == f"profilefit: {said}\n"


def test_a_figure_or_a_record_is_both_of_its_files_or_none(tmp_path):
    (tmp_path / "one.svg").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*one\.svg: it is a folder"):
        save(canvas(1.0, layout=None), tmp_path, "one")
    (tmp_path / "two.json").mkdir()
    path = FITS / "burley-whole.json"
    with pytest.raises(OutputError, match=r"cannot write .*two\.json: it is a folder"):
        record.write(tmp_path, "two", record.read(path), record.read_arrays(path))
    assert {one.name for one in tmp_path.iterdir()} == {"one.svg", "two.json"}


def test_every_example_is_copied_and_named(done, refused):
    Path("file").write_text("")
    refused("examples --out file/inside", "profilefit: cannot write")
    assert done("examples").splitlines() == [f"examples/{name}" for name in EXAMPLES]
    assert all(Path("examples", name).read_bytes() == Path(path).read_bytes() for name, path in EXAMPLES.items())


@pytest.mark.parametrize("there", ["file", "link"])
def test_what_is_there_is_never_replaced_and_nothing_is_half_copied(refused, there):
    Path("trial").mkdir()
    taken = Path("trial/skin.toml")
    taken.write_text("mine") if there == "file" else taken.symlink_to("nowhere")
    said = "cannot write into trial: skin.toml would be replaced; use --out with another folder"
    assert refused("examples --out trial", said) == f"profilefit: {said}\n"
    assert [path.name for path in Path("trial").iterdir()] == ["skin.toml"]
    assert taken.is_symlink() or taken.read_text() == "mine"
