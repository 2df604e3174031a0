"""Under the sea after Li et al.: beams, caustics and shafts of light in scattering water; imported on first use."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest
if TYPE_CHECKING:
    from profilefit.laws.phases import haltrin
    from profilefit.scenes.sea.law import beam_share, segment_integral
    from profilefit.scenes.sea.truth import caustic_irradiance
    from profilefit.scenes.sea.waves import first_hit
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            "first_hit": "waves",
            **dict.fromkeys(("beam_share", "haltrin", "segment_integral"), "law"),
            "caustic_irradiance": "truth",
        },
    )

__all__ = ["beam_share", "caustic_irradiance", "first_hit", "haltrin", "segment_integral"]
