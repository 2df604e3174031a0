"""Files that users write: their models, JSON Schema, and a page of their keys, columns and facts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module

from pydantic.json_schema import models_json_schema

from profilefit.measured.data import Facts, ProfileColumns
from profilefit.measured.photo.setup import Setup
from profilefit.recipes.declared import Declared, Table, accepted, resolved
from profilefit.recipes.kinds.stack import StackRequest
from profilefit.recipes.phases import PhaseColumns
from profilefit.recipes.recipe import Recipe
from profilefit.scenes import SCENES
from profilefit.studies.choose.requirements import ChooseFile

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Key = tuple[str, str, str, object]
HEAD = """# Keys of every file

What each file of `profilefit` may say, from the models that check it. `profilefit schema KIND` prints those of TOML
files as JSON Schema, by which editors complete and check keys. Tables of data have columns, and facts in comments.
"""


def models() -> dict[str, tuple[type[Declared], ...]]:
    """Return the models of each kind of file: of a scene those of `SCENES`, of "choose" what it reads besides."""
    scenes = tuple(import_module(home).read.__self__ for home, _ in SCENES.values())
    return {"scene": scenes, "stack": (StackRequest,), "recipe": (Recipe,), "photo": (Setup,), "choose": (ChooseFile,)}


def schema_of(kinds: Sequence[type[Declared]]) -> Table:
    """Return the JSON Schema of a file that is of one of several models."""
    each, known = models_json_schema([(model, "validation") for model in kinds])
    one_of = list(each.values())
    return {"$schema": DIALECT, **(one_of[0] if len(one_of) == 1 else {"oneOf": one_of}), **known}


def keys(model: type[Declared]) -> Iterator[Key]:
    """Yield table, key, accepted values and default of each key of a file; the default is None where there is none."""
    whole = model.model_json_schema()

    def within(table: str, schema: Table) -> Iterator[Key]:
        for key, value in schema["properties"].items():
            inner = resolved(value, whole.get("$defs", {}), True)
            name = f"{table}.{key}".removeprefix(".")
            if "properties" in inner:
                yield from within(name, inner)
            elif "properties" in inner.get("items", {}):
                yield from within(f"[{name}]", inner["items"])
            plain = resolved(value, whole.get("$defs", {}), False)
            if "properties" not in plain and "properties" not in plain.get("items", {}):
                yield table, key, accepted(plain), value.get("default")

    yield from within("", whole)


def data_rows() -> Iterator[str]:
    """Yield a row for each fact and column of tables of data: name, accepted spellings, accepted values and unit."""
    for of, model in (("fact", Facts), ("column", ProfileColumns), ("phase function's column", PhaseColumns)):
        for name, schema in model.model_json_schema()["properties"].items():
            spellings = ", ".join(map(code, schema["spellings"].split(", ")))
            unit = accepted(schema) if "cells" in schema else schema.get("unit", "")
            yield f"| {of} {code(name)} | {spellings} | {schema.get('cells', accepted(schema))} | {unit} |"


def code(value: object) -> str:
    """Return a value as code, nothing for none."""
    return "" if value in (None, "") else f"`{value}`"


def page() -> str:
    """Return the page: a table for each kind of file."""
    parts = [HEAD]
    for kind, each in models().items():
        for name, model in zip(SCENES if kind == "scene" else ("",), each, strict=True):
            row = "| {} | {} | {} | {} |".format
            rows = [row(code(table), code(key), words, code(default)) for table, key, words, default in keys(model)]
            title = f"## {kind.capitalize()}{f': {name}' * bool(name)}"
            parts.append("\n".join([title, "", "| table | key | accepted | default |", "|---|---|---|---|", *rows, ""]))
    head = "## Data\n\n| name | accepted spellings | accepted values | unit |\n|---|---|---|---|"
    return "\n".join([*parts, head, *data_rows(), ""])
