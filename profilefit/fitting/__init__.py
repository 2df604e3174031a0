"""Data and a law: constants with their errors, and how good they are. `profilefit` has the functions."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.fitting.estimate import Structure
    from profilefit.fitting.profiles import Covariance
    from profilefit.fitting.quality import AlbedoQuality, Quality
    from profilefit.fitting.solver import Solution, least_squares
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            "Structure": "estimate",
            "Covariance": "profiles",
            **dict.fromkeys(("AlbedoQuality", "Quality"), "quality"),
            **dict.fromkeys(("Solution", "least_squares"), "solver"),
        },
    )

__all__ = ["AlbedoQuality", "Covariance", "Quality", "Solution", "Structure", "least_squares"]
