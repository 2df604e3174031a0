"""The entry of each law, its printed constants, and a law that is added by its files and one line of the table."""

import subprocess
import sys
from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import profilefit
from mcml_sim import Setting
from profilefit import laws
from profilefit.errors import InputError
from profilefit.laws.base import Entry, Range, Sampler, Text
from profilefit.laws.escape import EscapeLaw
from profilefit.laws.published import SETS
from profilefit.laws.rational import Rational
from profilefit.recipes import catalogue, recipe, record
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records
from profilefit.recipes.targets import require_known, starting_law
from profilefit.shader import emit

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
        with pytest.raises(InputError, match=entry.text):
            emit.law_text(profilefit.load(name))


def test_no_record_is_of_an_index_that_its_law_is_not_made_for():
    for find in (catalogue.profile_laws, catalogue.albedo_laws):
        for one in find(fits_folder(), matched=False):
            assert one.law.entry.n.holds(one.setting.n), one.label


@pytest.mark.parametrize("name", ["dipole", "better_dipole"])
def test_dipoles_hold_for_any_index(name):
    for n in (0.5, 3.0):
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


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """A folder with the recipe of a law that is in the table; its file and its text are there, too."""
    monkeypatch.setitem(sys.modules, "toys.toy", SimpleNamespace(Toy=Toy))
    monkeypatch.setitem(laws.PROFILES, "toy", "toys.toy.Toy")
    shipped = emit.read_text
    monkeypatch.setattr(emit, "read_text", lambda file: TOY_TEXT if file == "toy" else shipped(file))
    (tmp_path / "toy.toml").write_text(TOY_RECIPE)
    return tmp_path


@pytest.mark.filterwarnings("ignore:no record 'albedo-rational'")
def test_a_law_is_added_by_one_line_of_the_table(toy):
    """From its recipe by a fit to a record, from that to a law by name, and from that to a text."""
    chosen = recipe.find("toy", toy)
    require_known(chosen)
    start = starting_law(chosen, toy)
    assert start.constants() == {"q0": 1.0, "q1": 1.0}
    edges = np.append(0.0, np.geomspace(0.1, 20.0, 12))
    found = profilefit.fit(profilefit.Profiles.from_exact(np.linspace(0.3, 0.9, 4), edges), start, jackknife=False)
    assert found.result == "converged"
    constants = {name: {"regenerated": value} for name, value in found.constants.items()}
    record.write(toy, "toy", {"law": "toy", "pipeline": "profile", "setting": Setting(), "constants": constants}, {})
    assert "toy" in profilefit.names()
    law = profilefit.load("toy", folder=toy)
    assert law.constants() == pytest.approx(found.constants, rel=1e-11)
    names = {}
    exec(emit.law_text(law, "python"), names)
    assert names["toy_profile"](0.5, 0.8, 1.0) == pytest.approx(law.profile(0.5, 0.8), rel=1e-9)
    assert names["toy_sample"](0.3, 0.8, 1.0) == pytest.approx(law.sampler.sample(0.3, 0.8), rel=1e-9)


def test_a_record_is_read_once(monkeypatch):
    """And only those that a law is made of: its own, and that of the map which normalises it."""
    seen, read = [], record.read

    def counted(path, whole=False):
        seen.append(path.stem)
        return read(path, whole)

    monkeypatch.setattr(record, "read", counted)
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
