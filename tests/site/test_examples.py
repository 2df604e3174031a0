"""The numbered scripts of `examples/`: short, and they run as they stand."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
SMOKE = "02_shader_source.py"
LONGEST = 25  # lines


def test_each_is_one_idea():
    assert len(SCRIPTS) == 5
    assert {path.name for path in SCRIPTS if len(path.read_text().splitlines()) > LONGEST} == set()


@pytest.mark.parametrize(
    "name", [path.name if path.name == SMOKE else pytest.param(path.name, marks=pytest.mark.slow) for path in SCRIPTS]
)
def test_scripts_run_and_say_nothing_but_the_answer(name, tmp_path):
    line = [sys.executable, FOLDER / name]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, timeout=250)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("\n") >= 1
    assert list(tmp_path.iterdir()) == []
