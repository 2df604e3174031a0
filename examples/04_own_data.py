"""Your own data: fit a medium to a measured profile, with 95 % intervals.

python examples/04_own_data.py [phantom.csv]
"""

import sys
from pathlib import Path

from profilefit.measured import fit

data = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "phantom.csv"
result = fit(data, seed=0)

for name in ("A", "alpha", "l", "mu_s'", "mu_a"):
    interval = result.interval(name)
    print(f"{name:6} {result.value(name):.4g}, 95 % in {interval[0]:.4g} ... {interval[1]:.4g}")
