"""Where records lie: in the folder one works in, if it has any, else in what came with this installation."""

from __future__ import annotations

from pathlib import Path

from profilefit import record

LOCAL = Path("fits")
EVIDENCE = Path("evidence")  # what was measured with records: shader check, failures, times


def fits_folder() -> Path:
    """The recipes and records that came with this installation."""
    return shipped("fits")


def shipped(name: str) -> Path:
    """A folder that came with this installation: in the wheel, or beside the package in a checkout."""
    package = Path(__file__).resolve().parent
    inside = package / name
    return inside if inside.is_dir() else package.parent / name


def records_folder(asked: Path | None = None) -> Path:
    """The folder that was asked for, or ./fits if it has records, or the one shipped."""
    return asked or (LOCAL if record.available(LOCAL) else fits_folder())


def evidence_folder(records: Path, asked: Path | None = None) -> Path:
    """The folder that was asked for, or ./evidence if it is there, or the one beside the records."""
    return asked or (EVIDENCE if EVIDENCE.is_dir() else records / EVIDENCE)
