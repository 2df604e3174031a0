"""The choice for a scene as a table: the cheapest option within tolerance and budget, its neighbours, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.text import Text

from profilefit.report.tables.cells import column_table, on_the_point, significant
from profilefit.studies.choose.case import is_filter
from profilefit.studies.choose.choice import Choice, Predicted, affordable, middle
from profilefit.studies.choose.cost import Ratios
from profilefit.studies.choose.error import CHANNELS, ReferenceLight, passes
from profilefit.studies.choose.layers import OneLayer

if TYPE_CHECKING:  # it draws, which nothing else here does
    from profilefit.studies.choose.scenes import AtlasNeed, FurNeed, SeaNeed

PARTS = {"model": "law", "curvature": "curve", "pixel": "pixel", "noise": "noise"}
CAUSES = {"model": "its shape", "curvature": "the curved surface", "pixel": "large pixels", "noise": "noise"}
LAYERS = {  # the worse the later
    "enough": "one layer is enough",
    "enough alone": "one layer is enough by itself, but not with this choice: a more accurate way leaves it room",
    "undecided": "undecided: as far from the tolerance as the photons' noise",
    "not enough": "one layer is not enough: fit the stack's own profile (profilefit fit STACK.mco)",
}


def choose_table(choice: Choice, ratios: Ratios, layers: Sequence[OneLayer] = ()) -> RenderableType:
    """Return the report of a choice.

    layers  the one layer for a stack: none without one, one of a grey stack, or those of red, green and blue
    """
    nearest = "chosen" if choice.chosen else "nearest"
    shown = {"best cheaper": choice.cheaper, nearest: choice.nearest, "next dearer": choice.dearer}
    rows = {name: one for name, one in shown.items() if one is not None}
    least = min(one.error.total for one in rows.values())
    places = max(1 - math.floor(math.log10(max(100.0 * least, 1e-4))), 0)  # two digits of the least
    columns = {
        "": list(rows),
        "way": [one.option.label for one in rows.values()],
        "error %": [_percent(one.error.total, places) for one in rows.values()],
        **{h: [_percent(getattr(one.error, part), places) for one in rows.values()] for part, h in PARTS.items()},
        "ms": on_the_point([significant(one.ms) for one in rows.values()]),
        "range": [f"{significant(one.frame.least)} to {significant(one.frame.most)}" for one in rows.values()],
        "serves": [_serves(one, choice) for one in rows.values()],
    }
    table = column_table(headline(choice), columns, _caption(choice, ratios), ("", "serves"), ("way",))
    return Group(table, Text(), Text(_layer(layers, choice), style="bold")) if layers else table


def atlas_line(answer: AtlasNeed) -> str:
    """Return whether a heart's scene needs an atlas."""
    error, hidden = (significant(100 * one) for one in (answer.error, answer.hidden))
    misses = f"screen space alone has an error of {error} % of the light, and hidden surface causes {hidden} %"
    is_coarse = answer.is_broken and answer.verdict == "no atlas"
    advice = "; finer pixels would mend it" if is_coarse else ""
    return f"{answer.verdict}: {misses} (tolerance: {_percent(answer.tolerance)} %){advice}"


def atlas_content(answer: AtlasNeed) -> dict[str, Any]:
    """Return the answer as data."""
    return {"verdict": answer.verdict, "error": answer.error, "hidden": answer.hidden, "tolerance": answer.tolerance}


def sea_lines(answer: SeaNeed) -> list[str]:
    """Return what a scene under the sea needs, a line each for terms, splat and steps, with the numbers."""
    off = ", ".join(f"{kind} {_percent(error)} %" for kind, error in answer.haze.items())
    folds = "light folds" if answer.focus >= 1.0 else "no light folds"
    ways = {"sunlight": (answer.light_steps, answer.light), "views": (answer.view_steps, answer.view)}
    each = (f"{name} {n or 'none, Newton alone'} (S {significant(steep)})" for name, (n, steep) in ways.items())
    return [
        f"terms: {answer.terms}; off the broadened haze at worst: {off} (requested: {_percent(answer.tolerance)} %)",
        f"splat: {answer.splat}; {folds} before the floor (F {significant(answer.focus)})",
        f"steps to a hit: {', '.join(each)}",
    ]


def sea_content(answer: SeaNeed) -> dict[str, Any]:
    """Return the answer as data."""
    return {
        "terms": answer.terms,
        "haze": dict(answer.haze),
        "tolerance": answer.tolerance,
        "splat": answer.splat,
        "focus": answer.focus,
        "steps": {"light": answer.light_steps, "view": answer.view_steps},
        "steepness": {"light": answer.light, "view": answer.view},
    }


