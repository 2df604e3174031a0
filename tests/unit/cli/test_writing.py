"""What a command writes goes through the writer of whole files, whose refusals are one line; records come in pairs."""

import os
from pathlib import Path

import pytest

from profilefit.errors import OutputError
from profilefit.recipes import record
from profilefit.recipes.catalogue import fits_folder
from profilefit.report.figures.canvas import canvas, save


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
