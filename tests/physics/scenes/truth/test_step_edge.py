"""The step edge against a plane sum that knows nothing of circles, a closed case, and its own nodes."""

import numpy as np
import pytest
from scipy.special import erf

import profilefit
from mcml_sim import Setting, exact
from profilefit.errors import InputError, SettingError
from profilefit.laws.gaussians import law_class
from profilefit.scenes.stage import step_edge
from profilefit.scenes.stage.step_edge import step_response

DIFFUSE = Setting("diffuse")
PLACES = np.array([-30.0, -4.0, -0.5, -1e-3, -1e-7, 0.0, 1e-4, 0.03, 1.0, 4.0])


def plane_sum(distance, alpha, setting):
    """The share from beyond a straight edge: R_d / A over x > distance and all y, by Gauss panels on squares."""
    ends = np.concatenate([[0.0], np.geomspace(0.05, 120.0, 24)])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    along = (ends[:-1, None] + 0.5 * np.diff(ends)[:, None] * (nodes + 1.0)).ravel()
    share = (0.5 * np.diff(ends)[:, None] * weights).ravel()
    r = np.hypot(distance + along[:, None], along)
    profile = exact.profile(r, alpha, setting=setting) / exact.reflectance(alpha, setting)
    return 2.0 * share @ profile @ share


@pytest.mark.slow
@pytest.mark.parametrize("setting", [Setting(), DIFFUSE], ids=str)
def test_is_the_sum_over_the_lit_half_plane(setting):
    found = step_response(-0.5, 0.9, setting=setting)
    assert found == pytest.approx(plane_sum(0.5, 0.9, setting), abs=1e-8)
    assert step_response(0.5, 0.9, setting=setting) == pytest.approx(1.0 - found, abs=1e-15)
    other = DIFFUSE if setting == Setting() else Setting()
    assert abs(found - step_response(-0.5, 0.9, setting=other)) > 1e-3


def test_one_gaussian_is_an_error_function(normalisation):
    law = law_class(1)(Setting(), normalisation, f1=0.0, f2=0.0, v1=np.log(0.7**2))
    x = np.append(PLACES, [-2.1, 0.7])
    np.testing.assert_allclose(step_response(x, 0.5, law=law), 0.5 + 0.5 * erf(x / (0.7 * 2**0.5)), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [None, ("hazard", "regenerated"), ("liang", "corrected"), ("gaussians:4", "regenerated")]
)
def test_more_nodes_change_nothing(law, monkeypatch):
    alphas = np.array([[1e-6], [0.5], [0.95], [1.0]] if law is None or law[0] != "liang" else [[0.05], [0.95], [1.0]])
    chosen = law and profilefit.load(*law)
    coarse = step_response(PLACES, alphas, law=chosen)
    monkeypatch.setattr(step_edge, "NODES", 2 * step_edge.NODES)
    np.testing.assert_allclose(coarse, step_response(PLACES, alphas, law=chosen), atol=1e-8)
    monkeypatch.setattr(step_edge, "NODES", 1)  # the comparison can fail
    assert np.max(np.abs(coarse - step_response(PLACES, alphas, law=chosen))) > 1e-5


@pytest.mark.slow
def test_ends_symmetry_and_units():
    assert step_response(0.0, 0.8) == 0.5
    assert step_response(-1e6, 0.8) == 0.0
    assert step_response(1e6, 0.8) == 1.0
    # White light falls off as x^-3: beyond 1e7 mfp its last 1e-7 is given up.
    assert step_response(-1e5, 1.0) * 1e5 == pytest.approx(step_response(-1e4, 1.0) * 1e4, rel=1e-3)
    x = np.linspace(-3.0, 3.0, 7)
    found = step_response(x, [[0.3], [0.9]])
    assert found.shape == (2, 7)
    assert np.all(np.diff(found) > 0)
    np.testing.assert_allclose(found + found[:, ::-1], 1.0, atol=1e-15)
    np.testing.assert_allclose(step_response(2.5 * x, 0.9, 2.5), found[1], atol=1e-15)
    assert isinstance(step_response(1.0, 0.5), float)


@pytest.mark.slow
def test_bias_of_the_project_law_is_small():
    """Within 4 mfp of the edge, at most 0.3 % of A; a published law has more."""
    x = np.linspace(-4.0, 4.0, 41)
    alphas = np.array([[0.5], [0.8], [0.95], [0.99]])
    for setting in (Setting(), DIFFUSE, Setting(n=1.4, g=0.8)):
        truth = step_response(x, alphas, setting=setting)
        assert np.max(np.abs(step_response(x, alphas, law=profilefit.load("hazard", setting=setting)) - truth)) < 0.003
    published = profilefit.load("burley", "published")
    assert np.max(np.abs(step_response(x, alphas, law=published) - step_response(x, alphas))) > 0.003


def test_misuse():
    with pytest.raises(InputError, match="alpha must be a single-scattering albedo"):
        step_response(1.0, 1.5)
    with pytest.raises(InputError, match="x must be a finite place, got inf"):
        step_response(np.inf, 0.5)
    with pytest.raises(InputError, match="mfp must be a mean free path > 0, got 0"):
        step_response(1.0, 0.5, 0.0)
    with pytest.raises(SettingError, match="the law belongs to searchlight"):
        step_response(1.0, 0.5, setting=DIFFUSE, law=profilefit.load("hazard"))
    with pytest.raises(SettingError, match="give a law of that setting"):
        step_response(1.0, 0.5, setting=Setting(n=0.9))
