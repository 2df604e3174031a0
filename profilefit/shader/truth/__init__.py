"""What the render should show, by float64 integrals that share no code with it."""
