"""Imports on first use: names of a package (PEP 562), and a command.

JAX and SciPy take seconds to import. A command that shows its help or completes a word does not need them.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from importlib import import_module

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from types import FrameType
    from typing import Any

INTERRUPTED = 130  # exit status, as of any command that Ctrl-C ended


def attributes(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the `__getattr__` and the `__dir__` of a package: `homes` names the module of each name.

    The home of a module is its folder with a dot: "media." gives `media.phase`, and "" gives a module of the root.
    An interactive shell also completes names before their first use.
    """

    def of_package(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = f"{package}.{homes[name]}"
        return import_module(home + name) if home.endswith(".") else getattr(import_module(home), name)

    return of_package, lambda: [*vars(sys.modules[package]), *homes]


def command(module: str) -> None:
    """Run `main` of `module`, and answer Ctrl-C by one line and its exit status, from the first import on.

    During imports Ctrl-C ends the process at once, because an exception there may be dropped or replaced.
    """

    def interrupt(_: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_code.co_filename.startswith("<frozen importlib"):
                _quit(module)
            frame = frame.f_back
        raise KeyboardInterrupt

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        import_module(module).main()
    except KeyboardInterrupt:  # between what `main` guards
        _quit(module)
    finally:
        if signal.getsignal(signal.SIGINT) is interrupt:
            signal.signal(signal.SIGINT, lambda *_: _quit(module))  # for as long as Python takes to end


def _quit(module: str) -> None:
    name = module.partition(".")[0].replace("_", "-")
    with contextlib.suppress(OSError):  # stderr is closed: nobody is listening
        os.write(2, f"{name}: stopped\n".encode())
    os._exit(INTERRUPTED)
