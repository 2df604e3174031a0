"""What a fit takes for light: exact light, interpolated; under beams of any width; in rings and through fibres."""

from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mcml_sim import Setting, exact
from profilefit.measured.instrument import PENCIL, Gaussian, Instrument, Profiled, TopHat, beam_of
from profilefit.measured.model import Model, exact_light, u_of
from tests.fixtures import refused, slow

SETTINGS = Setting(), Setting(n=1.4), Setting("diffuse", n=1.4)
ALPHA, W = 0.8, 0.5
BEAMS = {
    "Gaussian": Gaussian(W),
    "top hat": TopHat(W),
    # Straight pieces of a Gaussian beam, three of its radii far: 1e-4 of it.
    "measured": Profiled(*(lambda r: (r, 3.0 * np.exp(-2.0 * (r / W) ** 2)))(np.linspace(0.0, 1.5, 400))),
}


@pytest.mark.parametrize("setting", SETTINGS, ids=str)
def test_between_its_nodes_it_is_exact_light(setting):
    light = exact_light(setting)
    with jax.enable_x64(True):
        density = eqx.filter_jit(lambda x, alpha: light.ring_density(x, alpha))
        for alpha in (0.005, 0.05, 0.3, 0.7, 0.9, 0.99, 0.999, 0.99999):
            reach = 20.0 / exact.decay_rate(alpha)
            for low, high, most in ((1e-5, 20.0, 1e-5), (20.0, min(reach, 200.0), 3e-4)):
                if high <= low:
                    continue
                x = np.geomspace(low, min(high, reach), 60) * 1.00123
                right = 2.0 * np.pi * x * exact.profile(x, alpha, setting=setting)
                found = np.asarray(density(jnp.asarray(x), jnp.asarray(alpha)))
                np.testing.assert_allclose(found, right, rtol=most)
            total = float(light.total(jnp.asarray(alpha)))
            assert total == pytest.approx(exact.reflectance(alpha, setting=setting), rel=1e-9)


def predicted(instrument, inner, outer=None, mfp=0.5, alpha=ALPHA):
    """What a fit expects at radii, or over rings."""
    inner = np.atleast_1d(np.asarray(inner, float))
    point = np.array([[u_of(alpha), np.log(mfp), 0.0]])
    model = Model(exact_light(Setting(n=1.4)), instrument)
    return model.predicted(point, inner, inner if outer is None else np.asarray(outer, float))[0, :-1]


def profile(r, mfp):
    return np.asarray(exact.profile(r, ALPHA, mfp, Setting(n=1.4)))


def by_area(irradiance, reach, d, mfp):
    """A slow, obvious twin: light from every place of the beam, in polar coordinates about the point at d."""
    node, weight = np.polynomial.legendre.leggauss(12)
    graded, even = np.geomspace(1e-6, d + reach, 60), np.linspace(0.0, d + reach, 80)
    edges = np.unique(np.concatenate([graded, even, [abs(d - reach)]]))
    turn = np.pi * (np.arange(4000) + 0.5) / 4000
    total = 0.0
    for low, high in pairwise(edges):
        rho = 0.5 * (low + high) + 0.5 * (high - low) * node
        far = np.sqrt((d - rho[:, None]) ** 2 + 4.0 * d * rho[:, None] * np.sin(0.5 * turn) ** 2)
        total += 0.5 * (high - low) * weight @ (2.0 * np.pi * rho * profile(rho, mfp) * irradiance(far).mean(axis=1))
    return total


@pytest.mark.parametrize("mfp", [0.5, *slow(0.05, 2.0)])
@pytest.mark.parametrize("name", BEAMS)
def test_a_beam_is_the_sum_of_its_places(name, mfp):
    if name == "top hat":
        twin, reach = (lambda r: (r < W) / (np.pi * W**2)), W
    else:
        twin, reach = (lambda r: 2.0 / (np.pi * W**2) * np.exp(-2.0 * (r / W) ** 2)), 3.5 * W
    # 4000 points of a circle find the rim of a top hat to 1e-4; straight pieces and their end are off by as much.
    most = {"Gaussian": 1e-6, "top hat": 3e-4, "measured": 1e-3}[name]
    for d in (0.01, 0.3, 1.0):
        found = predicted(Instrument(BEAMS[name]), d, mfp=mfp)[0]
        assert found == pytest.approx(by_area(twin, reach, d, mfp), rel=most), d


def sampled(irradiance, radii):
    return Profiled(radii, np.array([float(irradiance(r)) for r in radii]))


class Halo:
    """Half of the light in a disc, half of it in one of three times its radius."""

    def nodes(self, d):
        (rho, weight), (more, another) = TopHat(0.3).nodes(d), TopHat(0.9).nodes(d)
        return np.concatenate([rho, more], axis=-1), 0.5 * np.concatenate([weight, another], axis=-1)


