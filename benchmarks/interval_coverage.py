"""Coverage of stated intervals: `python -m benchmarks.interval_coverage` fits 2000 runs made anew, by law and truth.

    known       the law itself is the truth: intervals by the sandwich hold its constants
    exact       the exact half space is the truth: they hold the pseudo-true constants
    counts      as exact, but whole photons drawn by ring and order, each with the covariance of its own counts
    independent negative control: the same refits, but noise taken for independent between rings and albedos
    misfit      negative control: s^2 (J^T J)^-1, the residuals taken for noise

An interval that covers has its share within the binomial 99 % band, Sidak over constants and levels.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import Progress

from benchmarks.refits import LEVELS, Coverage, coverage, drawn_noise, refits
from benchmarks.table import show
from mcml_sim import Grid, Orders, simulate_orders
from mcml_sim.errors import InputError
from mcml_sim.files.whole_file import write_whole
from profilefit.fitting.discrepancy import predicted
from profilefit.fitting.estimate import EVERYWHERE, Fit, ResidualFunction, Rings, fit
from profilefit.fitting.profiles import Profiles
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.targets import albedo_values, ring_edges

Floats = NDArray[np.float64]
LAWS = ("albedo-rational", "burley-whole", "liang-whole", "hazard", "quantile")
COUNTED = ("burley-whole",)
SEED, PHOTONS, REPLICATES = 41, 20 * 2**20, 2000


@dataclass(frozen=True)
class Row:
    """Line of the table: whose constants, which truth, which errors, and the result."""

    law: str
    truth: str
    errors: str
    found: Coverage
    failed: int

    def cells(self) -> tuple[str, ...]:
        spans = [f"{share.min():.3f} … {share.max():.3f}" for share in self.found.share]
        bands = [f"{low:.3f} … {high:.3f}" for low, high in self.found.band]
        verdict = "covers" if self.found.honest else "does not cover"
        pairs = [cell for pair in zip(spans, bands, strict=True) for cell in pair]
        return self.law, self.truth, self.errors, str(len(self.found.names)), *pairs, str(self.failed), verdict

    def content(self) -> dict[str, object]:
        found = self.found
        told = {"law": self.law, "truth": self.truth, "errors": self.errors, "replicates": found.replicates}
        shares = {f"{level:g}": share.tolist() for level, share in zip(found.levels, found.share, strict=True)}
        return {**told, "names": found.names, "shares": shares, "band": found.band.tolist(), "failed": self.failed}


def rows(name: str, photons: int, replicates: int) -> Iterator[Row]:
    """Yield every line of one recipe's law."""
    chosen = recipe.find(name, catalogue.fits_folder())
    edges = ring_edges(chosen.rings)
    light = simulate_orders(Grid.from_edges(r=edges), photons, SEED, chosen.setting, progress=False)
    run = Profiles.from_orders(light, albedo_values(chosen.albedos, chosen.setting))
    law = catalogue.find(name, catalogue.fits_folder()).law
    for truth, profiles in (("known", _of_law(chosen, law, run)), ("exact", _exact(run))):
        closed = profiles.covariance
        if closed is None:
            raise InputError(f"names must be of records of fits to profiles, got {name!r}")
        noise = _matched(drawn_noise(closed, replicates, SEED + 1), run)
        one = fitted(chosen, law, profiles)
        again = refits(one, np.column_stack([profiles.energy, profiles.beyond]), noise)
        off = again.found - again.truth
        sandwich, independent = again.sandwich_errors(closed), again.independent_errors(closed)
        yield Row(name, truth, "sandwich", coverage(again.names, off, sandwich), again.failed)
        yield Row(name, truth, "independent", coverage(again.names, off, independent), again.failed)
        if truth == "exact":
            misfit = np.sqrt(np.diag(one.misfit))
            yield Row(name, truth, "misfit", coverage(again.names, off, misfit), again.failed)
    if name in COUNTED:
        yield _of_counts(chosen, law, light, run, replicates)


def _matched(noise: Floats, run: Profiles) -> Floats:
    """Return draws (k, m, n + 1) with a column for the light beyond, whether the covariance has one or not."""
    missing = run.energy.shape[1] + 1 - noise.shape[2]
    return np.pad(noise, ((0, 0), (0, 0), (0, missing)))


def fitted(chosen: Recipe, law, profiles: Profiles, jackknife: bool = False) -> Fit:
    """Fit a recipe to other profiles, from `law` on."""
    weighting = chosen.weighting
    shares = tuple((np.arange(weighting.shares) + 0.5) / max(weighting.shares, 1) * weighting.last_share)
    limits = weighting.energy_limit, weighting.source_limit, weighting.rising
    free = tuple(n for n in law.seen_by(weighting.objective) if n not in chosen.held)
    return fit(profiles, law, weighting.objective, free, None, limits, shares, jackknife=jackknife)


