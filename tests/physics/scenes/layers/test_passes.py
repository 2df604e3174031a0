"""Layered objects: light scattered once as the passes draw it, samples of a stack's law, and its exact curves."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import profilefit
from benchmarks.planes import flat
from mcml_sim import Layer, Medium, Setting, exact, half_space
from mcml_sim.exact.single_scattering import reflected
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.recipes.stack.file import AbsorptionMap, ThicknessMap
from profilefit.scenes.layers import passes, truth
from profilefit.scenes.layers.law import single_scattering
from profilefit.scenes.layers.passes import (
    WithSingle,
    diffusely_once,
    of_half_space,
    of_stack,
    of_table,
    once,
    once_table,
)
from profilefit.scenes.layers.truth import StackTable, stack_table, table_of
from profilefit.scenes.stage.exact_law import FARTHEST, NEAREST, ExactLaw, exact_table
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.world import Light, unit
from tests.unit.scenes.scenes import ball, refused, scene

SIZE, SAMPLES = (96, 96), Sampling(4)
STAGE = SIZE, 256
LEAST, MOST = 0.05, 0.5  # thickness of the first layer [mm]
# Of each colour mu_a and mu_s of two layers [1/mm], and near what a fit of such a stack gives for its interface.
COLOURS = (((0.05, 1.8), (0.20, 1.13)), ((0.20, 2.2), (0.80, 1.2)), ((0.35, 2.6), (1.2, 1.3)))
CONSTANTS = {"w": 0.2, "u": -0.4, "g1": 0.95, "g2": 1.5, "b1": 0.06, "b2": 0.01, "h0": 0.78, "h1": 1.16, "k0": 0.17}


def media(n: float = 1.4, g: float = 0.0) -> tuple[Medium, ...]:
    return tuple(Medium((Layer(n, *top, g, 0.3), Layer(n, *below, g / 2))) for top, below in COLOURS)


def laws(n: float = 1.4) -> list[StackLaw]:
    setting = Setting("diffuse", n=n)
    own = profilefit.load("hazard", setting=setting)
    found = []
    for medium in media(n):
        top, below = (LayerLaw(setting, own, layer.alpha, layer.mfp) for layer in medium.layers)
        found.append(StackLaw(setting, top, below, 0.3, **CONSTANTS))
    return found


MFP = tuple(medium.layers[0].mfp for medium in media())


def left(medium: Medium, cosine: np.ndarray) -> np.ndarray:
    """`once` by another rule."""
    node, weight = np.polynomial.legendre.leggauss(90)
    turn = np.pi * (np.arange(96) + 0.5) / 96
    out = 0.5 * (node + 1.0)
    radiance = single_scattering(medium, cosine[:, None, None], out[:, None], turn)
    return np.pi * np.einsum("moa,o->m", radiance, weight * out) / 96 / cosine


def test_once_is_what_a_half_space_gives():
    """n = 1, g = 0: alpha / 2 (1 - mu ln(1 + 1 / mu))."""
    cosine = np.array([0.02, 0.05, 0.1, 0.3, 0.6, 1.0])
    known = 0.45 * (1.0 - cosine * np.log1p(1.0 / cosine))
    np.testing.assert_allclose(once(half_space(0.9), cosine), known, rtol=2e-7)  # of the quadrature where light grazes
    assert np.all(np.abs(once(half_space(0.91), cosine) / known - 1.0) > 0.01)
    grazing = once(half_space(0.9), np.array([passes.GRAZING]))
    assert grazing == pytest.approx(0.45 * (1.0 - passes.GRAZING * np.log1p(1.0 / passes.GRAZING)), rel=1e-3)


@pytest.mark.parametrize("n", [1.0, 1.4])
@pytest.mark.parametrize("g", [0.0, 0.5])
def test_of_diffuse_light_it_is_the_half_space_s(n, g):
    """Another sum of the same light, over spheroids; and a layer cut in two is one."""
    whole = Layer(n, 1.0, 9.0, g)
    share = 0.9 * reflected(Setting("diffuse", n=n, g=g))
    assert diffusely_once(Medium((whole,))) == pytest.approx(share, rel=1e-7)
    assert diffusely_once(Medium((replace(whole, thickness=0.03), whole))) == pytest.approx(share, rel=1e-7)
    other = Medium((replace(whole, thickness=0.03), replace(whole, mu_a=2.0)))
    assert diffusely_once(other) < 0.99 * share


@pytest.mark.parametrize(("n", "accepted"), [(1.0, 2e-4), (1.4, 5e-5)])
def test_the_table_is_right_between_its_places(n, accepted):
    """Of the light that arrives, cos_in once(cos_in): what comes or goes where the table is wrong."""
    three = media(n, 0.5)
    table = once_table(three, LEAST, MOST)
    assert table.shape == (passes.SHARES, passes.COSINES, 3)
    cosine = np.linspace(0.005, 1.0, 60)
    for share in (0.0, 0.04, 0.5, 1.0):
        found = between(table, cosine, np.full_like(cosine, share))
        for channel, medium in enumerate(three):
            known = left(medium.with_first(LEAST + (MOST - LEAST) * share), cosine)
            assert np.max(np.abs(found[:, channel] - known) * cosine) < accepted
    assert np.max(np.abs(between(table, cosine, np.full_like(cosine, 0.6))[:, 0] - found[:, 0]) * cosine) > accepted


def between(table, cosine, share):
    """(m, 3): the shader's two ways between four values, in numpy."""
    last = np.array(table.shape[1::-1]) - 1
    place = np.stack([cosine, share], axis=-1) * last
    corner = np.minimum(place.astype(int), last - 1)
    x, y = (place - corner).T[..., None]
    i, j = corner.T
    low, high = (table[row, i] + (table[row, i + 1] - table[row, i]) * x for row in (j, j + 1))
    return low + (high - low) * y


