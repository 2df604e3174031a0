"""Records as tables for a terminal or a README, and as figures."""

from profilefit.report.figures.record_figures import draw_all
from profilefit.report.tables.law_tables import every_law, markdown_sections
from profilefit.report.tables.markdown import fill, markdown_constants, markdown_quality, sections
from profilefit.report.tables.record_tables import record_tables, summary

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
