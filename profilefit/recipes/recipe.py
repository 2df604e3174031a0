"""Recipes: fits/*.toml states what is fitted to what, how it is weighted and over which range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import Any

from mcml_sim.files.text_file import read_toml
from mcml_sim.media.checks import shown
from mcml_sim.media.setting import FORWARD_G, FORWARD_N, Setting
from profilefit.errors import InputError, RecipeError
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.schema import LONGEST_TEXT, PIPELINES, is_line, is_number

TRUTHS = ("orders", "exact")
SEARCHLIGHT = Setting()
# Pipelines that answer questions about the paper, whose light is the searchlight and whose surface does not refract.
PAPERS = ("as-published", "evidence")
CHECKS = ("", "orders")
MOST_STARTS = 1000
SPACINGS = ("alpha", "reflectance", "sqrt(1-alpha)")
TRIMMED = ("r R_d", "R_d", "none")
NEAR_MATCHED = 1.02  # laws in n are continued to 1 from here
FEWEST_INDICES, LARGEST_INDEX = 4, 3.0  # coefficients are cubics in n; exact light is promised up to 3
FEWEST_OF_G = 3  # indices, and mean cosines, of a law in g, whose coefficients are straight lines in n
FORWARD_SPAN = (1.3, 1.5)  # indices that a law in g is continued to, from those of exact light
MFP = (1e-3, 1e3)  # beyond three decades a length is a slip of the pen
FINEST = 0.0025  # the first edge of the run that rings are merged from [mfp]
FEWEST_RINGS, MOST_RINGS = 3, 4000  # the run has 4000 even rings
MAX_LIMIT = 1e6  # a weight beyond this makes the rings round off beside it


@dataclass(frozen=True)
class Albedos:
    """Albedos that are fitted: `count` of them, even in `spacing`, from `low` to `high` in alpha [-]."""

    low: float
    high: float
    count: int
    spacing: str = "sqrt(1-alpha)"

    def problems(self) -> str | None:
        if not 0 < self.low < self.high <= 1:
            return f"albedos must have 0 < low < high <= 1, got low = {self.low!r}, high = {self.high!r}"
        if not 3 <= self.count <= 1000:
            return f"albedos.count must be between 3 and 1000, got {self.count!r}"
        if self.spacing not in SPACINGS:
            return f"albedos.spacing must be one of {', '.join(SPACINGS)}, got {self.spacing!r}"
        return None


@dataclass(frozen=True)
class RingLayout:
    """Rings that are fitted: even ones of width `dr`, or log-spaced from `first` to `last` [mfp]; `trim` is (6)."""

    last: float
    dr: float = 0.0
    first: float = 0.0
    count: int = 0
    trim: str = "none"
    epsilon: float = 0.005

    def problems(self) -> str | None:
        even = self.dr > 0 and self.first == 0 and self.count == 0
        log_spaced = self.dr == 0 and self.first > 0 and self.count > 0
        if not (even or log_spaced):
            got = f"dr = {self.dr!r}, first = {self.first!r}, count = {self.count!r}"
            return f"rings must have either dr > 0 or both first > 0 and count > 0, got {got}"
        if not max(self.dr, self.first) < self.last <= 1000:
            return f"rings.last must lie beyond the first ring and within 1000 mfp, got {self.last!r}"
        if log_spaced and not self.first >= FINEST:
            return f"rings.first must be at least {FINEST} mfp, the finest ring of the run, got {self.first!r}"
        if log_spaced and not 3 <= self.count <= 1000:
            return f"rings.count must be between 3 and 1000, got {self.count!r}"
        if self.trim not in TRIMMED or not 0 < self.epsilon < 1:
            accepted = f"one of {', '.join(TRIMMED)} with epsilon in (0, 1)"
            return f"rings.trim must be {accepted}, got {self.trim!r}, epsilon = {self.epsilon!r}"
        return None

    def problems_at(self, mfp: float) -> str | None:
        """Return what is impossible about even rings in a medium of this mean free path, or None."""
        # Rounded: 0.15 / 0.05 is 3 rings, and 2.9999999999999996 in binary.
        if self.dr > 0 and not FEWEST_RINGS <= round(self.last * mfp / self.dr, 6) <= MOST_RINGS:
            accepted = f"between {FEWEST_RINGS} and {MOST_RINGS} rings"
            got = f"last = {self.last!r}, mfp = {mfp!r}, dr = {self.dr!r}"
            return f"rings must have last * mfp / dr {accepted}, got {got}"
        return None


@dataclass(frozen=True)
class Weighting:
    """Objective of a fit: its name, the weights of its limits, and shares of energy for quantiles."""

    objective: str
    energy_limit: float = 0.0
    source_limit: float = 0.0
    rising: float = 0.0
    shares: int = 0
    last_share: float = 1.0

    def problems(self) -> str | None:
        limits = (self.energy_limit, self.source_limit, self.rising)
        if not all(0 <= limit <= MAX_LIMIT for limit in limits):
            got = ", ".join(map(repr, limits))
            return f"weighting limits must be between 0 and {MAX_LIMIT:g}, got {got}"
        if not (0 <= self.shares <= 10_000 and 0 < self.last_share <= 1):
            got = f"{self.shares!r}, {self.last_share!r}"
            return f"weighting needs 0 <= shares <= 10000 and 0 < last_share <= 1, got {got}"
        return None


@dataclass(frozen=True)
class Recipe:
    """One fit, from its truth to its record. `held` are constants that stay at their starting value, and why.

    setting        the light and the surface; the constants belong to it and to no other
    indices        refractive indices that a law which spans them is fitted to at once; the record says n = setting.n
                   where it speaks of one
    cosines        mean cosines g that a law which spans them is fitted to at once, at each index; albedos and rings are
                   reduced ones then
    check          "orders": fit the tracer's photons too, and compare with the fit to the exact half space
    random_starts  how many fits begin at random constants, to see whether one ends better
    """

    name: str
    title: str
    law: str
    equations: str
    pipeline: str
    truth: str
    start: str = "published"
    setting: Setting = SEARCHLIGHT
    indices: tuple[float, ...] = ()
    cosines: tuple[float, ...] = ()
    check: str = ""
    random_starts: int = 0
    albedos: Albedos = Albedos(0.05, 0.995, 24)
    weighting: Weighting = Weighting("")
    rings: RingLayout | None = None
    mfp: tuple[float, ...] = (1.0,)
    held: tuple[str, ...] = ()
    note: str = ""
    path: Path = field(default=Path(), compare=False)

    @property
    def span(self) -> tuple[float, float]:
        """Indices that its constants hold for: above the first, up to the last; and from 1 if the first is near."""
        if self.cosines:
            return FORWARD_SPAN
        first, last = self.indices[0], self.indices[-1]
        return (1.0 if first <= NEAR_MATCHED else first), last

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Settings that it is fitted to: its own, or each of its indices and mean cosines."""
        each = product(self.indices or (self.setting.n,), self.cosines or (self.setting.g,))
        return tuple(replace(self.setting, n=n, g=g) for n, g in each)

    def problems(self) -> str | None:
        """Return what is impossible about it, in one line, or None."""
        if self.pipeline not in PIPELINES:
            return f"pipeline must be one of {', '.join(PIPELINES)}, got {self.pipeline!r}"
        if self.truth not in TRUTHS:
            return f"truth must be one of {', '.join(TRUTHS)}, got {self.truth!r}"
        if text := self._problems_of_setting() or self._problems_of_tests():
            return text
        low, high = MFP
        if not self.mfp or not all(low <= length <= high for length in self.mfp):
            return f"mfp must be a list of lengths from {low:g} to {high:g}, got {list(self.mfp)!r}"
        if len(set(self.mfp)) < len(self.mfp):
            return f"mfp must be a list of different lengths, got {list(self.mfp)!r}"
        if self.pipeline == "as-published" and 1.0 not in self.mfp:
            return f"mfp of pipeline 'as-published' must contain 1.0, got {list(self.mfp)!r}"
        if self.rings is None and self.pipeline not in ("albedo", "evidence"):
            return f"a recipe of pipeline {self.pipeline!r} needs a table [rings]"
        objectives = PIPELINES[self.pipeline][0] or ("",)
        if self.weighting.objective not in objectives:
            accepted, got = ", ".join(objectives), self.weighting.objective
            return f"weighting.objective of pipeline {self.pipeline!r} must be one of {accepted}, got {got!r}"
        if self.pipeline == "inverse" and self.weighting.shares == 0:
            return "weighting.shares of pipeline 'inverse' must be between 1 and 10000, got 0"
        parts: tuple[Albedos | RingLayout | Weighting | None, ...] = (self.albedos, self.rings, self.weighting)
        if text := next((text for part in parts if part is not None and (text := part.problems())), None):
            return text
        lengths = self.mfp if self.pipeline == "as-published" else (1.0,)
        return next((text for mfp in lengths if self.rings and (text := self.rings.problems_at(mfp))), None)

    def _problems_of_setting(self) -> str | None:
        where = self.setting
        if self.cosines and (text := self._problems_of_cosines()):
            return text
        if where.g != 0 and not self.cosines:
            return f"setting.g must be 0 where there are no cosines, got {where.g!r}"
        if self.truth == "exact" and not where.n >= 1:
            return f"setting.n must be at least 1 where truth is 'exact' (use truth = \"orders\"), got {where.n!r}"
        if self.indices and (text := self._problems_of_indices()):
            return text
        if self.pipeline in PAPERS and where != SEARCHLIGHT:
            return f"setting of pipeline {self.pipeline!r} must be {SEARCHLIGHT}, got {where}"
        if self.pipeline == "inverse" and not where.is_matched_isotropic:
            return f"setting.n of pipeline 'inverse' must be 1, got {where.n!r}"
        if self.albedos.spacing == "reflectance" and not where.is_matched_isotropic:
            return f"albedos.spacing must be 'alpha' or 'sqrt(1-alpha)' where setting.n is not 1, got {where.n!r}"
        return None

    def _problems_of_indices(self) -> str | None:
        if self.truth != "exact" or self.pipeline not in ("albedo", "profile"):
            got = f"{self.truth!r}, {self.pipeline!r}"
            return f"indices need truth = \"exact\" and pipeline 'albedo' or 'profile', got {got}"
        if not all(1 < n <= LARGEST_INDEX for n in self.indices) or list(self.indices) != sorted(set(self.indices)):
            return f"indices must rise, each in (1, {LARGEST_INDEX:g}], got {list(self.indices)!r}"
        if len(self.indices) < (fewest := FEWEST_OF_G if self.cosines else FEWEST_INDICES):
            return f"indices must be at least {fewest}, got {list(self.indices)!r}"
        if self.setting.n not in self.indices:
            return f"setting.n must be one of the indices {list(self.indices)!r}, got {self.setting.n!r}"
        return None

    def _problems_of_cosines(self) -> str | None:
        low, high = FORWARD_N
        if not self.indices or not all(low <= n <= high for n in self.indices):
            return f"indices must be in [{low:g}, {high:g}] where there are cosines, got {list(self.indices)!r}"
        rising = list(self.cosines) == sorted(set(self.cosines))
        if not rising or not all(0 < g <= FORWARD_G for g in self.cosines) or len(self.cosines) < FEWEST_OF_G:
            return f"cosines must rise, at least {FEWEST_OF_G} in (0, {FORWARD_G:g}], got {list(self.cosines)!r}"
        if self.check:
            return f"check must be absent where there are cosines, got {self.check!r}"
        if self.setting.g not in self.cosines:
            return f"setting.g must be one of the cosines {list(self.cosines)!r}, got {self.setting.g!r}"
        return None

    def _problems_of_tests(self) -> str | None:
        if self.check not in CHECKS:
            return f"check must be 'orders' or absent, got {self.check!r}"
        if self.check and self.truth != "exact":
            return f'check needs truth = "exact": it compares the photons with it, got truth = {self.truth!r}'
        if not 0 <= self.random_starts <= MOST_STARTS:
            return f"random_starts must be between 0 and {MOST_STARTS}, got {self.random_starts!r}"
        if self.pipeline in PAPERS and (self.check or self.random_starts):
            return f"pipeline {self.pipeline!r} takes neither check nor random_starts"
        return None


