"""Closed forms of layers: single scattering, plates, and each formula of Zhao et al., as printed beside as read."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import profilefit
from benchmarks import zhao as paper
from benchmarks.zhao import CORRECTED, PRINTED, Corrections
from mcml_sim import Layer, Medium, Setting, exact, half_space
from mcml_sim.exact.single_scattering import entered, ring_shares
from mcml_sim.media.phase import HenyeyGreenstein, Isotropic
from profilefit.scenes.layers.law import plate_of, single_scattering
from tests.unit.scenes.scenes import refusals

TISSUE = Medium((Layer(1.4, 0.3, 4.0, 0.7, 0.2), Layer(1.4, 0.1, 2.0, 0.4)))
PLATE = Medium((Layer(1.5, 0.2, 1.0, 0.3, 0.6), Layer(1.33, 0.1, 3.0, -0.3, 0.4)), n_above=1.0, n_below=1.6)
PANE = Medium((Layer(1.5, 0.0, 0.0, 0.0, 1.0), Layer(1.4, 0.1, 2.0, 0.5)))
COSINES = np.array([[1.0, 0.5], [0.7, 0.9], [0.3, 0.2], [0.05, 1.0]])
EPIDERMIS, DERMIS = Layer(1.4, 0.21, 4.8, 0.0, 0.25), Layer(1.4, 0.0085, 0.45, 0.0)
SKIN = Medium((EPIDERMIS, DERMIS))
STACK = Medium((Layer(1.3, 0.3, 4.0, 0.0, 0.2), Layer(1.3, 0.1, 2.0, 0.0)))


def nodes(count: int, low: float, high: float):
    x, weight = np.polynomial.legendre.leggauss(count)
    return low + (high - low) * (x + 1) / 2, weight * (high - low) / 2


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_its_total_under_a_searchlight_is_that_of_the_half_space(n):
    cosine, weight = nodes(80, 0.0, 1.0)
    radiance = single_scattering(half_space(0.9, n=n), 1.0, cosine[:, None], np.pi * (np.arange(64) + 0.5) / 64)
    total = 2 * np.pi * np.sum((weight * cosine)[:, None] * radiance) / 64
    once = ring_shares(np.array([0.0, 1e3]), Setting(n=n))
    assert total == pytest.approx(0.9 * entered(Setting(n=n)) * float(np.sum(once)), rel=2e-6)


@pytest.mark.parametrize("medium", [TISSUE, PLATE, PANE])
@pytest.mark.parametrize("turn", [0.0, 1.0, np.pi])
def test_light_and_eye_may_change_places(medium, turn):
    into, out = COSINES.T
    there, back = single_scattering(medium, into, out, turn), single_scattering(medium, out, into, -turn)
    np.testing.assert_allclose(there / into, back / out, rtol=1e-12)


def test_a_layer_cut_in_two_is_one_layer():
    into, out = COSINES.T
    whole = Medium((Layer(1.4, 0.1, 2.0, 0.5, 1.0),), n_below=1.2)
    cut = Medium((Layer(1.4, 0.1, 2.0, 0.5, 0.3), Layer(1.4, 0.1, 2.0, 0.5, 0.7)), n_below=1.2)
    np.testing.assert_allclose(single_scattering(cut, into, out, 1.0), single_scattering(whole, into, out, 1.0), 1e-12)


def test_the_closed_sum_of_the_documentation():
    """One index, no surface below: the docstring's formula, written out."""
    cos_in, cos_out, turn, n = 0.6, 0.3, 0.8, 1.4
    into, out = (np.sqrt(1 - (1 - mu**2) / n**2) for mu in (cos_in, cos_out))

    def passed(mu, inside):
        s, p = (mu - n * inside) / (mu + n * inside), (inside - n * mu) / (inside + n * mu)
        return 1 - (s**2 + p**2) / 2

    turned = np.sqrt((1 - into**2) * (1 - out**2)) * np.cos(turn) - into * out
    rate, depth, total = 1 / into + 1 / out, 0.0, 0.0
    for layer in TISSUE.layers:
        p = (1 - layer.g**2) / (4 * np.pi * (1 + layer.g**2 - 2 * layer.g * turned) ** 1.5)
        own = layer.mu_t * layer.thickness
        total += layer.mu_s / layer.mu_t * p * np.exp(-rate * depth) * (1 - np.exp(-rate * own)) / rate
        depth += own
    expected = passed(cos_in, into) * passed(cos_out, out) / n**2 * cos_in / (into * out) * total
    assert single_scattering(TISSUE, cos_in, cos_out, turn) == pytest.approx(expected, rel=1e-13)


