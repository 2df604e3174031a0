"""Units of a medium: mean free paths, falloff lengths, coefficients, and what each renderer takes.

The hub is `Optical(alpha, mfp, g)`, a medium without its surface: alpha and mfp are the reduced ones. A colour is a
function of alpha, n and g alone, and every length is mfp times a function of alpha and g, so each converts to and from
the hub. A colour under a surface that refracts has the alpha that `alpha_of` finds at that n.
"""

from profilefit.convert.colour import alpha_of, reflectance_of
from profilefit.convert.engine import ENGINES, Engine
from profilefit.convert.lengths import QUANTITIES, Length
from profilefit.convert.optical import BY_NAME, LENGTHS, Optical

__all__ = ["BY_NAME", "ENGINES", "LENGTHS", "QUANTITIES", "Engine", "Length", "Optical", "alpha_of", "reflectance_of"]
