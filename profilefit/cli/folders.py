"""Which folders a command takes: what it is told, else what lies in the folder one works in, else what was shipped."""

from __future__ import annotations

import warnings
from pathlib import Path

from mcml_sim.cli.lazy import interruptible
from profilefit.errors import InputError, OtherRecords
from profilefit.recipes.folder import EVIDENCE, LOCAL, PHASES, STACKS, fits_folder


def records_folder(requested: Path | None = None, quiet: bool = False) -> Path:
    """The folder requested, or ./fits if it has records, or the one shipped.

    One that is not the shipped one is named by an OtherRecords warning, since constants of a strange folder look like
    ours; one that was requested is not, if `quiet`. InputError if it is no folder.
    """
    if requested is not None and not requested.is_dir():
        raise InputError(f"--fits must be a folder of records, got {str(requested)!r}, which is none")
    folder = known_folder(requested)
    if folder.resolve() != fits_folder().resolve() and not (quiet and requested):
        where = "" if requested else " in the folder that you are in; --fits chooses others"
        warnings.warn(f"records of {str(folder)!r}{where}", OtherRecords, stacklevel=2)
    return folder


def known_folder(requested: Path | None = None) -> Path:
    """The same without a word, there or not."""
    with interruptible(__name__):
        from profilefit.recipes.record import available

    return requested or (LOCAL if available(LOCAL) else fits_folder())


def known_stacks(requested: Path | None = None) -> dict[str, Path]:
    """The records of stacks by name: of the folder requested or, if none was, of ./fits beside those shipped."""
    return _known(STACKS, requested)


def known_phases(requested: Path | None = None) -> dict[str, Path]:
    """The same of phase functions."""
    return _known(PHASES, requested)


def _known(kind: str, requested: Path | None) -> dict[str, Path]:
    with interruptible(__name__):
        from profilefit.recipes.record import available

    found: dict[str, Path] = {}
    for one in (requested,) if requested else (fits_folder(), LOCAL):
        found |= available(one / kind)
    return dict(sorted(found.items()))


def evidence_folder(records: Path, requested: Path | None = None) -> Path:
    """The folder requested, or ./evidence if it is there, or the one beside the records.

    One that was not requested is named by an OtherRecords warning. InputError if one was requested and is no folder.
    """
    if requested is not None and not requested.is_dir():
        raise InputError(f"--evidence must be a folder, got {str(requested)!r}, which is none")
    if requested is None and EVIDENCE.is_dir():
        where = f"measurements of {str(EVIDENCE)!r} in the folder that you are in; --evidence chooses others"
        warnings.warn(where, OtherRecords, stacklevel=2)
    return requested or (EVIDENCE if EVIDENCE.is_dir() else records / EVIDENCE)
