"""The first screen, and examples that work as they are typed in a fresh clone."""

import shlex
import shutil
from pathlib import Path

import pytest
import typer

import mcml_sim.cli.app
import profilefit.cli

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = {"profilefit": profilefit.cli.app, "mcml-sim": mcml_sim.cli.app.app}
LINES, COLUMNS = 24, 80
# What takes more than a few seconds is only held against the options that there are.
CHEAP = (
    "profilefit examples --out trial",
    "profilefit convert --reflectance .9,.7,.5 --illumination diffuse --mfp 1.2mm",
    "profilefit convert --alpha 0.95 --dmfp 3mm --json",
    "profilefit export hazard-diffuse --n 1.4 --g 0.9 --lang hlsl --out skin.hlsl",
    "profilefit report hazard",
)


def subcommands() -> dict[tuple[str, str], typer.core.TyperCommand]:
    return {
        (program, name): one
        for program, app in PROGRAMS.items()
        for name, one in typer.main.get_command(app).commands.items()
    }


SUBCOMMANDS = subcommands()


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
