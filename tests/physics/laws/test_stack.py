"""The law of a stack: its ends, its energy, its sampler, whatever its constants; and what a fit makes of it.

Then the half space of one medium that scatters forward: its closed part, its energy, and light it was not fitted to.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from mcml_sim import Layer, Medium, Setting, exact, half_space
from mcml_sim.exact import single_scattering
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.laws.two_parts import ForwardHalfSpace
from profilefit.recipes.stack import fit as stacks
from profilefit.recipes.stack.fit import Tracing, ring_edges, stack_law, traced, traced_half_space
from tests.fixtures import refused, slow

R = np.geomspace(1e-3, 30.0, 40)
CONSTANTS = {"w": 0.2, "u": -0.1, "g1": 0.9, "g2": 1.4, "b1": 0.1, "b2": 0.2, "h0": 0.7, "h1": 1.1, "k0": 0.2}


def layer(alpha: float, mfp: float, n: float = 1.4, light: str = "searchlight") -> LayerLaw:
    setting = Setting(light, n=n)
    return LayerLaw(setting, profilefit.load("hazard", setting=setting), alpha, mfp)


def stack(n: float = 1.4, light: str = "searchlight", **changed: float) -> StackLaw:
    top, below = layer(0.95, 0.2, n, light), layer(0.8, 0.5, n, light)
    return StackLaw(top.setting, top, below, 0.1, **{**CONSTANTS, **changed})


def ring_integrals(function, edges, nodes):
    """Integrals over each interval, by Gauss's rule."""
    x, weight = np.polynomial.legendre.leggauss(nodes)
    width = np.diff(edges)
    return function(edges[:-1, None] + width[:, None] * (x + 1) / 2) @ (weight / 2) * width


@pytest.mark.parametrize(
    ("n", "light"), [(1.4, "searchlight"), (1.0, "diffuse"), *slow((1.0, "searchlight"), (1.4, "diffuse"))]
)
def test_both_ends_are_the_half_spaces(n, light):
    law = stack(n, light)
    for thickness, end in ((0.0, law.below), (np.inf, law.top), (1e4, law.top)):
        np.testing.assert_allclose(law.profile(R, thickness), end.profile(R), rtol=1e-9)
        np.testing.assert_allclose(law.cdf(R, thickness), end.cdf(R), rtol=1e-9, atol=1e-12)
        assert law.total(thickness) == pytest.approx(end.reflectance, rel=1e-9)


@pytest.mark.parametrize("thickness", [0.01, 0.1, 1.0])
@pytest.mark.parametrize(
    "law", [stack(), stack(u=0.5, w=0.9), *slow(stack(1.0, "diffuse"))], ids=["n", "back", "matched"]
)
def test_energy_is_closed(law, thickness):
    """2 pi r R_d integrates to A times the cdf."""
    edges = np.append(0.0, np.geomspace(1e-7, 1e3, 4001))
    within = np.cumsum(ring_integrals(lambda r: 2 * np.pi * r * law.profile(r, thickness), edges, 8))
    np.testing.assert_allclose(law.cdf(edges[1:], thickness) * law.total(thickness), within, rtol=1e-6, atol=1e-7)
    assert (law.cdf(np.inf, thickness), law.cdf(1e9, thickness)) == (1.0, pytest.approx(1.0, abs=1e-12))


@pytest.mark.slow
@pytest.mark.parametrize(("n", "thickness"), [(1.0, 0.1), *slow((1.4, 0.02), (1.4, 0.0), (1.4, 2.0), (1.4, np.inf))])
def test_sampler_has_its_own_density_and_finds_all_the_light(n, thickness):
    law = stack(n)
    xi = (np.arange(2**15) + 0.5) / 2**15
    r = law.sampler.sample(xi, thickness)
    edges = np.append(0.0, np.geomspace(1e-3, 10.0, 25))
    counted = np.histogram(r, edges)[0] / xi.size
    expected = ring_integrals(lambda r: law.sampler.pdf(r, thickness), edges, 40)
    np.testing.assert_allclose(counted, expected, atol=4e-4)
    weights = 2 * np.pi * r * law.profile(r, thickness) / law.sampler.pdf(r, thickness)
    assert weights.mean() == pytest.approx(law.total(thickness), rel=5e-3)
    assert np.std(weights) < 1.5 * weights.mean()


