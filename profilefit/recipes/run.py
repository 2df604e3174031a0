"""What all recipes of one command share: number of photons, folders, and progress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcml_sim import Grid, Orders, Setting, simulate_orders
from profilefit.recipes.record import record_name
from profilefit.recipes.targets import RUN_EDGES

Say = Callable[[str], None]
PHOTONS = {"quick": 20 * 2**20, "full": 400 * 2**20}
# Surfaces that refract take the general kernel, which needs six times as long for a photon.
REFRACTED_PHOTONS = {"quick": 8 * 2**20, "full": 160 * 2**20}
MAX_CHAIN = {"quick": 64_000, "full": 256_000}


@dataclass(frozen=True)
class RecipeRun:
    """One command's run. `photons` overrides the preset's number; `store` keeps the photons for a later run."""

    preset: str
    seed: int
    out: Path
    store: Path | None
    photons: int | None
    say: Say
    progress: bool | None = None

    @property
    def max_chain(self) -> int:
        """The longest that a chain may get [steps]."""
        return MAX_CHAIN[self.preset]

    def light(self, setting: Setting) -> Orders:
        """The order-resolved run of a setting; resumes from the store."""
        grid, photons = Grid.from_edges(r=RUN_EDGES), self.number(setting)
        light = simulate_orders(grid, photons, self.seed, setting, self._store(setting), progress=self.progress)
        self.say(f"{photons:.3g} photons: {setting}")  # now, since a run that fails says one line
        return light

    def number(self, setting: Setting) -> int:
        """How many photons a setting gets."""
        return self.photons or preset_photons(self.preset, setting)

    def _store(self, setting: Setting) -> Path | None:
        """A folder for each setting, inside that of Setting(): photons that are there already stay valid."""
        name = record_name("", setting).removeprefix("-")
        return None if self.store is None else self.store / name


def preset_photons(preset: str, setting: Setting) -> int:
    """The default number of photons of a setting."""
    return (PHOTONS if setting.is_matched_isotropic else REFRACTED_PHOTONS)[preset]
