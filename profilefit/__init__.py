"""Closed-form laws of subsurface scattering, fitted to simulated or exact light, with error bars."""

from mcml_sim.cli.lazy import attributes
from profilefit.errors import InputError, OutputError, RecipeError, RecordError, SettingError, StoreError

TYPE_CHECKING = False  # importing typing for it would take longer than all the rest, while Ctrl-C is a traceback
if TYPE_CHECKING:
    from profilefit import scenes
    from profilefit.fitting.chains import Posterior, posterior
    from profilefit.fitting.estimate import Fit, fit
    from profilefit.fitting.profiles import Profiles
    from profilefit.fitting.quality import albedo_quality, profile_quality
    from profilefit.recipes.catalogue import albedo_law, load, names
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            **dict.fromkeys(("albedo_law", "load", "names"), "recipes.catalogue"),
            **dict.fromkeys(("Posterior", "posterior"), "fitting.chains"),
            **dict.fromkeys(("Fit", "fit"), "fitting.estimate"),
            "Profiles": "fitting.profiles",
            **dict.fromkeys(("albedo_quality", "profile_quality"), "fitting.quality"),
            "scenes": "",
        },
    )

__all__ = [
    "Fit",
    "InputError",
    "OutputError",
    "Posterior",
    "Profiles",
    "RecipeError",
    "RecordError",
    "SettingError",
    "StoreError",
    "albedo_law",
    "albedo_quality",
    "fit",
    "load",
    "names",
    "posterior",
    "profile_quality",
    "scenes",
]
