"""The centre of light that fell in aslant: against photons, and the limit of Wang and Jacques."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.tracing import layered_event, pool, rng
from profilefit.errors import InputError
from profilefit.measured import fit
from profilefit.measured import model as oblique
from profilefit.measured.model import u_of

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
    mu_s, mu_a = 0.95 / (1.0 - setting.g), 0.05
    light = exact.profile(r, mu_s / (mu_s + mu_a), 1.0 / (mu_s + mu_a), setting=setting)
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
