"""Records of stacks: what is written is read as the same laws, and what is no such record is refused in one line."""

import functools
import hashlib
import json
import operator
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mcml_sim import Setting
from mcml_sim.files.whole_file import read_toml
from profilefit.errors import DamagedRecord, InputError, RecordError
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import catalogue, record
from profilefit.recipes.folder import STACKS, fits_folder
from profilefit.recipes.kinds import stack as stacks
from profilefit.recipes.kinds.stack import find, load, matching, read, request
from profilefit.recipes.regenerate import requests_of
from profilefit.recipes.run import RecipeRun
from tests.fixtures import recorded, refused, slow

RUN = RecipeRun("quick", 1, Path(), None, None)
STACK = """\
title = "Muscle under its skin"
illumination = "diffuse"

[[layers]]
name = "epicardium"
n = 1.38
mu_a = [0.05, 0.20, 0.35]
mu_s = [1.8, 2.2, 2.6]
g = 0.0
thickness = 0.3
source = "assumed"

[[layers]]
name = "muscle"
n = 1.38
mu_a = [0.20, 0.80, 1.2]
mu_s = [1.13, 1.2, 1.3]
g = 0.0
"""
LAYERS = STACK[STACK.index("[[layers]]") :]
VEIL = """\
[[layers]]
n = 1.38
mu_a = 0.1
mu_s = [3, 4, 5]
g = 0.0
thickness = 0.05
"""
THREE = VEIL + LAYERS
LAST = "mu_s = [1.13, 1.2, 1.3]\ng = 0.0"
# Near what a fit of heart muscle gives for its interface; each channel and interface here has its own.
CONSTANTS = {"w": 0.171, "u": -0.189, "g1": 1.03, "g2": 1.49, "b1": 0.027, "b2": 0.0075, "h0": 0.81, "h1": 1.08}
CONSTANTS |= {"k0": 1 / 7}  # of more digits than a record has
FITTED = {"published": None, "free": True, "statistical_error": None, "discretisation_error": 1e-5, "model_error": None}
FITTED |= {"misfit_error": 2e-3, "jackknife_error": 3e-2}
DIGEST = "0123456789abcdef" * 4
RADII, THICKNESSES = np.geomspace(0.01, 10.0, 20)[:, None], np.array([0.0, 0.1, 0.5])  # [mm]


def constants(medium, number):
    """Of an interface, counted from the surface; of each medium its own."""
    factor = 1.0 + 0.01 * medium.layers[0].mu_s + 0.1 * number
    return {name: value * factor for name, value in CONSTANTS.items()}


def made(illumination, medium, starts=(), tracing=None):
    """What `_channel` gives after a minute, at once: exact light has no photons, and nothing was fitted."""
    setting = Setting(illumination, n=medium.layers[0].n)
    own, number = catalogue.load("hazard", setting=setting).constants(), len(medium.layers) - 1
    named = {f"{i + 1}.{name}": one for i in range(number) for name, one in constants(medium, i).items()}
    return {
        "constants": {name: {**FITTED, "regenerated": value} for name, value in named.items()},
        "half_spaces": [own] * len(medium.layers),
        "thicknesses": [np.array([0.1, 0.3])] * number,
        "quality": [{"thickness": [0.2], "rel": [0.012], "ks": [0.003], "delta_A": [-0.0015]}] * number,
        "starts": [{"count": 5, "as_good": 3, "results": ["converged"]}] * number,
        "fit": [{"result": "converged", "steps": 9, "condition_number": 1e3}] * number,
        "data_digest": DIGEST,
    }


@pytest.fixture
def asked(monkeypatch):
    """What fits of colours, which take no time, were asked for."""
    given: list[tuple] = []
    monkeypatch.setattr(stacks, "_channel", lambda *one: given.append(one) or made(*one))
    return given


@pytest.fixture
def file(tmp_path):
    """Writes the stack above, pieces of it replaced, and gives the file's path."""

    def write(*pieces, name="heart", text=STACK):
        for old, new in zip(pieces[::2], pieces[1::2], strict=True):
            assert text.count(old) == 1, "the piece to replace must be there, once"
            text = text.replace(old, new)
        path = tmp_path / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


@pytest.fixture
def written(asked, file, tmp_path):
    """The record of the stack above."""
    return recorded(stacks.fit(request(file()), RUN), tmp_path / "mine")


