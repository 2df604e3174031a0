"""What float32 loses of a stack's text, and what it costs: both tables, small."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import stack_source
from profilefit.shader.check import law_cost
from tests.unit.shader.test_stack_text import LAWS, media


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(stack_source, "RADII", np.geomspace(1e-3, 100.0, 20))
    monkeypatch.setattr(stack_source, "DIRECTIONS", 50)
    monkeypatch.setattr(law_cost, "ENOUGH", 0.0)
    monkeypatch.setattr(law_cost, "TURNS", 1)
    monkeypatch.setattr(law_cost, "SIZE", (16, 16))


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
    found = stack_source.rounding(context, LAWS["two layers, matched"], media(2))
    assert min(found) > 1e-2


def test_without_records_one_line_says_so(capsys, tmp_path):
    stack_source.main(["--fits", str(tmp_path)])
    printed = capsys.readouterr().out
    assert printed.startswith(f"{tmp_path / 'stacks'} has no record of a stack: `profilefit regenerate")
    assert printed.count("\n") == 1
