"""Kinds of records: one signature for all, one order of names, and a sixth kind that is one file and one line."""

import inspect
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcml_sim import Layer, Medium
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import RecordError
from profilefit.recipes import kinds
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import KINDS, Kind, KindModule, gaussians, phase, records_of, stack
from profilefit.recipes.regenerate import requests_of
from profilefit.recipes.run import RecipeRun
from profilefit.recipes.stack import fit as stacks
from profilefit.recipes.stack.fit import Tracing
from profilefit.shader.law_file import export_subject
from tests.fixtures import refused
from tests.unit.cli.conftest import command, program
from tests.unit.recipes.stack.test_record import RUN, made
from tests.unit.recipes.stack.test_sum_record import made_sums

__all__ = ["command", "program"]
ROOT = Path(__file__).resolve().parents[3]
BY_KEY = {kind.key: kind for kind in KINDS}
TOY = '''\
"""Dice: the mean of numbers, one a line."""

from functools import partial
from pathlib import Path
from mcml_sim import Setting
from profilefit.recipes import record
from profilefit.recipes.record import read
from profilefit.recipes.run import Work
from rich.text import Text

def find(name, folder):
    path = record.named(name, folder / "dice", "dice")
    return None if path is None else read(path)

def request(name):
    return Path(name) if name.endswith(".dice") else None

def fit(path, run):
    throws = [float(line) for line in path.read_text().split()]
    about = {"title": "Dice", "law": "dice", "pipeline": "dice", "equations": "m", "setting": Setting()}
    about |= {"preset": run.preset, "seed": run.seed, "truth": {"kind": "throws"}, "fit": {"result": "converged"}}
    error = {"published": None, "free": True, "statistical_error": 0.1}

    def content(sums):
        mean = sums[0] / len(throws)
        return {**about, "constants": {"m": {"regenerated": mean, **error}}, "quality": quality(mean)}, {}

    return Work(f"dice/{path.stem}", (partial(sum, throws),), content)

def quality(mean):
    return {"regenerated": {"rel": [abs(mean / 3.5 - 1)]}}

def source(found, lang="glsl", name=None):
    return f"const float {name or 'dice'}_mean = {found['constants']['m']['regenerated']};\\n"

def tables(content, path):
    return [Text(f"{path.stem}: mean {content['constants']['m']['regenerated']}")]
'''


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.key)
def test_every_kind_has_the_functions_of_the_shelf(kind):
    functions = {name for name, one in inspect.getmembers(KindModule, inspect.isfunction) if name[0] != "_"}
    assert functions == {"find", "fit", "quality", "read", "request"}
    assert all(callable(getattr(kind.module, name)) for name in functions)
    assert list(inspect.signature(kind.module.fit).parameters)[1] == "run"
    assert next(iter(inspect.signature(kind.module.request).parameters)) == "name"
    assert list(inspect.signature(kind.module.find).parameters)[:2] == ["name", "folder"]


FIRST = dict.fromkeys(("hazard", "dipole", "liang-inverse-whole"), "law") | {"skin": "stack", "petzold": "phase"}
FIRST |= dict.fromkeys(("albedo liang", "chiang", "albedo-rational-diffuse"), "albedo_map")


@pytest.mark.parametrize(("name", "key"), FIRST.items())
def test_a_name_is_that_of_the_first_kind_that_has_it(name, key):
    first = next(kind for kind in KINDS if kind.find(name) is not None)
    assert first.key == key
    if key in ("stack", "phase"):
        words = {"stack": "a stack", "phase": "a phase function"}[key]
        refused(rf"^n must be left out where NAME is {words}, got '{name}'", first.find, name, n=1.4)


def test_records_of_paths_and_names_are_of_their_own_kinds(tmp_path):
    """A name means the first record of it, and those beside that."""
    for folder, key in (("stacks", "stack"), ("gaussians", "gaussians"), ("phases", "phase")):
        path = next((fits_folder() / folder).glob("*.json"))
        assert [kind.key for kind in KINDS if kind.find(str(path)) is not None] == [key]
    assert BY_KEY["law"].find("hazard", n=1.4).setting.n == 1.4
    found = records_of(["skin", "hazard", "petzold"])
    keys = [("stack", "skin"), ("gaussians", "skin"), ("law", "hazard"), ("phase", "petzold")]
    assert [(kind.key, name) for kind, name, _ in found] == keys
    refused(r"there is no record 'petzhold' in .*; stacks are heart, ", records_of, ["petzhold"], error=RecordError)
    refused("has no records", records_of, ["skin"], tmp_path, error=RecordError)
    # Every name that ships is requested of its kinds.
    found = requests_of()
    keys = {key: [request for kind, request in found if kind.key == key] for key in BY_KEY}
    assert {kind.key for kind, _ in found} == set(BY_KEY)
    assert [one.name for one in keys["stack"]] == [one.name for one in keys["gaussians"]]
    assert {one.pipeline for one in keys["albedo_map"]} == {"albedo"}
    shipped = [path for place in ("", "*/") for path in fits_folder().glob(f"{place}*.json")]
    assert len(found) == len([path for path in shipped if path.parent.name != "evidence"])


TRACED = Medium((Layer(1.4, 0.1, 10.0, 0.8, 0.5), Layer(1.4, 0.5, 5.0, 0.5, np.inf)))
EXACT = Medium(tuple(layer.similar for layer in TRACED.layers))
GIVEN = RecipeRun("full", 7, Path("out"), Path("photons"), 1000)


