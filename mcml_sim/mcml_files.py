"""MCML's files: what `read_mci` and `read_mco` read and `write_mco` writes."""

from mcml_sim.mci import Run, read_mci
from mcml_sim.mco import write_mco
from mcml_sim.mco_reader import Output, read_mco

__all__ = ["Output", "Run", "read_mci", "read_mco", "write_mco"]
