"""What a recipe names: where albedos, rings and fits begin, its photons, and what its laws are judged with."""

import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from profilefit.errors import RecipeError
from profilefit.laws import published
from profilefit.laws.refracting_rational import RefractingRational
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.pipelines import inversion_error, needs_photons, printed_sets
from profilefit.recipes.recipe import Albedos, RingLayout
from profilefit.recipes.targets import RUN_EDGES, albedo_values, require_known, ring_edges, starting_law, truth_of

FITS = catalogue.fits_folder()


@pytest.mark.parametrize(
    ("spacing", "even"),
    [
        ("alpha", lambda a: a),
        ("sqrt(1-alpha)", lambda a: np.sqrt(1 - a)),
        ("reflectance", lambda a: np.asarray(exact.reflectance(a))),
    ],
)
def test_albedos_are_even_in_their_spacing(spacing, even):
    alpha = albedo_values(Albedos(low=0.1, high=0.99, count=12, spacing=spacing))
    assert alpha[[0, -1]] == pytest.approx([0.1, 0.99], abs=1e-6)
    steps = np.diff(even(alpha))
    # The table behind the spacing in A is linear between 4001 nodes: its steps are even to 1e-4.
    assert steps == pytest.approx(np.full(11, steps.mean()), rel=1e-3)


def test_rings_are_edges_of_the_run():
    for rings in (RingLayout(last=20.0, dr=0.05), RingLayout(last=100.0, first=0.01, count=34)):
        edges = ring_edges(rings)
        assert set(edges) <= set(RUN_EDGES)
        assert edges[0] == 0.0
        assert edges[-1] == pytest.approx(rings.last, rel=0.05)
    assert np.diff(ring_edges(RingLayout(last=20.0, dr=0.05), mfp=0.5)) == pytest.approx(0.1)
    assert np.diff(ring_edges(RingLayout(last=20.0, dr=0.05), mfp=5.0)) == pytest.approx(0.01)


@pytest.mark.parametrize("rings", [RingLayout(last=20.0, dr=0.013), RingLayout(last=60.0, dr=0.05)])
def test_rings_that_the_run_cannot_make_are_refused(rings):
    with pytest.raises(RecipeError, match=r"rings.dr / mfp must be a multiple of 0.01 up to 40 mfp, got 0.0"):
        ring_edges(rings)


def test_photons_and_exact_truth_agree_on_a_recipes_rings():
    chosen = recipe.find("liang-whole", FITS)
    light = simulate_orders(Grid.from_edges(r=RUN_EDGES), 2**19, seed=11)
    photons, exactly = truth_of(chosen, light), truth_of(chosen.changed(truth="exact"), None)
    assert photons.source == "orders"
    assert exactly.source == "exact"
    # Where fewer photons arrive, the heavy ones may be missing, and the standard error with them: z is far from normal.
    seen = photons.effective_samples >= 500
    error = photons.standard_error[seen]
    z = (photons.energy - exactly.energy)[seen] / error
    # Some 500 rings, strongly correlated between albedos: 4.5 is the Šidák bound of 500 independent ones at 0.3 %.
    assert np.max(np.abs(z)) < 4.5
    # A negative control: a tally that lost one photon in twenty would be seen.
    lost = (0.95 * photons.energy - exactly.energy)[seen] / error
    assert np.max(np.abs(lost)) > 4.5


def test_the_starting_law_belongs_to_the_recipes_setting(tmp_path):
    """Printed constants of the searchlight are numbers to start from elsewhere too."""
    chosen = recipe.find("burley-whole", FITS).changed(setting_table={"illumination": "diffuse", "n": 1.4})
    law = starting_law(chosen, tmp_path)
    assert law.constants() == published.constants("burley", "published")
    assert (law.setting, law.albedo.setting) == (chosen.setting, chosen.setting)
    mapped = starting_law(recipe.find("albedo-rational-refracting", FITS), tmp_path)
    assert mapped.setting == Setting(n=1.4)
    assert mapped.constants() == RefractingRational.entry.start


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": "old"}, r"start must be one of published, diffuse.*, got 'old'"),
        ({"start": "none"}, r"start must be one of published, diffuse.*, got 'none'"),
        ({"law": "rational"}, r"law must be one of liang, burley.*, got 'rational'"),
        ({"held": ("s0", "s1", "s2", "s3")}, r"held leaves no constant of burley free"),
        ({"held": ("q",)}, r"held must name constants of burley, got q"),
        ({"pipeline": "evidence", "truth": "orders"}, r"truth of pipeline 'evidence' must be 'exact', got 'orders'"),
    ],
    ids=str,
)
def test_what_a_recipe_must_name(change, words):
    with pytest.raises(RecipeError, match=words):
        require_known(recipe.find("burley-whole", FITS).changed(**change))


def test_inversion_error_is_zero_for_an_exact_sampler_and_not_for_the_papers():
    class Exactly:
        setting = Setting()

        class sampler:
            sample = staticmethod(lambda xi, alpha: exact.quantile(xi, alpha))

    alpha = np.array([0.3, 0.9])
    assert inversion_error(Exactly(), alpha) == pytest.approx([0, 0], abs=1e-8)
    assert np.all(inversion_error(catalogue.load("liang", "published"), alpha) > 0.03)


def test_printed_sets_are_those_of_the_recipes_setting():
    burley = recipe.find("burley-whole", FITS)
    searchlight, diffuse = printed_sets(burley), printed_sets(burley.changed(setting_table={"illumination": "diffuse"}))
    assert searchlight["published"]["s0"] == 1.85
    assert diffuse["published"]["s0"] == 1.9
    assert printed_sets(burley.changed(setting_table={"n": 1.4})) == {}
    assert set(printed_sets(recipe.find("liang-whole", FITS))) == {"published", "corrected"}


def test_who_needs_photons():
    orders, exactly = recipe.find("albedo-liang", FITS), recipe.find("albedo-rational", FITS).changed(check="")
    assert needs_photons(orders)
    assert not needs_photons(exactly)
    assert needs_photons(exactly.changed(check="orders"))
