"""The tables of samplers say what was measured, the worst last."""

import io
from dataclasses import fields

import numpy as np
from rich.console import Console

from profilefit.fitting.sampling import SamplerQuality
from profilefit.report.tables.law_tables import sampler_tables


def rendered(width: int, **given) -> list[str]:
    alpha = np.array([0.5, 0.9])
    measures = {field.name: np.zeros(2) for field in fields(SamplerQuality)}
    quality = SamplerQuality(**(measures | {"alpha": alpha} | {name: np.array(v) for name, v in given.items()}))
    console = Console(width=width, file=io.StringIO(), highlight=False, color_system=None)
    for part in sampler_tables({"a sampler": quality}):
        console.print(part)
    return console.file.getvalue().splitlines()


def test_numbers_the_worst_last_and_infinity():
    lines = rendered(
        100, edge_bias=[-0.125, 0.01], bias_by_law_pdf=[0.0, np.inf], atom=[0.0154, 0.0], variance=[3e-7, 8.33]
    )
    assert lines[0] == "Sampler: a sampler"
    rows = {line.split()[0]: line.split()[1:] for line in lines[3:6]}
    assert rows["0.500"] == ["0", "0.015", "0", "0", "-0.12", "0", "0"]
    assert rows["0.900"] == ["0", "0", "0", "∞", "0.010", "0", "8.3"]
    assert rows["worst"] == ["0", "0.015", "0", "∞", "-0.12", "0", "8.3"]


def test_a_narrow_screen_cuts_nothing():
    lines = rendered(80, edge_bias=[-0.1234, 1e-5], variance=[0.1, 123.0])
    assert max(map(len, lines)) <= 80
    assert "…" not in "".join(lines)