@pytest.mark.slow
@pytest.mark.parametrize("n", [1.0, 1.4])
def test_a_stack_over_a_stack(n):
    """A layer cut in two by an interface of no thickness, and one whose lower part is as if it were not there."""
    inner = stack(n)
    outer = StackLaw(inner.setting, layer(0.9, 0.3, n), inner, 0.2, **CONSTANTS)
    np.testing.assert_allclose(outer.profile(R, 0.0), inner.profile(R), rtol=1e-9)
    np.testing.assert_allclose(outer.cdf(R, 0.0), inner.cdf(R), rtol=1e-8)
    r = outer.sampler.sample(np.array([0.1, 0.5, 0.999]))
    assert np.all(r > 0)
    assert np.all(outer.sampler.pdf(r) > 0)


def test_it_is_a_value_between_its_ends():
    """A pytree: its constants by name, traced, differentiated."""
    law, d = stack(), np.linspace(0.0, 3.0, 200)
    assert np.all(np.diff(law.total(d)) * np.sign(law.top.reflectance - law.below.reflectance) > 0)
    assert law.reflectance == law.total(0.1)
    assert law.profile(0.3) == law.profile(0.3, 0.1)
    assert law.constants() == CONSTANTS
    assert replace(law, w=0.3).total(0.1) != law.total(0.1)
    with jax.enable_x64(True):
        slope = jax.grad(lambda d: law.total(d))(jax.numpy.asarray(0.1))
    assert float(slope) == pytest.approx((law.total(0.1 + 1e-6) - law.total(0.1 - 1e-6)) / 2e-6, rel=1e-6)
    law = stack_law(half_space(0.9, mfp=0.5, n=1.3), "diffuse")
    known = profilefit.load("hazard", setting=Setting("diffuse", n=1.3))
    np.testing.assert_allclose(law.profile(R), known.profile(R, 0.9, 0.5), rtol=1e-12)
    np.testing.assert_allclose(law.sampler.sample([0.2, 0.9]), known.sampler.sample([0.2, 0.9], 0.9, 0.5), rtol=1e-12)
    np.testing.assert_allclose(law.sampler.pdf(R), known.sampler.pdf(R, 0.9, 0.5), rtol=1e-12)


def error(law: StackLaw, thickness: float, medium: Medium, light: str) -> tuple[float, float, float]:
    """rel, ks and relative error of A of a law at a thickness, against the exact light of this medium."""
    true = exact.solve(medium, light)
    r = np.geomspace(0.01 * medium.layers[0].mfp, 40.0, 120)
    share = true.cdf(r)
    near = r[share <= 0.995]
    relative = np.abs(law.profile(near, thickness) / true.profile(near) - 1).mean()
    return relative, np.abs(law.cdf(r, thickness) - share).max(), abs(law.total(thickness) / true.reflectance - 1)


@pytest.mark.slow
def test_a_fit_holds_between_the_thicknesses_that_it_was_made_at():
    """Green light on a heart; neither thickness is fitted."""
    wall, top = Layer(1.38, 0.80, 1.2, 0.0), Layer(1.38, 0.20, 2.2, 0.0, 0.3)
    law = stack_law(Medium((top, wall)))
    for thickness in (0.15, 0.6):
        medium = Medium((replace(top, thickness=thickness), wall))
        relative, ks, of_a = error(law, thickness, medium, "searchlight")
        assert relative < 0.03
        assert ks < 0.01
        assert of_a < 5e-3
        # Negative control: another thickness is another light, and the first layer alone is another still.
        assert error(law, 1.3 * thickness, medium, "searchlight")[2] > 0.03
        assert error(law, np.inf, medium, "searchlight")[0] > 0.1


L = partial(Layer, 1.4)
LAST = L(0.1, 1.0, 0.0)


