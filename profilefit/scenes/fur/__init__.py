"""Fur in shells after Fang et al.: random cones in closed form, thresholds and layers; imported on first use."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from profilefit.scenes.fur.law import best_exponent, shell_shadow, visibility
else:
    __getattr__, __dir__ = attributes(__name__, dict.fromkeys(("best_exponent", "shell_shadow", "visibility"), "law"))

__all__ = ["best_exponent", "shell_shadow", "visibility"]
