"""Kinds of records: one signature for all, one order of names, and a sixth kind that is one file and one line."""

import inspect
import json
import sys
from pathlib import Path

import pytest

from profilefit.errors import InputError, RecordError
from profilefit.recipes import kinds
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.kinds import KINDS, Kind, KindModule, records_of
from profilefit.recipes.regenerate import requests_of
from tests.unit.cli.conftest import command

__all__ = ["command"]
BY_KEY = {kind.key: kind for kind in KINDS}
TOY = '''\
"""Dice: the mean of numbers, one a line."""

from functools import partial
from pathlib import Path

from mcml_sim import Setting
from profilefit.recipes import record
from profilefit.recipes.run import Work
from rich.text import Text


def find(name, folder):
    path = record.named(name, folder / "dice", "dice")
    return None if path is None else read(path)


def request(name):
    return Path(name) if name.endswith(".dice") else None


def fit(path, run):
    throws = [float(line) for line in path.read_text().split()]
    return Work(f"dice/{path.stem}", (partial(sum, throws),), lambda sums: (content(sums[0] / len(throws), run), {}))


def content(mean, run):
    error = {"published": None, "regenerated": mean, "free": True, "statistical_error": 0.1}
    about = {"title": "Dice", "law": "dice", "pipeline": "dice", "equations": "m", "setting": Setting()}
    run_of = {"preset": run.preset, "seed": run.seed, "truth": {"kind": "throws"}}
    return {**about, **run_of, "constants": {"m": error}, "fit": {"result": "converged"}, "quality": quality(mean)}


def quality(mean):
    return {"regenerated": {"rel": [abs(mean / 3.5 - 1)]}}


def read(path):
    return record.read(path)


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


@pytest.mark.parametrize(
    ("name", "key"),
    [
        *(
            ("hazard", "law"),
            ("dipole", "law"),
            ("liang-inverse-whole", "law"),
            ("skin", "stack"),
            ("petzold", "phase"),
        ),
        *((name, "albedo_map") for name in ("albedo liang", "chiang", "albedo-rational-diffuse")),
    ],
)
def test_a_name_is_that_of_the_first_kind_that_has_it(name, key):
    for kind in KINDS:
        if (found := kind.find(name)) is not None:
            break
    assert (kind.key, found is not None) == (key, True)


def test_a_record_by_its_path_is_of_its_own_kind():
    for folder, key in (("stacks", "stack"), ("gaussians", "gaussians"), ("phases", "phase")):
        path = next((fits_folder() / folder).glob("*.json"))
        assert [kind.key for kind in KINDS if kind.find(str(path)) is not None] == [key]


def test_every_name_that_ships_is_requested_of_its_kinds():
    found = requests_of()
    keys = {key: [request for kind, request in found if kind.key == key] for key in BY_KEY}
    assert {kind.key for kind, _ in found} == set(BY_KEY)
    assert [one.name for one in keys["stack"]] == [one.name for one in keys["gaussians"]]
    assert {one.pipeline for one in keys["albedo_map"]} == {"albedo"}
    assert len(found) == sum(len(list(fits_folder().glob(f"{place}*.json"))) for place in ("", "*/")) - len(
        list((fits_folder() / "evidence").glob("*.json"))
    )


def test_options_that_say_nothing_of_a_kind_are_refused():
    for name, words in (("skin", "a stack"), ("petzold", "a phase function")):
        with pytest.raises(InputError, match=rf"^n must be left out where NAME is {words}, got '{name}'"):
            next(kind for kind in KINDS if kind.find(name) is not None).find(name, n=1.4)
    assert BY_KEY["law"].find("hazard", n=1.4).setting.n == 1.4


def test_records_of_names_are_those_beside_the_first(tmp_path):
    found = records_of(["skin", "hazard", "petzold"])
    keys = ["stack", "gaussians", "law", "phase"]
    assert [(kind.key, name) for kind, name, _ in found] == list(
        zip(keys, ["skin", "skin", "hazard", "petzold"], strict=True)
    )
    with pytest.raises(RecordError, match=r"there is no record 'petzhold' in .*; stacks are heart, "):
        records_of(["petzhold"])
    with pytest.raises(RecordError, match="has no records"):
        records_of(["skin"], tmp_path)


@pytest.fixture
def sixth(monkeypatch, tmp_path):
    """Two files are touched: the toy's own, and a line of the table of kinds."""
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "dice.py").write_text(TOY)
    monkeypatch.setattr(kinds, "__path__", [*kinds.__path__, str(tmp_path / "more")])
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, Kind("dice", "a die", "dice", "dice", plural="dice")))
    yield
    sys.modules.pop("profilefit.recipes.kinds.dice", None)


def test_a_sixth_kind_is_regenerated_reported_exported_and_completed(sixth, command, monkeypatch):
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
