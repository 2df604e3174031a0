"""What is imported only when it is asked for: names of a package (PEP 562), and what a subcommand does.

JAX and SciPy take seconds to import, which a command that only shows its help, or completes a word, has no use for.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def attributes(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package: `homes` says in which of its modules each name is; "" for a module itself."""

    def of_package(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if not homes[name]:
            return import_module(f"{package}.{name}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return of_package


def carried_out(module: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The subcommand below, which has options and a help but no body, done by the function of its name in `module`."""

    def of(asked: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(asked)
        def run(**given: Any) -> None:
            getattr(import_module(module), asked.__name__)(**given)

        return run

    return of
