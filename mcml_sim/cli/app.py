"""Command mcml-sim: its first screen, its one subcommand, and its errors in words of the shell."""

from __future__ import annotations

import sys

import typer

from mcml_sim.cli.program import FirstScreen, Program, accepted, add, add_version
from mcml_sim.cli.run import run
from mcml_sim.cli.terminal import two_interrupts
from mcml_sim.errors import ELSEWHERE, NAMED, RESUMES, ClusterError, InputError, OutputError, StoreError

__all__ = ["app", "main"]

# The library's remedies for errors, in the command line's words.
REMEDIES = {
    ELSEWHERE: "use --out elsewhere",
    NAMED: "--out FOLDER",
    RESUMES: "the same command resumes",
}
HELP = """\
Trace light through layered media as MCML does, with error bars.

  mcml-sim run FILE.mci --out runs        every run of an MCML input file
  mcml-sim run FILE.mci --precision 1e-3  until reflectance is known to 0.1 %

Writes NAME.mco, as MCML does, and NAME.npz with the standard error of each bin.
After Ctrl-C the same command resumes."""

app = typer.Typer(cls=FirstScreen, help=HELP, no_args_is_help=True, pretty_exceptions_enable=False)
add_version(app, "mcml_sim")
add(app, run)


def _remedied(text: str) -> str:
    """Return the text of a library error, with remedies of the command line."""
    for theirs, ours in REMEDIES.items():
        text = text.replace(theirs, ours)
    return text


def _hint() -> str:
    """Return advice for a command that was not understood."""
    first = next(iter(sys.argv[1:]), "")
    return f"mcml-sim run {first} does its runs" if first.endswith(".mci") else accepted()


PROGRAM = Program(
    "mcml-sim",
    app,
    (ClusterError, InputError, OutputError, StoreError),
    lambda: "stopped; the finished batches are kept, the same command resumes",
    hint=_hint,
    remedied=_remedied,
)


def main() -> None:
    """Run a command; the first Ctrl-C waits for the batches in flight, the second does not."""
    with two_interrupts():
        PROGRAM.main()
