"""Where recipes and records lie: in what came with this installation, and where one writes one's own."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

LOCAL = Path("fits")
STACKS = "stacks"  # in a folder of records: the folder of those of stacks
SUMS = "gaussians"  # and that of their sums of Gaussians
PHASES = "phases"  # and that of phase functions
EVIDENCE = Path("evidence")  # what was measured with records: shader check, failures, times


def fits_folder() -> Path:
    """The recipes and records that came with this installation."""
    return shipped("fits")


def shipped(name: str) -> Path:
    """A folder that came with this installation: in the wheel, or beside the package in a checkout."""
    package = Path(str(resources.files("profilefit"))).resolve()
    inside = package / name
    return inside if inside.is_dir() else package.parent / name
