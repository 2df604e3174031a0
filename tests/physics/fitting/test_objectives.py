"""Each objective vanishes for data that come from the law itself, and weights them as its docstring says."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import InputError, Setting
from profilefit.fitting import estimate as objectives
from profilefit.fitting.estimate import OBJECTIVES, Rings, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.laws.printed_maps import LiangAlbedo

ALPHAS = np.array([0.3, 0.6, 0.9])
EDGES = np.concatenate([[0.0], np.geomspace(0.05, 6.0, 20)])


def made(energy, beyond, edges=EDGES, alpha=ALPHAS, **extra):
    """Rings with these energies, every one of them used."""
    parts = {"used": np.ones(energy.shape), "weight": np.ones(alpha.size), "limits": np.zeros(3), "xi": np.zeros(0)}
    return Rings(**{"alpha": alpha, "r_edges": edges, "energy": energy, "beyond": beyond, **parts, **extra})


def of_law(law, **extra):
    """The energies that a law itself has, unscaled."""
    with jax.enable_x64(True):
        alpha = jnp.asarray(ALPHAS)[:, None]
        inside = np.asarray(law.unscaled_energy(jnp.asarray(EDGES), alpha))
        total = np.asarray(law.unscaled_energy(jnp.asarray(1e9), alpha))[:, 0]
    return made(np.diff(inside, axis=1), total - inside[:, -1], **extra)


@pytest.mark.parametrize("name", ["liang", "burley"])
def test_energy_vanishes_on_the_laws_own(name, request, x64):
    law = request.getfixturevalue(name)
    table = np.hstack(objectives.energy(law, of_law(law, limits=np.array([1.0, 0.0]))))
    assert table.shape == (3, 22)
    np.testing.assert_allclose(table[:, :-1], 0.0, atol=1e-13)


def test_energy_rows_are_weighted_and_rings_that_do_not_count_add_nothing(burley, x64):
    """A ring of energy E that is off by the fraction f has the residual f sqrt(E / A): f^2, weighted by energy."""
    rings = of_law(burley)
    off = made(rings.energy / 1.1, rings.beyond)
    table = np.hstack(objectives.energy(burley, off))[:, :-2]
    np.testing.assert_allclose(table, 0.1 * np.sqrt(off.energy / off.reflectance[:, None]), rtol=1e-10)
    # So a law that is off by f everywhere has the sum of squares f^2 (its rings' share of A).
    np.testing.assert_allclose(np.sum(table**2, axis=1), 0.01 * off.energy.sum(axis=1) / off.reflectance, rtol=1e-10)
    # Rows of limits, weight times (law / limit - 1): the unscaled energy over A, twice the source strength over alpha.
    doubled = made(2 * rings.energy, 2 * rings.beyond, limits=np.array([3.0, 5.0]))
    table = np.hstack(objectives.energy(burley, doubled))
    np.testing.assert_allclose(table[:, -2], 3.0 * (0.5 - 1), rtol=1e-12)
    # Normalized diffusion: 2 pi r R_d -> A s / 2 at the source.
    reflectance = np.asarray(burley.albedo.reflectance(jnp.asarray(ALPHAS)))
    scale = 1.85 - reflectance + 7 * np.abs(reflectance - 0.8) ** 3
    np.testing.assert_allclose(table[:, -1], 5.0 * (reflectance * scale / ALPHAS - 1), rtol=1e-12)
    used = np.ones_like(rings.energy)
    used[1, 4] = 0
    energy = rings.energy * 1.3
    energy[1, 4] = 0.0  # an empty ring has no relative error
    table = np.hstack(objectives.energy(burley, made(energy, rings.beyond, used=used)))
    assert np.all(np.isfinite(table))
    assert np.flatnonzero(table[1, :-2] == 0).tolist() == [4]


def test_radial_vanishes_on_the_formula_and_share_knows_the_negative_branch(liang, x64):
    """r R_d at the ring centre, from energies E = 2 pi dr r R_d."""
    centre, width = 0.5 * (EDGES[1:] + EDGES[:-1]), np.diff(EDGES)
    a, b, c = (np.asarray(value) for value in liang.coefficients(jnp.asarray(ALPHAS)[:, None]))
    curve = (a * centre + b) / (centre + c)
    rings = made(2 * np.pi * width * curve, np.zeros(3))
    np.testing.assert_allclose(np.hstack(objectives.radial(liang, rings)), 0.0, atol=1e-15)
    # Unweighted: data that are higher by d give -d in every ring that counts.
    used = np.ones_like(curve)
    used[:, 15:] = 0
    raised = made(2 * np.pi * width * (curve + 0.01), np.zeros(3), used=used)
    np.testing.assert_allclose(np.hstack(objectives.radial(liang, raised)), -0.01 * used, atol=1e-15)
    # g(xi) < 0 for xi < eps: its share is minus the cdf of |g|, so the fit is told of the sign.
    xi, edges = np.array([0.004]), np.array([0, 1.0, 2.0])
    rings = made(np.full((1, 2), 0.5), np.zeros(1), edges=edges, alpha=ALPHAS[:1], xi=xi)
    g = float(liang.sampler.unclipped(jnp.asarray(0.004), jnp.asarray(ALPHAS[0])))
    assert g < 0
    assert float(np.hstack(objectives.share(liang, rings)).item()) == pytest.approx(g / 2 - 0.004, rel=1e-12)


def test_albedo_and_reflectance_vanish_on_the_map_itself(normalisation, x64):
    map8 = LiangAlbedo(Setting(), 5.67, 3.84, 0.84)
    for law, objective, sign in ((map8, objectives.albedo, 1), (normalisation, objectives.reflectance, -1)):
        reflectance = np.asarray(law.reflectance(jnp.asarray(ALPHAS)))
        table = np.hstack(objective(law, made(0.25 * reflectance[:, None], 0.75 * reflectance, edges=EDGES[:2])))
        assert table.shape == (3, 1)
        np.testing.assert_allclose(table, 0.0, atol=1e-14)
        # Negative control: more light in the data raises alpha(A) and lowers A(alpha) - A.
        more = np.hstack(objective(law, made(0.26 * reflectance[:, None], 0.75 * reflectance, edges=EDGES[:2])))
        assert np.all(sign * more > 1e-4)


@pytest.mark.slow
def test_radius_and_share_vanish_on_the_samplers_own_cdf_and_have_their_units(liang, x64):
    """Data whose cdf at the edges g(xi_j) is xi_j exactly: then linear interpolation hits the nodes."""
    xi, alpha = np.linspace(0.05, 0.95, 10), ALPHAS[1:2]
    edges = np.concatenate([[0.0], np.asarray(liang.sampler.unclipped(jnp.asarray(xi), jnp.asarray(0.6)))])
    energy = np.diff(np.concatenate([[0.0], xi]))[None, :]
    rings = made(energy, np.array([0.05]), edges=edges, alpha=alpha, xi=xi)
    for name in ("radius", "relative_radius", "share"):
        np.testing.assert_allclose(np.hstack(OBJECTIVES[name](liang, rings)), 0.0, atol=1e-13)
    # All light of the data spread evenly over [0, 2]: quantile 2 xi, cdf r/2.
    xi, alpha = np.array([0.25, 0.5]), ALPHAS[:1]
    rings = made(np.full((1, 4), 0.25), np.zeros(1), edges=np.linspace(0, 2, 5), alpha=alpha, xi=xi)
    g = np.asarray(liang.sampler.unclipped(jnp.asarray(xi), jnp.asarray(alpha[0])))
    np.testing.assert_allclose(np.hstack(objectives.radius(liang, rings))[0], g - 2 * xi, rtol=1e-12)
    np.testing.assert_allclose(np.hstack(objectives.relative_radius(liang, rings))[0], g / (2 * xi) - 1, rtol=1e-12)
    np.testing.assert_allclose(np.hstack(objectives.share(liang, rings))[0], g / 2 - xi, rtol=1e-12)


def _law(name, liang, normalisation):
    """One that the objective is of."""
    maps = {"albedo": LiangAlbedo(Setting(), 5.67, 3.84, 0.84), "reflectance": normalisation}
    return maps.get(name.removeprefix("relative_"), liang)


@pytest.mark.parametrize("name", OBJECTIVES)
def test_every_objective_moves_what_its_law_says_it_sees(name, liang, normalisation, x64):
    """The Jacobian in a constant that is not seen is zero, and in one that is seen it is not."""
    law = _law(name, liang, normalisation)
    rings = of_law(liang, xi=np.linspace(0.1, 0.9, 5), limits=np.ones(3))
    # At alpha near 1 the term of a that a3 governs is not zero.
    rings = made(rings.energy, rings.beyond, alpha=np.array([0.3, 0.6, 0.97]), xi=rings.xi, limits=rings.limits)
    names = law.constant_names()
    jacobian = jax.jacfwd(lambda v: OBJECTIVES[name](law.with_vector(names, v), rings))(jnp.asarray(law.vector(names)))
    moves = np.any(np.abs(np.hstack(jacobian)) > 1e-12, axis=(0, 1))
    assert tuple(n for n, m in zip(names, moves, strict=True) if m) == law.seen_by(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", OBJECTIVES)
def test_every_objective_has_a_derivative_in_its_data(name, liang, normalisation, x64):
    """Photon noise goes to the constants through it: finite everywhere, and the finite difference."""
    law = _law(name, liang, normalisation)
    base = of_law(liang, xi=np.linspace(0.13, 0.91, 5), limits=np.ones(3))

    def cost(energy):
        tables = OBJECTIVES[name](law, made(energy, base.beyond, xi=base.xi, limits=base.limits))
        return sum(jnp.sum(table**2) for table in tables)

    energy = jnp.asarray(base.energy * 1.05)
    slope = np.asarray(jax.grad(cost)(energy))
    assert np.all(np.isfinite(slope))
    step = np.zeros(energy.shape)
    step[1, 6] = 1e-7
    difference = float(cost(energy + step) - cost(energy - step)) / 2e-7
    assert difference == pytest.approx(slope[1, 6], rel=1e-5, abs=1e-8)


def test_rings_of_leaves_out_what_is_not_trusted():
    effective = np.array([[100.0, 49.0, 51.0, 1e9]])
    energy = np.array([[0.1, 0.1, 0.1, 0.0]])
    error = np.array([[0.01, 0.015, 0.015, 0.0]])
    profiles = Profiles(np.array([0.5]), np.arange(5.0), energy, error, effective, np.zeros(1), "orders", Setting())
    np.testing.assert_array_equal(rings_of(profiles).used, [[1, 0, 1, 0]])
    chosen = rings_of(profiles, np.array([[False, True, True, True]]), limits=(1.0, 2.0), xi=(0.4, 0.5))
    np.testing.assert_array_equal(chosen.used, [[0, 0, 1, 0]])
    np.testing.assert_array_equal(chosen.limits, [1.0, 2.0])
    np.testing.assert_array_equal(chosen.xi, [0.4, 0.5])
    np.testing.assert_array_equal(chosen.weight, [1.0])
    # The albedo is as precise as .3^2 / (.01^2 + .015^2 + .015^2) = 164 photons make it; a tenth is too few.
    with pytest.raises(InputError, match="no albedo rests on 500 effective ones"):
        rings_of(profiles, xi=(0.1, 0.2))
    rings = made(np.array([[0.1, 0.2]]), np.array([0.1]), edges=np.arange(3.0), alpha=ALPHAS[:1])
    np.testing.assert_allclose(np.asarray(rings.reflectance), [0.4], rtol=1e-6)
    np.testing.assert_allclose(np.asarray(rings.cdf), [[0.0, 0.25, 0.75]], rtol=1e-6)


@pytest.mark.slow
def test_relative_is_a_mean_square_error_and_resists_a_fall_next_to_white(burley, x64):
    """A law that is 10 % off in every ring has rows of 0.1 whose squares add up to 0.01, however the rings are cut."""
    rings = of_law(burley)
    off = made(rings.energy / 1.1, rings.beyond / 1.1)
    table = np.hstack(objectives.relative(burley, off))
    n = EDGES.size - 1
    misfit, shares = table[:, :n], table[:, n : 2 * n + 1]
    np.testing.assert_allclose(np.sum(misfit**2, axis=1), 0.01, rtol=1e-10)
    assert np.all(misfit[:, 0] == 0)  # from 0 to the first edge: no stretch of ln r
    np.testing.assert_allclose(shares, 0.0, atol=1e-12)  # the energy is where it should be
    assert np.all(table[:, 2 * n + 1 :] == 0)
    # It counts misplaced energy, and stops at the last percent.
    moved = made(np.roll(rings.energy, 1, axis=1), rings.beyond)
    table = np.hstack(objectives.relative(burley, moved))
    cdf = np.asarray(moved.cdf)
    expected = objectives.SHARE_WEIGHT / np.sqrt(EDGES.size) * (np.asarray(rings.cdf) - cdf)
    np.testing.assert_allclose(table[:, n : 2 * n + 1], expected, atol=1e-12)
    beyond = cdf[:, 1:] > objectives.ENERGY_WITHIN
    assert np.any(beyond)
    assert np.all(table[:, :n][beyond] == 0)

    # A law whose energy is 1 + v times another's, v = sqrt(1 - alpha), falls with the slope 1 in v at white.
    class Falling:
        def under(self, surfaces):
            return self

        def unscaled_energy(self, x, alpha):
            return burley.unscaled_energy(x, 0.9 + 0 * alpha) * (1 + jnp.sqrt(1 - alpha))

    limits = np.array([0.0, 0.0, 7.0])
    rows = np.hstack(objectives.relative(Falling(), of_law(burley, limits=limits)))[:, 2 * n + 1 :]
    np.testing.assert_allclose(rows, 7 * (1 + objectives.LEAST_FALL) / np.sqrt(ALPHAS.size), rtol=1e-4)
    rises = np.hstack(objectives.relative(burley, of_law(burley, limits=limits)))[:, 2 * n + 1 :]
    assert np.any(rises == 0)
