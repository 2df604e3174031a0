"""The one writer: what it does with everything that a name may stand for, and what is left when it fails."""

import json
import os
import re
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from textwrap import indent
from types import SimpleNamespace

import pytest

from mcml_sim.errors import OutputError
from mcml_sim.files.whole_file import require_folder, require_target, require_writable, write_together, write_whole

NOBODY = 65534
IS_ROOT = os.geteuid() == 0


def names(folder: Path) -> set[str]:
    return set(os.listdir(folder))


def contents(folder: Path) -> dict[str, str]:
    return {name: (folder / name).read_text() for name in names(folder)}


def write(path: Path) -> None:
    write_whole(path, b"text")


def refused(path: Path, reason: str, call=write) -> None:
    """It is refused in one line, which names the file."""
    with pytest.raises(OutputError, match=rf"^cannot write {re.escape(str(path))}: {reason}$"):
        call(path)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def device(path: Path, minor: int) -> Path:
    """A node for null (3), zero (5) or full (7) of one's own: a writer that is wrong must not replace the system's."""
    try:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, minor))
        with path.open("wb"):  # a file system may be mounted without devices
            return path
    except PermissionError:
        pytest.skip("only root may make a device")


BEGIN = """
import os, sys
from pathlib import Path
from mcml_sim.errors import OutputError
from mcml_sim.files.whole_file import *
"""
BE_NOBODY = f"os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})"


