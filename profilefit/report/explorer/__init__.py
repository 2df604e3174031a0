"""Laws to play with inside the report: their own GLSL ES text in the reader's browser, against the exact half space."""

from profilefit.report.explorer.fragment import explorer_section

__all__ = ["explorer_section"]
