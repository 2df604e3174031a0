"""Commands as processes of their own, a thousand of them in minutes: one process imports what they need, and forks.

Run as a program, it reads requests from stdin, a JSON list [module, arguments, folder] a line, and answers
each with a line [status, stdout, stderr] when the process has ended; a status below 0 is the signal that ended it.
"""

from __future__ import annotations

import contextlib
import json
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

IMPORTED = (
    *("mcml_sim.cli.app", "mcml_sim.runs.input_runs", "profilefit.cli", "profilefit.report"),
    *("profilefit.studies.choose.choice", "profilefit.studies.choose.layers", "profilefit.report.tables.choose_table"),
    *("profilefit.shader.law_file", "profilefit.measured.result", "profilefit.recipes.regenerate"),
    *("profilefit.report.tables.fit_tables", "profilefit.report.figures.fit_figures"),
)
STREAMS = ("stdout", "stderr")
SECONDS = 200  # of processor time, at most


class Ended(NamedTuple):
    """How a process ended, and what it wrote."""

    status: int
    stdout: str
    stderr: str


@contextlib.contextmanager
def commands(folder: Path) -> Iterator[Callable[[str, Sequence[str], Path], Ended]]:
    """A program that runs them, until the end, as `python -m module arguments` would; its streams go into `folder`."""
    line = [sys.executable, str(Path(__file__).resolve()), str(folder)]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as program:

        def run(module: str, arguments: Sequence[str], where: Path) -> Ended:
            print(json.dumps([module, list(arguments), str(where)]), file=program.stdin, flush=True)
            return Ended(*json.loads(program.stdout.readline()))

        try:
            yield run
        finally:
            program.stdin.close()


def _become(module: str, arguments: list[str], folder: str, streams: list[Path]) -> None:
    """In the child: another folder, other streams, a bound on time, then the command."""
    import resource  # not where there is no fork

    os.chdir(folder)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
    for stream, path in enumerate(streams, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    sys.argv = [module, *arguments]
    signal.signal(signal.SIGINT, signal.default_int_handler)
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def _serve(folder: Path) -> None:
    answers = os.fdopen(os.dup(1), "w")
    streams = [folder / f".{name}" for name in STREAMS]
    for name in IMPORTED:
        __import__(name)
    for line in sys.stdin:
        module, arguments, where = json.loads(line)
        child = os.fork()
        if child == 0:
            _become(module, arguments, where, streams)
            sys.exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        told = [path.read_text(encoding="utf-8", errors="surrogateescape") for path in streams]
        print(json.dumps([status, *told]), file=answers, flush=True)


if __name__ == "__main__":
    _serve(Path(sys.argv[1]))
