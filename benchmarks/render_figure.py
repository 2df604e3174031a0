"""Small files of figures: as many colours as it takes, and no more."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial import cKDTree

from profilefit.report.figures.canvas import DPI


def save(figure: Figure, path: Path, colours: int, kept: Sequence[Sequence[int]] = ()) -> None:
    """Save a .png with a palette of up to 256 colours, each pixel the nearest, so that flat areas stay flat.

    kept  red, green, blue in 0 ... 255 that the palette has in any case: steps of a scale that must stay apart
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=DPI)
    with Image.open(drawn) as image:
        plain = image.convert("RGB")
    common = plain.quantize(colours - len(kept), dither=Image.Dither.NONE).getpalette() or []
    palette = np.concatenate([np.reshape(kept, (-1, 3)), np.reshape(common, (-1, 3))]).astype(np.uint8)
    _, index = cKDTree(palette.astype(float)).query(np.asarray(plain, float))
    small = Image.fromarray(index.astype(np.uint8), "P")
    small.putpalette(palette.tobytes())
    small.save(path, optimize=True)
