"""Stacks of layers: their files, the fit of their law, its records."""
