"""Records and measurements as tables for a terminal or a README, and as figures."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.report.figures.fit_figures import posterior_figure, residual_figure
    from profilefit.report.figures.record_figures import draw_all
    from profilefit.report.records import unscaled
    from profilefit.report.tables.fit_tables import fit_lines, fit_tables
    from profilefit.report.tables.law_tables import every_law, markdown_sections
    from profilefit.report.tables.markdown import fill, markdown_constants, markdown_quality, sections
    from profilefit.report.tables.record_tables import record_tables, summary
else:
    __getattr__ = attributes(
        __name__,
        {
            **dict.fromkeys(("posterior_figure", "residual_figure"), "figures.fit_figures"),
            "draw_all": "figures.record_figures",
            "unscaled": "records",
            **dict.fromkeys(("fit_lines", "fit_tables"), "tables.fit_tables"),
            **dict.fromkeys(("every_law", "markdown_sections"), "tables.law_tables"),
            **dict.fromkeys(("fill", "markdown_constants", "markdown_quality", "sections"), "tables.markdown"),
            **dict.fromkeys(("record_tables", "summary"), "tables.record_tables"),
        },
    )

__all__ = [
    "draw_all",
    "every_law",
    "fill",
    "fit_lines",
    "fit_tables",
    "markdown_constants",
    "markdown_quality",
    "markdown_sections",
    "posterior_figure",
    "record_tables",
    "residual_figure",
    "sections",
    "summary",
    "unscaled",
]
