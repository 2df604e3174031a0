"""Two failures of samples on the screen, in a close view of the head: aliasing of few pixels, rings of one pattern.

`python -m benchmarks.render_patterns` takes ten seconds, and holds a picture against a finer one averaged down, then
against many samples at the same pixels. Errors are root mean squares over the mean, where light scatters inside.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import profilefit
from benchmarks.render_view import CLOSE
from benchmarks.table import show
from profilefit.scenes.skin.scene import head_scene
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import Gather
from profilefit.scenes.stage.world import INSIDE
from profilefit.shader.context import open_context

SCENE = head_scene(camera=CLOSE)
SIZES = ((64, 48), (128, 96), (256, 192), (512, 384))  # [pixels]
SAMPLES, BLOCK = (16, 64), 4  # of a pixel; pixels of a block's side
KINDS = {"one for all": "importance blue", "white": "importance", "blue": "importance blue"}


@dataclass(frozen=True, eq=False)
class Shifted(Gather):
    is_one: bool = False  # shift for all pixels

    def passes(self, frame):
        one = {"noise_map": np.full((1, 1, 2), 0.5, np.float32)} if self.is_one else {}
        return [replace(each, reads={**each.reads, **one}) for each in super().passes(frame)]


def picture(stage: Stage, samples: int = MOST_SAMPLES, shifts: str = "blue", seed: int = 0):
    by = Shifted(Gather.of(profilefit.load("hazard", setting=DIFFUSE)).law, shifts == "one for all")
    return stage.scatter(by, SCENE.material.mfp, Sampling(samples, KINDS[shifts], seed=seed)).astype(float)


def mean(values, factor: int):
    rows, columns = (side // factor for side in values.shape[:2])
    return values.reshape(rows, factor, columns, factor, -1).mean(axis=(1, 3))


def aliasing() -> None:
    pictures, table = [], []
    for size in SIZES:
        with Stage(open_context(), size) as stage:
            stage.draw(SCENE)
            pictures.append(picture(stage))
            inside = stage.buffers().mask > INSIDE
    for size, own, finer in zip(SIZES[:-2], pictures, [mean(one, 2) for one in pictures[1:]], strict=False):
        truth, whole = (mean(one, SIZES[-1][0] // size[0]) for one in (pictures[-1], inside.astype(float)))
        seen, mfp = whole[..., 0] == 1.0, min(SCENE.material.mfp) * size[1] / SCENE.camera.height
        errors = (np.sqrt(np.mean((one - truth)[seen] ** 2)) / truth[seen].mean() for one in (own, finer))
        table.append((f"{size[0]} x {size[1]}", f"{mfp:.2f}", *(f"{one:.4f}" for one in errors)))
    show("Aliasing", ("pixels", "shortest mfp", "error", "of twice the pixels, averaged"), table)


def rings() -> None:
    table = []
    with Stage(open_context(), SIZES[2]) as stage:
        stage.draw(SCENE)
        inside, truth = stage.buffers().mask > INSIDE, np.mean([picture(stage, seed=1 + i) for i in range(4)], axis=0)
        blocks, pairs = mean(inside.astype(float), BLOCK)[..., 0] == 1.0, inside[:, 1:] & inside[:, :-1]
        for samples, shifts in ((samples, shifts) for samples in SAMPLES for shifts in KINDS):
            error = np.where(inside[..., None], picture(stage, samples, shifts) - truth, 0.0) / truth[inside].mean()
            sizes = (np.sqrt(np.mean(one**2)) for one in (error[inside], mean(error, BLOCK)[blocks]))
            alike = np.corrcoef(error[:, 1:][pairs].ravel(), error[:, :-1][pairs].ravel())[0, 1]
            table.append((shifts, str(samples), *(f"{one:.4f}" for one in sizes), f"{alike:.2f}"))
    show("Rings", ("shifts", "samples", "error", f"of {BLOCK} x {BLOCK} pixels", "correlation of neighbours"), table)


if __name__ == "__main__":
    aliasing()
    rings()