@pytest.mark.parametrize("text", [STACK, *slow(THREE)], ids=["two layers", "three"])
def test_a_record_is_read_as_the_laws_that_were_written(asked, file, tmp_path, text):
    said: list[str] = []
    of = request(file(text=text))
    path = recorded(stacks.fit(of, RUN), tmp_path / "mine", say=said.append)
    assert path == tmp_path / "mine" / "stacks" / "heart.json"
    assert [re.sub(r"[\d.]+ s", "SECONDS", line) for line in said] == [f"stacks/heart: SECONDS, {of.title}"]
    found = load(path)
    assert (found.name, found.stack.media, found.stack.names) == ("heart", of.stack.media, of.stack.names)
    assert (found.stack.sources, found.setting) == (of.stack.sources, Setting("diffuse", n=1.38))
    assert found.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.content["title"] == of.title
    own = catalogue.load("hazard", setting=found.setting)
    for law, medium in zip(found.laws, of.stack.media, strict=True):
        *tops, known = (LayerLaw(found.setting, own, layer.alpha, layer.mfp) for layer in medium.layers)
        for number in reversed(range(len(tops))):
            rounded = {name: float(f"{value:.12g}") for name, value in constants(medium, number).items()}
            known = StackLaw(found.setting, tops[number], known, medium.layers[number].thickness, **rounded)
        assert (law.constants(), law.thickness) == (known.constants(), medium.layers[0].thickness)
        np.testing.assert_array_equal(law.profile(RADII, THICKNESSES), known.profile(RADII, THICKNESSES))
    assert found.laws[0].total(0.1) != found.laws[1].total(0.1)
    assert len({one.constants()["w"] for one in found.laws}) == 3
    assert recorded(stacks.fit(of, RUN), tmp_path / "again").read_bytes() == path.read_bytes()


def test_grey_layers_are_fitted_once_and_starts_are_those_of_their_colours(asked, file, tmp_path):
    grey = ("[0.05, 0.20, 0.35]", "0.2", "[1.8, 2.2, 2.6]", "2", "[0.20, 0.80, 1.2]", "0.8", "[1.13, 1.2, 1.3]", "1.2")
    path = recorded(stacks.fit(request(file(*grey)), RUN), tmp_path)
    assert len(asked) == 1
    red, green, blue = load(path).laws
    assert red.constants() == green.constants() == blue.constants()
    rows = {name: [0.2, -0.1, *[1.0] * 6, float(place)] for place, name in enumerate(CHANNELS, start=1)}
    text = "\n[start]\n" + "\n".join(f"{name} = [{row}]" for name, row in rows.items())
    recorded(stacks.fit(request(file(text=STACK + text)), RUN), tmp_path)
    assert [given[2][0].tolist() for given in asked[1:]] == list(rows.values())


GONE = object()


def spoil(path, place, value=GONE):
    """Lose what stands at a place in a record, or put another value there; without a place all is another text."""
    if place is None:
        path.write_text(value)
        return
    content = json.loads(path.read_text())
    *above, last = (int(name) if name.isdigit() else name for name in place.split("/"))
    part = functools.reduce(operator.getitem, above, content)
    if value is GONE:
        del part[last]
    else:
        part[last] = value(part[last]) if callable(value) else value
    path.write_text(json.dumps(content))


def refused_record(reader, path, message):
    text = refused(message, reader, path, error=RecordError)
    assert path.stem in text
    assert len(text) < 400
    assert not text.startswith(f"{path}: is damaged") or text.endswith("; regenerate it")


