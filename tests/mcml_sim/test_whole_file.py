"""Files that are whole or absent."""

import os
import stat

import pytest

from mcml_sim.errors import OutputError
from mcml_sim.whole_file import require_writable, write_whole


def test_writes_and_replaces(tmp_path):
    path = tmp_path / "file"
    require_writable(path)
    assert not path.exists()
    write_whole(path, b"old")
    write_whole(path, b"new")
    assert path.read_bytes() == b"new"
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_link_is_followed(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_whole(tmp_path / "link", b"text")
    assert (tmp_path / "file").read_bytes() == b"text"
    assert (tmp_path / "link").is_symlink()


def test_folders_and_devices_are_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe"):
        for call in (require_writable, lambda path: write_whole(path, b"")):
            with pytest.raises(OutputError, match=r"cannot write .*: it is there already, and no file"):
                call(path)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_folder_that_is_missing_is_made_ahead(tmp_path):
    require_writable(tmp_path / "a" / "b" / "file")
    assert (tmp_path / "a" / "b").is_dir()
    with pytest.raises(OutputError, match=r"cannot write .*: No such file or directory"):
        write_whole(tmp_path / "c" / "file", b"")


@pytest.mark.parametrize("name", ["file\0", "f" * 300])
def test_names_that_no_file_has(tmp_path, name):
    with pytest.raises(OutputError, match="cannot write "):
        write_whole(tmp_path / name, b"")


def test_a_file_in_the_way_of_a_folder(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(OutputError, match="cannot write "):
        require_writable(tmp_path / "a" / "file")
