"""Fits of media that scatter forwards: g given, known as a range, or not thought of. The centre of light that fell in
aslant: against photons, and the limit of Wang and Jacques.
"""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks import half_spaces, own_data
from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.exact import forwards
from mcml_sim.tracing import layered_event, pool, rng
from profilefit.errors import InputError
from profilefit.measured import fit
from profilefit.measured import model as oblique
from profilefit.measured.data import Measured
from profilefit.measured.model import exact_light, u_of
from profilefit.measured.premises import Premises
from profilefit.report.tables.fit_tables import fit_lines
from tests.fixtures import slow

TISSUE = Setting(n=1.4, g=0.9)
MU_A, MU_S = 0.2, 10.0  # reduced, per cm


@pytest.fixture(scope="module")
def photons():
    """2e8 photons of tissue, in cm, as a simulation's rings."""
    found = half_spaces.reference(TISSUE)
    length = 1.0 / (MU_A + MU_S / (1 - TISSUE.g))
    energy = found.energy(MU_S / (MU_S + MU_A))
    edges, areas = found.grid.r_edges * length, found.grid.r_areas * length**2
    seen = np.asarray(energy.effective_samples) > 1000
    value, error = np.asarray(energy.value), np.asarray(energy.standard_error)
    seen &= (edges[1:] * (MU_A + MU_S) > 0.02) & (error > 0)
    rings = [one[seen] for one in (edges[:-1], edges[1:], value / areas, np.maximum(error, 2e-3 * value) / areas)]
    medium = Medium((Layer(1.4, MU_A, MU_S / (1 - TISSUE.g), TISSUE.g),))
    many = np.full(rings[0].size, np.inf)
    return Measured("tissue", "", *rings, many, "photons", "cm", medium=medium, illumination="searchlight")


def off(found):
    return found.values["mu_a"] / MU_A - 1, found.values["mu_s'"] / MU_S - 1


def test_photons_of_tissue_give_their_medium(photons):
    """2 % and 1 % from all rings, 4 % and 2 % from those beyond two transport mean free paths."""
    result = fit(photons, walk=False)
    assert result.fit.spec.law.setting == TISSUE, "of the simulation"
    near, far = off(result.fit), off(fit(photons.within(0.2, None), walk=False).fit)
    assert abs(near[0]) < 0.02
    assert abs(near[1]) < 0.01
    assert abs(far[0]) < 0.04
    assert abs(far[1]) < 0.02
    isotropic = fit(photons, setting=Setting(n=1.4), walk=False).fit
    assert abs(off(isotropic)[0]) > 0.04, "a negative control: similarity"


@pytest.mark.parametrize("ranges", [{"n": (1.35, 1.45), "g": (0.7, 0.95)}, *slow({}, {"g": (0.3, 0.95)})], ids=str)
def test_what_is_open_widens_the_errors(ranges):
    one = own_data.TISSUE
    data = own_data.rows(one, np.random.default_rng(3))
    given = fit(data, setting=one.setting, walk=False).fit
    found = fit(
        data, setting=Premises(Setting(n=1.4, g=float(np.mean(ranges.get("g", 0.9)))), ranges=ranges), walk=False
    )
    errors = found.fit.errors(found.fit.total_covariance)
    assert (errors["mu_a"] > 1.05 * given.errors(given.total_covariance)["mu_a"]) == bool(ranges)
    assert abs(found.fit.values["mu_a"] - 0.02) < 3 * errors["mu_a"]
    lines = [line.plain for line in fit_lines(found)]
    assert any(line.startswith("known as ranges: ") for line in lines) == bool(ranges)


@pytest.mark.parametrize("alpha", [0.5, 0.99])
def test_light_goes_on_beyond_the_table(alpha):
    """Beyond its farthest radius light of a fit is the table's, which decays on without a step."""
    setting = Setting(n=1.4, g=0.8)
    light, whole = exact_light(setting), forwards.light(setting)
    x = float(whole.farthest) * np.array([1.0 - 1e-9, 1.0 + 1e-9, 1.5])
    with jax.enable_x64(True):
        found, right = (np.asarray(one.ring_density(x, np.array(alpha))) for one in (light, whole))
    np.testing.assert_allclose(found, right, rtol=1e-12)
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_what_nobody_said_is_said_to_be_assumed():
    data = own_data.rows(own_data.TISSUE, np.random.default_rng(3))
    result = fit(data, walk=False)
    assert result.tissue.values["mu_a"] == pytest.approx(0.02, rel=0.1)
    told = next(line.plain for line in fit_lines(result) if "assumed; n = 1.4 and g = 0.9" in line.plain)
    assert told.startswith("n = 1 and g = 0 are assumed; ")
    assert told.endswith("give `n` and `g`, or a range")


@pytest.mark.slow
def test_intervals_hold_the_truth():
    """In 100 media, n and g given; 95 % of them within the binomial's 1e-3."""
    for one in own_data.coverage(100, False, jobs=2).values():
        assert one.held > 0.86
        assert one.wider < 3


ANGLE = 45.0
PHOTONS, BATCHES = 2**18, 6
RINGS = ((2.6, 3.6), (4.0, 7.0))  # l*