@pytest.mark.parametrize(
    ("medium", "message"),
    [
        (1.4, "medium must be a mcml_sim.Medium"),
        (Medium((L(0.1, 1.0, 0.0, 1.0),)), "last layer must be infinitely thick"),
        (Medium((L(0.0, 0.0, 0.0, 1.0), LAST)), "layers must scatter or absorb"),
        (Medium((L(0.1, 1.0, -0.5, 1.0), LAST)), r"g in \[0, 0.95\] .*-0.5 in layer 1"),
        (Medium((L(0.1, 1.0, 0.5, 1.0), L(0.1, 0.0, 0.0))), "where one scatters forward, .*in layer 2"),
        (Medium((L(0.1, 1.0, 0.0, 1.0), Layer(1.5, 0.1, 1.0, 0.0))), "one n .*1.5 in layer 2"),
        (half_space(0.9, n=1.8), r"n over that above must be 1 or in \(1, 1.6\] .*1.8"),
        (Medium((*[L(0.1, 1.0, 0.0, 1.0)] * 30, LAST)), "at most 20 layers, got 31"),
    ],
)
def test_refused(medium, message):
    refused(message, stack_law, medium)


def test_refused_arguments():
    law, top = stack(), stack().top
    for call, arguments, message in (
        (law.profile, (0.1, -1.0), "thickness must be >= 0"),
        (law.total, (None,), "thickness must be a number"),
        *(
            (method, (0.1, 1.0), "thickness must be left out")
            for method in (top.profile, top.cdf, top.sampler.sample, top.sampler.pdf)
        ),
        (stack_law, (half_space(0.9), "sunlight"), "illumination"),
    ):
        refused(message, call, *arguments)
    assert law.profile(0.1, None) == law.profile(0.1)


def test_fitted_thicknesses_hold_the_layer_s_own():
    own = stacks._thicknesses(Layer(1.4, 0.1, 1.0, 0.0, 0.37), is_below=False)
    assert 0.37 in own
    assert own[0] == pytest.approx(0.1 / 1.1)


@pytest.mark.slow
@pytest.mark.parametrize("absorbed", [0.0, 1e-6])
def test_a_white_layer_over_a_dark_one(absorbed):
    """A falls as h / (d + h) under a thicker one, not as a power of e; an endless one that absorbs nothing is white."""
    white, dark = Layer(1.4, absorbed, 1.0 - absorbed, 0.0, 1.0), Layer(1.4, 0.5, 0.5, 0.0)
    law = stack_law(Medium((white, dark)), "diffuse")
    for thickness in (0.3, 2.0, 8.0):
        medium = Medium((replace(white, thickness=thickness), dark))
        assert error(law, thickness, medium, "diffuse")[2] < 0.02
    assert float(law.total(1e6)) == pytest.approx(float(law.top.whole()), abs=1e-6)
    # Negative control: as a fit ends that starts where others do.
    lost = replace(law, w=3e-5, u=0.4)
    assert abs(float(lost.total(2.0)) / float(law.total(2.0)) - 1.0) > 0.1


# Forward scattering

G = 0.9
# Constants as a fit to tissue gives them.
LAW = ForwardHalfSpace(Setting("searchlight", n=1.4, g=G), 0.95, 0.38, 1.0, 0.5, 0.1, 0.5, 0.4, 0.1, 0.15)
TISSUE = Layer(1.4, 0.2, 48.0, G)


def ring_errors(within, fresh, mfp):
    """Relative errors of rings that hold photons, beyond a tenth of a mean free path; and which these are."""
    counts = (fresh.weight > 0) & (fresh.edges[:-1] > 0.1 * mfp)
    return np.diff(np.asarray(within(fresh.edges)))[counts] / fresh.energy[counts] - 1, counts


