"""Runs: photons through layers, or through a half space, resolved by scattering order; whole, or in shares."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from types import ModuleType

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import MAX_PHOTONS, checked_folder, checked_whole, checked_workers, require_own_process
from mcml_sim.media.grid import Grid, require_resolved
from mcml_sim.media.medium import Medium
from mcml_sim.media.setting import SEARCHLIGHT, Setting, require_illumination
from mcml_sim.results.orders import Orders
from mcml_sim.results.tally import Precision, Tally, require_quantity
from mcml_sim.runs.batches import run_batches
from mcml_sim.runs.store import Store, manifest, require_ours
from mcml_sim.tracing import deposits, layered_batch, matched_batch, order_bins, orders_batch, pool

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

    InputError on other arguments; StoreError if the folder is another run's or cannot be written; a damaged batch is
    named in a warning and traced again. Ctrl-C stops after the batches in flight, which the store keeps too.
    """
    if not isinstance(medium, Medium):
        raise InputError(f"medium must be a mcml_sim.Medium, got {medium!r}")
    require_resolved(grid)
    require_illumination(illumination)
    number, key = _checked_run(grid, photons, seed)
    threads, folder = checked_workers(workers, scheduler), checked_folder(store)
    kernel, made_by = _kernel(medium, illumination), _made_by(medium, grid, key, illumination)
    goal = precision if isinstance(precision, Precision | None) else Precision(precision)
    if goal is not None:
        require_quantity(goal.quantity, grid)

    def is_enough(sums: deposits.Deposits) -> bool:
        tally = Tally(medium, grid, sums.started, key, sums, illumination)
        return goal is not None and goal.is_reached(tally.quantity(goal.quantity))

    # The kernel of a matched half space traces beams only, and takes no light.
    light = {} if illumination == "searchlight" else {"illumination": illumination}
    read = partial(deposits.Deposits.from_arrays, shapes=deposits.shapes(grid, len(medium.layers)))
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


def simulate_orders(
    grid: Grid,
    photons: int,
    seed: int = 0,
    setting: Setting = SEARCHLIGHT,
    store: str | Path | None = None,
    workers: int | None = None,
    progress: bool | None = None,
    scheduler: str | None = None,
) -> Orders:
    """Simulate a conservative half space (alpha = 1), resolved by scattering order.

    Args:
        grid: rings, edges in units of 1 / (mu_s + mu_a).
        photons: how many to start, 1 to 1e13.
        seed: whole number >= 0; equal seeds start with equal photons.
        setting: the light and the surface; Setting() and its diffuse twin are the fastest.
        store: folder that keeps each finished batch of 2^20 photons; a run that finds batches there resumes.
        workers: threads, by default one a core; the result does not depend on it.
        progress: show a bar on stderr; by default only if that is a terminal.
        scheduler: address of a Dask scheduler whose workers trace the batches, instead of threads here.

    Errors and Ctrl-C are as for `simulate`.
    """
    number, key = _checked_run(grid, photons, seed, setting)
    threads, folder = checked_workers(workers, scheduler), checked_folder(store)
    kept = None if folder is None else _store(folder, grid, key, setting)
    counts = run_batches(
        partial(orders_batch.trace_batch, grid, key, setting=setting),
        orders_batch.BATCH_PHOTONS,
        number,
        workers=threads,
        store=kept,
        progress=progress,
        scheduler=scheduler,
    )
    return Orders(grid, number, key, setting, counts)


def trace_share(
    share: int,
    shares: int,
    grid: Grid,
    photons: int,
    seed: int = 0,
    setting: Setting = SEARCHLIGHT,
    *,
    store: str | Path,
) -> int:
    """Trace the batches share, share + shares, share + 2 shares, ... of `simulate_orders` into its store, on one core.

    For jobs that share a folder but no network: when each of them has traced its share, `simulate_orders` with the same
    arguments and that `store` reads all batches and traces none. Returns the number of batches that had to be traced.

    `share` is one of 0 ... shares - 1; the other arguments are as for `simulate_orders`. InputError and
    StoreError as there; what is finished stays, and the same call goes on from it.
    """
    number, key = _checked_run(grid, photons, seed, setting)
    parts = checked_whole("shares", shares, lowest=1)
    first = checked_whole("share", share, lowest=0, highest=parts - 1)
    if (folder := checked_folder(store)) is None:
        raise InputError("store must be the path of a folder, got None")
    kept, traced = _store(folder, grid, key, setting), 0
    for batch in range(first, -(-number // orders_batch.BATCH_PHOTONS), parts):
        size = min(orders_batch.BATCH_PHOTONS, number - batch * orders_batch.BATCH_PHOTONS)
        stored = kept.load(batch)
        if stored is None or stored.started < size:
            kept.save(batch, orders_batch.trace_batch(grid, key, batch, size, setting=setting))
            traced += 1
    return traced


def _checked_run(grid: Grid, photons: int, seed: int, setting: Setting = SEARCHLIGHT) -> tuple[int, int]:
    """Return the number of photons and the seed; InputError if the run cannot be done."""
    require_own_process()
    if not isinstance(setting, Setting):
        raise InputError(f"setting must be a mcml_sim.Setting, got {setting!r}")
    require_resolved(grid)
    return checked_whole("photons", photons, lowest=1, highest=MAX_PHOTONS), checked_whole("seed", seed, lowest=0)


def _store(folder: Path, grid: Grid, seed: int, setting: Setting) -> Store[order_bins.Counts]:
    bins = order_bins.bins_of(setting)
    made_by: dict[str, object] = {
        "kind": "orders",
        "setting": str(setting),
        "seed": seed,
        "grid": grid.digest,
        "r_edges": grid.r_edges.tolist(),
        "batch_photons": orders_batch.BATCH_PHOTONS,
        "max_order": bins.max_order,
        "first_roulette": bins.first_roulette,
        "last_exact_order": order_bins.LAST_EXACT,
        "order_bins_per_octave": order_bins.BINS_PER_OCTAVE,
    }
    shape = grid.rings + 1, bins.last_orders.size
    return Store(folder, made_by, partial(order_bins.Counts.from_arrays, shape=shape))
