"""A command as a user gives it."""

import sys

import pytest

from profilefit.cli import main


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Run `profilefit WORDS` in an empty folder; the exit status and what it printed on stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["profilefit", *words])
        with pytest.raises(SystemExit) as stop:
            main()
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return run
