"""A law that stands for the truth, quick to have, and a scene."""

from dataclasses import dataclass

import pytest

import profilefit
from mcml_sim import Setting
from profilefit.laws.base import ProfileLaw
from profilefit.studies.choose.case import Case, Within
from profilefit.studies.choose.error import ReferenceLight, beyond
from profilefit.studies.choose.requirements import Budget, Requirements

DIFFUSE = Setting("diffuse")
COLOUR, MFP = (0.6, 0.4, 0.2), (1.0, 0.7, 0.5)


@dataclass(frozen=True)
class LawLight(ReferenceLight):
    """That of a law in place of the exact one."""

    law: ProfileLaw | None = None

    def alpha(self, reflectance):
        return float(self.law.albedo.alpha(reflectance))

    def beyond(self, reflectance):
        return beyond(self.alpha(reflectance), self.setting, self.law)


@pytest.fixture(scope="session")
def hazard():
    return profilefit.load("hazard", setting=DIFFUSE)


@pytest.fixture(scope="session")
def light(hazard):
    """Where the truth is the hazard law, so that it has no error of its own."""
    return LawLight(DIFFUSE, hazard)


@pytest.fixture(scope="session")
def case():
    return Case(COLOUR, MFP, pixel=0.25)


@pytest.fixture(scope="session")
def scene():
    reflectance, mfp = (tuple((value, value) for value in values) for values in (COLOUR, MFP))
    return Requirements("mm", DIFFUSE, reflectance, mfp, (0.25, 0.25), 5.0, 0.02, Within(), Budget(ms=5.0))
