"""Stacks of layers under a first one of any thickness: from STACK.toml to a record, and back to three laws.

Records lie in a folder of their own, FITS/stacks: none of them is a law of every albedo.
"""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, model_validator

from mcml_sim import Medium, Setting, exact
from mcml_sim.files.whole_file import read_toml
from mcml_sim.media.arrays import Floats, is_number, require
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import DamagedRecord, InputError, RecordError
from profilefit.laws.stack import LayerLaw, StackLaw
from profilefit.laws.two_parts import ForwardHalfSpace
from profilefit.materials import CHANNELS
from profilefit.recipes import record
from profilefit.recipes.declared import LISTED, Declared, Keys, OneOf, Refused, Table, Text, is_line, words
from profilefit.recipes.folder import STACKS, fits_folder, is_file
from profilefit.recipes.record import SOLVED, Count, Digest, LawRecord, Measure, Numbers, WholeRecord, damage
from profilefit.recipes.run import LAWS, RecipeRun, RecordContent, Work
from profilefit.recipes.stack import fit as stacks
from profilefit.recipes.stack.file import Layered, LayerStack, read_layers
from profilefit.recipes.stack.fit import USUAL, TracedRings, Tracing

PIPELINE = "stack"
TITLE = "Layers under a first one of any thickness"
EQUATIONS = "R_d = R_1(r) - c_1 R_1(s_1) + c_2 R_2(s_2) + m I(r), s_i^2 = r^2 + (g_i d)^2, c_i = e^(-b_i d / l)"
NOTE = (
    "No error of photons: the light is exact. No error by a model of the misfit: at each thickness the law is wrong in "
    "its own way. Constants that trade against each other have large jackknife errors; together they are the law."
)
TRACED_NOTE = (
    "Traced light, since a layer scatters forward: half spaces are fitted to it first, then the interfaces, from where "
    "the similar stack has them. rel is of rings from a tenth of a mean free path, noise taken off in quadrature."
)
BY_THICKNESS = ("thickness", "rel", "ks", "delta_A")  # errors of an interface where none was fitted
EQUAL = 1e-4  # relative, of the constants of the half spaces that a record was fitted with and those of today
NEAR_TRACED = 0.1  # radius from which on rel is of traced light [mfp]
STARTS = f"lists of {', '.join(StackLaw.constant_names())}, one per interface: w in (0, 1), all but u > 0"
OF_SCENES = ("scene", "surface", "uneven", "pose", "technique", "camera", "light", "choose")  # tables and keys


