"""Light that fades along a row as e^-kx, x from 0 to 1 over the picture."""

import numpy as np


def mean_light(k, start, end):
    """Mean of e^-kx over x in [start, end]."""
    return (np.exp(-k * np.asarray(start)) - np.exp(-k * np.asarray(end))) / (k * (np.asarray(end) - np.asarray(start)))
