"""The fast tracer of layers against a slow obvious one, against exact answers, and against itself in other shapes."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, exact, half_space
from mcml_sim.runs.input_runs import Compiling
from mcml_sim.tracing import layered_batch

pytestmark = pytest.mark.slow

# Mismatched indices everywhere, forward, isotropic and backward scattering, every layer a few mean free paths.
SMALL = Medium((Layer(1.4, 0.5, 9.5, 0.8, 0.2), Layer(1.2, 1, 4, 0, 0.3), Layer(1.5, 2, 3, -0.4, 0.3)), 1.0, 1.3)
GRID = Grid(0.1, 8, 0.1, 8, na=6)
BATCH = layered_batch.BATCH_PHOTONS
# Sums of weights of all sizes: with float64 added in the order of lanes, six arrays would differ.
ABSORBING = Medium((Layer(1.37, 5, 1, 0.3, 0.5), Layer(1.5, 30, 1, -0.3, 0.5), Layer(1.2, 0.2, 3, 0.8, 1.0)))
UNEVEN = Grid.from_edges(r=[0, 0.5, 1.5, 5], z=[0, 0.3, 0.9])


@dataclass
class Found:
    side: np.ndarray  # -1 above, 1 below, 2 below without scattering, 0 if it ended inside
    rho: np.ndarray
    cosine: np.ndarray
    weight: np.ndarray
    by_layer: np.ndarray  # weight left in each layer, (photons, layers)
    by_depth: np.ndarray  # weight left at each depth, the overflow last, (photons, depths + 1)


def slow_twin(medium, z_edges, photons, seed):
    """MCML as Wang & Jacques describe it, in float64: left-over steps, roulette below 1e-4 with a chance of 0.1."""
    random = np.random.default_rng(seed)
    mu_a, mu_s, g = (np.array([getattr(layer, name) for layer in medium.layers]) for name in ("mu_a", "mu_s", "g"))
    n = np.array([medium.n_above, *(layer.n for layer in medium.layers), medium.n_below])
    top, bottom, mu_t = medium.z_edges[:-1], medium.z_edges[1:], mu_a + mu_s
    layers = len(mu_a)
    found = Found(*(np.zeros((photons, *size)) for size in ((), (), (), (), (layers,), (len(z_edges),))))
    place, direction = np.zeros((photons, 3)), np.tile([0.0, 0.0, 1.0], (photons, 1))
    layer, weight, step = np.zeros(photons, int), np.ones(photons), np.zeros(photons)
    scattered = np.zeros(photons, bool)
    flying = np.arange(photons)
    while flying.size:
        fresh = flying[step[flying] == 0]
        step[fresh] = random.exponential(size=fresh.size)
        here, uz = layer[flying], direction[flying, 2]
        distance = (np.where(uz > 0, bottom[here], top[here]) - place[flying, 2]) / uz
        hits = step[flying] > distance * mu_t[here]

        i, far = flying[hits], distance[hits]
        place[i] += far[:, None] * direction[i]
        step[i] -= far * mu_t[layer[i]]
        down = direction[i, 2] > 0
        place[i, 2] = np.where(down, bottom[layer[i]], top[layer[i]])
        n1, n2 = n[layer[i] + 1], n[layer[i] + 1 + np.where(down, 1, -1)]
        incidence = np.arccos(np.minimum(np.abs(direction[i, 2]), 1))
        reflectance, refraction = textbook_fresnel(n1, n2, incidence)
        passes = random.random(i.size) >= reflectance
        direction[i[~passes], 2] *= -1
        j = i[passes]
        direction[j, :2] *= (n1 / n2)[passes, None]
        direction[j, 2] = np.cos(refraction[passes]) * np.where(down[passes], 1, -1)
        layer[j] += np.where(down[passes], 1, -1)
        out = j[(layer[j] < 0) | (layer[j] == layers)]
        found.side[out] = np.where(layer[out] < 0, -1, np.where(scattered[out], 1, 2))
        found.rho[out] = np.hypot(place[out, 0], place[out, 1])
        found.cosine[out], found.weight[out] = np.abs(direction[out, 2]), weight[out]
        weight[out] = 0

        i = flying[~hits]
        place[i] += (step[i] / mu_t[layer[i]])[:, None] * direction[i]
        step[i], scattered[i] = 0, True
        left = weight[i] * mu_a[layer[i]] / mu_t[layer[i]]
        weight[i] -= left
        found.by_layer[i, layer[i]] += left
        found.by_depth[i, np.searchsorted(z_edges[1:], place[i, 2], side="right")] += left
        direction[i] = turned(direction[i], g[layer[i]], random)
        small = i[weight[i] < 1e-4]
        weight[small] *= 10 * (random.random(small.size) < 0.1)
        flying = flying[weight[flying] > 0]
    return found


def textbook_fresnel(n1, n2, angle):
    """Reflectance and angle of refraction, by the angles."""
    sine = n1 / n2 * np.sin(angle)
    refracted = np.arcsin(np.minimum(sine, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        minus, plus = angle - refracted, angle + refracted
        mean = 0.5 * (np.sin(minus) / np.sin(plus)) ** 2 * (1 + (np.cos(plus) / np.cos(minus)) ** 2)
    normal = ((n1 - n2) / (n1 + n2)) ** 2
    return np.where(sine >= 1, 1, np.where(angle < 1e-6, normal, mean)), refracted


def turned(direction, g, random):
    """Henyey-Greenstein by its usual inverse, around the direction by Gram-Schmidt."""
    xi = random.random(len(g))
    with np.errstate(invalid="ignore", divide="ignore"):
        peaked = (1 + g**2 - ((1 - g**2) / (1 - g + 2 * g * xi)) ** 2) / (2 * g)
    cosine = np.clip(np.where(g == 0, 2 * xi - 1, peaked), -1, 1)
    other = random.normal(size=direction.shape)
    other -= np.sum(other * direction, axis=1, keepdims=True) * direction
    other /= np.linalg.norm(other, axis=1, keepdims=True)
    new = cosine[:, None] * direction + np.sqrt(1 - cosine**2)[:, None] * other
    return new / np.linalg.norm(new, axis=1, keepdims=True)


@lru_cache(maxsize=4)
def twin(g=0.8):
    medium = Medium((Layer(1.4, 0.5, 9.5, g, 0.2), *SMALL.layers[1:]), SMALL.n_above, SMALL.n_below)
    return slow_twin(medium, GRID.z_edges, 40_000, seed=2)


@lru_cache(maxsize=4)
def fast(seed=1, photons=BATCH):
    return layered_batch.trace_batch(SMALL, GRID, seed, 0, photons)


def means_of_twin(found):
    """Means by photon and their variances: exits by ring and angle, totals, absorption by layer and depth."""
    photons = len(found.side)
    angle = np.minimum((np.arccos(found.cosine) / (np.pi / 2) * GRID.angles).astype(int), GRID.angles - 1)
    cell = np.searchsorted(GRID.r_edges[1:], found.rho, side="right") * GRID.angles + angle
    rows = []
    for side in (-1, 1):
        weight = np.where(found.side == side, found.weight, 0)
        for power in (1, 2):
            rows.append(np.bincount(cell, weight**power, minlength=(GRID.rings + 1) * GRID.angles))
    ballistic = np.where(found.side == 2, found.weight, 0)
    columns = np.column_stack([ballistic, found.by_layer, found.by_layer.sum(axis=1), found.by_depth])
    sums = np.concatenate([rows[0], rows[2], columns.sum(axis=0)])
    squares = np.concatenate([rows[1], rows[3], (columns**2).sum(axis=0)])
    return sums / photons, (squares - sums**2 / photons) / photons**2


def means_of_fast(d):
    sums = np.concatenate([d.reflected.ravel(), d.transmitted.ravel(), [d.ballistic], d.absorbed])
    squares = [d.reflected_squares.ravel(), d.transmitted_squares.ravel(), [d.ballistic_squares], d.absorbed_squares]
    variance = np.concatenate(squares) - sums**2 / d.started
    means = np.concatenate([sums, d.absorbed_z]) / d.started
    return means, np.concatenate([variance, d.absorbed_z_variance]) / d.started**2


def deviations(found, d):
    """Differences in standard errors, of all bins that enough photons of the twin have reached."""
    (slow, slow_variance), (quick, quick_variance) = means_of_twin(found), means_of_fast(d)
    enough = slow > 30 / len(found.side)
    return ((quick - slow) / np.sqrt(slow_variance + quick_variance + 1e-30))[enough]


@pytest.mark.parametrize(("g", "agrees"), [(0.8, True), (0.7, False)])
def test_tracer_agrees_with_its_slow_twin_in_every_bin_and_with_no_other(g, agrees, sidak):
    z = deviations(twin(g), fast())
    assert z.size > 60
    assert (np.abs(z).max() < sidak(z.size)) == agrees


def shares(d):
    return d.reflected.sum(), d.transmitted.sum() + d.ballistic, d.absorbed[-1], d.cut


def test_every_photon_is_accounted_for():
    d = fast()
    error = np.sqrt(d.accounted_squares - d.accounted**2 / d.started)
    assert abs(d.accounted - d.started) < 4 * error
    assert sum(shares(d)) == pytest.approx(d.accounted, rel=1e-7)
    assert d.absorbed[:-1].sum() == pytest.approx(d.absorbed[-1], rel=1e-7)
    assert d.absorbed_rz.sum() == pytest.approx(d.absorbed[-1], rel=1e-6)
    np.testing.assert_allclose(d.absorbed_rz.sum(axis=0), d.absorbed_z)
    assert d.cut == 0
    assert all(np.all(np.isfinite(values)) for values in d.arrays().values())
    # The layers end where depths say: the first edge of depth .2 is that of the first layer.
    assert d.absorbed_z[:2].sum() == pytest.approx(d.absorbed[0], rel=1e-4)
    assert d.absorbed_z[-1] < 1e-6 * d.started


def test_a_shorter_batch_holds_the_first_photons_of_a_longer_one():
    some, more = fast(1, 50_000), fast(1, 60_000)
    assert some.started == 50_000
    assert np.all(more.reflected >= some.reflected)
    assert np.all(more.absorbed > some.absorbed)
    assert np.all(more.absorbed_rz.sum(axis=0) >= some.absorbed_rz.sum(axis=0))
    assert more.reflected.sum() - some.reflected.sum() < 10_000
    for seed, batch in ((1, 1), (2, 0)):  # different photons
        assert layered_batch.trace_batch(SMALL, GRID, seed, batch, 50_000).reflected.sum() != some.reflected.sum()


@pytest.mark.parametrize(("medium", "photons"), [(SMALL, 50_000), (ABSORBING, 30_000)], ids=["any", "small weights"])
def test_the_number_of_lanes_does_not_change_a_bit(medium, photons):
    many, few = (layered_batch.trace_batch(medium, GRID, 1, 0, photons, lanes=lanes) for lanes in (4096, 1024))
    for name, values in many.arrays().items():
        np.testing.assert_array_equal(values, getattr(few, name), err_msg=name)


@pytest.mark.parametrize("absorbs", [1e-4, 1e-7, 1e-10])
def test_weak_absorption_keeps_its_digits(absorbs):
    """What a slab absorbs is in proportion to mu_a; 1 - mu_a / mu_t in float32 would be off by a fifth at 1e-7."""
    d = layered_batch.trace_batch(Medium((Layer(1, 5 * absorbs, 5, 0.5, 1),)), Grid(1, 5, 0.1, 10), 1, 0, 100_000)
    error = np.sqrt(d.absorbed_squares[-1] - d.absorbed[-1] ** 2 / d.started)
    # 10.777 by adding and doubling, as absorption vanishes; at 1e-4 it is a thousandth less.
    assert 0 < error < 0.01 * d.absorbed[-1]
    assert abs(d.absorbed[-1] - 10.777 * absorbs * d.started) < 4 * error
    assert d.absorbed_z.sum() == pytest.approx(d.absorbed[-1], rel=1e-5)
    assert np.sqrt(d.absorbed_z_variance.sum()) < 0.01 * d.absorbed[-1]


def test_another_medium_of_the_same_structure_is_not_compiled_again():
    fast()
    other = Medium((Layer(1.1, 1, 2, 0.1, 3), Layer(1.1, 1, 0, 0, 1), Layer(1.2, 0, 0, 0, 2)))
    with Compiling() as again:
        layered_batch.trace_batch(other, Grid(0.3, 8, 0.2, 8, na=6), 7, 3, 5000)
    assert again.seconds == 0


def test_errors_are_those_of_repeated_runs(sidak):
    """Variance between 40 runs over what each run claims, for all that has enough photons."""
    runs = [means_of_fast(layered_batch.trace_batch(SMALL, GRID, seed, 0, 5_000)) for seed in range(100, 140)]
    means, variances = (np.array(part) for part in zip(*runs, strict=True))
    enough = means.mean(axis=0) > 30 / 5_000
    ratio = means[:, enough].var(axis=0, ddof=1) / variances[:, enough].mean(axis=0)
    # Each has a relative standard error of sqrt(2 / 39) = .23, a chi-squared with a longer tail above.
    assert 20 < ratio.size < 200
    assert ratio.max() < 1 + 1.5 * sidak(ratio.size) * np.sqrt(2 / 39)
    # The bins are nearly independent: their mean would show errors that are off by a tenth.
    assert abs(ratio.mean() - 1) < 4 * np.sqrt(2 / 39 / ratio.size) + 0.03
    assert abs(1.25 * ratio.mean() - 1) > 4 * np.sqrt(2 / 39 / ratio.size) + 0.03


@lru_cache(maxsize=8)
def one_layer(medium):
    return layered_batch.trace_batch(medium, Grid(0.5, 10), 3, 0, BATCH)


@pytest.mark.parametrize("alpha", [0.2, 0.6, 0.9, 0.99])
def test_half_space_reflects_as_the_exact_solution(alpha):
    d = one_layer(half_space(alpha))
    total = d.reflected.sum()
    error = np.sqrt(d.reflected_squares.sum() - total**2 / d.started)
    assert abs(total - d.started * exact.reflectance(alpha)) < 4 * error
    rings = d.reflected[:, 0]
    expected = d.started * np.diff(exact.cdf(Grid(0.5, 10).r_edges, alpha)) * exact.reflectance(alpha)
    assert np.all(np.abs(rings[:-1] - expected) < 4.5 * np.sqrt(d.reflected_squares[:-1, 0]))


def test_conservative_half_space_ends_and_says_what_it_cut():
    d = one_layer(half_space(1.0, n=1.3, g=0.5))
    reflected, transmitted, absorbed, cut = shares(d)
    assert absorbed == transmitted == 0
    assert 0 < cut < 0.02 * d.started
    error = np.sqrt(d.accounted_squares - d.accounted**2 / d.started)
    assert abs(reflected + cut - d.started) < 4 * error
    # That the light that was cut is not half of what it should be would be seen.
    assert abs(reflected + cut / 2 - d.started) > 2 * error


def test_conservative_slab_sends_everything_back_or_through_and_without_scattering_beers_law_holds():
    d = one_layer(Medium((Layer(1.5, 0, 50, 0.7, 0.2),)))
    reflected, transmitted, absorbed, cut = shares(d)
    error = np.sqrt(d.accounted_squares - d.accounted**2 / d.started)
    assert absorbed == cut == 0
    assert abs(reflected + transmitted - d.started) < 4 * error + 1e-6 * d.started
    d = one_layer(Medium((Layer(1.0, 2, 0, 0, 0.5),)))
    assert d.reflected.sum() == d.transmitted.sum() == 0
    assert abs(d.ballistic / d.started - np.exp(-1)) < 4 * 0.5 / np.sqrt(d.started)
    assert d.absorbed[-1] == d.started - d.ballistic


@pytest.mark.parametrize("thickness", [1e-7, 1e5])
@pytest.mark.parametrize("g", [-0.9, 0.99])
def test_extremes_are_numbers_that_add_up(g, thickness):
    d = one_layer(Medium((Layer(1.5, 1, 9, g, thickness),), 1.4))
    assert all(np.all(np.isfinite(values)) for values in d.arrays().values())
    error = np.sqrt(max(d.accounted_squares - d.accounted**2 / d.started, 0))
    assert abs(sum(shares(d)) - d.started) < 4 * error + 1e-6 * d.started
    assert (d.absorbed[-1] / d.started < 1e-5) == (thickness == 1e-7)


@pytest.mark.parametrize(("layers", "grid", "inner"), [(3, GRID, 5), (9, UNEVEN, 1)])
def test_a_layer_cut_into_many_is_the_same_layer(layers, grid, inner):
    """Nine are more than are followed one by one in each photon; the `inner` rings end at r = 0.5."""
    whole = one_layer(Medium((Layer(1.4, 1, 9, 0.5, 0.9),)))
    d = layered_batch.trace_batch(Medium((Layer(1.4, 1, 9, 0.5, 0.9 / layers),) * layers), grid, 4, 0, BATCH)
    third = d.absorbed_z[: np.searchsorted(grid.z_edges, 0.299)].sum()
    assert third == pytest.approx(d.absorbed[: layers // 3].sum(), rel=1e-4)
    difference = whole.reflected[0].sum() - d.reflected[:inner].sum()
    assert abs(difference) < 4 * np.sqrt(2 * whole.reflected_squares[0].sum())
    for of in ("reflected", "transmitted", "ballistic"):
        one, other = getattr(whole, of).sum(), getattr(d, of).sum()
        assert abs(one - other) < 4 * np.sqrt(getattr(whole, of + "_squares").sum() * 2)
    error = np.sqrt(whole.absorbed_squares[-1] - whole.absorbed[-1] ** 2 / whole.started)
    assert abs(whole.absorbed[-1] - d.absorbed[-1]) < 4 * np.sqrt(2) * error
    assert d.absorbed[:-1].sum() == pytest.approx(d.absorbed[-1], rel=1e-6)
    claimed = np.sqrt(d.absorbed_squares[:-1] - d.absorbed[:-1] ** 2 / d.started)
    assert np.all((claimed / d.absorbed[:-1] > 1e-4) & (claimed / d.absorbed[:-1] < 0.01))


def test_errors_of_many_layers_are_those_of_few_groups_too():
    """A table so large that there are 8 groups; the same photons give the same errors but for the spread of 8."""
    medium = Medium((Layer(1.4, 1, 9, 0.5, 0.1),) * 9)
    few = layered_batch.trace_batch(medium, Grid(0.01, 999, 0.01, 999), 4, 0, 30_000)
    many = layered_batch.trace_batch(medium, Grid(0.1, 9, 0.1, 9), 4, 0, 30_000)
    np.testing.assert_allclose(few.absorbed, many.absorbed, rtol=1e-9)
    variances = [d.absorbed_squares[:-1] - d.absorbed[:-1] ** 2 / d.started for d in (few, many)]
    # Nine ratios of chi-squared of 7 and of 31 degrees of freedom; empty groups would make them a thousand.
    assert 0.3 < np.mean(variances[0] / variances[1]) < 3


def test_light_goes_through_glass_and_leaves_nothing_in_it():
    """A matched sheet above changes nothing but where the tissue begins."""
    tissue, air = Layer(1.37, 1, 20, 0.5, 0.2), Layer(1.0, 0, 0, 0, 0.1)
    under = layered_batch.trace_batch(Medium((air, tissue, air)), GRID, 1, 0, BATCH)
    bare = one_layer(Medium((tissue,)))
    assert under.absorbed[0] == under.absorbed[2] == under.absorbed_z[0] == 0
    # The photons are those that have entered the tissue; on their way out they cross the air.
    for of in ("transmitted", "ballistic"):
        error = np.sqrt(2 * getattr(bare, of + "_squares").sum())
        assert abs(getattr(under, of).sum() - getattr(bare, of).sum()) < 4 * error
    error = np.sqrt(2 * bare.absorbed_squares[-1] - 2 * bare.absorbed[-1] ** 2 / BATCH)
    assert abs(under.absorbed[-1] - bare.absorbed[-1]) < 4 * error


def test_clear_glass_is_a_window():
    one = layered_batch.trace_batch(Medium((Layer(1.5, 0, 0, 0, 1),)), GRID, 1, 0, 1000)
    assert one.ballistic == one.ballistic_squares == one.accounted == 1000
    sheets = Medium((Layer(1.5, 0, 0, 0, 1), Layer(1.2, 0, 0, 0, 1), Layer(1.5, 0, 0, 0, 1)))
    d = layered_batch.trace_batch(sheets, GRID, 1, 0, BATCH)
    inner, last = (0.3 / 2.7) ** 2, (0.5 / 2.5) ** 2
    # The photons start in the second sheet; all light stays on the axis and goes to and fro.
    reflected, transmitted, absorbed, cut = shares(d)
    assert absorbed == cut == 0
    assert reflected + transmitted == BATCH
    assert d.transmitted.sum() == 0
    assert 1 - inner - last < transmitted / BATCH < 1 - last
