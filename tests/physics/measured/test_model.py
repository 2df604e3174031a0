"""The model against the law itself, its derivatives against differences, and rings against a quadrature."""

import jax
import numpy as np
import pytest

from mcml_sim import Setting
from profilefit.errors import InputError
from profilefit.measured import model
from profilefit.measured.model import BLOCK, Model, alpha_of, exact_light, u_of
from profilefit.measured.problem import held_albedo
from profilefit.recipes import catalogue

LAW = catalogue.load("hazard")
POINT = np.array([u_of(0.9), np.log(1.3), np.log(0.7)])
R = np.geomspace(0.05, 9.0, BLOCK + 3)  # more than one block


def test_points_are_the_laws_own():
    light, _ = Model(LAW).linearised(POINT, R, R)
    np.testing.assert_allclose(light[:-1], 0.7 * LAW.profile(R, 0.9, 1.3), rtol=1e-12)
    assert light[-1] == pytest.approx(LAW.albedo.reflectance(0.9), rel=1e-14)


def test_derivatives_and_flocks_agree_with_single_evaluations():
    model, step = Model(LAW), 1e-5
    light, slopes = model.linearised(POINT, R, R)
    ways = np.concatenate([POINT + step * np.eye(3), POINT - step * np.eye(3)])
    moved = model.predicted(ways, R, R)
    # Central differences: their own error is step^2 times a third derivative, and rounding over the step.
    np.testing.assert_allclose((moved[:3] - moved[3:]).T / (2 * step), slopes, rtol=1e-7, atol=1e-9 * light.max())
    many = np.repeat(POINT[None], 70, axis=0)
    np.testing.assert_allclose(model.predicted(many, R, R), np.repeat(light[None], 70, axis=0), rtol=1e-12)


def test_rings_are_averages():
    inner, outer = np.array([0.0, 0.5, 3.0]), np.array([0.3, 0.6, 5.0])
    found = Model(LAW).predicted(POINT[None], inner, outer)[0, :-1]
    nodes, weights = np.polynomial.legendre.leggauss(200)
    r = 0.5 * (outer + inner)[:, None] + 0.5 * (outer - inner)[:, None] * nodes
    integral = np.sum(2 * np.pi * r * 0.7 * LAW.profile(r, 0.9, 1.3) * weights, axis=1) * 0.5 * (outer - inner)
    np.testing.assert_allclose(found, integral / (np.pi * (outer**2 - inner**2)), rtol=1e-5)  # r ln r at the source


@pytest.mark.parametrize("alpha", [1e-6, 0.3, 0.9, 1 - 1e-9])
def test_alpha_keeps_its_digits(alpha):
    assert alpha_of(u_of(alpha)) == pytest.approx(alpha, rel=1e-12)
    s = 1.0 / (1.0 + np.exp(-u_of(alpha)))
    assert s == pytest.approx(np.sqrt(1 - alpha), rel=1e-9)


def test_quantities_and_their_slopes():
    found = model.quantities(POINT[None], np.array([0.4]))
    assert {name: float(value[0]) for name, value in found.items()} == pytest.approx(
        {"A": 0.4, "alpha": 0.9, "l": 1.3, "mu_s'": 0.9 / 1.3, "mu_a": 0.1 / 1.3, "scale": 0.7}
    )
    step, slopes = 1e-6, model.slopes(POINT, np.zeros(3))
    for at in range(3):
        ends = np.stack([POINT + step * np.eye(3)[at], POINT - step * np.eye(3)[at]])
        two = model.quantities(ends, np.zeros(2))
        for name in ("alpha", "l", "mu_s'", "mu_a", "scale"):
            assert (two[name][0] - two[name][1]) / (2 * step) == pytest.approx(slopes[name][at], abs=1e-8)
    names = ("alpha", "mu_a")
    np.testing.assert_allclose(model.correlation(slopes, np.diag([1.0, 0, 0]), names), [[1, -1], [-1, 1]])
    assert model.unit_of("mu_a", "mm") == "1/mm"
    assert model.unit_of("l", "") == "unit of r"


def test_a_held_reflectance_is_an_albedo():
    assert held_albedo(LAW, "A", LAW.albedo.reflectance(0.8)) == pytest.approx(0.8, abs=1e-10)
    refracting = catalogue.load("hazard", setting=Setting(n=1.4))
    with pytest.raises(InputError, match=r"^held A must be a total reflectance in \[.*, 0.97\d+\] of this light"):
        held_albedo(refracting, "A", 0.99)
    with pytest.raises(InputError, match=r"^held alpha must be a single-scattering albedo in \(0, 1\), got 1"):
        held_albedo(LAW, "alpha", 1.0)


def test_exact_light_is_kept_for_the_next_process(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    exact_light.cache_clear()
    first = exact_light(Setting())
    (path,) = tmp_path.rglob("light-searchlight-n1.0-*.npz")
    written = path.stat().st_mtime_ns
    exact_light.cache_clear()
    again = exact_light(Setting())
    assert path.stat().st_mtime_ns == written
    assert all(np.array_equal(*pair) for pair in zip(*map(jax.tree.leaves, (first, again)), strict=True))
    exact_light.cache_clear()
