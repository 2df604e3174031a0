"""Phase functions, a file each: how far scattering turns the light."""

from mcml_sim.media.phase.base import Phase
from mcml_sim.media.phase.henyey_greenstein import HenyeyGreenstein
from mcml_sim.media.phase.isotropic import Isotropic

__all__ = ["HenyeyGreenstein", "Isotropic", "Phase"]
