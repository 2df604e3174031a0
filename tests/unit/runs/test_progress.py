"""The bar's words, and that it is there for a terminal only."""

import io
import sys
import time

import pytest

from mcml_sim.runs.progress import is_watched, rate, tracked, working


@pytest.mark.parametrize(
    ("speed", "unit", "said"),
    [
        (2.3e6, "photons", "2.30 M photons/s"),
        (4.14, "laws", "4.1 laws/s"),
        (1 / 12, "laws", "1 law in 12 s"),
        (1 / 150, "recipes", "1 recipe in 2.5 min"),
        (None, "laws", ""),
        (0.0, "laws", ""),
    ],
)
def test_a_rate_in_words(speed, unit, said):
    assert rate(speed, unit) == said


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_how_far_how_fast_and_how_long_still(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert is_watched()
    for number in tracked(iter([1, 2, 3]), "counting", "numbers", total=3):
        time.sleep(0.4 * number)  # in whole seconds, what is left rounds to one
    with working("thinking"):
        pass
    shown = sys.stderr.getvalue()
    assert "counting" in shown
    assert "3/3" in shown
    assert " numbers/s" in shown
    assert " left" in shown
    assert "thinking" in shown


@pytest.mark.parametrize(("screen", "quiet"), [(Terminal, True), (io.StringIO, False)])
def test_nobody_else_does(monkeypatch, screen, quiet):
    monkeypatch.setattr(sys, "stderr", screen())
    assert list(tracked([1, 2], "counting", quiet=quiet)) == [1, 2]
    with working("thinking", quiet):
        pass
    assert sys.stderr.getvalue() == ""


def test_a_closed_stderr_is_no_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", None)
    assert not is_watched()
