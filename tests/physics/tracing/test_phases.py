"""Photons that scatter by sums of terms and by tables."""

import numpy as np
import pytest

from mcml_sim import (
    Grid,
    InputError,
    Layer,
    Medium,
    Setting,
    StoreError,
    read_results,
    simulate,
    simulate_orders,
    write_mco,
    write_results,
)
from mcml_sim.media.phase import FournierForand, HenyeyGreenstein, Mixture, Tabulated
from mcml_sim.tracing import pool
from tests.fixtures import slow

ONE = HenyeyGreenstein(0.9)
GRID = Grid.from_edges(r=np.append(0.0, np.geomspace(0.1, 20, 12)))
SEA = Mixture((0.317, 0.6813, 0.0017), (HenyeyGreenstein(0.9933), HenyeyGreenstein(0.8957), HenyeyGreenstein(-0.635)))
ANGLES = np.radians(np.append(np.geomspace(0.05, 10, 60), np.linspace(12, 180, 80)))
TABLE = Tabulated(ANGLES, SEA.pdf(np.cos(ANGLES)))  # the same light, but for what goes on within 0.05 degrees
BY_PHASE = pytest.mark.parametrize(
    "phase", [SEA, *slow(TABLE, FournierForand(1.1, 3.6))], ids=["mixture", "table", "Forand"]
)
PHOTONS = pytest.mark.parametrize("photons", [2**14, *slow(2**17)])


@pytest.fixture(autouse=True)
def few_lanes(monkeypatch):
    """They change no bit; the last of few photons that scatter forwards for long leave most of many lanes idle."""
    monkeypatch.setattr(pool, "lanes", lambda: 1024)


def tally(phase, g=0.0, seed=1, photons=50_000, **given):
    layers = (Layer(1.2, 0.1, 1.0, 0.3, 2.0), Layer(1.2, 0.3, 1.0, g, phase=phase))
    return simulate(Medium(layers), GRID, photons, seed, **given)


@pytest.mark.slow
@PHOTONS
def test_an_empty_term_changes_no_bit(photons):
    mixed = Mixture((1, 0), (ONE, HenyeyGreenstein(0.1)))
    plain, same = tally(None, 0.9), tally(mixed)
    np.testing.assert_array_equal(plain.deposits.reflected, same.deposits.reflected)
    np.testing.assert_array_equal(plain.deposits.absorbed, same.deposits.absorbed)
    orders = [simulate_orders(GRID, photons, 3, Setting(n=1.2, phase=one)) for one in (ONE, mixed)]
    np.testing.assert_array_equal(orders[0].counts.exits, orders[1].counts.exits)


@pytest.mark.slow
def test_equal_terms_are_one():
    def reflected(phase, seed):
        layer = Layer(1.2, 0.1, 1.0, 0.0, phase=phase)
        return simulate(Medium((layer,)), GRID, 200_000, seed).diffuse_reflectance

    one, other = reflected(ONE, 1), reflected(Mixture((0.3, 0.7), (ONE, ONE)), 2)
    assert abs(one.value - other.value) < 3 * np.hypot(one.standard_error, other.standard_error)
    blunt = reflected(Mixture((0.3, 0.7), (HenyeyGreenstein(0.5), ONE)), 2)
    assert abs(one.value - blunt.value) > 5 * np.hypot(one.standard_error, blunt.standard_error)


@pytest.mark.parametrize(
    ("phase", "illumination"),
    [(SEA, "searchlight"), (SEA, "diffuse"), *slow((TABLE, "searchlight"), (FournierForand(1.1, 3.6), "searchlight"))],
    ids=["mixture", "mixture, diffuse", "table", "Forand"],
)
@PHOTONS
def test_light_scattered_once(phase, illumination, photons):
    """Photons of the first order against the closed single scattering of that phase function."""
    found = simulate_orders(GRID, photons, 4, Setting(illumination, n=1.2, phase=phase))
    seen = found.entered * found.counts.exits[:, 0] / found.photons
    error = found.entered * np.sqrt(found.counts.exits[:, 0] + 1) / found.photons
    assert np.all(np.abs(seen - found.once(1.0)) < 4.5 * error)
    total = found.once(1.0).sum()
    assert abs(seen.sum() - total) < 4 * np.sqrt(total * found.entered / found.photons)


@pytest.mark.slow
@BY_PHASE
@PHOTONS
def test_layers_and_orders_agree(phase, photons):
    """Two kernels that share nothing but the phase function: A and rings of one half space."""
    orders = simulate_orders(GRID, photons, 5, Setting(n=1.2, phase=phase))
    layer = Layer(1.2, 0.2, 0.8, 0.0, phase=phase)
    tally, own = simulate(Medium((layer,)), GRID, photons, 6), layer.alpha
    totals, rings = (orders.reflectance(own), tally.diffuse_reflectance), (orders.profile(own), tally.reflectance_r)
    for one, other in (totals, rings):
        error = np.hypot(one.standard_error, np.asarray(other.standard_error))
        assert np.all(np.abs(np.asarray(one.value) - other.value) < 4.5 * error)


@pytest.mark.slow
def test_a_table_and_the_terms_that_made_it():
    a, b = (tally(phase, seed=seed).diffuse_reflectance for phase, seed in ((SEA, 1), (TABLE, 2)))
    assert abs(a.value - b.value) < 4 * np.hypot(a.standard_error, b.standard_error)


@pytest.mark.slow
def test_results_keep_the_phase_function(tmp_path):
    found = tally(SEA, photons=1000)
    write_results(found, tmp_path / "sea.npz")
    assert read_results(tmp_path / "sea.npz").medium == found.medium
    with pytest.raises(InputError, match=r"an .mco has g alone for a phase function, got Mixture.* in layer 2"):
        write_mco(found, tmp_path / "sea.mco")
    assert not (tmp_path / "sea.mco").exists()


@pytest.mark.slow
def test_stores_of_different_phase_functions_do_not_mix(tmp_path):
    other = Tabulated(ANGLES, TABLE.pdf(np.cos(ANGLES)) * np.where(ANGLES > 1, 1.01, 1.0))
    tally(TABLE, photons=1000, store=tmp_path / "layers")
    with pytest.raises(StoreError, match="medium is"):
        tally(other, photons=1000, store=tmp_path / "layers")
    simulate_orders(GRID, 1000, 1, Setting(n=1.2, phase=TABLE), store=tmp_path / "orders")
    with pytest.raises(StoreError, match="setting is"):
        simulate_orders(GRID, 1000, 1, Setting(n=1.2, phase=other), store=tmp_path / "orders")
