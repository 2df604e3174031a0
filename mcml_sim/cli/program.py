"""Frame of every subcommand: errors in one line, exit statuses, and the first screen.

The first screen lists purpose, usage and subcommands by group, in 24 lines of 80 columns.
The frame also handles closed streams, letters that a terminal lacks, and Ctrl-C.
"""

from __future__ import annotations

import codecs
import contextlib
import inspect
import io
import logging
import os
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from types import FrameType

import typer
from rich.console import Console
from rich.text import Text
from typer.core import TyperCommand, TyperGroup

from mcml_sim.cli.lazy import INTERRUPTED
from mcml_sim.errors import Notice

GAP = 2  # characters between columns
NOT_SHOWN = ("--show-completion",)  # --install-completion does what most want
ANSWERS = (0, 1)
BAD_INPUT = 2
FAULT = 70  # exit status, EX_SOFTWARE of sysexits.h: of what should not have happened
LONGEST, KEPT_END = 2000, 500  # characters of a message, and of them those at its end, where the advice stands
NOBODY_READS = 141  # exit status, as a shell reports any program that SIGPIPE ended: 128 + 13
ACCEPTED = "--help shows what is accepted"
ENCODED = "spelled"  # name of the way to handle an encoding's errors
STANDS_FOR = {
    **dict(zip("▁▂▃▄▅▆▇█", "_.,-~=*#", strict=True)),
    **dict(zip("─│╭╮╰╯━┃", "-|++++-|", strict=True)),
    **dict(zip("αβγδκλμξπρστχω", "abgdklmxprstco", strict=True)),
    **dict(zip("±×−–—→…·²³√∂∞≤≥≈µ’é", "+x--->..23Vdi<>~u'e", strict=True)),
}
UNKNOWN = "?"
STOPPING = "mcml-sim: stopping after the batches in flight; Ctrl-C again stops at once\n"
SHOW_CURSOR = "\x1b[?25h"  # which a progress bar hides


class FirstScreen(TyperGroup):
    """First screen in place of typer's --help, whose boxes per group need more than one screen."""

    def format_help(self, ctx: typer.Context, formatter: object) -> None:  # type: ignore[override]
        """Print the screen to stdout, in colour on a terminal."""
        console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 80)
        console.print(Text.assemble("Usage: ", (f"{ctx.command_path} COMMAND [OPTIONS] ...", "bold")))
        console.print(Text(f"{(self.help or '').strip()}\n"))
        commands = {name: self.commands[name] for name in self.list_commands(ctx)}
        rows = [
            (getattr(command, "rich_help_panel", None) or "Commands", name, command.get_short_help_str(200))
            for name, command in commands.items()
        ]
        titles, names = (max(len(row[at]) for row in rows) + GAP for at in (0, 1))
        for title, group in groupby(rows, key=lambda row: row[0]):
            for at, (_, name, help_text) in enumerate(group):
                shown = "" if at else title
                console.print(Text.assemble((f"{shown:{titles}}", "dim"), (f"{name:{names}}", "bold cyan"), help_text))
        options = [option.opts[0] for option in self.get_params(ctx) if option.opts[0] not in NOT_SHOWN]
        console.print(Text.assemble((f"{'Options':{titles}}", "dim"), ", ".join(options)))
        console.print(Text(f"More, with examples: {ctx.command_path} COMMAND --help", style="dim"))


def add(
    app: typer.Typer, command: Callable[..., None], panel: str | None = None, kind: type[TyperCommand] | None = None
) -> None:
    """Add a subcommand; the examples at the end of its docstring come last in its --help, below the options."""
    help_text, _, examples = inspect.cleandoc(command.__doc__ or "").partition("\n\b\n")
    # Rich would keep the source's line breaks.
    paragraphs = [" ".join(paragraph.split()) for paragraph in help_text.split("\n\n")]
    epilog = f"\b\n{examples}"
    app.command(cls=kind, help="\n\n".join(paragraphs), epilog=epilog, rich_help_panel=panel)(command)


def add_version(app: typer.Typer, package: str) -> None:
    """Add --version, which prints the version of both packages."""

    def show(is_asked: bool) -> None:
        if is_asked:
            from mcml_sim.files.version import __version__

            typer.echo(f"{package.replace('_', '-')} {__version__}")
            raise typer.Exit

    @app.callback()
    def options(
        version: bool = typer.Option(False, "--version", callback=show, is_eager=True, help="Print the version."),
    ) -> None:
        pass


def one_line(text: str) -> str:
    """Return a text as one line without control characters.

    Names of files and words in them may hold line breaks, escape sequences or marks that turn the direction of
    writing. Characters that are not printable are escaped as in Python. The middle of a long text is left out.
    """
    if len(text) > LONGEST:
        text = f"{text[: LONGEST - KEPT_END]} ... {text[-KEPT_END:]}"
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


