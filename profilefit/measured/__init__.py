"""One's own data: a measured or simulated profile, the medium that explains it, and what it does not identify."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.measured.data import Measured
    from profilefit.measured.problem import Known
    from profilefit.measured.reading import read
    from profilefit.measured.result import MediumPosterior, fit
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {"Measured": "data", "Known": "problem", "read": "reading", "MediumPosterior": "result", "fit": "result"},
    )

__all__ = ["Known", "Measured", "MediumPosterior", "fit", "read"]
