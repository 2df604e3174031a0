"""Laws: their entries, printed constants, one that is added by a line; numbers in, numpy out, jax in, jax out."""

import subprocess
import sys
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from mcml_sim import Setting
from mcml_sim.runs.input_runs import Compiling
from profilefit import laws
from profilefit.laws.base import BLOCKS, Entry, EscapeLaw, Range, Sampler, Text, evaluated
from profilefit.laws.published import SETS
from profilefit.laws.rational import Rational
from profilefit.recipes import catalogue, recipe, record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records
from profilefit.recipes.targets import require_known, starting_law
from profilefit.shader import emit
from tests.fixtures import functions, refused

CLASSES = {**{f"map {name}": kind for name, kind in laws.map_classes().items()}, **laws.profile_classes()}
TEXTS = fits_folder().parent / "profilefit" / "shader" / "glsl"


def test_the_tables_import_no_law():
    code = "import sys, profilefit.laws; print(len(profilefit.laws.PROFILES), 'jax' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(len(laws.PROFILES)), "False"]


@pytest.mark.parametrize("name", CLASSES)
def test_an_entry_tells_of_what_there_is(name):
    kind, entry = CLASSES[name], CLASSES[name].entry
    assert entry.title
    assert entry.key == ("gaussians:6" if name == "gaussians" else name.replace("map ", "albedo "))
    assert set(entry.start) in (set(), set(kind.constant_names()))
    for base in entry.records:
        assert recipe.find(base, fits_folder()).law in (entry.name, entry.name.partition(":")[0])
    if entry.has_text:
        files = (entry.text.file, *entry.text.parts, *entry.text.ends)
        assert all((TEXTS / f"{file}.glsl").is_file() for file in files)
    else:
        refused(entry.text, emit.law_text, profilefit.load(name))


def test_no_record_is_of_an_index_that_its_law_is_not_made_for():
    """Dipoles hold for any."""
    for find in (catalogue.profile_laws, catalogue.albedo_laws):
        for one in find(fits_folder(), matched=False):
            assert one.law.entry.n.holds(one.setting.n), one.label
    for name, n in product(("dipole", "better_dipole"), (0.5, 3.0)):
        law = profilefit.load(name, setting=Setting(n=n))
        assert law.entry.n.holds(n)
        assert 0.0 < law.profile(1.0, 0.8) < 1.0


def test_a_range_has_ends():
    ends = np.array([0.0, 0.5, 1.0])
    assert Range().holds(ends).tolist() == [True, True, True]
    assert Range(open_low=True, open_high=True).holds(ends).tolist() == [False, True, False]
    assert str(Range(0.0, 0.5, open_low=True)) == "(0, 0.5]"


# Printed constants, typed here a second time from their sources: the two copies must agree, digit for digit.
# Liang et al.: (9)-(11) a, (12)-(13) b, (14)-(15) c, (19)-(20) the inverse; (8). Christensen and Burley 2015:
# s = 1.85 - A + 7 |A - 0.8|^3, 1.9 - A + 3.5 (A - 0.8)^2, 3.5 + 100 (A - 0.33)^4. Kulla and Conty 2017:
# s = 4.09712 + 4.20863 A - sqrt(9.59217 + 41.6808 A + 17.7126 A^2). Chiang, Kutz and Burley 2016:
# alpha = 1 - exp(-5.09406 A + 2.61188 A^2 - 4.31805 A^3).
LIANG = "a1 -0.0064 a2 0.00316 a3 30 b0 0.461 b1 6.7 b2 0.45 b3 2.6 b4 1.3 c1 0.0097 c2 4.2 c3 0.166 g1 1.504 g2 2.175 "
LIANG += "g3 0.7 g4 0.19 h1 3.993 h2 3.268 h3 0.2838"
PRINTED = {
    ("liang", "published", "searchlight"): LIANG,
    ("liang", "corrected", "searchlight"): LIANG.replace("b0 0.461", "b0 0.0641"),
    ("burley", "published", "searchlight"): "s0 1.85 s1 1 s2 7 s3 0.8",
    ("burley", "diffuse", "diffuse"): "s0 1.9 s1 1 s2 3.5 s3 0.8",
    ("burley_diffuse_mfp", "published", "searchlight"): "s0 3.5 s1 100 s2 0.33",
    ("liang_albedo", "published", "searchlight"): "p 5.67 q 3.84 w 0.84",
    ("van_de_hulst_albedo", "published", "diffuse"): "p0 4.09712 p1 4.20863 q0 9.59217 q1 41.6808 q2 17.7126",
    ("chiang_albedo", "published", "diffuse"): "e1 -5.09406 e2 2.61188 e3 -4.31805",
}


