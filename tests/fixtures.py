"""Runs, laws, photons and OpenGL that several files of tests look at, and the thresholds they share."""

import signal
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from mcml_sim import Grid, Setting, simulate_orders
from mcml_sim.results.estimate import covariance_factor
from profilefit.errors import InputError, ShaderError
from profilefit.fitting.profiles import Covariance, Profiles
from profilefit.laws.base import AlbedoLaw, Constants
from profilefit.laws.burley import Burley
from profilefit.laws.liang import Liang
from profilefit.laws.published import SETS
from profilefit.laws.rational import Rational
from profilefit.recipes.run import silent, written
from profilefit.recipes.workers import Workers
from profilefit.scenes.stage import technique
from profilefit.scenes.stage.stage import Stage
from profilefit.shader.context import open_context

# The files that ship as examples, by their names.
EXAMPLES = {path.name: str(path) for path in sorted((Path(__file__).parents[1] / "examples").iterdir())}
# A clearer and shallower sea than the example's, away from the sun's glare.
CLEAR_SEA = {
    "scene": "sea",
    "water": {"a": [0.25, 0.08, 0.06], "b": [0.08, 0.08, 0.08], "source": "assumed"},
    "sea": {"slope": 0.12, "tile": 5.0, "seed": 4},
    "floor": {"depth": 4.0},
    "technique": {"slices": 6},
    "camera": {"eye": [6.0, 2.5, -2.2], "target": [0.0, 2.5, -2.4], "angle": 1.1},
    "light": {"direction": [-0.5, 0.0, 0.9], "ambient": [0.25, 0.32, 0.42]},
}
# A law's tests must not move with the records: this map is within 3e-6 of the exact A, its digits are frozen here.
NORMALISATION = Rational(Setting(), 0.45058, 2.35857, 1.36799)


def slow(*values):
    """Values of a parameter that only `make test-all` takes, beside others of every run; a tuple is of several."""
    return [pytest.param(*(one if type(one) is tuple else (one,)), marks=pytest.mark.slow) for one in values]


def refused(message, call, *given, error=InputError, **named):
    """Text of the error that a call raises: one line, in which this message is found, a regular expression."""
    with pytest.raises(error, match=message) as caught:
        call(*given, **named)
    assert str(caught.value).isprintable()
    return str(caught.value)


def recorded(work, out, say=silent):
    """The path of a record that is made and written in this process."""
    with Workers(1) as workers:
        return next(written([work], out, workers, say)).path


def functions(text):
    """The functions of a Python text, by name."""
    names: dict = {}
    exec(text, names)
    return names


@pytest.fixture(scope="session")
def sidak():
    """|z| that the largest of m independent normal deviates exceeds with probability 1e-3."""
    return lambda m: float(norm.isf((1 - (1 - 1e-3) ** (1 / m)) / 2))


def whitened(values, covariance, number):
    """z (p, p) of a sample covariance of so many values about the identity, where `covariance` is 1 (Wishart)."""
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    sample, one = np.cov(values @ root.T, rowvar=False), np.eye(len(covariance))
    return (sample - one) / np.sqrt((1 + one) / number)


@pytest.fixture
def x64():
    """Double precision for tests that call jax themselves."""
    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="session")
def normalisation():
    return NORMALISATION


def _published(kind, law, name):
    """A fixture of a law with published constants."""
    constants = next(dict(s.constants) for s in SETS if (s.law, s.name) == (law, name))
    return pytest.fixture(scope="session")(lambda: kind(Setting(), NORMALISATION, **constants))


liang = _published(Liang, "liang", "corrected")  # as printed, with b0 = 0.0641
liang_printed = _published(Liang, "liang", "published")
burley = _published(Burley, "burley", "published")


@pytest.fixture(scope="session")
def white_run():
    """2^20 photons of the white half space, seed 2, in 25 rings."""
    return simulate_orders(Grid.from_edges(r=np.concatenate([[0.0], np.geomspace(0.02, 30.0, 25)])), 2**20, seed=2)


@pytest.fixture(scope="session")
def run():
    """4 batches of the order-resolved run, seed 1, from far inside a mean free path to where few photons arrive."""
    return simulate_orders(Grid.from_edges(r=np.concatenate([[0.0], np.geomspace(0.01, 30.0, 40)])), 2**22, seed=1)


