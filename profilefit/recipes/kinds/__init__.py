"""Kinds of records, in the order in which a name is looked up: where each lies, and the module that makes and reads it.

A new kind is a module of this package with the functions of `KindModule`, and a line of `KINDS`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from profilefit.errors import InputError, RecordError
from profilefit.laws import MAPS, PROFILES
from profilefit.recipes.folder import LOCAL, PHASES, STACKS, SUMS, available, fits_folder, known_folder

if TYPE_CHECKING:
    from profilefit.recipes.run import RecipeRun, Work


class KindModule(Protocol):
    """Functions of a kind's module; where no other room writes its source or tables, `source` and `tables`, too."""

    def find(self, name: str, folder: Path, **options: Any) -> Any | None:
        """Return what a record of a name or path is made into, such as a law; None if it is of another kind."""

    def request(self, name: str) -> Any | None:
        """Return what a name or file requests of `fit`, checked; None if it is of another kind."""

    def fit(self, request: Any, run: RecipeRun) -> Work:
        """Return the record to be made of a request, as parts that processes can do."""

    def quality(self, *measured: Any) -> Mapping[str, Any]:
        """Measure what was fitted, for the table `quality` of the record."""

    def read(self, path: Path) -> dict[str, Any]:
        """Return all that a record says; RecordError in one line on one that is damaged."""


@dataclass(frozen=True)
class Kind:
    """A kind of record.

    key      of its module;  words  of one, in messages;  plural  of what it is regenerated from
    folder   of its records inside a folder of records, "" where they are that folder's own
    ending   of the files that ship, from which it is regenerated;  forms  names that need no record
    options  of `export` that have something to say of it
    apart    options of `report` that its names do not go with;  is_listed  whether messages list its names
    """

    key: str
    words: str
    folder: str = ""
    ending: str = "toml"
    plural: str = ""
    forms: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    apart: tuple[str, ...] = ()
    is_listed: bool = False

    @property
    def module(self) -> KindModule:
        return cast(KindModule, import_module(f"{__name__}.{self.key}"))

    def places(self, fits: Path | None = None) -> tuple[Path, ...]:
        """Return the folders that a name is looked up in: of laws and maps, which refer to one another, one."""
        if not self.folder:
            return (known_folder(fits),)
        return (fits,) if fits else (LOCAL, fits_folder())

    def paths(self, fits: Path | None = None) -> dict[str, Path]:
        """Return its records by name, from a folder of records, or from `places`."""
        records: dict[str, Path] = {}
        for place in reversed(self.places(fits)):
            records |= available(place / self.folder)
        return dict(sorted(records.items(), key=lambda item: item[1].name))

    def root(self, path: Path) -> Path:
        """Return the folder of records that a record of this kind lies in."""
        return path.parent.parent if self.folder else path.parent

    def requests(self) -> list[str]:
        """Return the names of what ships to regenerate its records from."""
        return sorted(available(fits_folder() / self.folder, self.ending))

    def find(self, name: str, fits: Path | None = None, **options: Any) -> Any | None:
        """Return what a name is made into, None if it is of another kind; InputError on an option that says nothing."""
        own = {key: value for key, value in options.items() if key in self.options}
        for folder in self.places(fits):
            if (result := self.module.find(name, folder, **own)) is not None:
                require_none((key for key in options if key not in own), self.words, name)
                return result
        return None


NEAREST, ALIKE = 3, 0.6  # names that are suggested; of difflib's similarity, 1 for the same name
OF_LAWS = ("constants", "n", "g")
NOT_OF_STACKS = ("quality", "html", "figures")
KINDS: tuple[Kind, ...] = (
    Kind("law", "a law", plural="recipes", forms=tuple(PROFILES), options=OF_LAWS),
    Kind("albedo_map", "a map", plural="recipes", forms=tuple(MAPS), options=OF_LAWS),
    Kind("stack", "a stack", STACKS, plural="stacks", apart=NOT_OF_STACKS, is_listed=True),
    Kind("gaussians", "a sum of Gaussians", SUMS, plural="stacks", apart=NOT_OF_STACKS),
    Kind("phase", "a phase function", PHASES, "csv", "tables", apart=("claims", "markdown", *NOT_OF_STACKS)),
)
Chosen = tuple[Kind, str, Path]


def require_none(options: Iterable[str], words: str, name: str) -> None:
    """Raise InputError on an option of `export` that says nothing of a subject, `words` what it is."""
    for option in options:
        raise InputError(f"{option} must be left out where NAME is {words}, got {name!r}")


def names(kinds: Iterable[Kind], fits: Path | None = None, forms: bool = True) -> Iterator[str]:
    """Return the names by which kinds are found, each once: of records and, with `forms`, of what needs none."""
    yield from dict.fromkeys(name for kind in kinds for name in (*(kind.forms if forms else ()), *kind.paths(fits)))


def records_of(names: Sequence[str], fits: Path | None = None) -> list[Chosen]:
    """Return the records of these names, the kind and file of each; all of laws and maps, if none is named.

    A name means the first record of that name, and those of other kinds beside it. RecordError names the nearest.
    """
    first = {kind.folder: kind for kind in reversed(KINDS)}  # of kinds that share a folder
    known = {kind: kind.paths(fits) for kind in reversed(first.values())}
    if not names:
        return [(kind, name, path) for kind, paths in known.items() if not kind.folder for name, path in paths.items()]
    chosen: list[Chosen] = []
    for name in names:
        own = [(kind, name, paths[name]) for kind, paths in known.items() if name in paths]
        if not own:
            raise _no_record(name, known, known_folder(fits))
        root = own[0][0].root(own[0][2])
        chosen += [each for each in own if each[0].root(each[2]) == root]
    return chosen


def _no_record(name: str, known: Mapping[Kind, Mapping[str, Path]], folder: Path) -> RecordError:
    """Return the error for a name of no record: it lists names that begin so, or differ by a few letters."""
    listed = {kind: paths for kind, paths in known.items() if kind.is_listed and paths}
    every = [each for kind, paths in known.items() if not kind.folder or kind in listed for each in paths]
    if not every:
        return no_records(folder)
    begins = sorted((each for each in every if each.startswith(name.lower())), key=len)
    near = begins or get_close_matches(name.lower(), every, n=NEAREST, cutoff=ALIKE)
    hint = f"did you mean {', '.join(near[:NEAREST])}? " if near else ""
    hint += "".join(f"{kind.plural} are {', '.join(paths)}, and " for kind, paths in listed.items())
    lists = f"`profilefit report` lists {'records' if listed else 'them'}"
    return RecordError(f"there is no record {name!r} in {folder}; {hint}{lists}")


def no_records(folder: Path) -> RecordError:
    """Return the error for a folder without records."""
    return RecordError(f"{folder} has no records: `profilefit regenerate` makes them")
