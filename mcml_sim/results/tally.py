"""Shares of the light in a layered medium, quantity by quantity, with errors; and their file, for numpy alone.

Of each quantity of a tally the .npz holds NAME, NAME_standard_error, NAME_effective_samples; the edges r_edges,
z_edges, a_edges; and `header`, JSON text that says what was run: numpy.load(path)["absorbed_rz"] is all it takes.
"""

from __future__ import annotations

import io
import json
import math
import os
import reprlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.exact.single_scattering import entered
from mcml_sim.files.npz import read_npz
from mcml_sim.files.version import __version__
from mcml_sim.files.whole_file import checked_path, parse_json, read_whole, write_whole
from mcml_sim.media.arrays import MAX_PHOTONS, Floats, checked_whole, is_number, require, scalar_or_array, shown
from mcml_sim.media.grid import Grid, require_resolved
from mcml_sim.media.medium import MAX_LAYERS, Layer, Medium, specular_reflectance
from mcml_sim.media.phase import as_table, from_table
from mcml_sim.media.setting import Setting, require_illumination
from mcml_sim.results.estimate import Estimate
from mcml_sim.tracing.deposits import Deposits

SCALARS = (
    "specular_reflectance",
    "diffuse_reflectance",
    "absorbed",
    "transmittance",
    "diffuse_transmittance",
    "ballistic_transmittance",
    "energy",
)
BY_LAYER = ("absorbed_per_layer",)
BY_RADIUS = ("reflectance_r", "transmittance_r", "reflectance_r_overflow", "transmittance_r_overflow")
BY_DEPTH = ("absorbed_z", "absorbed_rz", "absorbed_z_overflow")
BY_ANGLE = ("reflectance_a", "reflectance_ra", "transmittance_a", "transmittance_ra")

FORMAT = 1
ENDS = ("", "_standard_error", "_effective_samples")  # the fields of an Estimate
EDGES = ("r_edges", "z_edges", "a_edges")
LIGHT = "illumination"
HEADER = frozenset({"format", "mcml_sim", "photons", "seed", "cut", "medium"})
PHASE = "phase"
MEDIUM, LAYER = (frozenset(field.name for field in fields(kind)) for kind in (Medium, Layer))
MAX_BYTES = 2**28  # of a file; the finest tables have 2^27.2 unpacked
MOST_FIRST = 2**22  # bytes of edges and header: 65537 numbers an axis, and a thousand layers
MOST_BEFORE = 512  # bytes of an array's own header
WORD = 8  # bytes of a number
LONGEST_VERSION = 60  # characters


def quantities(grid: Grid) -> tuple[str, ...]:
    """Return the names of all estimates that a grid resolves."""
    z = BY_DEPTH if grid.depths else ()
    a = BY_ANGLE if grid.angles else ()
    return (*SCALARS, *BY_LAYER, *BY_RADIUS, *z, *a)


