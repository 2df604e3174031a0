"""Closed-form laws of subsurface scattering, fitted to simulated or exact light, with error bars."""

from profilefit.catalogue import albedo_law, load, names
from profilefit.errors import InputError, OutputError, RecipeError, RecordError, SettingError, StoreError
from profilefit.estimate import Fit, fit
from profilefit.posterior import Posterior, posterior
from profilefit.profiles import Profiles
from profilefit.quality import albedo_quality, profile_quality

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
]
