"""Results of a run, with all its errors, in one .npz file that numpy alone can open.

For each quantity of a tally: NAME, NAME_standard_error, NAME_effective_samples; the edges r_edges, z_edges, a_edges;
and `header`, JSON text that says what was run. numpy.load(path)["absorbed_rz"] is all it takes elsewhere.
"""

from __future__ import annotations

import io
import json
import math
import os
import reprlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.files.npz import read_npz
from mcml_sim.files.text_file import parse_json
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import checked_path, write_whole
from mcml_sim.media.checks import MAX_PHOTONS, checked_whole, is_number, shown
from mcml_sim.media.grid import Grid, require_resolved
from mcml_sim.media.medium import MAX_LAYERS, Layer, Medium
from mcml_sim.media.phase import as_table, from_table
from mcml_sim.media.setting import require_illumination
from mcml_sim.results.estimate import Estimate
from mcml_sim.results.tally import Tally, shapes

FORMAT = 1
ENDS = ("", "_standard_error", "_effective_samples")  # the fields of an Estimate
EDGES = ("r_edges", "z_edges", "a_edges")
LIGHT = "illumination"
HEADER = frozenset({"format", "mcml_sim", "photons", "seed", "cut", "medium"})
PHASE = "phase"
MEDIUM, LAYER = (frozenset(field.name for field in fields(kind)) - {PHASE} for kind in (Medium, Layer))
MAX_BYTES = 2**28  # of a file; the finest tables have 2^27.2 unpacked
MOST_FIRST = 2**22  # bytes of edges and header: 65537 numbers an axis, and a thousand layers
MOST_BEFORE = 512  # bytes of an array's own header
WORD = 8  # bytes of a number
LONGEST_VERSION = 60  # characters


@dataclass(frozen=True, eq=False)
class Results:
    """Content of a file of `write_results`; lengths in the unit of its medium."""

    medium: Medium
    grid: Grid
    photons: int
    seed: int
    version: str
    """Version of mcml_sim that made it."""
    cut: float
    """Light terminated at the scattering limit, still inside [-]."""
    estimates: Mapping[str, Estimate]
    """Estimates by the names of the tally's properties."""
    illumination: str = "searchlight"


def write_results(tally: Tally, path: str | os.PathLike[str]) -> None:
    """Keep every estimate of a tally in an .npz file, whole or not at all. OutputError if it cannot be written.

    The same tally gives the same bytes. InputError if that is not what `simulate` gave, or no path.
    """
    if not isinstance(tally, Tally):
        raise InputError(f"tally must be what simulate gave, got {reprlib.repr(tally)}")
    write_whole(checked_path(path), results_bytes(tally))


def results_bytes(tally: Tally) -> bytes:
    """Return the bytes that `write_results` writes."""
    header: dict[str, object] = {
        "format": FORMAT,
        "mcml_sim": __version__,
        "photons": tally.photons,
        "seed": tally.seed,
        "cut": tally.cut,
        "medium": {**asdict(tally.medium), "layers": [_as_object(layer) for layer in tally.medium.layers]},
    }
    if tally.illumination != "searchlight":  # which files said nothing of when there was no other
        header[LIGHT] = tally.illumination
    edges = {"r_edges": tally.grid.r_edges, "z_edges": tally.grid.z_edges, "a_edges": tally.grid.a_edges}
    arrays = {name: values for name, values in edges.items() if values is not None}
    for name in tally.quantities:
        estimate = tally.quantity(name)
        parts = (estimate.value, estimate.standard_error, estimate.effective_samples)
        arrays |= {name + end: np.asarray(part) for end, part in zip(ENDS, parts, strict=True)}
    contents = io.BytesIO()
    np.savez_compressed(contents, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)
    return contents.getvalue()


def read_results(path: str | os.PathLike[str]) -> Results:
    """Read a file of `write_results`. InputError names the file and says what is wrong with it."""
    try:
        with Path(path).open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: expected results of mcml_sim, got: {reason}") from None
    return parse_results(content, str(path))


def parse_results(content: bytes, name: str) -> Results:
    """Return what `read_results` gives for a file of this name and content."""
    try:
        if len(content) > MAX_BYTES:
            raise ValueError(f"more than {MAX_BYTES} bytes")
        return _results(content)
    except ValueError as error:
        raise InputError(f"{name}: expected results of mcml_sim, got: {error}") from None


