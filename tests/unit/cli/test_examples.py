"""`profilefit examples`: the files that other commands' examples read, copied and never over anything."""

from pathlib import Path

import pytest

SHIPPED = Path(__file__).parents[3] / "examples"


def test_every_file_is_copied_and_named(command):
    status, out, err = command("examples")
    assert (status, err) == (0, "")
    assert out.splitlines() == [f"examples/{path.name}" for path in sorted(SHIPPED.iterdir())]
    assert all(Path("examples", path.name).read_bytes() == path.read_bytes() for path in SHIPPED.iterdir())


@pytest.mark.parametrize("there", ["file", "link"])
def test_what_is_there_is_never_replaced_and_nothing_is_half_copied(command, there):
    Path("trial").mkdir()
    taken = Path("trial/skin.toml")
    taken.write_text("mine") if there == "file" else taken.symlink_to("nowhere")
    status, out, err = command("examples", "--out", "trial")
    assert (status, out) == (2, "")
    assert err == ("profilefit: cannot write into trial: skin.toml would be replaced; use --out with another folder\n")
    assert [path.name for path in Path("trial").iterdir()] == ["skin.toml"]
    assert taken.is_symlink() or taken.read_text() == "mine"


def test_where_nothing_can_be_written_is_one_line(command):
    Path("file").write_text("")
    status, out, err = command("examples", "--out", "file/inside")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "profilefit: cannot write" in err
