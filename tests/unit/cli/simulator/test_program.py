"""What is around any subcommand: exit statuses, one line for what can be mended, Ctrl-C, and what a shell can do; and
names that are imported when they are asked for, which are the ones that are promised.
"""

import ast
import importlib
import io
import logging
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import mcml_sim
import profilefit
from mcml_sim.cli.lazy import attributes
from mcml_sim.cli.program import ENCODED, STANDS_FOR, STOPPING, mend_streams, two_interrupts, without_logs
from mcml_sim.results.tally import read_results
from tests.unit.cli.conftest import interrupted, started

MCI = "1.0\n1\nfirst.mco A\n2000\n0.01 0.02\n4 5 3\n1\n1.0\n1.4 10 90 0.5 0.05\n1.0\n"
STOPPED = "mcml-sim: stopped; the finished batches are kept, the same command resumes\n"
LINE = "α 0.12 ± 0.03 → ▁▅█ √(1 − α) 漢"


@pytest.fixture
def mci(tmp_path) -> Path:
    path = tmp_path / "one.mci"
    path.write_text(MCI)
    return path


@pytest.mark.slow
def test_control_c_says_what_it_waits_for_and_what_is_kept(mci, tmp_path):
    words = ("mcml_sim", "run", mci, "--photons", 10**12)
    ended = interrupted(*words, cwd=tmp_path, once="first.photons/batch*")
    assert ended == (130, "run 1 of 1: first.mco\n", STOPPING + STOPPED)


@pytest.mark.slow  # of a clock: a busy machine breaks its second
def test_a_second_control_c_ends_it_at_once(mci, tmp_path):
    """While it is compiled, which takes seconds and cannot be interrupted."""
    with started("mcml_sim", "run", mci, cwd=tmp_path, stdout=-1, stderr=-1) as run:
        end = time.monotonic() + 120
        while not (tmp_path / "first.photons/run.json").exists() and time.monotonic() < end:
            time.sleep(0.02)
        run.send_signal(signal.SIGINT)
        try:
            assert run.stderr.readline() == STOPPING
            begun = time.monotonic()
            run.send_signal(signal.SIGINT)
            err = run.stderr.read()
            run.wait(120)
        finally:
            run.kill()
    assert (run.returncode, err.removeprefix(STOPPED)) == (130, "")
    assert time.monotonic() - begun < 1, "else it was compiled to the end"


def test_a_full_disk_under_what_is_printed_is_one_line(tmp_path):
    with open("/dev/full", "w") as full, started("mcml_sim", "--version", cwd=tmp_path, stdout=full, stderr=-1) as run:
        _, err = run.communicate(timeout=120)
    assert (run.returncode, err) == (2, "mcml-sim: cannot print: No space left on device\n")


@pytest.mark.slow
def test_closed_streams_do_no_harm(mci, tmp_path):
    words = f"'{sys.executable}' -m mcml_sim run '{mci}' >&- 2>&-"
    done = subprocess.run(["sh", "-c", words], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert read_results(tmp_path / "first.npz").photons == 2000


@pytest.mark.parametrize(
    ("encoding", "printed"),
    [("utf-8", LINE), ("latin-1", "a 0.12 ± 0.03 > _~# V(1 - a) ?"), ("ascii", "a 0.12 + 0.03 > _~# V(1 - a) ?")],
)
def test_a_poor_encoding_prints_another_letter_for_each(monkeypatch, encoding, printed):
    """So that columns stay in place."""
    paper = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(paper, encoding=encoding))
    if encoding != "utf-8":
        with pytest.raises(UnicodeEncodeError):
            print(LINE)
    mend_streams()
    print(LINE, flush=True)
    assert paper.getvalue().decode(encoding) == printed + "\n"
    assert len(printed) == len(LINE)


def test_every_letter_has_one_in_ascii_and_what_cannot_be_read_is_not_spelled():
    assert all(len(text) == 1 and text.isascii() for text in STANDS_FOR.values())
    with pytest.raises(UnicodeDecodeError, match="can't decode byte"):
        b"\xff".decode("utf-8", ENCODED)


@pytest.mark.usefixtures("python_handles_sigint")
def test_control_c_is_pythons_own_again_unless_the_process_ends_by_it(capfd):
    with two_interrupts():
        assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(KeyboardInterrupt), two_interrupts():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    assert capfd.readouterr().err == STOPPING
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with two_interrupts():
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN, "of somebody else, it stays"


def test_logs_are_silent_only_inside(caplog):
    log = logging.getLogger("distributed.core")
    with without_logs():
        log.critical("inside")
    log.critical("after")
    assert caplog.messages == ["after"]


SMALL = r"""
import warnings
import numpy
import typer
from rich.console import Console
from mcml_sim.errors import InputError
from mcml_sim.cli.program import Program
from mcml_sim.runs.store import DamagedBatch

app = typer.Typer()

@app.command()
def printed():
    for _ in range(20000):
        print("a line of a table, and another")

@app.command()
def shown():
    console = Console()
    for _ in range(2000):
        console.print("a line of a table, and another")

@app.command()
def short():
    print("one line")

@app.command()
def wrong():
    raise InputError("x must be 1, got 2")

@app.command()
def hostile():
    raise InputError("\x1b[2Jone\r\ntwo\u202e\x9b\u2028:bomb:" + "x" * 10**6 + ", got 2")

@app.command()
def stopped():
    raise KeyboardInterrupt

@app.command()
def fault():
    raise KeyError("first line\nsecond line")

@app.command()
def overflow():
    print(numpy.float64(1e300) * numpy.float64(1e300))

@app.command()
def library():
    warnings.warn("jax has something to say", UserWarning)
    warnings.warn("a batch is damaged", DamagedBatch)

Program("small", app, (InputError,), lambda: "stopped; begin again", remedied=lambda text: text.upper()).main()
"""


