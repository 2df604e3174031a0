"""Run on Dask workers: python on_a_cluster.py tcp://host:8786 [photons]."""

import sys

from mcml_sim import Grid, Setting, simulate_orders

address = sys.argv[1]
photons = int(float(sys.argv[2])) if len(sys.argv) > 2 else 1_000_000_000
light = simulate_orders(
    Grid(dr=0.05, nr=400),  # annuli [1 / (mu_s + mu_a)]
    photons,
    setting=Setting("diffuse", n=1.4),
    store="skin.photons",  # finished batches; the same command resumes
    scheduler=address,
)
found = light.reflectance(0.9)
print(f"A {found.value:.6f} ± {found.standard_error:.6f} from {light.photons} photons")
