"""The folder of batches: what it keeps, refuses and finds damaged."""

import hashlib
import io
import json
import os
import time
from functools import partial

import numpy as np
import pytest

from mcml_sim import Grid, StoreError, simulate_orders
from mcml_sim.runs.batches import run_batches
from mcml_sim.runs.store import STALE_AFTER, DamagedBatch, Store, cpu_class, require_ours
from mcml_sim.tracing.deposits import Deposits, shapes
from mcml_sim.tracing.order_bins import Counts
from tests.fixtures import refused

GRID = Grid(0.5, 3)
MADE_BY = {"seed": 1, "grid": "abc"}
COUNTS = Counts(np.array([[1, 0, 2], [0, 0, 3]]), 4, 5, 15)
READ = partial(Counts.from_arrays, shape=(2, 3))


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path, MADE_BY, READ)


def test_batches_come_back_as_they_were(store, tmp_path):
    """Their names sort as numbers up to the largest run."""
    assert store.load(3) is None
    store.save(3, COUNTS)
    back = store.load(3)
    np.testing.assert_array_equal(back.exits, COUNTS.exits)
    assert back.ledger == COUNTS.ledger
    numbers = [0, 3, 9, 10, 999_999, 1_000_000, 10**13 // 2**17]
    for number in numbers:
        store.save(number, COUNTS)
    names = sorted(path.name for path in tmp_path.glob("batch-*.npz"))
    assert [int(name[len("batch-") : -len(".npz")]) for name in names] == numbers
    assert all(store.load(number).started == 15 for number in numbers)


def test_float_sums_come_back_bit_by_bit(tmp_path):
    rng = np.random.default_rng(1)
    by_name = shapes(Grid(0.1, 5, 0.1, 4, na=3), layers=2)
    sums = Deposits(**{name: rng.normal(size=shape) for name, shape in by_name.items() if name != "started"}, started=7)
    store = Store(tmp_path, MADE_BY, partial(Deposits.from_arrays, shapes=by_name))
    store.save(0, sums)
    back = store.load(0)
    assert back.started == 7
    for name, array in sums.arrays().items():
        np.testing.assert_array_equal(back.arrays()[name], array, strict=True)


def test_manifest_says_what_decides_the_bits(tmp_path):
    simulate_orders(GRID, 100, seed=4, store=tmp_path / "a" / "b")
    manifest = json.loads((tmp_path / "a" / "b" / "run.json").read_text())
    assert (manifest["seed"], manifest["setting"]) == (4, "searchlight, n = 1, g = 0")
    assert (manifest["r_edges"], manifest["cpu"]) == ([0, 0.5, 1, 1.5], cpu_class())
    decisive = {"grid", "max_order", "order_bins_per_octave", "batch_photons", "mcml_sim", "jaxlib", "device"}
    assert manifest.keys() >= decisive


def test_another_runs_store_is_refused_with_both_values(tmp_path):
    simulate_orders(GRID, 100, seed=4, store=tmp_path)
    remedy = "use another folder, or delete it if that run is over"
    with pytest.raises(StoreError, match=rf"made by another run: seed is 4 there, 5 here; {remedy}$"):
        simulate_orders(GRID, 100, seed=5, store=tmp_path)
    with pytest.raises(StoreError, match=r'made by another run: grid is "'):
        simulate_orders(Grid(0.4, 3), 100, seed=4, store=tmp_path)
    with pytest.raises(StoreError, match='kind is "orders" there, "simulate" here'):  # first, whatever else differs
        Store(tmp_path, {"kind": "simulate", "b": 2}, READ)


def test_long_values_are_shown_from_where_they_differ(tmp_path):
    one, other = ("layer " * 40 + thickness + " and so on" * 10 for thickness in ("0.25 cm", "0.5 cm"))
    Store(tmp_path, {"medium": one}, READ).save(0, COUNTS)
    differ = r"medium is \.\.\.yer layer 0\.25 cm and .*\.\.\. there, \.\.\..*layer 0\.5 cm"
    said = refused(differ, Store, tmp_path, {"medium": other}, READ, error=StoreError)
    assert len(said) < len(str(tmp_path)) + 250


@pytest.mark.parametrize("text", [json.dumps({"seed": 2}), "{", ""])
def test_a_run_that_ended_before_its_first_batch_blocks_no_other(tmp_path, text):
    """Killed while it was compiled, say, or without a cluster."""
    (tmp_path / "run.json").write_text(text)
    Store(tmp_path, MADE_BY, READ).save(0, COUNTS)
    assert json.loads((tmp_path / "run.json").read_text()).items() >= MADE_BY.items()
    assert Store(tmp_path, MADE_BY, READ).load(0).started == 15
    refused("seed is 1 there, 2 here", Store, tmp_path, {"seed": 2, "grid": "abc"}, READ, error=StoreError)


def test_looking_at_a_store_writes_nothing_and_another_versions_is_refused(store, tmp_path):
    store.save(0, COUNTS)
    require_ours(tmp_path / "none", MADE_BY)
    require_ours(tmp_path, MADE_BY)
    refused("seed is 1 there, 3 here", require_ours, tmp_path, MADE_BY | {"seed": 3}, error=StoreError)
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=r"cannot use .*file as a store: it is there already, and no folder"):
        require_ours(tmp_path / "file", MADE_BY)
    assert {path.name for path in tmp_path.iterdir()} == {"run.json", "batch-00000000.npz", "file"}
    manifest = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(manifest | {"jaxlib": "0.0.1"}))
    refused(r'jaxlib is "0.0.1" there, "', Store, tmp_path, MADE_BY, READ, error=StoreError)


