"""Each text, line by line in numpy, is its law: in float64 to the digits of its constants, in float32 to rounding."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from profilefit.laws.base import AlbedoLaw
from profilefit.laws.burley import BurleyDiffuseMfp
from profilefit.laws.diffusion import BeamDiffusion, DiffusionLaw
from profilefit.laws.gaussians import law_class
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.printed_maps import LiangAlbedo
from profilefit.laws.quantile import Quantile
from profilefit.recipes import catalogue
from profilefit.shader import emit
from profilefit.studies.stability.cells import Rounded
from tests.fixtures import slow

FITS = catalogue.fits_folder()
LAWS = {
    one.label: one.law
    for one in catalogue.profile_laws(FITS, matched=False)
    if not isinstance(one.law, BeamDiffusion)  # it has no text
}
MAPS = {one.label: one.law for one in catalogue.albedo_laws(FITS, matched=False)}
ALPHA = np.array([0.03, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 0.99999, 1.0])[:, None]
X = np.geomspace(1e-6, 200.0, 120)[None, :]
XI = np.concatenate([np.geomspace(1e-6, 9e-3, 20), np.linspace(0.0123, 0.99, 80), 1.0 - np.geomspace(9e-3, 1e-6, 20)])
# Both ends of every argument, and what lies between.
ALPHA_32 = np.concatenate([[0.0, 1e-30, 1e-6], np.linspace(1e-3, 1.0, 40), 1.0 - np.geomspace(6e-8, 1e-3, 9)])[:, None]
X_32 = np.concatenate([[0.0, 1e-30, 1e-10], np.geomspace(1e-6, 200.0, 150), [1e3, 1e8, 1e15, 1e30]])
XI_32 = np.concatenate([[0.0, 1e-30], XI, [1.0 - 6e-8, 1.0]])
# A record of another setting has the text of its law and other constants.
ELSEWHERE = [one for one in LAWS if "-" in one and one != "gaussians-2"]


class CoarseLog(Rounded):
    """numpy in float32, whose logarithm is off by `most` next to 0: OpenGL allows 2^-21, NVIDIA's takes 2^-22."""

    def __init__(self, most):
        super().__init__(np.float32)
        self.most = most

    def log(self, x):
        right = np.log(np.asarray(x, np.float32))
        return np.where((x >= 0.5) & (x <= 2.0), right + np.float32(self.most), right).astype(np.float32)


def twin(law, rounded=False, coarse=0.0):
    """The functions of a law's or map's text in Python, by name."""
    text = (emit.map_text if isinstance(law, AlbedoLaw) else emit.law_text)(law, "python", "law")
    names = {"np": CoarseLog(coarse) if coarse else Rounded(np.float32)} if rounded else {}
    exec(text.replace("import numpy as np\n", "") if rounded else text, names)
    return names


def labels(*kinds):
    return [label for label, law in LAWS.items() if isinstance(law, kinds)]


def truth(law, alpha):
    """Profile, cdf, density and radius of the law."""
    law = jax.tree.map(np.asarray, law)  # constants as arrays: instances of one class share what jax compiles
    profile, cdf = law.profile(X, alpha), law.cdf(X, alpha)
    if "two steps" in law.samplers:  # its text has the law's density for that of its two steps
        pdf = 2.0 * np.pi * X * profile / law.albedo.reflectance(alpha)
        return profile, cdf, pdf, law.samplers["two steps"].sample(XI, alpha)
    return profile, cdf, law.sampler.pdf(X, alpha), law.sampler.sample(XI, alpha)


def mismatch(names, law):
    """The largest differences, relative but for that of the cdf, which is a share."""
    alpha = ALPHA[:-1] if isinstance(law, BurleyDiffuseMfp) else ALPHA  # the law says that it does not have 1
    given = {"profile": X, "cdf": X, "pdf": X, "sample": XI}
    least = 1e-15, 1.0, 1e-12, 1e-9  # [1/mfp^2], [-], [1/mfp], [mfp]: nothing that a picture shows
    found = {}
    for (what, argument), right, floor in zip(given.items(), truth(law, alpha), least, strict=True):
        made = names[f"law_{what}"](argument, alpha, 1.0)
        found[what] = float(np.max(np.abs(made - right) / np.maximum(right, floor)))
    return found


