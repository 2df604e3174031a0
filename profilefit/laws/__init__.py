"""The laws and maps by name, each with its home: module and class. Nothing is imported before its first use."""

from importlib import import_module

TYPE_CHECKING = False  # a shell completes these names: importing typing would take longer than all the rest
if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

PROFILES = {
    "liang": "liang.Liang",
    "burley": "burley.Burley",
    "burley_diffuse_mfp": "burley.BurleyDiffuseMfp",
    "dipole": "diffusion.Dipole",
    "better_dipole": "diffusion.BetterDipole",
    "beam_diffusion": "diffusion.BeamDiffusion",
    "gaussians": "gaussians.Gaussians",
    "hazard": "hazard.Hazard",
    "quantile": "quantile.Quantile",
}
MAPS = {
    "liang": "printed_maps.LiangAlbedo",
    "rational": "rational.Rational",
    "van_de_hulst": "printed_maps.VanDeHulst",
    "chiang": "printed_maps.Chiang",
}
# Those that have other forms of the same name, where the surface refracts and where scattering has a direction.
REFRACTING = {
    "hazard.Hazard": "two_parts.RefractingHazard",
    "rational.Rational": "rational.RefractingRational",
}
FORWARD = {"hazard.Hazard": "two_parts.ForwardHazard", "rational.Rational": "rational.ForwardRational"}


def profile_classes() -> "dict[str, Any]":
    """Name -> class of every profile law: `gaussians:2` is a sum of two."""
    return _classes(PROFILES)


def map_classes() -> "dict[str, Any]":
    """Name -> class of every map between alpha and A."""
    return _classes(MAPS)


def find_class(table: "Mapping[str, str]", name: str) -> "Any":
    """Return the class of a name in one of the tables, without importing the others; None where there is none."""
    base = name.partition(":")[0]
    return _classes({base: table[base]}).get(name) if base in table else None


def home(place: str) -> "Any":
    """Return the class at a home: "module.Class" of this package, or the whole name of one in another package."""
    module, _, kind = place.rpartition(".")
    return getattr(import_module(module if "." in module else f"{__name__}.{module}"), kind)


def takes_g(name: str) -> bool:
    """Return whether the profile law of a name has a form for anisotropic scattering."""
    return PROFILES.get(name) in FORWARD


def at(kind: "Any", setting: "Any") -> "Any":
    """Return a law's class in a setting: this one, or the one for refracting interfaces, or for any g."""
    forms = REFRACTING if setting.is_isotropic else FORWARD
    place = forms.get(f"{kind.__module__.rpartition('.')[2]}.{kind.__name__}")
    return kind if setting.is_matched_isotropic or place is None else home(place)


def _classes(table: "Mapping[str, str]") -> "dict[str, Any]":
    return {
        f"{name}:{form}" if form else name: kind
        for name, place in table.items()
        for form, kind in home(place).forms().items()
    }