@pytest.fixture
def small():
    """Start it with WORDS."""

    def start(*words, stdout=subprocess.PIPE):
        return subprocess.Popen([sys.executable, "-c", SMALL, *words], stdout=stdout, stderr=subprocess.PIPE)

    return start


@pytest.mark.slow
@pytest.mark.parametrize("words", ["printed", "shown", "--help"])
def test_a_pipe_that_nobody_reads_ends_it_quietly(small, words):
    """As in `| head`: the status that a shell gives what SIGPIPE ended, and no traceback."""
    with small(words) as run:
        run.stdout.close()
        said = run.stderr.read()
    assert (run.returncode, said) == (141, b"")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("wrong", 2, "small: X MUST BE 1, GOT 2\n"),
        ("stopped", 130, "small: stopped; begin again\n"),
        (
            "fault",
            70,
            "small: a fault of this program, please report it: KeyError in <string>:41: 'first line\\nsecond line' "
            "(PYTHONDEVMODE=1 shows where)\n",
        ),
        ("overflow", 2, "small: no result: an intermediate number overflows double precision; check units and sizes\n"),
        ("library", 0, "small: a batch is damaged\n"),
        ("wrnog", 2, "small: No such command 'wrnog'. Did you mean 'wrong'? (--help shows what is accepted)\n"),
    ],
)
def test_what_a_user_can_mend_is_one_line(small, words, status, said):
    with small(words) as run:
        out, err = run.communicate(timeout=60)
    assert (run.returncode, err.decode()) == (status, said)
    assert out == b""


def test_whatever_a_message_holds_it_is_one_line_that_is_only_printed(small):
    with small("hostile") as run:
        _, err = run.communicate(timeout=60)
    said = err.decode()
    assert run.returncode == 2
    assert said.startswith(r"small: \X1B[2JONE\r\nTWO\u202e\x9b\u2028:BOMB:XXX".replace(r"\X1B", r"\x1b"))
    assert said.endswith("XXX, GOT 2\n")
    assert said[:-1].isprintable()
    assert len(said) < 2100


def test_a_full_disk_is_one_line(small):
    with open("/dev/full", "w") as disk, small("short", stdout=disk) as run:
        said = run.stderr.read()
    assert (run.returncode, said) == (2, b"small: cannot print: No space left on device\n")


ROOMS = ("fitting", "measured", "report", "scenes", "scenes.layers", "shader", "studies")
FACES = (mcml_sim, profilefit, *(importlib.import_module(f"profilefit.{room}") for room in ROOMS))


@pytest.mark.parametrize("package", FACES, ids=lambda package: package.__name__)
def test_every_name_is_there_and_is_the_one_that_is_typed(package):
    """What type checkers are told is what `__getattr__` gives. No module has the name of what is exported beside it: it
    would stand in the place of the function as soon as anybody imports it.
    """
    (branch,) = [one for one in ast.parse(Path(package.__file__).read_text()).body if isinstance(one, ast.If)]
    homes = {alias.name: one.module for one in branch.body for alias in one.names}
    assert set(homes) <= set(package.__all__)
    for name in package.__all__:
        assert getattr(package, name) is not None
    for name, home in homes.items():
        assert getattr(package, name) is getattr(importlib.import_module(home), name)
    beside = {path.stem for path in Path(package.__file__).parent.iterdir()}
    modules = {"exact", "fur", "heart", "layers", "scenes", "sea"}  # which are modules themselves
    assert beside & set(package.__all__) <= modules


@pytest.mark.parametrize("package", [mcml_sim, profilefit])
def test_an_interactive_shell_completes_names_that_nobody_has_asked_for(package):
    assert set(package.__all__) <= set(dir(package))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"module 'profilefit' has no attribute 'nothing'"):
        profilefit.nothing  # noqa: B018
    with pytest.raises(AttributeError, match=r"module 'a' has no attribute 'b'"):
        attributes("a", {})[0]("b")


INTERRUPTED = """
import runpy, signal, sys

_, imported, package, *words = sys.argv

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == imported:
            sys.meta_path.remove(self)
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupting())
sys.argv[1:] = words
runpy.run_module(package, run_name="__main__")
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("imported", "package", "words"),
    [
        ("typer", "profilefit", ("--help",)),
        ("typer", "mcml_sim", ("--help",)),
        ("numpy", "profilefit", ("convert", "--alpha", ".5", "--mfp", "1")),
        ("profilefit.convert", "profilefit", ("convert", "--alpha", ".5", "--mfp", "1")),
        ("profilefit.shader.emit", "profilefit", ("export", "hazard")),
        ("mcml_sim.tracing", "mcml_sim", ("run", "none.mci")),
    ],
)
def test_ctrl_c_among_the_imports_of_a_command_is_one_line(imported, package, words, tmp_path):
    """The first of a command's imports, and one of what a subcommand does."""
    run = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, imported, package, *words],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (run.returncode, run.stdout, run.stderr) == (130, "", f"{package.replace('_', '-')}: stopped\n")