@pytest.mark.parametrize("label", [*(one for one in LAWS if one not in ELSEWHERE), *slow(*ELSEWHERE)])
def test_the_twin_is_the_law(label):
    law = LAWS[label]
    found = mismatch(twin(law), law)
    accepted = {"profile": 1e-9, "cdf": 1e-11, "pdf": 1e-9, "sample": 1e-9}
    assert {what: error for what, error in found.items() if error > accepted[what]} == {}


@pytest.mark.slow
def test_two_steps_of_hazard_draw_its_density():
    law = LAWS["hazard"]
    with jax.enable_x64(True):
        own = np.asarray(jax.jit(law.samplers["two steps"].pdf)(jnp.asarray(X[:, ::4]), jnp.asarray(ALPHA)))
    made = twin(law)["law_pdf"](X[:, ::4], ALPHA, 1.0)
    assert np.max(np.abs(made / own - 1.0)[own > 1e-9]) < 1e-5


@pytest.mark.parametrize("label", labels(Quantile))
def test_quantile_finds_its_way_back_next_to_white_and_far_away(label):
    names = twin(LAWS[label])
    shape = names["law_shape"](np.array([[0.0], [0.9999], [1.0 - 1e-7], [1.0]]))
    x = np.geomspace(1e-6, 1e7, 100) + np.zeros((4, 1))
    np.testing.assert_allclose(names["law_local"](names["law_depth"](x, shape), shape).radius, x, rtol=1e-13)


def test_a_constant_that_is_off_in_the_eighth_digit_is_found():
    law = LAWS["quantile"]
    wrong = {**law.constants(), "b0": law.b0 * (1.0 + 1e-7)}
    found = mismatch(twin(law.with_vector(tuple(wrong), list(wrong.values()))), law)
    assert found["profile"] > 1e-9
    assert found["sample"] > 1e-9


