"""The documentation: every name has its place, examples run as they are printed, the site needs no network."""

import importlib
import io
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import typer

import mcml_sim
import profilefit
from mcml_sim.cli.app import app as mcml_sim_cli
from profilefit import cli
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.folder import STACKS
from profilefit.recipes.kinds import stack
from profilefit.shader.law_file import export, export_subject
from profilefit.shader.stack_text import export_stack
from tests.site.test_wheel import run

ROOT = Path(__file__).resolve().parents[2]
DOCS, FITS = ROOT / "docs", ROOT / "fits"
EXAMPLES = DOCS / "examples"


# The reference


def test_every_public_name_has_its_place():
    for package in (mcml_sim, profilefit):
        text = (DOCS / f"reference/{package.__name__}.md").read_text(encoding="utf-8")
        other = (DOCS / "reference/mcml_sim.md").read_text(encoding="utf-8")  # whose errors profilefit raises too
        for name in set(package.__all__) - {"__version__"}:
            assert re.search(rf"mcml_sim\.{name}\b", other) or re.search(rf"{package.__name__}\.{name}\b", text), name


def test_docstrings_become_lists_formulas_and_prose(monkeypatch):
    monkeypatch.syspath_prepend(DOCS / "ext")
    parts = [
        (["A law of |x| and `y*`."], [r"A law of \|x\| and `y*`."]),
        (
            ["alpha  albedo [-], in", "       [0, 1]", "r, s   radii"],
            ["**alpha**", "    albedo [-], in", "    [0, 1]", "**r, s**", "    radii"],
        ),
        (
            ["Args:", "    n: index [-],", "        > 0", "    g: mean cosine"],
            ["**n**", "    index [-],", "    > 0", "**g**", "    mean cosine"],
        ),
        (["Returns:", "    A, in", "    [0, 1]"], ["**Returns**", "    A, in", "    [0, 1]"]),
        (["V(z) = z - z^2 ln(1 + 1/z)"], ["::", "", "    V(z) = z - z^2 ln(1 + 1/z)", ""]),
    ]
    before, after = ([line for part in parts for line in ("", *part[which])][1:] for which in (0, 1))
    assert importlib.import_module("docstrings").restructured(before) == after


# What is to be typed

COMMANDS = {"profilefit": typer.main.get_command(cli.app), "mcml-sim": typer.main.get_command(mcml_sim_cli)}
PAGES = [
    "README.md",
    *sorted(path.relative_to(ROOT).as_posix() for path in DOCS.rglob("*.md") if "laws" not in path.parts),
]


def commands_of(page):
    """What a page tells to type, in a block or between backticks, without its remark."""
    text = (ROOT / page).read_text(encoding="utf-8")
    typed = re.findall(r"(?:^(?:\$ )?|`)((?:profilefit|mcml-sim) [a-z-][^`\n#]*)", text, re.MULTILINE)
    return [re.sub(r"[\[\]]|\.\.\.", "", one).split() for one in typed]


def test_no_text_installs_a_package_of_this_name_from_the_index():
    """There it is somebody else's, or will be: a clone is installed as '.[extra]', and messages name the packages."""
    places = ("docs", "notebooks", "benchmarks", "profilefit", "mcml_sim", "tests")
    texts = [*ROOT.glob("*.*"), ROOT / "Makefile", *(path for one in places for path in (ROOT / one).rglob("*.*"))]
    read = [path for path in texts if path.suffix in (".md", ".py", ".ipynb", ".sh", ".toml", "") and path.is_file()]
    named = re.compile("profilefit" r"\[|pip3? install (-\S+ )*[\"']?(profilefit|mcml)")
    assert len(read) > 400
    assert [path for path in read if "_build" not in path.parts and named.search(path.read_text("utf-8"))] == []
    for bad in ("pip install -U '{}[cluster]'", "the extra {}[cluster]", "pip install --upgrade {}"):
        assert named.search(bad.format("profilefit"))


@pytest.mark.parametrize("page", PAGES)
def test_commands_and_options_exist(page):
    for program, command, *words in commands_of(page):
        if command.startswith("--"):
            known, words = {"--help", "--version"}, [command, *words]
        else:
            assert command in COMMANDS[program].commands, f"{page}: {program} {command}"
            known = {option for one in COMMANDS[program].commands[command].params for option in one.opts} | {"--help"}
        assert {word for word in words if word.startswith("--")} <= known, f"{page}: {program} {command} {words}"


def test_commands_are_found():
    assert sum(len(commands_of(page)) for page in PAGES) > 30
    assert ["profilefit", "check"] in commands_of("docs/validation/checks.md")


# Words


