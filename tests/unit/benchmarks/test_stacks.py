"""Stacks that laws are judged by, and the table of the paper's misprints."""

import numpy as np

from benchmarks import paper_sum, stacks


def test_random_stacks_lie_where_it_is_said():
    media = [stacks.random_stack(number) for number in range(200)]
    assert stacks.random_stack(3) == media[3]
    assert {len(medium.layers) for medium in media} == {2, 3, 4}
    layers = [layer for medium in media for layer in medium.layers]
    alpha, thick = np.array([(one.alpha, one.thickness / one.mfp) for one in layers]).T
    assert 0.3 <= alpha.min() < 0.4 < 0.99 < alpha.max() <= 0.999
    finite = thick[np.isfinite(thick)]
    assert 0.1 <= finite.min() < 0.2 < 2.5 < finite.max() <= 3.0
    assert all(1.0 <= layer.n <= 1.5 for layer in layers)
    assert sum(len(stacks.stacks(channel)) for channel in range(3)) == 12


def test_misprints_cost_and_corrections_converge(monkeypatch):
    monkeypatch.setattr(paper_sum, "SAMPLES", (4, 16))
    monkeypatch.setattr(paper_sum, "IN", (0.7,))
    monkeypatch.setattr(paper_sum, "OUT", (0.5,))
    table = {label: [float(cell) for cell in cells] for label, *cells in paper_sum.rows(0.0)}
    assert table["corrected"][1] < 0.1 < table["corrected"][0]
    assert table["as printed"][1] > 10
    worse = [name for name, (_, fine) in table.items() if fine > 2 * table["corrected"][1]]
    assert len(worse) == 5  # all but those of the phase function, of which nothing is seen at g = 0
