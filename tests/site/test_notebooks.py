"""Every notebook runs as it is in the repository, stripped, and what its text says is what its cells print."""

import re
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from nbformat import NotebookNode

from profilefit.errors import ShaderError
from profilefit.shader.context import opened
from tests.site.test_wheel import run as command

FOLDER = Path(__file__).resolve().parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SECONDS = 120  # of a cell, which takes a tenth of that: what hangs is ended
NEEDS_OPENGL = ("04", "08", "09", "10", "11")  # numbers of notebooks
EXPLORE = FOLDER / "05-explore.ipynb"
LONGEST = 12  # lines of a function that a notebook may define: a longer one belongs in the package

SMOKE = FOLDER / "04-check-the-shader.ipynb"
FIRST = 6  # cells of it, up to the first picture: a whole notebook takes half a minute

STEMS = [path.stem for path in NOTEBOOKS]


@pytest.fixture(autouse=True)
def reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel draws into the notebook, as a reader's does."""
    monkeypatch.delenv("MPLBACKEND", raising=False)


def run(path: Path, *more: str, first: int | None = None) -> NotebookNode:
    """The notebook, or its first cells, after a run from where it lies, with more cells at its end."""
    notebook = nbformat.read(path, as_version=4)
    notebook.cells = notebook.cells[:first] + [nbformat.v4.new_code_cell(source) for source in more]
    NotebookClient(notebook, timeout=SECONDS, kernel_name="python3", resources={"metadata": {"path": FOLDER}}).execute()
    return notebook


@cache
def executed(path: Path, first: int | None = None) -> NotebookNode:
    """The same, once for all tests, where there is the OpenGL that it needs."""
    if path.stem[:2] in NEEDS_OPENGL:
        try:
            with opened():
                pass
        except ShaderError as error:
            pytest.skip(str(error))
    return run(path, first=first)


def outputs(notebook: NotebookNode, kind: str) -> list[NotebookNode]:
    return [one for cell in notebook.cells for one in cell.get("outputs", ()) if one.output_type == kind]


def pictures(notebook: NotebookNode) -> list[str]:
    """Pictures as base64, of cells and not of widgets."""
    return [one.data["image/png"] for one in outputs(notebook, "display_data") if "image/png" in one.data]


