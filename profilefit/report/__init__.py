"""Records as tables for a terminal or a README, and as figures."""

from profilefit.report.figures import draw_all
from profilefit.report.markdown import fill, markdown_constants, markdown_quality, sections
from profilefit.report.tables import record_tables, summary

__all__ = [
    "draw_all",
    "fill",
    "markdown_constants",
    "markdown_quality",
    "record_tables",
    "sections",
    "summary",
]
