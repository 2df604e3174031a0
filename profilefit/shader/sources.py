"""Source of whatever has one, by its name: a record or law of any kind, or what a scene exports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from profilefit.recipes.folder import known_folder
from profilefit.recipes.inventory import not_found
from profilefit.recipes.kinds import KINDS, require_none
from profilefit.shader import law_file, phase_text, stack_text

# By the key of a kind: what writes the file of what its `find` returned (found, folder of records, language, name).
SOURCES: Mapping[str, Callable[[Any, Path, str, str | None], str]] = {
    "law": law_file.export,
    "albedo_map": law_file.export,
    "stack": lambda found, _, *words: stack_text.export_stack(found, *words),
    "phase": lambda found, _, *words: phase_text.export_phase(found, *words),
}


def export(
    subject: str,
    lang: str = "glsl",
    name: str | None = None,
    fits: Path | None = None,
    scenes: Mapping[str, tuple[str, str]] | None = None,
    **options: Any,
) -> str:
    """Return the whole file of a subject in a language.

    Args:
        subject: name of a record, law or map, path of a record, or what scenes export.
        lang: one of `law_file.LANGUAGES`.
        name: what the names in it begin with, by default its own; two media in one shader need two.
        fits: folder of records; None stands for ./fits and those shipped.
        scenes: what scenes export, as `profilefit.scenes.SOURCES`.
        options: constants, n and g of a law, as for `inventory.find`.

    Raises:
        InputError: a subject, language, name or option that there is not; RecordError on a damaged record.
    """
    for kind in KINDS:
        source = SOURCES.get(kind.key) or getattr(kind.module, "source", None)
        if source is not None and (found := kind.find(subject, fits, **options)) is not None:
            text: str = source(found, known_folder(fits), lang, name)
            return text
    for ending, (words, module) in (scenes or {}).items():
        if subject == ending or (ending.startswith(".") and subject.endswith(ending)):
            require_none(options, words, subject)
            text = import_module(module).source(subject, lang, name)
            return text
    raise not_found(subject, known_folder(fits), options.get("constants"))
