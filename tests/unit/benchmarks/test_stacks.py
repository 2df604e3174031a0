"""Stacks that laws are judged by, the paper's misprints, what float32 loses of a stack's text, and what it costs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import stack_source, stacks, zhao
from profilefit.scenes.layers.law import single_scattering
from profilefit.shader.check import law_cost
from tests.unit.shader.test_stack_text import LAWS, media


def test_random_stacks_lie_where_it_is_said():
    every = [stacks.random_stack(number) for number in range(200)]
    assert stacks.random_stack(3) == every[3]
    assert {len(medium.layers) for medium in every} == {2, 3, 4}
    layers = [layer for medium in every for layer in medium.layers]
    alpha, thick = np.array([(one.alpha, one.thickness / one.mfp) for one in layers]).T
    assert 0.3 <= alpha.min() < 0.4 < 0.99 < alpha.max() <= 0.999
    finite = thick[np.isfinite(thick)]
    assert 0.1 <= finite.min() < 0.2 < 2.5 < finite.max() <= 3.0
    assert all(1.0 <= layer.n <= 1.5 for layer in layers)
    assert sum(len(stacks.stacks(channel)) for channel in range(3)) == 12


def test_misprints_cost_and_corrections_converge():
    """Error of Zhao et al.'s sum with 4 and 16 samples over twelve stacks, g = 0: as printed, each misprint, none."""
    every = [medium for channel in range(3) for medium in stacks.stacks(channel).values()]
    exact = [float(single_scattering(medium, 0.7, 0.5, 1.0)) for medium in every]

    def error(corrections, samples):
        sums = [zhao.single_sum(one, 0.7, 0.5, 1.0, samples, 6.0 * one.layers[0].mfp, corrections) for one in every]
        return float(np.sqrt(np.mean((np.array(sums) / exact - 1) ** 2)))

    corrected = error(zhao.CORRECTED, 16)
    assert corrected < 0.1 < error(zhao.CORRECTED, 4)
    assert error(zhao.PRINTED, 16) > 10
    misprints = [name for name in zhao.Corrections.switches() if name != "dipole_sign"]
    errors = [error(replace(zhao.CORRECTED, **{name: False}), 16) for name in misprints]
    assert sum(one > 2 * corrected for one in errors) == 4  # all but those of the phase function, unseen at g = 0


@pytest.fixture
def small(monkeypatch):
    few = {"RADII": np.geomspace(1e-3, 100.0, 20), "DIRECTIONS": 50}
    for module, sizes in ((stack_source, few), (law_cost, {"ENOUGH": 0.0, "TURNS": 1, "SIZE": (16, 16)})):
        for name, size in sizes.items():
            monkeypatch.setattr(module, name, size)


@pytest.mark.slow
def test_both_tables(context, small):
    laws = LAWS["three layers"]
    stack = SimpleNamespace(names=("a", "b", "c"), media=media(3))
    record = SimpleNamespace(name="skin", setting=laws[0].setting, laws=laws, stack=stack)
    (errors,), (costs,) = stack_source.rows(context, [record])
    assert errors[0] == costs[0] == "skin, 3 layers, searchlight, n = 1.4, g = 0"
    assert all(0.0 < float(cell) < 3e-5 for cell in errors[1:])
    assert len(costs) == 2 + len(stack_source.WORKS)
    assert all(float(cell) > 0.0 for cell in costs[1:])


def test_a_text_that_differs_is_seen(context, small, monkeypatch):
    """Negative control: the float64 text of other layers."""
    texts = stack_source.stack_text, stack_source.single_text
    other = {"stack_text": LAWS["two layers"], "single_text": media(2, g=0.9)}
    for (name, instead), text in zip(other.items(), texts, strict=True):

        def swapped(given, lang="glsl", name="", instead=instead, text=text):
            return text(given if lang == "glsl" else instead, lang, name)

        monkeypatch.setattr(stack_source, name, swapped)
    assert min(stack_source.rounding(context, LAWS["two layers, matched"], media(2))) > 1e-2


def test_without_records_one_line_says_so(capsys, tmp_path):
    stack_source.main(["--fits", str(tmp_path)])
    printed = capsys.readouterr().out
    assert printed.startswith(f"{tmp_path / 'stacks'} has no record of a stack: `profilefit regenerate")
    assert printed.count("\n") == 1
