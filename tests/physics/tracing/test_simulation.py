"""What `simulate` says of a layered medium: sums, units, errors, and when it stops."""

import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, Precision, StoreError, exact, half_space, simulate
from mcml_sim.runs import simulation
from mcml_sim.tracing import layered_batch, matched_batch
from mcml_sim.tracing.deposits import Deposits
from tests.fixtures import refused, slow

pytestmark = pytest.mark.slow

SLAB = Medium((Layer(1.4, 0.5, 9.5, 0.6, 0.1), Layer(1.2, 2.0, 8.0, 0.2, 0.2)), n_above=1.0, n_below=1.1)
GRID = Grid(0.05, 20, 0.029, 10, na=6)
PHOTONS = 40_000


@pytest.fixture(scope="module")
def tally():
    return simulate(SLAB, GRID, PHOTONS, seed=5)


def test_everything_is_an_estimate_of_its_bins_shape(tally):
    exits = {"r": (20,), "a": (6,), "ra": (20, 6)}
    shapes = {f"{side}_{end}": size for side in ("reflectance", "transmittance") for end, size in exits.items()}
    shapes |= {"absorbed_z": (10,), "absorbed_rz": (20, 10), "absorbed_per_layer": (2,)}
    for name in tally.quantities:
        found = tally.quantity(name)
        assert np.shape(found.value) == np.shape(found.standard_error) == shapes.get(name, ()), name
        assert np.all(np.asarray(found.value) >= 0), name
        assert np.all(np.isfinite(found.standard_error)), name
        if name not in shapes:
            assert isinstance(found.value, float), name
    alone = simulate(SLAB, GRID, 1)  # which says nothing of its error
    for name in set(alone.quantities) - {"specular_reflectance"}:
        assert np.all(np.isinf(alone.quantity(name).standard_error)), name


def test_light_that_entered_left_or_stayed(tally):
    parts = (tally.specular_reflectance, tally.diffuse_reflectance, tally.absorbed, tally.transmittance)
    assert sum(map(float, parts)) + tally.cut == pytest.approx(float(tally.energy), rel=1e-7)
    assert abs(float(tally.energy) - 1) < 4 * tally.energy.standard_error
    assert 0 < tally.energy.standard_error < 1e-2
    layers = tally.absorbed_per_layer
    assert layers.value.sum() == pytest.approx(float(tally.absorbed), rel=1e-6)
    both = float(tally.diffuse_transmittance) + float(tally.ballistic_transmittance)
    assert both == pytest.approx(float(tally.transmittance), rel=1e-12)


def test_bins_hold_densities_that_add_up(tally):
    areas, angles, widths = GRID.r_areas, GRID.solid_angles, GRID.z_widths
    for name in ("reflectance", "transmittance"):
        total = float(tally.quantity(f"diffuse_{name}"))
        by_r, by_a, by_ra = (tally.quantity(f"{name}_{axis}").value for axis in ("r", "a", "ra"))
        overflow = float(tally.quantity(f"{name}_r_overflow"))
        assert by_r @ areas + overflow == pytest.approx(total, rel=1e-12)
        assert by_a @ angles == pytest.approx(total, rel=1e-12)
        np.testing.assert_allclose(by_ra @ angles, by_r, rtol=1e-12)
    absorbed = tally.absorbed_z.value @ widths + float(tally.absorbed_z_overflow)
    assert absorbed == pytest.approx(float(tally.absorbed), rel=1e-6)
    inside = (tally.absorbed_rz.value * areas[:, None] * widths).sum(axis=0)
    assert np.all(inside <= tally.absorbed_z.value * widths * (1 + 1e-12))
    assert inside.sum() > 0.9 * float(tally.absorbed)


def test_the_surface_takes_its_share_first_and_ballistic_light_is_beers_law(tally):
    assert float(tally.specular_reflectance) == pytest.approx((0.4 / 2.4) ** 2)
    assert tally.specular_reflectance.standard_error == 0
    assert float(simulate(half_space(0.5), GRID, 100).specular_reflectance) == 0
    surfaces = [((a - b) / (a + b)) ** 2 for a, b in ((1.0, 1.4), (1.4, 1.2), (1.2, 1.1))]
    straight = np.prod([1 - r for r in surfaces]) * np.exp(-3.0)
    # What goes to and fro inside adds a share of e^-2 times two reflectances of one percent at most.
    found = tally.ballistic_transmittance
    assert abs(float(found) - straight) < 4 * found.standard_error + 2e-5


def test_length_units_do_not_matter():
    """Millimetres for centimetres and other photons: each density changes by its own power of ten."""
    in_mm = Medium(tuple(Layer(y.n, y.mu_a / 10, y.mu_s / 10, y.g, y.thickness * 10) for y in SLAB.layers), n_below=1.1)
    cm, mm = simulate(SLAB, GRID, PHOTONS, seed=1), simulate(in_mm, Grid(0.5, 20, 0.29, 10, na=6), PHOTONS, seed=2)
    powers = {"absorbed": 0, "reflectance_r": 2, "reflectance_ra": 2, "reflectance_a": 0, "absorbed_z": 1}
    for name, power in {**powers, "absorbed_rz": 3}.items():
        a, b = cm.quantity(name), mm.quantity(name).scaled(10.0**power)
        seen = np.asarray(a.is_sampled(200))
        z = (np.asarray(a.value) - b.value) / np.hypot(a.standard_error, b.standard_error)
        assert seen.any(), name
        # 32 groups give the errors of absorption: Student's t of 62 degrees of freedom in up to 100 bins.
        assert np.abs(z[seen]).max() < 4.6, name