@dataclass(frozen=True)
class Program:
    """Command with its subcommands.

    mendable  errors that the user can fix; remedied turns their messages into terms of the command line
    stopped   message after Ctrl-C; hint after a command line that cannot be parsed
    """

    name: str
    app: typer.Typer
    mendable: tuple[type[Exception], ...]
    stopped: Callable[[], str]
    hint: Callable[[], str] = lambda: ACCEPTED
    remedied: Callable[[str], str] = str

    def main(self) -> None:
        """Run a subcommand; an error that the user can fix is one line on stderr and exit status 2."""
        mend_streams()
        caught: list[Warning | str] = []
        with warnings.catch_warnings():
            warnings.filterwarnings("error", category=RuntimeWarning)  # of arithmetic: such numbers make no answer
            warnings.simplefilter("always", Notice)
            warnings.showwarning = lambda message, *_: caught.append(message)
            status = self._status()
            if status == INTERRUPTED:
                self.say(self.stopped())
            # Warnings of libraries are not shown; and an error is one line.
            notices = dict.fromkeys(str(warning) for warning in caught if isinstance(warning, Notice))
            for text in notices if status in ANSWERS else ():
                self.say(text)
        sys.exit(status)

    def say(self, text: object) -> None:
        """Print a text as one line on stderr."""
        console = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)
        console.print(f"{self.name}: {one_line(str(text))}", markup=False)

    def _status(self) -> int:
        """Run the subcommand, print its error if any, and return the exit status."""
        try:
            # Standalone, typer would end the process itself on Ctrl-C, and print usage errors in a box of many lines.
            status = int(self.app(prog_name=self.name, standalone_mode=False) or 0)
            sys.stdout.flush()
            return status
        except self.mendable as error:
            self.say(self.remedied(str(error)))
        except typer.TyperException as error:
            if message := error.format_message():  # without arguments typer has shown the help and says no more
                self.say(f"{message} ({self.hint()})")
        except (KeyboardInterrupt, typer.Abort):
            return INTERRUPTED
        except (BrokenPipeError, SystemExit) as end:  # as in `| head`; typer and rich make an exit of it
            if isinstance(end, SystemExit) and not isinstance(end.__context__, BrokenPipeError):
                raise
            _let_go_of_stdout()
            return NOBODY_READS
        except OSError as error:  # what is printed goes to a full disk
            self.say(f"cannot print: {error.strerror or error}")
            _let_go_of_stdout()
        except RuntimeWarning:
            self.say("no result: an intermediate number overflows double precision; check units and sizes")
        except Exception as error:
            if sys.flags.dev_mode:
                raise
            kind, place = type(error).__name__, traceback.extract_tb(error.__traceback__)[-1]
            first = next(iter(str(error).splitlines()), "")
            self.say(
                f"a fault of this program, please report it: {kind} in {Path(place.filename).name}:{place.lineno}: "
                f"{first[:KEPT_END]} (PYTHONDEVMODE=1 shows where)"
            )
            return FAULT
        return BAD_INPUT


def _let_go_of_stdout() -> None:
    """Redirect stdout to the null device, so that Python does not flush it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """Return replacements for characters that cannot be encoded, and the position behind them."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(STANDS_FOR.get(letter, UNKNOWN) for letter in lost), error.end


codecs.register_error(ENCODED, _spelled)


def mend_streams() -> None:
    """Open stdout and stderr where the shell has closed them, and replace characters that they cannot encode."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # For as long as the process lives, so nobody closes it.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors=ENCODED)


@contextlib.contextmanager
def two_interrupts() -> Iterator[None]:
    """Let the first Ctrl-C print a line and raise KeyboardInterrupt, and the second end the process.

    Compiling takes seconds and cannot be interrupted, and batches may take long. A second Ctrl-C does not wait.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):  # ignored, or not Python's
        yield
        return
    interrupts = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupts
        interrupts += 1
        if interrupts > 1:
            if sys.stderr.isatty():
                _tell(SHOW_CURSOR)
            os._exit(INTERRUPTED)
        try:
            before(number, frame)  # ends the process among imports
        except KeyboardInterrupt:
            _tell(STOPPING)
            raise

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        if not interrupts:  # else the process ends, and waits once more for what is compiled
            signal.signal(signal.SIGINT, before)


def _tell(text: str) -> None:
    """Write to stderr without its buffer, which the interrupted code may be changing."""
    with contextlib.suppress(OSError, ValueError):  # closed or full: nobody is listening
        os.write(sys.stderr.fileno(), text.encode())


@contextlib.contextmanager
def without_logs() -> Iterator[None]:
    """Suppress logs of libraries, whose exceptions are printed in one line."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
