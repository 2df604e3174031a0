"""Where laws, maps, samplers, stacks, conversions, exact light and fits fail: every cell with its cause and remedy."""
