"""Studies of laws and scenes: the cheapest option within tolerance and budget, failures, speed against accuracy."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.studies.choose.case import Within
    from profilefit.studies.choose.layers import one_layer
else:
    __getattr__, __dir__ = attributes(__name__, {"Within": "choose.case", "one_layer": "choose.layers"})

__all__ = ["Within", "one_layer"]
