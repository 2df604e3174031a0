"""docs/reference/cli.md: every command with its options and example, from the programs themselves."""

import re
from enum import Enum
from typing import Any

import typer
from sphinx.application import Sphinx

from mcml_sim.cli.app import app as mcml_sim
from profilefit.cli import app as profilefit

PAGE, HEAD = "reference/cli", "| option | meaning | default |\n|:--|:--|:--|\n"


def row(one: Any) -> str:
    """Return the row of an option or argument."""
    name = ", ".join(one.opts) if one.opts[0].startswith("-") else one.metavar or one.name.upper()
    value = one.default.value if isinstance(one.default, Enum) else one.default
    shown = "" if value is None or value is False else f"`{value}`"
    words = one.show_default if isinstance(one.show_default, str) else shown
    return f"| `{name}` | {in_code(one.help)} | {in_code('required' if one.required else words)} |\n"


def in_code(text: str) -> str:
    """Return a text with its options in code, and no HTML."""
    return re.sub(r"(?<![\w-])--[a-z][a-z-]*", r"`\g<0>`", text.replace("<", "&lt;"))


def add(app: Sphinx, name: str, source: list[str]) -> None:
    """Add the commands at the end of their page."""
    for program, cli in {"profilefit": profilefit, "mcml-sim": mcml_sim}.items() if name == PAGE else ():
        for command in typer.main.get_command(cli).commands.values():
            rows = "".join(row(one) for one in command.params if getattr(one, "help", None))
            example = command.epilog.partition(":\n")[2].strip()
            source[0] += (
                f"\n## {program} {command.name}\n\n{in_code(command.help)}\n\n{HEAD}{rows}\n```\n{example}\n```\n"
            )


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", add)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
