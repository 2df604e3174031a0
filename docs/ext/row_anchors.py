"""Rows of tables as targets of links: `<a id="hazard-error"></a>` in a page, `claims.md#hazard-error` in another."""

import re

from docutils import nodes
from sphinx.application import Sphinx

ANCHOR = re.compile(r'<a id="([\w-]+)">')


def add_anchors(app: Sphinx, doctree: nodes.document) -> None:
    """Add the anchors of a page to the headings that a link may name."""
    found = ANCHOR.findall(" ".join(node.astext() for node in doctree.findall(nodes.raw)))
    slugs = app.env.metadata[app.env.docname].setdefault("myst_slugs", {})
    slugs.update({name: (None, name, name) for name in found})


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("doctree-read", add_anchors)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