def test_constants_are_the_printed_ones():
    """Each set once, under its light, and from a source."""
    assert [(s.law, s.name, s.setting) for s in SETS] == [(law, name, Setting(light)) for law, name, light in PRINTED]
    for one, text in zip(SETS, PRINTED.values(), strict=True):
        words = text.split()
        assert one.constants == dict(zip(words[::2], map(float, words[1::2]), strict=True)), one.law
        assert one.source


class ToySampler(Sampler):
    law: "Toy"

    def scaled_sample(self, xi, alpha):
        return -jnp.log1p(-xi) / self.law.rate(alpha)

    def scaled_pdf(self, x, alpha):
        return self.law.scaled_density(x, alpha)


class Toy(EscapeLaw):
    """2 pi x R_d = A q e^{-q x}, q = q0 + q1 (1 - alpha)."""

    setting: Setting = eqx.field(static=True)
    albedo: Rational = eqx.field(static=True)
    q0: float
    q1: float
    entry = Entry("toy", "a toy", records=("toy",), start={"q0": 1.0, "q1": 1.0}, text=Text("toy"))
    sampler_class = ToySampler

    def rate(self, alpha):
        return self.q0 + self.q1 * (1.0 - alpha)

    def scaled_density(self, x, alpha):
        return self.rate(alpha) * jnp.exp(-self.rate(alpha) * x)

    def scaled_cdf(self, x, alpha):
        return -jnp.expm1(-self.rate(alpha) * x)


TOY_TEXT = """\
struct LAW_Shape {
    float reflectance; // A [-]
    float rate; // q [1/mfp]
};
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    s.rate = LAW_q0 + LAW_q1 * (1.0 - alpha);
    return s;
}
"""
FUNCTIONS = {
    "reflectance(LAW_Shape s)": "s.reflectance",
    "density(float x, LAW_Shape s)": "s.rate * exp(-s.rate * x)",
    "cumulated(float x, LAW_Shape s)": "1.0 - exp(-s.rate * x)",
    "radius(float xi, LAW_Shape s)": "-log(1.0 - clamp(xi, 0.0, PF_MOST_XI)) / s.rate",
    "radius_density(float x, LAW_Shape s)": "LAW_density(x, s)",
}
TOY_TEXT += "".join(f"\nfloat LAW_{head} {{\n    return {value};\n}}\n" for head, value in FUNCTIONS.items())
TOY_RECIPE = """\
title = "a toy"
law = "toy"
equations = "q"
pipeline = "profile"
truth = "exact"
albedos = { low = 0.3, high = 0.9, count = 4 }
rings = { first = 0.1, last = 20.0, count = 12 }
weighting = { objective = "energy" }
"""


@pytest.mark.filterwarnings("ignore:no record 'albedo-rational'")
def test_a_law_is_added_by_one_line_of_the_table(monkeypatch, tmp_path):
    """From its recipe by a fit to a record, from that to a law by name, and from that to a text."""
    monkeypatch.setitem(sys.modules, "toys.toy", SimpleNamespace(Toy=Toy))
    monkeypatch.setitem(laws.PROFILES, "toy", "toys.toy.Toy")
    shipped = emit.read_text
    monkeypatch.setattr(emit, "read_text", lambda file: TOY_TEXT if file == "toy" else shipped(file))
    (tmp_path / "toy.toml").write_text(TOY_RECIPE)
    chosen = recipe.find("toy", tmp_path)
    require_known(chosen)
    start = starting_law(chosen, tmp_path)
    assert start.constants() == {"q0": 1.0, "q1": 1.0}
    edges = np.append(0.0, np.geomspace(0.1, 20.0, 12))
    found = profilefit.fit(profilefit.Profiles.from_exact(np.linspace(0.3, 0.9, 4), edges), start, jackknife=False)
    assert found.result == "converged"
    constants = {name: {"regenerated": value} for name, value in found.constants.items()}
    told = {"law": "toy", "pipeline": "profile", "setting": Setting(), "constants": constants}
    record.write(tmp_path, "toy", told, {})
    assert "toy" in profilefit.names()
    law = profilefit.load("toy", folder=tmp_path)
    assert law.constants() == pytest.approx(found.constants, rel=1e-11)
    names = functions(emit.law_text(law, "python"))
    assert names["toy_profile"](0.5, 0.8, 1.0) == pytest.approx(law.profile(0.5, 0.8), rel=1e-9)
    assert names["toy_sample"](0.3, 0.8, 1.0) == pytest.approx(law.sampler.sample(0.3, 0.8), rel=1e-9)


