"""Records as tables for a terminal or a README, and as figures."""

from profilefit.report.figures import draw_all
from profilefit.report.law_tables import every_law, markdown_sections
from profilefit.report.markdown import fill, markdown_constants, markdown_quality, sections
from profilefit.report.tables import record_tables, summary

__all__ = [
    "draw_all",
    "every_law",
    "fill",
    "markdown_constants",
    "markdown_quality",
    "markdown_sections",
    "record_tables",
    "sections",
    "summary",
]
