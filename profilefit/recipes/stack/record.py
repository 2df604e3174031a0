"""From STACK.toml to the record of a stack, and back from the record to the laws of its three colours.

Records of stacks lie in a folder of their own, FITS/stacks: none of them is a law of every albedo.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Medium, Setting
from mcml_sim.files.text_file import read_toml
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import DamagedRecord, InputError, RecordError
from profilefit.laws.forward import ForwardHalfSpace
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import catalogue, kinds, record
from profilefit.recipes.folder import STACKS, fits_folder
from profilefit.recipes.stack import fit, quality
from profilefit.recipes.stack.file import LayerStack, read_layers, stack_of
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.recipes.work import Made, Work

Floats = NDArray[np.float64]
FOLDER, PIPELINE = STACKS, "stack"
TITLE = "Layers under a first one of any thickness"
EQUATIONS = "R_d = R_1(r) - c_1 R_1(s_1) + c_2 R_2(s_2) + m I(r), s_i^2 = r^2 + (g_i d)^2, c_i = e^(-b_i d / l)"
NOTE = (
    "No error of photons: the light is exact. No error by a model of the misfit: at each thickness the law is wrong in "
    "its own way. Constants that trade against each other have large jackknife errors; together they are the law."
)
# What texts and pictures take from a record besides its laws, by dotted key.
TOLD: Mapping[str, kinds.Kind] = {
    **dict.fromkeys(("unit", "equations", "note"), kinds.TEXT),
    "layers": kinds.LIST,
    "half_spaces": kinds.TABLE,
    **{f"half_spaces.{channel}": kinds.LIST for channel in CHANNELS},
    **dict.fromkeys(("quality.regenerated.rel", "quality.regenerated.ks"), kinds.NUMBERS),
    "quality.regenerated.delta_A": kinds.NUMBER,
    "data_digest": kinds.DIGEST,
}
TRACED_NOTE = (
    "Traced light, since a layer scatters forward: half spaces are fitted to it first, then the interfaces, from where "
    "the similar stack has them. rel is of rings from a tenth of a mean free path, noise taken off in quadrature."
)
ALIKE = 1e-4  # relative, of the constants of the half spaces that a record was fitted with and those of today
# Of STACK.toml, those that only draw a scene among them.
KEYS = (
    *("title", "unit", "illumination", "layers", "start"),
    *("scene", "surface", "uneven", "pose", "technique", "camera", "light", "choose"),
)


@dataclass(frozen=True)
class StackRequest:
    """Content of STACK.toml: a stack under a light. Its name is that of the file.

    starts  of red, green and blue: constants of each interface at which the fit begins; empty where it searches
    """

    name: str
    title: str
    illumination: str
    stack: LayerStack
    starts: tuple[Floats, ...] = ()


@dataclass(frozen=True)
class StackRecord:
    """A record, read. laws  of red, green, blue;  content  all that it says;  digest  sha256 of its file"""

    name: str
    stack: LayerStack
    laws: tuple[StackLaw, StackLaw, StackLaw]
    content: Mapping[str, Any]
    digest: str

    @property
    def setting(self) -> Setting:
        return self.laws[0].setting


def is_stack(name: str) -> bool:
    """Whether it names a file of layers, or one that is shipped, rather than a recipe."""
    try:
        if not name.endswith(".toml"):
            return not (fits_folder() / f"{name}.toml").exists() and _shipped(name).exists()
        path = Path(name)
        return path.is_file() and "layers" in read_toml(path)
    except OSError:  # no file has so long a name
        return False


def request_of(name: str) -> StackRequest:
    """The stack of STACK.toml, or of a shipped one by its name; InputError in one line."""
    path = Path(name) if name.endswith(".toml") else _shipped(name)
    return requested(str(path), read_toml(path))


def requested(file: str, content: Table) -> StackRequest:
    """The same of a file's content; keys of `KEYS` that draw a scene are not looked at."""
    tables = Tables(file, {"": KEYS})
    tables.known("", content)
    stack = read_layers(file, content)
    name = Path(file).stem
    if len(stack.names) < 2:
        raise tables.bad(
            "", "layers", "two layers or more: one is a half space, as `profilefit export hazard` has it", 1
        )
    if not kinds.is_line(name):
        raise InputError(f"{file!r}: the name of a stack must be one printable line")
    return StackRequest(
        name,
        tables.text("", "title", content, TITLE),
        tables.text("", "illumination", content, "diffuse", ILLUMINATIONS),
        stack,
        _starts(tables, content, stack),
    )


