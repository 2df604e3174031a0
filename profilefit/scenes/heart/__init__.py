"""A heart after Yang et al.: light blurred in an atlas and on the screen, split by scale; imported on first use."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from profilefit.scenes.heart.law import balance, crossover_of, screen_share, split
    from profilefit.scenes.heart.truth import surface_blur
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {**dict.fromkeys(("balance", "crossover_of", "screen_share", "split"), "law"), "surface_blur": "truth"},
    )

__all__ = ["balance", "crossover_of", "screen_share", "split", "surface_blur"]
