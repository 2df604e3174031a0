"""Mesh of one's own: seconds to the first picture and to one with its reference, of a GLB of 200,000 triangles.

    python -m benchmarks.own_mesh [--out DIR] [--rows N]

The file is a knot, made by formula, with a base colour, a normal map and a roughness. Both commands are run as a user
runs them, `profilefit scene`, at the default size of the picture.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Floats = NDArray[np.float64]
ROWS, ACROSS = 1000, 100  # of the knot's grid: 2 x ROWS x ACROSS triangles
RADIUS, TUBE = 0.06, 0.028  # [m]
SCENE = """scene = "skin"
material = "marble"
n = 1.5
[surface]
mesh = "knot.glb"
"""


def knot(rows: int = ROWS, across: int = ACROSS) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Return points (n, 3) [m], uv (n, 2) and triangles (m, 3) of a tube along a trefoil."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, across + 1), indexing="ij")
    t = 2.0 * np.pi * u
    middle = np.stack([np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t), -np.sin(3.0 * t)], axis=-1)
    along = np.stack(
        [np.cos(t) + 4.0 * np.cos(2.0 * t), -np.sin(t) + 4.0 * np.sin(2.0 * t), -3.0 * np.cos(3.0 * t)], axis=-1
    )
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    up = np.cross(side, along)
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    angle = 2.0 * np.pi * v[..., None]
    points = RADIUS / 3.0 * middle + TUBE * (np.cos(angle) * side + np.sin(angle) * up)
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return points.reshape(-1, 3), np.stack([u, v], axis=-1).reshape(-1, 2), triangles


def textures(side: int = 512) -> tuple[Image.Image, Image.Image]:
    """Return a base colour of veins, and a normal map of dimples."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, side), np.linspace(0.0, 1.0, side), indexing="ij")
    vein = np.abs(np.sin(2.0 * np.pi * (6.0 * u + np.sin(2.0 * np.pi * (2.0 * u + 3.0 * v)) / 3.0))) ** 0.3
    colour = np.clip(255.0 * (0.55 + 0.4 * vein[..., None] * [1.0, 0.98, 0.93]), 0, 255).astype(np.uint8)
    slope = 0.25 * np.stack([np.sin(2.0 * np.pi * 60.0 * u), np.sin(2.0 * np.pi * 8.0 * v)], axis=-1)
    normal = np.concatenate([slope, np.sqrt(1.0 - np.sum(slope**2, axis=-1, keepdims=True))], axis=-1)
    return Image.fromarray(colour), Image.fromarray(np.round(127.5 * (normal + 1.0)).astype(np.uint8))


def write(folder: Path, rows: int = ROWS, across: int = ACROSS) -> Path:
    """Write knot.glb and knot.toml into a folder, and return the latter's path."""
    import trimesh

    points, uv, triangles = knot(rows, across)
    colour, normal = textures()
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=colour, normalTexture=normal, roughnessFactor=0.3, metallicFactor=0.0
    )
    look = trimesh.visual.TextureVisuals(uv=uv, material=material)
    (folder / "knot.glb").write_bytes(
        trimesh.Trimesh(points, triangles, visual=look, process=False).export(file_type="glb")
    )
    path = folder / "knot.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def main() -> None:
    """Print seconds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="folder for the file and its pictures")
    parser.add_argument("--rows", type=int, default=ROWS, help="rows of the knot's grid")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = options.out or Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        path = write(folder, options.rows)
        print(f"{path.with_suffix('.glb')}: {2 * options.rows * ACROSS} triangles")
        for what, more in (("first picture", ["--no-reference"]), ("picture with its reference", [])):
            start = time.perf_counter()
            command = [sys.executable, "-m", "profilefit", "scene", str(path), "--out", str(folder), "--quiet", *more]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            print(f"{what}: {time.perf_counter() - start:.1f} s")
        print(done.stdout, end="")


if __name__ == "__main__":
    main()
