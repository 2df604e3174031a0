"""Photons through a layered medium, of a normal pencil beam or of diffuse light."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import ModuleType

from mcml_sim.errors import InputError
from mcml_sim.media.checks import MAX_PHOTONS, checked_folder, checked_whole, checked_workers, require_own_process
from mcml_sim.media.grid import Grid, require_resolved
from mcml_sim.media.medium import Medium
from mcml_sim.media.setting import require_illumination
from mcml_sim.results.tally import Precision, Tally, require_quantity
from mcml_sim.runs.batches import run_batches
from mcml_sim.runs.store import Store, manifest, require_ours
from mcml_sim.tracing import deposits, layered_batch, matched_batch, pool
from mcml_sim.tracing.deposits import Deposits

BATCH_PHOTONS = {matched_batch: pool.BATCH_PHOTONS, layered_batch: layered_batch.BATCH_PHOTONS}


def simulate(
    medium: Medium,
    grid: Grid,
    photons: int,
    seed: int = 0,
    store: str | Path | None = None,
    workers: int | None = None,
    precision: float | Precision | None = None,
    progress: bool | None = None,
    scheduler: str | None = None,
    illumination: str = "searchlight",
) -> Tally:
    """Trace photons, by default of a normal pencil beam, through a layered medium (Wang, Jacques & Zheng 1995).

    Args:
        medium: layers; lengths in any unit.
        grid: bins in the same unit: rings, and if wanted depths (for absorption) and exit angles.
        photons: how many to start, 1 to 1e13; with `precision`, at most so many.
        seed: whole number >= 0; equal seeds start with equal photons, in a matched isotropic half space those of
            `simulate_orders` too, so give runs that are to be compared seeds of their own.
        store: folder that keeps each finished batch; a run that finds batches there resumes.
        workers: threads, by default one a core; the result does not depend on it.
        precision: where to stop early: a relative standard error of the diffuse reflectance, or a Precision that
            names another quantity. It is looked at after 8, 16, 32, ... batches only, since stopping at the first
            lucky look would make the error bars too small.
        progress: show a bar on stderr; by default only if that is a terminal.
        scheduler: address of a Dask scheduler whose workers trace the batches, instead of threads here.
        illumination: "searchlight", the pencil beam, or "diffuse", cosine-weighted light that arrives at r = 0.

    InputError on other arguments; StoreError if the folder is another run's or cannot be written. Ctrl-C stops after
    the batches in flight, which the store keeps too.
    """
    if not isinstance(medium, Medium):
        raise InputError(f"medium must be a mcml_sim.Medium, got {medium!r}")
    require_resolved(grid)
    require_illumination(illumination)
    require_own_process()
    number = checked_whole("photons", photons, lowest=1, highest=MAX_PHOTONS)
    key = checked_whole("seed", seed, lowest=0)
    threads, folder = checked_workers(workers, scheduler), checked_folder(store)
    kernel, made_by = _kernel(medium, illumination), _made_by(medium, grid, key, illumination)
    goal = precision if isinstance(precision, Precision | None) else Precision(precision)
    if goal is not None:
        require_quantity(goal.quantity, grid)

    def is_enough(sums: Deposits) -> bool:
        tally = Tally(medium, grid, sums.started, key, sums, illumination)
        return goal is not None and goal.is_reached(tally.quantity(goal.quantity))

    # The kernel of a matched half space traces beams only, and takes no light.
    light = {} if illumination == "searchlight" else {"illumination": illumination}
    read = partial(Deposits.from_arrays, shapes=deposits.shapes(grid, len(medium.layers)))
    sums = run_batches(
        partial(kernel.trace_batch, medium, grid, key, **light),
        BATCH_PHOTONS[kernel],
        number,
        workers=threads,
        store=None if folder is None else Store(folder, made_by, read),
        progress=progress,
        scheduler=scheduler,
        enough=None if goal is None else is_enough,
    )
    return Tally(medium, grid, sums.started, key, sums, illumination)


def batch_photons(medium: Medium) -> int:
    """Return how many photons a batch of `simulate` has in this medium."""
    return BATCH_PHOTONS[_kernel(medium, "searchlight")]


def require_store(folder: Path, medium: Medium, grid: Grid, seed: int) -> None:
    """Raise StoreError if what is in that folder keeps `simulate` from storing batches there; nothing is written."""
    require_ours(folder, _made_by(medium, grid, seed, "searchlight"))


def is_store_of(folder: Path, medium: Medium, grid: Grid, seed: int) -> bool:
    """Return whether the batches in that folder are of such a run, by whatever version and on whatever machine."""
    return _made_by(medium, grid, seed, "searchlight").items() <= (manifest(folder) or {}).items()


def _kernel(medium: Medium, illumination: str) -> ModuleType:
    is_matched = medium.is_matched_isotropic_half_space and illumination == "searchlight"
    return matched_batch if is_matched else layered_batch


def _made_by(medium: Medium, grid: Grid, seed: int, illumination: str) -> dict[str, object]:
    """Return what decides which photons a batch holds and how they are counted."""
    return {
        "kind": "simulate" if illumination == "searchlight" else f"simulate, {illumination} light",
        "medium": repr(medium),
        "seed": seed,
        "grid": grid.digest,
        "batch_photons": BATCH_PHOTONS[_kernel(medium, illumination)],
    }