def shapes(grid: Grid, layers: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every estimate that a grid resolves, in a medium of so many layers."""
    bins = {"r": grid.rings, "z": grid.depths, "a": grid.angles}
    ends = {name: name.rpartition("_")[2] for name in quantities(grid)}
    axes = {name: tuple(bins[axis] for axis in end) for name, end in ends.items() if set(end) <= set(bins)}
    return {name: axes.get(name, (layers,) if name in BY_LAYER else ()) for name in ends}


@dataclass(frozen=True)
class Precision:
    """Precision at which a run stops: a quantity's standard error, in every bin, is this share of its value.

    relative_error  of the standard error to the value [-], in (0, 1)
    quantity        a name of `Tally.quantities`
    """

    relative_error: float
    quantity: str = "diffuse_reflectance"

    def __post_init__(self) -> None:
        share = self.relative_error
        if isinstance(share, bool) or not (isinstance(share, (int, float, np.number)) and 0 < share < 1):
            raise InputError(f"precision must be a relative standard error in (0, 1), got {share!r}")

    def is_reached(self, estimate: Estimate) -> bool:
        """Return True if the error is small enough in every bin; a bin without light is not known at all."""
        value, error = np.asarray(estimate.value), np.asarray(estimate.standard_error)
        return bool(np.all((value > 0) & (error <= self.relative_error * value)))


@dataclass(frozen=True, eq=False)
class Tally:
    """Shares of the light that came in, by where it went; lengths in the unit of the medium.

    Every quantity is an Estimate: value, standard error, effective samples. Bins hold means over themselves, never
    values at their middles. Those of radius leave out what fell beyond the last ring (`..._overflow`); what was
    transmitted without scattering is a ray, not a profile, and kept apart. InputError where the grid does not
    resolve what is requested.
    """

    medium: Medium
    grid: Grid
    photons: int
    seed: int
    deposits: Deposits
    """Sums that all estimates come from, for photons of weight 1 that have entered."""
    illumination: str = "searchlight"
    """Illumination, "searchlight" or "diffuse", as in `Setting`."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all estimates that this grid resolves."""
        return quantities(self.grid)

    def quantity(self, name: str) -> Estimate:
        """Return the estimate of that name."""
        require_quantity(name, self.grid)
        return cast(Estimate, getattr(self, name))

    @property
    def specular_reflectance(self) -> Estimate:
        """Light that the surface sends back before any of it enters [-]: Fresnel's formula, without error."""
        return Estimate(1 - self._entering, 0.0, math.inf)

    @property
    def diffuse_reflectance(self) -> Estimate:
        """Light that entered and left through the top, beyond the last ring included [-].

        As in MCML also what was never scattered but thrown back by an interface below; it leaves at r = 0.
        """
        return self._leaving("reflected", (0, 1))

    @property
    def transmittance(self) -> Estimate:
        """Light that left through the bottom, diffuse and ballistic [-]."""
        return self._exits(
            self.deposits.transmitted.sum() + self.deposits.ballistic,
            self.deposits.transmitted_squares.sum() + self.deposits.ballistic_squares,
        )

    @property
    def diffuse_transmittance(self) -> Estimate:
        """Light that was scattered and left through the bottom [-]."""
        return self._leaving("transmitted", (0, 1))

    @property
    def ballistic_transmittance(self) -> Estimate:
        """Light that was never scattered and left through the bottom [-]."""
        return self._exits(self.deposits.ballistic, self.deposits.ballistic_squares)

    @property
    def absorbed(self) -> Estimate:
        """Light absorbed in all layers [-]."""
        return self._exits(self.deposits.absorbed[-1], self.deposits.absorbed_squares[-1])

    @property
    def absorbed_per_layer(self) -> Estimate:
        """Light absorbed in each layer [-], (layers,)."""
        return self._exits(self.deposits.absorbed[:-1], self.deposits.absorbed_squares[:-1])

    @property
    def energy(self) -> Estimate:
        """Specular + diffuse reflectance + absorbed + transmittance + cut: 1 but for roulette's luck [-]."""
        entered = self._exits(self.deposits.accounted, self.deposits.accounted_squares)
        return replace(entered, value=entered.value + 1 - self._entering)

    @property
    def cut(self) -> float:
        """Light terminated at the scattering limit, still inside [-]; part of `energy`."""
        return float(self.deposits.cut) / self.photons * self._entering

    @property
    def reflectance_r(self) -> Estimate:
        """Diffuse reflectance by radius, R_d [1/length^2], (rings,)."""
        return self._by_radius("reflected")

    @property
    def transmittance_r(self) -> Estimate:
        """Diffuse transmittance by radius [1/length^2], (rings,)."""
        return self._by_radius("transmitted")

    @property
    def reflectance_r_overflow(self) -> Estimate:
        """Diffuse reflectance beyond the last ring [-]."""
        return self._overflow("reflected")

    @property
    def transmittance_r_overflow(self) -> Estimate:
        """Diffuse transmittance beyond the last ring [-]."""
        return self._overflow("transmitted")

    @property
    def reflectance_a(self) -> Estimate:
        """Diffuse reflectance by exit angle, all radii [1/sr], (angles,): per solid angle, not divided by a cosine."""
        return self._leaving("reflected", (0,)).scaled(1 / self.grid.solid_angles)

    @property
    def transmittance_a(self) -> Estimate:
        """Diffuse transmittance by exit angle, all radii [1/sr], (angles,)."""
        return self._leaving("transmitted", (0,)).scaled(1 / self.grid.solid_angles)

    @property
    def reflectance_ra(self) -> Estimate:
        """Diffuse reflectance by radius and exit angle [1/(length^2 sr)], (rings, angles)."""
        return self._by_radius_and_angle("reflected")

    @property
    def transmittance_ra(self) -> Estimate:
        """Diffuse transmittance by radius and exit angle [1/(length^2 sr)], (rings, angles)."""
        return self._by_radius_and_angle("transmitted")

    @property
    def absorbed_z(self) -> Estimate:
        """Light absorbed by depth, at all radii [1/length], (depths,)."""
        widths = self.grid.z_widths
        return self._spread(self.deposits.absorbed_z[:-1], self.deposits.absorbed_z_variance[:-1]).scaled(1 / widths)

    @property
    def absorbed_rz(self) -> Estimate:
        """Light absorbed by radius and depth [1/length^3], (rings, depths)."""
        volumes = self.grid.r_areas[:, None] * self.grid.z_widths
        sums, variance = self.deposits.absorbed_rz[:-1, :-1], self.deposits.absorbed_rz_variance[:-1, :-1]
        return self._spread(sums, variance).scaled(1 / volumes)

    @property
    def absorbed_z_overflow(self) -> Estimate:
        """Light absorbed below the last depth, at all radii [-]."""
        _ = self.grid.z_widths
        return self._spread(self.deposits.absorbed_z[-1], self.deposits.absorbed_z_variance[-1])

    @property
    def _entering(self) -> float:
        """Share of the light that enters [-]."""
        if self.illumination == "diffuse":
            return entered(Setting(self.illumination, n=self.medium.layers[0].n / self.medium.n_above))
        return 1 - specular_reflectance(self.medium)

    def _by_radius(self, what: str) -> Estimate:
        return self._leaving(what, (1,)).mapped(lambda part: part[:-1]).scaled(1 / self.grid.r_areas)

    def _overflow(self, what: str) -> Estimate:
        return self._leaving(what, (1,)).mapped(lambda part: float(part[-1]))

    def _by_radius_and_angle(self, what: str) -> Estimate:
        bins = self.grid.r_areas[:, None] * self.grid.solid_angles
        return self._leaving(what, ()).mapped(lambda part: part[:-1]).scaled(1 / bins)

    def _leaving(self, what: str, axes: tuple[int, ...]) -> Estimate:
        """Return the light out of one side, summed over `axes` (0: radius, 1: angle)."""
        sums, squares = getattr(self.deposits, what), getattr(self.deposits, f"{what}_squares")
        return self._exits(sums.sum(axis=axes), squares.sum(axis=axes))

    def _exits(self, sums: Floats, squares: Floats) -> Estimate:
        """Return the estimate from each photon's weight and its square, which every photon gives at most once."""
        if self.photons == 1:  # alone it says nothing of its error
            return self._spread(sums, np.full(np.shape(sums), math.inf))
        spread = np.maximum(squares - sums**2 / self.photons, 0)
        return self._spread(sums, spread * (self.photons / (self.photons - 1)))

    def _spread(self, sums: Floats, variance: Floats) -> Estimate:
        """Return the estimate from a sum over photons and the variance of that sum."""
        sums, variance = np.asarray(sums, np.float64), np.asarray(variance, np.float64)
        squares = variance + sums**2 / self.photons
        effective = np.divide(sums**2, squares, out=np.zeros_like(sums), where=squares > 0)
        share = self._entering / self.photons
        return Estimate(share * sums, share * np.sqrt(variance), effective).mapped(scalar_or_array)


def require_quantity(name: str, grid: Grid) -> None:
    """Raise InputError unless a grid resolves the quantity of that name."""
    require(name in quantities(grid), "quantity", f"one of {', '.join(quantities(grid))}", name)


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
    arrays = {name: edges for name in EDGES if (edges := getattr(tally.grid, name)) is not None}
    for name in tally.quantities:
        estimate = tally.quantity(name)
        parts = (estimate.value, estimate.standard_error, estimate.effective_samples)
        arrays |= {name + end: np.asarray(part) for end, part in zip(ENDS, parts, strict=True)}
    contents = io.BytesIO()
    np.savez_compressed(contents, allow_pickle=False, header=np.array(json.dumps(header)), **arrays)
    return contents.getvalue()


def read_results(path: str | os.PathLike[str]) -> Results:
    """Read a file of `write_results`. InputError names the file and says what is wrong with it."""
    return parse_results(read_whole(path, MAX_BYTES, "results of mcml_sim"), str(path))


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
    is_version = isinstance(version, str) and version.isprintable() and len(version) <= LONGEST_VERSION
    require(is_version, "mcml_sim", "a version", version)
    require(is_number(cut) and 0 <= cut <= 1, "cut", "a share of the light", cut)
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
    objects, layers = table.pop("layers"), []
    is_list = isinstance(objects, list) and len(objects) <= MAX_LAYERS
    require(is_list, "layers", f"a list of at most {MAX_LAYERS}", objects)
    for at, value in enumerate(objects, start=1):
        values = _table(f"layer {at}", {PHASE: None, **value} if isinstance(value, dict) else value, LAYER)
        if values[PHASE] is not None:
            values[PHASE] = from_table(values[PHASE])
        layers.append(Layer(**values))
    return Medium(tuple(layers), **table)


def _as_object(layer: Layer) -> dict[str, Any]:
    """Return a layer; its phase function only where that is not Henyey and Greenstein's, as files always did."""
    values = {field.name: getattr(layer, field.name) for field in fields(Layer) if field.name != PHASE}
    return values if layer.phase is None else {**values, PHASE: as_table(layer.phase)}


def _grid(arrays: Mapping[str, NDArray]) -> Grid:
    angles = arrays.get("a_edges")
    number = None if angles is None else angles.size - 1
    grid = Grid.from_edges(r=_needed(arrays, "r_edges"), z=arrays.get("z_edges"), na=number)
    require_resolved(grid)
    if angles is not None and not (angles.ndim == 1 and np.allclose(angles, np.asarray(grid.a_edges), rtol=1e-12)):
        raise ValueError("a_edges must be even from 0 to pi/2")
    return grid


def _table(name: str, value: Any, keys: frozenset[str]) -> dict[str, Any]:
    """Return an object of just these keys."""
    require(isinstance(value, dict), name, "an object", value)
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
