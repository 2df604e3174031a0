"""Exact light under surfaces that refract, and in stacks: its error, by what it shares no code with, and seconds.

    python -m benchmarks.refracting                # ten minutes on two cores; --quick: a tenth of the photons

Totals are held against the integral equation of a stack of one layer, which shares no code with mirror and cone; the
profile against more nodes of every quadrature, against photons in rings, and where n tends to 1 against the closed form
of a surface that does not refract; a half space cut into layers against the half space; derivatives against
differences. p-values are the least of several chi-squares, times their number.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.table import show
from mcml_sim import Grid, Layer, Medium, Setting, exact, half_space, simulate, simulate_orders
from mcml_sim.exact import cone, refracting
from mcml_sim.exact.transform import STANDARD

Floats = NDArray[np.float64]

INDICES = (1.3, 1.4, 1.5)
LIGHTS = ("searchlight", "diffuse")
SETTINGS = [Setting(light, n=n) for n in INDICES for light in LIGHTS]
ALPHAS = np.array([0.05, 0.3, 0.8, 0.95, 0.99, 0.999])[:, None]
RADII = np.geomspace(1e-3, 15.0, 60)
MANY_ALPHAS, MANY_RADII = (
    1 - np.linspace(np.sqrt(0.95), np.sqrt(0.001), 32)[:, None] ** 2,
    np.geomspace(1e-3, 15.0, 256),
)
BARELY = 1 + 1e-12  # an index that hardly refracts
WAVES = (1e-3, 0.1, 0.5, 1.0, 3.0, 7.0)
EDGES = np.append(0.0, np.geomspace(0.01, 10.0, 40))  # of rings of photons [mfp]
LAYERS = Medium((Layer(1.4, 0.1, 2.0, 0.0, 0.5), Layer(1.4, 0.5, 0.5, 0.0, 0.7), Layer(1.4, 0.05, 1.5, 0.0)))
PHOTONS = 10**8
TURNS = 5


def totals() -> float:
    """Return the largest relative difference of A from that by the integral equation."""
    pairs = [
        (exact.reflectance(alpha, where), exact.solve(half_space(alpha, n=where.n), where.illumination).reflectance)
        for where in SETTINGS
        for alpha in ALPHAS.ravel().tolist()
    ]
    return max(abs(one / other - 1) for one, other in pairs)


def doubled() -> float:
    """Return the largest relative change of the transform at a real wave number, total first, with twice the nodes."""
    worst = 0.0
    with jax.enable_x64(True):
        for n in INDICES:
            for k in WAVES:
                few, many = (_transform(cone.system(jnp.float64(n), jnp.asarray(k + 0j), factor * 96, factor * 72))
                             for factor in (1, 2))  # fmt: skip
                worst = max(worst, float(np.abs(few / many - 1).max()))
    return worst


def _transform(system: cone.System) -> NDArray[np.complex128]:
    """Return R^ / alpha at alpha = 0.9 under both lights."""
    matrix, leaving, source = map(np.asarray, system)
    return source @ np.linalg.solve(np.eye(len(matrix)) - 0.9 * matrix, leaving)


def profile() -> float:
    """Return the largest relative change of the profile with half as many nodes again."""
    return max(float(np.max(exact.error_estimate(RADII, ALPHAS, setting=where))) for where in SETTINGS)


def matched() -> float:
    """Return the largest relative difference of the profile at n - 1 = 1e-12 from the closed form at n = 1."""
    r = RADII[RADII < 5]
    pairs = [
        (exact.profile(r, ALPHAS, setting=Setting(light, n=BARELY)), exact.profile(r, ALPHAS, setting=Setting(light)))
        for light in LIGHTS
    ]
    return max(float(np.abs(one / other - 1).max()) for one, other in pairs)


def new_index() -> Floats:
    """Return the seconds of 256 radii at 32 albedos under a surface that was never seen, compiled, in turns."""
    seconds = []
    for n in np.linspace(1.31, 1.49, TURNS + 1):
        begin = time.perf_counter()
        refracting.new_table(float(n), STANDARD)
        made = time.perf_counter() - begin
        exact.reflectance(0.5, Setting(n=float(n)))  # keeps its table, made again
        begin = time.perf_counter()
        exact.profile(MANY_RADII, MANY_ALPHAS, setting=Setting(n=float(n)))
        seconds.append(made + time.perf_counter() - begin)
    return np.array(seconds[1:])


def derivatives() -> float:
    """Return the largest relative difference of the profile's slopes from differences of fourth order."""
    worst, at = 0.0, (0.9, 1.3, 1.2, 1.4)
    for light in LIGHTS:

        def value(alpha, r, mfp, n, light=light):
            return exact.profile(r, alpha, mfp, Setting(light, n=n))

        with jax.enable_x64(True):
            slopes = jax.jacfwd(lambda x, value=value: value(*x))(jnp.array(at))
        for index, slope in enumerate(np.asarray(slopes)):
            step = 4e-3 if index == 3 else 1e-3
            ends = [value(*(x + shift * step * (one == index) for one, x in enumerate(at))) for shift in (-2, -1, 1, 2)]
            difference = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
            worst = max(worst, abs(float(slope) / difference - 1))
    return worst