DAMAGE = [
    ("constants/red.1.w", GONE, r"'red.1.w' is missing"),
    ("half_spaces/green/1/a00", lambda a: 1.001 * a, r"was fitted with other constants of its half spaces"),
    ("half_spaces/red/0/a00", GONE, r"was fitted with other constants .*"),
    ("half_spaces", 3, r"half_spaces must be a table \[half_spaces\], got 3"),
    ("half_spaces/red", "x", r"\[half_spaces\] red must be a list, got 'x'"),
    ("half_spaces/red/0", 1, r"half_spaces must be tables of numbers, got 1"),
    ("half_spaces/red/0/a00", [1.0], r"half_spaces must be tables of numbers, got \{"),
    ("half_spaces/red/0", GONE, r"half_spaces must be 2, one a layer, got 1"),
    ("layers", GONE, r"table \[\[layers\]\] is missing"),
    ("layers", "x", r"layers must be tables \[\[layers\]\], got 'x'"),
    ("layers/0", 3, r"layers must be tables \[\[layers\]\], got \[3, "),
    ("layers/1", GONE, r"the last layer must be infinitely thick, got 0.3"),
    ("layers/0", GONE, r"half_spaces must be 1, one a layer, got 2"),
    ("layers/1/thickness", 2.0, r"the last layer must be infinitely thick, got 2"),
    ("layers/0/thickness", GONE, r"\[layers\] thickness may be infinite in the last layer only"),
    ("layers/1/mu_a", GONE, r"\[layers 2\] mu_a must be a coefficient >= 0, .*, got nothing"),
    ("layers/0/mu_s", [1], r"\[layers 1\] mu_s must be a coefficient >= 0, .*, got \[1\]"),
    ("layers/1/n", 1.5, r"layers must have one n for a law of a stack"),
    ("setting/n", 1.5, r"setting.n must be that of its layers, got 1.5"),
    # Whatever is at that place: a record is no reason to open another file.
    ("layers/0/thickness", {"image": "thickness.png"}, r"thickness must be a number or null, got \{'image'"),
    ("note", GONE, r"note must be a text, got nothing"),
    ("quality", GONE, r"table \[quality\] is missing"),
    ("quality/regenerated/rel", [], r"\[quality.regenerated\] rel must be a list of numbers, got \[\]"),
    ("quality/regenerated", 1, r"\[quality\] regenerated must be a table \[.*\], got 1"),
    ("data_digest", GONE, r"data_digest must be 64 hexadecimal digits, got nothing"),
    ("setting/illumination", "sun", r"it has no valid setting"),
]


PROFILE = ("pipeline", "profile", r"must be the record of a stack, got pipeline 'profile'")
EITHER = [PROFILE, ("unit", 3, r"unit must be a text, got 3")]
# What a report cannot show.
NOT_SHOWN = [
    ("interfaces", GONE, r"table \[interfaces\] is missing"),
    ("interfaces/green", GONE, r"table \[interfaces.green\] is missing"),
    ("interfaces/blue/quality/0/rel", GONE, r"\[interfaces.blue.quality 1\] rel must be a list of numbers, got noth"),
    ("interfaces/blue/quality/0/ks", [0.1, 0.2], r"\[interfaces.blue\] quality 1 must be lists of one length, got"),
    ("interfaces/red/fit/0", GONE, r"\[interfaces.red\] fit must be 1, one per interface, got 0"),
    ("interfaces/red/starts/0/count", 0.5, r"\[interfaces.red.starts 1\] count must be a whole number, got 0.5"),
    ("layers/1/mu_a", 1, r"\[layers 2\] mu_a must be a list of numbers, got 1"),
    ("constants/green.1.k0", GONE, r"\[constants\] green.1.k0 must be a table, got nothing"),
    ("quality/regenerated", GONE, r"table \[quality.regenerated\] is missing"),
]


@pytest.mark.parametrize(
    ("reader", "place", "value", "message"),
    [(reader, *row) for reader, rows in ((load, DAMAGE + EITHER), (read, NOT_SHOWN + EITHER)) for row in rows],
)
def test_a_damaged_record_is_one_line(written, reader, place, value, message):
    assert reader(written)
    spoil(written, place, value)
    refused_record(reader, written, message)


def test_what_is_a_stack_and_what_its_file_says(file, tmp_path):
    (tmp_path / "recipe.toml").write_text((fits_folder() / "hazard.toml").read_text())
    assert request("heart").stack.names == ("epicardium", "heart muscle")
    others = ("hazard", "nothing", "a" * 300, "a" * 300 + ".toml")
    for name in (*others, str(tmp_path / "recipe.toml"), str(tmp_path / "nothing.toml")):
        assert not request(name)
    of = request(file(name="mine"))
    assert (of.name, of.title, of.illumination) == ("mine", "Muscle under its skin", "diffuse")
    plain = request(file(STACK.partition("\n[[layers]]")[0], ""))
    assert (plain.title, plain.illumination) == (stacks.TITLE, "diffuse")
    # A scene's file is one of a stack: what draws it is not looked at.
    drawn = request(file('[[layers]]\nname = "epi', 'scene = "layers"\npose = 3\n[[layers]]\nname = "epi'))
    assert drawn.stack.media == of.stack.media
    path, other = file(), tmp_path / "other" / "heart.toml"
    other.parent.mkdir()
    other.write_text(STACK)
    assert [kind.key for kind, _ in requests_of([path, "skin", path])] == ["stack", "gaussians"] * 2
    with pytest.raises(RecordError, match="stacks must have different names, as their records do, got 'heart' twice"):
        requests_of([path, "skin", str(other)])


