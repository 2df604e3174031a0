"""What is around any subcommand: exit statuses, one line for what can be mended, a quiet end in a pipe."""

import subprocess
import sys

import pytest

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
