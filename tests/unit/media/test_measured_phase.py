"""Phase functions that measurements need: tables, sums of terms, and Fournier and Forand's."""

from functools import reduce

import jax
import numpy as np
import pytest

from mcml_sim import Layer, Medium, Setting, SettingError, exact
from mcml_sim.media.phase import FournierForand, HenyeyGreenstein, Isotropic, Mixture, Tabulated, as_table, from_table
from profilefit.recipes.folder import shipped
from profilefit.recipes.phases import read_phase
from tests.fixtures import refused

PETZOLD = read_phase(shipped("fits") / "phases" / "petzold.csv").table
FORAND = FournierForand(1.1054, 3.582)
SEA = Mixture((0.317, 0.6813, 0.0017), (HenyeyGreenstein(0.9933), HenyeyGreenstein(0.8957), HenyeyGreenstein(-0.635)))
ANY = Mixture((0.3, 0.3, 0.4), (PETZOLD, FORAND, HenyeyGreenstein(-0.2)))
NESTED = reduce(lambda inside, g: Mixture((0.5, 0.5), (inside, HenyeyGreenstein(g))), [0.5] * 6, Isotropic())
ALL = pytest.mark.parametrize("phase", [PETZOLD, FORAND, SEA], ids=["table", "Fournier-Forand", "mixture"])
STRATA = 2 * 10**6


def below(phase, u):
    """Share of all scatterings with 1 - c < u, without the rounding of a cosine."""
    if isinstance(phase, Mixture):
        return sum(weight * below(one, u) for weight, one in zip(phase.weights, phase.phases, strict=True))
    if isinstance(phase, Tabulated):
        return phase.pieces.below(u)
    return phase._below(u) if isinstance(phase, FournierForand) else 1 - phase.invert(1 - u)


def apart(drawn, phase):
    """Largest distance of the cumulative distribution of what was drawn, 1 - c, from that of the phase function."""
    share = below(phase, np.sort(np.asarray(drawn, np.float64)))
    steps = np.arange(share.size + 1) / share.size
    return max(np.max(steps[1:] - share), np.max(share - steps[:-1]))


def drawn(phase, v):
    return jax.jit(lambda phase, v: phase.deflection(v)[0])(phase.for_kernel(), v)


@pytest.mark.parametrize(
    ("phase", "most"),
    # Each of three terms may gain or lose a stratum at its end.
    [(PETZOLD, 1e-6), (FORAND, 1e-6), (SEA, 1e-6), (ANY, 3 / STRATA + 1e-6)],
    ids=["table", "Fournier-Forand", "mixture", "mixture of any"],
)
def test_stratified_draws_of_a_kernel(phase, most):
    v = (2 * (np.arange(STRATA) + 0.5) / STRATA - 1).astype(np.float32)
    assert apart(drawn(phase, v), phase) < most
    assert apart(drawn(HenyeyGreenstein(0.924), v), phase) > 1e-3


@ALL
def test_density_and_share_are_one_function(phase):
    """Integrated over ln u, where a forward peak is wide."""
    density = phase.pieces.value if isinstance(phase, Tabulated) else lambda u: 2 * np.pi * phase.pdf(1 - u)
    for low, high in ((1e-9, 1e-6), (1e-4, 2e-4), (0.01, 0.3), (0.9, 1.1), (1.5, 2.0)):
        u = np.geomspace(low, high, 200_001)
        inside = np.trapezoid(density(u) * u, np.log(u))
        assert below(phase, high) - below(phase, low) == pytest.approx(inside, rel=1e-6, abs=1e-11)
    assert below(phase, 2.0) == pytest.approx(1, abs=1e-12)


@ALL
def test_moments_and_sample(phase):
    xi = np.linspace(0.0, 0.9, 1001)
    cosine = phase.sample(xi)
    assert np.all(np.diff(cosine) > 0)
    np.testing.assert_allclose(phase.invert(cosine), xi, atol=1e-6)
    assert phase.moment(0) == pytest.approx(1, abs=1e-9)
    strata = (np.arange(10**6) + 0.5) / 10**6
    assert phase.mean_cosine == pytest.approx(np.mean(1 - phase.deflection(2 * strata - 1)[0]), abs=2e-6)


def test_petzolds_mean():
    """What Mobley et al. and others report of it; 5 % of the light goes on within 0.1 degrees."""
    assert PETZOLD.mean_cosine == pytest.approx(0.924, abs=5e-4)
    assert PETZOLD.invert(0.0) == pytest.approx(0.0183, abs=1e-4)
    assert PETZOLD.pieces.below(2 * np.sin(np.radians(0.05)) ** 2) == pytest.approx(0.052, abs=1e-3)


def test_a_table_of_a_known_function():
    """Rows at 0 and at 180 degrees, a row of zero."""
    angles = np.linspace(0, np.pi, 721)
    table, known = Tabulated(angles, HenyeyGreenstein(0.7).pdf(np.cos(angles))), HenyeyGreenstein(0.7)
    for order in range(6):
        assert table.moment(order) == pytest.approx(known.moment(order), abs=2e-5)
    half = Tabulated(angles, np.where(angles < np.pi / 2, 1 / (2 * np.pi), 0.0))
    assert (half.invert(-0.1), half.mean_cosine) == (0, pytest.approx(0.5, abs=5e-3))
    assert np.all(half.sample(np.linspace(0, 1, 101)) > -0.01)


