"""Phase functions: how far scattering turns the light."""

from mcml_sim.media.phase.fournier_forand import FournierForand
from mcml_sim.media.phase.kinds import as_table, from_table, settle
from mcml_sim.media.phase.mixture import Mixture
from mcml_sim.media.phase.phase import HenyeyGreenstein, Isotropic, Phase
from mcml_sim.media.phase.tabulated import Tabulated

__all__ = [
    "FournierForand",
    "HenyeyGreenstein",
    "Isotropic",
    "Mixture",
    "Phase",
    "Tabulated",
    "as_table",
    "from_table",
    "settle",
]