def test_words_at_which_readers_stopped_stand_nowhere():
    retired = re.compile(
        r"shader texts?\b|that serves\b|(do not|cannot|would) tell\b|tells? (more|most)\b|told (apart|as)\b|"
        r"± (data|law)\b|\d runs \(noise|stretches of one sign|steadied by",
        re.IGNORECASE,
    )
    texts = [
        *ROOT.glob("*.md"),
        *(path for one in ("docs", "docs/[!l_]*", "notebooks") for path in ROOT.glob(f"{one}/*.*")),
    ]
    texts += [path for one in ("profilefit", "mcml_sim", "examples") for path in (ROOT / one).rglob("*.*")]
    read = [path for path in texts if path.suffix in (".md", ".py", ".ipynb", ".toml", ".html", ".js")]
    assert len(read) > 250
    lines = [(path, line) for path in read for line in path.read_text("utf-8").splitlines()]
    assert [(path.name, line) for path, line in lines if retired.search(line)] == []
    assert retired.search("THE DATA CANNOT TELL alpha FROM scale"), "negative control"


# The examples


@pytest.mark.slow
def test_the_law_of_thirty_lines_is_one(monkeypatch, capsys):
    lines = (EXAMPLES / "one_exponential.py").read_text(encoding="utf-8").splitlines()
    assert sum(bool(line.strip()) for line in lines) <= 33
    monkeypatch.syspath_prepend(EXAMPLES)
    fitted = runpy.run_path(str(EXAMPLES / "fit_one_exponential.py"))
    printed = capsys.readouterr().out
    assert printed in (DOCS / "howto/add-a-law.md").read_text(encoding="utf-8")
    law = fitted["fit"].law
    x = np.linspace(0.0, 40.0, 4001)[1:]
    inside = np.cumsum(2 * np.pi * x * law.profile(x, 0.9)) * (x[1] - x[0])
    assert inside[-1] == pytest.approx(law.albedo.reflectance(0.9), rel=5e-3)  # the source's half step is left out
    assert law.cdf(law.sampler.sample(0.3, 0.9), 0.9) == pytest.approx(0.3)


@pytest.mark.skipif(shutil.which("glslangValidator") is None, reason="glslangValidator is not there (glslang-tools)")
@pytest.mark.parametrize(("printed", "call"), [("scatter", "radiance(uv)"), ("scatter_stack", "radiance(uv), 1.0")])
def test_the_shader_that_is_printed_compiles(tmp_path, printed, call):
    if printed == "scatter":
        law = export(catalogue.find("hazard-diffuse", FITS), FITS)
    else:
        law = export_stack(stack.load(FITS / STACKS / "skin.json"))
    main = f"in vec2 uv;\nout vec4 colours;\nvoid main() {{ colours = vec4({call}); }}\n"
    path = tmp_path / "scatter.frag"
    path.write_text(f"#version 330\n{law}{(EXAMPLES / f'{printed}.glsl').read_text()}{main}", encoding="utf-8")
    run("glslangValidator", path)


@pytest.mark.slow
def test_the_first_page_draws_light_that_bleeds_into_the_shadow(tmp_path, open_page):
    law = export_subject("hazard-diffuse", "glsl-es", fits=FITS, n=1.4)
    text = (EXAMPLES / "edge.html").read_text(encoding="utf-8")
    assert text.count('await (await fetch("skin.glsl")).text()') == 1
    page = text.replace('await (await fetch("skin.glsl")).text()', json.dumps(law))
    (tmp_path / "edge.html").write_text(page, encoding="utf-8")
    drawn = plt.imread(io.BytesIO(open_page(tmp_path / "edge.html").locator("canvas").screenshot()))[..., :3]
    shadow, bleeding = drawn[75, 500], drawn[225, 500]
    assert not shadow.any()
    assert bleeding[0] > bleeding[1] > bleeding[2] > 0.01, "red travels farthest"


def test_the_recipe_that_is_printed_is_one():
    skin = recipe.read(EXAMPLES / "gaussians-skin.toml")
    assert (skin.law, skin.truth, skin.setting.n) == ("gaussians:4", "exact", 1.4)


def beside_python(*folders, **names):
    """The environment with this Python, and what lies in the folders, found first."""
    path = os.pathsep.join(map(str, (*folders, Path(sys.executable).parent, os.environ["PATH"])))
    return {**os.environ, "PATH": path, **names}


SRUN = """#!/bin/sh
# What srun does with a step of two tasks, without a cluster.
"$@" & "$@" & wait
"""


@pytest.mark.slow
def test_the_slurm_script_runs_its_command_on_its_workers(tmp_path):
    (tmp_path / "srun").write_text(SRUN)
    (tmp_path / "srun").chmod(0o755)
    command = ["bash", EXAMPLES / "slurm.sh", sys.executable, EXAMPLES / "on_a_cluster.py", "@", "2e6"]
    printed = run(*command, cwd=tmp_path, env=beside_python(tmp_path, SLURM_JOB_ID="7"), timeout=240)
    assert re.match(r"A 0\.\d{6} ± 0\.000\d{3} from 2000000 photons", printed)
    assert len(list((tmp_path / "skin.photons").glob("batch-*.npz"))) == 2