def _starts(tables: Tables, content: Table, stack: LayerStack) -> tuple[Floats, ...]:
    """Constants (interfaces, 9) of each colour, from a table [start]; InputError on others."""
    if "start" not in content:
        return ()
    table, found, interfaces = tables.table(content, "start"), [], len(stack.names) - 1
    tables.known("start", table, CHANNELS)
    names = StackLaw.constant_names()
    accepted = f"lists of {', '.join(names)}, one an interface: w in (0, 1), all but u > 0"
    for channel in CHANNELS:
        rows = table.get(channel)
        if not (isinstance(rows, list) and len(rows) == interfaces and all(map(_is_start, rows))):
            raise tables.bad("start", channel, accepted, rows)
        found.append(np.array(rows, float))
    if any(layer.g > 0 for layer in stack.media[0].layers):
        raise tables.bad("", "start", "left out where a layer scatters forward", "a table")
    return tuple(found)


def _is_start(row: Any) -> bool:
    """Whether they are constants that a law may have."""
    names = StackLaw.constant_names()
    if not (isinstance(row, list) and len(row) == len(names) and all(map(kinds.is_number, row))):
        return False
    own = dict(zip(names, row, strict=True))
    return own["w"] < 1 and all(np.isfinite(one) and (one > 0 or name == "u") for name, one in own.items())


def require_apart(stacks: Sequence[StackRequest]) -> None:
    """RecordError where two stacks would write one record."""
    names = [one.name for one in stacks]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise RecordError(f"stacks must have different names, as their records do, got {twice!r} twice")


def work(of: StackRequest) -> Work:
    """Fits of the laws of a stack's colours, a part each: half a minute to two minutes. InputError if no law fits."""
    for medium in of.stack.media:
        fit.require(medium)
    different = list(dict.fromkeys(of.stack.media))

    def finish(found: list[Any]) -> Made:
        colours = zip(CHANNELS, of.stack.media, strict=True)
        return _content(of, {name: found[different.index(medium)] for name, medium in colours}), {}

    parts = []
    for medium in different:
        starts = list(of.starts[of.stack.media.index(medium)]) if of.starts else []
        parts.append(partial(_channel, of.illumination, medium, starts))
    return Work(f"{FOLDER}/{of.name}", tuple(parts), finish)


def load(path: Path) -> StackRecord:
    """The laws of a record; RecordError on one that is damaged, or whose half spaces have other constants by now."""
    content = of_stack(path)
    with damage(path):
        stack, setting = told_stack(str(path), content), record.record_setting(content)
        if setting.n != stack.media[0].layers[0].n:
            raise InputError(f"setting.n must be that of its layers, got {setting.n:g}")
        red, green, blue = (
            _law(content, channel, medium, _tops(path, medium, setting, content["half_spaces"][channel]))
            for channel, medium in zip(CHANNELS, stack.media, strict=True)
        )
    return StackRecord(path.stem, stack, (red, green, blue), content, hashlib.sha256(path.read_bytes()).hexdigest())


def find(name: str, folder: Path) -> Path | None:
    """The record of a stack by its path, or by its name in a folder of records; None where there is none."""
    if name.endswith(".json"):
        path = Path(name)
        return path if path.exists() and record.read(path)["pipeline"] == PIPELINE else None
    return record.available(folder / FOLDER).get(name)


