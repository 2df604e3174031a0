"""Shell and user around a command: streams that are closed, letters that a terminal lacks, Ctrl-C."""

from __future__ import annotations

import codecs
import contextlib
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

from mcml_sim.cli.lazy import INTERRUPTED

NAME = "spelled"  # of the way to handle an encoding's errors
STANDS_FOR = {
    **dict(zip("▁▂▃▄▅▆▇█", "_.,-~=*#", strict=True)),
    **dict(zip("─│╭╮╰╯━┃", "-|++++-|", strict=True)),
    **dict(zip("αβγδκλμξπρστχω", "abgdklmxprstco", strict=True)),
    **dict(zip("±×−–—→…·²³√∂∞≤≥≈µ’", "+x--->..23Vdi<>~u'", strict=True)),
}
UNKNOWN = "?"


def spelled(error: UnicodeError) -> tuple[str, int]:
    """Return the characters that could not be encoded, each as another, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lost = error.object[error.start : error.end]
    return "".join(STANDS_FOR.get(letter, UNKNOWN) for letter in lost), error.end


codecs.register_error(NAME, spelled)


STOPPING = "mcml-sim: stopping after the batches in flight; Ctrl-C again stops at once\n"
SHOW_CURSOR = "\x1b[?25h"  # which a progress bar hides


def mend_streams() -> None:
    """Have a stdout and a stderr to print to where the shell has closed them; what they cannot encode is spelled."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # For as long as the process lives, so nobody closes it.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors=NAME)


@contextlib.contextmanager
def two_interrupts() -> Iterator[None]:
    """Let the first Ctrl-C print what it waits for and raise KeyboardInterrupt, and the second end the process.

    Compiling cannot be interrupted and takes seconds, and batches may take long: someone who insists need not wait.
    """
    here = threading.current_thread() is threading.main_thread()
    if not here or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:  # somebody else's, or ignored
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
        _tell(STOPPING)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    finally:
        if not interrupts:  # else the process ends, and waits once more for what is compiled
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _tell(text: str) -> None:
    """Write to stderr past its buffer, which the code that was interrupted may be about to change."""
    with contextlib.suppress(OSError, ValueError):  # closed or full: nobody is listening
        os.write(sys.stderr.fileno(), text.encode())


@contextlib.contextmanager
def without_logs() -> Iterator[None]:
    """Keep libraries from logging what an exception will say in one line."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
