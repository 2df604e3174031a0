"""Why cells are red, and what helps: a cause is tested on the cell itself; a cell that none fits is unexplained."""

from __future__ import annotations

from profilefit.stability.cause import UNEXPLAINED, Cause
from profilefit.stability.causes_of_format import FORMAT
from profilefit.stability.causes_of_liang import LIANG
from profilefit.stability.causes_of_models import MODELS

__all__ = ["CAUSES", "UNEXPLAINED", "Cause"]

# The first that holds is told: what is special before what is general.
CAUSES: tuple[Cause, ...] = (*LIANG, *MODELS, *FORMAT)
