"""docs/laws: a page a law, written from the records each time the pages are built; files that are the same stay."""

from pathlib import Path

from sphinx.application import Sphinx

from profilefit.recipes.folder import fits_folder
from profilefit.report.figures.canvas import FORMATS
from profilefit.report.figures.quality_figure import quality_figure
from profilefit.report.records import Source
from profilefit.report.tables.law_page import INDEX, Page, index_text, law_pages, page_text

FIGURES = "figures"


def write_pages(app: Sphinx) -> None:
    """All pages, and for each law with records a figure of its errors; what is left of other laws goes."""
    records, out = fits_folder(), Path(app.srcdir) / "laws"
    out.mkdir(exist_ok=True)
    pages = law_pages(records)
    texts = {page.name: page_text(page, records, drawn(page, records, out)) for page in pages}
    texts[INDEX] = index_text(pages, records)
    for stale in {path.stem for path in out.glob("*.md")} - set(texts):
        (out / f"{stale}.md").unlink()
    for name, text in texts.items():
        path = out / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def drawn(page: Page, records: Path, out: Path) -> str | None:
    """The figure of a page's errors by albedo, as seen from the page; none where no record measured profiles."""
    source = Source(records, page.records)
    if not any("rel" in source.content(name)["quality"]["regenerated"] for name in page.records):
        return None
    token = FORMATS.set(("svg",))
    try:
        quality_figure(source, out / FIGURES, name=f"quality-{page.name}")
    finally:
        FORMATS.reset(token)
    return f"{FIGURES}/quality-{page.name}.svg"


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