def added(three, share, into, out, azimuth, exitance=left):
    """pi L less what leaves alike in all directions, (m, 3): of unit irradiance on a plane across the light."""
    found = []
    for medium in three:
        each = []
        for part, mu, eye, turn in zip(share, into, out, azimuth, strict=True):
            own = medium.with_first(LEAST + (MOST - LEAST) * float(part))
            radiance = single_scattering(own, float(mu), float(eye), float(turn))
            each.append(np.pi * radiance - float(mu * exitance(own, np.array([mu]))[0]))
        found.append(each)
    return np.array(found).T


@pytest.mark.parametrize("n", [1.0, 1.4])
def test_no_energy_comes_or_goes(n):
    """Over all directions of the eye, each by its cosine, what the pass adds is nothing; in one direction it is not."""
    node, weight = np.polynomial.legendre.leggauss(64)
    out, of_out = 0.5 * (node + 1.0), weight * 0.5 * (node + 1.0)  # 2 mu dmu: the mean over a hemisphere
    turn = np.pi * (np.arange(48) + 0.5) / 48
    for medium, thickness, cosine in product(media(n, 0.5), (LEAST, MOST), (0.05, 0.4, 1.0)):
        own = medium.with_first(thickness)
        alike = cosine * once(own, np.array([cosine]))
        apart = np.pi * np.asarray(single_scattering(own, cosine, out[:, None], turn)) - alike
        assert of_out @ apart.mean(axis=1) == pytest.approx(0.0, abs=1e-7)
        assert of_out @ np.abs(apart).mean(axis=1) > 0.05 * alike


def uneven_ball():
    values = np.linspace(0.0, 1.0, 64, dtype=np.float32)[None, :, None]
    return replace(ball(), reflectance=np.broadcast_to(values, (8, 64, 3)).copy())