LIGHT, TITLE = 'illumination = "diffuse"', '"Muscle under its skin"'
IN_START = [
    ("violet = [[1]]", "keys must be of red, green, blue, got 'violet'"),
    ("red = [[1, 2]]", r"red must be lists of w, u, .* one per interface.*, got \[\[1.0, 2.0\]\]"),
    ("red = [[0.2, 0, 1, 1, 1, 1, 1, 1, 0]]", "red must be .* all but u > 0, got"),
    ("red = [[1.5, 0, 1, 1, 1, 1, 1, 1, 1]]", r"red must be .* w in \(0, 1\)"),
    ("red = [[0.5, 0, 1, 1, 1, 1, 1, 1, 1]]", "green must be .*, got nothing"),
    ('red = [["0.5", 0, 1, 1, 1, 1, 1, 1, 1]]', "red must be "),
    ("red = [[0.5, inf, 1, 1, 1, 1, 1, 1, 1]]", "red must be "),
    ("red = 0.5", "red must be .*, got 0.5"),
]
REFUSED = [
    (LIGHT, 'colour = "red"', r"keys must be of unit, layers, title, illumination, start, got 'colour'"),
    ('"diffuse"', '"sun"', r"illumination must be one of searchlight, diffuse, got 'sun'"),
    (LIGHT, "start = 1", r"start must be a table \[start\], got 1"),
    *((LAST, f"{LAST}\n[start]\n{text}", rf"\[start\] {message}") for text, message in IN_START),
    (TITLE, "7", r"title must be a text of 60 characters at most, got 7"),
    (STACK[STACK.rindex("[[layers]]") :], "", r"layers must be two layers or more: .*, got 1"),
    (LAYERS, "", r"table \[\[layers\]\] is missing"),
]


@pytest.mark.parametrize(("old", "new", "message"), REFUSED)
def test_a_mistake_in_a_file_is_one_line(file, old, new, message):
    path = file(old, new)
    assert refused(message, stacks.requested, path, read_toml(Path(path))).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("n = 1.38\nmu_a = [0.20", "n = 1.5\nmu_a = [0.20", "layers must have one n for a law of a stack"),
        (LAST, LAST.replace("g = 0.0", "g = 0.99"), r"layers must scatter with g in"),
    ],
)
def test_what_no_law_is_for_is_refused_before_any_fit(asked, file, tmp_path, old, new, message):
    of = request(file(old, new))
    with pytest.raises(InputError, match=message):
        recorded(stacks.fit(of, RUN), tmp_path / "mine")
    assert not (tmp_path / "mine").exists()
    assert not asked


def test_a_fit_that_fails_leaves_nothing_behind(monkeypatch, asked, file, tmp_path):
    """Not after two colours, either; and an old record stays as it was."""

    def fails(illumination, medium, starts, tracing):
        if medium.layers[0].mu_a > 0.3:
            raise FloatingPointError("blue diverges")
        return made(illumination, medium)

    of = request(file())

    def failing(of):
        with monkeypatch.context() as patched:
            patched.setattr(stacks, "_channel", fails)
            with pytest.raises(FloatingPointError, match="blue diverges"):
                recorded(stacks.fit(of, RUN), tmp_path / "mine")

    failing(of)
    assert not (tmp_path / "mine").exists()
    path = recorded(stacks.fit(of, RUN), tmp_path / "mine")
    before = path.read_bytes()
    failing(of.changed(title="another"))
    assert [(one.name, one.read_bytes()) for one in path.parent.iterdir()] == [("heart.json", before)]