def test_a_batch_from_another_store_is_refused(store, tmp_path):
    Store(tmp_path / "other", MADE_BY | {"seed": 2}, READ).save(0, COUNTS)
    (tmp_path / "other" / "batch-00000000.npz").rename(tmp_path / "batch-00000000.npz")
    remedy = "if that is still at work, use another folder; if not, delete that file to redo just that batch"
    refused(rf"batch-00000000.npz was made by another run; {remedy}", store.load, 0, error=StoreError)


@pytest.mark.parametrize(
    "spoiled",
    [lambda data: data[: len(data) // 2], lambda data: b"", lambda data: data + b"\0", lambda data: b"not a batch"],
    ids=["cut short", "emptied", "lengthened", "overwritten"],
)
def test_a_damaged_batch_is_named_and_just_that_one_is_redone(store, tmp_path, spoiled):
    traced = []

    def trace(batch, photons):
        traced.append(batch)
        return Counts(COUNTS.exits, batch, photons - batch - 6, photons)

    good = run_batches(trace, 15, 40, store=store)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    path = tmp_path / "batch-00000001.npz"
    path.write_bytes(spoiled(path.read_bytes()))
    traced.clear()
    with pytest.warns(DamagedBatch, match=r"batch-00000001.npz is damaged \(.*\); just that batch is traced again"):
        again = run_batches(trace, 15, 40, store=store)
    assert again.ledger == good.ledger
    assert traced == [1]
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_any_flipped_bit_is_noticed(store, tmp_path):
    """Also where a zip file's own checks are blind: in its dates, names and directory."""
    store.save(0, COUNTS)
    path = tmp_path / "batch-00000000.npz"
    whole = path.read_bytes()
    bits = np.random.default_rng(3).choice(8 * len(whole), size=500, replace=False)
    for bit in map(int, bits):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        with pytest.warns(DamagedBatch, match="its bytes are not those that were written"):
            assert store.load(0) is None
    path.write_bytes(whole)
    assert store.load(0).started == 15, "else anything would be noticed"


def test_a_batch_whose_photons_do_not_add_up_or_that_cannot_be_read_is_damaged(store, tmp_path):
    store.save(0, Counts(COUNTS.exits, 4, 5, 16))
    with pytest.warns(DamagedBatch, match="its photons do not add up"):
        assert store.load(0) is None
    (tmp_path / "batch-00000001.npz").mkdir()
    with pytest.warns(DamagedBatch, match=r"batch-00000001.npz is damaged \(Is a directory\)"):
        assert store.load(1) is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"cells": np.array([6, 1])},
        {"cells": np.array([0, 2, -1])},
        {"cells": np.array([0.0, 2.0, 5.0])},
        {"rest": np.array([1, 2])},
        {"rest": np.array([4, 5, np.inf])},
        {"rest": np.array([-1, 10, 15])},
        {"exits": np.array([1, 2])},
        {"exits": np.array([1, np.nan, 2])},
    ],
)
def test_arrays_that_are_no_counts_are_refused(wrong):
    with pytest.raises(ValueError, match=r"."):
        READ({**COUNTS.arrays(), **wrong})
    refused("these are no counts", READ, {}, error=ValueError)
    assert READ(COUNTS.arrays()).ledger == COUNTS.ledger


def test_a_seal_is_no_proof(store, tmp_path, monkeypatch):
    """Anybody can seal a batch: what it claims is checked, and one that claims too much is not unpacked."""
    monkeypatch.setattr("mcml_sim.runs.store.MAX_BATCH", 2**20)
    store.save(0, COUNTS)
    with np.load(tmp_path / "batch-00000000.npz") as whole:
        fields = {**whole, "exits": np.zeros(2**26, np.int8)}
    file = io.BytesIO()
    np.savez_compressed(file, **fields)
    body = file.getvalue()[:-2] + (64).to_bytes(2, "little")
    (tmp_path / "batch-00000000.npz").write_bytes(body + hashlib.sha256(body).hexdigest().encode())
    claim = r"is damaged \(its arrays claim 6710\d+ bytes, more than the 1048576 that are read"
    with pytest.warns(DamagedBatch, match=claim):
        assert store.load(0) is None


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00", "[" * 10**5, '{"seed": 1, "seed": 2}'])
def test_a_damaged_manifest_is_named_and_rewritten_once_deleted(store, tmp_path, text):
    store.save(0, COUNTS)
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(StoreError, match=r"run.json is damaged \(.*\); delete it, the batches beside it stay valid"):
        Store(tmp_path, MADE_BY, READ)
    (tmp_path / "run.json").unlink()
    assert Store(tmp_path, MADE_BY, READ).load(0).started == 15


def test_what_is_no_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    reasons = {"/dev/full/store": "Not a directory", str(tmp_path / "file"): "File exists"}
    for place, reason in reasons.items():
        refused(rf"cannot use {place} as a store: {reason}", simulate_orders, GRID, 100, store=place, error=StoreError)


def test_leftovers_of_killed_runs_are_swept_when_old(tmp_path):
    old, new = tmp_path / "batch-00000000.npz.1.part", tmp_path / "batch-00000001.npz.2.part"
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (time.time() - 2 * STALE_AFTER,) * 2)
    Store(tmp_path, MADE_BY, READ)
    assert not old.exists()
    assert new.exists()