def in_a_process(code: str, *words: object, before: tuple[str, ...] = (), out: object = subprocess.PIPE) -> str:
    """What a child prints, which has imported the writer; what goes wrong there is one line."""
    program = f"{BEGIN}try:\n{indent(code, '    ')}\nexcept OutputError as error:\n    print(error)\n"
    child = subprocess.run(
        [*before, sys.executable, "-c", program, *map(str, words)],
        stdout=out,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    assert child.returncode == 0, child.stderr
    return child.stdout


@pytest.fixture
def open_folder():
    """A folder that other users get to; pytest's own are private."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.mark.parametrize("content", [b"new", "new"])
def test_writes_and_replaces(tmp_path, content):
    path = tmp_path / "file"
    require_writable(path)
    assert not path.exists()
    write_whole(path, b"old")
    write_whole(path, content)
    assert path.read_bytes() == b"new"
    assert names(tmp_path) == {"file"}


def test_half_a_character_of_a_file_name_is_escaped(tmp_path):
    """A page that names a file of other bytes than UTF-8 took two minutes, and was refused at the end."""
    write_whole(tmp_path / "file", '{"file": "µ\udcff.csv"}')
    assert json.loads((tmp_path / "file").read_bytes()) == {"file": "µ\udcff.csv"}


@pytest.mark.parametrize("make", [True, False])
def test_room_and_names_are_looked_at_before(tmp_path, monkeypatch, make):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "fit.json").mkdir()
    (tmp_path / "file").touch()
    require_folder(tmp_path / "out", "fit.png", make=make)
    with pytest.raises(OutputError, match=r"^cannot write .*out/fit\.json: it is a folder$"):
        require_folder(tmp_path / "out", "fit.png", "fit.json", make=make)
    with pytest.raises(OutputError, match=r"^cannot write into .*file/in: Not a directory$"):
        require_folder(tmp_path / "file" / "in", make=make)
    require_folder(tmp_path / "new" / "deep", make=make)
    assert (tmp_path / "new" / "deep").is_dir() == make
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=10**12, free=3_000_000))
    told = r"^cannot write into .*out: No space left on device: 3\.0 MB are free, {} MB may be needed$"
    with pytest.raises(OutputError, match=told.format(4)):
        require_folder(tmp_path / "out", make=make)
    with pytest.raises(OutputError, match=told.format(50)):
        require_writable(tmp_path / "out" / "page.html", room=50e6)
    require_folder(tmp_path / "out", room=2e6, make=make)


def test_a_device_is_written_into_by_a_link_too(tmp_path):
    null, link = device(tmp_path / "null", 3), tmp_path / "link"
    link.symlink_to("null")
    for path in (null, link):
        require_writable(path)
        write(path)
    assert stat.S_ISCHR(null.stat().st_mode)
    assert link.is_symlink()
    assert names(tmp_path) == {"null", "link"}


def test_a_full_device_is_one_line(tmp_path):
    full = device(tmp_path / "full", 7)
    refused(full, "No space left on device")
    assert stat.S_ISCHR(full.stat().st_mode)


def test_a_pipe_is_written_into(tmp_path):
    """More than it holds at once, so that its reader is waited for."""
    pipe, data, read = tmp_path / "pipe", os.urandom(2**20), []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    require_writable(pipe)
    deadline = time.monotonic() + 10
    while True:
        try:
            write_whole(pipe, data)
            break
        except OutputError:  # the reader has not got to it yet
            assert time.monotonic() < deadline
            time.sleep(0.01)
    reader.join()
    assert read == [data]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert names(tmp_path) == {"pipe"}


def test_a_pipe_that_nobody_reads_is_one_line_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    refused(tmp_path / "pipe", "it is a pipe that nobody reads from")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_standard_output_is_written_into_whatever_it_is(tmp_path):
    """Also where it is a file that others append to, which a renamed one would part from them."""
    (tmp_path / "link").symlink_to("/dev/stdout")
    code = "for one in sys.argv[1:]:\n    print('before')\n    write_whole(Path(one), b'text\\n')\n    print('after')"
    streams = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", tmp_path / "link")
    expected = "before\ntext\nafter\n" * len(streams)
    assert in_a_process(code, *streams) == expected
    log = tmp_path / "log"
    log.write_text("first\n")
    with log.open("a") as file:
        in_a_process(code, *streams, out=file)
    assert log.read_text() == f"first\n{expected}"
    assert names(tmp_path) == {"log", "link"}


def test_a_closed_standard_output_is_one_line():
    told = in_a_process("write_whole(Path('/dev/fd/57'), b'')")
    assert told == "cannot write /dev/fd/57: Bad file descriptor\n"


def test_a_link_is_followed(tmp_path):
    (tmp_path / "sub").mkdir()
    for target in ("there", "dangling"):
        link, file = tmp_path / f"to-{target}", tmp_path / "sub" / target
        link.symlink_to(f"sub/{target}")
        if target == "there":
            file.write_text("old")
        require_writable(link)
        write_whole(link, b"text")
        assert file.read_bytes() == b"text"
        assert link.is_symlink()
    assert names(tmp_path / "sub") == {"there", "dangling"}


def test_links_that_lead_nowhere_are_one_line(tmp_path):
    (tmp_path / "one").symlink_to("two")
    (tmp_path / "two").symlink_to("one")
    (tmp_path / "far").symlink_to("no/such/folder/file")
    refused(tmp_path / "far", "No such file or directory")
    for call in (write, require_writable):
        refused(tmp_path / "one", "Too many levels of symbolic links", call)
    assert names(tmp_path) == {"one", "two", "far"}


@pytest.mark.parametrize("call", [require_target, require_writable, write])
def test_folders_and_sockets_are_refused(tmp_path, call, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a socket's name is short
    Path("folder").mkdir()
    Path("link").symlink_to("folder")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        refused(Path("folder"), "it is a folder", call)
        refused(Path("link"), "it is a folder", call)
        refused(Path("socket"), "it is a socket, not a file", call)
    assert names(tmp_path) == {"folder", "link", "socket"}


@pytest.mark.skipif(not IS_ROOT, reason="only root may make a device")
def test_a_disk_is_refused(tmp_path):
    """A number that no driver has: nothing can be written there, were it tried."""
    os.mknod(tmp_path / "disk", stat.S_IFBLK | 0o666, os.makedev(240, 200))
    for call in (require_writable, write):
        refused(tmp_path / "disk", "it is a disk, not a file", call)


def test_a_folder_that_is_missing_is_made_ahead(tmp_path):
    require_writable(tmp_path / "a" / "b" / "file")
    assert (tmp_path / "a" / "b").is_dir()
    require_target(tmp_path / "c" / "file")
    assert names(tmp_path) == {"a"}
    with pytest.raises(OutputError, match=r"cannot write .*: No such file or directory"):
        write_whole(tmp_path / "c" / "file", b"")


@pytest.mark.parametrize("name", ["file\0", "f" * 300])
def test_names_that_no_file_has(tmp_path, name):
    with pytest.raises(OutputError, match="cannot write "):
        write_whole(tmp_path / name, b"")


@pytest.mark.parametrize("name", ["f" * 255, "ä" * 127, "." + "f" * 254])
def test_the_longest_names_are_no_trouble(tmp_path, name):
    for content in (b"old", b"new"):
        write_whole(tmp_path / name, content)
    write_together({tmp_path / "one": b"", tmp_path / name: b"pair"})
    assert names(tmp_path) == {name, "one"}
    assert (tmp_path / name).read_bytes() == b"pair"


def test_a_file_in_the_way_of_a_folder(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    for call in (require_writable, lambda path: require_folder(path.parent), write):
        with pytest.raises(OutputError, match="cannot write "):
            call(tmp_path / "a" / "file")


@pytest.mark.parametrize(("umask", "expected"), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_a_new_file_has_the_mode_of_the_umask(tmp_path, umask, expected):
    before = os.umask(umask)
    try:
        write_whole(tmp_path / "file", b"")
    finally:
        os.umask(before)
    assert mode(tmp_path / "file") == expected


@pytest.mark.parametrize("old", [0o600, 0o640, 0o755, 0o666])
def test_an_old_file_keeps_its_mode(tmp_path, old):
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(old)
    write_whole(path, b"new")
    assert (mode(path), path.read_bytes()) == (old, b"new")


def test_nobody_reads_along_while_a_private_file_is_replaced(tmp_path, monkeypatch):
    path, seen = tmp_path / "file", []
    path.write_text("old")
    path.chmod(0o600)
    sync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda file: seen.append(os.fstat(file).st_mode & 0o777) or sync(file))
    write_whole(path, b"new")
    assert seen == [0o600]


@pytest.mark.skipif(not IS_ROOT, reason="only root may give files away")
def test_root_leaves_a_file_its_owner(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")
    os.chown(path, NOBODY, NOBODY)
    path.chmod(0o640)
    write_whole(path, b"new")
    found = path.stat()
    assert (found.st_uid, found.st_gid, mode(path)) == (NOBODY, NOBODY, 0o640)


def test_a_hard_link_parts(tmp_path):
    (tmp_path / "one").write_text("old")
    os.link(tmp_path / "one", tmp_path / "other")
    write_whole(tmp_path / "one", b"new")
    assert contents(tmp_path) == {"one": "new", "other": "old"}


@pytest.mark.skipif(not IS_ROOT, reason="takes root to be another user")
def test_another_users_folder_and_a_read_only_file_are_one_line(open_folder):
    theirs, mine = open_folder / "theirs", open_folder / "mine"
    for folder in (theirs, mine):
        folder.mkdir()
        (folder / "file").write_text("old")
        (folder / "file").chmod(0o666)
    os.chown(mine, NOBODY, NOBODY)
    (mine / "kept").write_text("old")
    (mine / "kept").chmod(0o444)
    os.chown(mine / "kept", NOBODY, NOBODY)
    code = f"""
{BE_NOBODY}
for call in (lambda path: write_whole(path, "new"), require_writable):
    for name in sys.argv[1:]:
        try:
            call(Path(name))
        except OutputError as error:
            print(error)
"""
    closed = (theirs / "new", theirs / "file", mine / "kept")
    told = in_a_process(code, *closed, mine / "file").splitlines()
    lines = (*closed, f"into {theirs}", f"into {theirs}", mine / "kept")
    assert told == [f"cannot write {line}: Permission denied" for line in lines]
    assert contents(theirs) == {"file": "old"}
    assert contents(mine) == {"file": "new", "kept": "old"}
    assert (mine / "file").stat().st_uid == NOBODY


def pair(folder: Path, content: str) -> dict[Path, bytes | str]:
    return {folder / "a.npz": content, folder / "b.json": content}


LIMITED = """
import resource
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
write_together({Path(sys.argv[1], name): os.urandom(size) for name, size in (("a.npz", 100), ("b.json", 8192))})
"""
SMALL = """
import subprocess
folder = sys.argv[1]
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=True)
write_together({Path(folder, name): name.encode() for name in ("a.npz", "b.json")})
try:
    write_together({Path(folder, name): os.urandom(size) for name, size in (("a.npz", 100), ("b.json", 2**17))})