@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
@pytest.mark.parametrize("g", [0.0, 0.5, 0.9])
def test_light_next_to_the_source_was_scattered_once(light, g, x64):
    """2 pi x R_d at the source: s_0 / (1 - g), in transport mean free paths, whatever was fitted."""
    own = Setting(light, n=1.4, g=g)
    law = ForwardHalfSpace(own, *list(LAW.constants().values()))
    x = 1e-7
    found = 2 * np.pi * x * float(law.scaled_profile(jnp.asarray(x), jnp.asarray(0.0)))
    assert found == pytest.approx(0.95 * single_scattering.source_strength(own) / (1 - g), rel=1e-4)
    if g == 0:
        parts = law.parts(jnp.asarray(0.0))
        assert float(parts.share) * law.total_reflectance == pytest.approx(0.95 * single_scattering.reflected(own))


def test_profile_is_the_slope_of_the_energy_which_tends_to_all_of_it(x64):
    x, alpha = jnp.geomspace(1e-3, 30, 200), jnp.asarray(0.0)
    slope = jax.vmap(jax.grad(lambda at: LAW.unscaled_energy(at, alpha)))(x)
    np.testing.assert_allclose(2 * np.pi * x * LAW.scaled_profile(x, alpha), slope, rtol=1e-9)
    assert float(LAW.unscaled_energy(jnp.asarray(np.inf), alpha)) == LAW.total_reflectance
    assert float(LAW.unscaled_energy(jnp.asarray(0.0), alpha)) == 0


@pytest.mark.slow
def test_radii_have_the_density_that_is_said(x64):
    """The mean of the law over its sampler's density is 1; over that of another medium it is not."""
    xi, alpha = (np.arange(100_000) + 0.5) / 100_000, jnp.asarray(0.0)
    x = LAW.sampler.scaled_sample(jnp.asarray(xi), alpha)
    weight = 2 * np.pi * x * LAW.scaled_profile(x, alpha) / LAW.total_reflectance
    assert float(jnp.mean(weight / LAW.sampler.scaled_pdf(x, alpha))) == pytest.approx(1, abs=2e-4)
    other = ForwardHalfSpace(LAW.setting, 0.7, 0.12, *list(LAW.constants().values())[2:])
    assert abs(float(jnp.mean(weight / other.sampler.scaled_pdf(x, alpha))) - 1) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
def test_a_fitted_half_space_is_light_that_it_was_not_fitted_to(light, x64):
    setting = Setting(light, n=1.4)
    law = traced_half_space(TISSUE, setting, Tracing(1, 2**20))
    fresh = traced(Medium((TISSUE,)), light, ring_edges(TISSUE, (TISSUE,)), 2**20, seed=2)
    # Both runs have noise; what is left of the squares beyond it is the law's: 1 % of a ring at most, on average.
    mine, counts = ring_errors(law.within, fresh, law.mfp)
    assert np.mean(mine**2) < 2 * np.mean(fresh.noise[counts] ** 2) + 0.01**2
    assert abs(law.reflectance - fresh.whole) < 4 * np.sqrt(2) * fresh.error
    similar = TISSUE.similar
    whole = exact.reflectance(similar.alpha, setting)
    within = lambda r: exact.cdf(r, similar.alpha, similar.mfp, setting) * whole  # noqa: E731
    isotropic, _ = ring_errors(within, fresh, law.mfp)
    assert np.mean(isotropic**2) > 0.1**2


@pytest.mark.slow
def test_a_stack_that_scatters_forward_is_light_that_it_was_not_fitted_to(x64):
    """Heart muscle, green, under its epicardium: the similar stack's A is a sixth too high."""
    medium = Medium((Layer(1.38, 0.2, 22.0, G, 0.3), Layer(1.38, 0.8, 12.0, G)))
    law = stack_law(medium)
    fresh = traced(medium, "searchlight", ring_edges(medium.layers[0], medium.layers), 2**21, seed=3)
    off, _ = ring_errors(lambda r: np.asarray(law.cdf(r)) * law.reflectance, fresh, law.top.mfp)
    assert np.mean(np.abs(off)) < 0.03
    assert law.reflectance == pytest.approx(fresh.whole, rel=0.01)
    similar = Medium(tuple(layer.similar for layer in medium.layers))
    assert exact.solve(similar).reflectance > 1.12 * fresh.whole
