"""What a command writes goes through the writer of whole files, whose refusals are one line; pairs, and examples."""

import os
from pathlib import Path

import pytest

from profilefit.errors import OutputError
from profilefit.recipes import record
from profilefit.recipes.catalogue import fits_folder
from profilefit.report.figures.canvas import canvas, save
from tests.fixtures import EXAMPLES


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("pipe", "profilefit: cannot write pipe: it is a pipe that nobody reads from\n"),
        ("folder", "profilefit: cannot write folder: it is a folder\n"),
        ("loop", "profilefit: cannot write loop: Too many levels of symbolic links\n"),
    ],
)
def test_what_cannot_be_written_is_one_line(refused, name, said):
    os.mkfifo("pipe")
    Path("folder").mkdir()
    Path("loop").symlink_to("loop")
    assert refused(f"export burley --out {name}", "cannot write") == said


def test_what_is_filled_in_place_must_be_a_file(refused):
    """To read a pipe would wait for ever."""
    os.mkfifo("pipe")
    said = "--markdown must be a file whose tables are filled in, got pipe, which is none"
    assert refused("report burley-whole --markdown pipe", said) == f"profilefit: {said}\n"


def test_a_figure_or_a_record_is_both_of_its_files_or_none(tmp_path):
    (tmp_path / "one.svg").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*one\.svg: it is a folder"):
        save(canvas(1.0, layout=None), tmp_path, "one")
    (tmp_path / "two.json").mkdir()
    path = fits_folder() / "burley-whole.json"
    with pytest.raises(OutputError, match=r"cannot write .*two\.json: it is a folder"):
        record.write(tmp_path, "two", record.read(path), record.read_arrays(path))
    assert {one.name for one in tmp_path.iterdir()} == {"one.svg", "two.json"}


def test_every_example_is_copied_and_named(done):
    out = done("examples")
    assert out.splitlines() == [f"examples/{name}" for name in EXAMPLES]
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


def test_where_nothing_can_be_written_is_one_line(refused):
    Path("file").write_text("")
    refused("examples --out file/inside", "profilefit: cannot write")
