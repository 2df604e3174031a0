"""Files of users and records, declared as models: each key with its type, its range and its words in one place.

A mistake is one line: the file, the table and the key, what is accepted there, and what was got. What is accepted is
said by the JSON Schema of the model, which editors and the tables of keys in the docs read, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import inf
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PrivateAttr, ValidationError
from pydantic.annotated_handlers import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from mcml_sim.media.arrays import is_number, shown
from profilefit.errors import InputError

Table = dict[str, Any]
Range = tuple[float, float]
LONGEST_TEXT = 60  # characters
LONGEST_RECORDED = 1000  # characters of a text in a record or recipe; ours have 256
LENGTHS = 1e-9, 1e9  # between which lengths have squares and ratios to compute with
MOST_ASIDE = 1e6  # ratio of the ends of a range: beyond, it is a slip of the pen
COUNTS = {2: "two", 3: "three"}


class Refused(ValueError):
    """Value that a validator refuses.

    Attributes:
        accepted: what is accepted, in words.
        got: the value, None for none.
        place: keys and numbers from the validated value to the refused one.
    """

    def __init__(self, accepted: str, got: object, *place: str | int) -> None:
        super().__init__(accepted)
        self.accepted, self.got, self.place = accepted, got, place


class Misplaced(ValueError):
    """InputError whose message is to name the table at a place, seen from the validated value."""

    def __init__(self, error: InputError, *place: str | int) -> None:
        super().__init__(str(error))
        self.error, self.place = error, place


@contextmanager
def at(*place: str | int) -> Iterator[None]:
    """Let a message of an InputError name the table at a place, seen from the validated value."""
    try:
        yield
    except InputError as error:
        raise Misplaced(error, *place) from None


class OneOf:
    """Texts that a key accepts, as an annotation of `str`."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.literal_schema(list(self.names))


class NumberRange:
    """Two numbers, the smaller first, or one that is both, as an annotation of `Range`."""

    def __init__(self, least: float = 0.0, most: float = inf) -> None:
        self.least, self.most = least, most

    @property
    def words(self) -> str:
        """Accepted values in words."""
        limits = f"in {self.least:g} ... {self.most:g}" if self.least else f"> 0 and <= {self.most:.3g}"
        return f"a number {limits.removesuffix(' and <= inf')}, or two of them, the smaller first"

    def read(self, value: Any) -> Range:
        """Return both ends; Refused on any other value."""
        ends = value if isinstance(value, list) else [value, value]
        numbers = len(ends) == 2 and all(map(is_number, ends))
        inside = numbers and 0 < ends[0] <= ends[1] <= self.most and self.least <= ends[0]
        if not (inside and ends[1] < MOST_ASIDE * ends[0]):
            raise Refused(self.words, value)
        return float(ends[0]), float(ends[1])

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        number = {"type": "number", "exclusiveMinimum": 0}
        pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
        return {"accepted": self.words, "anyOf": [number, pair]}


class Keys:
    """Keys of a table, each with its type or its own `Keys`, as an annotation of `Table`; there may be others, too.

    optional  keys that may be absent, unless they are of `required`, too; "*" has the type of all others
    """

    def __init__(self, optional: Mapping[str, Any] = {}, /, **required: Any) -> None:
        self.optional, self.required = optional, required

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        fields, others = {}, Table()
        for key, kind in {**self.optional, **self.required}.items():
            schema = handler.generate_schema(Annotated[Table, kind] if isinstance(kind, Keys) else kind)
            fields[key] = core_schema.typed_dict_field(schema, required=key in self.required)
        if "*" in fields:
            others = {"extra_behavior": "allow", "extras_schema": fields.pop("*")["schema"]}
        config = core_schema.CoreConfig(strict=True, allow_inf_nan=False)  # as of `Declared`, which is not passed on
        return core_schema.typed_dict_schema(fields, config=config, **others)


def words(accepted: str = "", **schema: Any) -> Any:
    """Return an annotation that says in these words what a key accepts, and what else its JSON Schema has."""
    return Field(json_schema_extra={"accepted": accepted, **schema} if accepted else schema)


def printable(text: str) -> str:
    """Return a text; ValueError where it has control characters."""
    if not text.isprintable():
        raise ValueError("control characters")
    return text


def is_line(value: object) -> bool:
    """Return whether a value is one line of printable text, without control characters or hidden ones."""
    return isinstance(value, str) and len(value) <= LONGEST_RECORDED and value.isprintable()


