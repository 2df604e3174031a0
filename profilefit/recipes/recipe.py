"""Recipes: fits/*.toml states what is fitted to what, how it is weighted and over which range."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from mcml_sim.files.whole_file import read_toml
from mcml_sim.media.setting import FORWARD_G, FORWARD_N, Setting
from profilefit.errors import InputError, RecipeError
from profilefit.recipes.declared import LISTED, LONGEST_RECORDED, Declared, OneOf, Refused, is_line, printable, words
from profilefit.recipes.folder import available, fits_folder
from profilefit.recipes.record import PIPELINES

SEARCHLIGHT = Setting()
# Pipelines that answer questions about the paper, whose light is the searchlight and whose surface does not refract.
PAPERS = ("as-published", "evidence")
NEAR_MATCHED = 1.02  # laws in n are continued to 1 from here
FEWEST_INDICES, LARGEST_INDEX = 4, 3.0  # coefficients are cubics in n; exact light is promised up to 3
FEWEST_OF_G = 3  # indices, and mean cosines, of a law in g, whose coefficients are straight lines in n
FORWARD_SPAN = (1.3, 1.5)  # indices that a law in g is continued to, from those of exact light
MFP = (1e-3, 1e3)  # beyond three decades a length is a slip of the pen
FINEST = 0.0025  # the first edge of the run that rings are merged from [mfp]
FEWEST_RINGS, MOST_RINGS = 3, 4000  # the run has 4000 even rings
MAX_LIMIT = 1e6  # a weight beyond this makes the rings round off beside it


Share = Annotated[float, Field(gt=0.0, le=1.0)]
Limit = Annotated[float, Field(ge=0.0, le=MAX_LIMIT)]
Length = Annotated[float, Field(ge=MFP[0], le=MFP[1])]
Words = Annotated[str, Field(max_length=LONGEST_RECORDED), AfterValidator(printable)]  # it becomes comments in code
Names = Annotated[tuple[Words, ...], LISTED, words(f"a list of texts of {LONGEST_RECORDED} characters at most")]
Numbers = Annotated[tuple[float, ...], LISTED, words("a list of finite numbers")]


class Albedos(Declared):
    """Albedos that are fitted: `count` of them, even in `spacing`, from `low` to `high` in alpha [-]."""

    low: Share
    high: Share
    count: Annotated[int, Field(ge=3, le=1000)]
    spacing: Annotated[str, OneOf("alpha", "reflectance", "sqrt(1-alpha)")] = "sqrt(1-alpha)"

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if not self.low < self.high:
            raise Refused(f"a number > low, which is {self.low!r}, and <= 1", self.high, "high")
        return self


class RingLayout(Declared):
    """Rings that are fitted: even ones of width `dr`, or log-spaced from `first` to `last` [mfp]; `trim` is (6)."""

    last: Annotated[float, Field(gt=0.0, le=1000.0)]
    dr: Annotated[float, Field(ge=0.0)] = 0.0
    first: Annotated[float, Field(ge=0.0)] = 0.0
    count: Annotated[int, Field(ge=0, le=1000)] = 0
    trim: Annotated[str, OneOf("r R_d", "R_d", "none")] = "none"
    epsilon: Annotated[float, Field(gt=0.0, lt=1.0), words("a number in (0, 1)")] = 0.005

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        even = self.dr > 0 and self.first == 0 and self.count == 0
        if not even and not (self.dr == 0 and self.first > 0 and self.count > 0):
            got = f"dr = {self.dr!r}, first = {self.first!r}, count = {self.count!r}"
            raise InputError(f"rings must have either dr > 0 or both first > 0 and count > 0, got {got}")
        if not max(self.dr, self.first) < self.last:
            raise Refused("beyond the first ring and within 1000 mfp", self.last, "last")
        if not even and self.first < FINEST:
            raise Refused(f"at least {FINEST} mfp, the finest ring of the run", self.first, "first")
        if not even and self.count < 3:
            raise Refused("a whole number in 3 ... 1000", self.count, "count")
        return self

    def require_fit(self, mfp: float) -> None:
        """Refuse even rings of which a medium of this mean free path has too few or too many."""
        # Rounded: 0.15 / 0.05 is 3 rings, and 2.9999999999999996 in binary.
        if self.dr > 0 and not FEWEST_RINGS <= round(self.last * mfp / self.dr, 6) <= MOST_RINGS:
            accepted = f"between {FEWEST_RINGS} and {MOST_RINGS} rings"
            got = f"last = {self.last!r}, mfp = {mfp!r}, dr = {self.dr!r}"
            raise InputError(f"rings must have last * mfp / dr {accepted}, got {got}")


class Weighting(Declared):
    """Objective of a fit: its name, the weights of its limits, and shares of energy for quantiles."""

    objective: Words
    energy_limit: Limit = 0.0
    source_limit: Limit = 0.0
    rising: Limit = 0.0
    shares: Annotated[int, Field(ge=0, le=10_000)] = 0
    last_share: Share = 1.0


class SettingTable(Declared):
    """Table [setting]: illumination, refractive index and mean cosine that the constants belong to."""

    illumination: Words = SEARCHLIGHT.illumination
    n: float = SEARCHLIGHT.n
    g: float = SEARCHLIGHT.g

    @model_validator(mode="after")
    def _possible(self) -> Self:
        Setting(self.illumination, self.n, self.g)
        return self


class Recipe(Declared):
    """One fit, from its truth to its record. `held` are constants that stay at their starting value, and why.

    indices        refractive indices that a law which spans them is fitted to at once; the record says n = setting.n
                   where it speaks of one
    cosines        mean cosines g that a law which spans them is fitted to at once, at each index
    check          "orders": fit the tracer's photons too, and compare with the fit to the exact half space
    random_starts  how many fits begin at random constants, to see whether one ends better
    """

    title: Words
    law: Words
    equations: Words
    pipeline: Annotated[str, OneOf(*PIPELINES)]
    truth: Annotated[str, OneOf("orders", "exact")]
    start: Words = "published"
    setting_table: SettingTable = Field(SettingTable(), alias="setting")
    indices: Numbers = ()
    cosines: Numbers = ()
    check: Annotated[str, OneOf("", "orders"), words("'orders' or absent")] = ""
    random_starts: Annotated[int, Field(ge=0, le=1000)] = 0
    albedos: Albedos = Albedos(low=0.05, high=0.995, count=24)
    weighting: Weighting = Weighting(objective="")
    rings: RingLayout | None = None
    mfp: Annotated[
        tuple[Length, ...], LISTED, Field(min_length=1), words(f"a list of lengths from {MFP[0]:g} to {MFP[1]:g}")
    ] = (1.0,)
    held: Names = ()
    note: Words = ""

    @property
    def path(self) -> Path:
        return Path(self.file)

    @property
    def name(self) -> str:
        """Name of the recipe and of its record."""
        return self.path.stem

    @cached_property
    def setting(self) -> Setting:
        """Illumination and surface; the constants belong to it and to no other."""
        table = self.setting_table
        return Setting(table.illumination, table.n, table.g)

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

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, content: dict[str, Any]) -> dict[str, Any]:
        needed = () if content.get("pipeline") == "evidence" else ("albedos", "weighting")
        if missing := [f"[{name}]" for name in needed if name not in content]:
            raise InputError(f"missing {', '.join(missing)}")
        return content

    @model_validator(mode="after")
    def _possible(self) -> Self:
        pipeline, objective = self.pipeline, self.weighting.objective
        self._require_setting()
        if self.check and self.truth != "exact":
            got = f"got truth = {self.truth!r}"
            raise InputError(f'check needs truth = "exact": it compares the photons with it, {got}')
        if pipeline in PAPERS and (self.check or self.random_starts):
            raise InputError(f"pipeline {pipeline!r} takes neither check nor random_starts")
        if len(set(self.mfp)) < len(self.mfp):
            raise Refused("a list of different lengths", list(self.mfp), "mfp")
        if pipeline == "as-published" and 1.0 not in self.mfp:
            raise InputError(f"mfp of pipeline 'as-published' must contain 1.0, got {list(self.mfp)!r}")
        if self.rings is None and pipeline not in ("albedo", "evidence"):
            raise InputError(f"a recipe of pipeline {pipeline!r} needs a table [rings]")
        if objective not in (objectives := PIPELINES[pipeline][0] or ("",)):
            raise Refused(f"one of {', '.join(objectives)}", objective, "weighting", "objective")
        if pipeline == "inverse" and self.weighting.shares == 0:
            raise Refused("a whole number in 1 ... 10000 of pipeline 'inverse'", 0, "weighting", "shares")
        for mfp in self.mfp if pipeline == "as-published" else (1.0,):
            if self.rings is not None:
                self.rings.require_fit(mfp)
        return self

    def _require_setting(self) -> None:
        """Refuse an illumination, index or g, or several of them, that the pipeline cannot fit to."""
        where, indices, cosines = self.setting, list(self.indices), list(self.cosines)
        if cosines:
            low, high = FORWARD_N
            if not indices or not all(low <= n <= high for n in indices):
                raise InputError(f"indices must be in [{low:g}, {high:g}] where there are cosines, got {indices!r}")
            if not _rising(cosines, FORWARD_G, above=0) or len(cosines) < FEWEST_OF_G:
                accepted = f"at least {FEWEST_OF_G} in (0, {FORWARD_G:g}]"
                raise InputError(f"cosines must rise, {accepted}, got {cosines!r}")
            if self.check:
                raise Refused("absent where there are cosines", self.check, "check")
            if where.g not in cosines:
                raise Refused(f"one of the cosines {cosines!r}", where.g, "setting", "g")
        elif where.g != 0:
            raise Refused("0 where there are no cosines", where.g, "setting", "g")
        if self.truth == "exact" and not where.n >= 1:
            raise Refused("at least 1 where truth is 'exact' (use truth = \"orders\")", where.n, "setting", "n")
        if indices:
            if self.truth != "exact" or self.pipeline not in ("albedo", "profile"):
                got = f"{self.truth!r}, {self.pipeline!r}"
                raise InputError(f"indices need truth = \"exact\" and pipeline 'albedo' or 'profile', got {got}")
            if not _rising(indices, LARGEST_INDEX, above=1):
                raise InputError(f"indices must rise, each in (1, {LARGEST_INDEX:g}], got {indices!r}")
            if len(indices) < (fewest := FEWEST_OF_G if cosines else FEWEST_INDICES):
                raise InputError(f"indices must be at least {fewest}, got {indices!r}")
            if where.n not in indices:
                raise Refused(f"one of the indices {indices!r}", where.n, "setting", "n")
        if self.pipeline in PAPERS and where != SEARCHLIGHT:
            raise InputError(f"setting of pipeline {self.pipeline!r} must be {SEARCHLIGHT}, got {where}")
        if self.pipeline == "inverse" and not where.is_matched_isotropic:
            raise Refused("1 of pipeline 'inverse'", where.n, "setting", "n")
        if self.albedos.spacing == "reflectance" and not where.is_matched_isotropic:
            accepted = f"alpha or sqrt(1-alpha) where n is not 1 but {where.n!r}"
            raise Refused(accepted, "reflectance", "albedos", "spacing")


def _rising(numbers: list[float], most: float, above: float) -> bool:
    return numbers == sorted(set(numbers)) and all(above < one <= most for one in numbers)


def read(path: Path) -> Recipe:
    """Read one recipe; RecipeError says the file, what was wrong, what was got and what is accepted."""
    if not path.exists():
        raise RecipeError(f"{path}: there is no such recipe")
    try:
        table = read_toml(path)
    except InputError as error:
        raise RecipeError(str(error)) from None
    if not is_line(path.stem):  # it names the record
        raise RecipeError(f"{str(path)!r}: the name of a recipe must be one printable line")
    return Recipe.of(str(path), table, RecipeError)


def is_recipe(name: str) -> bool:
    """Return whether a name is that of a shipped recipe, or of a .toml file that is none of layers."""
    if not name.endswith(".toml"):
        return name in available(fits_folder(), "toml")
    path = Path(name)
    return not (path.is_file() and "layers" in read_toml(path))


def find(name: str, folder: Path) -> Recipe:
    """Return a recipe by its name in `folder`, or by the path of a .toml file."""
    if name.endswith(".toml"):
        return read(Path(name))
    known = available(folder, "toml")
    if name not in known:
        raise RecipeError(f"recipe must be one of {', '.join(known) or '(none)'} or a .toml file, got {name!r}")
    return read(known[name])
