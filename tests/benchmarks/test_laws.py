"""Costs and errors of a few laws, small."""

import jax
import jax.numpy as jnp
import numpy as np

import profilefit
from benchmarks import contenders, law_figure, laws
from benchmarks.stopwatch import Ratio

SMALL = laws.Sizes(points=2000, costly=200, albedos=1000, turns=2, judged=2)


def test_fast_forms_are_the_laws():
    """In float32, as they are timed."""
    alpha = jnp.array([[0.1], [0.8], [0.99]])
    x, xi = jnp.geomspace(0.01, 5.0, 50), jnp.linspace(0.01, 0.99, 50)
    law = profilefit.load("burley", "published")
    for contender, sampler in zip(contenders.made(contenders.YARDSTICK, law), ("exact", "xie"), strict=True):
        profile, drawn = jax.jit(lambda c=contender: (c.profile(x, alpha), c.sample(xi, alpha)))()
        np.testing.assert_allclose(profile, law.scaled_profile(x, alpha), rtol=1e-5)
        np.testing.assert_allclose(drawn, law.samplers[sampler].scaled_sample(xi, alpha), rtol=2e-5, atol=1e-6)
    (quantile,) = contenders.made("quantile", profilefit.load("quantile"))
    drawn, profile = jax.jit(lambda: quantile.both(xi, alpha))()
    np.testing.assert_allclose(drawn, jax.jit(lambda: quantile.sample(xi, alpha))(), rtol=1e-6)
    np.testing.assert_allclose(profile, jax.jit(lambda: quantile.profile(drawn, alpha))(), rtol=1e-5)


def test_fast_pdf_is_that_of_the_law():
    law = profilefit.load("burley", "published")
    fast = next(contenders.made(contenders.YARDSTICK, law))
    r = np.geomspace(0.01, 5.0, 9)
    np.testing.assert_allclose(fast.sampler.pdf(r, 0.8), law.sampler.pdf(r, 0.8), rtol=1e-12)


def test_costly_samplers_are_not_timed():
    (beam,) = contenders.made("beam", profilefit.load("beam_diffusion", "published"))
    counted = laws.counts(beam)
    assert counted["profile"].transcendental > laws.MANY
    works = laws.works(beam, counted, SMALL)
    assert set(works) == {"profile"}
    assert works["profile"](0) == SMALL.costly


def test_front():
    costs, errors = [1.0, 2.0, 2.0, 3.0, 0.5, 3.0], [0.5, 0.4, 0.3, 0.3, 0.9, 0.1]
    best = law_figure.front(costs, errors)
    assert best == [4, 0, 2, 5]
    beaten = [
        any(costs[j] <= costs[i] and errors[j] <= errors[i] and j != i for j in range(len(costs)))
        for i in range(len(costs))
    ]
    assert sorted(best) == [i for i, b in enumerate(beaten) if not b]
    assert law_figure.front([1.0, 1.0], [0.2, 0.2]) == [0]
    assert law_figure.front([], []) == []


def test_labels_keep_off_each_other_and_inside(tmp_path, monkeypatch):
    points = [law_figure.Point(f"law number {i}", 1.0 + 0.02 * i, 0.05, 0.1) for i in range(4)]
    placed = []
    monkeypatch.setattr(law_figure, "_crowding", _recorded(law_figure._crowding, placed))
    law_figure.draw({"one": points, "other": points[:1]}, tmp_path / "front.svg")
    assert len(placed) == 5
    assert max(placed) == 0.0


def _recorded(crowding, least):
    """Append the least crowding of each label, whose places are tried one after the other."""
    tried = []

    def called(*arguments):
        tried.append(crowding(*arguments))
        if len(tried) == len(law_figure.PLACES):
            least.append(min(tried))
            tried.clear()
        return crowding(*arguments)

    return called


def test_many_functions_are_summed():
    (dipole,) = contenders.made("dipole", profilefit.load("dipole", "published"))
    ratios = {part: Ratio(2.0, 1.0, 3.0) for part in laws.PARTS}
    row = laws.Row(dipole, laws.counts(dipole), ratios, None, np.array([0.1]), np.array([0.2]))
    assert laws.as_cells(row)[1:4] == ("0", "2 exp, 2 sqrt", "162 in all")
    assert laws.as_errors(row) == ("dipole", "0.1", "0.1", "0.2", "0.2")
