"""The referee of Blender's methods: exact light by the direction of entry, the fit, and messages without Blender."""

import sys

import numpy as np
import pytest

from benchmarks import blender, entering
from mcml_sim import Setting, exact
from profilefit.scenes.stage.reference.step_edge import step_response

DISTANCES = np.array([0.05, 0.3, 2.0, 8.0])
ENTRIES = {"searchlight": entering.refracted(1.4, 0.0), "diffuse": entering.cosine_weighted()}


@pytest.mark.parametrize("illumination", ["searchlight", pytest.param("diffuse", marks=pytest.mark.slow)])
def test_entry_has_both_illuminations_as_limits(illumination):
    setting, entry = Setting(illumination), ENTRIES[illumination]
    for alpha in (0.6, 0.99):
        assert entering.reflectance(alpha, entry) == pytest.approx(exact.reflectance(alpha, setting), abs=1e-5)
    dark = entering.dark_edge(0.9, entry)(np.log(DISTANCES))
    np.testing.assert_allclose(dark, step_response(-DISTANCES, 0.9, setting=setting), atol=3e-5)


def test_orders_of_scattering_end_where_asked():
    """Single scattering of diffuse light returns 2/3 (1 - ln 2) alpha."""
    entry = ENTRIES["diffuse"]
    once = 0.8 * 2.0 / 3.0 * (1.0 - np.log(2.0))
    assert entering.reflectance(0.8, entry, most=1) == pytest.approx(once, abs=1e-5)
    assert entering.reflectance(0.8, entry, most=400) == pytest.approx(entering.reflectance(0.8, entry), abs=1e-6)


def test_refraction_narrows_the_entry():
    """Facets of every slope refract a normal ray by at most 90 degrees less the critical angle."""
    entry = entering.refracted(1.4, 1.0, count=64)
    assert (entry.cosine.min(), entry.share.sum()) == (pytest.approx(1.0 / 1.4, abs=0.02), pytest.approx(1.0))
    assert np.all(entering.refracted(1.4, 0.0).cosine == 1.0)


def test_fit_finds_the_length_of_a_noisy_edge():
    """Pixels are means over their width, so a coarse picture has the length too."""
    edge = blender.exact_edge(0.9, "diffuse")
    half_width, length = 4.0, 0.7
    bounds = np.linspace(-half_width, half_width, 41)
    nodes, weights = entering.unit_nodes(6)
    lit = np.asarray(step_response(bounds[:-1, None] + 0.2 * nodes, 0.9, length, Setting("diffuse"))) @ weights
    noise = 0.004 * np.random.default_rng(1).standard_normal(40)
    a, found, residuals = blender.fitted(0.45 * (lit + noise), half_width, edge)
    assert (a, found) == (pytest.approx(0.45, rel=0.005), pytest.approx(length, rel=0.03))
    assert np.std(residuals) == pytest.approx(0.004, rel=0.3)


def test_without_blender_it_is_skipped_by_name(monkeypatch, capsys):
    monkeypatch.delenv(blender.VARIABLE, raising=False)
    monkeypatch.setattr(blender, "find_spec", lambda name: None)
    blender.main([])
    assert capsys.readouterr().out.startswith("skipped: no Python with Blender's package bpy; name one with --python")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", "1"], "--seeds must be from 2 to 1000, got 1"),
        (["--python", "/no/such/python"], "got /no/such/python: No such file or directory"),
        (["--python", sys.executable], "No module named 'bpy'"),
    ],
)
def test_mistakes_are_named(arguments, message, capsys):
    with pytest.raises(SystemExit, match=r"^2$"):
        blender.main(arguments)
    assert message in capsys.readouterr().err
