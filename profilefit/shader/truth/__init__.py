"""What the render should show: float64 integrals that share the G-buffer with it, and no sum."""
