"""profilefit on the command line: one file a subcommand, and what any of them says when it fails."""

from __future__ import annotations

import sys
import warnings

import typer
from rich.console import Console

from mcml_sim import __version__
from profilefit.cli.check import check
from profilefit.cli.choose import choose
from profilefit.cli.convert import convert
from profilefit.cli.export import export
from profilefit.cli.fit import fit
from profilefit.cli.regenerate import regenerate
from profilefit.cli.report import report
from profilefit.cli.stability import stability
from profilefit.cli.tradeoff import tradeoff
from profilefit.errors import InputError, OutputError, ShaderError, StoreError

__all__ = ["app", "main"]

BAD_INPUT = 2
INTERRUPTED = 130

app = typer.Typer(
    name="profilefit",
    help="Refit closed-form subsurface scattering profiles to simulated light, with error bars.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
)
app.command()(regenerate)
app.command()(report)
app.command()(convert)
app.command()(export)
app.command()(fit)
app.command()(check)
app.command()(choose)
app.command()(tradeoff)
app.command()(stability)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"profilefit {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    """Refit closed-form subsurface scattering profiles to simulated light, with error bars."""


def main() -> None:
    """Run a command; whatever the user can mend is one line on stderr and exit status 2."""
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    with warnings.catch_warnings():  # of a damaged batch, say: a line, without the place in the code
        warnings.showwarning = lambda message, *_: errors.print(f"profilefit: {message}", markup=False)
        status = _status(errors)
    if status == INTERRUPTED:  # from here, or as typer returns a Ctrl-C
        errors.print("profilefit: stopped; the finished batches are kept, the same command resumes", markup=False)
    sys.exit(status)


def _status(errors: Console) -> int:
    """Do the command, and say what went wrong."""
    try:
        # Standalone, typer would end the process itself on Ctrl-C, and tell usage errors in a box of many lines.
        return int(app(standalone_mode=False) or 0)
    except (InputError, OutputError, ShaderError, StoreError) as error:
        errors.print(f"profilefit: {error}", markup=False)
        return BAD_INPUT
    except typer.TyperException as error:
        if message := error.format_message():  # without arguments typer has shown the help and says no more
            errors.print(f"profilefit: {message} (--help shows what is accepted)", markup=False)
        return int(error.exit_code)
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
