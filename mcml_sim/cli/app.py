"""mcml-sim on the command line: how a run is asked for; `mcml_sim.cli.run` does it, and is imported when one is."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.help import FirstScreen, add
from mcml_sim.cli.lazy import carried_out
from mcml_sim.cli.program import Program, accepted
from mcml_sim.cli.terminal import two_interrupts
from mcml_sim.errors import ELSEWHERE, RESUMES, ClusterError, InputError, OutputError, StoreError
from mcml_sim.files.version import __version__

__all__ = ["app", "main", "run"]

# What the library tells to do about an error, as the command line says it.
REMEDIES = {
    ELSEWHERE: "use --out elsewhere",
    RESUMES: "the same command resumes",
}
# Numbers and names of what takes a second to import; a test holds them against it.
FIRST_LOOKS = ("2.1 million", "8.4 million")
QUANTITY = "diffuse_reflectance"
QUANTITIES = (
    "specular_reflectance",
    QUANTITY,
    "absorbed",
    "transmittance",
    "diffuse_transmittance",
    "ballistic_transmittance",
    "energy",
    "absorbed_per_layer",
    "reflectance_r",
    "transmittance_r",
    "reflectance_r_overflow",
    "transmittance_r_overflow",
    "absorbed_z",
    "absorbed_rz",
    "absorbed_z_overflow",
    "reflectance_a",
    "reflectance_ra",
    "transmittance_a",
    "transmittance_ra",
)
PRECISION = (
    "Stop a run early at this relative standard error, for example 1e-3. It is looked at after 8, 16, 32, ... batches, "
    f"first at {FIRST_LOOKS[0]} photons ({FIRST_LOOKS[1]} in a matched isotropic half space), and no run goes beyond "
    "the photons asked for."
)
HELP = """\
Trace light through layered media as MCML does, with error bars.

  mcml-sim run FILE.mci --out runs        every run of an MCML input file
  mcml-sim run FILE.mci --precision 1e-3  until reflectance is known to 0.1 %

Writes NAME.mco, as MCML does, and NAME.npz with the standard error of each bin.
After Ctrl-C the same command resumes."""

app = typer.Typer(cls=FirstScreen, help=HELP, no_args_is_help=True, pretty_exceptions_enable=False)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mcml-sim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    pass


def _quantities(incomplete: str) -> Iterator[str]:
    return (name for name in QUANTITIES if name.startswith(incomplete))


@carried_out("mcml_sim.cli.run")
def run(
    file: Annotated[Path, typer.Argument(help="Input file of MCML V1 (.mci).")],
    photons: Annotated[
        str | None, typer.Option(metavar="NUMBER", help="Photons of each run, such as 1e7.", show_default="the file's")
    ] = None,
    seed: Annotated[str, typer.Option(metavar="NUMBER", help="Seed of the photons, >= 0.")] = "0",
    precision: Annotated[float | None, typer.Option(help=PRECISION)] = None,
    quantity: Annotated[
        str | None,
        typer.Option(
            help=f"What --precision looks at: {', '.join(QUANTITIES)}.",
            show_default=QUANTITY,
            autocompletion=_quantities,
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Changes nothing: a command resumes without.")] = False,
    workers: Annotated[int | None, typer.Option(help="Threads.", show_default="one a core")] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers trace, like tcp://host:8786.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for what is written.", show_default="the current folder, as MCML"),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the totals of every run, with standard errors, as JSON instead.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print nothing but errors, and what --json does.")
    ] = False,
) -> None:
    """Do every run of an MCML input file.

    Each writes NAME.mco, as MCML does, and NAME.npz, with the standard error of every bin. While it runs, NAME.photons
    keeps the finished batches: the same command goes on where it was interrupted, and leaves a run that is finished as
    it is. Results of another run are replaced, other files are not. An absolute NAME, or one with .., needs --out, and
    its last part is written there.

    \b
    Examples, on a file of profilefit examples:
      mcml-sim run examples/slab.mci --photons 1e5 --out runs
      mcml-sim run examples/slab.mci --photons 1e8 --precision 1e-3 --out runs
    """


add(app, run)


def _stopped() -> str:
    return "stopped; the finished batches are kept, the same command resumes"


def _remedied(text: str) -> str:
    """What a library error says, with remedies of the command line."""
    for theirs, ours in REMEDIES.items():
        text = text.replace(theirs, ours)
    return text


def _hint() -> str:
    """How to put right a command that was not understood."""
    first = next(iter(sys.argv[1:]), "")
    return f"mcml-sim run {first} does its runs" if first.endswith(".mci") else accepted()


PROGRAM = Program(
    "mcml-sim", app, (ClusterError, InputError, OutputError, StoreError), _stopped, hint=_hint, remedied=_remedied
)


def main() -> None:
    """Run a command; the first Ctrl-C waits for the batches in flight, the second does not."""
    with two_interrupts():
        PROGRAM.main()