@pytest.mark.parametrize(
    ("beam", "measured"),
    [
        (Gaussian(0.25), sampled(lambda r: np.exp(-32.0 * r**2), np.linspace(0.0, 1.0, 200))),
        (Gaussian(0.1), sampled(lambda r: np.exp(-200.0 * r**2), np.linspace(0.0, 5.0, 2000))),
        (TopHat(0.3), Profiled(np.array([0.0, 0.2999, 0.3001]), np.array([5.0, 5.0, 0.0]))),
        (Halo(), Profiled(np.array([0.0, 0.2999, 0.3001, 0.9]), np.array([1.0, 1.0, 0.1, 0.1]))),
    ],
    ids=["Gaussian", "Gaussian with a long dark tail", "top hat", "halo"],
)
def test_a_measured_beam_is_the_beam_that_it_samples(beam, measured):
    """On the axis, at the rim, and as far as a hundred of its radii, where a circle passes it in a small angle."""
    d = np.array([0.0, 0.01, 0.05, 0.2, 0.31, 0.5, 0.95, 2.0, 5.0, 10.0, 30.0])
    (rho, weight), (right, another) = measured.nodes(d), beam.nodes(d)
    seen = Instrument(measured).nodes(measured.r[-1] * 0.5 ** np.arange(8), measured.r[-1] * 0.5 ** np.arange(8))[1]
    assert np.all(np.isfinite(seen)), "at radii where its panels end"
    np.testing.assert_allclose(np.sum(2.0 * np.pi * rho * weight, axis=-1), 1.0, rtol=1e-12)
    for mfp in (0.02, 0.5):
        light, exactly = (
            np.sum(each * radius / (radius + 0.1 * mfp) * np.exp(-0.1 * radius / mfp), axis=-1)
            for radius, each in ((rho, weight), (right, another))
        )
        np.testing.assert_allclose(light, exactly, rtol=1e-3)


def test_rings_hold_their_energy():
    """Pencil beam: differences of the exact cdf. Any beam: all rings together hold all of the light."""
    setting = Setting(n=1.4)
    total = exact.reflectance(ALPHA, setting=setting)
    for inner, outer in ((0.0, 0.1), (0.0, 2.0), (1.0, 1.1), (1.0, 20.0)):
        energy = total * np.diff(exact.cdf(np.array([inner, outer]), ALPHA, 0.5, setting))[0]
        found = predicted(PENCIL, [inner], [outer])[0]
        assert found * np.pi * (outer**2 - inner**2) == pytest.approx(energy, rel=2e-6)
    edges = np.append(0.0, np.geomspace(0.05, 60.0, 80))
    for beam in BEAMS.values():
        rings = predicted(Instrument(beam), edges[:-1], edges[1:])
        assert rings @ (np.pi * np.diff(edges**2)) == pytest.approx(total, rel=1e-4)


@pytest.mark.parametrize("r", [0.05, *slow(0.2, 0.7)])
def test_a_fibre_averages_over_its_core(r):
    """A hundred thousand places of its end, at random; it may cover the axis."""
    source, radius = np.random.default_rng(3), 0.2
    place = radius * np.sqrt(source.uniform(size=100_000)) * np.exp(2j * np.pi * source.uniform(size=100_000))
    values = profile(np.abs(r + place), 0.5)
    error = values.std() / np.sqrt(values.size)
    found = predicted(Instrument(fibre=radius), r)[0]
    assert abs(found - values.mean()) < 4.0 * error
    assert abs(predicted(PENCIL, r)[0] - values.mean()) > 10.0 * error, "negative control: a point"
    beamed = Instrument(Gaussian(1e-4), radius)
    assert predicted(beamed, r)[0] == pytest.approx(found, rel=1e-3), "a beam that is hardly one"


def test_beams_from_words(tmp_path):
    assert (beam_of("beam", "0.5mm", "cm"), beam_of("beam", "tophat:0.5", "mm")) == (Gaussian(0.05), TopHat(0.5))
    path = tmp_path / "beam.csv"
    path.write_text("r, irradiance\n0.1, 7  # counts\n0.5; 7\n0.6\t0\n")
    read = beam_of("beam", str(path), "mm")
    np.testing.assert_array_equal(read.r, [0.0, 0.1, 0.5, 0.6])
    np.testing.assert_array_equal(read.value, [7.0, 7.0, 7.0, 0.0])
    path.write_text("\ufeff0 9\n1 3\n2 0\n3 0\n4 0\n", encoding="utf-8")
    read = beam_of("beam", str(path), "mm")
    np.testing.assert_array_equal((read.r, read.value), ([0.0, 1.0, 2.0], [9.0, 3.0, 0.0])), "darkness is no beam"
    for text, message in (
        ("0, 1\n0.2, -1\n", r"beam\.csv:2: expected a radius >= 0 and an irradiance >= 0, got '0\.2, -1'"),
        ("0, 1\n0, 1\n", r"beam\.csv:2: expected radii that rise above 0, got 0"),
        ("0, 0\n1, 0\n", r"beam\.csv: expected 2 to 2000 rows of radius and irradiance, with light, got 2"),
        ("r, b\n", r"with light, got 0"),
    ):
        path.write_text(text)
        refused(message, beam_of, "beam", str(path), "mm")
    path.write_bytes(b"0, 1\n" * 2**18)
    refused(r"expected a beam of at most 1048576 bytes, got a longer file", beam_of, "beam", str(path), "mm")


@pytest.mark.parametrize("instrument", [PENCIL, Instrument(Gaussian(W))], ids=["pencil", "Gaussian"])
def test_derivatives_are_differences(instrument):
    model, r = Model(exact_light(Setting(n=1.4)), instrument), np.geomspace(0.1, 8.0, 12)
    point, step = np.array([u_of(ALPHA), np.log(0.5), 0.3]), 1e-5
    _, slopes = model.linearised(point, r, r)
    for at in range(3):
        up, down = model.predicted(point + step * np.outer([1, -1], np.eye(3)[at]), r, r)
        np.testing.assert_allclose(slopes[:, at], (up - down) / (2 * step), rtol=1e-6, atol=1e-9)
