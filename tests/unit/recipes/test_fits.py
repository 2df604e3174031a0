"""What a recipe names: where albedos, rings and fits begin, its photons; and random constants around such a start."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mcml_sim import Grid, Setting, exact, simulate_orders
from profilefit.errors import RecipeError
from profilefit.fitting.estimate import fit
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import CONVERGED, Solution
from profilefit.laws import published
from profilefit.laws.rational import RefractingRational
from profilefit.recipes import catalogue, checks, recipe, targets
from profilefit.recipes.pipelines import inversion_error, needs_photons, printed_sets
from profilefit.recipes.recipe import Albedos, RingLayout
from profilefit.recipes.targets import RUN_EDGES, albedo_values, require_known, ring_edges, starting_law, truth_of

FITS = catalogue.fits_folder()
SPACINGS = {"alpha": lambda a: a, "sqrt(1-alpha)": lambda a: np.sqrt(1 - a)}
SPACINGS |= {"reflectance": lambda a: np.asarray(exact.reflectance(a))}


def test_albedos_are_even_in_their_spacing_and_rings_are_edges_of_the_run():
    for spacing, even in SPACINGS.items():
        alpha = albedo_values(Albedos(low=0.1, high=0.99, count=12, spacing=spacing))
        assert alpha[[0, -1]] == pytest.approx([0.1, 0.99], abs=1e-6)
        steps = np.diff(even(alpha))
        # The table behind the spacing in A is linear between 4001 nodes: its steps are even to 1e-4.
        assert steps == pytest.approx(np.full(11, steps.mean()), rel=1e-3)
    even = RingLayout(last=20.0, dr=0.05)
    for rings in (even, RingLayout(last=100.0, first=0.01, count=34)):
        edges = ring_edges(rings)
        assert set(edges) <= set(RUN_EDGES)
        assert (edges[0], edges[-1]) == (0.0, pytest.approx(rings.last, rel=0.05))
    assert np.diff(ring_edges(even, mfp=0.5)) == pytest.approx(0.1)
    assert np.diff(ring_edges(even, mfp=5.0)) == pytest.approx(0.01)
    for rings in (RingLayout(last=20.0, dr=0.013), RingLayout(last=60.0, dr=0.05)):
        with pytest.raises(RecipeError, match=r"rings.dr / mfp must be a multiple of 0.01 up to 40 mfp, got 0.0"):
            ring_edges(rings)


def test_photons_and_exact_truth_agree_on_a_recipes_rings():
    chosen = recipe.find("liang-whole", FITS)
    light = simulate_orders(Grid.from_edges(r=RUN_EDGES), 2**19, seed=11)
    photons, exactly = truth_of(chosen, light), truth_of(chosen.changed(truth="exact"), None)
    assert (photons.source, exactly.source) == ("orders", "exact")
    # Where fewer photons arrive, the heavy ones may be missing, and the standard error with them: z is far from normal.
    seen = photons.effective_samples >= 500
    error = photons.standard_error[seen]
    # Some 500 rings, strongly correlated between albedos: 4.5 is the Šidák bound of 500 independent ones at 0.3 %.
    assert np.max(np.abs((photons.energy - exactly.energy)[seen] / error)) < 4.5
    # A negative control: a tally that lost one photon in twenty would be seen.
    assert np.max(np.abs((0.95 * photons.energy - exactly.energy)[seen] / error)) > 4.5


def test_starts_printed_sets_and_photons_are_those_of_the_recipe(tmp_path):
    """Printed constants of the searchlight are numbers to start from elsewhere too."""
    burley = recipe.find("burley-whole", FITS)
    chosen = burley.changed(setting_table={"illumination": "diffuse", "n": 1.4})
    law = starting_law(chosen, tmp_path)
    assert law.constants() == published.constants("burley", "published")
    assert (law.setting, law.albedo.setting) == (chosen.setting, chosen.setting)
    mapped = starting_law(recipe.find("albedo-rational-refracting", FITS), tmp_path)
    assert (mapped.setting, mapped.constants()) == (Setting(n=1.4), RefractingRational.entry.start)
    searchlight, diffuse = printed_sets(burley), printed_sets(burley.changed(setting_table={"illumination": "diffuse"}))
    assert (searchlight["published"]["s0"], diffuse["published"]["s0"]) == (1.85, 1.9)
    assert printed_sets(burley.changed(setting_table={"n": 1.4})) == {}
    assert set(printed_sets(recipe.find("liang-whole", FITS))) == {"published", "corrected"}
    orders, exactly = recipe.find("albedo-liang", FITS), recipe.find("albedo-rational", FITS).changed(check="")
    assert needs_photons(orders)
    assert not needs_photons(exactly)
    assert needs_photons(exactly.changed(check="orders"))


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
    exactly = SimpleNamespace(setting=Setting(), sampler=SimpleNamespace(sample=exact.quantile))
    alpha = np.array([0.3, 0.9])
    assert inversion_error(exactly, alpha) == pytest.approx([0, 0], abs=1e-8)
    assert np.all(inversion_error(catalogue.load("liang", "published"), alpha) > 0.03)


# Random starts


def test_random_constants_spread_as_the_rule_says():
    constants = np.array([2.0, -0.01, 0.0])
    found = checks.spread_out(constants, 20_000, seed=3)
    assert np.array_equal(found, checks.spread_out(constants, 20_000, seed=3))
    assert not np.array_equal(found, checks.spread_out(constants, 20_000, seed=4))
    factor = found[:, :2] / constants[:2]
    assert np.all(factor > 0)
    # Two of three within a factor of two: the normal's 0.6827, its error here 0.0033.
    assert np.mean(np.abs(np.log2(factor)) < 1, axis=0) == pytest.approx([0.6827, 0.6827], abs=0.013)
    assert np.std(found[:, 2]) == pytest.approx(np.log(2), rel=0.02)


def solution(parameters, cost, result=CONVERGED):
    """An optimum of this cost, whose constants the data pins to about cost^(1/2) / 10."""
    size = len(parameters)
    residuals = np.full(100 + size, np.sqrt(cost / (100 + size)))
    return Solution(np.asarray(parameters, float), residuals, np.eye(100 + size, size), 7, result)


def summarised(own, others):
    return checks.summarised(own, others, ("a", "b"), seed=1, rule="so")


NEAR, FAR = solution([1, 2], 1e-6), solution([5, 1], 2e-6)
STOPPED = "no convergence in 500 steps"


def test_outcomes_are_told_apart():
    failed = f"{STOPPED}: fix a constant"
    found = [NEAR, FAR, NEAR, solution([9, 9], 5e-6, failed), FAR, NEAR, solution([np.inf, 1], np.nan, "not finite: x")]
    told = summarised(NEAR, found)
    assert (told["result"], told["share_best"]) == (checks.OWN_IS_BEST, pytest.approx(3 / 7))
    assert [outcome["count"] for outcome in told["outcomes"]] == [3, 2, 1, 1]
    assert [outcome["cost_ratio"] for outcome in told["outcomes"]] == pytest.approx([1, 2, 5, np.inf])
    assert (told["outcomes"][1]["constants"], told["outcomes"][2]["result"]) == ({"a": 5.0, "b": 1.0}, failed)
    assert (told["others"], told["count"]) == (0, 7)
    many = [solution([1, 2 + i], 1e-6 * (1 + i)) for i in range(20)]  # of which not all are listed
    told = summarised(many[0], many)
    assert (len(told["outcomes"]), told["others"]) == (checks.MOST_OUTCOMES, 20 - checks.MOST_OUTCOMES)


def test_a_better_optimum_than_the_recipes_own_is_told():
    told = summarised(FAR, [FAR, NEAR, FAR])
    assert (told["result"], told["outcomes"][0]["constants"]) == (checks.OWN_IS_BEATEN, {"a": 1.0, "b": 2.0})
    assert told["share_best"] == pytest.approx(1 / 3)
    failed = solution([1, 2], 1e-7, STOPPED)
    assert summarised(FAR, [failed, FAR])["result"] == checks.OWN_IS_BEST  # where it stopped is no optimum
    assert summarised(failed, [NEAR])["result"] == checks.OWN_IS_BEATEN
    none = summarised(failed, [failed])
    assert (none["result"], none["share_best"]) == (checks.NONE_CONVERGED, 0.0)
    assert none["outcomes"][0]["cost_ratio"] == 1.0


def test_what_is_one_optimum():
    """Costs within 1e-6; constants within a thousandth, or a tenth of their misfit error (here 1e-4)."""
    own = solution([1.0, 1e-9], 1e-6)
    for parameters, cost, same in (
        ([1.0009, 1e-9], 1e-6 * (1 + 9e-7), True),
        ([1.0011, 1e-9], 1e-6, False),
        ([1.0, 0.9e-5], 1e-6, True),
        ([1.0, 1.1e-5], 1e-6, False),
        ([1.0, 1e-9], 1e-6 * (1 + 1.1e-6), False),
    ):
        assert summarised(own, [solution(parameters, cost)])["share_best"] == same, (parameters, cost)


@pytest.mark.slow
def test_all_random_starts_of_a_smooth_law_find_the_optimum(normalisation):
    alpha = 1 - np.linspace(0.05, 0.95, 5) ** 2  # too few for a jackknife, which takes time to compile
    truth = normalisation.reflectance(alpha) * (1 + 1e-3 * np.sin(9 * alpha))  # not quite the law's
    none, edges = np.zeros((5, 1)), np.array([0.0, 1e3])
    profiles = Profiles(alpha, edges, truth[:, None], none, none + np.inf, none[:, 0], "exact", Setting())
    begin = replace(normalisation, **type(normalisation).entry.start)
    own = fit(profiles, begin, "reflectance")
    told = checks.random_starts(own, begin, 10, seed=5)
    assert (told["result"], told["share_best"], len(told["outcomes"])) == (checks.OWN_IS_BEST, 1.0, 1)
    assert told["outcomes"][0]["constants"]["b"] == pytest.approx(own.law.b, rel=1e-4)


@pytest.mark.slow
def test_random_starts_beat_the_printed_start_of_the_papers_inverse():
    """A known case: from (20) as printed, the search ends in the second-best optimum."""
    from_exact = recipe.find("liang-inverse-whole", FITS).changed(truth="exact")
    profiles, start = truth_of(from_exact, None), starting_law(from_exact, FITS)
    xi = tuple((np.arange(64) + 0.5) / 64 * 0.99)
    own = fit(profiles, start, "share", targets.free(from_exact, start), xi=xi)
    told = checks.random_starts(own, start, 50, seed=1)
    assert told["result"] == checks.OWN_IS_BEATEN
    better = fit(profiles, replace(start, **told["outcomes"][0]["constants"]), "share", own.free, xi=xi)
    assert better.solution.cost < 0.8 * own.solution.cost
