"""What a run found, with all its errors, in one .npz file that numpy alone can open.

For each quantity of a tally: NAME, NAME_standard_error, NAME_effective_samples; the edges r_edges, z_edges, a_edges;
and `header`, JSON text that says what was run. numpy.load(path)["absorbed_rz"] is all it takes elsewhere.
"""

from __future__ import annotations

import io
import json
import os
import reprlib
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.grid import Grid
from mcml_sim.medium import Layer, Medium
from mcml_sim.quantities import Tally, quantities
from mcml_sim.tally import Estimate
from mcml_sim.version import __version__
from mcml_sim.whole_file import checked_path, write_whole

FORMAT = 1
ENDS = ("", "_standard_error", "_effective_samples")  # the fields of an Estimate
# What numpy and zip raise at a file that is not what was written.
DAMAGED = (OSError, ValueError, TypeError, LookupError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True, eq=False)
class Results:
    """What `write_results` kept of a tally; lengths in the unit of its medium."""

    medium: Medium
    grid: Grid
    photons: int
    seed: int
    version: str
    """Of mcml_sim, that made it."""
    cut: float
    """Light given up inside, after the last event allowed [-]."""
    estimates: Mapping[str, Estimate]
    """By the names of the tally's properties."""


def write_results(tally: Tally, path: str | os.PathLike[str]) -> None:
    """Keep every estimate of a tally in an .npz file, whole or not at all. OutputError if it cannot be written.

    The same tally gives the same bytes. InputError if that is not what `simulate` gave, or no path.
    """
    if not isinstance(tally, Tally):
        raise InputError(f"tally must be what simulate gave, got {reprlib.repr(tally)}")
    write_whole(checked_path(path), results_bytes(tally))


def results_bytes(tally: Tally) -> bytes:
    """What `write_results` writes."""
    header = {
        "format": FORMAT,
        "mcml_sim": __version__,
        "photons": tally.photons,
        "seed": tally.seed,
        "cut": tally.cut,
        "medium": asdict(tally.medium),
    }
    edges = {"r_edges": tally.grid.r_edges, "z_edges": tally.grid.z_edges, "a_edges": tally.grid.a_edges}
    arrays = {name: one for name, one in edges.items() if one is not None}
    for name in tally.quantities:
        estimate = tally.quantity(name)
        parts = (estimate.value, estimate.standard_error, estimate.effective_samples)
        arrays |= {name + end: np.asarray(part) for end, part in zip(ENDS, parts, strict=True)}
    contents = io.BytesIO()
    np.savez_compressed(contents, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)
    return contents.getvalue()


def read_results(path: str | os.PathLike[str]) -> Results:
    """What `write_results` wrote. InputError names the file and says what is wrong with it."""
    try:
        with Path(path).open("rb") as file:
            if not zipfile.is_zipfile(file):  # numpy would take it for a pickle
                raise ValueError("not a whole .npz file")
            with np.load(file, allow_pickle=False) as fields:
                return _results(dict(fields))
    except DAMAGED as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise InputError(f"{path}: expected results of mcml_sim, got: {reason.splitlines()[0]}") from None


def _results(fields: Mapping[str, NDArray]) -> Results:
    header: dict[str, Any] = json.loads(str(fields["header"]))
    if header["format"] != FORMAT:
        raise ValueError(f"format {header['format']!r}, not {FORMAT}")
    layers = tuple(Layer(**layer) for layer in header["medium"].pop("layers"))
    a_edges = fields.get("a_edges")
    grid = Grid.from_edges(
        r=fields["r_edges"], z=fields.get("z_edges"), na=None if a_edges is None else len(a_edges) - 1
    )
    estimates = {name: _estimate(fields, name) for name in quantities(grid)}
    return Results(
        medium=Medium(layers, **header["medium"]),
        grid=grid,
        photons=header["photons"],
        seed=header["seed"],
        version=header["mcml_sim"],
        cut=header["cut"],
        estimates=estimates,
    )


def _estimate(fields: Mapping[str, NDArray], name: str) -> Estimate:
    parts = [fields[name + end] for end in ENDS]
    return Estimate(*(part if part.ndim else float(part) for part in parts))
