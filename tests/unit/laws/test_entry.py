"""The entry of each law, and a law that is added by its file, its text, its record and one line of the table."""

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
        assert all(
            (TEXTS / f"{file}.glsl").is_file() for file in (entry.text.file, *entry.text.parts, *entry.text.ends)
        )
    else:
        with pytest.raises(InputError, match=entry.text):
            emit.law_text(profilefit.load(name))


def test_no_record_is_of_an_index_that_its_law_is_not_made_for():
    for find in (catalogue.profile_laws, catalogue.albedo_laws):
        for one in find(fits_folder(), matched=False):
            assert one.law.entry.n.holds(one.setting.n), one.label


@pytest.mark.parametrize("n", [0.5, 3.0])
def test_dipoles_hold_for_any_index(n):
    for name in ("dipole", "better_dipole"):
        law = profilefit.load(name, setting=Setting(n=n))
        assert law.entry.n.holds(n)
        assert 0.0 < law.profile(1.0, 0.8) < 1.0


def test_a_range_has_ends():
    ends = np.array([0.0, 0.5, 1.0])
    assert Range().holds(ends).tolist() == [True, True, True]
    assert Range(open_low=True, open_high=True).holds(ends).tolist() == [False, True, False]
    assert str(Range(0.0, 0.5, open_low=True)) == "(0, 0.5]"


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
    told = {
        **{"law": "toy", "pipeline": "profile", "setting": Setting()},
        "constants": {name: {"regenerated": value} for name, value in found.constants.items()},
    }
    record.write(toy, "toy", told, {})
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
