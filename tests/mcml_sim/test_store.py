import json
import os
import time

import numpy as np
import pytest

from mcml_sim import Grid, StoreError, simulate_orders
from mcml_sim.store import STALE_AFTER, Store, cpu_class
from mcml_sim.tally import Counts

GRID = Grid(0.5, 3)
MADE_BY = {"seed": 1, "grid": "abc"}
COUNTS = Counts(np.array([[1, 0, 2], [0, 0, 3]]), 4, 5, 15)


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path, MADE_BY, (2, 3))


def test_batches_come_back_as_they_were(store):
    assert store.load(3) is None
    store.save(3, COUNTS)
    back = store.load(3)
    np.testing.assert_array_equal(back.exits, COUNTS.exits)
    assert back.ledger == COUNTS.ledger


def test_manifest_says_what_decides_the_bits(tmp_path):
    simulate_orders(GRID, 100, seed=4, store=tmp_path / "a" / "b")
    manifest = json.loads((tmp_path / "a" / "b" / "run.json").read_text())
    assert manifest["seed"] == 4
    assert manifest["setting"] == "searchlight, n = 1, g = 0"
    assert manifest["r_edges"] == [0, 0.5, 1, 1.5]
    assert manifest["cpu"] == cpu_class()
    assert manifest.keys() >= {
        "grid",
        "max_order",
        "order_bins_per_octave",
        "batch_photons",
        "mcml_sim",
        "jaxlib",
        "device",
    }


def test_another_runs_store_is_refused_with_both_values(tmp_path):
    simulate_orders(GRID, 100, seed=4, store=tmp_path)
    with pytest.raises(StoreError, match=r"made by another run: seed is 4 there, 5 here; use another folder"):
        simulate_orders(GRID, 100, seed=5, store=tmp_path)
    with pytest.raises(StoreError, match=r'made by another run: grid is "'):
        simulate_orders(Grid(0.4, 3), 100, seed=4, store=tmp_path)


def test_another_versions_store_is_refused(store, tmp_path):
    manifest = json.loads((tmp_path / "run.json").read_text())
    (tmp_path / "run.json").write_text(json.dumps(manifest | {"jaxlib": "0.0.1"}))
    with pytest.raises(StoreError, match=r'jaxlib is "0.0.1" there, "'):
        Store(tmp_path, MADE_BY, (2, 3))


def test_a_batch_from_another_store_is_refused(store, tmp_path):
    other = Store(tmp_path / "other", MADE_BY | {"seed": 2}, (2, 3))
    other.save(0, COUNTS)
    (tmp_path / "other" / "batch-000000.npz").rename(tmp_path / "batch-000000.npz")
    with pytest.raises(
        StoreError, match=r"batch-000000.npz was made by another run; delete it to redo just that batch"
    ):
        store.load(0)


def spoil(path, how):
    data = bytearray(path.read_bytes())
    if how == "cut short":
        del data[len(data) // 2 :]
    elif how == "emptied":
        data.clear()
    elif how == "bits flipped":
        for i in range(40, len(data) - 200, 7):
            data[i] ^= 0x55
    else:
        data[:] = b"not a batch"
    path.write_bytes(data)


@pytest.mark.parametrize("how", ["cut short", "emptied", "bits flipped", "overwritten"])
def test_a_damaged_batch_is_named_and_redone_once_deleted(tmp_path, how):
    good = simulate_orders(GRID, 100, store=tmp_path)
    batch = tmp_path / "batch-000000.npz"
    spoil(batch, how)
    with pytest.raises(StoreError, match=r"batch-000000.npz is damaged \(.*\); delete it to redo just that batch"):
        simulate_orders(GRID, 100, store=tmp_path)
    batch.unlink()
    np.testing.assert_array_equal(simulate_orders(GRID, 100, store=tmp_path).counts.exits, good.counts.exits)


def test_a_batch_whose_photons_do_not_add_up_is_damaged(store):
    store.save(0, Counts(COUNTS.exits, 4, 5, 16))
    with pytest.raises(StoreError, match="its photons do not add up"):
        store.load(0)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00"])
def test_a_damaged_manifest_is_named_and_rewritten_once_deleted(store, tmp_path, text):
    store.save(0, COUNTS)
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(StoreError, match=r"run.json is damaged \(.*\); delete it, the batches beside it stay valid"):
        Store(tmp_path, MADE_BY, (2, 3))
    (tmp_path / "run.json").unlink()
    assert Store(tmp_path, MADE_BY, (2, 3)).load(0).started == 15


def test_a_full_disk_is_named_and_leaves_nothing_half_written(store, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreError, match=r"cannot write to store .*: No space left on device"):
        store.save(0, COUNTS)
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


def test_a_full_device_is_named():
    with pytest.raises(StoreError, match=r"cannot use /dev/full/store as a store: Not a directory"):
        simulate_orders(GRID, 100, store="/dev/full/store")


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match=r"cannot use .*file as a store: File exists"):
        simulate_orders(GRID, 100, store=tmp_path / "file")


def test_leftovers_of_killed_runs_are_swept_when_old(tmp_path):
    old, new = tmp_path / "batch-000000.npz.1.part", tmp_path / "batch-000001.npz.2.part"
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (time.time() - 2 * STALE_AFTER,) * 2)
    Store(tmp_path, MADE_BY, (2, 3))
    assert not old.exists()
    assert new.exists()
