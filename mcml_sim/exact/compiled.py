"""`jit` and `filter_jit`, as jax and equinox have them, with XLA's options for all but the tracing of photons."""

from functools import partial
from typing import Any

import equinox as eqx
import jax

# Its newer emitters of loops work out anew what several results share: a law's Jacobian takes five times as long, and
# compiles half as long again (jaxlib 0.10; 0.11 may not know the option).
OPTIONS = {"xla_cpu_use_fusion_emitters": False} if jax.__version_info__ < (0, 11) else {}
jit: Any = partial(jax.jit, compiler_options=OPTIONS)
filter_jit: Any = partial(eqx.filter_jit, compiler_options=OPTIONS)
