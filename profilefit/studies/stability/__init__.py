"""Where laws, maps, samplers, conversions, the exact solution and fits fail: every cell with its cause and remedy."""