@partial(jax.jit, compiler_options=pool.COMPILER_OPTIONS)
def ended(photons, key, stack, entry):
    """Places x + i y [unit of the stack] and weights (PHOTONS,) of what leaves on top."""
    go = photons > 0

    def enter(numbers):
        return layered_event.enter(key, numbers, jnp.int32(1), entry, 1)

    def turn(lanes, results):
        here = layered_event.optics(stack, lanes.layer)

        def flight(number, lanes):
            return layered_event.scatter(go, key, lanes, lanes.event + number, here)[0]

        lanes = jax.lax.fori_loop(jnp.uint32(0), jnp.uint32(layered_event.FLIGHTS), flight, lanes)
        lanes = layered_event.settle(go, key, stack, lanes, lanes.event + layered_event.FLIGHTS)
        lanes = lanes._replace(event=lanes.event + layered_event.EVENTS_PER_TURN)
        weight = jnp.where(lanes.layer == layered_event.REFLECTED, -lanes.weight, 0.0)
        at, found = pool.places(lanes, PHOTONS), (lanes.place, weight)
        return lanes, tuple(old.at[at].set(new) for old, new in zip(results, found, strict=True))

    nothing = jnp.zeros(PHOTONS + pool.LANES, jnp.complex64), jnp.zeros(PHOTONS + pool.LANES, jnp.float32)
    return tuple(one[:PHOTONS] for one in pool.follow(enter, turn, nothing, photons, pool.LANES))


def centre_of(place, weight, low, high):
    """Where the first moment of light between two radii vanishes [as place], and its standard error."""

    def moment(centre):
        away = place - centre
        inside = (np.abs(away) > low) & (np.abs(away) < high)
        return weight[inside] * away[inside].real / np.abs(away[inside])

    found = brentq(lambda centre: moment(centre).sum(), -1.0, 2.0, xtol=1e-4)
    slope = (moment(found + 0.2).sum() - moment(found - 0.2).sum()) / 0.4
    return found, float(np.sqrt(np.sum(moment(found) ** 2)) / abs(slope))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n", "g", "alpha", "within"),
    [(1.4, 0.8, 0.9, 0.03), (1.4, 0.0, 0.9, 0.05), (1.33, 0.9, 0.95, 0.028), (1.0, 0.0, 0.9, 0.1)],
)
def test_photons_that_fall_in_aslant_have_their_centre_there(n, g, alpha, within):
    assert within <= oblique.model_error(g) + 1e-12
    medium = Medium((Layer(n=n, mu_a=1.0 - alpha, mu_s=alpha / (1.0 - g), g=g),))  # lengths in l*
    sine = np.sin(np.radians(ANGLE)) / n
    entry = jnp.full(4097, np.sqrt(1.0 - sine**2), jnp.float32)
    stack, keys = layered_event.stack(medium, 1.0), [jnp.asarray(rng.batch_key(3, at)) for at in range(BATCHES)]
    places, weights = zip(*(ended(jnp.int32(PHOTONS), key, stack, entry) for key in keys), strict=True)
    place, weight = np.concatenate(places).astype(complex), np.concatenate(weights).astype(float)
    for low, high in RINGS:
        centre, error = centre_of(place, weight, low, high)
        (expected,) = oblique.centres(alpha, n, g, ANGLE, np.array([np.sqrt(low * high)]))
        assert abs(centre - expected) < 3.0 * error + within * expected
    if g == 0.0 and n > 1.0:
        assert abs(centre - sine) > 5.0 * error, "a negative control: l* sin theta_t"


def test_where_scattering_is_forward_and_nothing_absorbed_the_centre_is_wang_and_jacques():
    found = oblique.centres(0.9999, 1.4, 0.98, ANGLE, np.array([100.0]))
    assert found == pytest.approx(np.sin(np.radians(ANGLE)) / 1.4, rel=0.01)


def test_derivatives_are_differences():
    one, setting = oblique.Oblique(ANGLE, 4.0, 0.5, 0.01), Setting(n=1.4, g=0.8)
    point = np.array([u_of(0.95), np.log(0.9), 0.3])
    _, slopes = one.residuals(setting, point[None])
    moved = [[one.residuals(setting, (point + way)[None])[0][0] for way in step * np.eye(3)] for step in (1e-5, -1e-5)]
    np.testing.assert_allclose(slopes[0], np.subtract(*moved) / 2e-5, rtol=1e-4, atol=1e-6)


def test_an_oblique_beam_gives_the_scattering_that_a_free_scale_leaves_open(tmp_path):
    setting, r = Setting(n=1.4, g=0.8), np.geomspace(1.5, 6.0, 12)
    light = exact.profile(r, 0.95, setting=setting)
    table = tmp_path / "rings.csv"
    rows = zip(r, 7.0 * light, 0.02 * 7.0 * light, strict=True)
    table.write_text("r [mm],value,sigma\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    (centre,) = oblique.centres(0.95, 1.4, 0.8, ANGLE, np.array([4.0]))
    known = oblique.Oblique(ANGLE, 4.0, float(centre), 0.01)
    alone, both = (fit(table, setting=setting, scale=None, walk=False, oblique=one) for one in (None, known))
    errors = [one.fit.errors(one.fit.total_covariance)["mu_s'"] for one in (alone, both)]
    assert errors[1] < 0.5 * errors[0]
    assert both.fit.values["mu_s'"] == pytest.approx(0.95, rel=0.01)
    wrong = fit(table, setting=setting, scale=None, walk=False, oblique=replace(known, centre=1.3 * float(centre)))
    assert wrong.fit.values["mu_s'"] < 0.9, "a negative control: the centre counts"


def test_light_from_everywhere_has_no_slant(tmp_path):
    table = tmp_path / "rings.csv"
    table.write_text("r,value,sigma\n1,1,.1\n2,.5,.1\n3,.2,.1\n4,.1,.1\n")
    with pytest.raises(InputError, match="oblique light must be a searchlight, got diffuse light"):
        fit(table, setting=Setting("diffuse"), oblique=oblique.Oblique(ANGLE, 4.0, 0.5, 0.01))
