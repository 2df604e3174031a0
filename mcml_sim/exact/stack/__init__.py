"""Stacks of layers: `solution` has what users call, `fluence` the equation, on the nodes of `quadrature`."""
