"""Shader source of a phase function, and the file that holds it with its errors."""

from __future__ import annotations

from collections.abc import Mapping

from mcml_sim.media.phase import HenyeyGreenstein, Isotropic, Mixture, Phase, as_table
from profilefit.errors import InputError
from profilefit.laws.phases import FORMS, MOST_TERMS
from profilefit.recipes.kinds.phase import DEFAULT, PhaseRecord
from profilefit.shader import emit
from profilefit.shader.law_file import TRANSLATED, error_remark, json_file, require_language, text_file

NAMES = (
    ("pdf(off)", "density of the direction [1/sr], off = 1 - cos of the turn: 0 straight on, 2 straight back"),
    ("sample(xi)", "off for a uniform number xi in [0, 1)"),
)


def phase_text(phase: Phase, lang: str = "glsl", name: str = "phase", remarks: Mapping[str, str] | None = None) -> str:
    """Return a sum of one to four terms of Henyey and Greenstein, ready to include: NAME_pdf(off), NAME_sample(xi).

    lang, name, remarks  as for `emit.law_text`;  InputError on any other phase function: fit terms to it
    """
    constants: dict[str, float] = {}
    weights, terms = _terms(phase)
    for number, (weight, g) in enumerate(zip(weights, terms, strict=True), start=1):
        constants |= {f"w{number}": weight, f"g{number}": g}
    texts = [emit.read_text(part) for part in ("common", "phase")]
    return emit.filled(texts, name, constants, len(terms), lang, remarks or {})


def source(record: PhaseRecord, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of a record's best sum of terms, its moments held, in one of `law_file.LANGUAGES`.

    name  what the names in it begin with, by default the record's own with underscores; InputError where that is none
    """
    require_language(lang, name)
    form, how = DEFAULT
    constants, content = record.constants(form, how), record.content
    if lang == "json":
        kept = {key: content[key] for key in ("title", "equations", "note", "data", "data_digest", "constants")}
        return json_file({**kept, "phase": as_table(record.phase(form, how))})
    start = name or record.path.stem.replace("-", "_")
    remarks = {key: error_remark(errors) for key, errors in constants.items()}
    text = phase_text(record.phase(form, how), TRANSLATED.get(lang, lang), start, remarks)
    own, data = content["phases"][form][how], content["data"]
    head = [f"phase function {record.path.stem}: {FORMS[form].title}"]
    head += [*(f"{start}_{called:<20}{words}" for called, words in NAMES), ""]
    head += [f"fitted to {data['source']}, {data['rows']} angles: root mean square of ln(p / table) {own['rms']:.3f}"]
    head += [f"mean cosine {own['mean_cosine']:.4f}, turned by more than 90 degrees {own['backscattered']:.5f}"]
    head += [content["note"], f"sha256 of the data {content['data_digest']}"]
    return text_file(head, lang, text)


def _terms(phase: Phase) -> tuple[list[float], list[float]]:
    """Return weights and g of all terms."""
    own = phase.simplest
    pairs = list(zip(own.weights, own.phases, strict=True)) if isinstance(own, Mixture) else [(1.0, own)]
    for _, one in pairs:
        if not isinstance(one, HenyeyGreenstein | Isotropic):
            raise InputError(f"phase must be terms of Henyey and Greenstein to become a shader, got {one!r}")
    if len(pairs) > MOST_TERMS:
        raise InputError(f"phase must have at most {MOST_TERMS} terms to become a shader, got {len(pairs)}")
    return [float(weight) for weight, _ in pairs], [float(one.mean_cosine) for _, one in pairs]