def test_fournier_and_forand_where_delta_is_one():
    """The closed form is 0 / 0 there: 8e-3 of the turns of this one."""
    u = 2 / FORAND._largest * np.array([1 - 1e-9, 1.0, 1 + 1e-9])
    values = FORAND._density(u)
    assert np.ptp(values) < 1e-8 * values[0]
    around = FORAND._density(2 / FORAND._largest * np.exp([-0.0501, -0.0499, 0.0499, 0.0501]))
    assert np.all(np.abs(np.diff(np.log(around))[[0, 2]]) < 4e-4)


def test_a_term_of_all_the_weight_is_that_term():
    one = HenyeyGreenstein(0.9)
    for mixture in (Mixture((1, 0), (one, HenyeyGreenstein(0.1))), Mixture((0, 1), (Isotropic(), one))):
        v = np.linspace(-1, 1, 1001, dtype=np.float32)
        np.testing.assert_array_equal(mixture.for_kernel().deflection(v)[0], one.for_kernel().deflection(v)[0])
        assert mixture.simplest == one
        assert Layer(1.0, 0.1, 1.0, 0.0, phase=mixture) == Layer(1.0, 0.1, 1.0, 0.9)
        assert Setting(phase=mixture) == Setting(g=0.9)


@ALL
def test_tables_of_files(phase):
    again = from_table(as_table(phase))
    assert again == phase
    assert hash(again) == hash(phase)
    setting = Setting("diffuse", n=1.3, phase=phase)
    assert Setting.of(setting.as_table()) == setting
    assert Setting().as_table() == {"illumination": "searchlight", "n": 1.0, "g": 0.0}


def test_a_layer_has_one_phase_function():
    layer = Layer(1.3, 0.1, 1.0, 0.5, phase=SEA)
    assert (layer.g, layer.similar) == (pytest.approx(SEA.mean_cosine), Layer(1.3, 0.1, 1 - SEA.mean_cosine, 0.0))
    assert Layer(1.3, 0.1, 1.0, 0.0, phase=HenyeyGreenstein(0.8)) == Layer(1.3, 0.1, 1.0, 0.8)
    assert Layer(1.3, 0.1, 1.0, 0.3, phase=Isotropic()) == Layer(1.3, 0.1, 1.0, 0.0)
    # One without a preferred mean is not isotropic.
    both = Mixture((0.5, 0.5), (HenyeyGreenstein(0.5), HenyeyGreenstein(-0.5)))
    assert Setting(phase=both).g == 0
    assert not Setting(phase=both).is_matched_isotropic
    refused("exact light needs n >= 1 where g = 0", exact.reflectance, 0.5, Setting(phase=both), error=SettingError)
    refused("must scatter with g = 0", exact.solve, Medium((Layer(1.0, 0.1, 1.0, 0.0, phase=both),)))


def rows(**changed):
    angles = np.linspace(0, np.pi, 100)
    return {"angles": angles, "values": np.full(100, 1 / (4 * np.pi)), **changed}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Mixture((0.5, 0.6), (Isotropic(), Isotropic())), "weights must sum to 1, got 1.1"),
        (lambda: Mixture((1.5, -0.5), (Isotropic(), Isotropic())), r"weights must be shares in \[0, 1\], got 1.5"),
        (lambda: Mixture((1.0,), (Isotropic(), Isotropic())), "a weight for each, got 1 weights and 2 phases"),
        (lambda: Mixture((1.0,), (0.9,)), "phases must be phase functions, got 0.9"),
        (lambda: Mixture(1.0, Isotropic()), "weights must be a list, got 1.0"),
        (lambda: Mixture((), ()), "1 to 64 phases"),
        (lambda: Mixture((float("nan"), 1), (Isotropic(), Isotropic())), "weights must be shares"),
        (lambda: Tabulated(**rows(values=np.ones(100))), r"integral over all directions is 1, got 12\.57"),
        (lambda: Tabulated(**rows(angles=np.linspace(0, 180, 100))), "angles must be in radians, at most pi, got 180"),
        (lambda: Tabulated(**rows(angles=np.zeros(100))), "angles must rise"),
        (lambda: Tabulated(**rows(values=np.full(100, -1.0))), "values must be densities >= 0, got -1"),
        (lambda: Tabulated(**rows(values=np.where(np.arange(100) == 7, np.nan, 0.08))), "finite, got nan in row 8"),
        (lambda: Tabulated(**rows(values=np.ones(9))), "as many as angles, got 9 and 100"),
        (lambda: Tabulated([0.1, 0.2, 3.0], [1e3, 1.0, 1e-6]), "integral over all directions is 1, got"),
        (lambda: FournierForand(0.9, 3.5), r"n must be in \(1, 2\), got 0.9"),
        (lambda: FournierForand(1.1, 5.0), r"mu must be in \(3, 5\), got 5.0"),
        (lambda: Layer(1.0, 0.1, 1.0, 0.0, phase=0.9), "phase must be a phase function of mcml_sim.phase, got 0.9"),
        (lambda: Setting(phase="sea"), "phase must be a phase function of mcml_sim.phase, got 'sea'"),
        (lambda: from_table({"kind": "rayleigh"}), "kind of a phase function must be one of isotropic, "),
        (lambda: from_table({"kind": "mixture", "weights": [1]}), "must have weights, phases, got weights"),
        (lambda: from_table([]), r"a phase function must be a table, got \[\]"),
        (lambda: from_table(as_table(NESTED)), "at most 4 levels"),
    ],
)
def test_bad_input_in_one_line(make, message):
    refused(message, make)
