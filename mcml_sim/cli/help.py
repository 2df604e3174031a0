"""The first screen of a command: what it is for, how it is used, its subcommands by group, all in 24 lines of 80."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from itertools import groupby

import typer
from rich.console import Console
from rich.text import Text
from typer.core import TyperGroup

GAP = 2  # characters between columns
NOT_SHOWN = ("--show-completion",)  # --install-completion does what most want


class FirstScreen(TyperGroup):
    """typer's own --help has a box a group, which for nine subcommands is more than a screen."""

    def format_help(self, ctx: typer.Context, formatter: object) -> None:  # type: ignore[override]
        """Print it to stdout, in colour on a terminal."""
        console = Console(highlight=False, soft_wrap=True, width=None if sys.stdout.isatty() else 80)
        console.print(Text.assemble("Usage: ", (f"{ctx.command_path} COMMAND [OPTIONS] ...", "bold")))
        console.print(Text(f"\n{(self.help or '').strip()}\n"))
        rows = self._commands(ctx)
        titles, names = (max(len(row[at]) for row in rows) + GAP for at in (0, 1))
        for title, group in groupby(rows, key=lambda row: row[0]):
            for at, (_, name, told) in enumerate(group):
                shown = "" if at else title
                console.print(Text.assemble((f"{shown:{titles}}", "dim"), (f"{name:{names}}", "bold cyan"), told))
        options = [one.opts[0] for one in self.get_params(ctx) if one.opts[0] not in NOT_SHOWN]
        console.print(Text.assemble((f"{'Options':{titles}}", "dim"), ", ".join(options)))
        console.print(Text(f"More, with examples: {ctx.command_path} COMMAND --help", style="dim"))

    def _commands(self, ctx: typer.Context) -> list[tuple[str, str, str]]:
        """Group, name, what it does."""
        found = [self.commands[name] for name in self.list_commands(ctx)]
        return [
            (getattr(one, "rich_help_panel", None) or "Commands", one.name or "", one.get_short_help_str(200))
            for one in found
        ]


def add(app: typer.Typer, command: Callable[..., None], panel: str | None = None) -> None:
    """Add a subcommand; the examples at the end of its docstring come last in its --help, below the options."""
    told, _, examples = inspect.cleandoc(command.__doc__ or "").partition("\n\b\n")
    paragraphs = [" ".join(one.split()) for one in told.split("\n\n")]  # rich would keep the source's line breaks
    app.command(help="\n\n".join(paragraphs), epilog=f"\b\n{examples}", rich_help_panel=panel)(command)
