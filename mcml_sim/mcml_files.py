"""MCML's files: what `read_mci` reads and `write_mco` writes."""

from mcml_sim.mci import Run, read_mci
from mcml_sim.mco import write_mco

__all__ = ["Run", "read_mci", "write_mco"]