def test_a_record_is_read_once(monkeypatch):
    """And only those that a law is made of: its own, and that of the map which normalises it."""
    seen, read = [], record.read
    monkeypatch.setattr(record, "read", lambda path, *whole: seen.append(path.stem) or read(path, *whole))
    profilefit.load("hazard")
    assert seen == ["hazard", "albedo-rational"]
    records = Records(fits_folder())
    seen.clear()
    catalogue.find("hazard", records)
    catalogue.find("hazard", records)
    assert seen == ["hazard", "albedo-rational"]
    catalogue.profile_laws(records, matched=False)
    catalogue.albedo_laws(records, matched=False)
    assert sorted(seen) == sorted(records.paths)


# Numbers in, float64 numpy out; jax in, jax out


class Doubler(eqx.Module):
    @evaluated
    def twice(self, x, y=0.0):
        """Twice x, and y."""
        return 2.0 * x + y


class Halver(Doubler):
    """A law with a constant of its own; a jax array where it is being traced or fitted."""

    constant: float


def test_numbers_give_a_float_arrays_float64_and_jax_jax():
    for x in (3, 3.0, np.float32(3.0), np.array(3)):
        assert type(Doubler().twice(x)) is float
        assert Doubler().twice(x) == 6.0
    for x in ([1, 2], (1.0, 2.0), np.array([1, 2]), np.array([1, 2], np.float32)):
        out = Doubler().twice(x, y=np.array([[1.0], [2.0]]))
        assert type(out) is np.ndarray
        assert (out.dtype, out.shape) == (np.float64, (2, 2))
    assert Doubler().twice(0.1) == 0.2
    assert not jax.config.jax_enable_x64
    assert (Doubler.twice.__name__, Doubler.twice.__doc__) == ("twice", "Twice x, and y.")
    one = jnp.float32(1.0)  # jax anywhere stays jax
    for out in (Doubler().twice(one), Doubler().twice(1.0, y=one), Halver(one).twice(jnp.float32(1.0))):
        assert isinstance(out, jax.Array)
        assert out.dtype == jnp.float32


@pytest.mark.slow
@pytest.mark.parametrize("size", [0, 1, 63, 64, 65, 1024, 1025, 2 * BLOCKS[-1] + 1])
def test_every_length_is_that_of_one_call(burley, size):
    """To rounding: a vector's last numbers may be worked out by other instructions."""
    r, alpha = np.geomspace(1e-3, 30.0, size), np.linspace(0.1, 1.0, size)
    for albedos in (alpha, 0.9):
        found = burley.profile(r, albedos)
        assert found.shape == (size,)
        with jax.enable_x64(True):  # compiled for its arguments as they are: the twin of what goes by blocks
            twin = np.asarray(jax.jit(burley.profile)(jnp.asarray(r), jnp.asarray(albedos)))
        np.testing.assert_allclose(found, twin, rtol=1e-14)