def _of_law(chosen: Recipe, law, run: Profiles) -> Profiles:
    """Return the energies of the law itself, with the run's noise, as photons would have it where there are fewer."""
    none = np.zeros_like(run.energy)
    reflectance = np.asarray(law.albedo.reflectance(run.alpha)) if chosen.pipeline != "albedo" else run.reflectance
    rings = Rings(run.alpha, run.r_edges, none, reflectance, none, run.alpha, np.zeros(3), np.zeros(0))
    objective = chosen.weighting.objective
    free = law.seen_by(objective)
    energy, _ = predicted(ResidualFunction(objective, free), law, rings)
    if objective in ("energy", "relative"):
        whole = replace_edges(rings, np.array([0.0, EVERYWHERE]))
        reflectance = predicted(ResidualFunction(objective, free), law, whole)[0][:, 0]
    if chosen.pipeline == "albedo":
        reflectance = energy[:, 0]
    beyond = np.maximum(reflectance - energy.sum(axis=1), 0.0)
    made = replace(run, energy=energy, beyond=beyond)
    return made if chosen.pipeline == "albedo" else _with_its_noise(made, run)


def _with_its_noise(made: Profiles, run: Profiles) -> Profiles:
    """Scale noise with the root of the light: where a law has hardly any, the run's own would drown it."""
    fewer = np.divide(made.energy, run.energy, out=np.zeros_like(run.energy), where=run.energy > 0).clip(0.0, 1.0)
    whole = np.sqrt(np.column_stack([fewer, np.ones(len(fewer))]))
    if run.covariance is None:
        return made
    closed = replace(
        run.covariance, factor=run.covariance.factor * whole.T[:, :, None], energy=run.covariance.energy * whole
    )
    return replace(made, covariance=closed, effective_samples=run.effective_samples * fewer)


def replace_edges(rings: Rings, edges: Floats) -> Rings:
    """Return these albedos on other rings, which hold nothing yet."""
    none = np.zeros((np.asarray(rings.alpha).size, edges.size - 1))
    return Rings(rings.alpha, edges, none, rings.beyond, none, rings.weight, rings.limits, rings.xi)


def _exact(run: Profiles) -> Profiles:
    truth = Profiles.from_exact(run.alpha, run.r_edges, run.setting)
    return replace(run, energy=truth.energy, beyond=truth.beyond)


def _of_counts(chosen: Recipe, law, light: Orders, run: Profiles, replicates: int) -> Row:
    """Yield runs of whole photons: those of `light` shared out anew, which makes its own energies the truth."""
    one = fitted(chosen, law, run)
    cells = np.append(light.counts.exits.ravel(), light.photons - light.counts.exits.sum())
    generator = np.random.default_rng(SEED + 2)
    weights, once = light.weights(run.alpha)[:, 1:], light.once(run.alpha)
    energy, covariances = [], []
    for _ in range(replicates):
        counts = generator.multinomial(light.photons, cells / light.photons)[:-1].reshape(light.counts.exits.shape)
        again = replace(light, counts=replace(light.counts, exits=counts))
        profiles = Profiles.from_orders(again, run.alpha)
        energy.append(once + (counts[:, 1:] @ weights.T).T / light.photons)
        if profiles.covariance is not None:
            covariances.append(profiles.covariance)
    truth = np.column_stack([run.energy, run.beyond])
    found = refits(one, truth, np.stack(energy) - truth)
    errors = np.sqrt([np.diag(c.sandwich(g)) for c, g in zip(covariances, found.gain, strict=True)])
    return Row(
        chosen.name, "counts", "sandwich", coverage(found.names, found.found - found.truth, errors), found.failed
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=LAWS, help="records of laws")
    parser.add_argument("--photons", type=int, default=PHOTONS, help="of the run whose noise it is")
    parser.add_argument("--replicates", type=int, default=REPLICATES)
    parser.add_argument("--json", type=Path, help="also write the numbers into this file")
    given = parser.parse_args(arguments)
    found: list[Row] = []
    levels = [cell for level in LEVELS for cell in (f"{level:.0%}: shares", "band")]
    head = ("law", "truth", "errors", "constants", *levels, "failed", "verdict")
    with Progress(transient=True) as progress:
        task = progress.add_task("laws", total=len(given.names))
        for name in given.names:
            made = list(rows(name, given.photons, given.replicates))
            title = f"Coverage over {given.replicates} runs of {given.photons:.3g} photons: {name}"
            show(title, head, [row.cells() for row in made])  # a law takes minutes, so each as it comes
            found += made
            if given.json is not None:
                write_whole(given.json, json.dumps([row.content() for row in found], indent=1) + "\n")
            progress.advance(task)


if __name__ == "__main__":
    main()