def photons(medium: Medium, cos_in: float, count: int, seed: int):
    """Slow twin: cosines, cosines of the azimuth and weights of photons that leave above after one scattering."""
    random, layers = np.random.default_rng(seed), medium.layers
    index = np.array([medium.n_above, *(layer.n for layer in layers), medium.n_below])
    mu_t, alpha, g = np.array([(layer.mu_t, layer.mu_s / (layer.mu_t or 1.0), layer.g) for layer in layers]).T
    edges = medium.z_edges
    place = np.full(count, -1)  # of a layer; -1 above, len(layers) below
    course = np.tile([np.sqrt(1 - cos_in**2), 0.0, cos_in], (count, 1))
    z, weight, scattered = np.zeros(count), np.ones(count), np.zeros(count, bool)
    i = np.arange(count)
    _cross(random, index, place, course, i)
    while (i := i[(place[i] >= 0) & (place[i] < len(layers))]).size:
        at, down = place[i], course[i, 2]
        new = z[i] + random.exponential(size=i.size) / mu_t[at] * down
        stops = (new > edges[at]) & (new < edges[at + 1])
        z[i] = np.where(stops, new, np.where(down > 0, edges[at + 1], edges[at]))
        _cross(random, index, place, course, i[~stops])
        first = i[stops & ~scattered[i]]
        weight[first] *= alpha[place[first]]
        course[first] = _turned(random, course[first], g[place[first]])
        i = i[~stops | ~scattered[i]]  # a second scattering is the end
        scattered[first] = True
    kept = scattered & (place == -1)
    flat = course[kept, :2] / np.linalg.norm(course[kept, :2], axis=1, keepdims=True)
    return -course[kept, 2], flat[:, 0], weight[kept]


def _cross(random, index, place, course, i):
    here, side = place[i] + 1, np.where(course[i, 2] > 0, 1, -1)
    n1, n2 = index[here], index[here + side]
    mu1, sine2 = np.abs(course[i, 2]), n1 / n2 * np.hypot(course[i, 0], course[i, 1])
    mu2 = np.sqrt(np.maximum(1 - sine2**2, 0))
    s, p = (n1 * mu1 - n2 * mu2) / (n1 * mu1 + n2 * mu2), (n1 * mu2 - n2 * mu1) / (n1 * mu2 + n2 * mu1)
    through = random.random(i.size) >= np.where(sine2 >= 1, 1.0, (s**2 + p**2) / 2)
    course[i, 2] = np.where(through, side * mu2, -side * mu1)
    course[i, :2] *= np.where(through, n1 / n2, 1.0)[:, None]
    place[i] += np.where(through, side, 0)


def _turned(random, course, g):
    cosine, around = HenyeyGreenstein(g).sample(random.random(g.size)), 2 * np.pi * random.random(g.size)
    aside = np.cross(course, [0.3, 0.5, 0.8])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    swing = np.cos(around)[:, None] * aside + np.sin(around)[:, None] * np.cross(course, aside)
    return cosine[:, None] * course + np.sqrt(np.maximum(1 - cosine**2, 0))[:, None] * swing


@pytest.mark.parametrize("medium", [TISSUE, PLATE], ids=["two layers", "a plate of two indices on glass"])
def test_photons_that_scatter_once(medium):
    count, cos_in = 1_000_000, 0.6
    cosine, turn, weight = photons(medium, cos_in, count, seed=5)
    cosines, turns = np.array([0.0, 0.25, 0.5, 0.75, 1.0]), np.array([-1.0, -0.5, 0.5, 1.0])
    bins = [cosines, turns]
    share = np.histogram2d(cosine, turn, bins, weights=weight)[0] / count
    square = np.histogram2d(cosine, turn, bins, weights=weight**2)[0] / count
    error = np.sqrt((square - share**2) / count)
    expected = np.zeros_like(share)
    for i, j in np.ndindex(share.shape):
        mu, w = nodes(30, cosines[i], cosines[i + 1])
        angle, v = nodes(30, *np.arccos(turns[[j + 1, j]]))
        radiance = single_scattering(medium, cos_in, mu[:, None], angle)
        expected[i, j] = 2 * np.sum(w[:, None] * v * mu[:, None] * radiance) / cos_in
    z = (share - expected) / error
    assert np.all(np.abs(z) < 4.0), z
    assert np.mean(z**2) < 2.0
    # Negative control: the other sign of the azimuth is another light.
    assert np.max(np.abs((share - expected[:, ::-1]) / error)) > 10.0


