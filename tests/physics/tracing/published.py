"""Numbers that others have published, with where they stand. Shares of the incident light [-]."""

from mcml_sim import Layer, Medium

# van de Hulst, Multiple Light Scattering (Academic Press, 1980), table 35: a slab of optical thickness 2, albedo .9,
# Henyey-Greenstein g = .75, matched indices; in cm as MCML's manual has it (Wang & Jacques 1992, table 5.1).
VAN_DE_HULST_SLAB = Medium((Layer(n=1.0, mu_a=10.0, mu_s=90.0, g=0.75, thickness=0.02),))
VAN_DE_HULST_REFLECTANCE, VAN_DE_HULST_TRANSMITTANCE = 0.09739, 0.66096
"""Total; the transmittance includes the unscattered e^-2. Half a unit of the last digit is 5e-6."""
VAN_DE_HULST_ROUNDING = 5e-6
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
THREE_LAYERS_ROUNDING_BY_LAYER = 5e-5
THREE_LAYERS_TRANSMITTANCE_OF_RAN3 = 0.096355
