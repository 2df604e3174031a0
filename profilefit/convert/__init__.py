"""Units of a medium: mean free paths, falloff lengths, coefficients, and what each renderer takes.

The hub is `Optical(alpha, mfp, g)`, a medium without its surface: alpha and mfp are the reduced ones. A colour is a
function of alpha, n and g alone, and every length is mfp times a function of alpha and g, so each converts to and from
the hub. A colour under a surface that refracts has the alpha that `alpha_of` finds at that n.
"""

from profilefit.convert import blender, offline, real_time
from profilefit.convert.colour import alpha_of, reflectance_of
from profilefit.convert.engine import Engine
from profilefit.convert.lengths import QUANTITIES, Length
from profilefit.convert.optical import BY_NAME, LENGTHS, Optical

ENGINES = (*blender.ROWS, *real_time.ROWS, *offline.ROWS)

__all__ = ["BY_NAME", "ENGINES", "LENGTHS", "QUANTITIES", "Engine", "Length", "Optical", "alpha_of", "reflectance_of"]
