"""How the pages are built: sphinx-build -W --keep-going -b html docs docs/_build/html. Nothing is fetched."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "ext"))

project = "profilefit"
author = "the profilefit authors"
release = version = version_of("profilefit")
copyright = f"{author}, MIT licence"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
extensions += ["mathml", "docstrings", "law_pages", "file_keys", "commands", "row_anchors"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build", "examples", "ext"]
root_doc = "index"
smartquotes = False  # which draw -- and ' of mu_s' as other letters
highlight_language = "none"  # commands and tables; what is code says which

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

# Formulas are MathML, which browsers draw themselves: no script and no font from elsewhere.
html_math_renderer = "mathml"
html_theme = "furo"
html_title = "profilefit"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sourcelink = False
math_numfig = False

default_role = "code"
autosummary_generate = False  # tables only
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 110
autodoc_type_aliases = {"Floats": "numpy.ndarray", "Numbers": "ArrayLike", "ArrayLike": "ArrayLike"}
add_module_names = False

# Every name of this project that a page refers to must have its place in the pages; those of others are not looked up.
nitpicky = True
nitpick_ignore_regex = [("py:.*", r"(?!(mcml_sim|profilefit)\.).*")]
# Sums and targets inside a run and a fit, which no page explains.
nitpick_ignore = [
    ("py:class", name)
    for name in (
        "mcml_sim.tracing.deposits.Deposits",
        "mcml_sim.tracing.order_bins.Counts",
        "profilefit.fitting.estimate.Rings",
    )
]
