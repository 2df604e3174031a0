"""The first screen, and examples that work as they are typed in a fresh clone; what shells and editors are offered; the
library in words of the command line, and which records a command takes.
"""

import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest
import typer

import mcml_sim.cli.app
import profilefit.cli
from mcml_sim.files.whole_file import as_json
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.cli import options
from profilefit.cli.options import in_options, records_folder
from profilefit.cli.schema import FILES
from profilefit.errors import InputError, OtherRecords
from profilefit.measured.reading import FACT, NAMES
from profilefit.recipes import catalogue, record
from profilefit.recipes.folder import available, fits_folder
from profilefit.report.tables.keys_table import models, page, schema_of
from profilefit.shader.law_file import LANGUAGES
from profilefit.studies.stability.atlas import FUNCTIONS
from profilefit.studies.tradeoff.parts import PARTS

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = {"profilefit": profilefit.cli.app, "mcml-sim": mcml_sim.cli.app.app}
LINES, COLUMNS = 24, 80
# What takes more than a few seconds is only held against the options that there are.
CHEAP = (
    "profilefit examples --out trial",
    "profilefit convert --reflectance .9,.7,.5 --illumination diffuse --mfp 1.2mm",
    "profilefit export hazard-diffuse --n 1.4 --g 0.9 --lang hlsl --out skin.hlsl",
    "profilefit report hazard",
)


SUBCOMMANDS = {
    (program, name): one
    for program, app in PROGRAMS.items()
    for name, one in typer.main.get_command(app).commands.items()
}


def examples(epilog: str) -> list[str]:
    return [line.strip() for line in epilog.splitlines() if line.startswith("  ")]


EXAMPLES = [line for one in SUBCOMMANDS.values() for line in examples(one.epilog)]
JOB = [line.split("  ")[1] for line in profilefit.cli.HELP.splitlines() if line.startswith("  ")]


def test_the_first_screen_shows_the_job_and_every_subcommand(command, done):
    out = done("--help", said=None)
    lines = out.splitlines()
    assert len(lines) < LINES, "the prompt needs one"
    assert max(map(len, lines)) <= COLUMNS
    for program, name in SUBCOMMANDS:
        if program == "profilefit":
            (row,) = [line for line in lines if f" {name} " in f" {line[15:]}"[:14]]
            assert row.endswith(".")
    for panel in profilefit.cli.PANELS:
        assert any(line.startswith(panel) for line in lines)
    assert [line.split("  ")[1] for line in lines if line.startswith("  profilefit")] == JOB
    status, shown, _ = command()
    assert (status, shown.strip()) == (2, out.strip()), "no arguments: the same"


@pytest.mark.parametrize(("program", "name"), SUBCOMMANDS)
def test_every_help_ends_with_examples_of_its_own(program, name):
    given = examples(SUBCOMMANDS[program, name].epilog)
    assert given
    assert all(line.startswith(f"{program} {name} ") for line in given)
    assert all(len(line) <= COLUMNS - 3 for line in given), "or it is broken in two"


@pytest.mark.parametrize("line", [*EXAMPLES, *JOB])
def test_options_and_files_of_every_example_are_there(line):
    """Parsed as when it runs; what it reads lies in the repository."""
    program, name, *rest = shlex.split(line)
    one = SUBCOMMANDS[program, name]
    context = one.make_context(name, rest)
    lists = (value if isinstance(value, list | tuple) else [value] for value in context.params.values())
    files = [str(one) for values in lists for one in values if str(one).startswith("examples/")]
    assert all((ROOT / path).is_file() for path in files)
    assert len(files) == line.count("examples/")


def test_files_of_examples_are_said_to_be_of_the_command_that_copies_them():
    """An installed wheel has no examples/ in the folder that one works in."""
    for one in SUBCOMMANDS.values():
        assert ("examples/" in one.epilog) == ("of profilefit examples:" in one.epilog)
    assert not any("examples/" in text for text in (profilefit.cli.HELP, mcml_sim.cli.app.HELP))


@pytest.mark.parametrize("line", CHEAP)
def test_cheap_examples_run_as_typed(done, line):
    assert line in EXAMPLES
    shutil.copytree(ROOT / "examples", "examples")
    out = done(*shlex.split(line)[1:], said=None)
    assert out or Path("skin.hlsl").stat().st_size


def test_mcml_sim_fits_a_screen_too(program):
    lines = program("mcml-sim", "--help")[1].splitlines()
    assert len(lines) < LINES
    assert max(map(len, lines)) <= COLUMNS
    assert any("mcml-sim run FILE.mci --out runs" in line for line in lines)


FITS = catalogue.fits_folder()
HEAVY = ("jax", "numpy", "scipy", "matplotlib", "moderngl")  # take seconds together, which no shell has
PATIENCE = 1.0  # [s] of processor time, so that a busy machine does not count


def test_what_is_written_out_is_what_there_is():
    assert LANGUAGES == options.LANGUAGES
    assert tuple(PARTS) == options.PARTS
    assert set(FUNCTIONS) == set(options.FUNCTIONS)
    assert ILLUMINATIONS == options.LIGHTS