def fur_lines(answer: FurNeed) -> list[str]:
    """Return how many layers fur needs, a line an angle, and the answer."""
    lines = []
    for angle, layers in answer.layers.items():
        counts = ", ".join(f"{name.replace(',', '')} {count or 'none'}" for name, count in layers.items())
        best = answer.cheapest(angle)
        lines.append(f"{angle} degrees: {counts}; cheapest: {'none' if best is None else best.name.replace(',', '')}")
    requested = f"(requested: {_percent(answer.tolerance)} % of the length)"
    if answer.way is None:
        none = f"no way is within the tolerance at {answer.angle} degrees, by {answer.most} layers {requested}"
        return [*lines, none]
    way = answer.way.name.replace(",", "")
    return [*lines, f"{way}, {answer.count} layers: the cheapest to {answer.angle} degrees {requested}"]


def fur_content(answer: FurNeed) -> dict[str, Any]:
    """Return the answer as data."""
    return {
        "way": getattr(answer.way, "name", None),
        "layers": answer.count,
        "angle": answer.angle,
        "tolerance": answer.tolerance,
        "most": answer.most,
        "by_angle": [
            {"angle": angle, "layers": dict(layers), "cheapest": getattr(answer.cheapest(angle), "name", None)}
            for angle, layers in answer.layers.items()
        ],
    }


def headline(choice: Choice) -> str:
    """Return the answer in a line."""
    scene, one = choice.scene, choice.nearest
    requested, limits = f"{_percent(scene.tolerance)} %", "tolerance"
    if scene.budget.ms is not None:
        requested, limits = f"{requested} within {scene.budget.ms:g} ms", "tolerance and budget"
    if choice.chosen:
        return f"The cheapest option within {limits}: {one.option.label} (requested: {requested})"
    if choice.meets_tolerance:
        return f"No option meets {requested}: the cheapest within the tolerance is {one.option.label}"
    where = " in the budget" if choice.meets_budget and scene.budget.ms is not None else ""
    return f"No option meets {requested}: the most accurate{where} is {one.option.label}"


def content(choice: Choice, ratios: Ratios, layers: Sequence[OneLayer] = ()) -> dict[str, Any]:
    """Return a choice and all options as data, with the constants that a shader needs, and layers of every colour."""
    scene, option = choice.scene, choice.nearest.option
    filters = passes(option, middle(scene), ReferenceLight(scene.setting)) if is_filter(option) else ()
    made: dict[str, Any] = {
        "tolerance": scene.tolerance,
        "budget_ms": scene.budget.ms,
        "gpu": scene.budget.gpu,
        "ratios_of": ratios.device,
        "chosen": choice.chosen.option.label if choice.chosen else None,
        "nearest": _data(choice.nearest),
        "cheaper": _data(choice.cheaper) if choice.cheaper else None,
        "dearer": _data(choice.dearer) if choice.dearer else None,
        "options": [_data(one) for one in choice.predicted],
        "filters": [  # weights [-] and offsets [unit] of the taps, in the middle of the scene's ranges
            {"share": share.tolist(), "taps": kernel.taps(option.number, stretches).astype(float).tolist()}
            for share, kernel, stretches in filters
        ],
        "export": export_hint(choice),
    }
    verdicts = [{**vars(layer), "verdict": _verdict(layer, choice)} for layer in layers]
    if len(verdicts) == 1:
        made["one_layer"] = verdicts[0]
    elif verdicts:
        made["one_layer"] = [{"channel": name, **one} for name, one in zip(CHANNELS, verdicts, strict=True)]
    return made


def export_hint(choice: Choice) -> str:
    """Return how to get the shader source of what was chosen."""
    option = choice.nearest.option
    if option.law is not None:
        index = option.law.setting.n
        return f"profilefit export {option.name} --lang glsl" + (f" --n {index:g}" if index != 1.0 else "")
    if is_filter(option):
        return "the filter's constants: --json, `filters`; its source: profilefit/scenes/skin/separable.frag"
    return "nothing to export: radiance is A E / pi"


