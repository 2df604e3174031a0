"""Maps between alpha and A: printed ones by hand and with their known errors, rational ones exact at both ends."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, Setting, exact, simulate_orders
from mcml_sim.exact import single_scattering
from profilefit import albedo_law, albedo_quality
from profilefit.laws import published
from profilefit.laws.printed_maps import Chiang, LiangAlbedo, VanDeHulst
from profilefit.laws.rational import Rational, RefractingRational
from tests.fixtures import NORMALISATION, slow
from tests.physics.tracing.adding_doubling import solve

DIFFUSE = Setting("diffuse")
CHIANG = Chiang(DIFFUSE, **published.constants("chiang_albedo"))
VAN_DE_HULST = VanDeHulst(DIFFUSE, **published.constants("van_de_hulst_albedo"))
LIANG = LiangAlbedo(Setting(), **published.constants("liang_albedo"))
EVERY = {"chiang": CHIANG, "liang": LIANG, "rational": NORMALISATION, "van_de_hulst": VAN_DE_HULST}
ALPHA = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
FEW = ALPHA[[1, 4, 7, 9, 10]]


def test_printed_maps_by_hand_at_a_half():
    for law, alpha in (
        (CHIANG, 1 - math.exp(-2.43381625)),  # -2.54703 + 0.65297 - 0.53975625
        (LIANG, 2.835 / 3.01),  # 5.67 * 0.5 / (0.25 + 1.92 + 0.84)
        (VAN_DE_HULST, 1 - (6.201435 - math.sqrt(34.86072)) ** 2),  # 9.59217 + 20.8404 + 4.42815
    ):
        assert law.alpha(0.5) == pytest.approx(alpha, rel=1e-13)


def test_the_rational_map_by_hand_and_against_the_exact_one():
    """s = 1/2 at alpha = 3/4: 0.5 * (1 + 0.22529) / (1 + 1.179285 + 0.3419975) = 0.612645 / 2.5212825."""
    assert NORMALISATION.reflectance(0.75) == pytest.approx(0.612645 / 2.5212825, rel=1e-14)
    # 3.0e-6 at best for this form; five digits a constant cost a tenth of that.
    alpha = 1 - np.linspace(0, 1, 201) ** 2
    assert np.max(np.abs(NORMALISATION.reflectance(alpha) - exact.reflectance(alpha))) < 3.4e-6
    assert np.max(np.abs(NORMALISATION.reflectance(alpha) - exact.reflectance(alpha, DIFFUSE))) > 0.05
    s = np.geomspace(1e-5, 0.5, 20)
    back = np.sqrt(1 - NORMALISATION.alpha(NORMALISATION.reflectance(1 - s**2)))
    np.testing.assert_allclose(back, s, rtol=1e-4)  # 1 - alpha = 1e-10 has six digits in float64
    # Its ends are exact whatever the constants.
    for constants in ((0.45058, 2.35857, 1.36799), (0.5, 2.0, 1.0), (-0.2, 0.3, 0.1)):
        law = Rational(Setting(), *constants)
        assert [law.reflectance(0.0), law.reflectance(1.0), law.alpha(1.0)] == [0.0, 1.0, 1.0]
        assert law.alpha(0.0) == pytest.approx(0.0, abs=1e-15)


# alpha rounds at 1e-16; at the last step before A = 1 dA/dalpha is 70 (Chiang) and 2.9 / (2 s), 2e3 (rational). The
# digits of van de Hulst's put s = 0 at A = 0.99998 and s < 1 at A = 0: there the way back is cut, or has two ends.
@pytest.mark.parametrize(
    ("name", "low", "high", "error"),
    [
        ("chiang", 0, 1, 2e-14),
        ("liang", 0, 0.9, 1e-11),
        ("rational", 0, 1, 3e-13),
        ("van_de_hulst", 1e-3, 0.999, 1e-11),
    ],
)
def test_the_inverse_of_a_map_goes_back(name, low, high, error):
    law, reflectance = EVERY[name], np.linspace(low, high, 401)
    alpha = law.alpha(reflectance)
    np.testing.assert_allclose(law.reflectance(alpha), reflectance, rtol=0, atol=error)
    assert np.all(np.diff(alpha) > 0)


@pytest.mark.parametrize("name", EVERY)
def test_types_and_slopes(name):
    law = EVERY[name]
    assert type(law.alpha(0.5)) is type(law.reflectance(0.5)) is float
    assert (law.alpha([[0.5]]).shape, law.alpha([0.1, 0.2]).dtype) == ((1, 1), np.float64)
    single = jax.jit(law.reflectance)(jnp.float32(0.7))
    assert (single.dtype, float(single)) == (jnp.float32, pytest.approx(law.reflectance(0.7), rel=1e-5))
    with jax.enable_x64(True):
        alpha = jnp.array([0.01, 0.3, 0.99])
        slopes = jax.jit(jax.vmap(jax.grad(law.reflectance)))(alpha)
        back = jax.jit(jax.vmap(jax.grad(law.alpha)))(jnp.asarray(law.reflectance(np.asarray(alpha))))
    assert np.all(np.asarray(slopes) > 0)
    np.testing.assert_allclose(slopes * back, 1.0, rtol=1e-8)


def test_errors_and_ends_of_printed_maps():
    """0.007 in alpha under diffuse light, and 0.005 in A at these albedos; nothing maps beyond 0.9989."""
    truth = exact.reflectance(ALPHA, DIFFUSE)
    assert np.max(np.abs(CHIANG.alpha(truth) - ALPHA)) == pytest.approx(0.0069, abs=2e-4)
    assert np.max(np.abs(CHIANG.reflectance(ALPHA) - truth)) == pytest.approx(0.0047, abs=1e-4)
    assert CHIANG.alpha(1.0) == pytest.approx(1 - math.exp(-6.80023), rel=1e-12)
    np.testing.assert_allclose(CHIANG.reflectance([0.9995, 1.0]), 1.0, rtol=1e-15)
    with jax.enable_x64(True):
        assert np.isfinite(jax.grad(CHIANG.reflectance)(jnp.asarray(0.0)))
    # A fit moves the constants: a straight line, and a cubic whose slope changes threefold.
    even = np.linspace(0, 1, 101)
    for constants in ((-3.0, 0.0, 0.0), (-3.0, 2.0, -1.0)):
        law = Chiang(DIFFUSE, *constants)
        np.testing.assert_allclose(law.reflectance(law.alpha(even)), even, rtol=0, atol=1e-13)
    # 0.0021 in A under diffuse light, near A = 0.18.
    error = np.abs(VAN_DE_HULST.reflectance(ALPHA) - truth)
    assert 0.0019 < error.max() < 0.0021
    assert ALPHA[error.argmax()] in (0.5, 0.6)
    assert (VAN_DE_HULST.reflectance(0.0), VAN_DE_HULST.reflectance(1.0)) == (0.0, pytest.approx(1.0, abs=2e-5))
    assert VAN_DE_HULST.alpha([0.0, 1.0]) == pytest.approx([0.0, 1.0], abs=6e-6)
    # Its inverse is the rising branch; above the peak there is no reflectance.
    assert LIANG.alpha(0.0) == LIANG.reflectance(0.0) == 0.0
    assert LIANG.fold == pytest.approx(0.9165, abs=5e-5)
    near = LIANG.alpha(LIANG.fold + np.array([-1e-3, 0.0, 1e-3]))
    assert near[1] > max(near[0], near[2])
    assert near[1] == pytest.approx(0.99947, abs=5e-6)
    # 0.84 / 1 on the one side and 1 on the other: two reflectances, one albedo.
    assert LIANG.alpha(0.84) == pytest.approx(LIANG.alpha(1.0), rel=1e-15)
    assert LIANG.alpha(1.0) == pytest.approx(5.67 / 5.68, rel=1e-15)
    np.testing.assert_array_equal(np.isnan(LIANG.reflectance([0.9994, 0.9995, 1.0])), [False, True, True])


@pytest.mark.slow
def test_errors_of_printed_maps_everywhere():
    quality, other = albedo_quality(CHIANG), albedo_quality(VAN_DE_HULST)
    assert quality.delta_alpha == pytest.approx(0.00695, abs=1e-5)
    assert quality.delta_A == pytest.approx(0.0737, abs=1e-4)
    assert other.delta_A == pytest.approx(0.00206, abs=2e-5)
    assert quality.monotone
    assert other.monotone
    # Negative control: it is not meant for a searchlight.
    assert albedo_quality(VanDeHulst(Setting(), **VAN_DE_HULST.constants())).delta_A > 0.06


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(n=1.4), Setting("diffuse", n=1.4)], ids=str)
def test_photons_leave_specular_light_out(setting):
    light = simulate_orders(Grid.from_edges(r=[0.0, 1000.0]), 2**19, seed=4, setting=setting, progress=False)
    found, own = light.reflectance(FEW), exact.reflectance(FEW, setting)
    z = (np.asarray(found.value) - own) / np.asarray(found.standard_error)
    assert np.max(np.abs(z)) < 3.6  # five albedos of the same photons, at 0.3 % if they were independent
    with_specular = (np.asarray(found.value) + 1 - light.entered - own) / np.asarray(found.standard_error)
    assert np.min(with_specular) > 20


# Under surfaces that refract

ANY = {**RefractingRational.entry.start, "c0": 1.7, "d1": 1.2, "f0": 0.05}
REFRACTING = pytest.mark.parametrize(
    "setting", [Setting(light, n) for light in ("searchlight", "diffuse") for n in (1.0005, 1.1, 1.45, 1.6)], ids=str
)


@REFRACTING
def test_ends_are_exact_whatever_the_constants_and_the_inverse_goes_back(setting):
    law = RefractingRational(setting, **ANY)
    most = law.reflectance(1.0)
    assert most == pytest.approx(single_scattering.entered(setting), rel=1e-14)
    assert law.reflectance(1e-9) / 1e-9 == pytest.approx(single_scattering.reflected(setting), rel=1e-6)
    assert [law.reflectance(0.0), law.alpha(0.0), law.alpha(most)] == [0.0, 0.0, 1.0]
    assert law.alpha(1.0) == 1.0  # more than there is
    law = albedo_law("rational", setting=setting)
    alpha = np.concatenate([np.geomspace(1e-12, 0.5, 30), 1 - np.geomspace(0.5, 1e-10, 30)])
    np.testing.assert_allclose(law.alpha(law.reflectance(alpha)), alpha, rtol=1e-9)
    assert np.all(np.diff(law.alpha(np.linspace(0.0, law.entered, 401))) > 0)
    alpha = np.linspace(0.05, 1.0, 20)
    rest = law.reflectance(alpha) - alpha * single_scattering.reflected(setting)
    np.testing.assert_allclose(alpha**2 * law.scattered_again(alpha), rest, rtol=1e-9)
    assert np.all(law.scattered_again(np.linspace(0, 1, 101)) > 0)


@pytest.mark.parametrize("n", [1.4, *slow(1.001, 1.02, 1.2, 1.37, 1.6)])
@pytest.mark.parametrize("light", ["searchlight", "diffuse"])
def test_near_exact_light_at_every_index(light, n):
    law = albedo_law("rational", setting=Setting(light, n))
    quality = albedo_quality(law)
    assert quality.delta_A < 4e-5
    assert quality.monotone
    # By adding and doubling layers, to 1e-6: all but nothing gets through 200 mfp.
    media = (Medium((Layer(n, 1.0 - alpha, alpha, 0.0, 200.0),)) for alpha in FEW)
    own = [solve(medium, 6, 8, diffuse=light == "diffuse").reflected.sum() for medium in media]
    np.testing.assert_allclose(law.reflectance(FEW), own, atol=6e-5)
    other = albedo_law("rational", setting=Setting(light, n - 0.01 if n > 1.01 else n + 0.01))  # the negative control
    assert np.max(np.abs(other.reflectance(FEW) - exact.reflectance(FEW, setting=law.setting))) > 5e-4