@pytest.fixture
def completed(done, monkeypatch):
    """Words that bash is offered in place of the last of WORDS."""

    def run(*typed):
        monkeypatch.setenv("_PROFILEFIT_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", " ".join(("profilefit", *typed)))
        monkeypatch.setenv("COMP_CWORD", str(len(typed)))
        return set(done().split())

    return run


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (("ch",), {"check", "choose"}),
        (("report", "burley"), {name for name in record.available(FITS) if name.startswith("burley")}),
        (("report", "--fits", str(FITS), "reproduct"), {"reproduction"}),
        (("report", "--fits", "nowhere", "reproduct"), set()),
        (("report", "skim"), {"skimmilk-on-marble", "skimmilk-on-potato"}),
        (("report", "--fits", "nowhere", "skim"), set()),
        (("export", "hazard", "--lang", "glsl"), {"glsl", "glsl-es"}),
        (("fit", "x.csv", "--law", "quan"), {"quantile"}),
        (("check", "--constants", "c"), {"corrected"}),
        (("regenerate", "reprod"), {name for name in available(FITS, "toml") if name.startswith("reprod")}),
        (("stability", "sol"), {"solver"}),
        (("tradeoff", "l"), {"laws"}),
    ],
)
def test_a_shell_is_offered_names(completed, typed, offered):
    assert completed(*typed) == offered


def test_a_shell_is_answered_within_a_second(tmp_path):
    """The least of three: what runs beside it takes its share of a core."""
    words_so_far = {"COMP_WORDS": "profilefit report haz", "COMP_CWORD": "2"}
    spent = []
    for _ in range(3):
        before = os.times()
        done = subprocess.run(
            [sys.executable, "-m", "profilefit"], cwd=tmp_path, capture_output=True, text=True, timeout=60,
            env={**os.environ, "_PROFILEFIT_COMPLETE": "complete_bash", **words_so_far},
        )  # fmt: skip
        after = os.times()
        spent.append(after.children_user + after.children_system - before.children_user - before.children_system)
        assert "hazard-diffuse" in done.stdout.split()
    assert min(spent) < PATIENCE


def test_help_and_mistakes_import_nothing_that_takes_long(tmp_path):
    """Of every subcommand: only what is done needs it, and it is imported then."""
    code = f"""
import sys
from profilefit.cli import PANELS, PROGRAM
for command in (*(c for panel in PANELS.values() for c in panel), None):
    sys.argv = ["profilefit", *([command.__name__] if command else []), "--help"]
    assert PROGRAM._status() == 0
sys.argv = ["profilefit", "report", "--nonsense"]
assert PROGRAM._status() == 2
import mcml_sim.cli.app
print("LOADED", [name for name in {HEAVY!r} if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "LOADED []"


def test_arguments_are_named_by_their_options():
    said = {
        "out must be another folder, got out": "--out must be another folder, got out",
        "held alpha must be in (0, 1)": "--fix alpha must be in (0, 1)",
        "one unit, here and in `unit`": "one unit, here and in --unit",
        "constants of a record are its own": "constants of a record are its own",
        "x.csv: no row is left between `r_min` and `r_max`": "x.csv: no row is left between --r-min and --r-max",
    }
    assert {text: in_options(text) for text in said} == said
    for text in ("x.csv:1: column r: out must be", "lang must be glsl; `profilefit report` lists `names`"):
        assert in_options(text) == text


def test_content_is_gone_through_and_numbers_stay():
    told = {"data": {"notes": ("left out by `r_min`",), "rows": 3}, "result": "hold it with `held` alpha=..."}
    assert in_options(told) == {
        "data": {"notes": ["left out by --r-min"], "rows": 3},
        "result": "hold it with --fix alpha=...",
    }


def test_what_was_asked_for_comes_first_then_what_is_here_then_what_is_shipped(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert records_folder() == fits_folder()
    assert all((fits_folder() / f"hazard.{kind}").is_file() for kind in ("toml", "json")), "recipes and records"
    Path("fits").mkdir()
    assert records_folder() == fits_folder(), "an empty folder has nothing to show"
    Path("fits/one.json").write_text("{}")
    with pytest.warns(OtherRecords, match="records of 'fits' in the current folder; --fits chooses others"):
        assert records_folder(quiet=True) == Path("fits")
    Path("mine").mkdir()
    with pytest.warns(OtherRecords, match="records of 'mine'$"):
        assert records_folder(Path("mine")) == Path("mine")
    assert (records_folder(Path("mine"), quiet=True), records_folder(fits_folder())) == (Path("mine"), fits_folder())
    with pytest.raises(InputError, match=r"--fits must be a folder of records, got 'asked', which is none"):
        records_folder(Path("asked"))


SHIPPED = [path for folder in ("examples", "fits", "fits/stacks") for path in sorted((ROOT / folder).glob("*.toml"))]


def kind_of(content):
    if "scene" in content:
        return "scene"
    return "stack" if "layers" in content else "photo" if "medium" in content else "recipe"


@pytest.fixture(scope="module")
def schemas():
    return {kind: jsonschema.Draft202012Validator(schema_of(models()[kind])) for kind in FILES}


def test_shipped_files_are_valid(schemas):
    contents = [tomllib.loads(path.read_text(encoding="utf-8")) for path in SHIPPED]
    assert {kind_of(content) for content in contents} == set(FILES)
    for path, content in zip(SHIPPED, contents, strict=True):
        assert [error.message for error in schemas[kind_of(content)].iter_errors(content)] == [], path
        assert not schemas[kind_of(content)].is_valid({**content, "colour": 1})
    assert not schemas["photo"].is_valid({"medium": {"n": -1.0}})


def test_the_command_prints_it_or_names_the_kinds(done, refused, schemas):
    assert done("schema", "stack") == as_json(schemas["stack"].schema)
    said = "profilefit: KIND must be one of scene, stack, recipe, photo, got 'fog'\n"
    assert refused("schema fog", said) == said


def test_the_page_of_keys_has_every_name_of_data():
    rows = page().partition("## Data")[2]
    assert [name for name in (*FACT, *NAMES, "value1") if f"`{name}`" not in rows] == []
