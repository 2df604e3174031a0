"""Photographs of a laser spot: exposures, a bracket as one picture, rings about the spot, and the medium behind it."""
