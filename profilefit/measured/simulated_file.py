"""Files of simulated profiles: MCML's .mco files, and the .npz that `mcml-sim run` writes beside them.

An .mco holds no errors. A photon's weight w is at most that with which it entered, 1 - R_specular, so the mean of w^2
over a ring of energy E is at most E (1 - R_specular): the fit uses that bound, its errors are bounds too, and its
chi-square is at most what it should be. The .npz has the errors. The last ring of an .mco, which holds all light beyond
it, is left out.

Rings share the photons of their run, which correlates them (see `noise`): their covariance -E_i E_j / (N - 1) is exact
for both kinds where a photon leaves once and as a whole, as in `mcml-sim` and in MCML as it is distributed. With it,
the .mco's bound on the squares bounds the whole covariance, so errors of whatever is fitted stay upper bounds.

Far rings hold few photons or none, and leaving out empty ones would leave out the absence of light: neighbouring rings
are merged until each holds enough photons, the empty tail included.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mcml_sim.files.whole_file import read_whole
from mcml_sim.media.medium import Medium
from mcml_sim.results import mco, tally
from profilefit.errors import InputError
from profilefit.measured.data import Floats, Measured

UNIT = "cm"
# At a hundred photons the standard error of a ring is known to 10 %, and near enough to a normal one.
FEWEST_PHOTONS = 100.0
# Narrower rings, relative to their radius, add no information about a smooth profile.
NARROWEST = 0.03
FEWEST_RINGS = 3
MOST_SHOWN = 6  # layers
ENDLESS = 1e4  # cm: what users of MCML write for a half space is 1e8
ALL_LIGHT = 1.0 + 1e-3  # files are rounded


def read_mco_profile(path: Path) -> Measured:
    """Read Rd_r of an .mco file, lengths in cm."""
    content = read_whole(path, mco.MAX_BYTES)
    result = mco.parse_mco(content, str(path))
    grid, photons = result.run.grid, result.run.photons
    entered = 1.0 - result.specular_reflectance
    if not entered > 0:
        raise InputError(f"{path}: expected a specular reflectance below 1, got {result.specular_reflectance:g}")
    energy = (result.reflectance_r * grid.r_areas)[:-1]
    each = entered / photons
    notes = (f"the last of {grid.rings} annuli, which holds all light beyond it, is left out",)
    return _counted(
        path, content, grid.r_edges[:-1], energy, energy * each, energy / each, float(photons),
        "bounds: no photon weighs more than it entered with", True, result.run.medium, "searchlight",
        (*notes, *_layers(result.run.medium)),
    )  # fmt: skip


def read_npz_profile(path: Path) -> Measured:
    """Read reflectance_r of the results of `mcml-sim run`, with its own errors, lengths in cm."""
    content = read_whole(path, tally.MAX_BYTES)
    result = tally.parse_results(content, str(path))
    if result.photons < 2:
        raise InputError(f"{path}: expected two photons or more, since one has no standard error, got 1")
    estimate = result.estimates["reflectance_r"]
    areas = result.grid.r_areas
    with np.errstate(over="ignore"):  # impossible reflectances are refused below
        energy, error = np.asarray(estimate.value) * areas, np.asarray(estimate.standard_error) * areas
    if not np.all(error <= ALL_LIGHT):
        raise InputError(f"{path}: expected standard errors of no more than all of the light")
    _require_light(path, energy)
    squares = error**2 + energy**2 / (result.photons - 1.0)
    return _counted(
        path, content, result.grid.r_edges, energy, squares, np.asarray(estimate.effective_samples),
        float(result.photons), "standard errors of the simulation", False, result.medium, result.illumination,
        tuple(_layers(result.medium)),
    )  # fmt: skip


def _counted(
    path: Path,
    content: bytes,
    edges: Floats,
    energy: Floats,
    squares: Floats,
    seen: Floats,
    photons: float,
    errors: str,
    bounded: bool,
    medium: Medium,
    illumination: str,
    notes: tuple[str, ...],
) -> Measured:
    """Return rings merged until each holds enough photons, from (n,) rings.

    energy      E of each; squares the sum of w^2 of its photons over N (N - 1), whose excess over E^2 / (N - 1) is the
                variance of E; seen the photons that it is estimated from
    photons     N, of the whole run
    """
    _require_light(path, energy)
    starts = merged(edges, seen)
    if starts.size < FEWEST_RINGS:
        raise InputError(
            f"{path}: expected at least {FEWEST_RINGS} annuli of {FEWEST_PHOTONS:.0f} photons each, "
            f"got {float(seen.sum()):.0f} in all"
        )
    inner, outer = edges[starts], np.append(edges[starts[1:]], edges[-1])
    areas = np.pi * (outer - inner) * (outer + inner)
    whole = np.add.reduceat(energy, starts)
    variance = np.add.reduceat(squares, starts) - whole**2 / (photons - 1.0)
    if not np.all(variance > 0):
        at = int(np.argmin(variance > 0))
        raise InputError(f"{path}: expected a standard error > 0 of the light from r = {inner[at]:g} to {outer[at]:g}")
    spread = np.sqrt(variance)
    if starts.size < energy.size:
        merging = f"{energy.size} annuli merged into {starts.size}, of at least {FEWEST_PHOTONS:.0f} photons each"
        notes = (*notes, merging)
    return Measured(
        str(path), hashlib.sha256(content).hexdigest(), inner, outer, whole / areas, spread / areas,
        np.full(whole.size, np.inf), errors, UNIT, True, bounded, photons=photons, medium=medium,
        illumination=illumination, notes=notes,
    )  # fmt: skip


def _layers(medium: Medium) -> Iterator[str]:
    """Yield notes on what a medium has that no half space has."""
    if len(medium.layers) > 1:
        each = (
            f"n {one.n:g}, mu_a {one.mu_a:g}, mu_s' {one.similar.mu_s:g} 1/cm, "
            + ("endless" if math.isinf(one.thickness) else f"{one.thickness:g} cm")
            for one in medium.layers[:MOST_SHOWN]
        )
        more = f"; and {len(medium.layers) - MOST_SHOWN} more" if len(medium.layers) > MOST_SHOWN else ""
        yield f"the file's {len(medium.layers)} layers, from above: {'; '.join(each)}{more}"
    if not (medium.is_half_space or medium.z_edges[-1] > ENDLESS):
        yield (
            f"the file's medium is a slab {medium.z_edges[-1]:g} cm thick, fitted as a half space: light that leaves "
            "below reads as absorbed"
        )


def _require_light(path: Path, energy: Floats) -> None:
    if not (np.all(energy >= 0) and np.all(energy <= ALL_LIGHT) and energy.sum() <= ALL_LIGHT):
        raise InputError(f"{path}: expected annuli of reflectance >= 0 that add up to at most 1")


def merged(edges: Floats, photons: Floats) -> np.ndarray:
    """Return where the merged rings start (m,), from the innermost out; what is left at the end joins the last one."""
    starts, held, begin = [], 0.0, 0
    for at, one in enumerate(photons):
        held += one
        if held >= FEWEST_PHOTONS and edges[at + 1] - edges[begin] >= NARROWEST * edges[at + 1]:
            starts.append(begin)
            held, begin = 0.0, at + 1
    return np.array(starts, int)


SIMULATED = {".mco": read_mco_profile, ".npz": read_npz_profile}
