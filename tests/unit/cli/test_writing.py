"""What `--out` and its kin do to what is there already: devices, pipes, links, folders, modes, records in pairs."""

import os
import stat
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from profilefit.errors import OutputError
from profilefit.recipes import record
from profilefit.recipes.catalogue import fits_folder
from profilefit.report.figures.canvas import canvas, save

EXPORT = ("export", "burley", "--out")
NOBODY = 65534


def device(path: Path, minor: int) -> Path:
    """A null (3) or full (7) of one's own: the system's is not what to try a writer on."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, minor))
        with path.open("wb"):
            return path
    except PermissionError:
        pytest.skip("only root may make a device")


@pytest.mark.parametrize("link", [False, True])
def test_a_device_stays_one(command, tmp_path, link):
    null = device(tmp_path / "null", 3)
    if link:
        (tmp_path / "out").symlink_to("null")
    assert command(*EXPORT, "out" if link else "null") == (0, "", "")
    assert stat.S_ISCHR(null.stat().st_mode)
    assert (tmp_path / "out").is_symlink() == link


def test_a_full_disk_is_one_line(command, tmp_path):
    device(tmp_path / "full", 7)
    assert command(*EXPORT, "full") == (2, "", "profilefit: cannot write full: No space left on device\n")


def test_a_pipe_gets_the_text(command, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert command(*EXPORT, "pipe") == (2, "", "profilefit: cannot write pipe: it is a pipe that nobody reads from\n")
    # Open for both, so that it is ready before the command is; emptied by a thread, as it holds 64 KB only.
    handle, read = os.open("pipe", os.O_RDWR), []
    reader = threading.Thread(target=lambda: read.append(os.read(handle, 2**20)))
    reader.start()
    assert command(*EXPORT, "pipe") == (0, "", "")
    reader.join()
    os.close(handle)
    assert read == [command(*EXPORT[:-1])[1].encode()]
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_standard_output_by_name_is_standard_output(tmp_path):
    """A log that is appended to keeps what it held."""
    log = tmp_path / "log"
    log.write_text("first\n")
    with log.open("a") as file:
        subprocess.run([sys.executable, "-m", "profilefit", *EXPORT, "/dev/stdout"], stdout=file, check=True)
    assert log.read_text().startswith("first\n// by profilefit")


def test_folders_links_and_modes(command, tmp_path):
    Path("folder").mkdir()
    assert command(*EXPORT, "folder") == (2, "", "profilefit: cannot write folder: it is a folder\n")
    Path("loop").symlink_to("loop")
    said = "profilefit: cannot write loop: Too many levels of symbolic links\n"
    assert command(*EXPORT, "loop") == (2, "", said)
    Path("link").symlink_to("folder/law.glsl")
    before = os.umask(0o077)
    try:
        assert command(*EXPORT, "link") == (0, "", "")
    finally:
        os.umask(before)
    assert Path("link").is_symlink()
    assert stat.S_IMODE(Path("folder/law.glsl").stat().st_mode) == 0o600
    Path("folder/law.glsl").chmod(0o664)
    assert command(*EXPORT, "link") == (0, "", "")
    assert stat.S_IMODE(Path("folder/law.glsl").stat().st_mode) == 0o664


@pytest.mark.skipif(os.geteuid() != 0, reason="takes root to be another user")
@pytest.mark.skipif(
    not all(folder.stat().st_mode & 0o001 for folder in Path(__file__).parents), reason="others cannot read this clone"
)
def test_a_folder_of_another_user_is_one_line():
    with tempfile.TemporaryDirectory() as name:  # pytest's own folders are private
        Path(name).chmod(0o755)
        code = f"""
import os, sys
from profilefit.cli import main
for words in {EXPORT[:-1]!r}, {(*EXPORT, f"{name}/law.glsl")!r}:
    sys.argv = ["profilefit", *words]
    try:
        main()
    except SystemExit as end:
        if end.code:
            raise
    os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})  # now that all is imported, from wherever it is
"""
        child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert (child.returncode, child.stderr) == (2, f"profilefit: cannot write {name}/law.glsl: Permission denied\n")
        assert not os.listdir(name)


def test_what_is_filled_in_place_must_be_a_file(command, tmp_path):
    """To read a pipe would wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    status, out, err = command("report", "burley-whole", "--markdown", "pipe")
    assert (status, out, err) == (
        2,
        "",
        "profilefit: --markdown must be a file whose tables are filled in, got pipe, which is none\n",
    )


def test_a_figure_or_a_record_is_both_of_its_files_or_none(tmp_path):
    (tmp_path / "one.svg").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*one\.svg: it is a folder"):
        save(canvas(1.0, layout=None), tmp_path, "one")
    (tmp_path / "two.json").mkdir()
    path = fits_folder() / "burley-whole.json"
    with pytest.raises(OutputError, match=r"cannot write .*two\.json: it is a folder"):
        record.write(tmp_path, "two", record.read(path), record.read_arrays(path))
    assert {one.name for one in tmp_path.iterdir()} == {"one.svg", "two.json"}
