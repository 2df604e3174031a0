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
COLUMNS = "| keys | accepted values | default |\n|---|---|---|"
HEAD = """# Keys of every file

Files of `profilefit` accept these keys. Comments in the files of `profilefit examples` explain them, with units.
The command `profilefit schema KIND` prints JSON Schema, with which editors complete and check keys of TOML files.
"""


def models() -> dict[str, tuple[type[Declared], ...]]:
    """Return the models of each kind of file: for a scene one per kind, for "choose" its further table."""
    scenes = tuple(import_module(home).read.__self__ for home, _ in SCENES.values())
    return {"scene": scenes, "stack": (StackRequest,), "recipe": (Recipe,), "photo": (Setup,), "choose": (ChooseFile,)}


def schema_of(kinds: Sequence[type[Declared]]) -> Table:
    """Return the JSON Schema of a file that is of one of several models."""
    each, known = models_json_schema([(model, "validation") for model in kinds])
    one_of = list(each.values())
    return {"$schema": DIALECT, **(one_of[0] if len(one_of) == 1 else {"oneOf": one_of}), **known}


def tables(model: type[Declared]) -> Iterator[tuple[str, str]]:
    """Yield each table of a file, its name and itself in Markdown; keys with equal values and default share a row."""
    whole, rows = model.model_json_schema(), dict[tuple[str, str, str], list[str]]()

    def within(table: str, schema: Table) -> None:
        for key, value in schema["properties"].items():
            inner, plain = (resolved(value, whole.get("$defs", {}), is_table) for is_table in (True, False))
            name = f"{table.strip('[]')}.{key}".removeprefix(".")
            for label, below in ((name, inner), (f"[{name}]", inner.get("items", {}))):
                if "properties" in below:
                    within(label, below)
            if "properties" not in {*plain, *plain.get("items", {})}:
                rows.setdefault((table, accepted(plain), code(value.get("default"))), []).append(code(key))

    within("", whole)
    for table in dict.fromkeys(at for at, *_ in rows):
        lines = (f"| {', '.join(names)} | {row[1]} | {row[2]} |" for row, names in rows.items() if row[0] == table)
        yield code(table and f"[{table}]") or "Top of the file", "\n".join([COLUMNS, *lines, ""])


def data_names() -> Iterator[str]:
    """Yield the facts and columns of tables of data, as definitions: accepted spellings, values and unit."""
    for title, model in (("Facts", Facts), ("Columns", ProfileColumns), ("Columns of a phase function", PhaseColumns)):
        yield f"**{title}**\n"
        for schema in model.model_json_schema()["properties"].values():
            unit = (accepted(schema) if "cells" in schema else schema.get("unit", "")).removeprefix("in ")
            names = ", ".join(map(code, schema["spellings"].split(", ")))
            yield f"{names}\n: {schema.get('cells', accepted(schema))}{unit and f'; unit: {unit}'}\n"


def code(value: object) -> str:
    """Return a value as code, nothing for none."""
    return "" if value in (None, "") else f"`{str(value).lower() if isinstance(value, bool) else value}`"


def page() -> str:
    """Return the page: a section for each kind of file; a table that an earlier section has is a reference to it."""
    parts, first = [HEAD], dict[str, str]()
    for kind, each in models().items():
        for name, model in zip(SCENES if kind == "scene" else ("",), each, strict=True):
            title = f"{kind.capitalize()}{f': {name}' * bool(name)}"
            parts.append(f"## {title}\n")
            for table, rows in tables(model):
                parts.append(f"{table}: as {first[rows]}.\n" if rows in first else f"{table}\n\n{rows}")
                first.setdefault(rows, f"{table} of *{title}*")
    return "\n".join([*parts, "## Data\n", *data_names()])
