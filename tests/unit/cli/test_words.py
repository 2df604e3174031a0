"""What a shell completes, and how fast."""

import os
import subprocess
import sys

import pytest

from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.cli import options
from profilefit.recipes import catalogue, recipe, record
from profilefit.shader.law_file import LANGUAGES
from profilefit.studies.stability.atlas import FUNCTIONS
from profilefit.studies.tradeoff.parts import PARTS

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
        out = done()
        return set(out.split())

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
        (("regenerate", "reprod"), {name for name in recipe.available(FITS) if name.startswith("reprod")}),
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