def test_any_phase_function_grazing_light_and_light_that_cannot_enter():
    other = single_scattering(TISSUE, 1.0, 0.5, 0.0, phases=(Isotropic(), HenyeyGreenstein(0.4)))
    assert other != pytest.approx(single_scattering(TISSUE, 1.0, 0.5, 0.0), rel=0.1)
    grazing = single_scattering(TISSUE, 1e-9, COSINES[:, 1], 0.0)
    assert np.all((grazing > 0) & (grazing < 1e-8))
    # From a denser medium above, beyond the critical angle: nothing.
    denser = Medium((Layer(1.0, 0.1, 1.0, 0.0),), n_above=1.5)
    assert (single_scattering(denser, 0.3, 1.0, 0.0), single_scattering(denser, 1.0, 0.3, 0.0)) == (0.0, 0.0)


test_refused = refusals(
    partial(single_scattering, medium=TISSUE, cos_in=1.0, cos_out=1.0, azimuth=0.0),
    ({"medium": 1.4}, "medium must be a mcml_sim.Medium"),
    ({"cos_in": 0.0}, "cos_in must be a cosine"),
    ({"cos_out": 1.5}, "cos_out must be a cosine"),
    ({"azimuth": np.nan}, "azimuth must be"),
    ({"phases": (Isotropic(),)}, "phases must be 2"),
    ({"cos_in": [1.0, 0.5], "cos_out": [1.0, 0.5, 0.2]}, "shapes"),
)


def test_the_paper_s_sum_put_right_goes_to_the_closed_one():
    """Schlick's p is not Henyey and Greenstein's, but at g = 0; as printed the sum goes elsewhere."""
    medium = Medium((Layer(1.4, 0.3, 4.0, 0.0, 0.2), Layer(1.4, 0.1, 2.0, 0.0)))
    true = single_scattering(medium, 0.7, 0.5, 1.0)
    errors = [paper.single_sum(medium, 0.7, 0.5, 1.0, count, 6.0) / true - 1 for count in (250, 1000, 4000)]
    assert abs(errors[-1]) < 1e-3
    assert abs(errors[-1]) < 0.3 * abs(errors[0])
    printed = [paper.single_sum(medium, 0.7, 0.5, 1.0, count, 6.0, paper.PRINTED) / true for count in (250, 500)]
    assert printed[1] == pytest.approx(2 * printed[0], rel=0.1)  # no step: brightness grows with the samples


@pytest.mark.parametrize("thickness", [0.7, 1.1, 2.5, 6.0, 14.0, 30.0])
def test_plates_between_and_beyond_those_fitted(thickness):
    """Within half a percent; a plate without its skins lets through another light."""
    found = float(plate_of(SKIN).transmitted(thickness))
    layers = (EPIDERMIS, replace(DERMIS, thickness=thickness - 2 * EPIDERMIS.thickness), EPIDERMIS)
    covered, bare = (
        exact.solve(Medium(plate), "diffuse").transmittance
        for plate in (layers, (replace(DERMIS, thickness=thickness),))
    )
    assert found == pytest.approx(covered, rel=5e-3)
    assert abs(found / bare - 1) > 0.1


def test_ends_of_plates():
    """Far inside light dies with the core; a part no thicker than its skins counts as these; a dark core's error."""
    plate = plate_of(SKIN)
    ratio = plate.transmitted(81.0) / plate.transmitted(80.0)
    assert ratio == pytest.approx(np.exp(-float(exact.decay_rate(DERMIS.alpha)) / DERMIS.mfp), rel=1e-6)
    assert plate.transmitted(0.1) == plate.transmitted(2 * EPIDERMIS.thickness) <= 1
    dark = Layer(1.4, 2.5, 0.48, 0.0)
    assert plate.error < 2e-3 < 0.1 < plate_of(Medium((EPIDERMIS, dark))).error


def mean_cosine(corrections: Corrections, g: float = 0.9) -> tuple[float, float]:
    """Of (8): its integral over all directions, and the mean of the cosine of deflection."""
    x, weight = np.polynomial.legendre.leggauss(400)
    p = 2 * np.pi * weight * paper.phase(x, g, corrections)
    return float(p.sum()), float(p @ x)


def test_phase_function():
    """(8): printed it throws light back; Schlick's k in place of g brings back its mean cosine, not its tail."""
    total, back = mean_cosine(PRINTED)
    assert total == pytest.approx(1.0, abs=1e-9)
    assert back == pytest.approx(-0.7658, abs=1e-4)
    assert mean_cosine(replace(CORRECTED, schlick=False))[1] == pytest.approx(0.7658, abs=1e-4)
    assert mean_cosine(CORRECTED)[1] == pytest.approx(0.971, abs=1e-3)
    straight_back = HenyeyGreenstein(0.9).pdf(-1.0)
    assert paper.phase(-1.0, 0.9, replace(CORRECTED, schlick=False)) / straight_back == pytest.approx(1.9, abs=0.01)
    assert paper.phase(-1.0, 0.9, CORRECTED) / straight_back == pytest.approx(0.11, abs=0.01)


