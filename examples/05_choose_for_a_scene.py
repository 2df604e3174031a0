"""Choose the cheapest scattering technique within the tolerance and budget of a scene.

python examples/05_choose_for_a_scene.py [skin.toml]
"""

import sys
from pathlib import Path

from profilefit.studies.choose import choose, read, shipped

scene = read(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "skin.toml")
choice = choose(scene, shipped())  # with costs measured for this release

one = choice.chosen
if one is None:
    print("no option meets both")
else:
    print(f"{one.option.label}: error {one.error.total:.3g}, {one.frame.least:.2g} to {one.frame.most:.2g} ms")
