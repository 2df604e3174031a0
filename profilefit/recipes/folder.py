"""Folders of recipes and records: those that came with this installation, and the one that a user writes into."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

LOCAL = Path("fits")
STACKS = "stacks"  # inside a folder of records: the folder of those of stacks
SUMS = "gaussians"  # of their sums of Gaussians
PHASES = "phases"  # of phase functions
EVIDENCE = Path("evidence")  # what was measured with records: shader check, failures, times


def fits_folder() -> Path:
    """Return the folder of recipes and records that came with this installation."""
    return shipped("fits")


def known_folder(requested: Path | None = None) -> Path:
    """Return the folder requested, there or not, else ./fits where it has records of laws, else the shipped one."""
    return requested or (LOCAL if available(LOCAL) else fits_folder())


def available(folder: Path, ending: str = "json") -> dict[str, Path]:
    """Return the records of a folder by name, in order, or files of another ending."""
    return {path.stem: path for path in sorted(folder.glob(f"*.{ending}"))}


def shipped(name: str) -> Path:
    """Return a folder that came with this installation: in the wheel, or beside the package in a checkout."""
    package = Path(str(resources.files("profilefit"))).resolve()
    inside = package / name
    return inside if inside.is_dir() else package.parent / name


def is_file(path: Path) -> bool:
    """Return whether there is such a file; none has a name that is too long for the system."""
    try:
        return path.is_file()
    except OSError:
        return False
