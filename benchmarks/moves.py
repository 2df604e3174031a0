"""Moves of emcee by measured efficiency: `python -m benchmarks.moves`.

An ensemble of w walkers evaluates the density w times a step and gives w / tau independent draws, so tau is the number
of evaluations an independent draw costs, whatever the move; the time of a draw tells what the move itself adds. Chains
of fits to photons, the misfit taken for noise: the widest and least parabolic posterior.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import emcee
from rich.progress import Progress

from benchmarks.interval_coverage import fitted
from benchmarks.table import show
from mcml_sim import Grid, simulate_orders
from profilefit.fitting.chains import EVOLUTION, Moves, posterior
from profilefit.fitting.estimate import Fit
from profilefit.fitting.profiles import Profiles
from profilefit.recipes import catalogue, recipe
from profilefit.recipes.targets import albedo_values, ring_edges

LAWS = ("burley-whole", "liang-whole", "albedo-rational")
SEED, PHOTONS, LONGEST = 43, 4 * 2**20, 40_000


def moves() -> dict[str, Moves | None]:
    """What is compared, by name."""
    made = emcee.moves
    return {
        "stretch": ((made.StretchMove(), 1.0),),
        "walk": ((made.WalkMove(), 1.0),),
        "DE": ((made.DEMove(), 1.0),),
        "DE 0.8, snooker 0.2": EVOLUTION,
        "Laplace 0.5, DE 0.4, snooker 0.1": None,  # the default
        "DE 0.5, stretch 0.5": ((made.DEMove(), 0.5), (made.StretchMove(), 0.5)),
        "KDE": ((made.KDEMove(), 1.0),),
    }


def line(one: Fit, chosen: Moves | None, longest: int) -> tuple[str, ...]:
    """tau, ms an independent draw, acceptance and what the chain said."""
    posterior(one, "misfit", max_steps=100, moves=chosen)  # compiles
    start = time.perf_counter()
    chain = posterior(one, "misfit", max_steps=longest, moves=chosen)
    seconds = time.perf_counter() - start
    draws = chain.steps * chain.walkers / chain.tau
    return f"{chain.tau:.1f}", f"{1e3 * seconds / draws:.3f}", f"{chain.acceptance:.2f}", chain.result


def fit_of(name: str, photons: int) -> Fit:
    chosen = recipe.find(name, catalogue.fits_folder())
    light = simulate_orders(Grid.from_edges(r=ring_edges(chosen.rings)), photons, SEED, chosen.setting, progress=False)
    profiles = Profiles.from_orders(light, albedo_values(chosen.albedos, chosen.setting))
    return fitted(chosen, catalogue.find(name, catalogue.fits_folder()).law, profiles)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=LAWS, help="records of laws")
    parser.add_argument("--photons", type=int, default=PHOTONS)
    parser.add_argument("--longest", type=int, default=LONGEST, help="the longest that a chain may get [steps]")
    given = parser.parse_args(arguments)
    lines: dict[str, list[tuple[str, ...]]] = {}
    with Progress(transient=True) as progress:
        task = progress.add_task("chains", total=len(given.names) * len(moves()))
        for name in given.names:
            one, lines[name] = fit_of(name, given.photons), []
            for label, chosen in moves().items():
                lines[name].append((label, *line(one, chosen, given.longest)))
                progress.advance(task)
    head = ("moves", "evaluations a draw", "ms a draw", "acceptance", "chain")
    for name, found in lines.items():
        show(f"{name}: moves", head, found)


if __name__ == "__main__":
    main()
