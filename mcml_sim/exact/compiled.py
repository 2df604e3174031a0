"""Functions `jit` and `filter_jit` of jax and equinox, with XLA's options for all but the tracing of photons."""

from collections.abc import Callable
from functools import wraps
from typing import Any

import equinox as eqx
import jax

# Its newer emitters of loops work out anew what several results share: a law's Jacobian takes five times as long, and
# compiles half as long again (jaxlib 0.10; 0.11 may not know the option).
OPTIONS: dict[str, Any] = {"xla_cpu_use_fusion_emitters": False} if jax.__version_info__ < (0, 11) else {}
# Options for large programs that run a few dozen times: compiling takes half as long.
BRIEF = OPTIONS | {"xla_backend_optimization_level": 0}
# Options for programs that run for seconds and whose digits decide nothing else: an eighth faster with AVX-512.
WIDE = OPTIONS | {"xla_cpu_prefer_vector_width": 512}


def jit(function: Callable, **named: Any) -> Callable:
    """Return `jax.jit` of a function with these options."""
    return _outermost(function, jax.jit(function, compiler_options=OPTIONS, **named), jax.jit(function, **named))


def filter_jit(function: Callable, options: dict[str, Any] = OPTIONS) -> Callable:
    """Return `equinox.filter_jit` of a function with these options."""
    compiled: Any = eqx.filter_jit
    return _outermost(function, compiled(function, compiler_options=options), compiled(function))


def _outermost(function: Callable, own: Callable, within: Callable) -> Callable:
    """Call `own` with its options, or `within` a program that is compiled or differentiated, whose options hold."""

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        if any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves((arguments, named))):
            return within(*arguments, **named)
        with jax.core.eval_context():
            return own(*arguments, **named)

    return call