@pytest.fixture
def python_handles_sigint():
    """As in a terminal; a process started in the background inherits a deaf ear."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


ORDERS = np.arange(1, 41)
SHARES = 0.5 * ORDERS**-1.5 / np.sum(ORDERS**-1.5)


class Toy(Constants):
    """A law whose photons can be drawn: of all, SHARES[n - 1] leave after n scatterings, exponential in r/(h n^q).

    Energy within x: sum over n of k alpha^n SHARES[n] (1 - e^(-x / (h n^q))), with k = 1, h = 0.5, q = 0.5.
    """

    setting: Setting = eqx.field(static=True)
    k: float = 1.0
    h: float = 0.5
    q: float = 0.5

    def unscaled_energy(self, x, alpha):
        x, alpha = jnp.asarray(x)[..., None], jnp.asarray(alpha)[..., None]
        return jnp.sum(self.k * alpha**ORDERS * SHARES * -jnp.expm1(-x / (self.h * ORDERS**self.q)), axis=-1)

    def source_strength(self, alpha):
        return jnp.sum(self.k * jnp.asarray(alpha)[..., None] ** ORDERS * SHARES / (self.h * ORDERS**self.q), axis=-1)


class Tallies:
    """Photons of Toy in rings up to 40 mfp, where none is left: tallies as a simulation would make them."""

    photons = 200_000
    alpha = np.array([0.4, 0.6, 0.8, 0.9, 0.97])
    edges = np.concatenate([[0.0], np.geomspace(0.05, 40.0, 14)])
    weights = alpha[:, None] ** ORDERS

    def __init__(self):
        inside = -np.expm1(-self.edges[:, None] / (0.5 * np.sqrt(ORDERS)))
        self.chance = (np.diff(inside, axis=0) * SHARES).ravel()

    def draw(self, seed, number):
        """(number, rings, orders) counts."""
        full = np.append(self.chance, 1 - self.chance.sum())
        counts = np.random.default_rng(seed).multinomial(self.photons, full, size=number)
        return counts[:, :-1].reshape(number, self.edges.size - 1, ORDERS.size)

    def energy(self, counts):
        """(..., alphas, rings)."""
        return np.moveaxis(counts @ self.weights.T, -1, -2) / self.photons

    def profiles(self, counts):
        factor, dropped = covariance_factor(counts, self.weights, self.photons, 5)
        value, error = self.energy(counts), np.sqrt(np.sum(factor**2, axis=2)).T
        rings = self.alpha, self.edges, value, error, np.full_like(value, 1e6), np.zeros(self.alpha.size)
        covariance = Covariance(factor, value, self.photons, dropped)
        return Profiles(*rings, "orders", Setting(), self.photons, covariance)


class Line(AlbedoLaw):
    """A = u + v alpha, linear in its constants: errors have closed forms, and posteriors are normal."""

    u: float = 0.3
    v: float = 0.5

    def alpha(self, reflectance):
        return (reflectance - self.u) / self.v

    def reflectance(self, alpha):
        return self.u + self.v * alpha


@pytest.fixture(scope="session")
def toy():
    return Toy(Setting())


@pytest.fixture(scope="session")
def tallies():
    return Tallies()


@pytest.fixture(scope="session")
def shared_context():
    """One headless OpenGL context for all tests of a process."""
    try:
        context = open_context()
    except ShaderError as error:
        pytest.skip(str(error))
    yield context
    context.release()


@pytest.fixture
def context(shared_context):
    """It; an OpenGL error fails the test that made it."""
    with shared_context:  # another test of this process may have opened one of its own
        yield shared_context
        assert shared_context.error == "GL_NO_ERROR"


@pytest.fixture
def stage(context, request):
    """A stage as a module's STAGE says, columns and rows and the side of its shadow map; else of 128 x 128 pixels."""
    size, shadow_side = getattr(request.module, "STAGE", ((128, 128), 16))
    with Stage(context, size, shadow_side) as stage:
        yield stage


@pytest.fixture
def small(context, request):
    """A stage beside it, of a module's SMALL columns and rows."""
    with Stage(context, request.module.SMALL, shadow_side=16) as stage:
        yield stage


@pytest.fixture
def alter(monkeypatch):
    """alter(old, new) changes a line of scatter.frag, for stages that are made afterwards; old is what stands there."""

    def change(old, new):
        before = technique.text_beside
        assert before(technique.__name__, "glsl/scatter.frag").count(old) == 1
        monkeypatch.setattr(technique, "text_beside", lambda *place: before(*place).replace(old, new))

    return change
