"""Profile and colour: red, green and blue light that leaves skin at each distance from its entry.

python examples/01_profile_and_colour.py
"""

import numpy as np

import profilefit
from mcml_sim import Setting

light = Setting("diffuse", n=1.4)  # diffuse illumination of skin
colour = np.array([0.65, 0.40, 0.30])  # total reflectance of red, green, blue [-]
mfp = np.array([1.2, 0.8, 0.55])  # transport mean free path [mm]

alpha = profilefit.albedo_law("rational", setting=light).alpha(colour)
law = profilefit.load("hazard", setting=light)

print("reduced albedo:", *(f"{one:.4f}" for one in alpha))
print(" r [mm]   R_d [1/mm²]: red, green, blue    share within r")
for r in (0.1, 0.3, 1.0, 3.0):
    profile, within = law.profile(r, alpha, mfp=mfp), law.cdf(r, alpha, mfp=mfp)
    print(f"{r:7.1f}  ", *(f"{one:10.3e}" for one in profile), "  ", *(f"{one:6.3f}" for one in within))