@pytest.mark.parametrize("kind", ["orthographic", "perspective"])
@pytest.mark.parametrize("g", [0.0, 0.6])
def test_the_shader_adds_what_numpy_does(stage, kind, g):
    """On a ball, at some pixels that the light reaches: by the same table to float32, by the whole formula to 1e-4."""
    direction, three = (0.5, 0.4, 0.6), media(1.4, g)
    drawn = scene(direction, uneven_ball(), kind=kind)
    drawn = replace(drawn, light=replace(drawn.light, irradiance=(1.0, 0.8, 0.5)))
    stage.draw(drawn)
    by = of_stack(laws(), LEAST, MOST, ())
    plain, seen = stage.scatter(by, MFP, SAMPLES), stage.buffers()
    single = WithSingle(by, three, LEAST, MOST)
    found = stage.scatter(single, MFP, SAMPLES).astype(float) - plain
    toward = drawn.camera.view()[:3, :3] @ unit(direction)
    into = seen.normal.astype(float) @ toward
    lit = (seen.mask > 0.5) & (into > 0.0)
    np.testing.assert_array_equal(found[~lit], 0.0)
    eye = np.broadcast_to([0.0, 0.0, 1.0], seen.normal.shape)
    if kind == "perspective":
        eye = unit(np.where(lit[..., None], -seen.position, eye))
    out = np.sum(seen.normal * eye, axis=-1)
    chosen = np.argwhere(lit & (out > 0.05) & (into > 0.05))[:: max(1, int(lit.sum() / 40))]
    assert len(chosen) > 20
    at = tuple(chosen.T)
    onward = into[at][:, None] * seen.normal[at] - toward
    leaving = eye[at] - out[at][:, None] * seen.normal[at]
    turned = np.sum(unit(onward) * unit(leaving), axis=1)
    angle = np.arccos(np.clip(turned, -1.0, 1.0))
    share, light = seen.reflectance[at][:, 0], np.array(drawn.light.irradiance) * seen.visibility[at][:, None]
    assert np.ptp(share) > 0.3
    rows = between(single.table, into[at], share)
    radiance = added(three, share, into[at], out[at], angle, lambda *_: np.zeros(1))
    np.testing.assert_allclose(found[at], light * (radiance - into[at][:, None] * rows), atol=5e-6)
    known = light * added(three, share, into[at], out[at], angle)
    np.testing.assert_allclose(found[at], known, atol=1e-4)
    assert np.max(np.abs(known)) > 1e-3
    # The comparison can fail: light that turns the other way along the surface, where scattering has a direction.
    mirrored = light * added(three, share, into[at], out[at], np.pi - angle)
    assert (np.max(np.abs(found[at] - mirrored)) > 1e-3) == (g > 0)


def test_light_from_everywhere_has_no_direction(stage):
    """Nor has light from behind: there the pass changes not a bit."""
    by = of_stack(laws(), LEAST, MOST, ())
    single = WithSingle(by, media(), LEAST, MOST)
    for show, what in ((stage.draw, scene((0.0, 0.0, -1.0), uneven_ball())), (stage.upload, flat(SIZE, 1.0, 0.5))):
        show(what)
        np.testing.assert_array_equal(stage.scatter(single, MFP, SAMPLES), stage.scatter(by, MFP, SAMPLES))


def test_lamps_add_what_is_scattered_once(stage):
    """Each from its own side: of two it is the sum, and of two halves the whole."""
    single = WithSingle(of_stack(laws(), LEAST, MOST, ()), media(), LEAST, MOST)
    one, other = Light((0.6, 0.3, 0.7), (1.0, 0.8, 0.6)), Light((-0.8, 0.4, 0.3), (0.3, 0.5, 0.9))
    half = Light(one.direction, (0.5, 0.4, 0.3))
    found = []
    for lamps in ((one, other), (one,), (other,), (half, half)):
        stage.draw(replace(scene((0.0, 0.0, 1.0), uneven_ball()), light=lamps[0], more=lamps[1:], ambient=(0.0,) * 3))
        found.append(stage.scatter(single, MFP, SAMPLES).copy())
    both, first, second, halves = found
    assert second.max() > 0.1
    np.testing.assert_allclose(both, first + second, atol=2e-6)
    np.testing.assert_allclose(halves, first, atol=2e-6)


