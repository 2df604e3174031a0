"""Diffuse light into layers: against order-resolved runs, adding-doubling and exact light; and its files."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from mcml_sim import (
    Grid,
    InputError,
    Layer,
    Medium,
    Setting,
    StoreError,
    exact,
    half_space,
    read_results,
    simulate,
    simulate_orders,
    write_mco,
    write_results,
)
from mcml_sim.exact.single_scattering import entered
from profilefit.measured import fit
from tests.fixtures import slow
from tests.physics.tracing import adding_doubling

EDGES = np.append(0.0, np.geomspace(0.02, 8.0, 24))
GRID = Grid.from_edges(r=EDGES)
CHANCE = 1e-3  # that a right answer fails
FORWARD = Medium((Layer(1.4, 0.2, 2.0, 0.7, 0.3), Layer(1.4, 0.1, 4.0, 0.2, 0.5)))
STACK = Medium((Layer(1.4, 0.1, 2.0, 0.0, 0.5), Layer(1.4, 0.5, 0.5, 0.0, 0.7)), n_below=1.2)
MATCHED = Medium((Layer(1.0, 0.1, 2.0, 0.0, 0.5), Layer(1.0, 0.5, 0.5, 0.0, 0.7)))
GLAZED = Medium((Layer(1.4, 0.0, 0.0, 0.0, 0.2), *STACK.layers))
UNDER_GLASS = replace(STACK, n_above=1.6)


def shone(medium, photons=2**18, seed=3, grid=GRID):
    return simulate(medium, grid, photons, seed=seed, illumination="diffuse", progress=False)


def agrees(estimate, known):
    return abs(estimate.value - known) < 4 * estimate.standard_error + 1e-12


def likelihood(tally, known):
    """Chi-square's, of the energies of rings."""
    rings = tally.reflectance_r.scaled(tally.grid.r_areas)
    within = known.cdf(tally.grid.r_edges) * known.reflectance
    wanted = np.diff(within)
    wanted[0] += within[0]
    return chi2.sf(np.sum(((rings.value - wanted) / rings.standard_error) ** 2), wanted.size)


@pytest.mark.slow
def test_giovanelli_at_n_1_5():
    tally = shone(half_space(0.9, n=1.5))
    assert agrees(tally.diffuse_reflectance, 0.2161120812)
    assert tally.specular_reflectance.value == pytest.approx(1 - entered(Setting("diffuse", n=1.5)), rel=1e-12)
    assert not agrees(simulate(half_space(0.9, n=1.5), GRID, 2**18, progress=False).diffuse_reflectance, 0.2161120812)


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_orders_agree(n):
    tally, where = shone(half_space(0.8, n=n), 2**19), Setting("diffuse", n=n)
    orders = simulate_orders(GRID, 2**19, seed=4, setting=where, progress=False).energy(0.8)
    beam = simulate(half_space(0.8, n=n), GRID, 2**19, seed=5, progress=False)
    for seen, is_likely in ((tally, True), (beam, False)):
        rings = seen.reflectance_r.scaled(GRID.r_areas)
        z = (rings.value - orders.value) / np.hypot(rings.standard_error, orders.standard_error)
        assert (chi2.sf(np.sum(z**2), z.size) > CHANCE) == is_likely


def test_adding_and_doubling_agrees():
    tally, twin = shone(FORWARD), adding_doubling.solve(FORWARD, diffuse=True)
    assert agrees(tally.diffuse_reflectance, twin.reflected.sum())
    assert agrees(tally.transmittance, twin.transmitted.sum())
    assert tally.specular_reflectance.value == pytest.approx(twin.specular, abs=1e-5)
    assert not agrees(tally.transmittance, adding_doubling.solve(FORWARD).transmitted.sum())
    # And it is exact light where scattering is isotropic.
    medium = replace(STACK, n_below=1.0)
    twin, found = adding_doubling.solve(medium, 9, 8, diffuse=True), exact.solve(medium, "diffuse")
    assert twin.reflected.sum() == pytest.approx(found.reflectance, rel=1e-6)
    assert twin.transmitted.sum() == pytest.approx(found.transmittance, rel=1e-6)
    assert twin.specular == pytest.approx(found.specular, rel=1e-6)


