"""Set before the first test module is imported: figures are drawn to files, never to a screen."""

import os

os.environ["MPLBACKEND"] = "Agg"
