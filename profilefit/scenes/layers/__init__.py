"""Layered objects after Zhao et al., each part of the light in closed form beside its truth; imported on first use."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from profilefit.scenes.layers.law import single_scattering, stack_law
else:
    __getattr__, __dir__ = attributes(__name__, dict.fromkeys(("single_scattering", "stack_law"), "law"))

__all__ = ["single_scattering", "stack_law"]
