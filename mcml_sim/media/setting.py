"""Illumination and surface: a half-space profile means nothing without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax

from mcml_sim.media import phase as phases
from mcml_sim.media.arrays import is_number, require, require_index

ILLUMINATIONS = ("searchlight", "diffuse")
FORWARD_N, FORWARD_G = (1.33, 1.45), 0.95
"""Indices between which, and g up to which, half spaces that scatter forwards are solved."""


@dataclass(frozen=True)
class Setting:
    """Illumination and surface that a half-space profile belongs to.

    illumination  "searchlight", a pencil beam (normal, collimated; MCML's), or "diffuse", cosine-weighted light
    n             refractive index of the half space over that outside [-], > 0; a jax array () where an exact solution
                  is to be differentiated by it, and nowhere else
    g             mean cosine of the scattering angle [-], -1 < g < 1
    phase         a phase function of `mcml_sim.phase` in place of g, which is its mean cosine then; None for Henyey and
                  Greenstein's of g

    Profiles, laws and records of different settings never mix.
    """

    illumination: str = "searchlight"
    n: float = 1.0
    g: float = 0.0
    phase: phases.Phase | None = None

    def __post_init__(self) -> None:
        if self.phase is not None:
            phases.settle(self)
        require_illumination(self.illumination)
        if not is_traced(self.n):
            require_index("n", self.n)
        require(is_number(self.g) and -1 < self.g < 1, "g", "a mean cosine in (-1, 1)", self.g)

    @property
    def is_matched_isotropic(self) -> bool:
        """Whether the surface does not refract and scattering has no preferred direction."""
        return self.n == 1.0 and self.is_isotropic

    @property
    def is_isotropic(self) -> bool:
        """Whether scattering has no preferred direction."""
        return self.g == 0.0 and self.phase is None

    @property
    def scattering(self) -> phases.Phase:
        """Phase function."""
        return phases.HenyeyGreenstein(self.g) if self.phase is None else self.phase

    @property
    def is_solved(self) -> bool:
        """Whether `mcml_sim.exact` has the half space."""
        if self.is_isotropic:
            return is_traced(self.n) or self.n >= 1.0
        in_table = not is_traced(self.n) and FORWARD_N[0] <= self.n <= FORWARD_N[1] and 0.0 < self.g <= FORWARD_G
        return in_table and self.phase is None

    def as_table(self) -> dict[str, Any]:
        """Return the setting for files; `phase` only where it is not Henyey and Greenstein's."""
        table = {"illumination": self.illumination, "n": self.n, "g": self.g}
        return table if self.phase is None else {**table, "phase": phases.as_table(self.phase)}

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> Setting:
        """Return the setting of a table from `as_table`; InputError or TypeError on anything else."""
        if "phase" not in content:
            return cls(**content)
        return cls(**{**content, "phase": phases.from_table(content["phase"])})

    def __str__(self) -> str:
        n = str(self.n) if is_traced(self.n) else f"{self.n:g}"
        of_phase = "" if self.phase is None else f", phase = {self.phase}"
        return f"{self.illumination}, n = {n}, g = {self.g:g}{of_phase}"


def require_illumination(name: object) -> None:
    """Raise InputError unless that is one of ILLUMINATIONS."""
    require(name in ILLUMINATIONS, "illumination", f"one of {', '.join(ILLUMINATIONS)}", name)


def is_traced(n: object) -> bool:
    """Return whether jax may differentiate by an index."""
    return isinstance(n, jax.Array) and n.shape == ()


SEARCHLIGHT = Setting()