def cut() -> float:
    """Return the largest relative difference of the profile of a half space cut into three nearly equal layers."""
    worst, r = 0.0, RADII
    for n in (1.0, *INDICES):
        layers = (
            Layer(n, 0.1, 0.9, 0.0, 0.3),
            Layer(n, 0.1 * (1 + 1e-9), 0.9, 0.0, 1.0),
            Layer(n, 0.1, 0.9 * (1 + 1e-9), 0.0),
        )
        for light in LIGHTS:
            found = exact.solve(Medium(layers), light).profile(r) / exact.profile(r, 0.9, setting=Setting(light, n=n))
            worst = max(worst, float(np.abs(found - 1).max()))
    return worst


def stack() -> Floats:
    """Return the seconds of `exact.solve` and 256 radii of three layers that refract, in turns."""
    seconds = []
    for _ in range(TURNS + 1):
        begin = time.perf_counter()
        exact.solve(LAYERS).profile(MANY_RADII)
        seconds.append(time.perf_counter() - begin)
    return np.array(seconds[1:])


def half_space_photons(photons: int) -> float:
    """Return the p-value of rings under n = 1.4, both lights, three albedos."""
    chances = []
    for where in (Setting(light, n=1.4) for light in LIGHTS):
        run = simulate_orders(Grid.from_edges(r=EDGES), photons, seed=41, setting=where, progress=False)
        for alpha in (0.3, 0.9, 0.99):
            seen = run.energy(alpha)
            wanted = np.diff(exact.cdf(EDGES, alpha, setting=where)) * exact.reflectance(alpha, where)
            chances.append(_chance(np.asarray(seen.value), np.asarray(seen.standard_error), wanted))
    return min(1.0, len(chances) * min(chances))


def stack_photons(photons: int) -> float:
    """Return the p-value of rings of LAYERS, both lights."""
    grid, chances = Grid.from_edges(r=EDGES), []
    for light in LIGHTS:
        tally = simulate(LAYERS, grid, photons, seed=43, illumination=light, progress=False)
        seen = tally.reflectance_r.scaled(grid.r_areas)
        found = exact.solve(LAYERS, light)
        wanted = np.diff(found.cdf(EDGES)) * found.reflectance
        chances.append(_chance(np.asarray(seen.value), np.asarray(seen.standard_error), wanted))
    return min(1.0, len(chances) * min(chances))


def _chance(seen: Floats, error: Floats, wanted: Floats) -> float:
    return float(chi2.sf(np.sum(((seen - wanted) / error) ** 2), wanted.size))


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the photons")
    parser.add_argument("--json", type=Path, help="where to write the numbers")
    options = parser.parse_args()

    photons = PHOTONS // 10 if options.quick else PHOTONS
    works: dict[str, Callable[[], float | Floats]] = {
        "totals": totals,
        "doubled nodes": doubled,
        "profile": profile,
        "matched": matched,
        "derivatives": derivatives,
        "cut": cut,
        "half space, photons": lambda: half_space_photons(photons),
        "stack, photons": lambda: stack_photons(photons),
        "new index, seconds": new_index,
        "stack, seconds": stack,
    }
    found = {name: np.percentile(work(), [50, 0, 100]).tolist() for name, work in works.items()}
    show("Exact light under surfaces that refract, and in stacks", ("what", "measured", "from", "to"),
         [(name, *(f"{value:.2g}" for value in values)) for name, values in found.items()])  # fmt: skip
    if options.json:
        options.json.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