def read(path: Path) -> Recipe:
    """Read one recipe; RecipeError says the file, what was wrong, what was got and what is accepted."""
    if not path.exists():
        raise RecipeError(f"{path}: there is no such recipe")
    try:
        table = read_toml(path)
    except InputError as error:
        raise RecipeError(str(error)) from None
    for key in ("name", "path"):
        if key in table:
            raise RecipeError(f"{path}: unknown key {shown(key)}: a recipe is named by its file")
    needed = () if table.get("pipeline") == "evidence" else ("albedos", "weighting")
    if missing := [f"[{name}]" for name in needed if name not in table]:
        raise RecipeError(f"{path}: missing {', '.join(missing)}")
    if not is_line(path.stem):  # it names the record
        raise RecipeError(f"{str(path)!r}: the name of a recipe must be one printable line")
    recipe = _build(Recipe, {**table, "name": path.stem, "path": path}, str(path), frozenset({"path", "name"}))
    if problem := recipe.problems():
        raise RecipeError(f"{path}: {problem}")
    return recipe


def available(folder: Path) -> dict[str, Path]:
    """Return the recipes of a folder by name, in order."""
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def is_recipe(name: str) -> bool:
    """Return whether a name is that of a shipped recipe, or of a .toml file that is none of layers."""
    if not name.endswith(".toml"):
        return name in available(fits_folder())
    path = Path(name)
    return not (path.is_file() and "layers" in read_toml(path))