@pytest.mark.parametrize("illumination", ["searchlight", *slow("diffuse")])
def test_workers_and_interruptions_change_no_bit(tmp_path, monkeypatch, illumination):
    monkeypatch.setitem(simulation.BATCH_PHOTONS, layered_batch, 4000)
    store = {"seed": 3, "store": tmp_path / "photons", "illumination": illumination}
    alone = simulate(SLAB, GRID, 22_000, seed=3, workers=1, illumination=illumination)
    simulate(SLAB, GRID, 9000, workers=1, **store)
    resumed = simulate(SLAB, GRID, 22_000, workers=2, **store)
    for name, values in alone.deposits.arrays().items():
        np.testing.assert_array_equal(values, resumed.deposits.arrays()[name], err_msg=name)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"medium": half_space(0.5, g=0.1)}, "medium"),
        ({"grid": Grid(0.05, 20, 0.02, 10, na=7)}, "grid"),
        ({"seed": 4}, "seed"),
    ],
)
def test_a_store_belongs_to_its_run(tmp_path, change, what):
    run = {"medium": half_space(0.5, g=0.2), "grid": GRID, "photons": 1000, "seed": 3, "store": tmp_path}
    simulate(**run)
    refused(f"{what} is", simulate, **{**run, **change}, error=StoreError)


def test_precision_stops_at_the_first_look_that_reaches_it(monkeypatch):
    monkeypatch.setitem(simulation.BATCH_PHOTONS, matched_batch, 1000)
    medium = half_space(0.9)
    alpha_9 = 1 / np.sqrt(8000) * 1.2  # about what 8 batches give
    found = simulate(medium, Grid(0.1, 10), 10**6, precision=alpha_9)
    assert found.photons == 8000
    tighter = simulate(medium, Grid(0.1, 10), 10**6, precision=Precision(alpha_9 / 3, "absorbed"))
    assert tighter.photons in {1000 * 2**k for k in range(3, 10)}
    assert tighter.absorbed.standard_error <= alpha_9 / 3 * tighter.absorbed.value
    all_of_them = simulate(medium, Grid(0.1, 10), 20_000, precision=1e-6)
    assert all_of_them.photons == 20_000
    # In bins it waits for the last of them; light that nobody saw is not known precisely.
    never = simulate(half_space(0.5), Grid(1.0, 60), 17_000, precision=Precision(0.5, "reflectance_r"))
    assert never.photons == 17_000
    assert not Precision(0.1, "transmittance").is_reached(simulate(half_space(0.5), GRID, 100).transmittance)


def test_stopping_early_leaves_the_errors_honest(monkeypatch):
    """30 runs, each of which stops by its own error at 800 to 1600 photons: z of their means against the exact one."""
    monkeypatch.setitem(simulation.BATCH_PHOTONS, matched_batch, 100)
    runs = [simulate(half_space(0.8), Grid(1.0, 2), 6400, seed=s, precision=0.04, workers=1) for s in range(30)]
    z = [(float(t.diffuse_reflectance) - exact.reflectance(0.8)) / t.diffuse_reflectance.standard_error for t in runs]
    assert {t.photons for t in runs} == {800, 1600}
    # chi2 of 30 degrees of freedom, between its 5e-4 quantiles; the mean within 4 of its errors.
    assert 10.4 < np.square(z).sum() < 62.2
    assert abs(np.mean(z)) < 4 / np.sqrt(30)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"medium": "glass"}, "medium must be a mcml_sim.Medium, got 'glass'"),
        ({"grid": 3}, "grid must be a mcml_sim.Grid, got 3"),
        ({"photons": 0}, "photons must be a whole number >= 1"),
        ({"seed": -1}, "seed must be a whole number >= 0, got -1"),
        ({"workers": 0}, "workers must be"),
        ({"store": 5}, "store must be the path of a folder, got 5"),
        ({"precision": 0.0}, r"precision must be a relative standard error in \(0, 1\), got 0.0"),
        ({"precision": "high"}, "precision must be"),
        ({"precision": Precision(0.1, "colour")}, "quantity must be one of .*, got 'colour'"),
        ({"precision": Precision(0.1, "absorbed_z"), "grid": Grid(0.1, 3)}, "quantity must be one of"),
    ],
)
def test_bad_input_is_named(change, message):
    refused(message, simulate, **{"medium": SLAB, "grid": GRID, "photons": 100, **change})


@pytest.mark.parametrize(
    "name", ["absorbed_z", "absorbed_rz", "reflectance_a", "transmittance_ra", "absorbed_z_overflow"]
)
def test_what_the_grid_does_not_resolve_is_refused(name):
    tally = simulate(SLAB, Grid(0.1, 5), 100)
    refused("this grid resolves no", getattr, tally, name)
    refused("quantity must be one of", tally.quantity, name)


def test_deposits_must_be_whole():
    with pytest.raises(ValueError, match="reflected is missing"):
        Deposits.from_arrays({}, {"reflected": (3, 1)})
    with pytest.raises(ValueError, match="shape"):
        Deposits.from_arrays({"reflected": np.zeros(2)}, {"reflected": (3, 1)})
