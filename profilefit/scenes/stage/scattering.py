"""Pass 3: the scattered light by samples of a law, or by the separable filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import ProfileLaw
from profilefit.scenes.skin.separable_kernel import Separable
from profilefit.scenes.stage import pattern
from profilefit.scenes.stage.buffers import FullScreen, Targets, float_texture
from profilefit.scenes.stage.exact_law import NAME, ExactLaw
from profilefit.scenes.stage.pattern import best
from profilefit.scenes.stage.sampling import Sampling
from profilefit.shader.emit import law_text, prefix, stage_text

Floats = NDArray[np.float64]
LAW = "law"  # the prefix of the law in every shader of the stage
# Share of a tap that its depth takes, per depth in units of the kernel: the authors' 300 / tan(10 degrees) times a
# width of 0.0125 scene units, the middle of their slider, of which the kernel's unit is a third.
FOLLOW = 300.0 / np.tan(np.radians(10.0)) * 0.0125**2 / 3.0


@dataclass(frozen=True)
class View:
    """What the passes know of the camera: size [pixels], side of a pixel [mm], at a depth of 1 mm in perspective."""

    size: tuple[int, int]
    pixel: float
    is_perspective: bool

    def values(self) -> dict[str, object]:
        size = tuple(float(side) for side in self.size)
        return {"size": size, "pixel": self.pixel, "perspective": float(self.is_perspective)}


class Gathering:
    """Samples of a law whose text is compiled in."""

    def __init__(self, context: moderngl.Context, law: ProfileLaw | ExactLaw, sampling: Sampling):
        fragment = f"{_switches(sampling)}{text_of(law)}\n{stage_text('scatter.frag')}"
        self._pass = FullScreen(context, f"scatter {name_of(law)}", f"#version 330\n{fragment}")
        self.name, self.milliseconds = self._pass.name, self._pass.milliseconds
        self._tables = tables_of(context, law)
        shifts = pattern.shifts()
        self._noise = float_texture(context, shifts.shape[:2], 2, shifts)

    def run(self, targets: Targets, view: View, sampling: Sampling, mfp: Floats, fixed_alpha: Floats) -> None:
        # A channel's third of the points is no lattice: to be right in the mean, its shifts must go everywhere.
        lattice = best(sampling.samples)
        values = {
            **view.values(),
            "mfp": tuple(mfp),
            "fixed_alpha": tuple(fixed_alpha),
            "samples": sampling.samples,
            "longest": max(range(3), key=lambda channel: (mfp[channel], fixed_alpha[channel])),
            "seed": sampling.seed,
            "generator": lattice.generator,
            "cell": (1.0, 0.0, 0.0, 1.0) if sampling.channels == "mixture" else tuple(lattice.cell.ravel()),
        }
        textures = {**targets.maps, "noise_map": self._noise, **self._tables}
        self._pass.run(targets.into[targets.exitance], textures, values)

    def release(self) -> None:
        self._pass.release()
        for texture in (self._noise, *self._tables.values()):
            texture.release()


class Filtering:
    """Two passes of the separable filter."""

    def __init__(self, context: moderngl.Context, law: Separable):
        self.context, self.law = context, law
        self._pass = FullScreen(context, "separable", f"#version 330\n{stage_text('separable.frag')}")
        self.name, self.milliseconds = self._pass.name, self._pass.milliseconds

    def run(self, targets: Targets, view: View, sampling: Sampling, stretches: Floats) -> None:
        taps = self.law.taps(sampling.samples, stretches)
        kernel = float_texture(self.context, (len(taps), 1), 4, taps)
        common = {**view.values(), "follow": float(FOLLOW / np.max(stretches))}
        shared = {name: targets.maps[name] for name in ("reflectance_map", "position_map")} | {"kernel_map": kernel}
        steps = (
            (targets.maps["irradiance_map"], targets.halfway, (1.0, 0.0), 0.0),
            (targets.halfway, targets.exitance, (0.0, 1.0), 1.0),
        )
        for source, target, direction, last in steps:
            textures: Mapping[str, moderngl.Texture] = {"light_map": source, **shared}
            self._pass.run(targets.into[target], textures, {**common, "direction": direction, "last": last})
        kernel.release()

    def release(self) -> None:
        self._pass.release()


def text_of(law: ProfileLaw | ExactLaw) -> str:
    """The text of a law with the prefix that the stage's shaders call."""
    return law.text(LAW) if isinstance(law, ExactLaw) else law_text(law, name=LAW)


def tables_of(context: moderngl.Context, law: object) -> dict[str, moderngl.Texture]:
    """The textures that a law's text asks for, by the names of their samplers."""
    arrays = law.textures(LAW) if isinstance(law, ExactLaw) else {}
    return {
        name: float_texture(context, (array.shape[1], array.shape[0]), array.shape[2], array)
        for name, array in arrays.items()
    }


def name_of(law: ProfileLaw | ExactLaw) -> str:
    return NAME if isinstance(law, ExactLaw) else prefix(law)


def _switches(sampling: Sampling) -> str:
    on = {
        "UNIFORM": sampling.kind == "uniform",
        "BLUE": sampling.kind == "importance blue",
        "MIXTURE": sampling.channels == "mixture",
        "AREA": sampling.area,
    }
    return "".join(f"#define {name} {int(value)}\n" for name, value in on.items())