def matching(of: StackRequest, folder: Path) -> StackRecord | None:
    """The record in a folder that is of these very layers and this light, by whatever name; None if there is none.

    RecordError where that one is damaged; one whose layers cannot be read is passed over, with a DamagedRecord warning.
    """
    wanted = record.plain(of.stack.media)  # to the digits of a record: the mean of an image has more
    for path in record.available(folder / FOLDER).values():
        try:
            content = of_stack(path)
            with damage(path):
                media, setting = told_stack(str(path), content).media, record.record_setting(content)
        except RecordError as error:
            text = f"{path} is passed over: {str(error).removeprefix(f'{path}: ')}"
            warnings.warn(text, DamagedRecord, stacklevel=2)
            continue
        if record.plain(media) == wanted and setting.illumination == of.illumination:
            return load(path)
    return None


def of_stack(path: Path) -> dict[str, Any]:
    """What a record says; RecordError on one that cannot be read or is of no stack."""
    content = record.read(path)
    if content["pipeline"] != PIPELINE:
        raise RecordError(f"{path}: must be the record of a stack, got pipeline {content['pipeline']!r}")
    return content


@contextmanager
def damage(path: Path) -> Iterator[None]:
    """What is wrong inside a record as RecordError."""
    try:
        yield
    except RecordError:
        raise
    except InputError as error:
        raise RecordError(f"{path}: is damaged: {str(error).removeprefix(f'{path}: ')}; regenerate it") from None
    except KeyError as error:
        raise RecordError(f"{path}: is damaged: {error} is missing; regenerate it") from None


def _shipped(name: str) -> Path:
    return fits_folder() / FOLDER / f"{name}.toml"


def _channel(illumination: str, medium: Medium, starts: Sequence[Floats]) -> dict[str, Any]:
    """All that is recorded of one colour."""
    law, interfaces = fit.fitted(medium, illumination, starts)
    constants: dict[str, Any] = {}
    for number, one in enumerate(interfaces, start=1):
        errors = fit.errors(one)
        for name, value in one.law.constants().items():
            own = {"published": None, "regenerated": value, "free": True, **errors[name]}
            constants[f"{number}.{name}"] = own
    best = [one.best for one in interfaces]
    found = [
        {
            "count": len(one.found),
            "as_good": sum(each.cost <= 1.01 * one.best.cost for each in one.found),
            "results": sorted({each.result.partition(" in ")[0] for each in one.found}),
        }
        for one in interfaces
    ]
    return {
        "constants": constants,
        "half_spaces": [layer.law.constants() for layer in law.layers],
        "thicknesses": [one.thicknesses for one in interfaces],
        "quality": [quality.between(one) for one in interfaces],
        "starts": found,
        "fit": [
            {"result": one.result.partition(" in ")[0], "steps": one.steps, "condition_number": one.condition_number}
            for one in best
        ],
        "data_digest": record.digest(
            *(np.asarray(array) for one in interfaces for light in one.lights for array in light)
        ),
    }


