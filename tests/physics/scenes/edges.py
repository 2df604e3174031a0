"""Step edges whose answer is known, also on planes that are seen aslant."""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from benchmarks.planes import step_edge
from mcml_sim import Setting, exact

DIFFUSE = Setting("diffuse")
SHARES = (np.arange(1000) + 0.5) / 1000  # the answer is right to 1e-4
_radii = cache(partial(exact.quantile, SHARES))


def answer(x, alpha, setting=DIFFUSE):
    """Light at signed distances x [mfp] from an edge, over A: radii of even shares cross it by arccos(|x|/r) / pi."""
    radius = _radii(alpha, setting=setting)
    crossed = np.mean(np.arccos(np.minimum(np.abs(x)[..., None] / radius, 1.0)), axis=-1) / np.pi
    return np.where(x > 0, 1.0 - crossed, crossed)


def aslant(size, pixel, reflectance, degrees, depth=None):
    """`step_edge` turned about the edge, and pixels' distances from it [mm]; in perspective from `depth` [mm] away."""
    flat = step_edge(size, pixel, reflectance)
    x, y = np.moveaxis(flat.position[..., :2].astype(float), -1, 0)
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    normal = np.array([-sine, 0.0, cosine])
    if depth is None:
        position = np.stack([x, y, -100.0 + x * sine / cosine], axis=-1)
    else:
        ray = np.stack([x / depth, y / depth, np.full_like(x, -1.0)], axis=-1)
        position = ray * (-cosine * depth / (ray @ normal))[..., None]
    turned = replace(
        flat,
        position=position.astype(np.float32),
        normal=np.broadcast_to(normal, position.shape).astype(np.float32),
        is_perspective=depth is not None,
        pixel=pixel if depth is None else pixel / depth,
    )
    return turned, position[..., 0] / cosine
