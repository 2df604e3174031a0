"""`simulate` against numbers that others have published: shares of the incident light [-]."""

import numpy as np
import pytest

from mcml_sim import Grid, Layer, Medium, exact, half_space, simulate
from tests.physics.exact.test_exact import ALPHAS, PRINTED
from tests.physics.tracing.adding_doubling import solve

# van de Hulst, Multiple Light Scattering (Academic Press, 1980), table 35: a slab of optical thickness 2, albedo .9,
# Henyey-Greenstein g = .75, matched indices; in cm as MCML's manual has it (Wang & Jacques 1992, table 5.1).
VAN_DE_HULST_SLAB = Medium((Layer(n=1.0, mu_a=10.0, mu_s=90.0, g=0.75, thickness=0.02),))
VAN_DE_HULST_REFLECTANCE, VAN_DE_HULST_TRANSMITTANCE = 0.09739, 0.66096
"""Total; the transmittance includes the unscattered e^-2. Half a unit of the last digit is 5e-6."""
# The same by adding-doubling (Prahl, van Gemert & Welch, Appl. Opt. 32, 1993), with a digit more.
ADDING_DOUBLING_REFLECTANCE, ADDING_DOUBLING_TRANSMITTANCE = 0.097395, 0.660958

# The sample of MCML's manual (Wang & Jacques 1992, sec. 5): three layers under and above air, lengths in cm.
THREE_LAYERS = Medium(
    (
        Layer(n=1.37, mu_a=1.0, mu_s=100.0, g=0.9, thickness=0.1),
        Layer(n=1.37, mu_a=1.0, mu_s=10.0, g=0.0, thickness=0.1),
        Layer(n=1.37, mu_a=2.0, mu_s=10.0, g=0.7, thickness=0.2),
    )
)
# An MCML with a good generator, 2e7 photons, which leave a standard error of 4e-5 on each. The generator shipped with
# MCML (`ran3`) is biased: it gives a transmittance of .096355.
THREE_LAYERS_SPECULAR = 0.0243729
THREE_LAYERS_REFLECTANCE, THREE_LAYERS_ABSORBED, THREE_LAYERS_TRANSMITTANCE = 0.237826, 0.641779, 0.0960224
THREE_LAYERS_ABSORBED_BY_LAYER = (0.2619, 0.1488, 0.2311)
THREE_LAYERS_ERROR = 4e-5

GRID = Grid(0.05, 20)
FEW, MANY = 2**19, 10**7
HALF_SPACES = dict(zip(ALPHAS, PRINTED["searchlight"], strict=True))  # which `test_exact` holds the exact solution to
sizes = pytest.mark.parametrize("photons", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])


def is_met(estimate, published_value, published_error=0.0, rounding=0.0):
    """Within 4 standard errors of both (a chance of 6e-5 each), and what rounding to the last digit may hide."""
    error = np.hypot(estimate.standard_error, published_error)
    return np.all(np.abs(estimate.value - published_value) < 4 * error + rounding)


@sizes
def test_slab_of_van_de_hulst(photons):
    tally = simulate(VAN_DE_HULST_SLAB, GRID, photons, seed=30)
    assert is_met(tally.diffuse_reflectance, VAN_DE_HULST_REFLECTANCE, rounding=5e-6)
    assert is_met(tally.transmittance, VAN_DE_HULST_TRANSMITTANCE, rounding=5e-6)
    assert is_met(tally.diffuse_reflectance, ADDING_DOUBLING_REFLECTANCE)
    assert is_met(tally.transmittance, ADDING_DOUBLING_TRANSMITTANCE)
    assert tally.diffuse_reflectance.standard_error < 0.5 / np.sqrt(photons)
    # The convention: transmittance includes the unscattered light.
    assert not is_met(tally.diffuse_transmittance, VAN_DE_HULST_TRANSMITTANCE)


@pytest.mark.slow
@sizes
def test_three_layers_of_mcml(photons):
    tally = simulate(THREE_LAYERS, GRID, photons, seed=31)
    error = THREE_LAYERS_ERROR
    assert tally.specular_reflectance.value == pytest.approx(THREE_LAYERS_SPECULAR, abs=5e-8)
    assert is_met(tally.diffuse_reflectance, THREE_LAYERS_REFLECTANCE, error)
    assert is_met(tally.absorbed, THREE_LAYERS_ABSORBED, error)
    assert is_met(tally.transmittance, THREE_LAYERS_TRANSMITTANCE, error)
    assert is_met(tally.absorbed_per_layer, THREE_LAYERS_ABSORBED_BY_LAYER, error, rounding=5e-5)
    # By adding and doubling they are known to 1e-7, so only the run's own error counts.
    answer = solve(THREE_LAYERS, angles=10)
    transmittance = answer.transmitted.sum() + answer.ballistic
    assert is_met(tally.diffuse_reflectance, answer.reflected.sum())
    assert is_met(tally.transmittance, transmittance)
    assert is_met(tally.absorbed, 1 - answer.specular - answer.reflected.sum() - transmittance)
    # The biased generator of MCML would be seen.
    biased = abs(tally.transmittance.value - 0.096355)
    if photons == MANY:
        assert biased > 3.5 * tally.transmittance.standard_error


def test_adding_doubling_confirms_what_was_published_by_photons():
    answer = solve(THREE_LAYERS, angles=10)
    error = 4 * THREE_LAYERS_ERROR
    assert answer.reflected.sum() == pytest.approx(THREE_LAYERS_REFLECTANCE, abs=error)
    assert answer.transmitted.sum() + answer.ballistic == pytest.approx(THREE_LAYERS_TRANSMITTANCE, abs=error)
    assert answer.specular == pytest.approx(THREE_LAYERS_SPECULAR, abs=5e-8)


@sizes
@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99])
def test_half_space_of_chandrasekhar(alpha, photons):
    tally = simulate(half_space(alpha), GRID, photons // (1 if photons == MANY else 2), seed=32)
    assert is_met(tally.diffuse_reflectance, exact.reflectance(alpha))
    assert is_met(tally.diffuse_reflectance, HALF_SPACES[alpha], rounding=5e-7)
    # Negative control: with 5 % less absorption it is not met.
    assert not is_met(tally.diffuse_reflectance, exact.reflectance(1 - 0.95 * (1 - alpha)))
