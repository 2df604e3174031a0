"""What is right in a setting: the exact half space, or where it has no exact solution this project's own law for it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.recipes import catalogue
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record_folder import Records
from profilefit.scenes.skin.law import DARKEST, albedo_of
from profilefit.studies.choose.response import Beyond, beyond

STAND_IN = "hazard"


@dataclass(frozen=True)
class Truth:
    """The light of a setting.

    law    None where the half space has an exact solution;  albedo  its map, where there is a law
    floor  how far F of that law may be from photons [-]: half of its record's worst `ks`, since of the energy within a
           circle at most half crosses an edge; 0 where it is exact
    """

    setting: Setting
    law: ProfileLaw | None = None
    albedo: AlbedoLaw | None = None
    floor: float = 0.0

    def alpha(self, reflectance: float) -> float:
        """Single-scattering albedo [-] of a reflectance A [-]."""
        if self.albedo is None:
            return max(albedo_of(reflectance, self.setting), DARKEST)
        return max(float(self.albedo.alpha(reflectance)), DARKEST)

    def reflectance(self, alpha: float) -> float:
        """A [-] of a single-scattering albedo [-]."""
        law = self.albedo
        return float(exact.reflectance(alpha, self.setting) if law is None else law.reflectance(alpha))

    def beyond(self, reflectance: float) -> Beyond:
        """F(d) of a reflectance A [-]."""
        return beyond(self.alpha(reflectance), self.setting, self.law)


@lru_cache(maxsize=16)
def truth(setting: Setting) -> Truth:
    """Of a setting that has a record; InputError that lists them."""
    if setting.is_matched_isotropic:
        return Truth(setting)
    records = Records(fits_folder())
    known = [one for one in records.settings(STAND_IN) if one.illumination == setting.illumination]
    if setting not in known:
        accepted = ", ".join(f"{one.n:g}" for one in sorted(known, key=lambda one: one.n))
        raise InputError(f"index must be one of {accepted} under {setting.illumination} light, got {setting.n:g}")
    measured = records.read(records.path(STAND_IN, setting))["quality"]["regenerated"]["ks"]
    law = catalogue.load(STAND_IN, setting=setting, folder=records)
    return Truth(setting, law, catalogue.normalisation(setting, records), 0.5 * float(max(measured)))
