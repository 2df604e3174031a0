"""docs/laws/keys.md: the keys, columns and facts of every file that users write, from the models that check them."""

from pathlib import Path

from sphinx.application import Sphinx

from profilefit.report.tables.keys_table import page


def write_page(app: Sphinx) -> None:
    """Write the page where it is not the same."""
    path, text = Path(app.srcdir) / "laws" / "keys.md", page()
    path.parent.mkdir(exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("builder-inited", write_page, priority=600)  # behind the laws', which delete others' pages
    return {"parallel_read_safe": True, "parallel_write_safe": True}
