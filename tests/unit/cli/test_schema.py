"""profilefit schema: what editors check by it is what the commands read."""

import tomllib
from pathlib import Path

import jsonschema
import pytest

from mcml_sim.files.text_file import as_json
from profilefit.cli.schema import FILES
from profilefit.report.tables.keys_table import models, schema_of

ROOT = Path(__file__).resolve().parents[3]
SHIPPED = [path for folder in ("examples", "fits", "fits/stacks") for path in sorted((ROOT / folder).glob("*.toml"))]


def kind_of(content):
    if "scene" in content:
        return "scene"
    return "stack" if "layers" in content else "photo" if "medium" in content else "recipe"


@pytest.fixture(scope="module")
def schemas():
    return {kind: jsonschema.Draft202012Validator(schema_of(models()[kind])) for kind in FILES}


def test_shipped_files_are_valid(schemas):
    contents = [tomllib.loads(path.read_text(encoding="utf-8")) for path in SHIPPED]
    assert {kind_of(content) for content in contents} == set(FILES)
    for path, content in zip(SHIPPED, contents, strict=True):
        assert [error.message for error in schemas[kind_of(content)].iter_errors(content)] == [], path
        assert not schemas[kind_of(content)].is_valid({**content, "colour": 1})
    assert not schemas["photo"].is_valid({"medium": {"n": -1.0}})


def test_the_command_prints_it(command, schemas):
    status, out, err = command("schema", "stack")
    assert (status, err) == (0, "")
    assert out == as_json(schemas["stack"].schema)


def test_another_kind_is_one_line(command):
    status, out, err = command("schema", "fog")
    assert (status, out) == (2, "")
    assert err == "profilefit: KIND must be one of scene, stack, recipe, photo, got 'fog'\n"
