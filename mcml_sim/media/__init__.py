"""Media: layers, their surfaces and phase functions, the light that falls on them, and grids of bins."""