def test_a_single_gaussian():
    kind, near = law_class(1), LAWS["gaussians-2"]
    law = kind(setting=near.setting, albedo=near.albedo, f1=-6.0, f2=2.0, v1=1.0)
    names, s = twin(law), np.sqrt(1.0 - ALPHA)
    rate = 0.5 * np.exp(-(1.0 - 6.0 * s + 2.0 * s**2))
    np.testing.assert_allclose(names["law_sample"](XI, ALPHA, 1.0), np.sqrt(-np.log1p(-XI) / rate), rtol=1e-9)
    np.testing.assert_allclose(names["law_cdf"](X, ALPHA, 1.0), -np.expm1(-rate * X**2), rtol=0, atol=1e-14)
    right = 2.0 * X * rate * np.exp(-rate * X**2)
    np.testing.assert_allclose(names["law_pdf"](X, ALPHA, 1.0), right, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("label", LAWS)
def test_the_reflectance_comes_back(label):
    law, names = LAWS[label], twin(LAWS[label])
    own = law.reflectance if isinstance(law, DiffusionLaw) else law.albedo.reflectance
    reflectance = np.linspace(0.0, own(1.0), 50)
    alpha = names["law_alpha"](reflectance)
    back = names["law_reflectance"](names["law_shape"](alpha))
    # Where white, the last bit of alpha is 2e-8 of sqrt(1 - alpha).
    np.testing.assert_allclose(back, reflectance, rtol=0, atol=1e-7)
    if not isinstance(law, DiffusionLaw):  # whose alpha is by its own reflectance
        np.testing.assert_allclose(alpha, law.albedo.alpha(reflectance), rtol=0, atol=1e-12)


@pytest.mark.filterwarnings("ignore:overflow encountered in (multiply|divide):RuntimeWarning")  # 1e30 mfp: exp(-inf)
@pytest.mark.parametrize("label", LAWS)
def test_float32_is_finite_everywhere_and_right_to_rounding(label):
    law = LAWS[label]
    rounded, exact = twin(law, rounded=True), twin(law)
    alpha, mfp = ALPHA_32.astype(np.float32), np.float32(1.0)
    for what, given in (("profile", X_32), ("cdf", X_32), ("pdf", X_32), ("sample", XI_32)):
        given = given.astype(np.float32)
        made = rounded[f"law_{what}"](given, alpha, mfp)
        assert made.dtype == np.float32
        assert np.all(np.isfinite(made) & (made >= 0.0)), what
    x, inner = X_32.astype(np.float32), ALPHA_32[:, 0] > 0.05
    share = rounded["law_cdf"](x, alpha, mfp)
    np.testing.assert_allclose(share, exact["law_cdf"](x.astype(float), alpha.astype(float), 1.0), atol=3e-6)
    assert np.min(np.diff(share, axis=1)) > -5e-7
    density = exact["law_pdf"](x.astype(float), alpha.astype(float), 1.0)[inner]
    error = np.abs(rounded["law_pdf"](x, alpha, mfp)[inner] / np.maximum(density, 1e-30) - 1.0)
    # 1e-3 where the inverse of Liang et al. turns: its density has no end there.
    assert np.max(error[density > 1e-9]) < (2e-3 if isinstance(law, Liang) else 1e-4)


@pytest.mark.parametrize("off", [2.0**-22, -(2.0**-22)])
@pytest.mark.parametrize("label", [one for one in LAWS if one not in labels(Liang)])  # whose inverse turns back
def test_radii_where_the_logarithm_is_coarse(label, off):
    law = LAWS[label]
    coarse, exact = twin(law, rounded=True, coarse=off), twin(law)
    xi = np.concatenate([[0.0], np.geomspace(2.0**-24, 1e-3, 60), np.linspace(0.002, 0.99, 50)]).astype(np.float32)
    alpha = ALPHA_32[ALPHA_32[:, 0] > 0.05].astype(np.float32)
    drawn = coarse["law_sample"](xi, alpha, np.float32(1.0)).astype(float)
    assert np.all(np.isfinite(drawn) & (drawn >= 0.0))
    right = exact["law_sample"](xi.astype(float), alpha.astype(float), 1.0)
    shares = [exact["law_cdf"](radius, alpha.astype(float), 1.0) for radius in (drawn, right)]
    assert np.max(np.abs(shares[0] - shares[1])) < 5e-6
    if isinstance(law, Hazard | Quantile):  # radii by which a stratified sampler orders its samples
        assert np.all(np.diff(drawn) >= 0.0)


@pytest.mark.parametrize("label", labels(Hazard))
def test_the_hazard_turns_as_steeply_in_float32_next_to_the_source(label):
    rounded, exact = twin(LAWS[label], rounded=True), twin(LAWS[label])
    x, alpha = np.geomspace(1e-25, 30.0, 400).astype(np.float32), np.array([[0.036], [0.5], [0.95]], np.float32)
    made, right = (
        names["pf_local"](x.astype(kind), names["law_shape"](alpha.astype(kind)).curve).bend
        for names, kind in ((rounded, np.float32), (exact, float))
    )
    assert np.max(np.abs(made - right) / (np.abs(right) + 1.0)) < 1e-5


@pytest.mark.parametrize("label", MAPS)
def test_the_twin_is_the_map(label):
    law, names, share = MAPS[label], twin(MAPS[label]), np.linspace(0.0, 1.0, 101)
    alpha, reflectance, highest = (names[f"law_{one}"] for one in ("alpha", "map_reflectance", "MAX_REFLECTANCE"))
    np.testing.assert_allclose(alpha(share), law.alpha(share), rtol=0, atol=1e-11)
    assert highest == pytest.approx(law.reflectances.high, rel=1e-11)
    beyond = highest + np.array([0.0, 0.01, 1.0, 1e6])
    np.testing.assert_array_equal(alpha(beyond), alpha(beyond[0]))
    assert alpha(-1.0) == alpha(0.0)
    reached = share[:-1] if isinstance(law, LiangAlbedo) else share  # alpha = 1 is beyond its fold
    np.testing.assert_allclose(reflectance(reached), law.reflectance(reached), rtol=0, atol=1e-10)
    assert 0.0 < reflectance(1.0) <= 1.0


@pytest.mark.parametrize("label", MAPS)
def test_a_map_in_float32_is_finite_and_right_to_rounding(label):
    share = np.linspace(0.0, 1.0, 301, dtype=np.float32)
    rounded, exact = twin(MAPS[label], rounded=True), twin(MAPS[label])
    for name, span in (("law_alpha", 2e-6), ("law_map_reflectance", 1e-5)):
        made = rounded[name](share)
        assert np.all((made >= 0.0) & (made <= 1.0)), name
        np.testing.assert_allclose(made, exact[name](share.astype(float)), rtol=0, atol=span)