def test_seed_preset_and_store_are_of_every_kind(monkeypatch):
    """A record says which; where nothing is traced, its note says that they are of no effect."""
    calls = []
    monkeypatch.setattr(stack, "_channel", lambda *given: calls.append(given) or made(*given))
    monkeypatch.setattr(phase, "fit_phase", lambda *given: calls.append(given))
    for name, module, seed in (("heart", stack, 7), ("heart", gaussians, 306), ("petzold", phase, 7)):
        request = module.request(name)
        for run, notes in ((GIVEN, " No photon is traced: the preset and number"), (RUN, None)):
            work = module.fit(request, run)
            if module is gaussians:  # whose fits take a minute
                results = [{light: made_sums(request.stack.media, light) for light in ILLUMINATIONS}]
            else:
                results = [part() for part in work.parts]
            content, _ = work.finish([[]] if module is phase else results)
            assert (content["preset"], content["seed"]) == (run.preset, seed + run.seed - 7)
            assert (notes or module.NOTE) in content["note"]
    tracing = [given[-1] for given in calls if isinstance(given[-1], Tracing)]
    assert {one.seed for one in tracing} == {1, 7}
    assert {str(one.store) for one in tracing} == {"None", *(f"photons/stacks/heart-{i}" for i in range(3))}
    assert {given[-1] for given in calls if not isinstance(given[-1], Tracing)} == {1, 7}


def test_traced_light_is_that_of_its_run(monkeypatch):
    """Number of photons, seed and store; a store for each medium, light and seed."""
    calls = []
    monkeypatch.setattr(stacks, "traced", lambda *given: calls.append(given))
    edges = np.array([0.0, 1.0])
    for medium, light, offset in ((1, "diffuse", 0), (2, "diffuse", 0), (1, "searchlight", 0), (1, "diffuse", 3)):
        Tracing.of(GIVEN, "skin-0", EXACT).rings(medium, light, edges, 2**20, offset)
    assert [given[3:5] for given in calls] == [(1000, 7)] * 3 + [(1000, 10)]
    stores = [given[5] for given in calls]
    assert (len(set(stores)), {store.parent for store in stores}) == (4, {Path("photons/stacks/skin-0")})
    Tracing.of(replace(GIVEN, photons=None), "skin-0", EXACT).rings(1, "diffuse", edges, 2**20, 0)
    Tracing().rings(1, "diffuse", edges, 2**20, 0)
    assert [given[3:] for given in calls[-2:]] == [(20 * 2**20, 7, stores[0]), (2**20, 1, None)]
    refused(r"photons must be a whole number >= 131072 where .* forward, got 1000", Tracing.of, GIVEN, "skin-0", TRACED)


@pytest.mark.slow
def test_traced_light_resumes(tmp_path):
    tracing, edges = Tracing(3, 2000, store=tmp_path / "new"), np.append(0.0, np.geomspace(0.01, 10.0, 20))
    first = tracing.rings(TRACED, "diffuse", edges, 1, 5)
    (batch,) = tmp_path.rglob("batch-*")
    before = batch.stat().st_mtime_ns
    again, plain = (one.rings(TRACED, "diffuse", edges, 1, 5) for one in (tracing, tracing._replace(store=None)))
    assert batch.stat().st_mtime_ns == before
    for one in (again, plain):
        np.testing.assert_array_equal(one.energy, first.energy)


def test_a_sixth_kind_is_regenerated_reported_exported_and_completed(command, monkeypatch, tmp_path):
    """Two files are touched: the toy's own, and a line of the table of kinds."""
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "dice.py").write_text(TOY)
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(tmp_path / "more")])
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, Kind("dice", "a die", "dice", "dice", plural="dice")))
    monkeypatch.setitem(sys.modules, "profilefit.recipes.kinds.dice", None)  # so that it is gone afterwards
    monkeypatch.delitem(sys.modules, "profilefit.recipes.kinds.dice")
    monkeypatch.setattr("profilefit.recipes.workers.cores", lambda: 1)
    Path("fair.dice").write_text("1\n2\n3\n4\n5\n6\n")
    status, out, err = command("regenerate", "fair.dice", "--seed", "7", "--out", "mine", "--json", "--quiet")
    assert (status, err) == (0, "")
    assert json.loads(out)["dice/fair"]["constants"]["m"]["regenerated"] == 3.5
    assert json.loads(Path("mine/dice/fair.json").read_text())["seed"] == 7
    assert command("report", "fair", "--fits", "mine", "--quiet") == (0, "fair: mean 3.5\n", "")
    told = json.loads(command("report", "fair", "--fits", "mine", "--json", "--quiet")[1])
    assert told["dice"]["fair"]["title"] == "Dice"
    words = ("export", "fair", "--fits", "mine", "--name", "lucky")
    assert command(*words) == (0, "const float lucky_mean = 3.5;\n", "profilefit: records of 'mine'\n")
    assert command(*words, "--n", "2")[2].endswith("--n must be left out where NAME is a die, got 'fair'\n")
    assert "fair" in kinds.names(kinds.KINDS, Path("mine"))


def test_an_exported_law_is_found_without_a_walk_through_other_kinds():
    """Files of the packages whose functions run, in a process that has them imported; one is of measures."""
    export_subject("hazard")
    entered = set()

    def profile(frame, event, _):
        path, name = frame.f_code.co_filename, frame.f_code.co_name
        own = path.startswith((str(ROOT / "profilefit"), str(ROOT / "mcml_sim")))
        if event == "call" and name != "<module>" and own:
            entered.add(path)

    sys.setprofile(profile)
    try:
        export_subject("hazard")
    finally:
        sys.setprofile(None)
    assert len(entered) <= 12
    assert not [path for path in entered if Path(path).stem in ("stack", "gaussians", "phase", "albedo_map")]
