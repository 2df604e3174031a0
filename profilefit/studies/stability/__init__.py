"""Failures of laws, maps, samplers, stacks, conversions, exact light and fits: every cell, and what helps."""