def _content(of: StackRequest, channels: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    first = of.stack.media[0].layers[0]
    is_traced = any(layer.g > 0 for layer in of.stack.media[0].layers)
    setting = Setting(of.illumination, n=first.n, g=first.g)
    digests = "".join(one["data_digest"] for one in channels.values())
    return {
        "title": of.title,
        "law": PIPELINE,
        "pipeline": PIPELINE,
        "equations": EQUATIONS,
        "note": TRACED_NOTE if is_traced else NOTE,
        "setting": setting,
        "unit": of.stack.unit,
        "layers": of.stack.layers,
        "half_spaces": {channel: one["half_spaces"] for channel, one in channels.items()},
        "constants": {
            f"{channel}.{name}": value for channel, one in channels.items() for name, value in one["constants"].items()
        },
        "fit": {"result": _result([fit for one in channels.values() for fit in one["fit"]])},
        "quality": {"regenerated": _worst([one for of in channels.values() for one in of["quality"]])},
        "interfaces": {
            channel: {key: one[key] for key in ("fit", "quality", "starts", "thicknesses")}
            for channel, one in channels.items()
        },
        "truth": {"kind": "photons" if is_traced else "exact"},
        "preset": "quick",
        "seed": fit.SEED,
        "versions": record.versions(),
        "data_digest": hashlib.sha256(digests.encode()).hexdigest(),
    }


def _worst(found: Sequence[Mapping[str, list[float]]]) -> dict[str, Any]:
    """rel and ks of every interface and thickness that was not fitted, and the largest relative error of A [-]."""
    rel, ks, of_a = ([value for one in found for value in one[key]] for key in ("rel", "ks", "delta_A"))
    return {"rel": rel, "ks": ks, "delta_A": max(map(abs, of_a))}


def _result(fits: Sequence[Mapping[str, Any]]) -> str:
    """Of all interfaces: one that does not converge has constants that trade against each other."""
    return next((one["result"] for one in fits if one["result"] != "converged"), "converged")


def told_stack(file: str, content: Mapping[str, Any], told: Mapping[str, kinds.Kind] = TOLD) -> LayerStack:
    """The layers of a record, of which some law is; InputError where what is `told` in it is of another kind."""
    for key, kind in told.items():
        value: Any = content
        for name in key.split("."):
            if not isinstance(value, Mapping):
                raise InputError(f"{key} must be {kind.words}, got nothing")
            value = value[name]
        if not kind.accepts(value):
            raise InputError(f"{key} must be {kind.words}, got {kinds.shown(value)}")
    layers = [_told_layer(one) for one in content["layers"]]
    stack = stack_of(Tables(file, {}), layers, content["unit"])
    for medium in stack.media:
        fit.require(medium)
    return stack


def _told_layer(layer: Any) -> Table:
    """A layer of a record as a file has it. Its thickness is no image: a record opens no other file."""
    if not kinds.TABLE.accepts(layer):
        raise InputError(f"layers must be tables, got {kinds.shown(layer)}")
    if not kinds.MEASURE.accepts(layer.get("thickness")):
        raise InputError(f"thickness must be {kinds.MEASURE.words}, got {kinds.shown(layer['thickness'])}")
    return {key: value for key, value in layer.items() if value is not None}


def _tops(path: Path, medium: Medium, setting: Setting, recorded: Sequence[Mapping[str, float]]) -> list[LayerLaw]:
    """The half spaces of a medium's layers: today's, which the record's must be, or its own where it scatters forward.

    A stack's constants belong to its half spaces'. InputError where what is recorded is of another kind.
    """
    for one in recorded:
        if not isinstance(one, Mapping) or not all(map(kinds.is_number, one.values())):
            raise InputError(f"half_spaces must be tables of numbers, got {kinds.shown(one)}")
    if len(recorded) != len(medium.layers):
        raise InputError(f"half_spaces must be {len(medium.layers)}, one a layer, got {len(recorded)}")
    if any(layer.g > 0 for layer in medium.layers):
        own = [replace(setting, g=layer.g) for layer in medium.layers]
        similar = [layer.similar for layer in medium.layers]
        laws = [
            ForwardHalfSpace(each, **{name: float(one[name]) for name in ForwardHalfSpace.constant_names()})
            for each, one in zip(own, recorded, strict=True)
        ]
        return [LayerLaw(each, law, one.alpha, one.mfp) for each, law, one in zip(own, laws, similar, strict=True)]
    hazard = catalogue.load("hazard", setting=setting)
    constants = hazard.constants()
    for one in recorded:
        same = one.keys() == constants.keys()
        if not (same and np.allclose([one[name] for name in constants], list(constants.values()), rtol=ALIKE)):
            raise RecordError(f"{path}: was fitted with other constants of its half spaces; regenerate it")
    return [LayerLaw(setting, hazard, layer.alpha, layer.mfp) for layer in medium.layers]


def _law(content: Mapping[str, Any], channel: str, medium: Medium, tops: Sequence[LayerLaw]) -> StackLaw:
    law: LayerLaw | StackLaw = tops[-1]
    for number in reversed(range(len(tops) - 1)):
        values = {
            name: float(content["constants"][f"{channel}.{number + 1}.{name}"]["regenerated"])
            for name in StackLaw.constant_names()
        }
        law = StackLaw(tops[number].setting, tops[number], law, medium.layers[number].thickness, **values)
    if not isinstance(law, StackLaw):
        raise RecordError(f"record {content.get('name')!r} is damaged: it has fewer than two layers")
    return law
