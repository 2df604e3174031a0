"""Every formula that Zhao et al. print, as printed beside as read."""

from dataclasses import replace

import numpy as np
import pytest

import profilefit
from benchmarks import zhao as paper
from benchmarks.zhao import CORRECTED, PRINTED, Corrections
from mcml_sim import Layer, Medium, Setting, half_space
from mcml_sim.exact.single_scattering import entered
from mcml_sim.media.phase import HenyeyGreenstein
from profilefit.errors import InputError
from profilefit.scenes.layers.law import single_scattering

STACK = Medium((Layer(1.3, 0.3, 4.0, 0.0, 0.2), Layer(1.3, 0.1, 2.0, 0.0)))


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


def test_extinction():
    """(6) and (9) by their names: exactly twice too bright at normal incidence, where nothing refracts."""
    medium = half_space(0.9)
    wrong = replace(CORRECTED, extinction=False)
    ratio = [paper.single_sum(medium, 1.0, 1.0, np.pi, 4096, 30.0, corrections) for corrections in (wrong, CORRECTED)]
    assert ratio[0] / ratio[1] == pytest.approx(2.0, rel=1e-4)


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


def test_surface():
    """(9): neither cosine nor Fresnel nor the narrowing of the beam."""
    medium, (cos_in, cos_out) = half_space(0.9, n=1.3), (1.0, 1.0)
    bare = paper.single_sum(medium, cos_in, cos_out, 0.0, 64, 6.0, replace(CORRECTED, surface=False))
    passed = (1 - (0.3 / 2.3) ** 2) ** 2 / 1.3**2
    assert paper.single_sum(medium, cos_in, cos_out, 0.0, 64, 6.0) == pytest.approx(passed * bare, rel=1e-9)


def test_weights():
    """(2): their sum is 1, though what they weigh is in one unit already, where each of them is 1."""
    assert sum(paper.WEIGHTS) == pytest.approx(1.0)
    assert len(paper.WEIGHTS) == 5


def test_every_misprint_has_a_switch_that_changes_something():
    tissue = Medium((Layer(1.3, 0.3, 4.0, 0.7, 0.2), Layer(1.3, 0.1, 2.0, 0.7)))
    for name in Corrections.switches():
        wrong = replace(CORRECTED, **{name: False})
        sums = [paper.single_sum(tissue, 0.7, 0.5, 1.0, 16, 1.4, corrections) for corrections in (wrong, CORRECTED)]
        dipoles = [float(paper.dipole(tissue, 0.1, corrections)) for corrections in (wrong, CORRECTED)]
        assert (sums[0] != sums[1]) != (dipoles[0] != dipoles[1]), name


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"samples": 0}, "samples must be a whole number >= 1"),
        ({"samples": 10**6}, "samples must be a whole number"),
        ({"deepest": np.inf}, "deepest must be a depth > 0"),
        ({"medium": Medium((Layer(1.3, 1, 1, 0, 1), Layer(1.4, 1, 1, 0)))}, "one index in all layers"),
    ],
)
def test_refused(given, message):
    arguments = {"medium": STACK, "cos_in": 1.0, "cos_out": 1.0, "azimuth": 0.0, "samples": 8, "deepest": 1.0, **given}
    with pytest.raises(InputError, match=message):
        paper.single_sum(**arguments)
