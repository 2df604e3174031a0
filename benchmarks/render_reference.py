"""Reference of a render: seconds, memory, what half a pixel changes, and its difference from a double sum."""

from __future__ import annotations

import resource
import time

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim import Setting
from profilefit.scenes.skin.scene import head_scene, read
from profilefit.scenes.stage.exact_law import exact_table
from profilefit.scenes.stage.reference.surface import Surface, View, exitance_of, own_error, seen
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Rgb

Floats = NDArray[np.float64]
SIZE, SETTING = (1280, 720), Setting("diffuse", n=1.4)
CHECKED = 100  # pixels
# Gauss points on a side of pixels up to so many of their sides away; one beyond.
RULES = ((4.0, 10), (16.0, 3))


def measured(context: moderngl.Context, size: tuple[int, int]) -> dict:
    """Return seconds and errors of the reference of skin at a size [pixels]."""
    scene = head_scene(camera=read("defaults", {}).camera, setting=SETTING)
    exact_table(SETTING)
    with Stage(context, size) as stage:
        stage.draw(scene)
        buffers = stage.buffers()
    before, start = peak(), time.perf_counter()
    light = exitance_of(buffers, scene.material.mfp, SETTING)
    seconds, own = time.perf_counter() - start, peak()
    surface, view = seen(buffers)
    pixels = np.random.default_rng(1).permutation(np.argwhere(surface.mask))[:CHECKED]
    summed = double_sum(surface, view, scene.material.mfp, SETTING, pixels)
    with Stage(context, (2 * size[0], 2 * size[1])) as stage:
        stage.draw(scene)
        fine = stage.buffers()
    error = own_error(fine, scene.material.mfp, SETTING)
    change = np.abs(light[tuple(pixels.T)] - summed) / light[surface.mask].mean()
    return {
        "size": size,
        "pixels": len(np.argwhere(surface.mask)),
        "seconds": seconds,
        "double_sum": {"rms": float(np.sqrt(np.mean(change**2))), "largest": float(change.max())},
        "own_error": error,
        "peak_bytes": {"before": before, "reference": own, "with_error": peak()},
    }


def report(found: dict) -> None:
    """Print them."""
    columns, rows = found["size"]
    print(f"{columns} x {rows}, {found['pixels']} pixels of skin: {found['seconds']:.1f} s, its table built before")
    differences = ", ".join(f"{name} {value:.1e}" for name, value in found["double_sum"].items())
    print(f"difference from a double sum at {CHECKED} pixels: {differences}")
    print("what half a pixel changes, median, 90 %, RMS:", *(f"{value:.1e}" for value in found["own_error"]))
    before, own, with_error = (size / 1e9 for size in found["peak_bytes"].values())
    print(f"peak memory: {own:.2f} GB, with its error {with_error:.2f} GB, of which {before:.2f} GB before it")


def peak() -> int:
    """Return the largest resident memory of this process so far [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # Linux counts KiB


def double_sum(surface: Surface, view: View, mfp: Rgb, setting: Setting, pixels: NDArray[np.intp]) -> Floats:
    """Return the light (m, 3) at pixels, of the exact profile summed over every visible pixel by Gauss points."""
    across, along = (side[surface.mask] for side in view.footprint(surface.position, surface.normal))
    place, irradiance = surface.position[surface.mask], surface.irradiance[surface.mask]
    area, table = np.linalg.norm(np.cross(across, along), axis=1), exact_table(setting)
    side = np.maximum(np.linalg.norm(across, axis=1), np.linalg.norm(along, axis=1))
    light = np.empty((len(pixels), 3))
    for number, at in enumerate(map(tuple, pixels)):
        curves, lengths = table.curves(surface.reflectance[at]), np.array(mfp)[:, None]
        offset = place - surface.position[at]
        distance = np.linalg.norm(offset, axis=1)
        away = distance / side
        weight = np.empty((3, len(place)))
        for low, high, points in _bands():
            of = (away >= low) & (away < high)
            nodes, shares = np.polynomial.legendre.leggauss(points)
            weight[:, of] = sum(
                0.25 * u * v * area[of] * _density(curves, offset[of] + 0.5 * (a * across[of] + b * along[of]), lengths)
                for a, u in zip(nodes, shares, strict=True)
                for b, v in zip(nodes, shares, strict=True)
            )
        own = int(np.argmin(distance))
        weight[:, own] = _own(curves, across[own], along[own], lengths)
        light[number] = np.sum(weight * irradiance.T, axis=1) / weight.sum(axis=1)
    return light * surface.reflectance[tuple(pixels.T)]


def _bands() -> list[tuple[float, float, int]]:
    ends = [0.0, *(most for most, _ in RULES), np.inf]
    return [(low, high, points) for low, high, points in zip(ends, ends[1:], [n for _, n in RULES] + [1], strict=False)]


def _density(curves, offset: Floats, mfp: Floats) -> Floats:
    return curves.density(np.linalg.norm(offset, axis=1) / mfp) / mfp**2


def _own(curves, across: Floats, along: Floats, mfp: Floats) -> Floats:
    """Return the integral (3,) over the own pixel, by four triangles whose area element cancels 1 / r."""
    nodes, shares = np.polynomial.legendre.leggauss(24)
    s, t = (0.5 * (grid.ravel() + 1.0) for grid in np.meshgrid(nodes, nodes))
    weights = 0.25 * np.outer(shares, shares).ravel()
    corners = [0.5 * (a * across + b * along) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    total = np.zeros(3)
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        offset = s[:, None] * ((1.0 - t)[:, None] * p + t[:, None] * q)
        total += np.linalg.norm(np.cross(p, q)) * np.sum(weights * s * _density(curves, offset, mfp), axis=1)
    return total
