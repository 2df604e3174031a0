"""Records and measurements as tables for a terminal or a README, and as figures."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.report.figures.fit_figures import posterior_figure, residual_figure
    from profilefit.report.figures.record_figures import draw_all
    from profilefit.report.records import unscaled
    from profilefit.report.tables.fit_tables import fit_lines, fit_tables
    from profilefit.report.tables.law_tables import every_law
    from profilefit.report.tables.markdown import fill, sections
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            **dict.fromkeys(("posterior_figure", "residual_figure"), "figures.fit_figures"),
            "draw_all": "figures.record_figures",
            "unscaled": "records",
            **dict.fromkeys(("fit_lines", "fit_tables"), "tables.fit_tables"),
            "every_law": "tables.law_tables",
            **dict.fromkeys(("fill", "sections"), "tables.markdown"),
        },
    )

__all__ = [
    "draw_all",
    "every_law",
    "fill",
    "fit_lines",
    "fit_tables",
    "posterior_figure",
    "residual_figure",
    "sections",
    "unscaled",
]
