"""A stack's table between its thicknesses against exact light, and where exact light is known in another way."""

from dataclasses import replace

import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting, exact
from profilefit.errors import InputError
from profilefit.scenes.layers import truth
from profilefit.scenes.layers.truth import StackTable, stack_table
from profilefit.scenes.stage.exact_law import FARTHEST, NEAREST, exact_table

X = np.geomspace(0.01, 10.0, 60)  # r over the first layer's mean free path
SEEN = 0.995  # of the light: farther out are the faintest parts of a picture
RED, GREEN = (
    Medium((Layer(1.4, top, 4.8, 0.0, 0.25), Layer(1.4, 0.016, 3.2, 0.0, 0.2), Layer(1.4, below, 0.45, 0.0)))
    for top, below in ((0.21, 0.0085), (0.5, 0.1))
)
HEART = Medium((Layer(1.38, 0.2, 2.2, 0.0, 0.3), Layer(1.38, 0.8, 1.2, 0.0)))


def of_thickness(medium: Medium, thickness: float) -> Medium:
    first, *others = medium.layers
    return Medium((replace(first, thickness=thickness), *others))


def between(table: StackTable, places: list[int]) -> np.ndarray:
    """Thicknesses half way in ln d between neighbours of the table."""
    return np.exp(0.5 * (table.u[1:] + table.u[:-1]))[places]


def errors(
    table: StackTable, medium: Medium, channel: int, thickness: float, light: str, taken: float | None = None
) -> np.ndarray:
    """Largest error of R_d as far as light is SEEN, relative; of A, relative; of the cdf.

    taken  what the table is asked for, if that is another thickness
    """
    true, unit = exact.solve(of_thickness(medium, thickness), light), medium.layers[0].mfp
    curves = table.curves(np.full(3, ((taken or thickness) - table.least) / (table.most - table.least)))
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
def alike(few):
    """Of two layers of one material: a half space, however thick the first one is."""
    layer = Layer(1.4, 0.5, 9.5, 0.0, 0.2)
    return stack_table((Medium((layer, replace(layer, thickness=np.inf))),) * 3, 0.1, 0.3)


def test_of_one_material_it_is_the_half_space(alike):
    """To the digits of exact light with few nodes: 4e-7 were found."""
    setting = Setting("diffuse", n=1.4)
    reflectance = float(exact.reflectance(0.95, setting))
    own, known = alike.curves([0.0, 0.37, 1.0]), exact_table(setting).curves([reflectance])
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
    with pytest.raises(InputError, match=r"least and most must be thicknesses, 0 <= least < most, got "):
        stack_table((HEART,) * 3, least, most)
    with pytest.raises(InputError, match=r"one n in all layers, got 1.4 in layer 1 and 1.5 in layer 2"):
        stack_table((Medium((Layer(1.4, 0.1, 1.0, 0.0, 1.0), Layer(1.5, 0.1, 1.0, 0.0))),) * 3, 0.1, 0.2)


@pytest.mark.slow
def test_between_its_thicknesses():
    """Of skin, whose first layer is thrice as thick in one place as in another: 3e-4, 1e-6 and 6e-6 were found."""
    table = stack_table((RED, GREEN, RED), 0.125, 0.375)
    accepted = np.array([1e-3, 1e-5, 2e-5])
    for thickness in between(table, [0, 3, 7]):
        for channel, medium in ((0, RED), (1, GREEN)):
            found = errors(table, medium, channel, float(thickness), "diffuse")
            assert np.all(found < accepted), found
    # The comparison can fail: for another channel, and for a thickness that is 1 % off.
    assert np.all(errors(table, RED, 1, 0.2, "diffuse") > 100.0 * accepted)
    assert np.all(errors(table, RED, 0, 0.2, "diffuse", 0.202) > accepted)


@pytest.mark.slow
@pytest.mark.parametrize("least", [0.02, 0.0])
def test_a_range_of_a_hundred_times_and_from_nothing(least):
    """Its rows are then half a unit of ln d apart: 4e-2, 1.3e-3 and 7e-4 were found."""
    table = stack_table((HEART,) * 3, least, 2.0, "searchlight")
    last = len(table.u) - 2
    found = np.array([errors(table, HEART, 0, float(d), "searchlight") for d in between(table, [last // 2, last])])
    assert np.all(found.max(axis=0) < [5e-2, 2e-3, 1e-3]), found
