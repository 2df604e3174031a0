"""In which numbers a law is computed: its text, line by line in numpy, from half to extended precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.shader import emit

NAME = "law"
# 64 bits of mantissa and 15 of exponent on x86: float64's own rounding and overflow are seen from outside. Where it is
# no more than float64, what float64 does wrong to its last digits goes unseen.
EXTENDED = np.longdouble
NUMPY_HEAD = "import numpy as np\n"


class Rounded:
    """numpy whose every result is of one type; numbers in the code take that of the arrays they meet."""

    def __init__(self, dtype: type) -> None:
        self._dtype = dtype

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function, dtype = getattr(np, name), self._dtype

        def call(*arguments: Any) -> Any:
            arrays = [np.asarray(one) for one in arguments]
            return function(*(one if one.dtype == bool else one.astype(dtype) for one in arrays))

        return call


class Text:
    """The functions of a law's or map's shader text, computed in one type throughout."""

    def __init__(self, law: AlbedoLaw | ProfileLaw, dtype: type) -> None:
        self.dtype = dtype
        text = emit.map_text if isinstance(law, AlbedoLaw) else emit.law_text
        source = text(law, "python", NAME).replace(NUMPY_HEAD, "", 1)  # type: ignore[arg-type]
        self._names: dict[str, Any] = {"np": Rounded(dtype)}
        exec(compile(source, f"{type(law).__name__}.py", "exec"), self._names)

    def call(self, function: str, *arguments: Any) -> Any:
        """A function of the text, by its name less the prefix, of arrays that are rounded to the type first."""
        given = [one.astype(self.dtype) if isinstance(one, np.ndarray) else one for one in arguments]
        with np.errstate(all="ignore"):  # what is no number is what is looked for
            return self._names[f"{NAME}_{function}"](*given)

    def replace(self, function: str, other: Callable[..., Any]) -> None:
        """Have the text call another function by that name, less the prefix."""
        self._names[f"{NAME}_{function}"] = other