def test_a_record_says_what_it_is_worth_and_is_found_by_path_and_by_name(written, tmp_path):
    content = record.read(written)
    assert (content["pipeline"], content["law"], content["truth"]) == ("stack", "stack", {"kind": "exact"})
    assert content["quality"]["regenerated"] == {"rel": [0.012] * 3, "ks": [0.003] * 3, "delta_A": 0.0015}
    assert (content["fit"]["result"], content["layers"]) == ("converged", load(written).stack.layers)
    assert len(content["constants"]) == 3 * len(CONSTANTS)
    assert content["constants"]["green.1.w"] == {**FITTED, "regenerated": float(f"{CONSTANTS['w'] * 1.022:.12g}")}
    folder = tmp_path / "mine"
    digest = hashlib.sha256(written.read_bytes()).hexdigest()
    assert find(str(written), tmp_path).digest == find("heart", folder).digest == digest
    for name in ("skin", "hazard", str(fits_folder() / "hazard.json"), str(tmp_path / "nothing.json"), "a" * 300):
        assert find(name, folder) is None
    assert find("heart", tmp_path) is None
    (tmp_path / "damaged.json").write_text("{")
    refused(r"damaged\.json: is not a record", find, str(tmp_path / "damaged.json"), folder, error=RecordError)


def test_a_record_matches_the_layers_that_it_is_of(written, file, tmp_path):
    """By whatever names; at another thickness or light, or with another coefficient, it is of something else."""
    folder = tmp_path / "mine"
    names = ('"epicardium"', '"bark"', '"assumed"', '"a book"', '"Muscle under its skin"', '"x"')
    same = request(file(*names, name="x"))
    found = matching(same, folder)
    assert found is not None
    assert found.digest == load(written).digest
    for pieces in (("0.3\n", "0.31\n"), ('"diffuse"', '"searchlight"'), ("0.80", "0.8000001"), ("2.6", "2.7")):
        assert matching(request(file(*pieces, name="x")), folder) is None
    assert matching(same, tmp_path) is None
    # An image's mean thickness has more digits than a record.
    Image.fromarray(np.array([[0, 1], [2, 250]], np.uint8)).save(tmp_path / "thickness.png")
    of = request(file("= 0.3\n", '= { image = "thickness.png", range = [0.1, 0.4] }\n'))
    mean = of.stack.media[0].layers[0].thickness
    assert mean != float(f"{mean:.12g}")
    path = recorded(stacks.fit(of, RUN), tmp_path / "image")
    found = matching(of, tmp_path / "image")
    assert found is not None
    assert found.laws[0].thickness == pytest.approx(mean, rel=1e-11)
    assert load(path).stack.map is None
    # The one that is asked for must be whole: its layers say which one it is, and to go on without it would hide that.
    spoil(written, "half_spaces/green/1/a00", lambda a: 1.001 * a)
    with pytest.raises(RecordError, match="was fitted with other constants of its half spaces; regenerate it"):
        matching(request(file()), folder)
    assert matching(request(file("0.3\n", "0.31\n")), folder) is None


CAUSES = [
    (None, "{", r"is not a record: "),
    (None, "[]", r"is not a record of format 1 or 2, got 'list'"),
    PROFILE,
    ("layers", GONE, r"table \[\[layers\]\] is missing"),
    ("layers/0", 3, r"layers must be tables \[\[layers\]\], got \[3, "),
    ("setting/illumination", "sun", r"record 'heart' is damaged: it has no valid setting"),
]


@pytest.mark.parametrize(("place", "value", "cause"), CAUSES)
def test_a_damaged_record_of_something_else_stops_nothing(written, file, tmp_path, place, value, cause):
    """It comes first; whether the record that is asked for is there or not, one line names it and says why."""
    folder, first = tmp_path / "mine", written.with_name("first.json")
    first.write_text(written.read_text())
    spoil(first, place, value)
    for pieces, name in (((), "heart"), (("0.3\n", "0.31\n"), None)):
        with pytest.warns(DamagedRecord, match=rf"first\.json is passed over: .*{cause}") as said:
            found = matching(request(file(*pieces)), folder)
        assert (found and found.name) == name
        assert len(said) == 1
        assert str(said[0].message).isprintable()


SHIPPED = sorted(path.stem for path in (fits_folder() / STACKS).glob("*.toml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_stack_has_its_record(name):
    """Of the layers that its file has, and under the map and laws that ship today."""
    found = matching(request(name), fits_folder())
    assert found is not None
    assert found.name == name
    assert find(name, fits_folder()).digest == found.digest
    for channel, law in enumerate(found.laws):
        ends = sorted([law.top.reflectance, law.below.reflectance])
        assert ends[0] <= law.total(0.2) <= ends[1], channel