def prints(stem: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Run a test, one of the slow ones, with what this notebook prints."""
    given = pytest.mark.parametrize("text", [stem], indirect=True)
    return lambda test: pytest.mark.slow(given(test))


@pytest.fixture
def text(request: pytest.FixtureRequest) -> str:
    """What the cells of a notebook print, plainly and as tables."""
    notebook = executed(FOLDER / f"{request.param}.ipynb")
    tables = (one.data["text/plain"] for one in outputs(notebook, "display_data"))
    return "\n".join([*(one.text for one in outputs(notebook, "stream")), *tables])


def numbers(pattern: str, text: str) -> list[float]:
    """The first group of every match."""
    return [float(found) for found in re.findall(pattern, text)]


def test_there_are_eleven_and_a_table_of_them():
    assert [path.stem[:2] for path in NOTEBOOKS] == [f"{number:02d}" for number in range(1, 12)]
    assert re.findall(r"\((\S+\.ipynb)\)", (FOLDER / "README.md").read_text()) == [path.name for path in NOTEBOOKS]


def test_nbstripout_finds_nothing_to_strip():
    pytest.importorskip("nbstripout")
    command(sys.executable, "-m", "nbstripout", "--verify", *NOTEBOOKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=STEMS)
def test_notebooks_are_stripped_with_text_between_cells_links_that_lead_and_no_long_helper(path):
    notebook = nbformat.read(path, as_version=4)
    cells = notebook.cells
    assert set(notebook.metadata) <= {"kernelspec", "language_info"}
    left = [cell.id for cell in cells if cell.metadata or cell.get("outputs") or cell.get("execution_count")]
    assert left == [], "strip outputs before committing: nbstripout notebooks/*.ipynb"
    kinds = [cell.cell_type for cell in cells]
    assert kinds[0] == kinds[-1] == "markdown"
    assert "code code" not in " ".join(kinds)
    functions = re.compile(r"^def .*\n(?:(?:[ \t].*)?\n?)*", re.MULTILINE)
    blocks = [block.rstrip().splitlines() for cell in cells for block in functions.findall(cell.source)]
    assert [block for block in blocks if len(block) > LONGEST] == []
    assert "**" in cells[0].source, "the question comes first"
    assert "## What was learnt" in cells[-1].source
    words = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    assert [link for link in re.findall(r"\]\(([^)#]+)\)", words) if not (FOLDER / link).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize("cells", [*((path,) for path in NOTEBOOKS), (SMOKE, FIRST)], ids=[*STEMS, "the-first-of-one"])
def test_runs_draws_warns_of_nothing_and_leaves_nothing_behind(cells):
    before = set(FOLDER.rglob("*"))
    notebook = executed(*cells)
    assert outputs(notebook, "error") == []
    assert [one.text for one in outputs(notebook, "stream") if one.name == "stderr"] == []
    assert pictures(notebook)
    assert set(FOLDER.rglob("*")) - before == set()


@prints("01-simulate-and-read-error-bars")
def test_repeats_scatter_as_the_error_bars_say_and_sums_do_not(text):
    (ratio,) = numbers(r"stated over true, .*: (\d\S+) on average", text)
    assert 0.9 < ratio < 1.1, "thirty repeats of thirty rings know it to a few per cent"
    (scatter,) = numbers(r"true scatter .*± (\S+)", text)
    (squares,) = numbers(r"squares of the annuli's bars\s+± (\S+)", text)
    assert squares > 1.5 * scatter
    assert "of   0 effective photons" in text
    assert max(numbers(r"alpha 0.5, r = .*± (\S+) of the exact light, 1.0 photons", text)) < 1e-3
    assert "the same bits as without a break: True" in text


@prints("02-refit-the-paper")
def test_printed_constants_of_the_paper_are_seen_to_fail(text):
    assert min(numbers(r"energy of \(17\) over A:\s+(\S+) as printed", text)) > 10
    assert all(0.9 < one < 1.1 for one in numbers(r"as printed, (\S+) with b0", text))
    assert min(numbers(r"(?m)^[abc]\d .* (\d+)$", text)) > 5, "photons are the smallest of a constant's errors"
    rows = re.findall(r"(?m)^[bc]\d  +(\d\S+e\S+)  +(\S+)  +(\S+)  +(\S+)$", text)
    assert rows
    assert all(10 * float(photons) < min(map(float, others)) for photons, *others in rows)
    *others, hazard = numbers(r"mean error of R_d (\d\S+),", text)
    assert 10 * hazard < min(others)
    assert re.search(r"\(8\) as printed .*rises all the way: False", text)
    assert re.search(r"rational map .*rises all the way: True", text)


@prints("03-what-errors-mean-on-screen")
def test_light_and_surface_cost_more_steps_than_a_law(text):
    published, refitted, hazard, beam, index = numbers(r"off by at most\s+(\S+) steps", text)
    assert hazard < 0.2 < refitted < published < beam < index
    (apart,) = numbers(r"± model\s+taken one by one\s+(\S+) steps", text)
    (together,) = numbers(r"± model .*together\s+(\S+) steps", text)
    assert apart > 1 > 2 * together
    most, least = numbers(r"(?m)^[a-h]\d: (\d+) % show as one step", text)
    assert most < 8 < 100 < least


@prints("04-check-the-shader")
def test_check_finds_a_misprint_and_a_slip_of_the_pen(text):
    assert "hazard: 7 bounds, 0 broken" in text
    assert "FAIL energy by (17)" in text
    assert re.findall(r"typed as \S+: (\w+),", text) == ["FAIL", "FAIL", "pass", "pass"]
    alpha, colour = numbers(r"in the texture: off by at most (\S+) of 255", text)
    assert alpha > 1 > 40 * colour / alpha


@prints("05-explore")
def test_layers_hide_from_the_eye_and_the_index_does_not(text):
    assert max(numbers(r"at worst (\S+) % of white", text)) < 0.5
    assert all(8 < one < 23 for one in numbers(r"g 0.8, .*:\s+(\S+) % too much", text))
    assert max(numbers(r"g 0.0, .*:\s+(\S+) % too much", text)) < 0.1
    assert max(numbers(r"largest error (\S+) % at that n and g", text)) < 0.4
    assert [one < 0.15 for one in numbers(r"hazard, .*: largest error (\S+) %", text)] == [False, True]


@prints("06-fit-your-own-data")
def test_fits_report_what_is_not_identifiable(text):
    assert "alpha AND scale ARE NOT SEPARATELY IDENTIFIABLE" in text
    assert "most informative additional measurement: the scale" in text
    assert "MISFIT (p-value below 1e-16)" in text
    ((data, misfit),) = re.findall(r"two layers: mu_a = \S+ ± (\S+) \(statistical\) ± (\S+) \(lack of fit\)", text)
    assert float(misfit) > 3 * float(data)


@prints("07-when-do-layers-matter")
def test_layers_matter_where_mean_free_paths_differ(text):
    (skin,) = numbers(r"red: A .* off by (\S+) % of white at an edge", text)
    assert 1 < skin < 3
    (layers, half_space) = re.findall(r"beyond .* mm: (\S+) of the light .*, (\S+) of that of the half space", text)[0]
    assert float(layers) > 5 * float(half_space)
    assert 0 < max(numbers(r"cdf off by (\S+) %", text)) < 0.5
    assert max(numbers(r"below 1 times its mean free path: (\S+) %", text)) < 0.2
    assert min(numbers(r"below (?!1 )\S+ times its mean free path: (\S+) %", text)) > 0.5


@prints("08-texture-or-screen")
def test_a_split_is_nearest_on_atlases_of_any_texel(text):
    lines = {line.split()[0]: line for line in text.splitlines() if "texel" in line and "crossover" not in line}
    split, texture, screen = (numbers(r"texel \S+ mm: (\S+)", lines[kind]) for kind in ("split", "texture", "screen"))
    assert len(split) == 3
    assert max(split) < 0.5 * min(screen)
    assert split[0] < 1.03 * texture[0]  # texels finer than the narrowest Gaussian that matters
    assert all(a < b for a, b in zip(split[1:], texture[1:], strict=True))
    assert max(split) < 1.5 * min(split)
    assert max(texture) > 2 * min(texture)


@pytest.mark.slow
def test_sliders_redraw_after_all_cells_have_run():
    shown = "print(*(one.get('text', '\\n') for one in interactive.out.outputs), end='')"
    notebook = run(EXPLORE, shown, "sliders['g'].value, sliders['n'].value = 0.9, 1.6", shown)
    before, after = (one.text for one in outputs(notebook, "stream")[-2:])
    assert before.startswith("alpha 0.90, l 0.50 mm, n 1.4, g 0: ")
    assert after.startswith("alpha 0.90, l 0.50 mm, n 1.45, g 0.9: "), "the nearest n with exact light"
    assert before.count("\n") == after.count("\n") == 2, "a line and a picture"


@pytest.mark.slow
def test_without_ipywidgets_one_line_stands_in_for_the_sliders(tmp_path, monkeypatch):
    (tmp_path / "ipywidgets.py").write_text("raise ImportError('not installed')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    notebook = run(EXPLORE)
    assert "no sliders without ipywidgets: pip" in "".join(one.text for one in outputs(notebook, "stream"))
    assert len(pictures(notebook)) == len(pictures(executed(EXPLORE)))


@pytest.mark.slow
@pytest.mark.parametrize("stem", ["03-what-errors-mean-on-screen", "04-check-the-shader", "08-texture-or-screen"])
def test_without_opengl_one_line_says_so(stem, monkeypatch):
    monkeypatch.setenv("GLCONTEXT_LINUX_LIBEGL", "libEGL-none.so")
    notebook = run(FOLDER / f"{stem}.ipynb")
    told = [one.text for one in outputs(notebook, "stream") if "no OpenGL" in one.text]
    assert len(told) == 1
    assert "libEGL-none.so is missing" in told[0]
    assert outputs(notebook, "error") == []
    assert pictures(notebook)


@prints("09-under-the-sea")
def test_light_of_the_sea_is_turned_more_than_once(text):
    more = numbers(r"there is (\S+) times as much light", text)
    assert more == sorted(more)
    assert more[-1] > 2.0
    wrong, *_ = numbers(r"wireframe, constant .* bright (\S+) %", text)
    right, *_ = numbers(r"cells .* bright (\S+) %", text)
    assert abs(right) < 1.0
    assert wrong < -20.0
    broadened, scaled, single = numbers(r"error (\S+)", text)
    assert broadened < 0.6 * scaled < 0.6 * single


@prints("10-how-many-layers")
def test_swept_slabs_need_the_fewest_layers(text):
    assert max(numbers(r"off by (\S+) at most", text)) < 0.03
    linear, quadratic, _, swept, two = numbers(r"16 layers: (\S+)", text)
    assert two < 0.5 * swept < 0.1 * quadratic < 0.1 * linear
    one, other = map(int, re.search(r"(\d+) swept slabs, or (\d+) with", text).groups())
    assert other < one <= 16
    linear, quadratic, two = numbers(r"error (\S+) of the mean", text)
    assert two < 0.5 * quadratic < 0.5 * linear


@prints("11-from-photographs-to-a-ball")
def test_cards_make_the_medium_surer_and_the_ball_with_it(text):
    assert max(numbers(r"off by (\S+) of its errors", text)) < 3.5
    alone, cards = ([float(one) for one in re.findall(rf"{label} +\S+ +known to (\S+)%", text)]
                    for label in ("alone", "with cards"))  # fmt: skip
    assert max(cards) < 0.5 * max(alone)
    blind, sure = numbers(r"spread (\S+) of", text)
    assert sure < 0.7 * blind
    assert max(numbers(r"ball is off by (\S+) steps", text)) < 4.0