@pytest.mark.slow
def test_the_array_of_shares_is_the_run(tmp_path):
    """Three tasks of four batches, one of them sent twice."""
    text = (EXAMPLES / "share.py").read_text(encoding="utf-8").replace("1_000_000_000", "4_000_000")
    (tmp_path / "share.py").write_text(text, encoding="utf-8")

    def told(task=None):
        environment = beside_python(SLURM_ARRAY_TASK_ID=str(task), SLURM_ARRAY_TASK_COUNT="3")
        command = [sys.executable, "share.py"] if task is None else ["bash", EXAMPLES / "array.sh"]
        return run(*command, cwd=tmp_path, env=environment, timeout=240)

    def times():
        return {path: path.stat().st_mtime_ns for path in tmp_path.glob("shares.photons/batch-*")}

    assert [told(task) for task in (0, 1, 1, 2)] == [f"{n} batches traced\n" for n in (2, 1, 0, 1)]
    before = times()
    assert "Estimate(value=" in told()
    assert times() == before
    assert len(before) == 4


@pytest.mark.slow
def test_the_cluster_of_two_processes_traces():
    assert "Estimate(value=" in run(sys.executable, EXAMPLES / "local_cluster.py", timeout=240)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["README.md", "docs/tutorials/mcml.md"])
def test_the_python_that_is_printed_runs(page, tmp_path, monkeypatch):
    """With a hundredth of the photons, beside the files of the run that the tutorial begins with."""
    monkeypatch.chdir(tmp_path)
    slab = ["run", str(ROOT / "examples/slab.mci"), "--photons", "1e4", "--out", "runs", "--quiet"]
    COMMANDS["mcml-sim"](slab, standalone_mode=False)
    blocks = re.findall(r"```python\n(.+?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    exec("\n".join(blocks).replace("1_000_000", "10_000"), {})


# The numbered scripts of `examples/`: short, and they run as they stand

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
SMOKE = "02_shader_source.py"
LONGEST = 25  # lines


def test_each_is_one_idea():
    assert len(SCRIPTS) == 5
    assert {path.name for path in SCRIPTS if len(path.read_text().splitlines()) > LONGEST} == set()


@pytest.mark.parametrize(
    "name", [path.name if path.name == SMOKE else pytest.param(path.name, marks=pytest.mark.slow) for path in SCRIPTS]
)
def test_scripts_run_and_say_nothing_but_the_answer(name, tmp_path):
    line = [sys.executable, ROOT / "examples" / name]
    done = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, timeout=250)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("\n") >= 1
    assert list(tmp_path.iterdir()) == []


# The commands


def test_make_ends_when_a_worker_dies(tmp_path):
    """As the Makefile runs the tests: the run fails at once and names the test, where it waited for ever."""
    words = re.search(r"^PYTEST := \$\(PY\) (-m pytest .*)$", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
    (tmp_path / "test_dead.py").write_text("import os\ndef test_lives(): pass\ndef test_dies(): os._exit(9)\n")
    for name in "abc":
        (tmp_path / f"test_{name}.py").write_text("def test_one(): pass\ndef test_two(): pass\n")
    command = [sys.executable, *words[1].replace("auto", "1").split(), "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "crashed while running 'test_dead.py::test_dies'" in done.stdout


# The site


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    out = tmp_path_factory.mktemp("site")
    run(sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", DOCS, out)
    return out


@pytest.mark.slow
def test_the_site_needs_no_network(site):
    """No script, style, font or picture from elsewhere; links for readers are no part of a page."""
    loads = ("<(?:script|img|iframe)[^>]+src=", """<link[^>]+rel=["']stylesheet["'][^>]+href=""")
    for page, tag in product(site.rglob("*.html"), loads):
        assert not re.search(rf"""{tag}["'](?:https?:)?//""", page.read_text(encoding="utf-8")), page
    assert "<math" in (site / "theory/exact.html").read_text(encoding="utf-8")


# Tables, numbered formulas and, in a narrow window, code scroll by themselves; nothing else is wider than its place.
FITS_THE_WINDOW = """code => [document.documentElement, ...document.querySelectorAll('article p, article li' + code)]
    .every(one => one.scrollWidth <= one.clientWidth + 1 || getComputedStyle(one).display == 'inline')"""


@pytest.mark.slow
@pytest.mark.parametrize(("width", "code"), [(400, ""), (1366, ", article pre")])
def test_nothing_of_the_site_is_cut_off(site, width, code, open_page):
    page = open_page(site / "index.html", width)
    for path in sorted(site.rglob("*.html")):
        page.goto(path.as_uri())
        assert page.evaluate(FITS_THE_WINDOW, code), path
