"""Least that a scene needs to scatter light: options, their predicted errors, their costs."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.studies.choose.choice import choose
    from profilefit.studies.choose.cost import shipped
    from profilefit.studies.choose.requirements import read
else:
    __getattr__, __dir__ = attributes(__name__, {"choose": "choice", "shipped": "cost", "read": "requirements"})

__all__ = ["choose", "read", "shipped"]