def _results(content: bytes) -> Results:
    """Return the results; the header is read first, which says how large all else is. ValueError in one line."""
    first = read_npz(content, MOST_FIRST, {"header": (), **dict.fromkeys(EDGES)}, text=["header"])
    head = parse_json(str(_needed(first, "header")).encode(), MOST_FIRST, infinite=True)
    light = head.pop(LIGHT, "searchlight") if isinstance(head, dict) else None
    header = _table("header", head, HEADER)
    require_illumination(light)
    if type(header["format"]) is not int or header["format"] != FORMAT:
        raise ValueError(f"format {shown(header['format'])}, not {FORMAT}")
    medium, grid = _medium(header["medium"]), _grid(first)
    photons = checked_whole("photons", header["photons"], lowest=1, highest=MAX_PHOTONS)
    version, cut = header["mcml_sim"], header["cut"]
    if not (isinstance(version, str) and version.isprintable() and len(version) <= LONGEST_VERSION):
        raise ValueError(f"mcml_sim must be a version, got {shown(version)}")
    if not (is_number(cut) and 0 <= cut <= 1):
        raise ValueError(f"cut must be a share of the light, got {shown(cut)}")
    sizes = shapes(grid, len(medium.layers))
    parts = {name + end: size for name, size in sizes.items() for end in ENDS}
    arrays = read_npz(content, sum(MOST_BEFORE + WORD * math.prod(size) for size in parts.values()), parts)
    return Results(
        medium=medium,
        grid=grid,
        photons=photons,
        seed=checked_whole("seed", header["seed"], lowest=0),
        version=version,
        cut=cut,
        estimates={name: _estimate(arrays, name) for name in sizes},
        illumination=str(light),
    )


def _medium(value: object) -> Medium:
    table = _table("medium", value, MEDIUM)
    layers = table.pop("layers")
    if not isinstance(layers, list) or len(layers) > MAX_LAYERS:
        raise ValueError(f"layers must be a list of at most {MAX_LAYERS}, got {shown(layers)}")
    return Medium(tuple(_layer(f"layer {at}", layer) for at, layer in enumerate(layers, start=1)), **table)


def _as_object(layer: Layer) -> dict[str, Any]:
    """Return a layer; its phase function only where that is not Henyey and Greenstein's, as files always did."""
    values = {field.name: getattr(layer, field.name) for field in fields(Layer) if field.name != PHASE}
    return values if layer.phase is None else {**values, PHASE: as_table(layer.phase)}


def _layer(name: str, value: object) -> Layer:
    values = dict(value) if isinstance(value, dict) else value
    phase = values.pop(PHASE) if isinstance(values, dict) and PHASE in values else None
    return Layer(**_table(name, values, LAYER), phase=None if phase is None else from_table(phase))


def _grid(arrays: Mapping[str, NDArray]) -> Grid:
    angles = arrays.get("a_edges")
    grid = Grid.from_edges(
        r=_needed(arrays, "r_edges"), z=arrays.get("z_edges"), na=None if angles is None else angles.size - 1
    )
    require_resolved(grid)
    if angles is not None and not (angles.ndim == 1 and np.allclose(angles, np.asarray(grid.a_edges), rtol=1e-12)):
        raise ValueError("a_edges must be even from 0 to pi/2")
    return grid


def _table(name: str, value: object, keys: frozenset[str]) -> dict[str, Any]:
    """Return an object of just these keys."""
    if not isinstance(value, dict):
        raise ValueError(f"{name} must be an object, got {shown(value)}")
    for key in sorted(keys ^ value.keys()):
        raise ValueError(f"{name} has no key {key!r}" if key in keys else f"{name} has the unknown key {shown(key)}")
    return dict(value)


def _estimate(arrays: Mapping[str, NDArray], name: str) -> Estimate:
    value, error, samples = parts = [_needed(arrays, name + end) for end in ENDS]
    if not np.all(np.isfinite(value)):
        raise ValueError(f"{name} must be finite")
    if not np.all(error >= 0):  # infinite where too few photons say nothing of it
        raise ValueError(f"{name}{ENDS[1]} must be >= 0")
    if not np.all(samples >= 0):
        raise ValueError(f"{name}{ENDS[2]} must be >= 0")
    return Estimate(*(np.asarray(part, float) if part.ndim else float(part) for part in parts))


def _needed(arrays: Mapping[str, NDArray], name: str) -> NDArray:
    if name not in arrays:
        raise ValueError(f"no {name}")
    return arrays[name]