def _data(prediction: Predicted) -> dict[str, Any]:
    error, case = prediction.error, prediction.error.case
    return {
        "option": prediction.option.label,
        "ms": prediction.ms,
        "ms_range": [prediction.frame.least, prediction.frame.most],
        "error": error.total,
        "parts": {part: getattr(error, part) for part in PARTS},
        "worst": {
            "channel": CHANNELS[error.channel],
            "pixel": case.pixel,
            "radius": None if case.is_flat else case.radius,
        },
    }


def _serves(prediction: Predicted, choice: Choice) -> str:
    """Return which of the limits an option keeps."""
    precise, paid = prediction.error.total <= choice.scene.tolerance, affordable(prediction, choice.scene)
    if precise and paid:
        budget = choice.scene.budget.ms
        return "yes" if budget is None or prediction.frame.most <= budget else "likely"
    return "no: " + " and ".join(what for what, good in (("error", precise), ("ms", paid)) if not good)


def _caption(choice: Choice, ratios: Ratios) -> str:
    scene = choice.scene
    budget, setting = scene.budget, scene.setting
    lines = []
    for name, one in {"worst": choice.nearest, "the best cheaper": choice.cheaper}.items():
        if one is not None:
            case, parts = one.error.case, {part: getattr(one.error, part) for part in PARTS}
            shape = "flat" if case.is_flat else f"radius {significant(case.radius)} {scene.unit}"
            at = f"{CHANNELS[one.error.channel]}, pixel {significant(case.pixel)} {scene.unit}, {shape}"
            lines.append(f"{name}: {at}; mostly {CAUSES[max(parts, key=parts.__getitem__)]}.")
    lines += [
        f"error: root mean square of radiance within {scene.within.mfp:g} transport mean free paths (at least "
        f"{scene.within.pixels} pixels) of a step edge of light, worst channel and case, in one frame, as a "
        "share of white; then its parts, which add in squares.",
        f"ms: an estimate of a frame on a {budget.gpu} at {100 * budget.screen_share:.0f} % coverage: Table 2 of Liang "
        f"et al. times ratios measured on {ratios.device.partition(' (')[0]}; its range by what is not known of the GPU"
        + ("." if budget.ms is None else "; likely: the estimate is within the budget, the end of the range is not."),
        f"light: {setting.illumination}, n = {setting.n:g}.",
    ]
    return "\n".join([*lines, export_hint(choice)])


def _verdict(layer: OneLayer, choice: Choice) -> str:
    """Return whether it is within the tolerance, by itself and in what the choice leaves of it, in squares."""
    alone = layer.verdict(choice.scene.tolerance)
    left = max(choice.scene.tolerance**2 - choice.nearest.error.total**2, 0.0) if choice.meets_tolerance else 0.0
    return "enough alone" if alone == "enough" and layer.verdict(math.sqrt(left)) != "enough" else alone


def _layer(layers: Sequence[OneLayer], choice: Choice) -> str:
    """Return what one layer in place of the stack costs, of several colours in the worst."""
    verdicts = [_verdict(layer, choice) for layer in layers]
    worst = max(range(len(layers)), key=lambda one: (list(LAYERS).index(verdicts[one]), layers[one].error))
    layer, verdict = layers[worst], verdicts[worst]
    colour = "of one colour" if len(layers) == 1 else f"of three colours, {CHANNELS[worst]} the worst"
    unit = choice.scene.unit
    noise = f" ± {_percent(layer.standard_error)}" if layer.photons else ""
    light = {"searchlight": "a pencil beam", "diffuse": "diffuse illumination"}[choice.scene.setting.illumination]
    together = math.hypot(layer.error, choice.nearest.error.total)
    text = (
        f"Layers, {colour}: {LAYERS[verdict]}. The nearest single one (A {significant(layer.reflectance, 3)}, "
        f"transport mean free path {significant(layer.mfp, 3)} {unit}, n = {layer.n:g}, under {light}) has "
        f"an error of {_percent(layer.error)}{noise} %; with the choice {_percent(together)} %."
    )
    single = max(one.single for one in layers)
    needs = "needs a pass of its own" if single > choice.scene.tolerance else "needs no pass of its own"
    text += f" Single scattering {needs}: if it leaves in all directions alike, the mean error is {_percent(single)} %."
    index = choice.scene.setting.n
    if not math.isclose(layer.n, index, rel_tol=0.01):
        text += f" The choice is for n = {index:g}, as the file says, and these layers are not."
    return text


def _percent(share: float, places: int | None = None) -> str:
    """Return a percentage without the sign, to so many decimals or two digits."""
    return significant(100.0 * share) if places is None else f"{100.0 * share:.{places}f}"
