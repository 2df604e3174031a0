"""What a user gets: the wheel, built from the sdist, in an environment that holds nothing else."""

import math
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

# Downloads and unpacks jax, scipy and matplotlib: half a minute with a warm pip cache, minutes over a slow line.
in_an_environment_of_its_own = pytest.mark.timeout(900)


def run(*command: str | Path, **options: Any) -> str:
    """The standard output of a command; where it fails, the test fails and shows all it printed."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", out, ROOT, cwd=out)
    (built,) = out.glob("*.whl")
    return built


@pytest.mark.slow
def test_wheel_holds_the_packages_every_recipe_and_record_and_every_text_that_the_packages_read(wheel):
    """Shaders, pages, scenes: whatever lies beside the modules."""
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {name.split("/")[0] for name in names} == {"mcml_sim", "profilefit", "profilefit-0.1.0.dist-info"}

    fits = {path.name for pattern in ("*.toml", "*.json") for path in (ROOT / "fits").glob(pattern)}
    assert any(name.endswith(".json") for name in fits)
    assert {f"profilefit/fits/{name}" for name in fits} <= names
    assert {f"profilefit/examples/{path.name}" for path in (ROOT / "examples").iterdir()} <= names

    found = [path for package in ("mcml_sim", "profilefit") for path in (ROOT / package).rglob("*.*")]
    texts = {path.relative_to(ROOT).as_posix() for path in found if path.suffix != ".pyc" and path.is_file()}
    assert {Path(name).suffix for name in texts} >= {".glsl", ".frag", ".css", ".js", ".html", ".json"}
    assert texts <= names


@pytest.mark.slow
def test_unpacked_wheel_is_used_away_from_the_checkout(wheel, tmp_path):
    """The wheel alone, with the libraries of this environment: nothing of it is left behind in the checkout."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    code = "import sys; sys.path.insert(0, 'site'); import profilefit, profilefit.cli as cli; "
    code += "print(profilefit.__file__, profilefit.load('liang').profile(0.5, 0.9), flush=True); cli.main()"
    out = run(sys.executable, "-I", "-c", code, "export", "hazard-diffuse", "--lang", "hlsl", cwd=tmp_path)
    first, text = out.split("\n", 1)
    place, value = first.split()
    assert Path(place).resolve().is_relative_to((tmp_path / "site").resolve())
    assert 0 < float(value) < math.inf
    assert "hazard_profile" in text
    copied = run(sys.executable, "-I", "-c", code, "examples", cwd=tmp_path).splitlines()[1:]
    assert {Path(line) for line in copied} == {Path("examples", path.name) for path in (ROOT / "examples").iterdir()}
    assert all((tmp_path / line).read_bytes() == (ROOT / line).read_bytes() for line in copied)


@pytest.mark.slow
@in_an_environment_of_its_own
def test_installed_law_evaluates_away_from_the_checkout(wheel, tmp_path):
    """In a new environment with the wheel and its dependencies."""
    venv.create(tmp_path / "environment", with_pip=True)
    python = tmp_path / "environment" / ("Scripts" if os.name == "nt" else "bin") / "python"
    run(python, "-m", "pip", "--quiet", "--no-input", "--disable-pip-version-check", "install", wheel, cwd=tmp_path)
    code = "import profilefit; law = profilefit.load('liang'); print(law.profile(0.5, 0.9))"
    assert 0 < float(run(python, "-I", "-c", code, cwd=tmp_path)) < math.inf
