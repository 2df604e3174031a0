"""What is around any subcommand: exit statuses, one line for what can be mended, Ctrl-C, and what a shell can do."""

import io
import logging
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mcml_sim.cli.program import ENCODED, STANDS_FOR, STOPPING, mend_streams, two_interrupts, without_logs
from mcml_sim.results.tally import read_results

MCI = "1.0\n1\nfirst.mco A\n2000\n0.01 0.02\n4 5 3\n1\n1.0\n1.4 10 90 0.5 0.05\n1.0\n"
STOPPED = "mcml-sim: stopped; the finished batches are kept, the same command resumes\n"
LINE = "α 0.12 ± 0.03 → ▁▅█ √(1 − α) 漢"


@pytest.fixture
def mci(tmp_path) -> Path:
    path = tmp_path / "one.mci"
    path.write_text(MCI)
    return path


def start(*words: object, cwd: Path, **streams) -> subprocess.Popen:
    """The command in a process of its own, with the handler of Ctrl-C that a shell's background jobs lack."""
    code = "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "runpy.run_module('mcml_sim', run_name='__main__', alter_sys=True)"
    return subprocess.Popen([sys.executable, "-c", code, *map(str, words)], cwd=cwd, text=True, **streams)


@pytest.mark.slow
def test_control_c_says_what_it_waits_for_and_what_is_kept(mci, tmp_path):
    with start("run", mci, "--photons", 10**12, cwd=tmp_path, stdout=-1, stderr=-1) as run:
        end = time.monotonic() + 120
        while not list(tmp_path.glob("first.photons/batch*")) and run.poll() is None and time.monotonic() < end:
            time.sleep(0.1)
        run.send_signal(signal.SIGINT)
        try:
            out, err = run.communicate(timeout=120)
        finally:
            run.kill()
    assert run.returncode == 130, err
    assert err == STOPPING + STOPPED
    assert out == "run 1 of 1: first.mco\n"


@pytest.mark.slow  # of a clock: a busy machine breaks its second
def test_a_second_control_c_ends_it_at_once(mci, tmp_path):
    """While it is compiled, which takes seconds and cannot be interrupted."""
    with start("run", mci, cwd=tmp_path, stdout=-1, stderr=-1) as run:
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
    with open("/dev/full", "w") as full, start("--version", cwd=tmp_path, stdout=full, stderr=-1) as run:
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


def test_every_letter_has_one_in_ascii():
    assert all(len(text) == 1 and text.isascii() for text in STANDS_FOR.values())


def test_what_cannot_be_read_is_not_spelled():
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


def test_a_handler_of_somebody_else_stays():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with two_interrupts():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


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
        ("overflow", 2, "small: no answer: a number on the way is beyond double precision; check units and sizes\n"),
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