def find(name: str, folder: Path) -> Recipe:
    """Return a recipe by its name in `folder`, or by the path of a .toml file."""
    if name.endswith(".toml"):
        return read(Path(name))
    known = available(folder)
    if name not in known:
        raise RecipeError(f"recipe must be one of {', '.join(known) or '(none)'} or a .toml file, got {name!r}")
    return read(known[name])


def _build(kind: type, table: Mapping[str, Any], where: str, given: frozenset[str] = frozenset()) -> Any:
    """Make a dataclass from a TOML table: every key known, every needed key there, every type right."""
    known = {f.name: f for f in fields(kind)}
    for key in table:
        if key not in known:
            accepted = ", ".join(name for name in known if name not in given)
            raise RecipeError(f"{where}: unknown key {shown(key)}, accepted: {accepted}")
    missing = [n for n, f in known.items() if n not in table and f.default is MISSING and f.default_factory is MISSING]
    if missing:
        raise RecipeError(f"{where}: missing {', '.join(missing)}")
    typed = {key: value if key in given else _typed(known[key].type, key, value, where) for key, value in table.items()}
    try:
        return kind(**typed)
    except InputError as error:  # a Setting checks itself
        raise RecipeError(f"{where}: {error}") from None


def _typed(annotation: Any, key: str, value: Any, where: str) -> Any:
    """Return a TOML value as the type its field declares, or raise RecipeError."""
    tables = {"Albedos": Albedos, "RingLayout | None": RingLayout, "Weighting": Weighting, "Setting": Setting}
    if annotation in tables:
        if not isinstance(value, dict):
            raise RecipeError(f"{where}: [{key}] must be a table, got {shown(value)}")
        return _build(tables[annotation], value, f"{where}: [{key}]")
    if annotation == "float" and is_number(value):
        return float(value)
    if annotation == "int" and is_number(value) and isinstance(value, int):
        return value
    if annotation == "str" and is_line(value):
        return value
    if annotation == "tuple[float, ...]" and isinstance(value, list) and all(map(is_number, value)):
        return tuple(float(v) for v in value)
    if annotation == "tuple[str, ...]" and isinstance(value, list) and all(map(is_line, value)):
        return tuple(value)
    words = {"float": "finite number", "int": "whole number", "str": "text"}.get(annotation)
    words = words or ("list of finite numbers" if "float" in annotation else "list of texts")
    texts = [value] if annotation == "str" else value
    if "str" in annotation and isinstance(texts, list) and all(isinstance(text, str) for text in texts):
        words += f" of one printable line and {LONGEST_TEXT} characters at most"  # it becomes comments in code
    raise RecipeError(f"{where}: {key} must be a {words}, got {shown(value)}")