@pytest.mark.parametrize("medium", [MATCHED, *slow(STACK, GLAZED, UNDER_GLASS)])
def test_exact_light_agrees(medium):
    tally, found = shone(medium, 2**20), exact.solve(medium, "diffuse")
    assert agrees(tally.diffuse_reflectance, found.reflectance)
    assert agrees(tally.transmittance, found.transmittance)
    assert tally.specular_reflectance.value == pytest.approx(found.specular, rel=1e-9)
    assert likelihood(tally, found) > CHANCE
    assert likelihood(tally, exact.solve(medium)) < CHANCE


def test_unscattered_light_is_told_apart():
    """Straight through clear and absorbing layers nothing is diffuse; through one that scatters e^-T/mu is not."""
    clear = shone(Medium((Layer(1.5, 0.0, 0.0, 0.0, 1.0), Layer(1.5, 0.3, 0.0, 0.0, 1.0))), 2**14)
    found = exact.solve(clear.medium, "diffuse")
    assert agrees(clear.ballistic_transmittance, found.transmittance)
    assert agrees(clear.diffuse_reflectance, found.reflectance)
    assert clear.diffuse_transmittance.value == 0.0
    pane = shone(Medium((Layer(1.5, 0.0, 0.0, 0.0, 1.0),)), 2**14)
    assert pane.energy.value == pytest.approx(1, abs=1e-6)
    assert agrees(pane.ballistic_transmittance, exact.solve(pane.medium, "diffuse").transmittance)
    thin = shone(Medium((Layer(1.0, 0.0, 1.0, 0.0, 0.5),)), 2**18)
    mu, weight = np.polynomial.legendre.leggauss(60)
    mu = (1 + mu) / 2
    assert agrees(thin.ballistic_transmittance, np.sum(weight * mu * np.exp(-0.5 / mu)))


@pytest.mark.slow
def test_files_and_stores_keep_the_light(tmp_path):
    grid = Grid(0.1, 5, dz=0.1, nz=3)
    tally = shone(STACK, 2000, grid=grid)
    write_results(tally, tmp_path / "diffuse.npz")
    assert read_results(tmp_path / "diffuse.npz").illumination == "diffuse"
    beam = simulate(STACK, grid, 2000, progress=False)
    write_results(beam, tmp_path / "beam.npz")
    assert read_results(tmp_path / "beam.npz").illumination == "searchlight"
    assert "illumination" not in json.loads(str(np.load(tmp_path / "beam.npz")["header"]))
    with pytest.raises(InputError, match=r"an \.mco is of a searchlight, got a tally of diffuse light"):
        write_mco(tally, tmp_path / "diffuse.mco")
    assert not (tmp_path / "diffuse.mco").exists()

    kept, again = (
        simulate(STACK, grid, 2000, store=tmp_path / "store", illumination="diffuse", progress=False) for _ in range(2)
    )
    assert np.array_equal(kept.deposits.reflected, again.deposits.reflected)
    with pytest.raises(StoreError, match='kind is "simulate, diffuse light" there, "simulate" here'):
        simulate(STACK, grid, 2000, store=tmp_path / "store", progress=False)


def test_other_light_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="illumination must be one of searchlight, diffuse, got 'sun'"):
        simulate(STACK, GRID, 100, illumination="sun")
    write_results(shone(STACK, 100), tmp_path / "a.npz")
    arrays = dict(np.load(tmp_path / "a.npz"))
    arrays["header"] = np.array(str(arrays["header"]).replace('"diffuse"', '"sun"'))
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(InputError, match=r"b\.npz: .*illumination must be one of searchlight, diffuse, got 'sun'"):
        read_results(tmp_path / "b.npz")


@pytest.mark.slow
def test_a_fit_takes_the_light_that_was_simulated(tmp_path):
    grid = Grid.from_edges(r=np.append(0.0, np.geomspace(0.05, 6.0, 25)))
    tally = simulate(half_space(0.9), grid, 2**18, illumination="diffuse", progress=False)
    write_results(tally, tmp_path / "diffuse.npz")
    answer = fit(tmp_path / "diffuse.npz", walk=False)
    assert answer.fit.spec.law.setting == Setting("diffuse")
    with pytest.raises(InputError, match=r"diffuse\.npz: a simulation of diffuse light, got searchlight light to fit"):
        fit(tmp_path / "diffuse.npz", setting=Setting())
