"""A run in shares: python share.py 3 16 traces the fourth of sixteen shares; without arguments all are read."""

import sys

from mcml_sim import Grid, Setting, simulate_orders, trace_share

RUN = {
    "grid": Grid(dr=0.05, nr=400),  # rings [mfp]
    "photons": 1_000_000_000,
    "setting": Setting("diffuse", n=1.4),
    "store": "shares.photons",  # one folder that all jobs see
}
if len(sys.argv) == 3:
    print(trace_share(int(sys.argv[1]), int(sys.argv[2]), **RUN), "batches traced")
else:
    light = simulate_orders(**RUN)
    print(light.reflectance(0.9))