def _starts(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    names = StackLaw.constant_names()
    for row in rows:
        own = dict(zip(names, row, strict=False))
        if len(row) != len(names) or own["w"] >= 1 or any(own[name] <= 0 for name in names if name != "u"):
            raise Refused(STARTS, [list(one) for one in rows])
    return rows


Row = Annotated[tuple[float, ...], LISTED]
Starts = Annotated[tuple[Row, ...], LISTED, AfterValidator(_starts), words(STARTS)]


class StartTable(Declared):
    """Table [start]: constants of each interface at which the fit of a colour begins."""

    red: Starts
    green: Starts
    blue: Starts


class StackRequest(Layered):
    """Content of STACK.toml: a stack under a light. Its name is that of the file; a fit without `start` searches."""

    title: Text = TITLE
    illumination: Annotated[str, OneOf(*ILLUMINATIONS)] = "diffuse"
    start: StartTable | None = None

    @property
    def name(self) -> str:
        return Path(self.file).stem

    @classmethod
    def of(cls, file: str, content: object, error: type[InputError] = InputError) -> Self:
        """Return the stack of a file's content; InputError as for any table, and on a file without a printable name."""
        if not is_line(Path(file).stem):
            raise error(f"{file!r}: the name of a stack must be one printable line")
        return super().of(file, content, error)

    @property
    def media(self) -> tuple[Medium, Medium, Medium]:
        return self.stack.media

    @cached_property
    def starts(self) -> tuple[Floats, ...]:
        """Constants (interfaces, 9) of each colour at which the fit begins; empty where it searches."""
        start = self.start
        return () if start is None else tuple(np.array(getattr(start, channel), float) for channel in CHANNELS)

    @model_validator(mode="after")
    def _fitted(self) -> Self:
        if len(self.layers) < 2:
            accepted = "two layers or more: one is a half space, as `profilefit export hazard` has it"
            raise Refused(accepted, 1, "layers")
        for channel in CHANNELS if self.start is not None else ():
            rows = getattr(self.start, channel)
            if len(rows) != len(self.layers) - 1:
                raise Refused(STARTS, [list(row) for row in rows], "start", channel)
        if self.start is not None and any(layer.g for layer in self.layers):
            raise Refused("left out where a layer scatters forward", "a table", "start")
        return self


QUALITY = Keys(regenerated=Keys(rel=Numbers, ks=Numbers, delta_A=float))
HalfSpaces = Annotated[list[Any], words("a list")]  # of what is compared with the laws of today
Thickness = Annotated[Table, Keys({"thickness": Measure})]  # no image: a record is no reason to open another file


class UsedStack(LawRecord):
    """Record with what shader sources and pictures take from it besides its laws."""

    unit: str
    equations: str
    note: str
    layers: list[Thickness]
    half_spaces: Annotated[Table, Keys(**dict.fromkeys(CHANNELS, HalfSpaces))]
    quality: Annotated[Table, QUALITY]
    data_digest: Digest


ShownLayer = Annotated[Table, Keys(name=str, thickness=Measure, n=float, g=float, mu_a=Numbers, mu_s=Numbers)]
OfThickness = Annotated[Table, Keys(**dict.fromkeys(BY_THICKNESS, Numbers))]
Solved = Annotated[Table, Keys(**SOLVED, steps=Count)]
Started = Annotated[Table, Keys(as_good=Count, count=Count)]
INTERFACES = Keys(quality=list[OfThickness], fit=list[Solved], starts=list[Started])


class ShownStack(WholeRecord, LawRecord):
    """Record with what `profilefit report` shows of a stack."""

    unit: str
    layers: list[ShownLayer]
    quality: Annotated[Table, QUALITY]
    interfaces: Annotated[Table, Keys(**dict.fromkeys(CHANNELS, INTERFACES))]

    @model_validator(mode="after")
    def _matching(self) -> Self:
        """Refuse a list that is not as long as others, and a record without a constant of its laws."""
        count = len(self.layers) - 1
        for channel, tables in self.interfaces.items():
            for key, rows in tables.items():
                if len(rows) != count:
                    raise Refused(f"{count}, one per interface", len(rows), "interfaces", channel, key)
            for number, row in enumerate(tables["quality"]):
                if len(set(map(len, row.values()))) > 1:
                    raise Refused("lists of one length", row, "interfaces", channel, "quality", number)
        places, names = interfaces({"layers": self.layers}), StackLaw.constant_names()
        self.require_constants(f"{channel}.{number}.{name}" for channel, number in places for name in names)
        return self


@dataclass(frozen=True)
class StackRecord:
    """Record of a stack: its layers, laws of red, green and blue, all that it says, and SHA-256 of its file."""

    name: str
    stack: LayerStack
    laws: tuple[StackLaw, StackLaw, StackLaw]
    content: Mapping[str, Any]
    digest: str

    @property
    def setting(self) -> Setting:
        return self.laws[0].setting


def find(name: str, folder: Path) -> StackRecord | None:
    """Return the laws of a stack by the path of its record or by its name in a folder; None where there is none."""
    path = record.named(name, folder / STACKS, PIPELINE)
    return None if path is None else load(path)


def request(name: str) -> StackRequest | None:
    """Return the stack of a file of layers or of a shipped one by its name, None if it is of something else."""
    path = Path(name)
    if not name.endswith(".toml"):
        path = fits_folder() / STACKS / f"{name}.toml"
        if not is_file(path) or is_file(fits_folder() / path.name):
            return None
    elif not is_file(path) or "layers" not in read_toml(path):
        return None
    return requested(str(path), read_toml(path))


def requested(file: str, content: Table) -> StackRequest:
    """Return the stack of a file's content, checked; keys that draw a scene are not looked at."""
    return StackRequest.of(file, {key: value for key, value in content.items() if key not in OF_SCENES})


def fit(of: StackRequest, run: RecipeRun) -> Work:
    """Return the record to be made of a stack, a part for each colour that differs; InputError if no law fits."""
    for medium in of.media:
        stacks.require(medium)
    different = list(dict.fromkeys(of.media))
    parts = []
    for number, medium in enumerate(different):
        starts = list(of.starts[of.media.index(medium)]) if of.starts else []
        parts.append(partial(_channel, of.illumination, medium, starts, Tracing.of(run, f"{of.name}-{number}", medium)))

    def finish(results: list[Any]) -> RecordContent:
        colours = zip(CHANNELS, of.media, strict=True)
        return _content(of, run, {name: results[different.index(medium)] for name, medium in colours}), {}

    return Work(f"{STACKS}/{of.name}", tuple(parts), finish, order=(LAWS, 1, 0))


def quality(interface: stacks.Interface, tracing: Tracing = USUAL) -> dict[str, list[float]]:
    """Measure rel, ks and the relative error of A at thicknesses between those that were fitted [length]."""
    law, fitted = interface.law, interface.thicknesses
    d, illumination = np.sqrt(fitted[:-1] * fitted[1:]), law.setting.illumination
    if interface.is_traced:
        numbered = enumerate(d, start=len(d) + 1)  # after those that were fitted
        rings = [stacks.rings_of(interface.medium, at, illumination, number, tracing) for number, at in numbered]
        measured = [of_rings(law, at, own) for at, own in zip(d, rings, strict=True)]
    else:
        measured = [_of_exact(interface, float(at)) for at in d]
    rel, _, ks, delta_a = (list(values) for values in zip(*measured, strict=True))
    return {"thickness": d.tolist(), "rel": rel, "ks": ks, "delta_A": delta_a}


def read(path: Path) -> dict[str, Any]:
    """Return all that a record says, of which a report makes no law; RecordError on one that is damaged."""
    return record.read_of(path, PIPELINE, "the record of a stack", ShownStack)


def load(path: Path) -> StackRecord:
    """Return the laws of a record; RecordError if it is damaged, or if its half spaces have other constants by now."""
    content, stack, setting = _opened(path)
    with damage(path):
        if setting.n != stack.media[0].layers[0].n:
            raise InputError(f"setting.n must be that of its layers, got {setting.n:g}")
        red, green, blue = (
            _law(content, channel, medium, _tops(path, medium, setting, content["half_spaces"][channel]))
            for channel, medium in zip(CHANNELS, stack.media, strict=True)
        )
    return StackRecord(path.stem, stack, (red, green, blue), content, hashlib.sha256(path.read_bytes()).hexdigest())


def matching(of: StackRequest, folder: Path) -> StackRecord | None:
    """Return the record in a folder of these very layers and this light, by whatever name; None if there is none.

    RecordError where that one is damaged; one whose layers cannot be read is passed over, with a DamagedRecord warning.
    """
    media = record.plain(of.media)  # to the digits of a record: the mean of an image has more
    for path in record.available(folder / STACKS).values():
        try:
            _, own, setting = _opened(path)
        except RecordError as error:
            text = f"{path} is passed over: {str(error).removeprefix(f'{path}: ')}"
            warnings.warn(text, DamagedRecord, stacklevel=2)
            continue
        if record.plain(own.media) == media and setting.illumination == of.illumination:
            return load(path)
    return None


def _opened(path: Path) -> tuple[dict[str, Any], LayerStack, Setting]:
    """Return what a record says, its layers and its setting; RecordError where it is damaged, or of no stack."""
    content = record.read_of(path, PIPELINE, "the record of a stack", UsedStack)
    with damage(path):
        return content, recorded_stack(str(path), content), record.record_setting(content)


def interfaces(content: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Return the colour and number of each interface of a record, from the surface down, colour by colour."""
    return ((channel, number) for channel in CHANNELS for number in range(1, len(content["layers"])))


def recorded_stack(file: str, content: Mapping[str, Any]) -> LayerStack:
    """Return the layers of a record that has a list of them; InputError where no law fits them."""
    layers = [{key: value for key, value in layer.items() if value is not None} for layer in content["layers"]]
    stack = read_layers(file, {"unit": content["unit"], "layers": layers})
    for medium in stack.media:
        stacks.require(medium)
    return stack


def header(of: StackRequest, run: RecipeRun, pipeline: str, equations: str, notes: tuple[str, str]) -> dict[str, Any]:
    """Return what the records of a stack say of its layers and light; notes  on exact light, and on traced light."""
    first = of.media[0].layers[0]
    is_traced = any(layer.g > 0 for layer in of.media[0].layers)
    return {
        "law": pipeline,
        "pipeline": pipeline,
        "equations": equations,
        "note": notes[is_traced] + ("" if is_traced else run.unused()),
        "setting": Setting(of.illumination, n=first.n, g=first.g),
        "unit": of.stack.unit,
        "layers": of.stack.layers,
        "truth": {"kind": "photons" if is_traced else "exact"},
        "preset": run.preset,
        "versions": record.versions(),
    }


def of_rings(law: StackLaw, thickness: float, rings: TracedRings) -> tuple[float, float, float, float]:
    """Measure a law by traced light: rel, the noise that was taken off it in quadrature, ks, relative error of A [-].

    rel is of rings from a tenth of the first layer's mean free path.
    """
    within = np.asarray(law.cdf(rings.edges, thickness)) * float(law.total(thickness))
    counts = (rings.weight > 0) & (rings.edges[:-1] > NEAR_TRACED * law.layers[0].mfp)
    rel = float(np.mean(np.abs(np.diff(within)[counts] / rings.energy[counts] - 1.0)))
    # The mean size of a Gaussian's values is sqrt(2 / pi) of its spread.
    noise = float(np.sqrt(2.0 / np.pi) * np.mean(rings.noise[counts]))
    light = np.cumsum(np.where(rings.weight > 0, rings.energy, np.diff(within)))
    ks = float(np.max(np.abs(light - within[1:]))) / rings.whole
    return float(np.sqrt(max(rel**2 - noise**2, 0.0))), noise, ks, float(law.total(thickness)) / rings.whole - 1


def _of_exact(interface: stacks.Interface, thickness: float) -> tuple[float, float, float, float]:
    law, medium = interface.law, interface.medium
    light = exact.solve(medium.with_first(thickness), law.setting.illumination, stacks.NODES)
    r = stacks.radii(medium)
    share = np.asarray(light.cdf(r))
    near = r[share <= stacks.LAST_SHARE]
    relative = np.asarray(law.profile(near, thickness)) / np.asarray(light.profile(near)) - 1.0
    ks = float(np.max(np.abs(np.asarray(law.cdf(r, thickness)) - share)))
    return float(np.mean(np.abs(relative))), 0.0, ks, float(law.total(thickness)) / light.reflectance - 1


def _channel(illumination: str, medium: Medium, starts: Sequence[Floats], tracing: Tracing) -> dict[str, Any]:
    """Fit one colour, and return all that is recorded of it."""
    law, fitted = stacks.fitted(medium, illumination, starts, tracing)
    constants: dict[str, Any] = {}
    for number, interface in enumerate(fitted, start=1):
        errors = stacks.errors(interface)
        for name, value in interface.law.constants().items():
            constants[f"{number}.{name}"] = {"published": None, "regenerated": value, "free": True, **errors[name]}
    return {
        "constants": constants,
        "half_spaces": [layer.law.constants() for layer in law.layers],
        "thicknesses": [interface.thicknesses for interface in fitted],
        "quality": [quality(interface, tracing) for interface in fitted],
        "starts": [
            {
                "count": len(interface.solutions),
                "as_good": sum(each.cost <= 1.01 * interface.best.cost for each in interface.solutions),
                "results": sorted({each.result.partition(" in ")[0] for each in interface.solutions}),
            }
            for interface in fitted
        ],
        "fit": [
            {"result": best.result.partition(" in ")[0], "steps": best.steps, "condition_number": best.condition_number}
            for best in (interface.best for interface in fitted)
        ],
        "data_digest": record.digest(
            *(np.asarray(array) for interface in fitted for light in interface.lights for array in light)
        ),
    }


def _content(of: StackRequest, run: RecipeRun, channels: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    results = [fit["result"] for one in channels.values() for fit in one["fit"]]
    measured = [each for one in channels.values() for each in one["quality"]]
    rel, ks, of_a = ([value for each in measured for value in each[key]] for key in ("rel", "ks", "delta_A"))
    digests = "".join(one["data_digest"] for one in channels.values())
    return {
        **header(of, run, PIPELINE, EQUATIONS, (NOTE, TRACED_NOTE)),
        "title": of.title,
        "half_spaces": {channel: one["half_spaces"] for channel, one in channels.items()},
        "constants": {
            f"{channel}.{name}": value for channel, one in channels.items() for name, value in one["constants"].items()
        },
        # One that does not converge has constants that trade against each other.
        "fit": {"result": record.first_failure(results)},
        "quality": {"regenerated": {"rel": rel, "ks": ks, "delta_A": max(map(abs, of_a))}},
        "interfaces": {
            channel: {key: one[key] for key in ("fit", "quality", "starts", "thicknesses")}
            for channel, one in channels.items()
        },
        "seed": run.seed,
        "data_digest": hashlib.sha256(digests.encode()).hexdigest(),
    }


def _tops(path: Path, medium: Medium, setting: Setting, recorded: Sequence[Mapping[str, float]]) -> list[LayerLaw]:
    """Return the laws of the semi-infinite media that a medium's layers would be alone.

    They are the catalogue's current laws, which the record's constants must match. Where a layer scatters forward, all
    take the constants of the record instead. InputError where what is recorded is of another kind.
    """
    for table in recorded:
        holds = isinstance(table, dict) and all(map(is_number, table.values()))
        require(holds, "half_spaces", "tables of numbers", table)
    if len(recorded) != len(medium.layers):
        raise InputError(f"half_spaces must be {len(medium.layers)}, one a layer, got {len(recorded)}")
    if any(layer.g > 0 for layer in medium.layers):
        tops = []
        for layer, values in zip(medium.layers, recorded, strict=True):
            own = replace(setting, g=layer.g)
            law = ForwardHalfSpace(own, **{name: float(values[name]) for name in ForwardHalfSpace.constant_names()})
            tops.append(LayerLaw(own, law, layer.alpha, layer.mfp))
        return tops
    tops = stacks.isotropic_tops(medium, setting)
    today = tops[0].law.constants()
    for constants in recorded:
        same = constants.keys() == today.keys()
        if not (same and np.allclose([constants[name] for name in today], list(today.values()), rtol=EQUAL)):
            raise RecordError(f"{path}: was fitted with other constants of its half spaces; regenerate it")
    return tops


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