LISTED = Field(strict=False)  # annotates a tuple, which a file writes as a list
Text = Annotated[str, Field(max_length=LONGEST_TEXT), AfterValidator(printable)]
Line = Annotated[str, Field(max_length=300), AfterValidator(printable)]
Seed = Annotated[int, Field(ge=0, le=2**31)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Tolerance = Annotated[float, Field(gt=0.0, le=1.0)]
Shares = Annotated[tuple[Share, Share, Share], LISTED]


class Declared(BaseModel):
    """Table of a file; a key that is no field of it is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    _file: str = PrivateAttr("")

    @property
    def file(self) -> str:
        """Name of the file that it was read from."""
        return self._file

    @classmethod
    def of(cls, file: str, content: object, error: type[InputError] = InputError) -> Self:
        """Return the table of a file's content.

        Raises:
            InputError: one line with file, table and key, what is accepted and what was got; of the class `error`.
        """
        try:
            read = cls.model_validate(content, context=file)
        except ValidationError as mistakes:
            raise _refusal(cls, file, content, mistakes, error) from None
        read._file = file
        return read

    @classmethod
    def parsed(cls, key: str, value: object, label: str, context: object = None) -> Any:
        """Return the value of a key alone, where the others have defaults; an InputError calls the key by its label."""
        try:
            return getattr(cls.model_validate({key: value}, context=context), key)
        except ValidationError as mistakes:
            cause = mistakes.errors()[0].get("ctx", {}).get("error")
            told = getattr(cause, "accepted", "") or accepted(cls.model_json_schema()["properties"][key])
            raise InputError(f"{label} must be {told}, got {shown(value)}") from None

    def changed(self, file: str | None = None, **values: Any) -> Self:
        """Return an unchecked copy with other values; of a table only some keys may be given, as in water={"n": 1.3}.

        file  name of the copy's file
        """
        for name, value in values.items():
            own = getattr(self, name)
            values[name] = own.changed(**value) if isinstance(own, Declared) and isinstance(value, dict) else value
        copy = self.model_copy(update=values)
        copy._file = self._file if file is None else file
        for name in set(vars(copy)) - set(type(copy).model_fields):  # cached properties of other values
            del vars(copy)[name]
        return copy


def accepted(schema: Table) -> str:
    """Return in words what a key accepts by its JSON Schema."""
    if "accepted" in schema:
        return str(schema["accepted"])
    if "enum" in schema or "const" in schema:
        return f"one of {', '.join(map(str, schema.get('enum', [schema.get('const')])))}"
    kind = schema.get("type")
    if kind == "boolean":
        return "true or false"
    if kind == "string":
        return f"a text of {schema['maxLength']} characters at most" if "maxLength" in schema else "a text"
    if kind == "array":
        items = schema["prefixItems"]
        return accepted(items[0]).replace("a ", f"{COUNTS[len(items)]} ", 1).replace("number", "numbers", 1)
    noun = "a number" if kind == "number" else "a whole number"
    least, above, most = (schema.get(key) for key in ("minimum", "exclusiveMinimum", "maximum"))
    told = [(sign, f"{at:.10g}") for sign, at in ((">=", least), (">", above), ("<=", most)) if at is not None]
    if least is not None and most is not None:
        return f"{noun} in {told[0][1]} ... {told[1][1]}"
    if not told and kind == "number":
        return "a finite number"
    return f"{noun} {' and '.join(' '.join(one) for one in told)}".rstrip()


def _refusal(
    model: type[BaseModel], file: str, content: object, mistakes: ValidationError, error: type[InputError]
) -> InputError:
    """Return the error of the first mistake; keys that are not known come first."""
    first = min(mistakes.errors(include_url=False), key=lambda mistake: mistake["type"] != "extra_forbidden")
    cause = first.get("ctx", {}).get("error")
    place = (*first["loc"], *getattr(cause, "place", ()))
    cause = cause.error if isinstance(cause, Misplaced) else cause
    tables, key, schema, value = _located(model, content, place)
    if first["type"] == "extra_forbidden":
        where = ".".join(filter(None, (*tables, key)))
        keys = ", ".join(schema["properties"])
        return error(f"{file}: {f'[{where}] ' * bool(where)}keys must be of {keys}, got {shown(place[-1])}")
    is_table = schema.get("type") == "object" or "properties" in schema.get("items", {})
    if isinstance(cause, InputError):
        where = ".".join(filter(None, (*tables, key * is_table)))
        kind = type(cause) if issubclass(type(cause), error) else error
        return kind(f"{file}: {f'[{where}] ' * bool(where)}{cause}")
    name, is_one = ".".join((*tables, key)), schema.get("type") == "object"
    if isinstance(cause, Refused):
        told, value = cause.accepted, cause.got
    elif not is_table:
        told = accepted(schema)
    elif value is None:
        return error(f"{file}: table {f'[{name}]' if is_one else f'[[{name}]]'} is missing")
    else:
        told = f"a table [{name}]" if is_one else f"tables [[{name}]]"
    where, got = f"[{'.'.join(tables)}] " * bool(tables), "nothing" if value is None else shown(value)
    return error(f"{file}: {where}{key} must be {told}, got {got}")


def _located(model: type[BaseModel], content: Any, place: tuple[Any, ...]) -> tuple[list[str], str, Table, Any]:
    """Return the tables around a place, its key, the JSON Schema of this key, and its value."""
    whole = model.model_json_schema()
    tables, key, schema, value = [], "", whole, content
    for part in place:
        inner = schema.get("properties", {}).get(part, schema.get("additionalProperties"))
        if isinstance(inner, dict):
            tables += [key] * bool(key)
            key, schema = str(part), inner
            value = value.get(part) if isinstance(value, dict) else None
        elif isinstance(part, int) and isinstance(value, list):
            if "items" not in schema or part >= len(value) or not isinstance(value[part], dict):
                break  # within a key's value, of which no place is told
            key, schema, value = f"{key} {part + 1}", schema["items"], value[part]
        schema = resolved(schema, whole.get("$defs", {}), isinstance(value, dict))
    return tables, key, schema, value


def resolved(schema: Table, known: Table, is_table: bool) -> Table:
    """Return a schema without references; of several kinds the one for a table, or for anything else."""
    if "$ref" in schema:
        return {**known[schema["$ref"].rpartition("/")[2]], **{k: v for k, v in schema.items() if k != "$ref"}}
    kinds = schema.get("anyOf") or schema.get("oneOf")
    if (kinds and "accepted" not in schema) or (kinds and is_table):
        plain = [resolved(kind, known, is_table) for kind in kinds if kind.get("type") != "null"]
        other = schema if "accepted" in schema else plain[0]
        return next((kind for kind in plain if (kind.get("type") == "object") == is_table), other)
    if isinstance(schema.get("items"), dict) and "$ref" in schema["items"]:
        return {**schema, "items": resolved(schema["items"], known, True)}
    return schema
