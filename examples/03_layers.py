"""Layers: trace light through two layers of skin, with a standard error for each annulus.

python examples/03_layers.py
"""

from mcml_sim import Grid, Layer, Medium, simulate

epidermis = Layer(n=1.4, mu_a=0.3, mu_s=5.0, g=0.8, thickness=0.1)  # coefficients in 1/mm, thickness in mm
dermis = Layer(n=1.4, mu_a=0.03, mu_s=10.0, g=0.9, thickness=2.0)
grid = Grid(dr=0.25, nr=8)
tally = simulate(Medium((epidermis, dermis)), grid, photons=50_000, seed=1)

for name in ("specular_reflectance", "diffuse_reflectance", "absorbed", "transmittance"):
    one = tally.quantity(name)
    print(f"{name:21} {one.value:.4f} ± {one.standard_error:.4f}")
profile = tally.reflectance_r
for r, value, error in zip(grid.r_edges, profile.value, profile.standard_error, strict=False):
    print(f"from {r:4.2f} mm: R_d = {value:.4f} ± {error:.4f} per mm²")