def test_a_grid_keeps_its_shape(burley):
    r, alpha, mfp = np.geomspace(1e-3, 30.0, 40), np.linspace(0.1, 1.0, 9)[:, None], np.full((2, 1, 1), 1.5)
    found = burley.profile(r, alpha, mfp)
    assert found.shape == (2, 9, 40)
    np.testing.assert_array_equal(found[0], found[1])
    for row, a in zip(found[0], alpha[:, 0], strict=True):
        np.testing.assert_allclose(row, burley.profile(r, a, 1.5), rtol=1e-14)
    assert burley.profile(1.0, [0.5]).shape == (1,)
    # Constants may be many, as the draws of a posterior are: a row a draw.
    draws = replace(burley, s0=np.array([[1.8], [1.9]]))
    expected = [replace(burley, s0=s0).profile([0.1, 1.0, 3.0], 0.9) for s0 in (1.8, 1.9)]
    np.testing.assert_allclose(draws.profile([0.1, 1.0, 3.0], 0.9), expected, rtol=1e-12)


def test_no_length_and_no_constant_compiles_anew(burley):
    """Once for each size of block; jax's own listener counts."""
    for size in BLOCKS:
        burley.profile(np.ones(size), 0.9)
        burley.sampler.sample(np.full(size, 0.5), 0.9)
    with Compiling() as again:
        for size in range(1, 2000, 7):
            law = replace(burley, s0=1.0 + size)
            law.profile(np.ones(size), 0.5)
            law.sampler.sample(np.full(size, 0.5), 1.0 / size)
    assert again.seconds == 0.0


GROWTH = """
import mmap
import numpy as np, profilefit
from pathlib import Path

law = profilefit.load("hazard")
pages = lambda: int(Path("/proc/self/statm").read_text().split()[1])
law.profile(1.0, 0.9), law.sampler.sample(0.5, 0.9)
before = pages()
for size in range(1, 1001):
    law.profile(np.full(size, 1.0), 0.9), law.sampler.sample(np.full(size, 0.5), 0.9)
print((pages() - before) * mmap.PAGESIZE)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_thousand_lengths_take_no_memory():
    """They took 35 MB each."""
    done = subprocess.run([sys.executable, "-c", GROWTH], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 200e6


A_NUMBER = "r must be a number or an array of numbers, got"
OUT_OF_RANGE = [
    ({"r": [1.0, 2.0, 3.0], "alpha": [0.5, 0.6]}, r"arguments must broadcast to one, got r \(3,\), alpha \(2,\)"),
    ({"r": 0.5, "alpha": 1.5}, r"alpha must be in \[0, 1\], got 1.5"),
    ({"r": 0.5, "alpha": np.nan}, r"alpha must be in \[0, 1\], got nan"),
    ({"r": 0.5, "alpha": 0.5, "mfp": 0.0}, r"mfp must be > 0, from 1e-100 to 1e\+100, got 0"),
    *(
        ({"r": given, "alpha": 0.5}, said)
        for given, said in (
            ([0.5, -1.0], "r must be >= 0, got -1"),
            ("far", f"{A_NUMBER} 'far'"),
            ("0.5", f"{A_NUMBER} '0.5'"),
            (np.array([1j]), rf"{A_NUMBER} array\(\[0.\+1.j\]\)"),
            (10**400, f"{A_NUMBER} one of 401 digits"),
            ([[1.0], [1.0, 2.0]], rf"{A_NUMBER} \[\[1.0\], "),
            (np.array([0.5, None]), r"r must be a number .*, got array\(.* dtype=object\)"),
            (np.ma.masked_greater([0.5, 9.0], 1.0), "r must be .*, got an array with masked values: fill"),
        )
    ),
]


@pytest.mark.parametrize(("words", "said"), OUT_OF_RANGE, ids=[said[-40:] for _, said in OUT_OF_RANGE])
def test_numbers_out_of_range_are_named(burley, words, said):
    refused(said, burley.profile, **words)
    refused(said, burley.profile, *words.values())


def test_samplers_and_maps_name_theirs(burley, liang_printed):
    whole = np.ma.masked_greater([0.5, 0.7], 1.0)
    np.testing.assert_array_equal(burley.profile(whole, 0.5), burley.profile([0.5, 0.7], 0.5))
    for evaluate, given, said in (
        (burley.sampler.sample, (2.0, 0.5), r"xi must be in \[0, 1\], got 2"),
        (burley.albedo.alpha, (1.2,), r"reflectance must be in \[0, 1\], got 1.2"),
        (liang_printed.largest_radius, (-0.1,), r"alpha must be in \[0, 1\], got -0.1"),
    ):
        refused(said, evaluate, *given)
