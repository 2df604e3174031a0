"""Trace the fourth of 16 shares: python share.py 3 16. Without arguments, read all."""

import sys

from mcml_sim import Grid, Setting, simulate_orders, trace_share

RUN = {
    "grid": Grid(dr=0.05, nr=400),  # annuli [1 / (mu_s + mu_a)]
    "photons": 1_000_000_000,
    "setting": Setting("diffuse", n=1.4),
    "store": "shares.photons",  # a folder that all jobs see
}
if len(sys.argv) == 3:
    print(trace_share(int(sys.argv[1]), int(sys.argv[2]), **RUN), "batches traced")
else:
    light = simulate_orders(**RUN)
    print(light.reflectance(0.9))
