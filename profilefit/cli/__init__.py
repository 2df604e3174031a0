"""Program profilefit: one file per subcommand, with its options and work."""

from __future__ import annotations

import sys

import typer

from mcml_sim.cli.program import FirstScreen, Program, add, add_version
from profilefit.cli.check import check
from profilefit.cli.choose import choose
from profilefit.cli.convert import convert
from profilefit.cli.examples import examples
from profilefit.cli.export import export
from profilefit.cli.fit import fit
from profilefit.cli.options import in_options
from profilefit.cli.photo import SeveralFiles, photo
from profilefit.cli.regenerate import regenerate
from profilefit.cli.report import report
from profilefit.cli.scene import scene
from profilefit.cli.schema import schema
from profilefit.cli.stability import stability
from profilefit.cli.tradeoff import tradeoff
from profilefit.errors import InputError, OutputError, ShaderError, StoreError

__all__ = ["app", "main"]

# The first line is empty: typer takes the margin of all others off them.
HELP = """
Closed-form subsurface-scattering profiles, refitted with uncertainties.

  profilefit regenerate hazard --out mine  refit a profile model (a minute)
  profilefit export hazard --lang hlsl     write it as shader source
  profilefit fit FILE.csv                  fit mu_a and mu_s' to measured data"""
PANELS = {
    "Fit models": (regenerate, report),
    "Use models": (export, choose, convert, scene),
    "Your own data": (fit, photo, examples, schema),
    "Validation": (check, stability, tradeoff),
}

app = typer.Typer(cls=FirstScreen, help=HELP, no_args_is_help=True, pretty_exceptions_enable=False)
for panel, commands in PANELS.items():
    for command in commands:
        add(app, command, panel, SeveralFiles if command is photo else None)
add_version(app, "profilefit")


RESUMES = "; the finished batches are kept, the same command resumes"
PROGRAM = Program(
    "profilefit",
    app,
    (InputError, OutputError, ShaderError, StoreError),
    lambda: "stopped" + RESUMES * (sys.argv[1:2] == [regenerate.__name__]),
    remedied=in_options,
)


def main() -> None:
    """Run a command."""
    PROGRAM.main()
