"""The cheapest option within tolerance and budget, by every option's predicted cost and worst error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from mcml_sim import Setting
from profilefit.laws import profile_classes
from profilefit.laws.base import ProfileLaw
from profilefit.recipes import catalogue
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import Records
from profilefit.studies.choose.case import Case, Option, filters, sampled
from profilefit.studies.choose.cost import Milliseconds, Ratios, milliseconds
from profilefit.studies.choose.error import Error, ReferenceLight, error
from profilefit.studies.choose.requirements import Range, Requirements

STRIDE = 4.0  # largest step of a mean free path in pixels from one case to the next
SEEN = 4.0  # pixels of a radius from which its shape is seen: below, an outline is
AS_GOOD = 1.1  # ratio of errors: predicted noise is known to 4 %, and less well where a few samples weigh much
Track = Callable[[list[Option]], Iterable[Option]]


@dataclass(frozen=True)
class Predicted:
    """An option's frame, and its error in the scene's worst case."""

    option: Option
    frame: Milliseconds
    error: Error

    @property
    def ms(self) -> float:
        """Estimated time of a frame [ms]."""
        return self.frame.estimate


@dataclass(frozen=True)
class Choice:
    """Options with their predictions, and which of them are within the limits.

    predicted  cheapest first, as far as the choice needs
    chosen     the cheapest within tolerance and budget, or None
    nearest    what is shown: the chosen one, else the cheapest within the tolerance, else the most accurate within the
               budget
    cheaper    of those that cost less, the most accurate;  dearer  the cheapest that is more accurate; None if there is
               none
    """

    scene: Requirements
    predicted: tuple[Predicted, ...]
    chosen: Predicted | None
    nearest: Predicted
    cheaper: Predicted | None
    dearer: Predicted | None

    @property
    def meets_tolerance(self) -> bool:
        return self.nearest.error.total <= self.scene.tolerance

    @property
    def meets_budget(self) -> bool:
        return affordable(self.nearest, self.scene)


def affordable(prediction: Predicted, scene: Requirements) -> bool:
    """Return whether its frame, as estimated, is within the budget."""
    return scene.budget.ms is None or prediction.ms <= scene.budget.ms


def laws(setting: Setting) -> dict[str, ProfileLaw]:
    """Return laws with a shader source and one record under this illumination, by the record's name.

    The record is one whose constants hold for the setting, else that of a matched surface.
    """
    records, laws = Records(fits_folder()), {}
    for name, kind in profile_classes().items():
        for base in kind.entry.records if kind.entry.has_text else ():
            own = setting if records.name(base, setting) in records.paths else Setting(setting.illumination)
            if kind.entry.records == (base,) and (of := records.name(base, own)) in records.paths:
                laws[of] = catalogue.load(name, setting=own, folder=records)
    return laws


def cases(scene: Requirements) -> Iterator[Case]:
    """Yield the ends of all ranges: dark and light skin, far and near, flat and as curved as it gets.

    From the shortest mean free path in the largest pixel to the longest in the smallest in steps of STRIDE at most.
    """
    kernel = middle(scene).reflectance
    (near, far), path = scene.pixel, max(high / low for low, high in scene.mfp)
    steps = math.ceil(math.log(path * far / near) / math.log(STRIDE)) if path * far / near > 1.001 else 0
    for way in np.linspace(0.0, 1.0, steps + 1).tolist():
        mfp = tuple(_between(one, way) for one in scene.mfp)
        pixel = _between((far, near), way)
        columns, rows = scene.resolution
        window = (0.5 * columns * pixel, 0.5 * rows * pixel)
        for reflectance in sorted({tuple(one[end] for one in scene.reflectance) for end in (0, 1)}):
            yield Case(reflectance, mfp, pixel, math.inf, kernel, window)
            if SEEN * pixel <= scene.radius < math.inf:
                yield Case(reflectance, mfp, pixel, scene.radius, kernel, window)


def middle(scene: Requirements) -> Case:
    """Return the middle of all ranges, on a plane: what one filter for the whole picture is made for."""
    reflectance = tuple(0.5 * (low + high) for low, high in scene.reflectance)
    return Case(reflectance, tuple(_between(one, 0.5) for one in scene.mfp), _between(scene.pixel, 0.5))


def choose(scene: Requirements, ratios: Ratios, track: Track = iter) -> Choice:
    """Predict all options whose cost was measured, and choose."""
    budget, light = scene.budget, ReferenceLight(scene.setting)
    of_laws = [option for name, law in laws(scene.setting).items() for option in sampled(law, name)]
    priced = {
        option: milliseconds(option, ratios, budget.gpu, budget.screen_share, math.prod(scene.resolution))
        for option in (*filters(), *of_laws)
        if ratios.knows(option)
    }
    predicted: list[Predicted] = []
    for option in track(sorted(priced, key=lambda option: priced[option].estimate)):
        errors = (error(option, case, light, scene.within) for case in cases(scene))
        predicted.append(Predicted(option, priced[option], max(errors, key=lambda one: one.total)))
        serving = next((one for one in predicted if one.error.total <= scene.tolerance), None)
        if serving and predicted[-1].error.total < serving.error.total:  # what is dearer still need not be known
            break
    return chosen(scene, predicted)


def chosen(scene: Requirements, predicted: Iterable[Predicted]) -> Choice:
    """Return the choice among options, cheapest first."""
    every = tuple(predicted)
    good = [one for one in every if one.error.total <= scene.tolerance]
    paid = [one for one in every if affordable(one, scene)]
    both = [one for one in good if affordable(one, scene)]
    if good:
        nearest = (both or good)[0]
    else:  # the cheapest that is as good as any, within the accuracy of a prediction
        least = min(one.error.total for one in paid or every)
        nearest = next(one for one in paid or every if one.error.total <= AS_GOOD * least)
    place = every.index(nearest)
    cheaper = min(every[:place], key=lambda one: one.error.total, default=None)
    dearer = next((one for one in every[place + 1 :] if one.error.total < nearest.error.total), None)
    return Choice(scene, every, both[0] if both else None, nearest, cheaper, dearer)


def _between(ends: Range, way: float) -> float:
    """Return a point between both ends, geometrically."""
    return float(ends[0] ** (1.0 - way) * ends[1] ** way)
