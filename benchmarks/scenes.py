"""Five scenes as README and pages show them: errors of the shipped examples beside rivals, and their pictures.

    python -m benchmarks.scenes [--only NAME ...] [--pictures] [--json FILE]   # ten minutes on two cores

With --pictures it writes pages of comparison into fits/evidence, and small pictures of README into docs/_static.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from benchmarks.table import Listed, Rows, parser_of, show_all
from mcml_sim.files.whole_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.report.scene_report import scene_figures
from profilefit.scenes import SCENES
from profilefit.shader import opened, renderer

ROOT = Path(__file__).parents[1]
PAGE, SMALL, COLOURS = 1440, 240, 256  # widths of pictures [pixels], and colours of a file


def drawn(name: str, has_pictures: bool = False) -> Rows:
    """Return technique, error and milliseconds of an example and its rivals; write its pictures if asked for."""
    home, file = SCENES[name]
    module, path = import_module(home), shipped("examples") / file
    with opened() as context:
        found, device = module.draw(context, module.read(str(path), read_toml(path))), renderer(context)
    if has_pictures:
        pictures: dict[str, Any] = scene_figures(found, device)
        _write(pictures["-comparison"], PAGE, ROOT / "fits" / "evidence" / f"render-{name}.png")
        _write(pictures[""], SMALL, ROOT / "docs" / "_static" / f"{name}.png")
    every = [found.point, *(rival.point for rival in found.rivals)]
    return [(point.label, point.samples, point.rmse, min(point.milliseconds)) for point in every]


def _write(picture: bytes, width: int, path: Path) -> None:
    whole = Image.open(BytesIO(picture)).convert("RGB")
    smaller = whole.resize((width, round(width * whole.height / whole.width)), Image.Resampling.LANCZOS)
    smaller.quantize(COLOURS, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


TABLES = {
    name: Listed(
        f"examples/{file}",
        {"technique": "", "samples": "d", "error": ".3f", "ms": ".0f"},
        partial(drawn, name),
    )
    for name, (_, file) in SCENES.items()
}


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__doc__, TABLES)
    parser.add_argument("--pictures", action="store_true", help="write the pictures, too")
    given = parser.parse_args(arguments)
    tables = {name: TABLES[name]._replace(rows=partial(drawn, name, given.pictures)) for name in given.only or TABLES}
    show_all(tables, given.json)


if __name__ == "__main__":
    main()
