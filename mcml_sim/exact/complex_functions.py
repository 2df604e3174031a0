"""Functions of finite complex numbers, over jax.numpy.

jax.numpy has them all, for every infinity and signed zero, which takes XLA seconds to compile and several times as long
to run; and its sinh of small complex numbers has no digit right.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp


@jax.custom_jvp
def square_root(z: jax.Array) -> jax.Array:
    """Principal root of z != 0."""
    larger = jnp.sqrt(0.5 * (jnp.sqrt(z.real**2 + z.imag**2) + jnp.abs(z.real)))
    smaller = 0.5 * z.imag / larger
    right = z.real >= 0.0
    real, imag = jnp.where(right, larger, jnp.abs(smaller)), jnp.where(right, smaller, jnp.copysign(larger, z.imag))
    return jax.lax.complex(real, imag)


@square_root.defjvp
def _square_root_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    root = square_root(primals[0])
    return root, 0.5 * tangents[0] / root


@jax.custom_jvp
def logarithm(z: jax.Array) -> jax.Array:
    """Principal logarithm."""
    return jax.lax.complex(0.5 * jnp.log(z.real**2 + z.imag**2), jnp.arctan2(z.imag, z.real))


@logarithm.defjvp
def _logarithm_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    return logarithm(primals[0]), tangents[0] / primals[0]


def arctangent(z: jax.Array) -> jax.Array:
    """Principal arctan, of z with Re z >= 0 and not near i or beyond it."""
    real, imag = z.real, z.imag
    angle = 0.5 * jnp.arctan2(2.0 * real, 1.0 - real**2 - imag**2)
    return jax.lax.complex(angle, 0.25 * jnp.log1p(4.0 * imag / (real**2 + (1.0 - imag) ** 2)))


def inverse_sinh(z: jax.Array, root: jax.Array) -> jax.Array:
    """asinh, of z with Re z >= 0 and not near i, and sqrt(1 + z^2); right to all digits where z is small, too."""
    less_one = z + z * z / (1.0 + root)  # e^asinh(z) - 1
    real, imag = less_one.real, less_one.imag
    return jax.lax.complex(0.5 * jnp.log1p(2.0 * real + real**2 + imag**2), jnp.arctan2(imag, 1.0 + real))


def sinh_and_cosh(z: jax.Array) -> tuple[jax.Array, jax.Array]:
    """sinh and cosh, right to all digits where z is small, too."""
    less_one = jnp.expm1(z.real)
    inverse = 1.0 / (1.0 + less_one)
    # Held, or XLA works them out and compiles them anew wherever they are used.
    sinh, cosh, sin, cos = jax.lax.optimization_barrier(
        (0.5 * less_one * (1.0 + inverse), 1.0 + 0.5 * less_one**2 * inverse, jnp.sin(z.imag), jnp.cos(z.imag))
    )
    return jax.lax.complex(sinh * cos, cosh * sin), jax.lax.complex(cosh * cos, sinh * sin)