finally:
    print(sorted(os.listdir(folder)), Path(folder, "a.npz").read_text(), Path(folder, "b.json").read_text())
"""


def test_files_that_get_too_large_leave_nothing(tmp_path):
    write_together(pair(tmp_path, "old"))
    assert in_a_process(LIMITED, tmp_path) == f"cannot write {tmp_path / 'b.json'}: File too large\n"
    assert contents(tmp_path) == {"a.npz": "old", "b.json": "old"}


def test_a_full_disk_leaves_the_old_pair(tmp_path):
    trial = ["unshare", "-Urm", "mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", "/tmp"]
    if shutil.which("unshare") is None or subprocess.run(trial, capture_output=True).returncode != 0:
        pytest.skip("this machine lets no user mount a file system; the test before meets nearly the same error")
    told = in_a_process(SMALL, tmp_path, before=("unshare", "-Urm"))
    assert told == (f"['a.npz', 'b.json'] a.npz b.json\ncannot write {tmp_path / 'b.json'}: No space left on device\n")


@pytest.mark.parametrize("spoiled", ["a.npz", "b.json"])
@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), KeyboardInterrupt()])
@pytest.mark.parametrize("old", [(), ("a.npz",), ("a.npz", "b.json")])
def test_a_pair_is_put_back_when_a_rename_fails(tmp_path, monkeypatch, spoiled, error, old):
    for name in old:
        (tmp_path / name).write_text("old")
    replace = os.replace

    def failing(source, target):
        if Path(target).name == spoiled and Path(source).read_text() == "new":
            raise error
        replace(source, target)

    monkeypatch.setattr(os, "replace", failing)
    expected = KeyboardInterrupt if isinstance(error, KeyboardInterrupt) else OutputError
    with pytest.raises(expected, match=None if expected is KeyboardInterrupt else f"cannot write .*{spoiled}: Input"):
        write_together(pair(tmp_path, "new"))
    assert contents(tmp_path) == dict.fromkeys(old, "old")


@pytest.mark.parametrize("refused", ["a.npz", "b.json"])
def test_a_pair_with_one_that_cannot_be_is_not_begun(tmp_path, refused):
    write_together(pair(tmp_path, "old"))
    (tmp_path / refused).unlink()
    (tmp_path / refused).mkdir()
    with pytest.raises(OutputError, match=f"cannot write .*{refused}: it is a folder"):
        write_together(pair(tmp_path, "new"))
    other = ({"a.npz", "b.json"} - {refused}).pop()
    assert ((tmp_path / other).read_text(), names(tmp_path)) == ("old", {"a.npz", "b.json"})


def test_a_pair_that_is_one_file_is_refused(tmp_path):
    (tmp_path / "a.npz").write_text("old")
    (tmp_path / "b.json").symlink_to("a.npz")
    with pytest.raises(OutputError, match=r"cannot write .*b\.json: it is the same file as .*a\.npz$"):
        write_together(pair(tmp_path, "new"))
    assert contents(tmp_path) == {"a.npz": "old", "b.json": "old"}


WRITES_FOR_EVER = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts what is in its background without
at = 0
while True:
    at += 1
    write_together({Path(sys.argv[1], name): f"{at:09d}" * 3000 for name in ("a.npz", "b.json")})
    if at == 1:
        print(flush=True)
"""


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
def test_a_writer_killed_at_any_moment_leaves_no_mixed_pair(tmp_path, end):
    """Ctrl-C leaves nothing else either."""
    words = [sys.executable, "-c", BEGIN + WRITES_FOR_EVER, str(tmp_path)]
    for turn in range(3):
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as child:
            child.stdout.readline()
            time.sleep(0.05 + 0.013 * turn)
            child.send_signal(end)
        found = {name: (tmp_path / name).read_text() for name in ("a.npz", "b.json") if (tmp_path / name).exists()}
        assert all(len(text) == 27000 for text in found.values())
        if "b.json" in found:
            assert found["a.npz"] == found["b.json"]
        if end == signal.SIGINT:
            assert names(tmp_path) == {"a.npz", "b.json"}


def test_readers_see_the_old_file_or_the_new_one(tmp_path):
    """Never a part of it, and never none."""
    path = tmp_path / "file"
    write_whole(path, b"0" * 100_000)
    done = threading.Event()

    def write():
        for at in range(1, 60):
            write_whole(path, b"%d" % (at % 10) * 100_000)
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    seen = set()
    while not done.is_set():
        data = path.read_bytes()
        assert (len(data), len(set(data))) == (100_000, 1)
        seen.add(data[0])
    writer.join()
    assert len(seen) > 1, "else it was read before or after only"


def test_a_link_that_somebody_plants_is_not_written_through(tmp_path, monkeypatch):
    """A temporary file of a known name is how one user has another overwrite a file."""
    monkeypatch.setattr("secrets.token_hex", lambda _: "known")
    (tmp_path / "victim").write_text("old")
    (tmp_path / ".file.known.part").symlink_to("victim")
    refused(tmp_path / "file", "File exists")
    assert (tmp_path / "victim").read_text() == "old"