@pytest.mark.parametrize("n", [1.0, 1.4])
@pytest.mark.parametrize("mfp", [3.0, 1e-3], ids=["blurred", "not blurred"])
def test_a_furnace_of_three_thicknesses(stage, n, mfp):
    """Even light on a plane: each pixel gives A of its own thickness, whatever lies beside it."""
    share = np.repeat([0.0, 0.3, 1.0], SIZE[0] // 3)
    light = np.array([1.0, 0.7, 0.2])
    stage.upload(flat(SIZE, 1.0, share[None, :, None], light))
    found = stage.scatter(of_stack(laws(n), LEAST, MOST, ()), mfp, SAMPLES)
    known = np.stack([law.total(LEAST + (MOST - LEAST) * share) for law in laws(n)], axis=-1) * light
    np.testing.assert_allclose(found, np.broadcast_to(known, found.shape), rtol=2e-5)  # float32
    assert np.all(np.ptp(known, axis=0) > 0.02 * light)


def test_a_half_space_everywhere(stage):
    """Of the three albedos, whatever the map says of thicknesses."""
    law, alpha = profilefit.load("hazard", setting=Setting("diffuse", n=1.4)), np.array([0.95, 0.8, 0.5])
    known = np.array([LayerLaw(law.setting, law, one, 1.0).reflectance for one in alpha])
    for share in (0.1, 0.9):
        stage.upload(flat(SIZE, 1.0, share))
        for mfp in (3.0, 1e-3):
            found = stage.scatter(of_half_space(law), mfp, SAMPLES, alpha)
            np.testing.assert_allclose(found, np.broadcast_to(known, found.shape), rtol=2e-5)  # float32
    assert np.all(np.diff(known) < -0.05)


@pytest.mark.slow
def test_a_table_of_one_material_draws_the_exact_half_space(stage, uniform):
    """Whatever the map says of thicknesses; half of the light lies left of an edge. Another albedo is seen."""
    setting = Setting("diffuse", n=1.4)
    light = (np.arange(SIZE[0]) < SIZE[0] / 2)[None, :, None].astype(float)
    stage.upload(flat(SIZE, 1.0, np.linspace(0.0, 1.0, SIZE[1])[:, None, None], light))
    own = stage.scatter(of_table(uniform, ()), 3.0, Sampling(64))
    stage.upload(flat(SIZE, 1.0, float(exact.reflectance(0.95, setting)), light))
    known, other = (
        stage.scatter(ExactLaw((alpha,), setting), 3.0, Sampling(64), (alpha,) * 3) for alpha in (0.95, 0.94)
    )
    np.testing.assert_allclose(own, known, atol=1e-3)
    assert np.max(np.abs(own - other)) > 4e-3


X = np.geomspace(0.01, 10.0, 60)  # r over the first layer's mean free path
SEEN = 0.995  # of the light: farther out are the faintest parts of a picture
RED, GREEN = (
    Medium((Layer(1.4, top, 4.8, 0.0, 0.25), Layer(1.4, 0.016, 3.2, 0.0, 0.2), Layer(1.4, below, 0.45, 0.0)))
    for top, below in ((0.21, 0.0085), (0.5, 0.1))
)
HEART = Medium((Layer(1.38, 0.2, 2.2, 0.0, 0.3), Layer(1.38, 0.8, 1.2, 0.0)))


def halfway(table: StackTable, places: list[int]) -> list[float]:
    """Thicknesses half way in ln d between neighbours of the table."""
    return np.exp(0.5 * (table.u[1:] + table.u[:-1]))[places].tolist()


def errors(
    table: StackTable, medium: Medium, channel: int, value: float, light: str, unit: float | None = None
) -> np.ndarray:
    """Largest error of R_d as far as light is SEEN, relative; of A, relative; of the cdf.

    value  share of the way from the table's least to its most;  unit  of the table's lengths, by default the medium's
    """
    true, unit = exact.solve(medium, light), unit or medium.layers[0].mfp
    curves = table.curves(np.full(3, value))
    share = np.asarray(true.cdf(unit * X))
    density = np.asarray(true.profile(unit * X)) * unit**2 / true.reflectance
    x = np.tile(X, (3, 1))
    return np.array(
        [
            np.max(np.abs(curves.density(x)[channel] / density - 1.0)[share < SEEN]),
            abs(curves.reflectance[channel] / true.reflectance - 1.0),
            np.max(np.abs(curves.share(x)[channel] - share)),
        ]
    )


@pytest.fixture
def few(monkeypatch):
    """Four rows in place of nine, for what does not depend on their number."""
    monkeypatch.setattr(truth, "THICKNESSES", 4)


@pytest.fixture
def uniform(few):
    """Of two layers of one material: a half space, however thick the first one is."""
    layer = Layer(1.4, 0.5, 9.5, 0.0, 0.2)
    return stack_table((Medium((layer, replace(layer, thickness=np.inf))),) * 3, 0.1, 0.3)


def test_of_one_material_it_is_the_half_space(uniform):
    """To the digits of exact light with few nodes: 4e-7 were found."""
    setting = Setting("diffuse", n=1.4)
    reflectance = float(exact.reflectance(0.95, setting))
    own, known = uniform.curves([0.0, 0.37, 1.0]), exact_table(setting).curves([reflectance])
    np.testing.assert_allclose(own.reflectance, reflectance, rtol=2e-6)
    x = np.tile(X, (3, 1))
    np.testing.assert_allclose(own.density(x), np.tile(known.density(X[None]), (3, 1)), rtol=2e-6)
    np.testing.assert_allclose(own.share(x), np.tile(known.share(X[None]), (3, 1)), atol=2e-6)
    other = exact_table(setting).curves([0.999 * reflectance])  # the comparison can fail
    assert np.max(np.abs(own.share(x) - other.share(X[None]))) > 1e-4
    # Density and share were made apart: 2 pi x density integrates to share, and that to 1.
    edges = np.geomspace(NEAREST, 0.1 * FARTHEST, 400)
    node, weight = np.polynomial.legendre.leggauss(8)
    width = np.diff(edges)
    at = edges[:-1, None] + 0.5 * width[:, None] * (node + 1.0)
    parts = np.pi * width * ((at * own.density(at.reshape(1, -1).repeat(3, 0))[0].reshape(at.shape)) @ weight)
    within = own.share(edges[None].repeat(3, 0))[0]
    np.testing.assert_allclose(within[0] + np.cumsum(parts), within[1:], atol=2e-5)
    assert within[-1] == pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_hardly_a_first_layer(few):
    """Thinner than exact light has digits for: A is that of what lies below, and R_d is a number."""
    table = stack_table((HEART,) * 3, 0.0, 1e-5)
    below = float(exact.reflectance(HEART.layers[1].alpha, Setting("diffuse", n=1.38)))
    np.testing.assert_allclose(table.curves([0.0] * 3 + [1.0] * 3).reflectance, below, rtol=1e-4)
    assert np.all(table.curves([0.0, 0.5, 1.0]).density(np.tile(X, (3, 1))) > 0)


@pytest.mark.parametrize(("least", "most"), [(0.2, 0.2), (0.3, 0.2), (-0.1, 0.2), (0.1, np.inf), (np.nan, 0.2)])
def test_refused(least, most):
    refused("least and most must be thicknesses, 0 <= least < most, got ", stack_table, (HEART,) * 3, least, most)
    unlike = Medium((Layer(1.4, 0.1, 1.0, 0.0, 1.0), Layer(1.5, 0.1, 1.0, 0.0)))
    refused("one n in all layers, got 1.4 in layer 1 and 1.5 in layer 2", stack_table, (unlike,) * 3, 0.1, 0.2)


@pytest.mark.slow
def test_between_its_thicknesses():
    """Of skin, whose first layer is thrice as thick in one place as in another: 3e-4, 1e-6 and 6e-6 were found."""
    table = stack_table((RED, GREEN, RED), 0.125, 0.375)
    accepted = np.array([1e-3, 1e-5, 2e-5])
    for thickness in halfway(table, [0, 3, 7]):
        for channel, medium in enumerate((RED, GREEN)):
            found = errors(table, medium.with_first(thickness), channel, (thickness - 0.125) / 0.25, "diffuse")
            assert np.all(found < accepted), found
    # The comparison can fail: for another channel, and for a thickness that is 1 % off.
    assert np.all(errors(table, RED.with_first(0.2), 1, 0.3, "diffuse") > 100.0 * accepted)
    assert np.all(errors(table, RED.with_first(0.2), 0, 0.308, "diffuse") > accepted)


COLOUR = (RED, GREEN, RED)
VARIED = {
    "blood": AbsorptionMap(np.zeros((1, 1)), (0.005, 0.02, 0.005), (0.05, 0.4, 0.05), 2),
    "melanin": AbsorptionMap(np.zeros((1, 1)), (0.0, 0.0, 0.0), (0.8, 2.0, 0.8), 0),
    "thickness": ThicknessMap(np.zeros((1, 1)), 0.1, 0.6, 1),
}


BETWEEN = [("blood", (1e-3, 5e-4, 5e-4)), ("melanin", (1e-3, 5e-4, 5e-4)), ("thickness", (1e-3, 1e-4, 1e-4))]


def test_a_map_of_one_value_is_a_stack_without(few):
    """Whatever the map's value; a stack as exact as its table's columns."""
    own = RED.layers[2].mu_a, GREEN.layers[2].mu_a, RED.layers[2].mu_a
    table = table_of(COLOUR, AbsorptionMap(np.zeros((1, 1)), own, own, 2))
    for channel, medium in enumerate((RED, GREEN)):
        for value in (0.0, 0.4, 1.0):
            assert np.all(errors(table, medium, channel, value, "diffuse") < [1e-3, 1e-5, 1e-5])


@pytest.mark.slow
def test_a_second_layer_s_thickness_is_that_of_a_plain_stack(few):
    """At a row of its table, whose places are the roots of values; exact light of the plain stack knows no map."""
    table = table_of((RED,) * 3, ThicknessMap(np.zeros((1, 1)), 0.1, 0.6, 1))
    first, second, last = RED.layers
    for d, is_same in ((0.1 + 0.5 * 4.0 / 9.0, True), (0.31, False)):
        plain = Medium((first, replace(second, thickness=d), last))
        assert np.all(errors(table, plain, 0, 4.0 / 9.0, "diffuse") < [1e-3, 1e-5, 1e-5]) == is_same


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "accepted"), BETWEEN)
def test_between_values_of_any_map(kind, accepted):
    """Blood below, melanin on top from none at all, a second layer of another thickness."""
    of = VARIED[kind]
    table = table_of(COLOUR, of)
    for value in (0.01, 0.2, 0.9):
        for channel, medium in enumerate(of.media(COLOUR, value)[:2]):
            found = errors(table, medium, channel, value, "diffuse", COLOUR[channel].layers[0].mfp)
            assert np.all(found < accepted), (value, found)
    medium = of.media(COLOUR, 0.9)[1]
    assert np.all(errors(table, medium, 1, 0.85, "diffuse", COLOUR[1].layers[0].mfp) > accepted)


@pytest.mark.slow
@pytest.mark.parametrize("least", [0.02, 0.0])
def test_a_range_of_a_hundred_times_and_from_nothing(least):
    """Its rows are then half a unit of ln d apart: 4e-2, 1.3e-3 and 7e-4 were found."""
    table = stack_table((HEART,) * 3, least, 2.0, "searchlight")
    last = len(table.u) - 2
    found = np.array(
        [
            errors(table, HEART.with_first(d), 0, (d - least) / (2.0 - least), "searchlight")
            for d in halfway(table, [last // 2, last])
        ]
    )
    assert np.all(found.max(axis=0) < [5e-2, 2e-3, 1e-3]), found