def test_dipole():
    """(10): printed the image lies inside the body."""
    medium = half_space(0.9, n=1.3)
    assert paper.dipole_heights(medium, PRINTED) == pytest.approx((1.0, -2.65), abs=5e-3)
    assert paper.dipole_heights(medium) == pytest.approx((1.0, 4.47), abs=5e-3)
    r = np.geomspace(0.01, 10, 20)
    known = profilefit.load("dipole", setting=Setting(n=1.3)).profile(r, 0.9)
    np.testing.assert_allclose(entered(Setting(n=1.3)) * paper.dipole(medium, r), known, rtol=1e-6)
    assert np.any(paper.dipole(medium, r, PRINTED) < 0)
    deeper = Medium((*STACK.layers[:1], Layer(1.3, 5.0, 0.1, 0.0)))
    np.testing.assert_array_equal(paper.dipole(STACK, r), paper.dipole(deeper, r))  # the first layer only


def test_extinction_surface_and_weights():
    """(6) and (9) by their names: exactly twice too bright at normal incidence, where nothing refracts."""
    medium = half_space(0.9)
    wrong = replace(CORRECTED, extinction=False)
    ratio = [paper.single_sum(medium, 1.0, 1.0, np.pi, 4096, 30.0, corrections) for corrections in (wrong, CORRECTED)]
    assert ratio[0] / ratio[1] == pytest.approx(2.0, rel=1e-4)
    # (9): neither cosine nor Fresnel nor the narrowing of the beam.
    beam = half_space(0.9, n=1.3), 1.0, 1.0, 0.0, 64, 6.0
    passed = (1 - (0.3 / 2.3) ** 2) ** 2 / 1.3**2 * paper.single_sum(*beam, replace(CORRECTED, surface=False))
    assert paper.single_sum(*beam) == pytest.approx(passed, rel=1e-9)
    # (2): the five weights sum to 1, though what they weigh is in one unit already, where each of them is 1.
    assert sum(paper.WEIGHTS) == pytest.approx(1.0)
    assert len(paper.WEIGHTS) == 5


def test_steps():
    """(4) and (5): from the near ends too bright, in the middle less wrong; without its step the sum grows with N."""
    true = single_scattering(STACK, 0.7, 0.5, 1.0)

    def error(count: int, **changed: bool) -> float:
        return paper.single_sum(STACK, 0.7, 0.5, 1.0, count, 1.4, replace(CORRECTED, **changed)) / true - 1

    near, middle = ([error(count, middle=m) for count in (4, 8, 16, 64)] for m in (False, True))
    assert near == sorted(near, reverse=True)
    assert near[0] > 2.0
    assert near[3] == pytest.approx(near[2] / 4, rel=0.25)
    assert np.all(np.abs(middle) < 0.4 * np.array(near))
    # The step along the ray, refracted with its cosine.
    out = np.sqrt(1 - (1 - 0.5**2) / 1.3**2)
    assert (1 + error(16, step=False)) / (1 + error(16)) == pytest.approx(16 * out / 1.4)


def test_every_misprint_has_a_switch_that_changes_something():
    tissue = Medium((Layer(1.3, 0.3, 4.0, 0.7, 0.2), Layer(1.3, 0.1, 2.0, 0.7)))
    for name in Corrections.switches():
        wrong = replace(CORRECTED, **{name: False})
        sums = [paper.single_sum(tissue, 0.7, 0.5, 1.0, 16, 1.4, corrections) for corrections in (wrong, CORRECTED)]
        dipoles = [float(paper.dipole(tissue, 0.1, corrections)) for corrections in (wrong, CORRECTED)]
        assert (sums[0] != sums[1]) != (dipoles[0] != dipoles[1]), name


test_what_the_paper_refuses = refusals(
    partial(paper.single_sum, medium=STACK, cos_in=1.0, cos_out=1.0, azimuth=0.0, samples=8, deepest=1.0),
    ({"samples": 0}, "samples must be a whole number >= 1"),
    ({"samples": 10**6}, "samples must be a whole number"),
    ({"deepest": np.inf}, "deepest must be a depth > 0"),
    ({"medium": Medium((Layer(1.3, 1, 1, 0, 1), Layer(1.4, 1, 1, 0)))}, "one index in all layers"),
)
